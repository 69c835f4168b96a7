//! The program `sinew`, with the agents that come with it.

fn main() -> std::process::ExitCode {
    sinew::program(sinew::runtime::Registry::default())
}

//! The program `sinew`, with the agents that come with it.

/// It counts who takes memory, so that a summary can tell of real-time steps that do.
#[global_allocator]
static MEMORY: sinew::runtime::Watched = sinew::runtime::Watched::SYSTEM;

fn main() -> std::process::ExitCode {
    sinew::program(sinew::runtime::Registry::default())
}

//! Tries the program out.
fn main() -> std::process::ExitCode {
    program::program(runtime::Registry::default())
}

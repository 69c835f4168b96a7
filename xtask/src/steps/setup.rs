//! The programs that steps need beside cargo; what is missing is installed where that is the custom, else told.

use std::collections::BTreeSet;
use std::path::Path;

use super::Done;
use crate::failure::Failure;
use crate::tool::Tool;

/// A program that a step needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Need {
    /// A C compiler; it links, and builds the compressor of the logs.
    Compiler,
    Rustfmt,
    Clippy,
    /// Python 3 that can make a virtual environment.
    PythonVenv,
}

impl Need {
    fn is_met(self) -> bool {
        let works = |program: &str, args: &[&str]| Tool::new(program, Path::new(".")).args(args).works();
        match self {
            Need::Compiler => works("cc", &["--version"]),
            Need::Rustfmt => Tool::cargo(Path::new(".")).args(["fmt", "--version"]).works(),
            Need::Clippy => Tool::cargo(Path::new(".")).args(["clippy", "--version"]).works(),
            Need::PythonVenv => works("python3", &["-c", "import ensurepip, venv"]),
        }
    }

    /// Its name, and how it is installed.
    fn source(self) -> (&'static str, Source) {
        match self {
            Need::Compiler => ("a C compiler", Source::Debian(&["gcc", "libc6-dev"])),
            Need::Rustfmt => ("rustfmt", Source::Rustup("rustfmt")),
            Need::Clippy => ("clippy", Source::Rustup("clippy")),
            Need::PythonVenv => ("python3 with venv", Source::Debian(&["python3", "python3-venv"])),
        }
    }
}

enum Source {
    Debian(&'static [&'static str]),
    Rustup(&'static str),
}

/// Looks for all that is needed.
pub(super) fn run<'a>(needs: impl Iterator<Item = &'a Need>) -> Result<Done, Failure> {
    let needs: BTreeSet<Need> = needs.copied().collect();
    for need in needs {
        let (name, source) = need.source();
        if need.is_met() {
            println!("  {name}: there");
            continue;
        }
        install(name, &source)?;
        if !need.is_met() {
            return Err(Failure::new(
                format!("{name} was installed but does not work"),
                "Does the path lead to it?",
            ));
        }
    }
    Ok(Done::Passed(String::new()))
}

/// Only root on Debian, or a toolchain kept by rustup, is changed unasked; anybody else is told what to do.
fn install(name: &str, source: &Source) -> Result<(), Failure> {
    let here = Path::new(".");
    match source {
        Source::Rustup(component) if Tool::new("rustup", here).args(["--version"]).works() => {
            Tool::new("rustup", here).args(["component", "add", component]).run("rustup cannot add it.")
        }
        Source::Debian(packages) if Path::new("/etc/debian_version").exists() && is_root() => {
            let remedy = format!("apt-get cannot install {name}.");
            Tool::new("apt-get", here).args(["update", "-qq"]).run(&remedy)?;
            let words = ["install", "-y", "-qq", "--no-install-recommends"];
            Tool::new("apt-get", here)
                .env("DEBIAN_FRONTEND", "noninteractive")
                .args(words)
                .args(*packages)
                .run(&remedy)
        }
        Source::Rustup(component) => Err(Failure::new(
            format!("{name} is missing"),
            format!("Install it, as with: rustup component add {component}"),
        )),
        Source::Debian(packages) => Err(Failure::new(
            format!("{name} is missing"),
            format!("Install it, as with: sudo apt-get install {}", packages.join(" ")),
        )),
    }
}

fn is_root() -> bool {
    let output = std::process::Command::new("id").arg("-u").output();
    output.is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

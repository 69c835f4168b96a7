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
    /// A C++ compiler; the fuzzer itself is written in it.
    CppCompiler,
    Rustfmt,
    Clippy,
    /// Python 3 that can make a virtual environment.
    PythonVenv,
    /// The library with which bindings to C are made.
    Libclang,
}

impl Need {
    fn is_met(self) -> bool {
        let works = |program: &str, args: &[&str]| Tool::new(program, Path::new(".")).args(args).works();
        match self {
            Need::Compiler => works("cc", &["--version"]),
            Need::CppCompiler => works("c++", &["--version"]),
            Need::Rustfmt => Tool::cargo(Path::new(".")).args(["fmt", "--version"]).works(),
            Need::Clippy => Tool::cargo(Path::new(".")).args(["clippy", "--version"]).works(),
            Need::PythonVenv => works("python3", &["-c", "import ensurepip, venv"]),
            Need::Libclang => {
                std::env::var_os("LIBCLANG_PATH").is_some()
                    || LIBRARIES.iter().any(|folder| has_libclang(folder))
            }
        }
    }

    /// Its name, and how it is installed.
    fn source(self) -> (&'static str, Source) {
        match self {
            Need::Compiler => ("a C compiler", Source::Debian(&["gcc", "libc6-dev"])),
            Need::CppCompiler => ("a C++ compiler", Source::Debian(&["g++"])),
            Need::Rustfmt => ("rustfmt", Source::Rustup("rustfmt")),
            Need::Clippy => ("clippy", Source::Rustup("clippy")),
            Need::PythonVenv => ("python3 with venv", Source::Debian(&["python3", "python3-venv"])),
            Need::Libclang => ("libclang", Source::Debian(&["libclang-dev"])),
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
    needs.into_iter().try_for_each(provide)?;
    Ok(Done::Passed(String::new()))
}

/// Sees to it that something is there, or says how to get it.
pub(crate) fn provide(need: Need) -> Result<(), Failure> {
    let (name, source) = need.source();
    if need.is_met() {
        println!("  {name}: there");
        return Ok(());
    }
    install(name, &source)?;
    if need.is_met() {
        return Ok(());
    }
    Err(Failure::new(format!("{name} was installed but does not work"), "Does the path lead to it?"))
}

/// Where libraries lie; a folder may stand for all that begin like it.
const LIBRARIES: [&str; 5] = ["/usr/lib", "/usr/lib64", "/usr/local/lib", "/usr/lib/*", "/usr/lib/*/lib"];

/// Whether one of the folders holds libclang itself; its relative for C++ (`libclang-cpp`) does not do.
fn has_libclang(folder: &str) -> bool {
    let Some((above, below)) = folder.split_once("/*") else { return holds_libclang(Path::new(folder)) };
    let Ok(entries) = std::fs::read_dir(above) else { return false };
    entries.flatten().any(|entry| holds_libclang(&entry.path().join(below.trim_start_matches('/'))))
}

fn holds_libclang(folder: &Path) -> bool {
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| is_libclang(&entry.file_name().to_string_lossy()))
}

/// `libclang.so`, `libclang.so.1`, `libclang-14.so`, …
fn is_libclang(name: &str) -> bool {
    let rest = name
        .strip_prefix("libclang")
        .map(|rest| rest.trim_start_matches(|c: char| c == '-' || c == '.' || c.is_ascii_digit()));
    rest.is_some_and(|rest| rest == "so" || rest.starts_with("so."))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libclang_is_known_by_its_names_and_not_taken_for_its_relatives() {
        for name in
            ["libclang.so", "libclang.so.1", "libclang-14.so", "libclang-14.so.14.0.6", "libclang-14.0.6.so"]
        {
            assert!(is_libclang(name), "{name}");
        }
        for name in ["libclang-cpp.so.14", "libclangAST.a", "libclang.a", "libc.so", "liblldb.so"] {
            assert!(!is_libclang(name), "{name}");
        }
    }
}

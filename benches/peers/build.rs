//! Hands the versions of what is measured to the program, and to copper's macros where they may keep their index of texts.

use std::process::Command;

/// The packages that are measured, and the variable with their version.
const MEASURED: [(&str, &str); 6] = [
    ("cu29", "VERSION_CU29"),
    ("rtrb", "VERSION_RTRB"),
    ("crossbeam-channel", "VERSION_CROSSBEAM"),
    ("flume", "VERSION_FLUME"),
    ("tokio", "VERSION_TOKIO"),
    ("iceoryx2", "VERSION_ICEORYX2"),
];

fn main() {
    cu29_build::setup();
    println!("cargo::rerun-if-changed=Cargo.lock");
    let lock = std::fs::read_to_string("Cargo.lock").unwrap_or_default();
    for (package, variable) in MEASURED {
        println!("cargo::rustc-env={variable}={}", locked(&lock, package).unwrap_or("unknown"));
    }
    println!("cargo::rustc-env=VERSION_RUST={}", compiler().unwrap_or_else(|| "unknown".to_owned()));
}

/// The newest version of a package in a lock file, where older ones stand first.
fn locked<'a>(lock: &'a str, package: &str) -> Option<&'a str> {
    let name = format!("name = \"{package}\"");
    let mut lines = lock.lines();
    let mut version = None;
    while let Some(line) = lines.next() {
        if line == name {
            version = lines.next()?.strip_prefix("version = \"")?.strip_suffix('"');
        }
    }
    version
}

/// `1.95.0` of `rustc 1.95.0 (…)`.
fn compiler() -> Option<String> {
    let output = Command::new(std::env::var_os("RUSTC")?).arg("--version").output().ok()?;
    Some(String::from_utf8_lossy(&output.stdout).split_whitespace().nth(1)?.to_owned())
}

//! The threads of the runtime under ThreadSanitizer, which sees accesses to memory that no order makes safe; and those in real time under
//! another one, see [`realtime`].
//!
//! The standard library is built with it too: what its locks and channels order would else look like a race. Fences alone it does not see.
//! The runtime has one pair of them, `sync::light_barrier` and `sync::heavy_barrier`, which loom looks at; no access is ordered by these
//! alone, so each report counts.

use std::path::Path;

use super::cargo::tests_run;
use super::{Done, realtime};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// What the compiler must be told. By `tsan` the runtime knows that it may not take real-time priorities.
const FLAGS: &str = "-Zsanitizer=thread --cfg tsan";
/// The standard library, with what unwinds and what runs tests.
const LIBRARY: &str = "-Zbuild-std=std,panic_unwind,test";
/// By this file in the folder of a compiler cargo knows that the source of the standard library is there.
const SOURCE: &str = "lib/rustlib/src/rust/library/Cargo.lock";
const REMEDY: &str = "Where a race was seen, both accesses, the memory and the threads stand above. It is one even where it never did harm.";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let nightly = || Tool::new("rustup", &workspace.root).args(["run", "nightly"]);
    let skipped = |why: &str| Ok(Done::Skipped(why.to_owned()));
    if !nightly().args(["rustc", "--version"]).works() {
        return skipped("sanitizers need a nightly compiler: rustup toolchain install nightly");
    }
    let compiler = nightly().args(["rustc", "--print", "sysroot"]).text(REMEDY)?;
    if !Path::new(compiler.trim()).join(SOURCE).is_file() {
        return skipped(
            "ThreadSanitizer needs the source of the standard library: rustup component add rust-src --toolchain nightly",
        );
    }
    // The quicker one first.
    let blocked = realtime::run(workspace, &nightly)?;
    println!("  {blocked} tests and a robot without a call that blocks in real time");
    let words = ["cargo", "test", "--quiet", "--no-fail-fast", LIBRARY, "--target", &workspace.host];
    let tests = nightly().args(words).args(["-p", "sinew-runtime", "--lib", "--tests"]);
    let tests = tests.args(["--", "--test-threads=1"]).flags("RUSTFLAGS", FLAGS);
    let tests = tests.env("CARGO_TARGET_DIR", workspace.target.join("sanitize"));
    // A program in which there was a race ends as one that failed, when all its tests are done.
    let ran = tests_run(&tests.text(REMEDY)?);
    if ran == 0 {
        return Err(Failure::new("no test was run", REMEDY));
    }
    Ok(Done::Passed(format!(
        "{ran} tests without a race, {blocked} and a robot without a call that blocks in real time"
    )))
}

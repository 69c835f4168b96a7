//! Steps that are a call of cargo.

use super::Done;
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

fn passed() -> Result<Done, Failure> {
    Ok(Done::Passed(String::new()))
}

pub(super) fn format(workspace: &Workspace) -> Result<Done, Failure> {
    let cargo = Tool::cargo(&workspace.root).args(["fmt", "--all", "--", "--check", "-l"]);
    cargo.run("`cargo fmt --all` puts it right.")?;
    let words = ["fmt", "--manifest-path", "fuzz/Cargo.toml", "--", "--check", "-l"];
    Tool::cargo(&workspace.root)
        .args(words)
        .run("`cargo fmt --manifest-path fuzz/Cargo.toml` puts it right.")?;
    passed()
}

pub(super) fn clippy(workspace: &Workspace) -> Result<Done, Failure> {
    let words = ["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"];
    Tool::cargo(&workspace.root).args(words).run(
        "Do what clippy says. Where it is wrong, allow the lint at that place with a reason; general exceptions stand in Cargo.toml.",
    )?;
    passed()
}

pub(super) fn unit(workspace: &Workspace) -> Result<Done, Failure> {
    Tool::cargo(&workspace.root).args(["test", "--quiet", "--workspace"]).run(
        "One test alone: cargo test -p PACKAGE NAME. A property that failed has written its case into proptest-regressions; keep that file.",
    )?;
    passed()
}

/// With its own build folder: the flag changes every crate, and would spoil the usual one.
pub(super) fn loom(workspace: &Workspace) -> Result<Done, Failure> {
    let words =
        ["test", "--quiet", "--release", "-p", "sinew-runtime", "-p", "sinew-hardware", "--lib", "model::"];
    let cargo = Tool::cargo(&workspace.root).args(words).flags("RUSTFLAGS", "--cfg loom");
    let cargo = cargo.env("CARGO_TARGET_DIR", workspace.target.join("loom"));
    let text = cargo.text("Loom found an order of events that breaks a ring, a memory or the latch. LOOM_LOG=1 with the same command prints it.")?;
    print!("{text}");
    let ran: u64 = tests_run(&text);
    if ran == 0 {
        return Err(Failure::new(
            "no model was run",
            "The models are the modules named `model` in crates/runtime/src and crates/hardware/src.",
        ));
    }
    Ok(Done::Passed(format!("{ran} models")))
}

/// The sum of the numbers in lines like `test result: ok. 7 passed; 0 failed`.
pub(super) fn tests_run(text: &str) -> u64 {
    let counts = text
        .lines()
        .filter_map(|line| line.split(" passed;").next()?.rsplit(' ').next()?.parse::<u64>().ok());
    counts.sum()
}

pub(super) fn docs(workspace: &Workspace) -> Result<Done, Failure> {
    let cargo = Tool::cargo(&workspace.root).args(["doc", "--quiet", "--workspace", "--no-deps"]);
    cargo.flags("RUSTDOCFLAGS", "-D warnings").run("Mend the documentation that rustdoc names.")?;
    passed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_are_counted_over_all_binaries() {
        let text = "running 2 tests\n..\ntest result: ok. 2 passed; 0 failed; 0 ignored\n\ntest result: ok. 5 passed; 0 failed";
        assert_eq!(tests_run(text), 7);
        assert_eq!(tests_run("test result: ok. 0 passed; 0 failed"), 0);
    }
}

//! A fresh agent, as a user would begin one: it builds, its test passes, it runs.

use std::path::{Path, PathBuf};

use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// What the fresh agent is called.
const NAME: &str = "patrol";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let folder = workspace.fresh_scratch("new-agent")?;
    Tool::new(&program, &folder)
        .args(["new", "agent", NAME])
        .run("`sinew new agent` must end well in an empty folder.")?;
    let package = folder.join(NAME);
    // What is locked here need not be chosen and fetched again.
    std::fs::copy(workspace.root.join("Cargo.lock"), package.join("Cargo.lock")).map_err(|error| {
        Failure::new(format!("{}: {error}", package.display()), "Did `sinew new agent` make this folder?")
    })?;
    // The usual build folder is shared, so that all crates below are there already.
    let cargo = |words: &[&str]| Tool::cargo(&package).env("CARGO_TARGET_DIR", &workspace.target).args(words);
    let remedy = "What `sinew new agent` writes does not build or hold; its templates lie in crates/program.";
    cargo(&["test", "--quiet"]).run(remedy)?;
    let system = system_file(&package)
        .ok_or_else(|| Failure::new("there is no system file beside the new agent", remedy))?;
    let out = workspace.scratch("new-agent/out");
    let tool =
        cargo(&["run", "--quiet", "--", "run"]).arg(&system).args(["--no-log", "--json", "--out"]).arg(out);
    let document = sinew::document(tool, remedy)?;
    if document["goal"]["met"] != true || document["collisions"] != 0 {
        let what = format!(
            "the new system does not reach its goal: {}; {} collisions",
            document["goal"]["why"], document["collisions"]
        );
        return Err(Failure::new(what, remedy));
    }
    Ok(Done::Passed(String::new()))
}

/// The first TOML file of the package that is not cargo's.
fn system_file(package: &Path) -> Option<PathBuf> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(package).ok()?.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "toml") && !path.ends_with("Cargo.toml"));
    files.sort();
    files.into_iter().next()
}

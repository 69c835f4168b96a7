//! The program `sinew` as the steps use it: built once, in release.

use std::path::PathBuf;

use serde_json::Value;

use crate::failure::Failure;
use crate::tool::{Tool, end_of};
use crate::workspace::Workspace;

/// Names a program that was built already, in some other way.
const PROGRAM: &str = "SINEW_PROGRAM";

/// Builds the program and says where it is.
pub(super) fn build(workspace: &Workspace) -> Result<PathBuf, Failure> {
    if let Some(program) = std::env::var_os(PROGRAM) {
        return Ok(PathBuf::from(program));
    }
    let cargo = Tool::cargo(&workspace.root).args(["build", "--quiet", "--release", "-p", "sinew-cli"]);
    cargo.run("The program does not build.")?;
    Ok(workspace.target.join("release").join("sinew"))
}

/// Runs the program with `--json`. Codes 0 (done) and 1 (goal not met) come with a document; anything else is a failure.
pub(super) fn document(tool: Tool, remedy: &str) -> Result<Value, Failure> {
    let (line, output) = tool.output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let failed = |what: String| Failure::new(format!("{line}\n        {what}\n{}", end_of(&text)), remedy);
    if !matches!(output.status.code(), Some(0 | 1)) {
        return Err(failed(output.status.to_string()));
    }
    let document: Value =
        serde_json::from_str(&text).map_err(|error| failed(format!("no JSON document: {error}")))?;
    match document.get("error").or_else(|| document.get("errors")) {
        Some(_) => Err(failed("it answers with an error".to_owned())),
        None => Ok(document),
    }
}

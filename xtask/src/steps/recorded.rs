//! Recordings of real robots, played to the agents. The recordings are no part of the repository.

use std::path::{Path, PathBuf};

use serde_json::Value;

use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// Folders of recordings, and how their files end.
const KINDS: [(&str, [&str; 2]); 2] = [("carmen", [".log", ".log.gz"]), ("ticks", [".dat", ".dat.gz"])];

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let data = workspace.data();
    let files: Vec<PathBuf> =
        KINDS.iter().flat_map(|(folder, ends)| recordings(&data.join(folder), ends)).collect();
    if files.is_empty() {
        return Ok(Done::Skipped(format!(
            "no recordings in {}; SINEW_DATA names another folder",
            data.display()
        )));
    }
    let program = sinew::build(workspace)?;
    let out = workspace.fresh_scratch("recorded")?;
    for file in &files {
        let name = file.file_name().unwrap_or_default();
        let tool =
            Tool::new(&program, &workspace.root).args(["run", "recorded", "--no-log", "--json", "--from"]);
        let remedy = "A recording must play to its end; bad lines are counted, not fatal.";
        let document = sinew::document(tool.arg(file).arg("--out").arg(out.join(name)), remedy)?;
        if !heard(&document) {
            return Err(Failure::new(format!("{}: no scan was played", file.display()), remedy));
        }
    }
    Ok(Done::Passed(format!("{} recordings", files.len())))
}

/// Whether a robot of the run gave a scan of its recording.
fn heard(document: &Value) -> bool {
    let robots = document["robots"].as_array();
    robots.is_some_and(|robots| robots.iter().any(|robot| robot["recording"]["scans"].as_u64() > Some(0)))
}

fn recordings(folder: &Path, ends: &[&str]) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    files.retain(|path| ends.iter().any(|end| path.to_string_lossy().ends_with(end)));
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_recording_without_scans_was_not_played() {
        assert!(heard(&json!({"robots": [{"recording": {"scans": 3}}]})));
        for silent in [json!({}), json!({"robots": [{}]}), json!({"robots": [{"recording": {"scans": 0}}]})] {
            assert!(!heard(&silent), "{silent}");
        }
    }
}

//! Where things are: the clone, its build folder, the recordings.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::failure::Failure;

/// Recordings of real robots, beside the clone unless `SINEW_DATA` names another folder.
const DATA: &str = "../shared/data";

/// The clone in which this program was built.
pub(crate) struct Workspace {
    /// The root of the clone.
    pub(crate) root: PathBuf,
    /// Where cargo builds.
    pub(crate) target: PathBuf,
    /// What `cargo metadata` says.
    pub(crate) metadata: Value,
}

impl Workspace {
    pub(crate) fn find() -> Result<Workspace, Failure> {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = here.parent().unwrap_or(here).to_owned();
        let metadata = metadata(&root)?;
        let target = match metadata["target_directory"].as_str() {
            Some(folder) => PathBuf::from(folder),
            None => root.join("target"),
        };
        Ok(Workspace { root, target, metadata })
    }

    /// A folder for what the steps make.
    pub(crate) fn scratch(&self, name: &str) -> PathBuf {
        self.target.join("xtask").join(name)
    }

    /// A folder for what a step makes, empty.
    pub(crate) fn fresh_scratch(&self, name: &str) -> Result<PathBuf, Failure> {
        let folder = self.scratch(name);
        let failed = |error: std::io::Error| {
            Failure::new(
                format!("{}: {error}", folder.display()),
                "Remove this folder by hand and try again.",
            )
        };
        if folder.exists() {
            std::fs::remove_dir_all(&folder).map_err(failed)?;
        }
        std::fs::create_dir_all(&folder).map_err(failed)?;
        Ok(folder)
    }

    /// The recordings of real robots; they are no part of the repository.
    pub(crate) fn data(&self) -> PathBuf {
        match std::env::var_os("SINEW_DATA") {
            Some(folder) => PathBuf::from(folder),
            None => self.root.join(DATA),
        }
    }
}

/// Only the packages for this kind of machine, so that cargo need not fetch those for others.
fn metadata(root: &Path) -> Result<Value, Failure> {
    let remedy = "Cargo cannot read the workspace: `cargo metadata` says why.";
    let failed = |what: String| Failure::new(what, remedy);
    let text = |program: &str, args: &[&str]| {
        let output = Command::new(program).args(args).current_dir(root).output();
        let output = output.map_err(|error| failed(format!("{program}: {error}")))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        Err(failed(format!("{program} {}\n{}", args.join(" "), String::from_utf8_lossy(&output.stderr))))
    };
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    let about = text(&rustc, &["-vV"])?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or_else(|| failed(format!("rustc names no host:\n{about}")))?;
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let json = text(&cargo, &["metadata", "--format-version", "1", "--filter-platform", host])?;
    serde_json::from_str(&json).map_err(|error| failed(format!("cargo metadata: {error}")))
}

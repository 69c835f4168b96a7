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
    /// The kind of this machine, as rustc names it.
    pub(crate) host: String,
    /// What `cargo metadata` says.
    pub(crate) metadata: Value,
}

impl Workspace {
    pub(crate) fn find() -> Result<Workspace, Failure> {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = here.parent().unwrap_or(here).to_owned();
        let host = host(&root)?;
        let metadata = metadata(&root, &host)?;
        let target = match metadata["target_directory"].as_str() {
            Some(folder) => PathBuf::from(folder),
            None => root.join("target"),
        };
        Ok(Workspace { root, target, host, metadata })
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

const REMEDY: &str = "Cargo cannot read the workspace: `cargo metadata` says why.";

fn host(root: &Path) -> Result<String, Failure> {
    let about = text(&std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into()), &["-vV"], root)?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| Failure::new(format!("rustc names no host:\n{about}"), REMEDY))
}

/// Only the packages for this kind of machine, so that cargo need not fetch those for others.
fn metadata(root: &Path, host: &str) -> Result<Value, Failure> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let json = text(&cargo, &["metadata", "--format-version", "1", "--filter-platform", host], root)?;
    serde_json::from_str(&json).map_err(|error| Failure::new(format!("cargo metadata: {error}"), REMEDY))
}

fn text(program: &str, args: &[&str], root: &Path) -> Result<String, Failure> {
    let failed = |what: String| Failure::new(what, REMEDY);
    let output = Command::new(program).args(args).current_dir(root).output();
    let output = output.map_err(|error| failed(format!("{program}: {error}")))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    Err(failed(format!("{program} {}\n{}", args.join(" "), String::from_utf8_lossy(&output.stderr))))
}

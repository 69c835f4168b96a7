//! A run of the program that goes on while a step asks it for things.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use crate::failure::Failure;
use crate::tool::end_of;

/// A run with a run folder of its own.
pub(super) struct Running {
    program: PathBuf,
    folder: PathBuf,
    child: Child,
    remedy: String,
}

impl Running {
    /// Starts `sinew run` with these words; what it says and writes goes to `folder`.
    pub(super) fn start(
        program: &Path,
        folder: &Path,
        words: &[&str],
        remedy: &str,
    ) -> Result<Running, Failure> {
        let failed = |what: String| Failure::new(what, remedy);
        let own = folder.join("run");
        std::fs::create_dir_all(&own).map_err(|error| failed(format!("{}: {error}", own.display())))?;
        private(&own).map_err(|error| failed(format!("{}: {error}", own.display())))?;
        let said = |name: &str| {
            std::fs::File::create(folder.join(name)).map_err(|error| failed(format!("{name}: {error}")))
        };
        println!("  $ sinew run {} &", words.join(" "));
        let mut command = Command::new(program);
        command.arg("run").args(words).args(["--json", "--out"]).arg(folder.join("out"));
        command.env("XDG_RUNTIME_DIR", &own).stdin(Stdio::null());
        command.stdout(said("said.json")?).stderr(said("told.txt")?);
        let child = command.spawn().map_err(|error| failed(format!("{}: {error}", program.display())))?;
        let mut running = Running {
            program: program.to_owned(),
            folder: folder.to_owned(),
            child,
            remedy: remedy.to_owned(),
        };
        // It answers a little after it was started.
        for _ in 0..500 {
            if running.ask(&["ls"]) {
                return Ok(running);
            }
            if running.has_ended() {
                break;
            }
            std::thread::park_timeout(Duration::from_millis(10));
        }
        let told = std::fs::read_to_string(running.folder.join("told.txt")).unwrap_or_default();
        Err(failed(format!("the run does not answer\n{}", end_of(&told))))
    }

    pub(super) fn pid(&self) -> u32 {
        self.child.id()
    }

    fn has_ended(&mut self) -> bool {
        !matches!(self.child.try_wait(), Ok(None))
    }

    /// Asks by the command line; whether it was done.
    pub(super) fn ask(&self, words: &[&str]) -> bool {
        let mut command = Command::new(&self.program);
        command.args(words).env("XDG_RUNTIME_DIR", self.folder.join("run")).stdin(Stdio::null());
        command.stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok_and(|status| status.success())
    }

    /// Sends a signal.
    pub(super) fn signal(&self, name: &str) -> bool {
        let pid = self.pid().to_string();
        Command::new("kill").args(["-s", name, &pid]).status().is_ok_and(|status| status.success())
    }

    /// Waits for the end and reads the summary.
    pub(super) fn end(mut self) -> Result<Value, Failure> {
        let status =
            self.child.wait().map_err(|error| Failure::new(error.to_string(), self.remedy.clone()))?;
        let text = std::fs::read_to_string(self.folder.join("said.json")).unwrap_or_default();
        let told = std::fs::read_to_string(self.folder.join("told.txt")).unwrap_or_default();
        serde_json::from_str(&text).map_err(|error| {
            Failure::new(
                format!("the run ended with {status}: {error}\n{}", end_of(&told)),
                self.remedy.clone(),
            )
        })
    }

    /// Where its log is.
    pub(super) fn log(folder: &Path) -> PathBuf {
        folder.join("out").join("run.mcap")
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // One that has ended cannot be killed, which is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(unix)]
fn private(folder: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt as _;
    std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o700))
}

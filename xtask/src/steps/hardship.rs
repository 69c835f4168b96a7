//! A full disk, a terminal that is gone, clients that do not keep to the protocol: the robot goes on all the same.

use std::io::{Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::live::Running;
use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

const REMEDY: &str = "Nothing that happens around a run may reach the robot. The same command by hand, with --json, shows what became of it.";
/// What is run, and for how long.
const RUN: [&str; 6] = ["run", "exploration", "--seed", "4", "--for", "20s"];

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let scratch = workspace.fresh_scratch("hardship")?;
    let usual = scratch.join("usual");
    let tool = Tool::new(&program, &workspace.root).args(RUN).args(["--json", "--out"]).arg(&usual);
    let document = sinew::document(tool, REMEDY)?;
    let scene = Scene { workspace, program, scratch, usual: usual.join("run.mcap"), document };
    let lost = scene.full_disk()?;
    scene.closed_output()?;
    let terminal = scene.closed_terminal()?;
    scene.rude_clients()?;
    let terminal = if terminal { "a closed terminal, " } else { "" };
    Ok(Done::Passed(format!(
        "a full disk ({lost} messages lost and told), closed output, {terminal}rude clients"
    )))
}

/// What all of it is held against.
struct Scene<'a> {
    workspace: &'a Workspace,
    program: PathBuf,
    scratch: PathBuf,
    usual: PathBuf,
    document: Value,
}

impl Scene<'_> {
    fn failed(what: impl Into<String>) -> Failure {
        Failure::new(what, REMEDY)
    }

    /// The log ends when no more can be written, the run does not.
    fn full_disk(&self) -> Result<u64, Failure> {
        let out = self.scratch.join("full");
        // A limit on the length of files is a disk that is full after a megabyte; it takes no right to make one.
        let line = "ulimit -f 2048; exec \"$0\" \"$@\"";
        let tool = Tool::new("sh", &self.workspace.root).args(["-c", line]).arg(&self.program).args(RUN);
        let document = sinew::document(tool.args(["--json", "--out"]).arg(&out), REMEDY)?;
        let lost = went_on(&document, &self.document).map_err(Self::failed)?;
        let info =
            Tool::new(&self.program, &self.workspace.root).args(["log", "info"]).arg(out.join("run.mcap"));
        info.args(["--json"]).text(REMEDY)?;
        Ok(lost)
    }

    /// Nobody reads what the program says.
    fn closed_output(&self) -> Result<(), Failure> {
        let out = self.scratch.join("closed");
        let mut command = Command::new(&self.program);
        command.current_dir(&self.workspace.root).args(RUN).arg("--out").arg(&out).stdin(Stdio::null());
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| Self::failed(error.to_string()))?;
        drop((child.stdout.take(), child.stderr.take()));
        let status = child.wait().map_err(|error| Self::failed(error.to_string()))?;
        if !matches!(status.code(), Some(0 | 1)) {
            return Err(Self::failed(format!("with its output closed the run ended with {status}")));
        }
        self.same(&out.join("run.mcap"), "with its output closed")
    }

    /// The terminal on which it draws is closed. Told of it by a signal it stops the robot and ends in order; where somebody had that
    /// signal ignored, it goes on to its end.
    fn closed_terminal(&self) -> Result<bool, Failure> {
        let script = self.workspace.root.join("xtask/src/steps/terminal.py");
        if !Tool::new("python3", &self.workspace.root).args(["-c", "import pty"]).works() {
            return Ok(false);
        }
        for (folder, told) in [("hangup", "told"), ("nohup", "untold")] {
            let out = self.scratch.join(folder);
            let tool =
                Tool::new("python3", &self.workspace.root).arg(&script).args([told]).arg(&self.program);
            let words = ["--speed", "20", "--clock", "sim", "--out"];
            tool.args(RUN).args(words).arg(&out).run(REMEDY)?;
            let log = out.join("run.mcap");
            if told == "untold" {
                self.same(&log, "with its terminal closed")?;
                continue;
            }
            let info = Tool::new(&self.program, &self.workspace.root)
                .args(["log", "info"])
                .arg(&log)
                .args(["--json"]);
            let info = sinew::document(info, REMEDY)?;
            if info["whole"] != true {
                return Err(Self::failed(format!("with its terminal closed the log was not ended: {info}")));
            }
        }
        Ok(true)
    }

    /// Garbage, half a line, a line of 100 MB, questions whose answers nobody reads.
    fn rude_clients(&self) -> Result<(), Failure> {
        let folder = self.scratch.join("rude");
        let words = ["exploration", "--seed", "4", "--for", "20s", "--speed", "4"];
        let running = Running::start(&self.program, &folder, &words, REMEDY)?;
        let socket = folder.join("run/sinew/exploration.sock");
        let failed = |error: std::io::Error| Self::failed(format!("{}: {error}", socket.display()));
        let client = || UnixStream::connect(&socket).map_err(failed);
        let _half = {
            let mut half = client()?;
            half.write_all(b"{\"id\":1,\"do\":[\"l").map_err(failed)?;
            half
        };
        std::thread::scope(|scope| {
            scope.spawn(|| client().map(garbage));
            scope.spawn(|| client().map(long_line));
            let deaf = scope.spawn(|| client().map(never_reads));
            let answers = (0..20).filter(|_| running.ask(&["ls"])).count();
            drop(deaf.join());
            if answers == 20 {
                Ok(())
            } else {
                Err(Self::failed(format!("{answers} of 20 questions were answered beside rude clients")))
            }
        })?;
        running.end()?;
        self.same(&Running::log(&folder), "beside rude clients")
    }

    fn same(&self, log: &Path, when: &str) -> Result<(), Failure> {
        let bytes = |path: &Path| {
            std::fs::read(path).map_err(|error| Self::failed(format!("{}: {error}", path.display())))
        };
        if bytes(log)? == bytes(&self.usual)? {
            Ok(())
        } else {
            Err(Self::failed(format!("{when} the run went another way")))
        }
    }
}

fn garbage(mut client: UnixStream) {
    // The client is cut at some time, which is what it gets for it.
    for number in 0..2000u32 {
        let line: Vec<u8> =
            (0..200u32).map(|i| (number.wrapping_mul(2_654_435_761) >> (i % 24)) as u8).collect();
        if client.write_all(&line).and_then(|()| client.write_all(b"\n")).is_err() {
            return;
        }
    }
}

fn long_line(mut client: UnixStream) {
    let part = vec![b'a'; 1 << 20];
    for _ in 0..100 {
        if client.write_all(&part).is_err() {
            break;
        }
    }
    let _ = client.read(&mut [0; 64]);
}

/// Listens to much and asks again and again, and never reads a byte. What it listens to is heard anyway: an output that works for listeners
/// only would come into the log by it.
fn never_reads(mut client: UnixStream) {
    let _ = client.set_write_timeout(Some(Duration::from_millis(200)));
    for port in ["h1.image", "h1.gyro", "odometry.odometry", "sonar.raw"] {
        let line = format!("{{\"id\":1,\"do\":[\"tap\",\"{port}\"]}}\n");
        if client.write_all(line.as_bytes()).is_err() {
            return;
        }
    }
    while client.write_all(b"{\"id\":2,\"do\":[\"graph\"]}\n").is_ok() {}
}

/// Whether a run without room for its log went the usual way and says what was lost; how much that was.
fn went_on(full: &Value, usual: &Value) -> Result<u64, String> {
    for key in ["time_s", "distance_m", "collisions", "messages", "goal"] {
        if full[key] != usual[key] {
            return Err(format!("with a full disk {key} is {}, else {}", full[key], usual[key]));
        }
    }
    match (full["log"]["lost"].as_u64(), full["log"]["errors"].as_array()) {
        (Some(lost), Some(errors)) if lost > 0 && !errors.is_empty() => Ok(lost),
        _ => Err(format!("with a full disk the summary says of the log only {}", full["log"])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_a_full_disk_costs_must_be_told_and_must_be_all() {
        let run = |time: f64, lost: u64, errors: &[&str]| json!({"time_s": time, "log": {"lost": lost, "errors": errors}});
        let usual = run(20.0, 0, &[]);
        assert_eq!(went_on(&run(20.0, 7, &["no room"]), &usual), Ok(7));
        assert!(went_on(&run(3.0, 7, &["no room"]), &usual).unwrap_err().contains("time_s"));
        assert!(went_on(&run(20.0, 0, &["no room"]), &usual).is_err());
        assert!(went_on(&run(20.0, 7, &[]), &usual).is_err());
    }
}

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
/// The same on the wall clock; the disk is full after a second or two.
const RUN_ON_THE_WALL: [&str; 8] = ["run", "exploration", "--seed", "4", "--clock", "wall", "--for", "5s"];
const WALL_SECONDS: f64 = 4.9;

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let scratch = workspace.fresh_scratch("hardship")?;
    let usual = scratch.join("usual");
    let tool = Tool::new(&program, &workspace.root).args(RUN).args(["--json", "--out"]).arg(&usual);
    let document = sinew::document(tool, REMEDY)?;
    let scene = Scene { workspace, program, scratch, usual: usual.join("run.mcap"), document };
    let cut = scene.limited_file()?;
    let full = scene.full_disk()?;
    scene.closed_output()?;
    let terminal = scene.closed_terminal()?;
    scene.rude_clients()?;
    let terminal = if terminal { "a closed terminal, " } else { "" };
    let disk = match full {
        Some(lost) => format!("a full disk ({lost} messages lost and told)"),
        None => format!(
            "no full disk, since none may be mounted here; in its place a limit on files ({cut} messages lost and told)"
        ),
    };
    Ok(Done::Passed(format!("{disk}, closed output, {terminal}rude clients")))
}

/// How `unshare` is told to give a program mounts of its own, where that is permitted: as root, or as one who is root to himself.
fn apart() -> Option<&'static [&'static str]> {
    let ways: [&[&str]; 2] = [&["--mount"], &["--map-root-user", "--mount"]];
    let permitted = |way: &&&[&str]| {
        let script = "mount -t tmpfs -o size=64k sinew-hardship /tmp";
        Tool::new("unshare", Path::new(".")).args(**way).args(["sh", "-c", script]).works()
    };
    ways.iter().find(permitted).copied()
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

    /// A limit on the length of files: the log ends when no more can be written, the run does not. It takes no right to set one.
    fn limited_file(&self) -> Result<u64, Failure> {
        let out = self.scratch.join("limited");
        let line = "ulimit -f 2048; exec \"$0\" \"$@\"";
        let tool = Tool::new("sh", &self.workspace.root).args(["-c", line]).arg(&self.program).args(RUN);
        let document = sinew::document(tool.args(["--json", "--out"]).arg(&out), REMEDY)?;
        let lost = went_on(&document, &self.document).map_err(Self::failed)?;
        let info =
            Tool::new(&self.program, &self.workspace.root).args(["log", "info"]).arg(out.join("run.mcap"));
        info.args(["--json"]).text(REMEDY)?;
        Ok(lost)
    }

    /// A disk of half a megabyte, in simulated time, where all goes the usual way, and on the wall clock. Nothing where none may be mounted.
    fn full_disk(&self) -> Result<Option<u64>, Failure> {
        let Some(apart) = apart() else {
            println!(
                "  a full disk: no file system may be mounted here (unshare and mount), so there is none"
            );
            return Ok(None);
        };
        let document = self.on_full_disk(apart, "full", &RUN)?;
        let lost = went_on(&document, &self.document).map_err(Self::failed)?;
        let document = self.on_full_disk(apart, "full-wall", &RUN_ON_THE_WALL)?;
        let lasted = document["time_s"].as_f64().is_some_and(|time| time >= WALL_SECONDS);
        if !lasted || document["collisions"] != 0 || document["log"]["lost"] == 0 {
            return Err(Self::failed(format!("with a full disk a run on the wall clock gave {document}")));
        }
        Ok(Some(lost))
    }

    /// A run on a disk that nobody else sees, which is gone with the run. What was on it when it was full is told of, and mended.
    fn on_full_disk(&self, apart: &[&str], name: &str, words: &[&str]) -> Result<Value, Failure> {
        let (disk, kept) = (self.scratch.join(name), self.scratch.join(format!("{name}-kept")));
        for folder in [&disk, &kept] {
            std::fs::create_dir_all(folder)
                .map_err(|error| Self::failed(format!("{}: {error}", folder.display())))?;
        }
        let script = self.workspace.root.join("xtask/src/steps/small_disk.sh");
        let tool = Tool::new("unshare", &self.workspace.root).args(apart).arg("sh").arg(script);
        let tool = tool.arg(&disk).arg(&kept).arg(&self.program).args(words).arg("--json");
        let document = sinew::document(tool, REMEDY)?;
        let told = kept.join("told.txt");
        let told = std::fs::read_to_string(&told)
            .map_err(|error| Self::failed(format!("{}: {error}", told.display())))?;
        says_what_where_and_how(&told, &disk.join("out/run.mcap")).map_err(Self::failed)?;
        let (cut, whole) = (kept.join("run.mcap"), kept.join("whole.mcap"));
        let log = |words: [&str; 2]| Tool::new(&self.program, &self.workspace.root).args(words);
        let mended =
            sinew::document(log(["log", "repair"]).arg(&cut).arg("--out").arg(&whole).arg("--json"), REMEDY)?;
        let info = sinew::document(log(["log", "info"]).arg(&whole).arg("--json"), REMEDY)?;
        let written = &document["log"]["messages"];
        if written == 0
            || mended["messages"] != *written
            || info["messages"] != *written
            || info["whole"] != true
        {
            let what = format!(
                "the run wrote {written} messages to the full disk, mended are {mended}, read {info}"
            );
            return Err(Self::failed(what));
        }
        Ok(document)
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

/// Whether a run said once that its disk is full, where, and what can be done.
fn says_what_where_and_how(told: &str, log: &Path) -> Result<(), String> {
    let place = log.display().to_string();
    let lines: Vec<&str> = told.lines().filter(|line| line.contains("the log ends here")).collect();
    match lines[..] {
        [line] if line.contains(&place) && line.contains("sinew log repair") && line.contains("--out") => {
            Ok(())
        }
        [line] => Err(format!("of a full disk it is not said where it is ({place}) and what to do: {line}")),
        _ => Err(format!("a full disk is told {} times, and not once:\n{told}", lines.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_full_disk_is_told_once_with_its_place_and_a_remedy() {
        let log = Path::new("/d/run.mcap");
        let line = "warning: /d/run.mcap: the log ends here: No space left on device; `sinew log repair /d/run.mcap`, or --out";
        assert_eq!(says_what_where_and_how(&format!("begin\n{line}\n"), log), Ok(()));
        assert!(says_what_where_and_how(&format!("{line}\n{line}"), log).unwrap_err().contains("2 times"));
        assert!(says_what_where_and_how("", log).unwrap_err().contains("0 times"));
        assert!(says_what_where_and_how(line, Path::new("/e/run.mcap")).unwrap_err().contains("where"));
    }

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

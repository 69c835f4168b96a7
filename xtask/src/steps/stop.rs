//! The emergency stop and the signals, while every processor is busy in real time.

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::live::Running;
use super::{Done, sinew};
use crate::failure::Failure;
use crate::workspace::Workspace;

const REMEDY: &str = "Stop must win: from another process and by a signal, whoever else is busy. Gates run at 90, the thread that takes signals too.";
/// The priority of those who are busy: that of the executor of ordinary control.
const BUSY: &str = "60";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let scratch = workspace.fresh_scratch("stop")?;
    let mut real_time = true;
    for how in ["stop", "INT", "HUP"] {
        let folder = scratch.join(how);
        let words = ["exploration", "--clock", "wall", "--for", "20s", "--no-log"];
        let running = Running::start(&program, &folder, &words, REMEDY)?;
        // It drives within this time; how long the machine takes to let others run is not asked.
        std::thread::park_timeout(Duration::from_millis(1000));
        let busy = Busy::start();
        real_time &= busy.real_time;
        let done = match how {
            // What is busy leaves ordinary processes the twentieth part that the kernel keeps for them.
            "stop" => running.ask(&["stop", "test"]) && running.signal("TERM"),
            signal => running.signal(signal),
        };
        // A signal does its work while they are busy; to write the summary down needs them gone.
        std::thread::park_timeout(Duration::from_millis(300));
        drop(busy);
        judge(&running.end()?, done).map_err(|what| Failure::new(format!("{how}: {what}"), REMEDY))?;
    }
    let how = if real_time { "in real time" } else { "as ordinary threads, without the right to more" };
    Ok(Done::Passed(format!("stop and two signals with all processors busy {how}")))
}

/// One busy process for each processor, in real time where that is allowed.
struct Busy {
    children: Vec<Child>,
    real_time: bool,
}

impl Busy {
    fn start() -> Busy {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let line = "while :; do :; done";
        let allowed = Command::new("chrt").args(["-f", BUSY, "true"]).stderr(Stdio::null()).status();
        let real_time = allowed.is_ok_and(|status| status.success());
        let start = |_| {
            let mut command = Command::new(if real_time { "timeout" } else { "sh" });
            // Should this program die, they end by themselves.
            let words: &[&str] =
                if real_time { &["20", "chrt", "-f", BUSY, "sh", "-c", line] } else { &["-c", line] };
            command.args(words).spawn().ok()
        };
        Busy { children: (0..processors).filter_map(start).collect(), real_time }
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        for child in &mut self.children {
            // `timeout` passes the signal on to what it runs.
            let _ = Command::new("kill").arg(child.id().to_string()).status();
            let _ = child.wait();
        }
    }
}

fn judge(document: &Value, done: bool) -> Result<(), String> {
    if !done {
        return Err("it was not done".into());
    }
    if document["robots"][0]["latched"] != true {
        return Err("the latch is not set".into());
    }
    match document["ended"].as_str() {
        Some("interrupted") => Ok(()),
        other => Err(format!("the run ended because {other:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_run_that_only_ends_was_not_stopped() {
        let run = |latched: bool, ended: &str| json!({"ended": ended, "robots": [{"latched": latched}]});
        assert_eq!(judge(&run(true, "interrupted"), true), Ok(()));
        assert!(judge(&run(true, "interrupted"), false).is_err());
        assert!(judge(&run(false, "interrupted"), true).unwrap_err().contains("latch"));
        assert!(judge(&run(true, "the time is over"), true).unwrap_err().contains("time is over"));
    }
}

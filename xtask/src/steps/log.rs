//! The log of a run, opened by a reader that was made elsewhere.

use std::path::PathBuf;

use serde_json::Value;

use super::{Done, sinew};
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// The readers, from PyPI.
const READERS: [&str; 2] = ["mcap==1.6.0", "mcap-ros2-support==0.6.0"];

/// What a robot's run always says, in the types of ROS 2.
const TYPES: [&str; 3] = ["nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "tf2_msgs/msg/TFMessage"];

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let program = sinew::build(workspace)?;
    let folder = workspace.fresh_scratch("log")?;
    let log = folder.join("exploration.mcap");
    let words = ["run", "exploration", "--seed", "1", "--for", "30s", "--json", "--log"];
    let tool =
        Tool::new(&program, &workspace.root).args(words).arg(&log).arg("--out").arg(folder.join("figures"));
    sinew::document(tool, "The run must end well, whether or not its goal is met in this time.")?;
    let python = readers(workspace)?;
    let script = workspace.root.join("crates/record/tests/independent_reader.py");
    let remedy = "The readers of the field cannot open our log, or find it damaged.";
    let report = Tool::new(python, &workspace.root).arg(script).arg(&log).text(remedy)?;
    let report: Value = serde_json::from_str(&report)
        .map_err(|error| Failure::new(format!("the reader's report: {error}"), remedy))?;
    let messages = judge(&report).map_err(|what| Failure::new(what, remedy))?;
    Ok(Done::Passed(format!("{messages} messages decoded")))
}

/// A virtual environment with the readers; made once.
fn readers(workspace: &Workspace) -> Result<PathBuf, Failure> {
    let python = workspace.scratch("venv/bin/python");
    let words = ["-c", "import mcap.reader, mcap_ros2.decoder"];
    if !Tool::new(&python, &workspace.root).args(words).works() {
        let venv = workspace.fresh_scratch("venv")?;
        Tool::new("python3", &workspace.root)
            .args(["-m", "venv"])
            .arg(venv)
            .run("Python cannot make a virtual environment.")?;
        let pip = Tool::new(&python, &workspace.root).args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ]);
        pip.args(READERS).run("The readers come from PyPI: is there a network?")?;
    }
    Ok(python)
}

/// How many messages the reader decoded, if it found what every run says.
fn judge(report: &Value) -> Result<u64, String> {
    if report["profile"] != "ros2" {
        return Err(format!("the log's profile is {}, not \"ros2\"", report["profile"]));
    }
    let topics = report["topics"].as_array().ok_or("the reader's report has no topics")?;
    for wanted in TYPES {
        if !topics.iter().any(|topic| topic["type"] == wanted) {
            return Err(format!("no topic of the log is a {wanted}"));
        }
    }
    report["messages"]
        .as_u64()
        .filter(|count| *count > 0)
        .ok_or_else(|| "the log holds no message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_log_without_odometry_or_of_another_profile_is_refused() {
        let topics: Vec<Value> = TYPES.iter().map(|name| json!({"type": name})).collect();
        let good = json!({"profile": "ros2", "messages": 12, "topics": topics});
        assert_eq!(judge(&good), Ok(12));
        assert!(judge(&json!({"profile": "x", "messages": 12, "topics": topics})).is_err());
        assert!(
            judge(&json!({"profile": "ros2", "messages": 12, "topics": topics[1..]}))
                .unwrap_err()
                .contains("Odometry")
        );
        assert!(judge(&json!({"profile": "ros2", "messages": 0, "topics": topics})).is_err());
    }
}

//! The reactive layer: what is asked of it in the scenario `reactive`, hundreds of goals by the pose of the localizer alone, and a robot among
//! people.

use serde_json::Value;

use super::live::Running;
use super::sinew;
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// How the tasks of the scenario end, in their order. The second goal lies behind a crate, and it goes there straight; the thirteenth drives
/// against a step that no sensor sees, and the latch ends it.
const ENDS: [&str; 17] = [
    "arrived",
    "unreachable",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
    "halted",
    "arrived",
    "arrived",
    "arrived",
    "arrived",
];
/// The figures of its parts.
const FIGURES: [&str; 9] =
    ["goto", "goto-avoid", "move", "turns", "soft-stop", "path", "hard-stop", "wall", "dock"];
/// The one that docks.
const DOCK: u64 = 17;
/// So far from their places robots may truly be when they tell that they have arrived (m).
const OFF: f64 = 0.02;
/// The same in a dock (m, rad).
const OFF_DOCK: (f64, f64) = (0.01, 0.01);
const GOALS: usize = 300;
/// How many places it comes to among people, at least: ten minutes, and most are reached within one.
const AMONG_PEOPLE: usize = 4;

/// Runs both; says what was seen.
pub(super) fn run(workspace: &Workspace, program: &std::path::Path) -> Result<String, Failure> {
    let out = workspace.fresh_scratch("reactive")?;
    let words = ["run", "reactive", "--json", "--out"];
    let all = sinew::document(Tool::new(program, &workspace.root).args(words).arg(&out), REMEDY)?;
    parts(&all).map_err(|what| Failure::new(format!("reactive: {what}"), REMEDY))?;
    if let Some(name) = FIGURES.iter().find(|name| !out.join(format!("{name}.png")).is_file()) {
        return Err(Failure::new(format!("reactive: there is no figure {name}.png"), REMEDY));
    }
    calls(workspace, program)?;
    let out = workspace.fresh_scratch("goals")?;
    let random = format!("agent.tour.random={GOALS}");
    let words = ["run", "goals", "--set", &random, "--for", "135min", "--json", "--out"];
    let goals = sinew::document(Tool::new(program, &workspace.root).args(words).arg(&out), REMEDY)?;
    let most = all_reached(&goals).map_err(|what| Failure::new(format!("goals: {what}"), REMEDY))?;
    // Logs of hundreds of megabytes.
    let _ = std::fs::remove_dir_all(&out);
    let out = workspace.fresh_scratch("crowd")?;
    let words = ["run", "crowd", "--for", "10min", "--json", "--out"];
    let crowd = sinew::document(Tool::new(program, &workspace.root).args(words).arg(&out), REMEDY)?;
    let places = among_people(&crowd).map_err(|what| Failure::new(format!("crowd: {what}"), REMEDY))?;
    let _ = std::fs::remove_dir_all(&out);
    Ok(format!(
        "reactive, {GOALS} goals at most {:.0} mm off, {places} places among people without a collision",
        most * 1e3
    ))
}

/// What people ask of a robot that runs, on the command line.
fn calls(workspace: &Workspace, program: &std::path::Path) -> Result<(), Failure> {
    let folder = workspace.fresh_scratch("calls")?;
    let words = ["reactive", "--clock", "wall", "--for", "60s", "--no-log"];
    let running = Running::start(program, &folder, &words, REMEDY)?;
    let asked: [(&[&str], bool); 11] = [
        (&["call", "navigation.go", "x=3", "y=3"], true),
        (&["call", "navigation.go", "xx=3"], false),
        (&["call", "navigation.come", "x=3"], false),
        (&["call", "world.add", "name=wall", "x=6", "y=1", "length=0.2", "width=1"], true),
        (&["call", "navigation.go", "x=2", "y=6", "heading=1.57", "dock=true"], true),
        (&["call", "navigation.wall", "side=left", "distance=0.8", "seconds=5"], true),
        (&["call", "hand.drive", "angular=0.2", "seconds=1"], true),
        (&["call", "hand.release"], true),
        (&["call", "processes.change", "name=idle"], true),
        (&["graph"], true),
        (&["quit"], true),
    ];
    let wrong = asked.iter().find(|(words, expected)| running.ask(words) != *expected);
    running.end()?;
    match wrong {
        None => Ok(()),
        Some((words, expected)) => {
            let what = if *expected { "was refused" } else { "was not refused" };
            Err(Failure::new(format!("reactive: \"sinew {}\" {what}", words.join(" ")), REMEDY))
        }
    }
}

const REMEDY: &str = "Look at it: cargo run --release -- run reactive, run goals, and run crowd; their figures lie in the folders that the summaries name.";

fn tasks(run: &Value) -> Result<&Vec<Value>, String> {
    run["tasks"].as_array().ok_or_else(|| "the document has no \"tasks\"".to_owned())
}

fn parts(run: &Value) -> Result<(), String> {
    let tasks = tasks(run)?;
    for (i, expected) in ENDS.iter().enumerate() {
        let number = i as u64 + 1;
        let task = tasks.iter().find(|task| task["task"] == number);
        let Some(task) = task else { return Err(format!("task {number} did not end")) };
        if task["ended"] != *expected {
            return Err(format!("task {number} ended {}, not \"{expected}\": {task}", task["ended"]));
        }
        let off = task["off_m"].as_f64().unwrap_or(0.0);
        let most = if number == DOCK { OFF_DOCK.0 } else { OFF };
        if *expected == "arrived" && off > most {
            return Err(format!("task {number} arrived {off} m off"));
        }
        let turned = task["off_rad"].as_f64().unwrap_or(0.0);
        if number == DOCK && turned > OFF_DOCK.1 {
            return Err(format!("task {number} docked {turned} rad off"));
        }
    }
    // The step, once; nothing else.
    if run["collisions"] != 1 {
        return Err(format!("{} collisions, and one is asked for", run["collisions"]));
    }
    Ok(())
}

/// The most that a robot was off.
fn all_reached(run: &Value) -> Result<f64, String> {
    let tasks = tasks(run)?;
    if tasks.len() != GOALS {
        return Err(format!("{} of {GOALS} tasks ended", tasks.len()));
    }
    let mut most = 0.0_f64;
    for task in tasks {
        let off = task["off_m"].as_f64().unwrap_or(f64::INFINITY);
        if task["ended"] != "arrived" || off > OFF {
            return Err(format!("not reached within {OFF} m: {task}"));
        }
        most = most.max(off);
    }
    match run["collisions"].as_u64() {
        Some(0) => Ok(most),
        _ => Err(format!("collisions: {}", run["collisions"])),
    }
}

/// To how many places it came without driving into anybody.
fn among_people(run: &Value) -> Result<usize, String> {
    let places = tasks(run)?.iter().filter(|task| task["ended"] == "arrived").count();
    match run["collisions"].as_u64() {
        Some(0) if places >= AMONG_PEOPLE => Ok(places),
        Some(0) => Err(format!("it came to {places} places, and {AMONG_PEOPLE} are asked for")),
        _ => Err(format!("collisions: {}", run["collisions"])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn task(number: usize, ended: &str, off: f64) -> Value {
        json!({"task": number, "ended": ended, "off_m": off})
    }

    #[test]
    fn a_part_that_ends_otherwise_is_named() {
        let mut tasks: Vec<Value> = (0..).zip(ENDS).map(|(i, ended)| task(i + 1, ended, 0.009)).collect();
        let run = |tasks: &[Value], collisions: u64| json!({"tasks": tasks, "collisions": collisions});
        assert_eq!(parts(&run(&tasks, 1)), Ok(()));
        assert!(parts(&run(&tasks, 2)).unwrap_err().contains("2 collisions"));
        assert!(parts(&run(&tasks[..13], 1)).unwrap_err().contains("task 14"));
        tasks[16]["off_rad"] = json!(0.02);
        assert!(parts(&run(&tasks, 1)).unwrap_err().contains("docked 0.02 rad off"));
        tasks[16] = task(17, "arrived", 0.011);
        assert!(parts(&run(&tasks, 1)).unwrap_err().contains("task 17 arrived 0.011 m off"));
        tasks[3] = task(4, "arrived", 0.3);
        assert!(parts(&run(&tasks, 1)).unwrap_err().contains("task 4 arrived 0.3 m off"));
        tasks[2] = task(3, "timed out", 0.0);
        assert!(parts(&run(&tasks, 1)).unwrap_err().contains("task 3 ended \"timed out\""));
    }

    #[test]
    fn a_goal_that_is_missed_is_named() {
        let mut tasks: Vec<Value> = (1..=GOALS).map(|i| task(i, "arrived", 0.011)).collect();
        let run = |tasks: &[Value]| json!({"tasks": tasks, "collisions": 0});
        assert_eq!(all_reached(&run(&tasks)), Ok(0.011));
        assert!(all_reached(&run(&tasks[1..])).unwrap_err().contains("299 of 300"));
        tasks[7] = task(8, "arrived", 0.021);
        assert!(all_reached(&run(&tasks)).unwrap_err().contains("0.021"));
    }

    #[test]
    fn among_people_it_gets_on_and_drives_into_nobody() {
        let tasks: Vec<Value> = (1..=5).map(|i| task(i, "arrived", 0.3)).collect();
        let run = |tasks: &[Value], collisions: u64| json!({"tasks": tasks, "collisions": collisions});
        assert_eq!(among_people(&run(&tasks, 0)), Ok(5));
        assert!(among_people(&run(&tasks, 1)).unwrap_err().contains("collisions: 1"));
        assert!(among_people(&run(&tasks[2..], 0)).unwrap_err().contains("to 3 places"));
    }
}

//! Wrong system files and what is said of them. Each `mistakes/NAME.toml` has its messages in `mistakes/NAME.txt`; with
//! `BLESS=1` in the environment the messages are written instead of compared, to be read aloud before they are kept.

use std::fs;
use std::path::Path;

use program::{Failure, Paint, file};

use crate::registry;

/// Files that are parts of others.
const PARTS: [&str; 3] = ["part", "own_name", "floor_part"];
/// A file whose mistake is told where it is to be run: see below.
const TO_BE_RUN: &str = "untriggered";

#[test]
fn wrong_files_are_told_what_is_wrong() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mistakes");
    let bless = std::env::var_os("BLESS").is_some();
    let mut names: Vec<String> = fs::read_dir(&folder)
        .unwrap()
        .filter_map(|entry| {
            entry.unwrap().file_name().to_str().unwrap().strip_suffix(".toml").map(str::to_owned)
        })
        .filter(|name| !PARTS.contains(&name.as_str()) && name != TO_BE_RUN)
        .collect();
    names.sort();
    assert!(names.len() >= 12, "{names:?}");
    let mut wrong = Vec::new();
    for name in names {
        let text = fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
        let shown = format!("{name}.toml");
        let said = match file::read(&text, &shown, Some(&folder), &[], &registry()) {
            Ok(_) => "no mistake\n".to_owned(),
            Err(mistakes) => Failure::from(mistakes).to_text(Paint::Plain),
        };
        let said = said.replace(&format!("{}/", folder.display()), "");
        let golden = folder.join(format!("{name}.txt"));
        if bless {
            fs::write(&golden, &said).unwrap();
        } else if fs::read_to_string(&golden).unwrap_or_default() != said {
            wrong.push(format!("{name}: now it says\n{said}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_agent_to_whose_trigger_no_wire_leads_is_told_where_a_system_is_to_run() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mistakes").join(TO_BE_RUN);
    let file = path.with_extension("toml");
    let mistakes = file::load(file.to_str().unwrap(), &[], &registry()).unwrap_err();
    let said =
        Failure::from(mistakes).to_text(Paint::Plain).replace(file.to_str().unwrap(), "untriggered.toml");
    assert_eq!(said, fs::read_to_string(path.with_extension("txt")).unwrap());
    // What a run of some agents left of a plan has fewer wires, and is read all the same.
    let mut some = file::load("exploration", &[], &registry()).unwrap().plan;
    some.only(&["wall".to_owned(), "safety".to_owned()]).unwrap();
    assert!(file::read_plan(&file::write_plan(&some), "exploration", &registry()).is_ok());
}

#[test]
fn a_change_on_the_command_line_is_shown_where_it_was_typed() {
    let sets = ["agent.wall.keep=far".to_owned(), "agent.sonra.deadline=1ms".to_owned()];
    let mistakes = file::load("exploration", &sets, &registry()).unwrap_err();
    let wanted = "\
error: there is no agent \"sonra\"
 --> --set:1:1
1 | agent.sonra.deadline=1ms
  | ^^^^^^^^^^^^^^^^^^^^
  = help: did you mean \"sonar\"?
";
    let said = Failure::from(mistakes).to_text(Paint::Plain);
    assert!(said.contains(wanted), "{said}");
    assert!(
        said.contains("error: \"keep\" must be a number, not a text (\"far\")\n --> --set:1:17\n"),
        "{said}"
    );
}

#[test]
fn a_draw_of_what_a_robot_has_not_is_told_at_the_draw_before_anything_runs() {
    let said = |draw: &str| {
        let sets = [format!("vary.{draw}={{ uniform = [0.9, 1.1] }}")];
        match file::check("exploration", &sets, &registry()) {
            Ok(_) => String::new(),
            Err(mistakes) => Failure::from(mistakes).to_text(Paint::Plain),
        }
    };
    assert_eq!(said("robot.h1.drive.right_scale"), "");
    let wanted = "\
error: there is no entry in \"drive\" \"lefft_scale\"
 --> --set:1:1
1 | vary.robot.h1.drive.lefft_scale={ uniform = [0.9, 1.1] }
  | ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^
  = help: did you mean \"left_scale\"?
";
    assert_eq!(said("robot.h1.drive.lefft_scale"), wanted);
    assert!(said("world.ligth").contains("--> --set:1:1"), "{}", said("world.ligth"));
    assert!(said("robot.h7.drive.left_scale").contains("did you mean \"h1\"?"));
}

#[test]
fn a_file_that_is_not_there_is_said_with_what_there_is() {
    let mistakes = file::load("exploraton", &[], &registry()).unwrap_err();
    let said = Failure::from(mistakes).to_text(Paint::Plain);
    let wanted =
        "error: there is no system file or scenario \"exploraton\"\n = help: did you mean \"exploration\"?\n";
    assert_eq!(said, wanted);
}

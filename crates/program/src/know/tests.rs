//! Whole commands as they are typed, and what is answered.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use clap::Parser;
use types::Time;

use super::{Answer, KnowArgs, answer};
use crate::error::{Failure, Paint};

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    know: KnowArgs,
}

/// A folder with a knowledge base, gone after the test.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Folder {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("sinew-know-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        Folder(folder)
    }

    /// Writes a file and gives its path.
    fn with(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.0.join(name);
        fs::write(&path, bytes).unwrap();
        path.display().to_string()
    }

    fn say(&self, words: &[&str]) -> Result<Answer, Failure> {
        let file = self.0.join("knowledge.db").display().to_string();
        let line = ["know", "--file", &file].into_iter().chain(words.iter().copied());
        answer(&Line::try_parse_from(line).unwrap().know, Time(1_500_000_000))
    }

    /// The answer for people; the folder is left out.
    fn text(&self, words: &[&str]) -> String {
        self.short(&self.say(words).unwrap().text)
    }

    /// The failure for people and its exit code.
    fn failure(&self, words: &[&str]) -> (String, u8) {
        let failure = self.say(words).unwrap_err();
        (self.short(&failure.to_text(Paint::Plain)), failure.code)
    }

    fn short(&self, text: &str) -> String {
        text.replace(&format!("{}/", self.0.display()), "")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

const TABLE: &str = "\"danger.near\" = { safety = 1.0, wall = 0.0 }\nfree = { safety = 0.0, wall = 1.0 }\n";

#[test]
fn a_table_goes_in_and_comes_out_as_it_was_written() {
    let folder = Folder::new();
    let file = folder.with("roaming.toml", TABLE.as_bytes());
    assert_eq!(
        folder.text(&["put", "table", "roaming", &file]),
        "knowledge.db: put table roaming, version 1"
    );
    assert_eq!(folder.text(&["get", "table", "roaming"]), TABLE);
    assert_eq!(
        folder.text(&["put", "table", "roaming", "--set", "free.wall=0.5", "--set", "target.seen.track=1.0"]),
        "knowledge.db: put table roaming, version 2"
    );
    let changed = TABLE.replace("wall = 1.0", "wall = 0.5") + "\"target.seen\" = { track = 1.0 }\n";
    assert_eq!(folder.text(&["get", "table", "roaming"]), changed);
    assert_eq!(folder.text(&["get", "table", "roaming", "--version", "1"]), TABLE);
    let history = folder.say(&["get", "table", "roaming", "--history"]).unwrap().json;
    assert_eq!(history["versions"][0]["weights"]["target.seen"]["track"], 1.0);
    assert_eq!(history["versions"][1]["version"], 1);
    let (said, code) = folder.failure(&["get", "table", "roaming", "--version", "7"]);
    assert_eq!((said.contains("it has: 2, 1"), code), (true, 1), "{said}");
}

#[test]
fn the_section_of_a_system_file_is_a_table() {
    let folder = Folder::new();
    let file = folder.with("system.toml", b"name = \"x\"\n[decide]\ndanger.near = { safety = 1.0 }\n");
    folder.text(&["put", "table", "roaming", &file]);
    assert_eq!(folder.text(&["get", "table", "roaming"]), "\"danger.near\" = { safety = 1.0 }\n");
}

#[test]
fn a_wrong_table_is_refused_whole_with_its_places_and_the_old_one_kept() {
    let folder = Folder::new();
    let good = folder.with("good.toml", TABLE.as_bytes());
    folder.text(&["put", "table", "roaming", &good]);
    let bad =
        folder.with("bad.toml", b"\"danger.neer\" = { safety = 1.0 }\nfree = { wall = 1.5 }\nnarrow = 3\n");
    let (said, code) = folder.failure(&["put", "table", "roaming", &bad]);
    assert_eq!(code, 2);
    assert_eq!(
        said,
        "error: there is no situation \"danger.neer\"
 --> bad.toml:1:1
1 | \"danger.neer\" = { safety = 1.0 }
  | ^^^^^^^^^^^^^
  = help: did you mean \"danger.near\"?

error: the weight of \"wall\" is 1.5, not a number from 0 to 1
 --> bad.toml:2:17
2 | free = { wall = 1.5 }
  |                 ^^^

error: \"narrow\" must be a table of weights
 --> bad.toml:3:10
3 | narrow = 3
  |          ^
  = help: as in { safety = 1.0, wall = 0.0 }

3 errors
"
    );
    for words in [
        &["put", "table", "roaming", "--set", "free.wall=2"][..],
        &["put", "table", "roaming", "--set", "free"],
        &["put", "table", "roaming", "missing.toml"],
        &["put", "table", "_", &good],
        &["put", "table", "roaming", &folder.with("empty.toml", b"")],
        &["put", "table", "roaming", &folder.with("noise.toml", b"\xff\xfe")],
    ] {
        assert_eq!(folder.failure(words).1, 2, "{words:?}");
    }
    assert_eq!(folder.say(&["get", "table", "roaming"]).unwrap().json["version"], 1);
    assert_eq!(folder.text(&["get", "table", "roaming"]), TABLE);
}

#[test]
fn facts_are_put_found_and_taken_back() {
    let folder = Folder::new();
    for words in [
        &["put", "fact", "cup", "in", "cupboard", "--confidence", "0.4", "--source", "camera"][..],
        &["put", "fact", "cupboard", "in", "kitchen"],
        &["put", "fact", "kitchen", "in", "house"],
        &["put", "fact", "floor", "level", "-1"],
    ] {
        folder.text(words);
    }
    assert_eq!(
        folder.text(&["query", "cup", "_", "_"]),
        "  cup  in  cupboard  0.4  camera  1970-01-01 00:00:01\n"
    );
    let house = folder.say(&["query", "_", "in", "house", "--in-depth"]).unwrap();
    assert_eq!(house.text, "  kitchen   1 step\n  cupboard  2 steps\n  cup       3 steps\n");
    assert_eq!(house.json["reached"][2]["name"], "cup");
    assert_eq!(folder.text(&["query", "cup", "in", "house", "--in-depth"]), "  house  3 steps\n");
    for (words, code) in [
        (&["query", "cup", "in", "house", "--in-depth", "--confidence", "0.5"][..], 1),
        (&["query", "house", "in", "cup", "--in-depth"], 1),
        (&["query", "*", "in", "*", "--confidence", "0.5", "--most", "9"], 0),
        (&["query", "spoon", "_", "_"], 1),
    ] {
        let answer = folder.say(words).unwrap();
        assert_eq!(answer.code, code, "{words:?}: {}", answer.text);
    }
    for words in [&["query", "_", "_", "house", "--in-depth"][..], &["query", "_", "in", "_", "--in-depth"]] {
        assert_eq!(folder.failure(words).1, 2, "{words:?}");
    }
    assert_eq!(
        folder.text(&["get", "fact", "floor", "level", "-1"]),
        "  floor  level  -1  1  -  1970-01-01 00:00:01\n"
    );
    assert_eq!(folder.text(&["remove", "fact", "_", "in", "_"]), "knowledge.db: removed 3 facts");
    assert_eq!(folder.failure(&["remove", "fact", "cup", "in", "_"]).1, 1);
    assert_eq!(folder.failure(&["remove", "fact", "cup"]).1, 2);
}

#[test]
fn patterns_and_maps_come_from_files_and_go_into_new_ones() {
    let folder = Folder::new();
    let picture = folder.with("hall.pgm", b"P5\n3 2\n255\n\x01\x02\x03\x04\x05\x06");
    folder.text(&["put", "map", "hall", &picture, "--resolution", "0.05", "--origin", "-1,2.5,0"]);
    folder.text(&["put", "pattern", "door", &picture, "--set", "width=0.9"]);
    folder.text(&["put", "pattern", "red", "--set", "hue=[5.9, 0.3]"]);
    let map = folder.text(&["get", "map", "hall"]);
    assert_eq!(map, "resolution = 0.05 # m\norigin = [-1, 2.5, 0] # m, m, rad\nwidth = 3\nheight = 2\n");
    let door = folder.say(&["get", "pattern", "door"]).unwrap().json;
    assert_eq!(
        (&door["media_type"], &door["parameters"]["width"]),
        (&"image/x-portable-graymap".into(), &0.9.into())
    );
    assert_eq!(folder.text(&["get", "pattern", "red"]), "kind = \"colour\"\nhue = [5.9, 0.3]\n");
    for kind in ["map hall", "pattern door"] {
        let out = folder.0.join(kind).display().to_string();
        let (kind, name) = kind.split_once(' ').unwrap();
        folder.text(&["get", kind, name, "--out", &out]);
        assert_eq!(fs::read(&out).unwrap(), fs::read(&picture).unwrap(), "{kind}");
        let (said, code) = folder.failure(&["get", kind, name, "--out", &out]);
        assert!(said.contains("cannot be written") && code == 2, "a file that is there stays: {said}");
    }
    for words in [
        &["put", "map", "hall", &picture, "--resolution", "0"][..],
        &["put", "map", "hall", &folder.with("map.txt", b"#####"), "--resolution", "1"],
        &["put", "pattern", "door", "--set", "width"],
        &["get", "fact", "a", "b", "c", "--out", "x"],
        &["get", "map", "hall", "--history"],
    ] {
        assert_eq!(folder.failure(words).1, 2, "{words:?}");
    }
    assert_eq!(folder.text(&["get", "map", "hall"]), map);
    let list = folder.text(&["list"]);
    assert_eq!(
        list,
        "  pattern  door  image, image/x-portable-graymap, 17 bytes
  pattern  red   colour
  map      hall  3 × 2 cells of 0.05 m\n"
    );
}

#[test]
fn schedules_are_checked_as_requests_are() {
    let folder = Folder::new();
    folder.text(&["put", "schedule", "nightly", "--cron", "0 3 * * *", "set", "wall", "keep=0.6"]);
    folder.text(&["put", "schedule", "often", "--every", "10min", "--at", "30s", "fault wall panic"]);
    folder.text(&["put", "schedule", "end", "--at", "1h", "stop"]);
    assert_eq!(
        folder.text(&["get", "schedule", "nightly"]),
        "cron = \"0 3 * * *\"\ndo = \"set wall keep=0.6\"\n"
    );
    let often = folder.say(&["get", "schedule", "often"]).unwrap().json;
    assert_eq!(often["when"], serde_json::json!({"every_s": 600.0, "at_s": 30.0}));
    assert_eq!(
        folder.text(&["list", "schedule"]),
        "  schedule  end      once at 3600s: stop
  schedule  nightly  cron 0 3 * * *: set wall keep=0.6
  schedule  often    every 600s from 30s: fault wall panic\n"
    );
    let (said, code) = folder.failure(&["put", "schedule", "bad", "--at", "1s", "falt", "wall", "panic"]);
    assert!(said.contains("did you mean \"fault\"?") && code == 2, "{said}");
    assert_eq!(folder.failure(&["put", "schedule", "bad", "--every", "5ms", "stop"]).1, 2);
}

#[test]
fn what_is_not_there_is_told_with_the_nearest_name_and_makes_no_file() {
    let folder = Folder::new();
    for words in [
        &["list"][..],
        &["get", "table", "roaming"],
        &["query", "_", "_", "_"],
        &["remove", "table", "roaming"],
        &["put", "fact", "a", "b", "_"],
    ] {
        let (said, code) = folder.failure(words);
        assert_eq!(code, 2, "{words:?}: {said}");
    }
    assert!(!folder.0.join("knowledge.db").exists());
    folder.text(&["put", "table", "roaming", &folder.with("roaming.toml", TABLE.as_bytes())]);
    for verb in ["get", "remove"] {
        let (said, code) = folder.failure(&[verb, "table", "roamin"]);
        assert_eq!(code, 1);
        assert_eq!(
            said,
            "error: there is no table \"roamin\" in knowledge.db\n = help: did you mean \"roaming\"?\n"
        );
    }
    folder.with("knowledge.db", b"this is a text");
    let (said, code) = folder.failure(&["put", "fact", "a", "b", "c"]);
    assert!(said.starts_with("error: knowledge.db is no knowledge base") && code == 2, "{said}");
    assert_eq!(fs::read(folder.0.join("knowledge.db")).unwrap(), b"this is a text");
}

#[test]
fn words_that_clap_refuses_are_wrong_use() {
    for words in [
        &["get", "tabel", "x"][..],
        &["put", "fact", "a", "b"],
        &["put", "fact", "a", "b", "c", "--confidence", "2"],
        &["put", "table", "x"],
        &["put", "schedule", "x", "stop"],
        &["put", "schedule", "x", "--cron", "61 * * * *", "stop"],
        &["put", "map", "x", "y.pgm", "--resolution", "1", "--origin", "1,2"],
        &["query", "a", "b"],
    ] {
        assert!(Line::try_parse_from(["know"].iter().chain(words)).is_err(), "{words:?}");
    }
}

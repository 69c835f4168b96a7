//! What `sinew new` writes. That the crate builds and its own tests pass is seen by `cargo test` in it, not here.

use std::fs;
use std::path::PathBuf;

use program::{file, new};
use runtime::{Agent, Fault, Input, Output, Step, registry as types_of};
use types::messages::{Ranges, Twist};
use types::params::Params;

use crate::registry;

/// A folder of its own that goes when the test ends.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Scratch {
        let path = std::env::temp_dir().join(format!("sinew-new-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The parameters that the template's agent has.
#[derive(Clone, Debug, Params)]
struct WatcherParams {
    /// As in the template (m).
    #[param(default = 0.6)]
    keep: f64,
}

/// The ports that the template's agent has.
#[derive(Agent)]
#[agent(kind = "wall-watcher")]
struct Watcher {
    /// As in the template.
    ranges: Input<Ranges>,
    /// As in the template.
    #[robot("drive")]
    drive: Output<Twist>,
    params: WatcherParams,
}

impl Agent for Watcher {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if self.ranges.latest().is_some() {
            self.drive.send(Twist::new(self.params.keep, 0.0));
        }
        Ok(())
    }
}

#[test]
fn a_new_agent_has_a_program_a_test_and_a_system_that_is_right() {
    let scratch = Scratch::new("agent");
    let files = new::agent("WallWatcher", &scratch.0, "rust").unwrap();
    let names: Vec<String> =
        files.iter().map(|file| file.strip_prefix(&scratch.0).unwrap().display().to_string()).collect();
    let wanted = ["Cargo.toml", "src/main.rs", "src/wall_watcher.rs", "wall-watcher.toml"];
    assert_eq!(names, wanted.map(|file| format!("wall-watcher/{file}")));
    for file in &files {
        assert!(!fs::read_to_string(file).unwrap().contains('@'), "{}", file.display());
    }
    let mut types = registry();
    types.extend(types_of![Watcher].types().iter().cloned());
    let system = files[3].to_str().unwrap();
    file::check(system, &[], &types).unwrap_or_else(|mistakes| panic!("{mistakes}"));
}

#[test]
fn a_new_system_is_right() {
    let scratch = Scratch::new("system");
    let files = new::system("my-robot", &scratch.0, "rust").unwrap();
    let loaded = file::check(files[0].to_str().unwrap(), &[], &registry()).unwrap_or_else(|m| panic!("{m}"));
    assert_eq!(loaded.plan.name, "my-robot");
}

#[test]
fn nothing_is_overwritten() {
    let scratch = Scratch::new("twice");
    let files = new::system("my-robot", &scratch.0, "rust").unwrap();
    fs::write(&files[0], "mine").unwrap();
    let failure = new::system("my-robot.toml", &scratch.0, "rust").unwrap_err();
    assert!(failure.problems[0].what.ends_with("is there already, and nothing is overwritten"));
    assert_eq!((failure.code, fs::read_to_string(&files[0]).unwrap().as_str()), (2, "mine"));
}

#[test]
fn other_languages_are_refused_with_a_reason() {
    for lang in ["c", "python", "cobol"] {
        let failure = new::agent("mine", &std::env::temp_dir(), lang).unwrap_err();
        assert_eq!(failure.code, 2);
        assert!(failure.problems[0].what.starts_with("there is no "), "{lang}");
    }
}

#[test]
fn in_a_checkout_the_checkout_is_used() {
    let scratch = Scratch::new("checkout");
    fs::create_dir_all(scratch.0.join("crates/sinew")).unwrap();
    fs::write(scratch.0.join("crates/sinew/Cargo.toml"), "").unwrap();
    let inside = new::agent("mine", &scratch.0.join("robots"), "rust").unwrap();
    let manifest = fs::read_to_string(&inside[0]).unwrap();
    assert!(manifest.contains("sinew = { path = \"../../crates/sinew\" }"), "{manifest}");
    let outside = Scratch::new("outside");
    let manifest = fs::read_to_string(&new::agent("mine", &outside.0, "rust").unwrap()[0]).unwrap();
    assert!(manifest.contains("sinew = \"0.1.0\""), "{manifest}");
}

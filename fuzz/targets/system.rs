//! System files, with a file that they use as a group.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use program::file::{Mistakes, read, read_plan, write_plan};
use runtime::{AgentType, Plan, Registry};
use sinew_fuzz::{put, scratch};
use types::value::Span;

static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let mut registry = agents::registry();
    registry.extend([AgentType::of::<hardware::Robot>()]);
    registry
});

/// Behind this line comes the text of the file that the first may use.
const PART: &str = "\n%%% part.toml\n";

fuzz_target!(|text: &str| {
    let part = scratch("part.toml");
    let folder = part.parent().unwrap_or(Path::new(""));
    let text = match text.split_once(PART) {
        Some((text, used)) if put(&part, used.as_bytes()) => text,
        Some(_) => return,
        None => {
            let _ = std::fs::remove_file(&part);
            text
        }
    };
    match read(text, "fuzz.toml", Some(folder), &[], &REGISTRY) {
        Ok(loaded) => again(loaded.plan),
        Err(mistakes) => placed(&mistakes),
    }
});

/// There are mistakes, each can be shown, and each place is in its text.
fn placed(mistakes: &Mistakes) {
    assert!(!mistakes.list.is_empty());
    let shown = mistakes.to_string();
    for mistake in &mistakes.list {
        assert!(shown.contains(mistake.what.as_str()));
        if mistake.at != Span::default() {
            let place = mistakes.sources.place(mistake.at);
            let place = place.unwrap_or_else(|| panic!("{mistake} stands nowhere: {:?}", mistake.at));
            assert!(place.line > 0 && place.column > 0);
        }
    }
}

/// The plan is the same when it is written and read again.
fn again(plan: Plan) {
    let text = write_plan(&plan);
    match read_plan(&text, "fuzz.toml", &REGISTRY) {
        Ok(again) => assert_eq!(write_plan(&again), text),
        Err(mistakes) => panic!("{mistakes}\n{text}"),
    }
}

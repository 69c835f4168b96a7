//! The schema, held against files by a validator that knows nothing of this program.

use std::fs;
use std::path::Path;

use boon::{Compiler, Schemas};
use program::file::{Shelf, tree};
use program::schema::{json_of, schema};
use serde_json::Value as Json;

use crate::registry;

/// What the validator says of a text; nothing when it agrees.
fn said(text: &str) -> Option<String> {
    let mut schemas = Schemas::new();
    let mut compiler = Compiler::new();
    compiler.add_resource("system.json", schema(&registry())).unwrap();
    let index = compiler.compile("system.json", &mut schemas).unwrap();
    let file: Json = json_of(&tree(text).unwrap());
    schemas.validate(&file, index).err().map(|error| error.to_string())
}

#[test]
fn it_agrees_with_every_scenario() {
    for (name, text) in Shelf::Scenarios.built_in() {
        assert_eq!(said(text), None, "{name}");
    }
    let groups = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/groups/robot.toml");
    assert_eq!(said(&fs::read_to_string(groups).unwrap()), None);
    let wire = |recipient| format!("wires.\"a.b\" = {{ to = \"c.d\", every = 2, recipient = {recipient} }}");
    assert_eq!(said(&wire("\"c\"")), None);
    assert!(said(&wire("3")).is_some_and(|error| error.contains("recipient")));
    let knows = "knowledge = { file = \"home.db\", begins = \"2026-03-02 07:59\", decide = \"home\" }";
    assert_eq!(said(knows), None);
    assert!(said(&knows.replace("file", "fiel")).is_some_and(|error| error.contains("fiel")));
    let decide = |row| format!("decide.\"battery.low\" = {{ when = \"battery < 0.2\", {row} }}");
    assert_eq!(said(&decide("goal = \"charge\", wall = { rate = 0.5, active = true }")), None);
    assert_eq!(said("decide.battery.low = { when = \"battery < 0.2\", wall = 0.5 }"), None);
    for wrong in ["priority = 0.5", "wall = 2.0", "wall = { rate = 0 }", "wall = { wieght = 1.0 }"] {
        assert!(said(&decide(wrong)).is_some(), "{wrong}");
    }
}

#[test]
fn it_sees_what_can_be_seen_without_reading_on() {
    for (name, wrong) in [
        ("misspelt_keys", true),
        ("wrong_units", true),
        ("unknown_types", true),
        ("unknown_inputs", true),
        ("unknown_sections", true),
        ("never_runs", true),
        ("by_deadline", true),
        // What other files say is not in the schema.
        ("wires_that_do_not_fit", true),
        ("wire_filters", true),
        ("group", false),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/mistakes/{name}.toml"));
        let text = fs::read_to_string(path).unwrap();
        assert_eq!(said(&text).is_some(), wrong, "{name}: {:?}", said(&text));
    }
}

#[test]
fn a_parameter_carries_its_doc_its_range_and_its_default() {
    let schema = schema(&registry());
    let kinds = schema["properties"]["agent"]["additionalProperties"]["anyOf"].as_array().unwrap();
    let safety = kinds.iter().find(|kind| kind["title"] == "safety-monitor").unwrap();
    let stop = &safety["properties"]["stop_distance"];
    assert_eq!(
        (&stop["type"], &stop["minimum"], &stop["maximum"]),
        (&"number".into(), &0.0.into(), &5.0.into())
    );
    assert!(stop["description"].as_str().unwrap().contains('m') && stop["default"].is_number());
    let wall = kinds.iter().find(|kind| kind["title"] == "wall-follower").unwrap();
    assert_eq!(wall["properties"]["side"]["enum"], serde_json::json!(["left", "right"]));
    assert!(kinds.iter().all(|kind| kind["title"] != "robot"), "robots have a section of their own");
}

//! What is wrong in a table is told all at once.

use types::messages::{MOST_AGENTS, MOST_SITUATIONS};
use types::value::Entry;

use super::*;

fn said(written: &Table, signals: &[&str]) -> Vec<String> {
    let signals: Vec<String> = signals.iter().map(|name| (*name).to_owned()).collect();
    let mut table = Table::new();
    let names = signals.iter().map(|name| Entry::from(Value::from(name.as_str()))).collect();
    table.set("table", Value::Table(written.clone()));
    table.set("signals", Value::List(names));
    let mistakes = DecisionParams::read(&table, "decision-maker").err().unwrap_or_default();
    mistakes.iter().map(ToString::to_string).collect()
}

#[test]
fn a_table_with_a_wrong_word_is_refused_with_the_right_one() {
    let text = |text: &str| Value::from(text);
    let written = table(&[
        ("danger.nearr", weights(&[("safety", 1.0)])),
        ("lost", row(&[("goal", text("home"))])),
        ("free", weights(&[("wall", 1.5)])),
        ("narrow", row(&[("when", text("nearest < 0.3")), ("wall", text("much"))])),
        (
            "low",
            row(&[
                ("when", text("batery < 0.2")),
                ("until", Value::Float(0.3)),
                ("priority", Value::Float(0.5)),
            ]),
        ),
        (
            "crowd",
            row(&[
                ("when", text("faces + 1")),
                ("track.wieght", Value::Float(1.0)),
                ("track.rate", Value::Float(0.0)),
                ("track.importance", Value::Int(2)),
                ("track.active", text("yes")),
                ("track.method", Value::Int(1)),
                ("goal", text("")),
            ]),
        ),
    ]);
    assert_eq!(
        said(&written, &["faces"]),
        [
            "there is no situation \"danger.nearr\"; did you mean \"danger.near\"?",
            "there is no situation \"lost\"; one of your own needs a condition, as in { when = \"battery < 0.2\", wall = 0.0 }",
            "the weight of \"wall\" is 1.5, not a number from 0 to 1",
            "\"narrow\" is recognised by itself, it takes no \"when\"",
            "the weight of \"wall\" is \"much\", not a number from 0 to 1",
            "there is no signal \"batery\"; did you mean \"battery\"?",
            "\"until\" is a number, not a condition; as in until = \"battery < 0.2\"",
            "\"priority\" is 0.5, not a whole number from 0 to 1000",
            "this is a number, not a condition; compare it, as in battery < 0.2",
            "there is no setting of an agent \"wieght\"; did you mean \"weight\"?",
            "the rate of \"track\" is 0.0, not a number above 0, to 1",
            "the importance of \"track\" is 2, not a number from 0 to 1",
            "\"active\" is \"yes\", not true or false",
            "\"method\" is 1, not a text",
            "\"goal\" is empty",
        ]
    );
    assert_eq!(said(&own(), &["faces"]), [""; 0]);
    assert_eq!(said(&own(), &["face"]), ["there is no signal \"faces\"; did you mean \"face\"?"]);
}

#[test]
fn signals_are_declared_by_names_of_their_own() {
    let free = table(&[("free", weights(&[("wall", 1.0)]))]);
    assert_eq!(
        said(&free, &["battery", "two words", "faces"]),
        [
            "\"battery\" is a signal that every decision maker knows",
            "\"two words\" is no name for a signal: it has letters, digits and _, 23 at most"
        ]
    );
    let many: Vec<String> = (0..17).map(|i| format!("s{i}")).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    assert_eq!(said(&free, &many), ["17 signals are too many: 16 have room"]);
}

#[test]
fn what_has_no_room_is_refused() {
    let mut written = Table::new();
    for i in 0..=(MOST_SITUATIONS - Situation::ALL.len()) {
        written.set(&format!("own{i}"), row(&[("when", Value::from("speed > 1"))]));
    }
    assert_eq!(said(&written, &[]), ["\"own8\" is one situation too many: 8 of one's own have room"]);
    let agents: Vec<String> = (0..=MOST_AGENTS).map(|i| format!("a{i}")).collect();
    let agents: Vec<(&str, f64)> = agents.iter().map(|name| (name.as_str(), 1.0)).collect();
    let written = table(&[("free", weights(&agents))]);
    assert_eq!(said(&written, &[]), ["\"a12\" is one agent too many: a table has room for 12"]);
    let names: Vec<String> = (0..14).map(|i| format!("s{i}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let when = |part: &[&str]| row(&[("when", Value::from(part.join(" + ") + " > 0"))]);
    let written = table(&[("x", when(&names[..13])), ("y", when(&names[12..]))]);
    let help = "the conditions of a table can need 13 beside those of the built-in situations";
    assert_eq!(said(&written, &names), [format!("\"s13\" is one signal too many; {help}")]);
}

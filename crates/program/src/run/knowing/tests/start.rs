//! What a run takes out of its store when it begins.

use super::*;

#[test]
fn the_table_of_the_store_is_the_decision_makers() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(table(0.25));
    home.put(table(0.5));
    let (scenario, knowing, told) = home.begun(&[]).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 0.5);
    assert_eq!(knowing.known.table.as_ref().unwrap().version, 2);
    let told = told.lock().unwrap().join("\n");
    assert!(
        told.ends_with("is in force; [decide] says something else") && told.contains("version 2"),
        "{told}"
    );
}

#[test]
fn a_table_that_only_the_file_has_becomes_the_first_version() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    let (scenario, _, told) = home.begun(&[]).unwrap();
    assert_eq!(weight_in(&scenario.file.plan), 1.0);
    let said = told.lock().unwrap().join("\n");
    assert!(
        said.starts_with("[decide] is now table \"home\", version 1, in ") && said.ends_with("home.db"),
        "{said}"
    );
    let mut store = home.store();
    assert_eq!(store.read().unwrap().newest("home").unwrap().unwrap().weights, table(1.0).weights);
    // The second time it is there.
    let (_, _, told) = home.begun(&[]).unwrap();
    assert!(told.lock().unwrap().is_empty());
    assert_eq!(store.read().unwrap().history("home").unwrap().len(), 1);
}

#[test]
fn the_command_line_names_a_store_in_the_place_of_the_files() {
    let home = Home::new(&[SYSTEM, DECIDE]);
    let other = home.0.join("other.db").display().to_string();
    let (scenario, knowing, _) = home.begun(&["--know", &other]).unwrap();
    assert!(knowing.store.ends_with("other.db") && knowing.store.exists(), "it is made");
    let text = plan_text(&scenario.prepare(1).unwrap());
    assert!(text.contains("[knowledge]\nfile = \"other.db\"\n"), "the log knows no folder: {text}");
    fs::write(&other, "this is a text").unwrap();
    let said = home.failure(&["--know", &other]);
    let wanted = "error: other.db is no knowledge base: it does not begin as a database does\n = help: it was left as it is; ";
    assert!(said.starts_with(wanted), "{said}");
}

#[test]
fn what_cannot_be_read_is_told_with_its_place_and_what_mends_it() {
    for (system, wanted) in [
        (
            format!("{SYSTEM}[knowledge]\nfile = \"small.toml/home.db\"\n"),
            "error: small.toml/home.db cannot be read or written: Not a directory (os error 20)
 --> small.toml:9:8
9 | file = \"small.toml/home.db\"
  |        ^^^^^^^^^^^^^^^^^^^^
  = help: nothing was changed; look at the folder, the rights of both, and the room on the disk
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"small.toml\"\n"),
            "error: small.toml is no knowledge base: it does not begin as a database does
 --> small.toml:9:8
9 | file = \"small.toml\"
  |        ^^^^^^^^^^^^
  = help: it was left as it is; name another file, which is made when something is put into it
",
        ),
        (
            format!(
                "{SYSTEM}[knowledge]\nfile = \"home.db\"\nbegins = \"2026-02-30 07:59\"\ndecade = \"home\"\n"
            ),
            "error: \"begins\" is \"2026-02-30 07:59\", which is no date
  --> small.toml:10:10
10 | begins = \"2026-02-30 07:59\"
   |          ^^^^^^^^^^^^^^^^^^
   = help: a date is as in \"2026-03-02 07:59\", with or without the time of day, from 1678 to 2261

error: there is no entry in [knowledge] \"decade\"
  --> small.toml:11:1
11 | decade = \"home\"
   | ^^^^^^
   = help: did you mean \"decide\"?

2 errors
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"home.db\"\ndecide = \"hose\"\n"),
            "error: there is no decision table \"hose\" in home.db, and no section [decide]
  --> small.toml:10:10
10 | decide = \"hose\"
   |          ^^^^^^
   = help: did you mean \"home\"?
",
        ),
        (
            format!("{SYSTEM}[knowledge]\nfile = \"home.db\"\ndecide = \"garden\"\n"),
            "error: there is no decision table \"garden\" in home.db, and no section [decide]
  --> small.toml:10:10
10 | decide = \"garden\"
   |          ^^^^^^^^
   = help: put one: sinew know --file home.db put table garden FILE
",
        ),
        (
            "name = \"small\"\n[knowledge]\nfile = \"home.db\"\ndecide = \"home\"\n".to_owned(),
            "error: nobody reads the decision table
 --> small.toml:4:10
4 | decide = \"home\"
  |          ^^^^^^
  = help: add an agent with is = \"decision-maker\", or take \"decide\" out
",
        ),
        (
            format!("{SYSTEM}[knowledge]\n"),
            "error: [knowledge] needs \"file\", as in file = \"home.db\"
 --> small.toml:8:1
8 | [knowledge]
  | ^^^^^^^^^^^
",
        ),
    ] {
        let home = Home::new(&[&system]);
        home.put(table(0.5));
        assert_eq!(home.failure(&[]), wanted, "{system}");
    }
}

#[test]
fn a_table_with_mistakes_stops_the_start_with_its_name_version_and_place() {
    let home = Home::new(&[SYSTEM, DECIDE, KNOWS]);
    home.put(table(0.5));
    let mut bad = table(0.5);
    let mut row = Table::new();
    row.set("wal", Value::Float(1.0));
    bad.weights.set("danger.neer", Value::Table(row));
    home.put(bad);
    assert_eq!(
        home.failure(&[]),
        "error: there is no situation \"danger.neer\"
 --> table \"home\", version 2, in home.db:2:1
2 | \"danger.neer\" = { wal = 1.0 }
  | ^^^^^^^^^^^^^
  = help: did you mean \"danger.near\"?

error: there is no agent \"wal\"
 --> table \"home\", version 2, in home.db:2:19
2 | \"danger.neer\" = { wal = 1.0 }
  |                   ^^^
  = help: did you mean \"wall\"?

2 errors
"
    );
}

#[test]
fn an_agent_is_given_the_numbers_of_the_pattern_that_it_names() {
    let eye = "[agent.eye]\nis = \"eye\"\nperiod = \"1s\"\npattern = \"ball\"\n";
    let section = "[knowledge]\nfile = \"home.db\"\n";
    let home = Home::new(&[SYSTEM, eye, section]);
    let pattern = |name: &str, kind| {
        let mut parameters = Table::new();
        parameters.set("hue_from", Value::Int(350));
        parameters.set("saturation", Value::Float(0.4));
        let bytes = if kind == PatternKind::Image { vec![1] } else { Vec::new() };
        Pattern { name: name.into(), kind, media_type: String::new(), bytes, parameters }
    };
    home.put(pattern("bull", PatternKind::ColourRange));
    let said = home.failure(&[]);
    let wanted = "error: there is no pattern \"ball\" in home.db
  --> small.toml:11:11
11 | pattern = \"ball\"
   |           ^^^^^^
   = help: did you mean \"bull\"?
";
    assert_eq!(said, wanted);
    home.put(pattern("ball", PatternKind::Image));
    let said = home.failure(&[]);
    assert!(
        said.contains("\"ball\" in home.db cannot be used: it is a picture")
            && said.contains("small.toml:11"),
        "{said}"
    );
    home.put(pattern("ball", PatternKind::ColourRange));
    let (scenario, knowing, _) = home.begun(&[]).unwrap();
    let params = &scenario.file.plan.agent("eye").unwrap().params;
    assert_eq!(params.get("pattern").unwrap().value.to_string(), "{ hue_from = 350.0, saturation = 0.4 }");
    // The log holds the numbers, and a repeated run needs no store.
    let ready = scenario.prepare(1).unwrap();
    assert!(plan_text(&ready).contains("pattern = { hue_from = 350.0, saturation = 0.4 }"));
    assert_eq!(Known::of_note(&knowing.known.to_note()), Some(knowing.known.clone()));
    let without = Home::new(&[SYSTEM, eye]);
    let said = without.failure(&[]);
    assert!(said.contains("there is no store of patterns") && said.contains("--know FILE"), "{said}");
}

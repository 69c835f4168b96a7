//! The rules of the house: lengths, words, one test binary a crate, common lints, numbered lessons.

use std::collections::BTreeSet;

use super::Finding;
use super::graph::Graph;
use super::tree::Tree;

/// No file is longer than this (lines) without a reason.
const LINES: usize = 900;

/// Lessons are shorter than this (lines).
const LESSON_LINES: usize = 100;

/// Longer files, each with the reason why it is one.
pub(crate) const LONG: &[(&str, &str)] = &[];

/// Written by a program or taken over from elsewhere.
const NOT_OURS: [&str; 4] =
    ["Cargo.lock", "benches/peers/Cargo.lock", "fuzz/Cargo.lock", "crates/record/font/"];

/// Words that mark unfinished work. They are put together here, so that this file does not hold them.
const UNFINISHED: [&str; 4] =
    [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("todo", "!"), concat!("unimplemented", "!")];

/// Folders of one machine; put together for the same reason.
const MACHINE: [&str; 4] =
    [concat!("/wo", "rk/"), concat!("/fa", "rm/"), concat!("/ro", "ot/"), concat!("/ho", "me/")];

pub(crate) fn check(tree: &Tree, graph: &Graph, long: &[(&str, &str)]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (path, text) in
        tree.under("").filter(|(path, _)| !NOT_OURS.iter().any(|other| path.starts_with(other)))
    {
        let lines = text.lines().count();
        if lines > LINES && !long.iter().any(|(known, _)| *known == path) {
            findings.push(Finding::new(
                path,
                format!(
                    "{lines} lines: no file has over {LINES} without a reason in xtask/src/tidy/house.rs"
                ),
            ));
        }
        for (at, line) in text.lines().enumerate() {
            for word in UNFINISHED.iter().filter(|word| has_word(line, word)) {
                findings.push(Finding::at(path, at + 1, format!("{word} marks unfinished work")));
            }
            for folder in MACHINE.iter().filter(|folder| line.contains(**folder)) {
                findings.push(Finding::at(path, at + 1, format!("{folder} is a folder of one machine")));
            }
        }
    }
    let stale = |path: &str| tree.text(path).is_none_or(|text| text.lines().count() <= LINES);
    let stale = long.iter().filter(|(path, _)| stale(path));
    findings.extend(
        stale.map(|(path, _)| Finding::new(*path, "is listed as long in xtask/src/tidy/house.rs but is not")),
    );
    for member in graph.members.values() {
        findings.extend(check_package(tree, &member.folder));
    }
    findings
}

/// Whether the word stands by itself, not as a part of another.
fn has_word(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let joins = |c: char| c == '_' || c.is_alphanumeric();
        let before = line[..at].chars().next_back().is_some_and(joins);
        let after = word.chars().all(char::is_alphanumeric)
            && line[at + word.len()..].chars().next().is_some_and(joins);
        !before && !after
    })
}

fn check_package(tree: &Tree, folder: &str) -> Vec<Finding> {
    let mut findings = Vec::new();
    let tests = format!("{folder}/tests");
    let binaries: BTreeSet<&str> = tree
        .rust(&tests)
        .filter_map(|(path, _)| {
            let inner = &path[tests.len() + 1..];
            (!inner.contains('/') || inner.matches('/').count() == 1 && inner.ends_with("/main.rs"))
                .then_some(inner)
        })
        .collect();
    if binaries.len() > 1 {
        let names: Vec<&str> = binaries.into_iter().collect();
        findings.push(Finding::new(
            tests.as_str(),
            format!("one test binary a crate, not {}: each costs a link", names.join(" and ")),
        ));
    }
    let manifest = format!("{folder}/Cargo.toml");
    let lints = tree.text(&manifest).is_some_and(|text| text.contains("[lints]\nworkspace = true"));
    if !lints {
        findings.push(Finding::new(
            manifest,
            "does not take the lints of the workspace: [lints] workspace = true",
        ));
    }
    findings
}

/// Lessons are numbered without a gap, short, known to cargo, and say what they print.
pub(crate) fn check_lessons(tree: &Tree) -> Vec<Finding> {
    let known = tree.text("crates/sinew/Cargo.toml").unwrap_or_default();
    let mut findings = Vec::new();
    for (at, (path, text)) in tree.rust("examples").enumerate() {
        let mut say = |what: String| findings.push(Finding::new(path, what));
        let number = format!("{:02}_", at + 1);
        if !path["examples/".len()..].starts_with(&number) {
            say(format!("the next lesson begins with {number}"));
        }
        if text.lines().count() >= LESSON_LINES {
            say(format!("a lesson is shorter than {LESSON_LINES} lines"));
        }
        if !known.contains(&format!("path = \"../../{path}\"")) {
            say("is no [[example]] of crates/sinew/Cargo.toml".to_owned());
        }
        if crate::steps::expected_output(text).is_none() {
            say("does not end with `// Output:` and what it prints".to_owned());
        }
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::super::graph::Layer;
    use super::*;

    fn found(files: &[(&str, &str)], long: &[(&str, &str)]) -> Vec<String> {
        check(&Tree::of(files), &Graph::default(), long).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn a_long_file_needs_a_reason_and_a_reason_needs_a_long_file() {
        let long = "x\n".repeat(LINES + 1);
        assert_eq!(found(&[("a.rs", &long)], &[]).len(), 1);
        assert_eq!(found(&[("a.rs", &long)], &[("a.rs", "one table")]), [""; 0]);
        assert!(found(&[("a.rs", "x")], &[("a.rs", "one table")])[0].contains("but is not"));
    }

    #[test]
    fn unfinished_work_and_folders_of_one_machine_are_found() {
        let text =
            format!("fine\n// {} later\n{}()\nlet a = \"{}me\";\n", UNFINISHED[0], UNFINISHED[2], MACHINE[0]);
        let found = found(&[("a.rs", &text)], &[]);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found[0].starts_with("a.rs:2: ") && found[2].starts_with("a.rs:4: "), "{found:?}");
        assert!(!has_word(&format!("{}S are many", UNFINISHED[0]), UNFINISHED[0]));
    }

    #[test]
    fn one_test_binary_and_the_common_lints() {
        let graph = Graph::default().put("sinew-a", Some(Layer::Number(1)), &[]);
        let good = [
            ("crates/a/Cargo.toml", "[lints]\nworkspace = true\n"),
            ("crates/a/tests/world.rs", ""),
            ("crates/a/tests/common/mod.rs", ""),
        ];
        assert_eq!(check(&Tree::of(&good), &graph, &[]), []);
        let mut bad = Tree::of(&good);
        bad.put("crates/a/tests/more/main.rs", "");
        bad.put("crates/a/Cargo.toml", "");
        assert_eq!(check(&bad, &graph, &[]).len(), 2);
    }

    #[test]
    fn lessons_are_numbered_known_and_say_what_they_print() {
        let manifest = (
            "crates/sinew/Cargo.toml",
            "path = \"../../examples/01_first.rs\"\npath = \"../../examples/03_third.rs\"",
        );
        let lesson = "fn main() {}\n// Output:\n// one\n";
        let first = ("examples/01_first.rs", lesson);
        assert_eq!(check_lessons(&Tree::of(&[manifest, first])), []);
        let found = check_lessons(&Tree::of(&[manifest, first, ("examples/03_third.rs", lesson)]));
        assert_eq!(found, [Finding::new("examples/03_third.rs", "the next lesson begins with 02_")]);
        assert_eq!(
            check_lessons(&Tree::of(&[manifest, first, ("examples/02_second.rs", "fn main() {}")])).len(),
            2
        );
    }
}

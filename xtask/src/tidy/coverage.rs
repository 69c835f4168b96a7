//! `docs/coverage.md` has a line for every row of the ledger, and what it names exists.
//!
//! A line is `| id | what | state | shown by | tested by |`. The state is `built`, `in part` or `not yet`. What is built names a
//! command and a test, what is there in part names a test and says what is missing, and what is not yet there names nothing.

use std::collections::BTreeSet;

use super::Finding;
use super::tree::Tree;

/// Where the lines stand.
const PAGE: &str = "docs/coverage.md";

/// The rows of the ledger: a letter for each paper and how many rows it has.
const LEDGER: [(char, usize); 4] = [('N', 20), ('C', 10), ('D', 8), ('R', 8)];

/// Where the words of the command line are known.
const COMMAND_SOURCES: [&str; 2] = ["crates/program/src", "crates/control/src"];

pub(crate) fn check(tree: &Tree) -> Vec<Finding> {
    let Some(page) = tree.text(PAGE) else { return vec![Finding::new(PAGE, "is missing")] };
    let mut missing: BTreeSet<String> = LEDGER
        .iter()
        .flat_map(|(letter, count)| (1..=*count).map(move |row| format!("{letter}{row}")))
        .collect();
    let all = missing.clone();
    let mut findings = Vec::new();
    for (at, line) in page.lines().enumerate() {
        let cells: Vec<&str> = line.trim().trim_matches('|').split(" | ").map(str::trim).collect();
        if !line.trim_start().starts_with('|') || !all.contains(cells[0]) {
            continue;
        }
        let problems = if missing.remove(cells[0]) {
            check_row(tree, &cells)
        } else {
            vec!["stands here twice".to_owned()]
        };
        findings.extend(
            problems.into_iter().map(|what| Finding::at(PAGE, at + 1, format!("{}: {what}", cells[0]))),
        );
    }
    findings.extend(missing.into_iter().map(|id| Finding::new(PAGE, format!("{id} has no line"))));
    findings
}

fn check_row(tree: &Tree, cells: &[&str]) -> Vec<String> {
    let &[_, what, state, shown, tested] = cells else {
        return vec!["a line is | id | what | state | shown by | tested by |".to_owned()];
    };
    let code = |cell| super::pages::names(cell).map(|(_, name)| name).collect::<Vec<_>>();
    let (commands, tests) = (code(shown), code(tested));
    let mut problems = Vec::new();
    match state {
        "built" if commands.is_empty() || tests.is_empty() => {
            problems.push("what is built names a command and a test".to_owned())
        }
        "in part" if tests.is_empty() => problems.push("what is there in part names a test".to_owned()),
        "in part" if !what.contains("Missing: ") => {
            problems.push("what is there in part says what is missing".to_owned());
        }
        "not yet" if !commands.is_empty() || !tests.is_empty() => {
            problems.push("what is not yet there names nothing".to_owned())
        }
        "built" | "in part" | "not yet" => {}
        other => problems.push(format!("the state is built, in part or not yet; not \"{other}\"")),
    }
    problems.extend(commands.into_iter().filter_map(|line| unknown_command(tree, line)));
    problems.extend(
        tests.into_iter().filter(|name| !has_test(tree, name)).map(|name| format!("there is no test {name}")),
    );
    problems
}

/// What is wrong with `sinew run exploration --seed 3` or `cargo run -p … --example …`.
fn unknown_command(tree: &Tree, line: &str) -> Option<String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        ["sinew", "run", system, ..] if !known_system(tree, system) => {
            Some(format!("there is no scenario {system}"))
        }
        ["sinew", command, ..] if !known_word(tree, command) => {
            Some(format!("there is no command sinew {command}"))
        }
        ["sinew", _, ..] => None,
        ["cargo", "xtask", command, ..] => {
            (!crate::COMMANDS.contains(&command)).then(|| format!("there is no cargo xtask {command}"))
        }
        ["cargo", "run", .., "-p", package, "--example", example] => {
            let path = format!("crates/{}/examples/{example}.rs", package.trim_start_matches("sinew-"));
            let lesson = format!("examples/{example}.rs");
            (!tree.has(&path) && !tree.has(&lesson))
                .then(|| format!("there is no example {example} of {package}"))
        }
        _ => Some(format!("\"{line}\" is no command of this repository")),
    }
}

/// A scenario by its name, a file by its path, or a word in capitals that stands for one.
pub(super) fn known_system(tree: &Tree, name: &str) -> bool {
    tree.has(&format!("scenarios/{name}.toml")) || tree.has(name) || name.chars().all(char::is_uppercase)
}

/// The word stands in the sources between quotes, or as a case of the command line (`Run(…)`, `Schema,`).
fn known_word(tree: &Tree, word: &str) -> bool {
    let quoted = format!("\"{word}\"");
    let mut letters = word.chars();
    let case: String =
        letters.next().map(|first| first.to_ascii_uppercase()).into_iter().chain(letters).collect();
    let cases = [format!("    {case}("), format!("    {case} {{"), format!("    {case},\n")];
    let known = |text: &str| text.contains(&quoted) || cases.iter().any(|case| text.contains(case));
    COMMAND_SOURCES.iter().any(|folder| tree.rust(folder).any(|(_, text)| known(text)))
}

/// `cargo xtask test --only STEP`, or a test by name.
fn has_test(tree: &Tree, name: &str) -> bool {
    match name.strip_prefix("cargo xtask test --only ") {
        Some(steps) => crate::steps::named(steps).is_ok(),
        None => has_function(tree, name),
    }
}

/// `runtime::ring::newest_wins_past_the_wrap`: a crate, parts of the path to the file, and a function under `#[test]`.
fn has_function(tree: &Tree, name: &str) -> bool {
    let parts: Vec<&str> = name.split("::").collect();
    let [krate, modules @ .., function] = &parts[..] else { return false };
    let folder = match *krate {
        "xtask" => "xtask".to_owned(),
        krate => format!("crates/{krate}"),
    };
    tree.rust(&folder).any(|(path, text)| {
        let mut steps = path.trim_end_matches(".rs").split('/');
        modules.iter().all(|module| steps.any(|step| step == *module)) && is_test(text, function)
    })
}

/// Whether nothing but attributes stands between `#[test]` and the function.
fn is_test(text: &str, function: &str) -> bool {
    text.match_indices(&format!("fn {function}(")).any(|(at, _)| {
        let before = &text[..at];
        before.rfind("#[test]").is_some_and(|test| !before[test..].contains("fn "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST: &str = "#[test]\n#[ignore]\nfn it_holds() {}\nfn helper() {}";

    fn found(row: &str) -> Vec<String> {
        let rows =
            LEDGER.iter().flat_map(|(letter, count)| (1..=*count).map(move |row| format!("{letter}{row}")));
        let others = rows.filter(|id| id != "N5").map(|id| format!("| {id} | x | not yet | – | – |\n"));
        let page: String = others.chain([row.to_owned()]).collect();
        let tree = Tree::of(&[
            (PAGE, &page),
            ("crates/sim/src/goal.rs", TEST),
            ("crates/program/src/words.rs", "[\"run\", \"top\"]\n    Check(Args),"),
            ("scenarios/annex.toml", ""),
            ("crates/sim/examples/picture.rs", ""),
        ]);
        check(&tree).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn a_row_that_names_what_exists_is_fine() {
        for shown in [
            "`sinew run annex --seed 3`",
            "`sinew top`",
            "`sinew check FILE`",
            "`cargo run -p sinew-sim --example picture`",
            "`cargo xtask tidy`",
        ] {
            assert_eq!(found(&format!("| N5 | x | built | {shown} | `sim::goal::it_holds` |")), [""; 0]);
        }
        assert_eq!(found("| N5 | x. Missing: y | in part | – | `sim::it_holds` |"), [""; 0]);
        assert_eq!(found("| N5 | x | built | `sinew top` | `cargo xtask test --only unit` |"), [""; 0]);
    }

    #[test]
    fn what_does_not_exist_is_found() {
        for (row, expected) in [
            ("| N5 | x | built | `sinew run attic` | `sim::goal::it_holds` |", "there is no scenario attic"),
            ("| N5 | x | built | `sinew tap` | `sim::goal::it_holds` |", "there is no command sinew tap"),
            (
                "| N5 | x | built | `cargo run -p sinew-sim --example gone` | `sim::it_holds` |",
                "there is no example gone",
            ),
            ("| N5 | x | built | `sinew top` | `sim::goal::helper` |", "there is no test sim::goal::helper"),
            (
                "| N5 | x | built | `sinew top` | `sim::shape::it_holds` |",
                "there is no test sim::shape::it_holds",
            ),
            ("| N5 | x | built | `sinew top` | – |", "names a command and a test"),
            ("| N5 | x | not yet | `sinew top` | – |", "names nothing"),
            ("| N5 | x | in part | – | `sim::it_holds` |", "says what is missing"),
            (
                "| N5 | x | built | `sinew top` | `cargo xtask test --only none` |",
                "there is no test cargo xtask test --only none",
            ),
            ("| N5 | x | soon | – | – |", "the state is"),
            ("| N6 | x | not yet | – | – |", "N6: stands here twice"),
            ("", "N5 has no line"),
        ] {
            let found = found(row);
            assert!(found.iter().any(|line| line.contains(expected)), "{row}: {found:?}");
        }
    }
}

//! What the documents name must be there: crates, files, folders, items, chores.

use super::Finding;
use super::coverage::known_system;
use super::graph::Graph;
use super::tree::Tree;

/// The documents that are read for names.
const PAGES: [&str; 7] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "docs/coverage.md",
    "docs/faults.md",
    "docs/performance.md",
    "CHANGELOG.md",
];

/// Endings that make a word in a document the name of a file.
const ENDINGS: [&str; 7] = [".md", ".rs", ".toml", ".png", ".svg", ".py", ".yml"];

/// Files that a reader makes, not we.
const MADE_BY_READERS: [&str; 3] = ["file.toml", "my.toml", "run.toml"];

/// The map of the code.
const MAP: &str = "ARCHITECTURE.md";

pub(crate) fn check(tree: &Tree, graph: &Graph) -> Vec<Finding> {
    let mut findings = Vec::new();
    for page in ["README.md", MAP, "CONTRIBUTING.md", "CHANGELOG.md", "docs/coverage.md"] {
        if !tree.has(page) {
            findings.push(Finding::new(page, "is missing"));
        }
    }
    let decisions = tree.under("docs/decisions").map(|(path, _)| path);
    let pages = PAGES.into_iter().chain(decisions);
    for (page, text) in pages.filter_map(|page| Some((page, tree.text(page)?))) {
        for (line, system) in systems(text) {
            if !known_system(tree, system) {
                findings.push(Finding::at(
                    page,
                    line,
                    format!("runs `{system}`, and there is no such scenario"),
                ));
            }
        }
        for (line, name) in names(text) {
            if let Some(what) = wrong(tree, graph, page, name) {
                findings.push(Finding::at(page, line, what));
            }
        }
    }
    findings.extend(unnamed_crates(tree, graph));
    findings
}

/// Every package has its paragraph in the map of the code.
fn unnamed_crates(tree: &Tree, graph: &Graph) -> Vec<Finding> {
    let Some(map) = tree.text(MAP) else { return Vec::new() };
    let named: Vec<&str> = names(map).map(|(_, name)| name.trim_end_matches('/')).collect();
    let unnamed = graph.members.values().filter(|member| !named.contains(&member.folder.as_str()));
    unnamed.map(|member| Finding::new(MAP, format!("does not name `{}`", member.folder))).collect()
}

/// What stands between backquotes and what links point to, with the line; blocks of code are passed over.
pub(crate) fn names(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut in_block = false;
    text.lines().enumerate().flat_map(move |(at, line)| {
        if line.trim_start().starts_with("```") {
            in_block = !in_block;
        }
        let skip = in_block || line.trim_start().starts_with("```");
        let quoted = line.split('`').skip(1).step_by(2);
        let linked = line.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        quoted.chain(linked).filter(move |_| !skip).map(move |name| (at + 1, name))
    })
}

/// What is run in lines like `sinew run exploration` or `cargo run --release -- run exploration`.
fn systems(text: &str) -> impl Iterator<Item = (usize, &str)> {
    text.lines().enumerate().filter_map(|(at, line)| {
        let rest = line.split_once("sinew run ").or_else(|| line.split_once("-- run "))?.1;
        let end = rest.find(|c: char| !(c.is_alphanumeric() || "/._-".contains(c))).unwrap_or(rest.len());
        (end > 0).then_some((at + 1, &rest[..end]))
    })
}

/// Why a name in a document leads nowhere.
fn wrong(tree: &Tree, graph: &Graph, page: &str, name: &str) -> Option<String> {
    let name = name.split('#').next().unwrap_or_default();
    let plain = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "/._-:".contains(c));
    if !plain || name.contains("://") {
        return chore(name);
    }
    if let Some((krate, inner)) = name.split_once("::") {
        let member = graph.in_folder(&format!("crates/{krate}"))?;
        return missing_item(tree, &member.folder, inner)
            .map(|item| format!("`{name}`: there is no {item} in {}", member.folder));
    }
    let top = name.split('/').next().unwrap_or_default();
    let is_path = name.contains('/') && tree.has(top)
        || ENDINGS.iter().any(|ending| name.ends_with(ending))
        || name.starts_with("../");
    if !is_path || MADE_BY_READERS.contains(&name) || found(tree, page, name) {
        return None;
    }
    Some(format!("names `{name}`, which is not there"))
}

/// As a path from the root, from the page's folder, or as the bare name of a file anywhere.
fn found(tree: &Tree, page: &str, name: &str) -> bool {
    let mut folder: Vec<&str> = page.split('/').collect();
    folder.pop();
    for part in name.split('/') {
        match part {
            ".." => drop(folder.pop()),
            "." => {}
            part => folder.push(part),
        }
    }
    let anywhere = !name.contains('/') && tree.under("").any(|(path, _)| path.ends_with(&format!("/{name}")));
    tree.has(name) || tree.has(&folder.join("/")) || anywhere
}

/// The last part of `module::Item` must be a word of the crate's source.
fn missing_item<'a>(tree: &Tree, folder: &str, inner: &'a str) -> Option<&'a str> {
    let item = inner.rsplit("::").next().unwrap_or(inner);
    let is_there = tree.rust(folder).any(|(path, text)| {
        path.ends_with(&format!("/{item}.rs"))
            || path.contains(&format!("/{item}/"))
            || has_identifier(text, item)
    });
    (!is_there).then_some(item)
}

fn has_identifier(text: &str, word: &str) -> bool {
    text.split(|c: char| c != '_' && !c.is_alphanumeric()).any(|one| one == word)
}

/// `cargo xtask WORD` with a word that there is not.
fn chore(name: &str) -> Option<String> {
    let word = name.strip_prefix("cargo xtask ")?.split(' ').next()?;
    (!crate::COMMANDS.contains(&word)).then(|| format!("names `cargo xtask {word}`, which is no command"))
}

#[cfg(test)]
mod tests {
    use super::super::graph::Layer;
    use super::*;

    fn found_in(map: &str) -> Vec<String> {
        let graph = Graph::default().put("sinew-sim", Some(Layer::Number(2)), &[]);
        let tree = Tree::of(&[
            ("README.md", "[map](ARCHITECTURE.md)"),
            ("CONTRIBUTING.md", ""),
            ("CHANGELOG.md", ""),
            ("docs/coverage.md", "[map](../ARCHITECTURE.md)"),
            ("crates/sim/src/goal.rs", "pub struct Goal;"),
            (MAP, map),
        ]);
        check(&tree, &graph).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn what_is_there_may_be_named() {
        let map = "`crates/sim/` has `sim::goal` and `sim::goal::Goal`; `true/false`, `a b/c.rs`, `cargo xtask tidy`, `goal.rs`.
            ```text\n`crates/nowhere`\n```\n[lint](https://example.org/x.md)";
        assert_eq!(found_in(map), [""; 0]);
    }

    #[test]
    fn what_is_gone_is_found_at_its_line() {
        let map =
            "`crates/sim`\n`crates/gone` [it](docs/none.md) `sim::Gaol` `cargo xtask bliss` `../lost/x`";
        let found = found_in(map);
        for (at, what) in
            ["crates/gone", "sim::Gaol", "xtask bliss", "../lost/x", "docs/none.md"].into_iter().enumerate()
        {
            assert!(
                found[at].starts_with("ARCHITECTURE.md:2: ") && found[at].contains(what),
                "{what}: {found:?}"
            );
        }
        assert_eq!(found.len(), 5);
    }

    #[test]
    fn a_scenario_that_is_gone_is_found_in_blocks_too() {
        let map = "`crates/sim`\n```sh\ncargo run --release -- run attic --seed 3\nsinew run FILE\n```";
        assert_eq!(found_in(map), ["ARCHITECTURE.md:3: runs `attic`, and there is no such scenario"]);
    }

    #[test]
    fn an_unnamed_crate_is_found() {
        assert_eq!(found_in("The simulator is elsewhere."), ["ARCHITECTURE.md: does not name `crates/sim`"]);
    }
}

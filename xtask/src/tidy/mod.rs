//! The lines between the parts, checked by machine.
//!
//! | to find | look in |
//! |---|---|
//! | who may depend on whom | [`layers`], [`heavy`] |
//! | what algorithms may not touch | [`purity`] |
//! | where `unsafe` may stand | [`unsafety`] |
//! | what the documents name | [`pages`], [`coverage`] |
//! | lengths, words, tests, lessons | [`house`] |
//!
//! Each check is a function of plain values ([`Tree`], [`Graph`]), so its tests show it a small bad tree that it must not like.

mod coverage;
mod graph;
mod heavy;
mod house;
mod layers;
mod pages;
mod purity;
mod tokens;
mod tree;
mod unsafety;

use std::fmt;

use crate::failure::Failure;
use crate::workspace::Workspace;
use graph::Graph;
use tree::Tree;

/// One thing that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Finding {
    place: String,
    what: String,
}

impl Finding {
    fn new(place: impl Into<String>, what: impl Into<String>) -> Finding {
        Finding { place: place.into(), what: what.into() }
    }

    fn at(path: &str, line: usize, what: impl Into<String>) -> Finding {
        Finding::new(format!("{path}:{line}"), what)
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}: {}", self.place, self.what)
    }
}

/// Runs all checks and prints what they find.
pub(crate) fn run(workspace: &Workspace) -> Result<(), Failure> {
    let tree = Tree::read(&workspace.root).map_err(|error| Failure::new(error.to_string(), ""))?;
    let graph = Graph::of(&workspace.metadata, &workspace.root);
    let checks: [(&str, Vec<Finding>); 8] = [
        ("layers", layers::check(&graph)),
        ("heavy names", heavy::check(&graph, heavy::OWNED)),
        ("purity", purity::check(&tree, &graph)),
        ("unsafe", unsafety::check(&tree, unsafety::ALLOWED)),
        ("house", house::check(&tree, &graph, house::LONG)),
        ("lessons", house::check_lessons(&tree)),
        ("documents", pages::check(&tree, &graph)),
        ("coverage", coverage::check(&tree)),
    ];
    let mut all = 0;
    for (name, findings) in &checks {
        let count = findings.len();
        println!("  {name:<12} {}", if count == 0 { "ok".to_owned() } else { format!("{count} found") });
        findings.iter().for_each(|finding| println!("    {finding}"));
        all += count;
    }
    if all == 0 {
        return Ok(());
    }
    Err(Failure::new(
        format!("tidy found {all}"),
        "Each line above names the place and what is wrong with it. Where a line between parts must move, move it in \
         ARCHITECTURE.md and in xtask/src/tidy together, with the reason.",
    ))
}

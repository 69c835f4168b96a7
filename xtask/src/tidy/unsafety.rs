//! `unsafe` stands in a few files only, each listed with its reason.

use std::collections::BTreeSet;

use super::Finding;
use super::tokens::tokens;
use super::tree::Tree;

/// Where `unsafe` may stand, and why it must.
pub(crate) const ALLOWED: &[(&str, &str)] = &[
    ("benches/peers/src/machine.rs", "a call of the operating system"),
    ("crates/hardware/src/latch/page.rs", "the latch is a word in a mapped file"),
    ("crates/program/src/signals.rs", "one thread takes the signals of the process"),
    ("crates/runtime/src/allocations.rs", "an allocator in front of another"),
    ("crates/runtime/src/context.rs", "what a thread owns is reached through a pointer to it"),
    (
        "crates/runtime/src/executor/change.rs",
        "an agent stops while another thread may take over the rest of its executor",
    ),
    (
        "crates/runtime/src/executor/step.rs",
        "a step runs while another thread may take over the rest of its executor",
    ),
    ("crates/runtime/src/fetch.rs", "a hint to the processor, which reads nothing"),
    ("crates/runtime/src/handover.rs", "the model uses an executor as the real threads do"),
    ("crates/runtime/src/log.rs", "messages are written down by their type's function"),
    ("crates/runtime/src/memory.rs", "slots are shared by pins"),
    ("crates/runtime/src/message_type.rs", "a message whose type is known at run time only"),
    (
        "crates/runtime/src/nonblocking.rs",
        "names two functions of a sanitizer, where the program is built with it",
    ),
    ("crates/runtime/src/os.rs", "calls of the operating system"),
    ("crates/runtime/src/port/input.rs", "an input is reached by its executor's thread alone"),
    ("crates/runtime/src/port/output.rs", "an output is reached by its executor's thread alone"),
    ("crates/runtime/src/port/router.rs", "an end at the router is reached by its executor's thread alone"),
    ("crates/runtime/src/queue/ring.rs", "slots have one owner at a time"),
    ("crates/runtime/src/ring.rs", "slots have one owner at a time"),
    ("crates/runtime/src/simulated.rs", "runs the same executors as the wall clock"),
    ("crates/runtime/src/trace.rs", "a ring of words between two threads"),
    ("crates/runtime/src/wall.rs", "executors are handed from thread to thread"),
    ("crates/runtime/tests/system/memory.rs", "an allocator that counts bytes"),
];

pub(crate) fn check(tree: &Tree, allowed: &[(&str, &str)]) -> Vec<Finding> {
    let mut needed = BTreeSet::new();
    let mut findings = Vec::new();
    for (path, text) in tree.rust("") {
        let Some(token) = tokens(text).into_iter().find(|token| token.text == "unsafe") else { continue };
        needed.insert(path);
        if !allowed.iter().any(|(known, _)| *known == path) {
            findings.push(Finding::at(
                path,
                token.line,
                "unsafe stands outside the files listed in xtask/src/tidy/unsafety.rs",
            ));
        }
    }
    let stale = allowed.iter().filter(|(path, _)| !needed.contains(path));
    findings.extend(
        stale.map(|(path, _)| {
            Finding::new(*path, "is listed in xtask/src/tidy/unsafety.rs but has no unsafe")
        }),
    );
    findings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unsafe_outside_the_list_and_a_stale_entry_are_found() {
        let tree = Tree::of(&[
            ("a.rs", "fn f() { unsafe { g() } }"),
            ("b.rs", "// unsafe\n#![forbid(unsafe_code)]"),
            ("c.rs", "fn f() {}\nunsafe fn g() {}"),
        ]);
        assert_eq!(check(&tree, &[("a.rs", "pointers"), ("c.rs", "calls")]), []);
        let found: Vec<String> =
            check(&tree, &[("a.rs", "pointers"), ("b.rs", "none")]).iter().map(Finding::to_string).collect();
        assert!(found[0].starts_with("c.rs:2: unsafe stands outside"), "{found:?}");
        assert!(found[1].starts_with("b.rs: is listed"), "{found:?}");
    }
}

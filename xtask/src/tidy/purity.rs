//! Algorithms compute and do nothing else: no clock, thread, file, global or chance of their own.
//!
//! Looked at is every crate below the runtime, every sibling of it, and the agents, which see time only through their step.
//! Tests may do what they like.

use super::Finding;
use super::graph::{Graph, Layer};
use super::tokens::{Token, tokens, without_tests};
use super::tree::Tree;

/// The runtime's own layer.
const RUNTIME: Layer = Layer::Number(2);

/// Parts of `std` that reach outside.
const STD: [(&str, &str); 8] = [
    ("fs", "reads or writes files"),
    ("io", "reads or writes"),
    ("net", "uses the network"),
    ("process", "runs or ends processes"),
    ("thread", "starts or stops threads"),
    ("env", "reads the environment"),
    ("os", "asks the operating system"),
    ("sync", "shares state between threads"),
];

/// Names that mean the same wherever they come from.
const NAMES: [(&str, &str); 13] = [
    ("Instant", "reads a clock: time comes in as an argument"),
    ("SystemTime", "reads a clock: time comes in as an argument"),
    ("thread_local", "is a global"),
    ("OnceLock", "is a global"),
    ("LazyLock", "is a global"),
    ("Mutex", "waits for other threads"),
    ("RwLock", "waits for other threads"),
    ("HashMap", "is ordered by chance; BTreeMap is not"),
    ("HashSet", "is ordered by chance; BTreeSet is not"),
    ("rand", "draws from a generator; a draw is a function of seed, stream and number (types::chance)"),
    ("fastrand", "draws from a generator; a draw is a function of seed, stream and number (types::chance)"),
    ("getrandom", "draws from a generator; a draw is a function of seed, stream and number (types::chance)"),
    ("libc", "asks the operating system"),
];

/// Macros that print.
const PRINTS: [&str; 5] = ["println", "print", "eprintln", "eprint", "dbg"];

/// Functions whose last bits differ between machines; `libm` has them all. Roots are exact everywhere.
const INEXACT: [&str; 21] = [
    "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2",
    "exp_m1", "ln", "ln_1p", "log10", "powf", "powi", "cbrt", "hypot",
];

pub(crate) fn check(tree: &Tree, graph: &Graph) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, member) in &graph.members {
        let below = member.layer.is_some_and(|layer| layer <= RUNTIME) && name != "sinew-runtime";
        if below || name == "sinew-agents" {
            findings.extend(check_crate(tree, &format!("{}/src", member.folder)));
        }
    }
    findings
}

fn check_crate(tree: &Tree, folder: &str) -> Vec<Finding> {
    let files: Vec<_> = tree.rust(folder).map(|(path, text)| (path, tokens(text))).collect();
    let parts: Vec<_> = files.iter().map(|(path, all)| (*path, without_tests(all))).collect();
    let tests: Vec<String> =
        parts.iter().flat_map(|(path, (_, modules))| test_files(path, modules)).collect();
    let mut findings = Vec::new();
    for (path, (kept, _)) in &parts {
        if !tests.iter().any(|test| {
            path == test || path.strip_prefix(test.as_str()).is_some_and(|rest| rest.starts_with('/'))
        }) {
            findings.extend(found(kept).into_iter().map(|(line, what)| Finding::at(path, line, what)));
        }
    }
    findings
}

/// The file or folder of each module that a file declares for tests alone.
fn test_files(path: &str, modules: &[&str]) -> Vec<String> {
    let folder = match path.rsplit_once('/') {
        Some((folder, "lib.rs" | "main.rs" | "mod.rs")) => folder,
        _ => path.trim_end_matches(".rs"),
    };
    modules.iter().flat_map(|name| [format!("{folder}/{name}.rs"), format!("{folder}/{name}")]).collect()
}

fn found(tokens: &[Token<'_>]) -> Vec<(usize, String)> {
    let mut out = Vec::new();
    let text = |at: usize| tokens.get(at).map_or("", |token| token.text);
    for (at, token) in tokens.iter().enumerate() {
        let word = token.text;
        let before = if at == 0 { "" } else { text(at - 1) };
        if let Some((_, why)) = NAMES.iter().find(|(name, _)| *name == word) {
            out.push((token.line, format!("{word} {why}")));
        } else if PRINTS.contains(&word) && text(at + 1) == "!" {
            out.push((token.line, format!("{word}! prints: only the program does")));
        } else if word == "static" && changes(&tokens[at..]) {
            out.push((token.line, "a static that changes is a global".to_owned()));
        } else if INEXACT.contains(&word) && text(at + 1) == "(" && before == "." {
            out.push((token.line, format!(".{word}() differs between machines: libm::{word}")));
        } else if INEXACT.contains(&word)
            && before == "::"
            && ["f64", "f32"].contains(&text(at.saturating_sub(2)))
        {
            out.push((token.line, format!("{word} differs between machines: libm::{word}")));
        } else if word == "std" && text(at + 1) == "::" {
            out.extend(std_parts(&tokens[at + 2..]));
        }
    }
    out
}

/// What a path or group after `std::` names of the parts that reach outside.
fn std_parts(tokens: &[Token<'_>]) -> Vec<(usize, String)> {
    let mut named = Vec::new();
    if tokens.first().is_some_and(|token| token.text == "{") {
        let (mut depth, mut begins) = (0usize, false);
        for token in tokens {
            match token.text {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ if begins && depth == 1 => named.push(token),
                _ => {}
            }
            begins = token.text == "," || token.text == "{";
            if depth == 0 {
                break;
            }
        }
    } else {
        named.extend(tokens.first());
    }
    let why = |token: &&Token<'_>| STD.iter().find(|(name, _)| *name == token.text).map(|(_, why)| *why);
    named
        .iter()
        .filter_map(|token| Some((token.line, format!("std::{} {}", token.text, why(token)?))))
        .collect()
}

/// Whether a static can change: it says so, or its type does.
fn changes(tokens: &[Token<'_>]) -> bool {
    let declared = tokens.iter().take_while(|token| token.text != "=" && token.text != ";");
    declared.skip(1).any(|token| {
        token.text == "mut"
            || token.text.starts_with("Atomic")
            || ["Cell", "RefCell", "UnsafeCell", "OnceCell"].contains(&token.text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph() -> Graph {
        Graph::default()
            .put("sinew-motion", Some(Layer::Number(1)), &[])
            .put("sinew-runtime", Some(Layer::Number(2)), &[])
            .put("sinew-agents", Some(Layer::Number(5)), &[])
            .put("sinew-record", Some(Layer::Number(3)), &[])
    }

    fn found_in(path: &str, text: &str) -> Vec<String> {
        check(&Tree::of(&[(path, text)]), &graph()).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn each_reach_outside_is_found_at_its_line() {
        for (source, expected) in [
            ("\nuse std::time::Instant;", "2: Instant reads a clock"),
            ("use std::{fmt, fs::{self, File}};", "1: std::fs reads or writes files"),
            ("fn f() { std::thread::yield_now() }", "1: std::thread starts"),
            ("static mut COUNT: u8 = 0;", "1: a static that changes"),
            ("static COUNT: AtomicU8 = AtomicU8::new(0);", "1: a static that changes"),
            ("fn f() { println!(\"\") }", "1: println! prints"),
            ("fn f(x: f64) -> f64 { x.sin() }", "1: .sin() differs"),
            ("fn f(x: f64) -> f64 { f64::cos(x) }", "1: cos differs"),
            ("use std::collections::HashMap;", "1: HashMap is ordered by chance"),
            ("fn f() -> u8 { rand::random() }", "1: rand draws"),
        ] {
            let found = found_in("crates/motion/src/a.rs", source);
            assert!(
                found.iter().any(|line| line.starts_with(&format!("crates/motion/src/a.rs:{expected}"))),
                "{source}: {found:?}"
            );
        }
    }

    #[test]
    fn plain_computing_is_fine() {
        let source = "
            //! Instant is spoken of only.
            use std::{fmt, ops::Add};
            static TABLE: [u8; 2] = [1, 2];
            fn f(x: f64) -> f64 { libm::sin(x).sqrt() }
            fn g() -> &'static str { \"println!\" }
            #[cfg(test)] mod tests { use std::time::Instant; fn t() { println!() } }";
        assert_eq!(found_in("crates/motion/src/lib.rs", source), [""; 0]);
    }

    #[test]
    fn agents_are_looked_at_and_those_who_must_reach_outside_are_not() {
        let source = "use std::fs;";
        assert_eq!(found_in("crates/agents/src/lib.rs", source).len(), 1);
        for path in ["crates/runtime/src/os.rs", "crates/record/src/lib.rs", "crates/motion/tests/a.rs"] {
            assert_eq!(found_in(path, source), [""; 0], "{path}");
        }
    }

    #[test]
    fn a_file_for_tests_alone_may_do_what_it_likes() {
        let tree = Tree::of(&[
            ("crates/motion/src/wall.rs", "#[cfg(test)] mod bench;"),
            ("crates/motion/src/wall/bench.rs", "use std::fs;"),
            ("crates/motion/src/bench.rs", "use std::fs;"),
        ]);
        let found: Vec<String> = check(&tree, &graph()).iter().map(Finding::to_string).collect();
        assert_eq!(found, ["crates/motion/src/bench.rs:1: std::fs reads or writes files"]);
    }
}

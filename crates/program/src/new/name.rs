//! The name of something new, in the forms in which files and code have it.

use crate::error::Failure;

/// Words that Rust keeps for itself, and crates that a new one would hide.
const TAKEN: [&str; 48] = [
    "abstract", "alloc", "as", "async", "await", "become", "box", "break", "const", "continue", "core",
    "crate", "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in",
    "let", "loop", "macro", "main", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "sinew", "static", "std", "struct", "super", "test", "trait", "use", "while",
];

/// The longest name that fits into a message.
const LONGEST: usize = 23;

/// A name of words of small letters and digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Name {
    words: Vec<String>,
}

impl Name {
    /// Reads `wall-watcher`, `wall_watcher` or `WallWatcher`.
    pub(super) fn read(name: &str) -> Result<Name, Failure> {
        let mut words: Vec<String> = vec![String::new()];
        for c in name.chars() {
            let begins = c == '-' || c == '_' || c.is_ascii_uppercase();
            if begins && words.last().is_some_and(|word| !word.is_empty()) {
                words.push(String::new());
            }
            if let (true, Some(word)) = (c.is_ascii_alphanumeric(), words.last_mut()) {
                word.push(c.to_ascii_lowercase());
            } else if c != '-' && c != '_' {
                return Err(Name::bad(name, "it has other letters than a-z, 0-9, - and _"));
            }
        }
        words.retain(|word| !word.is_empty());
        let read = Name { words };
        let begins_well = read.words.iter().all(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()));
        if read.words.is_empty() || !begins_well {
            return Err(Name::bad(name, "each of its words must begin with a letter"));
        }
        if read.kebab().len() > LONGEST {
            return Err(Name::bad(name, "it has more than 23 letters"));
        }
        if TAKEN.contains(&read.snake().as_str()) {
            return Err(Name::bad(name, "it is taken"));
        }
        if agents::registry().get(&read.kebab()).is_some() || read.kebab() == "robot" {
            return Err(Name::bad(name, "there is an agent type of this name"));
        }
        Ok(read)
    }

    fn bad(name: &str, why: &str) -> Failure {
        Failure::new(format!("\"{name}\" cannot be the name: {why}")).help("take one such as wall-watcher")
    }

    /// `wall-watcher`, as in system files.
    pub(super) fn kebab(&self) -> String {
        self.words.join("-")
    }

    /// `wall_watcher`, as modules have it.
    pub(super) fn snake(&self) -> String {
        self.words.join("_")
    }

    /// `WallWatcher`, as types have it.
    pub(super) fn camel(&self) -> String {
        let capital = |word: &String| word[..1].to_ascii_uppercase() + &word[1..];
        self.words.iter().map(capital).collect()
    }

    /// A template with the name in it.
    pub(super) fn fill(&self, template: &str) -> String {
        template
            .replace("@NAME@", &self.kebab())
            .replace("@KIND@", &self.kebab())
            .replace("@FILE@", &self.kebab())
            .replace("@MODULE@", &self.snake())
            .replace("@TYPE@", &self.camel())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_three_forms() {
        for name in ["wall-watcher", "wall_watcher", "WallWatcher"] {
            let name = Name::read(name).unwrap();
            assert_eq!(
                (name.kebab(), name.snake(), name.camel()),
                ("wall-watcher".into(), "wall_watcher".into(), "WallWatcher".into())
            );
        }
    }

    #[test]
    fn what_would_not_build_is_refused() {
        for name in [
            "",
            "7up",
            "wall-7",
            "a b",
            "käse",
            "loop",
            "Sinew",
            "sonar",
            "../x",
            "a-name-of-far-too-many-letters",
        ] {
            let said = Name::read(name).unwrap_err().problems[0].what.clone();
            assert!(said.contains("cannot be the name"), "{name}: {said}");
        }
    }
}

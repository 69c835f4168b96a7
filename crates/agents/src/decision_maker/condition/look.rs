//! What can be seen to be wrong in a condition before it is parsed. The parser is for a whole language, and calls itself as deeply as a
//! text is nested: what has no meaning here does not reach it.

use types::value::{Mistake, Span};

use super::{DEEPEST, EXAMPLE, too_deep};

/// No condition that people read is longer than this (bytes).
const LONGEST: usize = 256;
/// What stands in conditions beside letters, digits and spaces.
const SIGNS: &str = "_.+-*/(),<>=!&|";

fn span(start: usize, len: usize) -> Span {
    Span { start: start as u32, end: (start + len) as u32 }
}

/// The first mistake.
pub(super) fn looked_over(text: &str) -> Option<Mistake> {
    let whole = span(0, text.len());
    if text.trim().is_empty() {
        return Some(Mistake::new(whole, "the condition is empty").help(EXAMPLE));
    }
    if text.len() > LONGEST {
        let what = format!("the condition is too long: {} characters, {LONGEST} have room", text.len());
        return Some(Mistake::new(whole, what).help("make two situations of it"));
    }
    let has_meaning = |c: char| c.is_ascii_alphanumeric() || c.is_ascii_whitespace() || SIGNS.contains(c);
    if let Some((at, c)) = text.char_indices().find(|(_, c)| !has_meaning(*c)) {
        return Some(Mistake::new(span(at, c.len_utf8()), format!("\"{c}\" means nothing in a condition")));
    }
    brackets(text).or_else(|| assignment(text)).or_else(|| foreign_word(text))
}

fn brackets(text: &str) -> Option<Mistake> {
    let mut open = Vec::new();
    for (at, c) in text.char_indices() {
        let here = span(at, 1);
        match c {
            '(' => open.push(here),
            ')' if open.pop().is_none() => return Some(Mistake::new(here, "this bracket closes none")),
            _ => {}
        }
        if open.len() > DEEPEST {
            return Some(too_deep(here));
        }
    }
    open.pop().map(|at| Mistake::new(at, "this bracket is not closed"))
}

/// One "=" alone.
fn assignment(text: &str) -> Option<Mistake> {
    let bytes = text.as_bytes();
    let before = |at: usize| at.checked_sub(1).is_some_and(|before| b"=<>!".contains(&bytes[before]));
    let behind = |at: usize| bytes.get(at + 1) == Some(&b'=');
    let at = (0..bytes.len()).find(|&at| bytes[at] == b'=' && !before(at) && !behind(at))?;
    Some(Mistake::new(span(at, 1), "\"=\" does not compare").help("write =="))
}

/// A word that other languages have.
fn foreign_word(text: &str) -> Option<Mistake> {
    let mut start = 0;
    for word in text.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')) {
        let instead = match word {
            "and" => Some("write &&"),
            "or" => Some("write ||"),
            "not" => Some("write !"),
            "as" => Some(EXAMPLE),
            _ => None,
        };
        if let Some(instead) = instead {
            let what = format!("\"{word}\" is no word here");
            return Some(Mistake::new(span(start, word.len()), what).help(instead));
        }
        start += word.len() + 1;
    }
    None
}

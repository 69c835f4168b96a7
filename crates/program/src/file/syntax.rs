//! Syntax errors, all of them, in words for people who do not know the grammar of TOML.

use std::ops::Range;

use toml::de::DeTable;
use types::value::{Mistake, Span};

/// More errors than this help nobody.
const MOST: usize = 30;

/// All syntax errors of a text and where they stand. The parser loses its way at the first, so what is wrong is taken out of
/// the text and the rest is parsed again.
pub(super) fn mistakes(text: &str) -> Vec<(Range<usize>, Mistake)> {
    let mut rest = text.to_owned();
    let mut found = Vec::new();
    while found.len() < MOST {
        let (_, errors) = DeTable::parse_recoverable(&rest);
        let seen = errors.iter().map(|error| (seen(error.span().unwrap_or(0..0), &rest), error.message()));
        let Some((range, message)) = seen.min_by_key(|(range, _)| range.start) else { break };
        // What was taken out may have been half of a letter.
        let range = text.floor_char_boundary(range.start)..text.ceil_char_boundary(range.end);
        // An open bracket swallows what follows: whatever the parser says after it is not the cause.
        match open_bracket(&rest).filter(|open| open.bracket <= range.start) {
            Some(Open { bracket, ends }) => {
                found.push((bracket..bracket + 1, never_closed(&text[bracket..bracket + 1])));
                take_out(&mut rest, bracket..ends.max(bracket + 1), found.len());
            }
            None => {
                found.push((
                    range.clone(),
                    in_our_words(message, &text[range.clone()], &line_of(text, range.start)),
                ));
                take_out(&mut rest, range, found.len());
            }
        }
    }
    found.sort_by_key(|(range, _)| range.start);
    found
}

fn line_of(text: &str, at: usize) -> String {
    let start = text[..at].rfind('\n').map_or(0, |at| at + 1);
    text[start..].lines().next().unwrap_or("").trim().to_owned()
}

/// Blanks the lines of a range. A heading becomes one that nobody else has, so that what follows does not fall to the section
/// before it.
fn take_out(text: &mut String, range: Range<usize>, number: usize) {
    let start = text[..range.start].rfind('\n').map_or(0, |at| at + 1);
    let last = range.end.max(range.start + 1).min(text.len()) - 1;
    let end =
        text.as_bytes()[last..].iter().position(|&byte| byte == b'\n').map_or(text.len(), |at| last + at);
    let lines = &text[start..end];
    let mut instead: String = lines.bytes().map(|byte| if byte == b'\n' { '\n' } else { ' ' }).collect();
    if lines.starts_with('[') && !lines.contains('\n') && lines.len() > 2 {
        instead = format!("[{number:_<width$}]", width = lines.len() - 2);
    }
    if instead.len() == lines.len() {
        text.replace_range(start..end, &instead);
    } else {
        // No room for a name of its own: the rest of the text is not looked at.
        text.truncate(start);
    }
}

/// What to show for the span of an error. An empty one lies behind the cause: the word before it is shown.
fn seen(range: Range<usize>, text: &str) -> Range<usize> {
    // The parser counts bytes and may end inside a letter.
    let (start, end) = (text.floor_char_boundary(range.start), text.ceil_char_boundary(range.end));
    if range.start < range.end && !text[start..end].trim().is_empty() {
        return start..end;
    }
    let end = text[..start].trim_end_matches([' ', '\t', '\r', '\n']).len();
    let begin = text[..end].rfind(|c: char| c.is_whitespace()).map_or(0, |at| at + 1);
    if begin < end {
        return begin..end;
    }
    // Nothing stands before it: a place is at least one letter wide.
    let start = start.min(text.len().saturating_sub(1));
    start..(start + 1).min(text.len())
}

/// The parser's message about `word` in our words.
fn in_our_words(message: &str, word: &str, line: &str) -> Mistake {
    let (what, help) = match message.split(',').next().unwrap_or(message) {
        "string values must be quoted" if word.ends_with('=') => {
            ("there is no value after the \"=\"".to_owned(), String::new())
        }
        "string values must be quoted" => {
            let help = format!("if it is a text, write \"{}\"", word.trim());
            (format!("`{}` is no number, and a text or time needs quotes", word.trim()), help)
        }
        "invalid boolean" => {
            (format!("`{word}` is no value"), "write true or false, in small letters".to_owned())
        }
        "duplicate key" => (
            format!("`{word}` is here for the second time"),
            "two entries or sections cannot have one name; join them, or rename one".to_owned(),
        ),
        "key with no value" => {
            let rest =
                line.strip_prefix(word).map(str::trim).filter(|rest| rest.starts_with(['"', '[', '{', ':']));
            let help = match rest {
                Some(rest) => format!("write {word} = {}", rest.trim_start_matches([':', ' '])),
                None => "an entry is written as in name = \"exploration\", a section as in [agent.sonar]"
                    .to_owned(),
            };
            (format!("`{word}` has no value"), help)
        }
        "invalid basic string" | "invalid literal string" => {
            ("this text is not closed".to_owned(), "it needs a quote at its end, on the same line".to_owned())
        }
        "unclosed table" => {
            ("this heading is not closed".to_owned(), "it needs a \"]\" at its end".to_owned())
        }
        "unexpected key or value" => (
            format!("nothing can follow `{word}` on this line"),
            "every entry has a line of its own".to_owned(),
        ),
        "invalid unquoted key" => (
            format!("`{word}` is no name"),
            "a name with other letters than a-z, A-Z, 0-9, - and _ needs quotes; a comment begins with #"
                .to_owned(),
        ),
        "unquoted keys cannot be empty" => ("here a name is missing".to_owned(), String::new()),
        "invalid mantissa" | "invalid fraction" => {
            ("this number needs digits on both sides of its point".to_owned(), "write 0.5, or 1.0".to_owned())
        }
        first if first.starts_with("missing comma") => {
            (format!("a comma is missing after `{word}`"), String::new())
        }
        first if first.starts_with("cannot extend value") => {
            (format!("`{word}` has a value already, it cannot be a section as well"), String::new())
        }
        _ => (message.to_owned(), String::new()),
    };
    let mistake = Mistake::new(Span::default(), what);
    if help.is_empty() { mistake } else { mistake.help(help) }
}

/// A bracket that is never closed.
fn never_closed(bracket: &str) -> Mistake {
    let closing = if bracket == "[" { "]" } else { "}" };
    Mistake::new(Span::default(), format!("this \"{bracket}\" is never closed"))
        .help(format!("put a \"{closing}\" where the list or table ends"))
}

/// A bracket that is not closed.
struct Open {
    /// Where it stands.
    bracket: usize,
    /// Where something else begins, or the text ends.
    ends: usize,
}

/// The bracket of a value that is still open when a new section, a new entry or the end of the text comes.
fn open_bracket(text: &str) -> Option<Open> {
    let mut open: Vec<Bracket> = Vec::new();
    let mut offset: usize = 0;
    for line in text.split_inclusive('\n') {
        if let Some(&Bracket { at, in_list }) = open.last()
            && (is_heading(line) || (in_list && is_entry(line)))
        {
            return Some(Open { bracket: at, ends: offset.saturating_sub(1) });
        }
        if !(open.is_empty() && line.trim_start().starts_with('[')) {
            scan(line, offset, &mut open);
        }
        offset += line.len();
    }
    open.last().map(|bracket| Open { bracket: bracket.at, ends: text.len() })
}

/// A bracket on the way through a text.
#[derive(Clone, Copy)]
struct Bracket {
    at: usize,
    /// It, or one around it, begins a list.
    in_list: bool,
}

/// `[agent.sonar]` or `[[at]]`, which inside a list would be a list of a word without quotes.
fn is_heading(line: &str) -> bool {
    let line = line.split('#').next().unwrap_or("").trim();
    line.starts_with('[')
        && line.ends_with(']')
        && line.trim_matches(['[', ']']).starts_with(|c: char| c.is_ascii_alphabetic())
        && !line.contains([',', '='])
}

/// `period = …`, which inside a list would be no item.
fn is_entry(line: &str) -> bool {
    let name = line.trim_start();
    let rest = match name.strip_prefix('"') {
        Some(quoted) => quoted.split_once('"').map_or("", |(_, rest)| rest),
        None => name.trim_start_matches(|c: char| c.is_ascii_alphanumeric() || "._-".contains(c)),
    };
    rest.len() < name.len() && rest.trim_start().starts_with('=')
}

/// Follows the brackets of a line; texts and comments are passed over.
fn scan(line: &str, offset: usize, open: &mut Vec<Bracket>) {
    let mut quote = None;
    let mut escaped = false;
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (Some('"'), _) if escaped => escaped = false,
            (Some('"'), '\\') => escaped = true,
            (Some(q), c) if c == q => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, '#') => return,
            (None, '[' | '{') => {
                let in_list = c == '[' || open.last().is_some_and(|around| around.in_list);
                open.push(Bracket { at: offset + at, in_list });
            }
            (None, ']' | '}') => {
                open.pop();
            }
            (None, _) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A text has mistakes exactly when the parser refuses it, and looking for them ends.
        #[test]
        fn what_is_refused_has_a_mistake(text in "([\\[\\]{}=\"' ,.a-c1\n#]|\\[a\\]\n|a = 1\n|ä){0,40}") {
            prop_assert_eq!(mistakes(&text).is_empty(), DeTable::parse(&text).is_ok());
            prop_assert!(mistakes(&text).iter().all(|(range, _)| range.start < range.end), "each has a place");
        }
    }

    #[test]
    fn a_mistake_with_nothing_before_it_has_a_place() {
        let places: Vec<_> = mistakes("]").iter().map(|(range, _)| (range.start, range.end)).collect();
        assert_eq!(places, [(0, 1)]);
    }

    #[test]
    fn the_bracket_that_was_forgotten_is_found() {
        for (text, at) in [
            ("a = [1, 2\nb = 3\n", Some(4)),
            ("[wires]\n\"a.b\" = [\"c.d\"\n\n[decide]\n", Some(16)),
            ("a = [{ x = 1 }, { y = 2\n]\n[b]\n", Some(4)),
            ("a = { x = [1, 2 }\n", Some(4)),
            ("a = [\n  [1, 2],\n  [\"]\", 4], # [\n]\n[b.c]\n", None),
            ("stage = [\n  { inside = \"[\" },\n]\n", None),
        ] {
            assert_eq!(open_bracket(text).map(|open| open.bracket), at, "{text}");
        }
    }
}

//! The texts that a plan was read from, and which place of which text a span is.

use std::fmt;

use types::value::{Mistake, Span};

use crate::error::{Paint, Place, Problem};

/// The texts that a plan was read from. Each has a range of its own in one common count of bytes, so that a span alone says
/// which text it belongs to.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    texts: Vec<Source>,
}

#[derive(Clone, Debug)]
struct Source {
    name: String,
    text: String,
    base: u32,
}

/// All that is wrong in a system file, its world and its parts.
#[derive(Clone, Debug)]
pub struct Mistakes {
    /// The texts in which the mistakes stand.
    pub sources: Sources,
    /// The mistakes, in the order of the texts; at least one.
    pub list: Vec<Mistake>,
}

impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, mistake) in self.list.iter().enumerate() {
            let problem = Problem::of(mistake, &self.sources);
            write!(f, "{}{}", if i > 0 { "\n" } else { "" }, problem.to_text(Paint::Plain))?;
        }
        Ok(())
    }
}

impl std::error::Error for Mistakes {}

impl Sources {
    /// Adds a text and gives the count at which it begins.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> u32 {
        // One more than the length, so that the end of a text is still a place in it.
        let base = self.texts.last().map_or(0, |last| last.base + last.text.len() as u32 + 1);
        self.texts.push(Source { name: name.into(), text: text.into(), base });
        base
    }

    /// The text that begins at `base`.
    pub fn text(&self, base: u32) -> &str {
        self.texts.iter().find(|source| source.base == base).map_or("", |source| &source.text)
    }

    /// The name of the text that begins at `base`.
    pub fn name(&self, base: u32) -> &str {
        self.texts.iter().find(|source| source.base == base).map_or("", |source| &source.name)
    }

    /// The place of a span; none for the empty span of what was made in code.
    pub fn place(&self, span: Span) -> Option<Place> {
        if span.start >= span.end {
            return None;
        }
        let source = self.texts.iter().rev().find(|source| source.base <= span.start)?;
        let start = source.text.floor_char_boundary((span.start - source.base) as usize);
        let end = source.text.floor_char_boundary((span.end - source.base) as usize).max(start);
        let line_start = source.text[..start].rfind('\n').map_or(0, |at| at + 1);
        let line_end = source.text[start..].find('\n').map_or(source.text.len(), |at| start + at);
        let text = source.text[line_start..line_end].trim_end_matches('\r').to_owned();
        Some(Place {
            file: source.name.clone(),
            line: source.text[..start].matches('\n').count() + 1,
            column: source.text[line_start..start].chars().count() + 1,
            width: source.text[start..end.min(line_end)].trim_end().chars().count().max(1),
            text,
        })
    }

    /// The span of the first appearance of `word` in any text.
    #[cfg(test)]
    pub(crate) fn text_span(&self, word: &str) -> Span {
        let found = self.texts.iter().find_map(|source| Some((source.base, source.text.find(word)? as u32)));
        let (base, at) = found.expect("the word is there");
        Span { start: base + at, end: base + at + word.len() as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_says_its_text_line_and_column() {
        let mut sources = Sources::default();
        sources.add("a.toml", "one\ntwo");
        let base = sources.add("b.toml", "drei\r\nvier\r\n");
        let place = |start, end| {
            let place = sources.place(Span { start, end }).unwrap();
            (place.file, place.line, place.column, place.text, place.width)
        };
        assert_eq!(place(4, 7), ("a.toml".into(), 2, 1, "two".into(), 3));
        assert_eq!(place(7, 8), ("a.toml".into(), 2, 4, "two".into(), 1), "the end of a text is a place");
        assert_eq!(place(base + 7, base + 20), ("b.toml".into(), 2, 2, "vier".into(), 3));
        assert_eq!(sources.place(Span::default()), None);
    }
}

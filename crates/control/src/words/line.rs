//! A line of text as words, and back.

use runtime::Refusal;

/// Splits a line at white space, as a shell does: what stands between quotation marks of either kind is kept together, and
/// within the double ones `\"` and `\\` stand for `"` and `\`.
///
/// ```
/// assert_eq!(control::words::split("set wall side='far left'").unwrap(), ["set", "wall", "side=far left"]);
/// ```
///
/// # Errors
/// When a quotation mark is never closed.
pub fn split(line: &str) -> Result<Vec<String>, Refusal> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut chars = line.chars();
    while let Some(c) = chars.next() {
        match c {
            '\'' | '"' => quoted(c, &mut chars, word.get_or_insert_default()).ok_or_else(|| {
                Refusal::new(format!("a quotation mark {c} is not closed in: {line}"))
                    .help("close it, or put the other kind around it")
            })?,
            c if c.is_whitespace() => words.extend(word.take()),
            c => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    Ok(words)
}

fn quoted(mark: char, chars: &mut std::str::Chars<'_>, word: &mut String) -> Option<()> {
    loop {
        match chars.next()? {
            c if c == mark => return Some(()),
            '\\' if mark == '"' => match chars.next()? {
                c @ ('"' | '\\') => word.push(c),
                c => word.extend(['\\', c]),
            },
            c => word.push(c),
        }
    }
}

/// Joins words to a line that [`split`] takes apart again.
pub fn join<W: AsRef<str>>(words: &[W]) -> String {
    let words: Vec<String> = words.iter().map(|word| quote(word.as_ref())).collect();
    words.join(" ")
}

fn quote(word: &str) -> String {
    if !word.is_empty() && !word.contains(|c: char| c.is_whitespace() || c == '\'' || c == '"') {
        word.to_owned()
    } else if !word.contains('\'') {
        format!("'{word}'")
    } else {
        format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn quotes_keep_words_together() {
        for (line, words) in [
            ("", vec![]),
            ("  a  b\tc ", vec!["a", "b", "c"]),
            ("a='b c'd", vec!["a=b cd"]),
            (r#""a \"b\" \\ \n" ''"#, vec![r#"a "b" \ \n"#, ""]),
            (r"a\b", vec![r"a\b"]),
        ] {
            assert_eq!(split(line).unwrap(), words, "{line}");
        }
        assert!(split("a 'b").is_err() && split("\"a\\").is_err());
    }

    proptest! {
        #[test]
        fn what_is_joined_is_split_again(words in proptest::collection::vec(any::<String>(), 0..5)) {
            prop_assert_eq!(split(&join(&words)).unwrap(), words);
        }
    }
}

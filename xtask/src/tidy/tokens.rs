//! Rust source as words, without comments, texts and tests.

/// A word or sign of the source and its line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Token<'a> {
    pub(crate) text: &'a str,
    pub(crate) line: usize,
}

/// The words and signs of a source. Comments are left out; a text or character is the single sign `"`.
pub(crate) fn tokens(source: &str) -> Vec<Token<'_>> {
    let mut out = Vec::new();
    let (mut at, mut line) = (0, 1);
    while at < source.len() {
        let rest = &source[at..];
        let (len, shown) = next(rest);
        let text = match shown {
            Shown::Nothing => "",
            Shown::Itself => &rest[..len],
            Shown::Quote => "\"",
        };
        if !text.is_empty() {
            out.push(Token { text, line });
        }
        line += rest[..len].matches('\n').count();
        at += len;
    }
    out
}

enum Shown {
    Nothing,
    Itself,
    Quote,
}

/// How long the next thing is, and what of it counts.
fn next(rest: &str) -> (usize, Shown) {
    let first = rest.chars().next().unwrap_or(' ');
    if first.is_whitespace() {
        (first.len_utf8(), Shown::Nothing)
    } else if rest.starts_with("//") {
        (rest.find('\n').unwrap_or(rest.len()), Shown::Nothing)
    } else if rest.starts_with("/*") {
        (block_comment(rest), Shown::Nothing)
    } else if let Some(len) = raw_text(rest) {
        (len, Shown::Quote)
    } else if let Some(prefix) = ["\"", "b\"", "c\"", "b'"].iter().find(|prefix| rest.starts_with(**prefix)) {
        (prefix.len() + quoted(&rest[prefix.len()..], &prefix[prefix.len() - 1..]), Shown::Quote)
    } else if first == '\'' {
        apostrophe(rest)
    } else if first == '_' || first.is_alphanumeric() {
        let len = rest.find(|c: char| c != '_' && !c.is_alphanumeric()).unwrap_or(rest.len());
        (len, Shown::Itself)
    } else if rest.starts_with("::") {
        (2, Shown::Itself)
    } else {
        (first.len_utf8(), Shown::Itself)
    }
}

fn block_comment(rest: &str) -> usize {
    let (mut depth, mut at) = (0usize, 0);
    while at < rest.len() {
        if rest[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if rest[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += rest[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    at
}

/// The length of `r"…"`, `r#"…"#`, with `b` or `c` in front.
fn raw_text(rest: &str) -> Option<usize> {
    let body =
        rest.strip_prefix("br").or_else(|| rest.strip_prefix("cr")).or_else(|| rest.strip_prefix('r'))?;
    let hashes = body.len() - body.trim_start_matches('#').len();
    let inner = body[hashes..].strip_prefix('"')?;
    let end = format!("\"{}", "#".repeat(hashes));
    let len = inner.find(&end).map_or(inner.len(), |at| at + end.len());
    Some(rest.len() - inner.len() + len)
}

/// The length of what stands up to the closing mark, and the mark.
fn quoted(inner: &str, mark: &str) -> usize {
    let mut escaped = false;
    for (at, c) in inner.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if mark.starts_with(c) => return at + c.len_utf8(),
            _ => {}
        }
    }
    inner.len()
}

/// A character or a lifetime.
fn apostrophe(rest: &str) -> (usize, Shown) {
    let mut inner = rest[1..].chars();
    let (one, two) = (inner.next(), inner.next());
    if one == Some('\\') || two == Some('\'') {
        return (1 + quoted(&rest[1..], "'"), Shown::Quote);
    }
    let len = rest[1..].find(|c: char| c != '_' && !c.is_alphanumeric()).unwrap_or(rest.len() - 1);
    (1 + len, Shown::Itself)
}

/// What is left of a source when its tests are taken out, and the names of the modules in other files that are tests.
pub(crate) fn without_tests<'a>(tokens: &[Token<'a>]) -> (Vec<Token<'a>>, Vec<&'a str>) {
    let (mut kept, mut modules) = (Vec::new(), Vec::new());
    let mut at = 0;
    while at < tokens.len() {
        if !opens_attribute(tokens, at) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let end = closing(tokens, at + 1);
        if is_test(&tokens[at + 2..end]) {
            let item_end = item(tokens, end + 1);
            modules.extend(outside_module(&tokens[end + 1..item_end]));
            at = item_end;
        } else {
            kept.extend_from_slice(&tokens[at..=end]);
            at = end + 1;
        }
    }
    (kept, modules)
}

fn is(tokens: &[Token<'_>], at: usize, text: &str) -> bool {
    tokens.get(at).is_some_and(|token| token.text == text)
}

fn opens_attribute(tokens: &[Token<'_>], at: usize) -> bool {
    is(tokens, at, "#") && is(tokens, at + 1, "[")
}

/// Where the bracket that opens at `at` closes.
fn closing(tokens: &[Token<'_>], at: usize) -> usize {
    let mut depth = 0usize;
    for (i, token) in tokens.iter().enumerate().skip(at) {
        match token.text {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return i;
        }
    }
    tokens.len() - 1
}

/// `test`, `cfg(test)` and `cfg(all(test, …))`, but not `cfg(not(test))`.
fn is_test(inside: &[Token<'_>]) -> bool {
    let named = |at: usize| inside[at].text == "test" && !(at >= 2 && inside[at - 2].text == "not");
    match inside.first().map(|token| token.text) {
        Some("test") => inside.len() == 1,
        Some("cfg") => (1..inside.len()).any(named),
        _ => false,
    }
}

/// Where the item that begins at `at` is over.
fn item(tokens: &[Token<'_>], mut at: usize) -> usize {
    while opens_attribute(tokens, at) {
        at = closing(tokens, at + 1) + 1;
    }
    let field = is(tokens, at + 1, ":");
    while at < tokens.len() {
        match tokens[at].text {
            ";" => return at + 1,
            "," if field => return at + 1,
            "{" => return closing(tokens, at) + 1,
            "(" | "[" => at = closing(tokens, at),
            ")" | "]" | "}" => return at,
            _ => {}
        }
        at += 1;
    }
    tokens.len()
}

/// `name` of `mod name;`.
fn outside_module<'a>(item: &[Token<'a>]) -> Option<&'a str> {
    let at = item.iter().position(|token| token.text == "mod")?;
    is(item, at + 2, ";").then(|| item[at + 1].text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(source: &str) -> Vec<&str> {
        tokens(source).into_iter().map(|token| token.text).collect()
    }

    #[test]
    fn comments_texts_and_characters_are_no_words() {
        let source = "a // unsafe\n/* unsafe /* more */ */ \"unsafe \\\" unsafe\" r#\"un\"safe\"# b'\\'' 'x' '\\'' 'life b";
        assert_eq!(words(source), ["a", "\"", "\"", "\"", "\"", "\"", "'life", "b"]);
    }

    #[test]
    fn lines_are_counted_through_texts_and_comments() {
        let source = "/*\n*/ \"\n\n\" last";
        assert_eq!(tokens(source).last().unwrap(), &Token { text: "last", line: 4 });
    }

    #[test]
    fn tests_are_taken_out_and_nothing_else() {
        let source = "
            struct A { #[cfg(test)] probe: Vec<u8>, kept: u8 }
            #[cfg(test)] mod scratch;
            #[cfg(all(test, loom))] mod model { fn gone() { if a { b } } }
            #[cfg(not(test))] fn stays<A, B>() {}
            #[derive(Debug)] struct Also;
            #[cfg(test)] #[allow(x)] pub fn helper<A, B>(a: [u8; 3]) -> u8 { 1 }
            fn end() {}";
        let tokens = tokens(source);
        let (kept, modules) = without_tests(&tokens);
        let kept: Vec<&str> = kept.iter().map(|token| token.text).collect();
        for gone in ["probe", "scratch", "model", "gone", "helper"] {
            assert!(!kept.contains(&gone), "{gone} in {kept:?}");
        }
        for stays in ["kept", "stays", "Also", "end"] {
            assert!(kept.contains(&stays), "{stays} in {kept:?}");
        }
        assert_eq!(modules, ["scratch"]);
    }
}

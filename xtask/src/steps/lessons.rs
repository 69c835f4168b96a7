//! The numbered examples: each is run, and prints what its last comment says.

use std::path::{Path, PathBuf};

use super::Done;
use crate::failure::Failure;
use crate::tool::Tool;
use crate::workspace::Workspace;

/// The line after which a lesson says what it prints.
const MARK: &str = "// Output:";

pub(super) fn run(workspace: &Workspace) -> Result<Done, Failure> {
    let lessons = lessons(&workspace.root.join("examples"));
    for lesson in &lessons {
        check(workspace, lesson)?;
    }
    if lessons.is_empty() {
        return Ok(Done::Skipped("there are no lessons in examples/ yet".to_owned()));
    }
    Ok(Done::Passed(format!("{} lessons", lessons.len())))
}

fn lessons(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "rs"));
    paths.sort();
    paths
}

fn check(workspace: &Workspace, lesson: &Path) -> Result<(), Failure> {
    let name = lesson.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let source =
        std::fs::read_to_string(lesson).map_err(|error| Failure::new(format!("{name}: {error}"), ""))?;
    let remedy = format!("A lesson ends with a line `{MARK}` and what it prints as a comment.");
    let expected = expected_output(&source)
        .ok_or_else(|| Failure::new(format!("{name} does not say what it prints"), remedy))?;
    let cargo = Tool::cargo(&workspace.root).args(["run", "--quiet", "-p", "sinew", "--example", &name]);
    let printed = cargo.text("A lesson must end well; run it alone with the command above.")?;
    match first_difference(&expected, &printed) {
        None => Ok(()),
        Some(what) => Err(Failure::new(
            format!("{name} does not print what it says: {what}"),
            "Mend the lesson, or the comment at its end.",
        )),
    }
}

/// What a lesson says it prints: the comment after the mark, up to the end of the file.
pub(crate) fn expected_output(source: &str) -> Option<String> {
    let lines: Vec<&str> = source.lines().collect();
    let mark = lines.iter().rposition(|line| *line == MARK)?;
    let said: Option<Vec<&str>> = lines[mark + 1..].iter().map(|line| line.strip_prefix("//")).collect();
    let said: Vec<&str> = said?.into_iter().map(|line| line.strip_prefix(' ').unwrap_or(line)).collect();
    (!said.is_empty()).then(|| said.join("\n"))
}

fn first_difference(expected: &str, printed: &str) -> Option<String> {
    let mut expected = expected.trim_end().lines();
    let mut printed = printed.trim_end().lines();
    for number in 1.. {
        match (expected.next(), printed.next()) {
            (None, None) => return None,
            (expected, printed) if expected.map(str::trim_end) == printed.map(str::trim_end) => {}
            (expected, printed) => {
                let show =
                    |line: Option<&str>| line.map_or("nothing".to_owned(), |line| format!("\"{line}\""));
                return Some(format!("line {number} is {}, not {}", show(printed), show(expected)));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_comment_says_what_is_printed() {
        let source = "// Output:\n// not this\nfn main() {}\n\n// Output:\n// one\n//\n//  two\n";
        assert_eq!(expected_output(source).unwrap(), "one\n\n two");
        assert_eq!(expected_output("fn main() {}"), None);
        assert_eq!(expected_output("// Output:\n// one\nfn main() {}"), None, "code after it");
        assert_eq!(expected_output("fn main() {}\n// Output:\n"), None, "nothing after it");
    }

    #[test]
    fn a_difference_is_told_with_its_line() {
        assert_eq!(first_difference("a\nb", "a  \nb\n\n"), None);
        assert_eq!(first_difference("a\nb", "a\nc").unwrap(), "line 2 is \"c\", not \"b\"");
        assert_eq!(first_difference("a\nb", "a").unwrap(), "line 2 is nothing, not \"b\"");
        assert_eq!(first_difference("a", "a\nb").unwrap(), "line 2 is \"b\", not nothing");
    }
}

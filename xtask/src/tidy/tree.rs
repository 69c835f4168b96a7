//! The files of the repository, as texts by their paths.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

/// What is never looked at: it is built, recorded or kept by other programs.
const PASSED_OVER: [&str; 3] = ["target", ".git", "out"];

/// A folder read into memory. Paths are relative, with `/`.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    texts: BTreeMap<String, String>,
    paths: BTreeSet<String>,
}

impl Tree {
    pub(crate) fn read(root: &Path) -> io::Result<Tree> {
        let mut tree = Tree::default();
        tree.read_folder(root, "")?;
        Ok(tree)
    }

    fn read_folder(&mut self, folder: &Path, prefix: &str) -> io::Result<()> {
        for entry in std::fs::read_dir(folder)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let kind = entry.file_type()?;
            if PASSED_OVER.contains(&name.as_str()) || kind.is_symlink() {
                continue;
            }
            let path = format!("{prefix}{name}");
            if kind.is_dir() {
                self.read_folder(&entry.path(), &format!("{path}/"))?;
            } else {
                match std::fs::read(entry.path()).map(String::from_utf8) {
                    Ok(Ok(text)) => self.put(&path, &text),
                    Ok(Err(_)) => self.know(&path),
                    // An editor may have removed its own file between the listing and now.
                    Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }

    /// Takes a file in, with all folders above it.
    pub(crate) fn put(&mut self, path: &str, text: &str) {
        self.texts.insert(path.to_owned(), text.to_owned());
        self.know(path);
    }

    fn know(&mut self, path: &str) {
        let ends = path.match_indices('/').map(|(at, _)| at);
        self.paths.extend(ends.map(|at| path[..at].to_owned()));
        self.paths.insert(path.to_owned());
    }

    /// Whether there is a file or a folder of this name.
    pub(crate) fn has(&self, path: &str) -> bool {
        self.paths.contains(path.trim_end_matches('/'))
    }

    pub(crate) fn text(&self, path: &str) -> Option<&str> {
        self.texts.get(path).map(String::as_str)
    }

    /// All texts below a folder (`""` for all), with their paths.
    pub(crate) fn under<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.texts
            .iter()
            .filter(move |(path, _)| {
                folder.is_empty() || path.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'))
            })
            .map(|(path, text)| (path.as_str(), text.as_str()))
    }

    /// All Rust files below a folder.
    pub(crate) fn rust<'a>(&'a self, folder: &'a str) -> impl Iterator<Item = (&'a str, &'a str)> {
        self.under(folder).filter(|(path, _)| path.ends_with(".rs"))
    }

    #[cfg(test)]
    pub(crate) fn of(files: &[(&str, &str)]) -> Tree {
        let mut tree = Tree::default();
        files.iter().for_each(|(path, text)| tree.put(path, text));
        tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_known_and_names_are_not_cut() {
        let tree = Tree::of(&[("crates/sim/src/lib.rs", ""), ("crates/simple/src/lib.rs", "")]);
        assert!(tree.has("crates/sim/") && tree.has("crates/sim/src") && !tree.has("crates/s"));
        assert_eq!(tree.rust("crates/sim").count(), 1);
    }
}

//! Built-in scenarios and worlds, and files by name.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use types::value::{Mistake, Span, nearest};

mod built_in {
    include!(concat!(env!("OUT_DIR"), "/library.rs"));
}

/// What a name can stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shelf {
    /// System files.
    Scenarios,
    /// Worlds.
    Worlds,
    /// Floors; none is built in.
    Floors,
}

/// A text that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// What messages call it: its path, or the name with `.toml`.
    pub name: String,
    /// The text.
    pub text: String,
    /// The folder in which names inside the text are looked for; none for what is built in.
    pub folder: Option<PathBuf>,
}

impl Shelf {
    /// What is built in, name and text, in the order of the names.
    pub const fn built_in(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Shelf::Scenarios => built_in::SCENARIOS,
            Shelf::Worlds => built_in::WORLDS,
            Shelf::Floors => &[],
        }
    }

    /// The names of what is built in.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        self.built_in().iter().map(|(name, _)| *name)
    }

    const fn kind(self) -> &'static str {
        match self {
            Shelf::Scenarios => "system file or scenario",
            Shelf::Worlds => "world",
            Shelf::Floors => "floor",
        }
    }

    /// Finds a text by its name or path; paths are meant from `folder`. What is not built in is looked for as `NAME.toml` too.
    ///
    /// # Errors
    /// Says what there is, and what is nearest.
    pub fn find(self, name: &str, folder: &Path) -> Result<Found, Mistake> {
        if let Some((name, text)) = self.built_in().iter().find(|(known, _)| *known == name) {
            return Ok(Found { name: format!("{name}.toml"), text: (*text).to_owned(), folder: None });
        }
        let plain = folder.join(name);
        let with_ending = folder.join(format!("{name}.toml"));
        let path = if plain.is_file() || !with_ending.is_file() { plain } else { with_ending };
        // A device may have no end, a pipe nobody who writes.
        if fs::metadata(&path).is_ok_and(|found| !found.is_file()) {
            return Err(mistake(format!("{} is no file", path.display())));
        }
        match fs::read(&path) {
            Ok(bytes) => {
                let shown = path.strip_prefix("./").unwrap_or(&path).display().to_string();
                let text = String::from_utf8(bytes).map_err(|_| {
                    mistake(format!("{shown} is no text")).help("a system file is TOML in UTF-8")
                })?;
                Ok(Found { name: shown, text, folder: Some(path.parent().unwrap_or(folder).to_owned()) })
            }
            Err(error) if error.kind() == ErrorKind::NotFound => Err(self.unknown(name, folder)),
            Err(error) => Err(mistake(format!("{} cannot be read: {error}", path.display()))),
        }
    }

    /// Nothing has this name. A path is compared with the files beside it, a name with what is built in.
    fn unknown(self, name: &str, folder: &Path) -> Mistake {
        if name.ends_with(".toml") {
            let path = folder.join(name);
            let beside = fs::read_dir(path.parent().unwrap_or(folder)).into_iter().flatten().flatten();
            let files: Vec<String> =
                beside.filter_map(|entry| entry.file_name().into_string().ok()).collect();
            let word = name.rsplit('/').next().unwrap_or(name);
            let near = nearest(word, files.iter().map(String::as_str).filter(|file| file.ends_with(".toml")));
            let said = mistake(format!("there is no file \"{name}\""));
            return match near {
                Some(near) => said.help(format!("did you mean \"{near}\"?")),
                None => said,
            };
        }
        let said = mistake(format!("there is no {} \"{name}\"", self.kind()));
        match nearest(name, self.names()) {
            Some(near) => said.help(format!("did you mean \"{near}\"?")),
            None if self.built_in().is_empty() => {
                said.help("it can be \"world\", for that of the simulated world, or the path of a file, as in \"office.toml\"")
            }
            None => {
                let names: Vec<&str> = self.names().collect();
                said.help(format!("built in are: {}; anything else is the path of a file", names.join(", ")))
            }
        }
    }
}

fn mistake(what: String) -> Mistake {
    Mistake::new(Span::default(), what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_names_need_no_file() {
        for shelf in [Shelf::Scenarios, Shelf::Worlds] {
            for name in shelf.names() {
                let found = shelf.find(name, Path::new("/nowhere")).unwrap();
                assert!(found.text.contains("name = "), "{name}");
                assert_eq!(found.folder, None);
            }
        }
        assert!(Shelf::Scenarios.names().any(|name| name == "exploration"));
        assert!(Shelf::Worlds.names().any(|name| name == "laboratory"));
    }

    #[test]
    fn a_name_that_is_nearly_right_is_put_right() {
        let mistake = Shelf::Worlds.find("laborattory", Path::new(".")).unwrap_err();
        assert_eq!(mistake.what, "there is no world \"laborattory\"");
        assert_eq!(mistake.help.as_deref(), Some("did you mean \"laboratory\"?"));
        let mistake = Shelf::Worlds.find("moon", Path::new(".")).unwrap_err();
        assert!(mistake.help.unwrap().starts_with("built in are: annex, "));
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../worlds");
        let mistake = Shelf::Worlds.find("anex.toml", &folder).unwrap_err();
        assert_eq!(mistake.to_string(), "there is no file \"anex.toml\"; did you mean \"annex.toml\"?");
    }

    #[test]
    fn what_is_no_file_is_not_read() {
        for name in ["/dev/null", env!("CARGO_MANIFEST_DIR")] {
            let mistake = Shelf::Worlds.find(name, Path::new("")).unwrap_err();
            assert_eq!(mistake.what, format!("{name} is no file"));
        }
    }

    #[test]
    fn files_are_found_with_and_without_their_ending() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
        for name in ["exploration.toml", "../scenarios/exploration"] {
            let found = Shelf::Scenarios.find(name, &folder).unwrap();
            assert!(found.folder.is_some() && found.text.contains("[robot.h1]"), "{name}");
        }
    }
}

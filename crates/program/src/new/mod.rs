//! `sinew new`: templates that build, run and have a test.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::error::Failure;

mod name;

use name::Name;

/// Makes a crate of one agent: a program that is the whole of `sinew` with the agent in it, a system file that runs it, and its
/// tests. It is put into `folder`, under its name; in a checkout of Sinew it depends on the checkout.
///
/// # Errors
/// When the name cannot be one, something of this name is there, or it cannot be written.
pub fn agent(name: &str, folder: &Path, lang: &str) -> Result<Vec<PathBuf>, Failure> {
    only_rust(lang)?;
    let name = Name::read(name)?;
    let home = folder.join(name.kebab());
    let sinew = dependency(&home);
    let fill = |text: &str| name.fill(text).replace("@SINEW@", &sinew);
    write(
        &home,
        vec![
            ("Cargo.toml".to_owned(), fill(include_str!("agent/Cargo.toml.in"))),
            ("src/main.rs".to_owned(), fill(include_str!("agent/main.rs.in"))),
            (format!("src/{}.rs", name.snake()), fill(include_str!("agent/agent.rs.in"))),
            (format!("{}.toml", name.kebab()), fill(include_str!("agent/system.toml.in"))),
        ],
    )
}

/// Makes a system file, `NAME.toml` in `folder`: a robot that follows a wall.
///
/// # Errors
/// As [`agent`].
pub fn system(name: &str, folder: &Path, lang: &str) -> Result<Vec<PathBuf>, Failure> {
    only_rust(lang)?;
    let name = Name::read(name.strip_suffix(".toml").unwrap_or(name))?;
    write(folder, vec![(format!("{}.toml", name.kebab()), name.fill(include_str!("system.toml.in")))])
}

/// Agents in other languages have no template.
fn only_rust(lang: &str) -> Result<(), Failure> {
    match lang {
        "rust" => Ok(()),
        "c" | "python" => Err(Failure::new(format!("there is no template in {lang}, only in rust"))
            .help("leave --lang away, or write --lang rust")),
        other => Err(Failure::unknown("language", other, ["rust"])),
    }
}

/// What stands behind `sinew =` in the manifest: the checkout in which the new crate lies, else the version of this program.
fn dependency(home: &Path) -> String {
    let absolute = std::path::absolute(home).unwrap_or_else(|_| home.to_owned());
    let mut up = PathBuf::new();
    for above in absolute.ancestors() {
        if above.join("crates/sinew/Cargo.toml").is_file() {
            return format!("{{ path = \"{}\" }}", up.join("crates/sinew").display());
        }
        up.push("..");
    }
    format!("\"{}\"", env!("CARGO_PKG_VERSION"))
}

/// Writes files that are not there yet: all of them, or none.
fn write(home: &Path, files: Vec<(String, String)>) -> Result<Vec<PathBuf>, Failure> {
    let paths: Vec<PathBuf> = files.iter().map(|(file, _)| home.join(file)).collect();
    if let Some(there) = paths.iter().find(|path| path.symlink_metadata().is_ok()) {
        return Err(Failure::new(format!(
            "{} is there already, and nothing is overwritten",
            there.display()
        ))
        .help("take another name, or move it away"));
    }
    for (path, (_, text)) in paths.iter().zip(&files) {
        let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fresh(path, text));
        written.map_err(|error| {
            Failure::new(format!("{} cannot be written: {error}", path.display())).code(1)
        })?;
    }
    Ok(paths)
}

/// Writes a file that nobody has made in the meantime.
fn fresh(path: &Path, text: &str) -> io::Result<()> {
    let mut file = fs::File::create_new(path)?;
    io::Write::write_all(&mut file, text.as_bytes())
}

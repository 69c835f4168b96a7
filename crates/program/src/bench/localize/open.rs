//! From a folder or an archive to a recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use hardware::mrclam::Team;

use crate::error::Failure;

/// Files of a recording are no larger than this (bytes): a day of odometry at 100 Hz is half as large.
const LARGEST: u64 = 1 << 29;

/// What is named, or what this machine has; nothing when nothing is named and it has none.
pub(super) fn find(named: Option<&Path>) -> Result<Option<(PathBuf, Team)>, Failure> {
    let Some(folder) = super::folder(named) else { return Ok(None) };
    if named.is_none() && !folder.exists() {
        return Ok(None);
    }
    let Some(place) = recording(&folder) else {
        let what = format!("there is no recording in {}", folder.display());
        return Err(Failure::new(what).help(
            "a folder with Barcodes.dat and the files of the robots, or an archive .tar.xz with them",
        ));
    };
    let files = if place.is_dir() { read_folder(&place) } else { read_archive(&place) };
    let files =
        files.map_err(|error| Failure::new(format!("{} cannot be read: {error}", place.display())))?;
    let team = Team::read(&files).map_err(|bad| Failure::new(format!("{}: {bad}", place.display())))?;
    Ok(Some((place, team)))
}

/// The folder itself, one in it, or an archive in it; or the archive.
fn recording(place: &Path) -> Option<PathBuf> {
    let is_one = |path: &Path| path.join("Barcodes.dat").is_file();
    if is_one(place) || place.is_file() {
        return Some(place.to_path_buf());
    }
    let mut inside: Vec<PathBuf> =
        std::fs::read_dir(place).ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    inside.sort();
    let is_archive = |path: &Path| path.to_string_lossy().ends_with(".tar.xz");
    let found = inside.iter().find(|path| is_one(path));
    let found = found.or_else(|| inside.iter().find(|path| is_archive(path))).cloned();
    found.or_else(|| recording(&place.join("mrclam")))
}

fn read_folder(folder: &Path) -> std::io::Result<BTreeMap<String, String>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".dat") {
            files.insert(name, text(File::open(entry.path())?)?);
        }
    }
    Ok(files)
}

fn read_archive(archive: &Path) -> std::io::Result<BTreeMap<String, String>> {
    let mut unpacked = Vec::new();
    lzma_rs::xz_decompress(&mut BufReader::new(File::open(archive)?), &mut unpacked)
        .map_err(|error| std::io::Error::other(format!("it is no archive .tar.xz: {error}")))?;
    let mut files = BTreeMap::new();
    for entry in tar::Archive::new(&unpacked[..]).entries()? {
        let entry = entry?;
        let name = entry.path()?.file_name().map(|name| name.to_string_lossy().into_owned());
        if let Some(name) = name.filter(|name| name.ends_with(".dat")) {
            files.insert(name, text(entry)?);
        }
    }
    Ok(files)
}

fn text(input: impl Read) -> std::io::Result<String> {
    let mut text = String::new();
    let read = input.take(LARGEST).read_to_string(&mut text)?;
    if read as u64 == LARGEST { Err(std::io::Error::other("a file of it is too large")) } else { Ok(text) }
}

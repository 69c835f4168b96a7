//! Maps and queries from files: a folder of maps, or an archive of them, and lists of queries.

use std::collections::BTreeMap;
use std::fs;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use navigation::path::Grid;
use navigation::path::moving_ai::{self, WrongFile};

use super::peer::Peer;
use super::{Floor, Query, SAME, own};
use crate::error::{Failure, Place, Problem};

/// Queries of chance on a map for which there are no others.
const QUERIES: usize = 20;
/// A packed file of more bytes than this is no archive of maps.
const LARGEST: usize = 1 << 28;

/// The maps of a folder or an archive by their names, as text.
type Texts = BTreeMap<String, String>;

/// Reads what there is to measure on.
pub(super) fn read(folder: &Path, scen: Option<&Path>) -> Result<Vec<Floor>, Failure> {
    let texts = texts(folder)?;
    let lists = match scen {
        Some(file) => vec![file.to_owned()],
        None => files(folder, ".scen")?,
    };
    if lists.is_empty() {
        return texts.iter().map(|(name, text)| floor_of_chance(name, text, folder)).collect();
    }
    let mut floors = Vec::new();
    for list in lists {
        floors.extend(asked(&list, &texts, folder)?);
    }
    Ok(floors)
}

/// The maps of a list of queries, with those of its queries that are for them.
fn asked(list: &Path, texts: &Texts, folder: &Path) -> Result<Vec<Floor>, Failure> {
    let text = fs::read_to_string(list)
        .map_err(|error| unreadable(list, &error, "--scen FILE names a list of queries"))?;
    let queries = moving_ai::queries(&text).map_err(|wrong| wrong_file(list, &text, &wrong))?;
    if queries.is_empty() {
        let failure = Failure::new(format!("{}: there is no query in it", list.display()));
        return Err(failure
            .help("a query is `bucket map width height x y x y length`, or `row column row column length`"));
    }
    let mut floors: Vec<Floor> = Vec::new();
    for query in queries {
        // Some lists name their maps with the folder that they once lay in.
        let name = query.map.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
        let at = |what: String, help: &str| at_line(list, &text, query.line, what, help);
        let known = floors.iter().position(|floor| floor.name == name);
        let number = match known {
            Some(number) => number,
            None => {
                let Some(map) = texts.get(&name) else {
                    let what = format!("there is no map {name} in {}", folder.display());
                    return Err(at(what, "name the folder in which it lies: --maps DIR"));
                };
                floors.push(Floor { grid: grid(&name, map, folder)?, name, queries: Vec::new() });
                floors.len() - 1
            }
        };
        let floor = &mut floors[number];
        let (width, height) = (floor.grid.width(), floor.grid.height());
        let other_map = "the queries are for another map, or for another edition of it";
        if query.size.is_some_and(|size| size != (width, height)) {
            let (columns, rows) = query.size.unwrap_or_default();
            let what = format!("{} has {width} × {height} cells, not {columns} × {rows}", floor.name);
            return Err(at(what, other_map));
        }
        for (end, cell) in [("start", query.start), ("goal", query.goal)] {
            if floor.grid.is_closed(cell) {
                let what =
                    format!("on {} the {end} is closed: column {}, row {}", floor.name, cell.x, cell.y);
                return Err(at(what, other_map));
            }
        }
        floor.queries.push(Query { start: query.start, goal: query.goal, length: Some(query.length) });
        check(floor, &query, list, &text)?;
    }
    Ok(floors)
}

/// The length in the list is that of the shortest way by the other system's account.
fn check(floor: &Floor, query: &moving_ai::Query, list: &Path, text: &str) -> Result<(), Failure> {
    // One a hundred is enough to see that the list is for another map.
    if floor.queries.len() % 100 != 1 {
        return Ok(());
    }
    let found = Peer::new(&floor.grid).length(query.start, query.goal);
    if found.is_some_and(|found| (found - query.length).abs() <= SAME) {
        return Ok(());
    }
    let found =
        found.map_or("there is no way".to_owned(), |found| format!("the shortest way is {found:.8} long"));
    let what = format!("on {} {found}, not {:.8}", floor.name, query.length);
    Err(at_line(list, text, query.line, what, "the queries are for another map, or their ways cut corners"))
}

fn floor_of_chance(name: &str, text: &str, folder: &Path) -> Result<Floor, Failure> {
    let grid = grid(name, text, folder)?;
    let queries = own::queries_of_chance(&grid, name, QUERIES);
    Ok(Floor { name: name.to_owned(), grid, queries })
}

fn grid(name: &str, text: &str, folder: &Path) -> Result<Grid, Failure> {
    moving_ai::map(text).map_err(|wrong| wrong_file(&folder.join(name), text, &wrong))
}

/// The texts of all maps of a folder, those in its archives among them, or of an archive.
pub(super) fn texts(folder: &Path) -> Result<Texts, Failure> {
    const HELP: &str = "--maps DIR names a folder with files .map, or with a .tar.xz of them";
    let mut texts = Texts::new();
    if folder.is_file() {
        unpack(folder, &mut texts)?;
    } else {
        for archive in files(folder, ".tar.xz")? {
            unpack(&archive, &mut texts)?;
        }
        for file in files(folder, ".map")? {
            let text = fs::read(&file).map_err(|error| unreadable(&file, &error, HELP))?;
            let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
            texts.insert(name, String::from_utf8_lossy(&text).into_owned());
        }
    }
    if texts.is_empty() {
        return Err(Failure::new(format!("{}: there is no map in it", folder.display())).help(HELP));
    }
    Ok(texts)
}

/// The files of a folder whose names end so, in the order of their names.
fn files(folder: &Path, end: &str) -> Result<Vec<PathBuf>, Failure> {
    if folder.is_file() {
        return Ok(Vec::new());
    }
    let list = fs::read_dir(folder).map_err(|error| {
        unreadable(folder, &error, "--maps DIR names a folder with files .map, or with a .tar.xz of them")
    })?;
    let paths = list.filter_map(|entry| entry.ok().map(|entry| entry.path()));
    let mut paths: Vec<PathBuf> =
        paths.filter(|path| path.to_string_lossy().ends_with(end) && path.is_file()).collect();
    paths.sort();
    Ok(paths)
}

/// Takes the maps out of an archive.
fn unpack(archive: &Path, texts: &mut Texts) -> Result<(), Failure> {
    const HELP: &str = "it must be an archive .tar.xz; unpack it by hand (tar xf) and name the folder";
    let file = fs::File::open(archive).map_err(|error| unreadable(archive, &error, HELP))?;
    let mut out = Capped(Vec::new());
    lzma_rs::xz_decompress(&mut BufReader::new(file), &mut out)
        .map_err(|error| unreadable(archive, &error, HELP))?;
    let before = texts.len();
    for (name, bytes) in members(&out.0) {
        if name.ends_with(".map") {
            let name = name.rsplit('/').next().unwrap_or_default().to_owned();
            texts.insert(name, String::from_utf8_lossy(bytes).into_owned());
        }
    }
    if texts.len() == before {
        return Err(Failure::new(format!("{}: there is no map in it", archive.display())).help(HELP));
    }
    Ok(())
}

/// The files in an archive (POSIX.1-1988, "ustar"): a block of 512 bytes with the name from 0 on, the size in octal from 124 on and the kind at 156,
/// then the bytes, filled up to whole blocks. What is cut ends it.
fn members(bytes: &[u8]) -> impl Iterator<Item = (String, &[u8])> {
    const BLOCK: usize = 512;
    let mut rest = bytes;
    core::iter::from_fn(move || {
        loop {
            let (head, after) = rest.split_at_checked(BLOCK)?;
            let text = |field: &[u8]| {
                let end = field.iter().position(|byte| *byte == 0).unwrap_or(field.len());
                String::from_utf8_lossy(&field[..end]).trim().to_owned()
            };
            let size = usize::from_str_radix(&text(&head[124..136]), 8).ok()?;
            let content = after.get(..size)?;
            rest = after.get(size.div_ceil(BLOCK) * BLOCK..).unwrap_or_default();
            if matches!(head[156], b'0' | 0) {
                return Some((text(&head[..100]), content));
            }
        }
    })
}

/// Bytes, as many as an archive may have.
struct Capped(Vec<u8>);

impl std::io::Write for Capped {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.0.len() + bytes.len() > LARGEST {
            return Err(std::io::Error::other("it holds more than an archive of maps does"));
        }
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn unreadable(path: &Path, error: &dyn core::fmt::Display, help: &str) -> Failure {
    Failure::new(format!("{}: {error}", path.display())).help(help)
}

fn wrong_file(path: &Path, text: &str, wrong: &WrongFile) -> Failure {
    at_line(
        path,
        text,
        wrong.line,
        wrong.what.to_string(),
        "mend the line, or take the file from its source anew",
    )
}

/// A mistake with its place in a file.
fn at_line(path: &Path, text: &str, line: usize, what: String, help: &str) -> Failure {
    // Rows of a map can be long.
    let text: String = text.lines().nth(line - 1).unwrap_or_default().chars().take(80).collect();
    let width = text.chars().count().max(1);
    let place = Place { file: path.display().to_string(), line, column: 1, text, width };
    let problem = Problem { what, help: Some(help.to_owned()), place: Some(place) };
    Failure { problems: vec![problem], code: 2 }
}

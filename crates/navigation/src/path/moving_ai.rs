//! The files of the MovingAI benchmarks of grids: maps, and queries with the lengths of their shortest ways (Sturtevant 2012, "Benchmarks for grid-based
//! pathfinding").
//!
//! A map begins with `type octile`, `height H`, `width W` and `map`, or with a line `H W` alone; then come H lines of W letters. `.`, `G` and `S` (swamp)
//! can be gone over; `@`, `O` (out of bounds), `T` (trees) and `W` (water) cannot.
//!
//! Queries come in two forms: after `version 1` lines of `bucket map width height x y x y length`, start before goal; or after a line with the name of the map
//! lines of `row column row column length`.

use super::grid::{Cell, Grid, LARGEST};

/// Why a text is no map, or no list of queries.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct WrongFile {
    /// Where, from 1 on.
    pub line: usize,
    /// What is wrong, and what would be right.
    pub what: Wrong,
}

/// What can be wrong with a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Wrong {
    /// It does not begin as such files do.
    #[error("a map begins with `type octile`, `height H`, `width W`, `map`, or with `H W`")]
    NoMap,
    /// Columns or rows are none or too many.
    #[error("a map has 1 to {LARGEST} rows and columns, not {height} × {width}")]
    Size {
        /// Rows.
        height: u64,
        /// Columns.
        width: u64,
    },
    /// A row has another length.
    #[error("the row has {found} letters, not {width}")]
    Row {
        /// Letters that it has.
        found: usize,
        /// Letters that it must have.
        width: u32,
    },
    /// There are too few rows.
    #[error("the map ends after {found} of {height} rows")]
    Rows {
        /// Rows that there are.
        found: usize,
        /// Rows that there must be.
        height: u32,
    },
    /// There is text after the last row.
    #[error("the map has only {height} rows; remove what follows")]
    More {
        /// Rows that there must be.
        height: u32,
    },
    /// A letter that means nothing.
    #[error("column {column}: {letter:?} is no letter of a map: free are . G S, closed @ O T W")]
    Letter {
        /// Where, from 1 on.
        column: usize,
        /// Which.
        letter: char,
    },
    /// It does not begin as lists of queries do.
    #[error("a list of queries begins with `version 1`, or with the name of its map")]
    NoQueries,
    /// A line that is no query.
    #[error("a query is `bucket map width height x y x y length`, or `row column row column length`")]
    NoQuery,
}

/// A query of a list.
#[derive(Clone, Debug, PartialEq)]
pub struct Query {
    /// The line on which it stands, from 1 on.
    pub line: usize,
    /// The map that it is for, as the file names it.
    pub map: String,
    /// Columns and rows of the map, where the file tells them.
    pub size: Option<(u32, u32)>,
    /// From here.
    pub start: Cell,
    /// To there.
    pub goal: Cell,
    /// How long the shortest way is (sides of a cell).
    pub length: f64,
}

/// Reads a map. What cannot be gone over is taken; nothing is inflated.
pub fn map(text: &str) -> Result<Grid, WrongFile> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim_end_matches('\r')));
    let (height, width) = head(&mut lines)?;
    let mut grid = Grid::new(width, height);
    let mut rows = 0;
    for (line, row) in lines {
        let wrong = |what| WrongFile { line, what };
        if rows == height as usize {
            if row.trim().is_empty() {
                continue;
            }
            return Err(wrong(Wrong::More { height }));
        }
        let found = row.chars().count();
        if found != width as usize {
            return Err(wrong(Wrong::Row { found, width }));
        }
        for (x, letter) in row.chars().enumerate() {
            let taken = match letter {
                '.' | 'G' | 'S' => false,
                '@' | 'O' | 'T' | 'W' => true,
                _ => return Err(wrong(Wrong::Letter { column: x + 1, letter })),
            };
            grid.set(Cell::new(x as u32, rows as u32), taken);
        }
        rows += 1;
    }
    if rows < height as usize {
        let line = text.lines().count().max(1);
        return Err(WrongFile { line, what: Wrong::Rows { found: rows, height } });
    }
    grid.inflate(0.0);
    Ok(grid)
}

/// Rows and columns.
fn head<'a>(lines: &mut impl Iterator<Item = (usize, &'a str)>) -> Result<(u32, u32), WrongFile> {
    let mut last = 1;
    let mut next = || {
        let (line, text) = lines.next().unwrap_or((last, ""));
        last = line;
        (line, text.split_whitespace().collect::<Vec<_>>())
    };
    let no_map = |line| WrongFile { line, what: Wrong::NoMap };
    let (line, first) = next();
    let number = |word: &str| word.parse::<u64>().ok();
    let ((height, width), line) = if first.first() == Some(&"type") {
        let mut named = |name: &str| {
            let (line, words) = next();
            match words[..] {
                [word, count] if word == name => number(count).ok_or_else(|| no_map(line)),
                _ => Err(no_map(line)),
            }
        };
        let size = (named("height")?, named("width")?);
        match next() {
            (line, words) if words == ["map"] => (size, line),
            (line, _) => return Err(no_map(line)),
        }
    } else {
        match first[..] {
            [height, width] => (number(height).zip(number(width)).ok_or_else(|| no_map(line))?, line),
            _ => return Err(no_map(line)),
        }
    };
    let fits = |count: u64| (1..=u64::from(LARGEST)).contains(&count);
    if !fits(height) || !fits(width) {
        return Err(WrongFile { line, what: Wrong::Size { height, width } });
    }
    Ok((height as u32, width as u32))
}

/// Reads a list of queries, in either form.
pub fn queries(text: &str) -> Result<Vec<Query>, WrongFile> {
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let (line, first) = lines.find(|(_, line)| !line.is_empty()).unwrap_or((1, ""));
    let words: Vec<&str> = first.split_whitespace().collect();
    let is_standard = match words[..] {
        ["version", number] if number.parse::<f64>().is_ok_and(|number| number == 1.0) => true,
        [name] if name != "version" => false,
        _ => return Err(WrongFile { line, what: Wrong::NoQueries }),
    };
    let rows = lines.filter(|(_, row)| !row.is_empty());
    rows.map(|(line, row)| {
        let words: Vec<&str> = row.split_whitespace().collect();
        let query = if is_standard { standard(&words) } else { short(first, &words) };
        query.map(|query| Query { line, ..query }).ok_or(WrongFile { line, what: Wrong::NoQuery })
    })
    .collect()
}

/// `bucket map width height x y x y length`.
fn standard(words: &[&str]) -> Option<Query> {
    let [_, map, width, height, x, y, to_x, to_y, length] = words[..] else { return None };
    Some(Query {
        line: 0,
        map: map.to_owned(),
        size: Some((width.parse().ok()?, height.parse().ok()?)),
        start: cell(x, y)?,
        goal: cell(to_x, to_y)?,
        length: number(length)?,
    })
}

/// `row column row column length`.
fn short(map: &str, words: &[&str]) -> Option<Query> {
    let [y, x, to_y, to_x, length] = words[..] else { return None };
    let (start, goal) = (cell(x, y)?, cell(to_x, to_y)?);
    Some(Query { line: 0, map: map.to_owned(), size: None, start, goal, length: number(length)? })
}

fn cell(x: &str, y: &str) -> Option<Cell> {
    Some(Cell::new(x.parse().ok()?, y.parse().ok()?))
}

fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|number: &f64| number.is_finite() && *number >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_map_with_and_without_its_head_is_the_same() {
        let rows = ".@GO\nSTW.\n";
        let long = map(&format!("type octile\nheight 2\nwidth 4\nmap\n{rows}")).unwrap();
        let short = map(&format!("2 4\r\n{}", rows.replace('\n', "\r\n"))).unwrap();
        assert_eq!(long, short);
        let free: Vec<bool> = (0..8).map(|i| !long.is_closed(Cell::new(i % 4, i / 4))).collect();
        assert_eq!(free, [true, false, true, false, true, false, false, true]);
    }

    #[test]
    fn what_is_wrong_with_a_map_is_told_with_its_line() {
        let check =
            |text: &str, expect: &str| assert_eq!(map(text).unwrap_err().to_string(), expect, "{text:?}");
        let head = "a map begins with `type octile`, `height H`, `width W`, `map`, or with `H W`";
        check("", &format!("line 1: {head}"));
        check("version 1\n", &format!("line 1: {head}"));
        check("type octile\nwidth 2\nheight 1\nmap\n..\n", &format!("line 2: {head}"));
        check("type octile\nheight 2\nwidth x\nmap\n..\n", &format!("line 3: {head}"));
        check("type octile\nheight 2\nwidth 2\n..\n", &format!("line 4: {head}"));
        check("0 4\n", "line 1: a map has 1 to 4096 rows and columns, not 0 × 4");
        check("9 99999\n", "line 1: a map has 1 to 4096 rows and columns, not 9 × 99999");
        check("2 2\n..\n...\n", "line 3: the row has 3 letters, not 2");
        check("2 2\n..\n", "line 2: the map ends after 1 of 2 rows");
        check("1 2\n..\n\n..\n", "line 4: the map has only 1 rows; remove what follows");
        check("1 2\n.x\n", "line 2: column 2: 'x' is no letter of a map: free are . G S, closed @ O T W");
    }

    #[test]
    fn queries_are_read_in_both_forms() {
        let standard = queries("version 1\n0\tmaps/a.map\t9\t8\t1\t2\t3\t4\t2.82842712\n\n").unwrap();
        let query = Query {
            line: 2,
            map: "maps/a.map".into(),
            size: Some((9, 8)),
            start: Cell::new(1, 2),
            goal: Cell::new(3, 4),
            length: 2.82842712,
        };
        assert_eq!(standard.first(), Some(&query));
        assert_eq!(standard.len(), 1);
        let short = queries("a.map\n2 1 4 3 2.82842712\n").unwrap();
        assert_eq!(short, [Query { map: "a.map".into(), size: None, ..query }]);
        assert_eq!(queries("version 1.0\n").unwrap(), []);
    }

    #[test]
    fn what_is_wrong_with_queries_is_told_with_its_line() {
        for (text, line, what) in [
            ("", 1, Wrong::NoQueries),
            ("version 2\n", 1, Wrong::NoQueries),
            ("version\n", 1, Wrong::NoQueries),
            ("\n1 2 3 4 5.0\n", 2, Wrong::NoQueries),
            ("a.map\n1 2 3 4 5.0\n1 2 3 4\n", 3, Wrong::NoQuery),
            ("a.map\n1 2 3 -4 5.0\n", 2, Wrong::NoQuery),
            ("a.map\n1 2 3 4 nan\n", 2, Wrong::NoQuery),
            ("version 1\n1 2 3 4 5.0\n", 2, Wrong::NoQuery),
        ] {
            assert_eq!(queries(text).unwrap_err(), WrongFile { line, what }, "{text:?}");
        }
    }

    proptest! {
        /// What is written by hand is read as it was meant.
        #[test]
        fn a_map_is_read_as_it_is_written(rows in (1usize..9, 1usize..70).prop_flat_map(|(height, width)| {
            proptest::collection::vec(proptest::collection::vec(0usize..7, width), height)
        })) {
            let (height, width) = (rows.len(), rows[0].len());
            let letter = |i: &usize| ['.', 'G', 'S', '@', 'O', 'T', 'W'][*i];
            let lines: Vec<String> = rows.iter().map(|row| row.iter().map(letter).collect()).collect();
            let grid = map(&format!("{height} {width}\n{}", lines.join("\n"))).unwrap();
            for (y, row) in rows.iter().enumerate() {
                for (x, i) in row.iter().enumerate() {
                    prop_assert_eq!(grid.is_closed(Cell::new(x as u32, y as u32)), *i >= 3);
                }
            }
        }

        /// Any text is read or refused.
        #[test]
        fn no_text_makes_it_fall(
            head in "(type octile\n)?(height [0-9]{0,5}\n)?(width [0-9]{0,5}\n)?(map\n)?|[0-9]{0,2} [0-9]{0,2}\n|version 1\n|\\PC{0,20}\n",
            rest in "([.@GSOTW]{0,4}\n){0,4}|([0-9a-z. \t-]{0,30}\n){0,4}|\\PC{0,60}",
        ) {
            let text = head + &rest;
            let lines = text.lines().count().max(1);
            prop_assert!(map(&text).err().is_none_or(|wrong| (1..=lines).contains(&wrong.line)));
            prop_assert!(queries(&text).err().is_none_or(|wrong| (1..=lines).contains(&wrong.line)));
        }
    }
}

//! Worlds like those of BARN, the benchmark for navigation among obstacles that nobody mapped: a corridor full of cylinders, to be passed
//! from a start to a goal.
//!
//! ```text
//!   y 13.0      goal                      clear
//!           ┆         ┆
//!   y  9.5  █ █    ██ █
//!           █   █     █                   field: 30 rows of 30 cells of 0.15 m, a cylinder of 75 mm radius in each that is taken
//!   y  5.2  █  ██   █ █
//!           █         █                   apron
//!   y  3.0  █  start  █
//!   y  0.1  ███████████
//!          −4.4      −0.1
//! ```
//!
//! Published ones are read from a text; others are generated, each from its number alone, in the same way: a cellular automaton
//! smooths a random fill (Perille, Truong, Xiao and Stone, SSRR 2020), and what no robot could pass is drawn again.

use std::collections::BinaryHeap;

use libm::{hypot, sqrt};
use types::geometry::PI;
use types::{Point, Pose};

use types::chance::Stream;

/// Where the robot starts.
pub const START: Pose = Pose::new(-2.25, 3.0, PI / 2.0);
/// Where it shall go.
pub const GOAL: Point = Point::new(-2.25, 13.0);
/// So near to it is there (m).
pub const REACHED: f64 = 1.0;
/// The clock starts when it has moved so far (m).
pub const MOVED: f64 = 0.1;
/// Then it has so long (s).
pub const WITHIN: f64 = 100.0;
/// Radius of a cylinder (m).
pub const CYLINDER: f64 = 0.075;
/// Rows of a world.
pub const ROWS: usize = 64;
/// Columns of a world.
pub const COLUMNS: usize = 30;
/// A disc of this radius passes each generated world (m): it passes each published one.
pub const PASSABLE: f64 = 0.364;

const CELL: f64 = 0.15;
const FIRST: Point = Point::new(-4.425, 0.075);
/// The first row of the field.
const FIELD: usize = 34;
/// Draws until one is passable. Nearly each second is.
const DRAWS: u64 = 1000;

/// A world of BARN.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Its number.
    pub number: u64,
    /// Length of the way that the benchmark's own planner finds from the start to the goal (m).
    pub path_length: f64,
    /// Radius of the largest disc that passes (m).
    pub passable: f64,
    /// A bit for each column of each row where a cylinder stands, the lowest first; the nearest row first.
    pub rows: [u32; ROWS],
}

/// A text is no list of worlds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotWorlds {
    /// The line, from 1; 0 where the text has no world at all.
    pub line: usize,
    /// What is wrong there.
    pub what: String,
}

impl std::fmt::Display for NotWorlds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            0 => f.write_str(&self.what),
            line => write!(f, "line {line}: {}", self.what),
        }
    }
}

impl std::error::Error for NotWorlds {}

impl World {
    /// The middles of the cylinders.
    pub fn cylinders(&self) -> impl Iterator<Item = Point> + '_ {
        self.rows.iter().enumerate().flat_map(|(row, bits)| {
            (0..COLUMNS).filter(move |column| bits >> column & 1 == 1).map(move |column| middle(row, column))
        })
    }

    /// The score of a run that took `seconds`: the time of a way at 2 m/s over the time that was taken, this held within twice and eight
    /// times that; so at most a half.
    pub fn score(&self, seconds: f64) -> f64 {
        let optimal = self.path_length / 2.0;
        optimal / seconds.clamp(2.0 * optimal, 8.0 * optimal)
    }
}

fn middle(row: usize, column: usize) -> Point {
    Point::new(FIRST.x + CELL * column as f64, FIRST.y + CELL * row as f64)
}

/// Reads worlds, one a line: number, path length (m), radius of the largest disc that passes (m), 64 rows as hexadecimal numbers. Lines
/// that are empty or begin with `#` are passed over.
///
/// # Errors
/// Says which line is wrong, and in what.
pub fn read(text: &str) -> Result<Vec<World>, NotWorlds> {
    let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let told = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let worlds = told
        .map(|(number, line)| read_line(line).map_err(|what| NotWorlds { line: number, what }))
        .collect::<Result<Vec<World>, NotWorlds>>()?;
    if worlds.is_empty() {
        return Err(NotWorlds { line: 0, what: "there is no world in it".to_owned() });
    }
    Ok(worlds)
}

fn read_line(line: &str) -> Result<World, String> {
    let mut words = line.split_whitespace();
    let mut next = |what: &str| words.next().ok_or_else(|| format!("{what} is missing"));
    let word = next("the number of the world")?;
    let number = word.parse().map_err(|_| format!("\"{word}\" is no number of a world"))?;
    let path_length = length(next("the length of the path")?, "length of a path")?;
    let passable = length(next("the radius of the largest disc")?, "radius")?;
    let mut rows = [0; ROWS];
    for (i, row) in rows.iter_mut().enumerate() {
        let word = next(&format!("row {} of {ROWS}", i + 1))?;
        *row = u32::from_str_radix(word, 16)
            .ok()
            .filter(|bits| bits >> COLUMNS == 0)
            .ok_or_else(|| format!("\"{word}\" is no row of {COLUMNS} bits in hexadecimal"))?;
    }
    match words.next() {
        Some(word) => Err(format!("\"{word}\" stands behind the {ROWS} rows")),
        None => Ok(World { number, path_length, passable, rows }),
    }
}

fn length(word: &str, what: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(length) if length > 0.0 && length < 1000.0 => Ok(length),
        _ => Err(format!("\"{word}\" is no {what} in metres")),
    }
}

/// The world of a number: the same for the same number.
pub fn generate(number: u64) -> World {
    let stream = Stream::new(number, "barn");
    let mut world = World { number, path_length: 0.0, passable: 0.0, rows: bare() };
    for attempt in 0..DRAWS {
        world.rows = grown(stream.sample(attempt));
        let lattice = Lattice::of(&world);
        world.passable = lattice.widest();
        if world.passable >= PASSABLE
            && let Some(length) = lattice.shortest()
        {
            world.path_length = length;
            return world;
        }
    }
    // Chance would have to be very bad; an empty one is a world, too.
    world.rows = bare();
    let lattice = Lattice::of(&world);
    World { passable: lattice.widest(), path_length: lattice.shortest().unwrap_or(10.0), ..world }
}

/// What is measured of the rows of a world: the radius of the largest disc that passes, and the length of the shortest way (m), if there is
/// one.
pub fn measure(world: &World) -> (f64, Option<f64>) {
    let lattice = Lattice::of(world);
    (lattice.widest(), lattice.shortest())
}

/// The walls alone.
fn bare() -> [u32; ROWS] {
    let mut rows = [1 | 1 << (COLUMNS - 1); ROWS];
    rows[0] = (1 << COLUMNS) - 1;
    rows
}

/// A random fill, smoothed: a cell with five neighbours or more that are taken is taken, one with one or none is freed.
fn grown(draw: Stream) -> [u32; ROWS] {
    let fill = draw.between(0, 0.17, 0.33);
    let rounds = 2 + draw.index(1, 3);
    let mut rows = bare();
    for row in FIELD..ROWS {
        for column in 1..COLUMNS - 1 {
            let taken = draw.uniform((2 + row * COLUMNS + column) as u64) < fill;
            rows[row] |= u32::from(taken) << column;
        }
    }
    for _ in 0..rounds {
        let before = rows;
        for row in FIELD..ROWS {
            for column in 1..COLUMNS - 1 {
                match neighbours(&before, row, column) {
                    0 | 1 => rows[row] &= !(1 << column),
                    5.. => rows[row] |= 1 << column,
                    _ => {}
                }
            }
        }
    }
    rows
}

/// How many of the eight cells around one in the field are taken; beyond the last row none is.
fn neighbours(rows: &[u32; ROWS], row: usize, column: usize) -> u32 {
    let three = 0b111u32 << (column - 1);
    let here = rows[row] & three & !(1 << column);
    let above = rows.get(row + 1).map_or(0, |bits| bits & three);
    (rows[row - 1] & three).count_ones() + here.count_ones() + above.count_ones()
}

/// Steps of the lattice on which ways are looked for (m), and its size.
const STEP: f64 = 0.05;
const WIDE: usize = 90;
const HIGH: usize = 160;
const CORNER: Point = Point::new(-4.5, 2.5);
/// What the ways of the benchmark keep from the middles of cylinders at least, less the radius of one (m).
const KEPT: f64 = 0.25;

/// How far each point of the corridor is from the nearest cylinder.
struct Lattice {
    clearance: Vec<f64>,
}

/// Something to be looked at, the one of least cost first.
#[derive(PartialEq)]
struct Waiting(f64, usize);

impl Eq for Waiting {}

impl Ord for Waiting {
    fn cmp(&self, other: &Waiting) -> std::cmp::Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Waiting) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Lattice {
    fn of(world: &World) -> Lattice {
        let cylinders: Vec<Point> = world.cylinders().collect();
        let nearest = |at: Point| {
            let square = |c: &Point| (*c - at).dot(*c - at);
            sqrt(cylinders.iter().map(square).fold(f64::INFINITY, f64::min)) - CYLINDER
        };
        Lattice { clearance: (0..WIDE * HIGH).map(|i| nearest(place(i))).collect() }
    }

    /// The radius of the largest disc that gets out of the corridor (m): Dijkstra's search for the widest way.
    fn widest(&self) -> f64 {
        let mut best = vec![f64::NEG_INFINITY; WIDE * HIGH];
        let start = index(START.position());
        best[start] = self.clearance[start];
        let mut waiting = BinaryHeap::from([Waiting(-best[start], start)]);
        while let Some(Waiting(width, at)) = waiting.pop() {
            if at / WIDE == HIGH - 1 {
                return -width;
            }
            if -width < best[at] {
                continue;
            }
            for (next, _) in around(at, 1) {
                let through = (-width).min(self.clearance[next]);
                if through > best[next] {
                    best[next] = through;
                    waiting.push(Waiting(-through, next));
                }
            }
        }
        0.0
    }

    /// The length of the shortest way to the goal (m), if there is one.
    fn shortest(&self) -> Option<f64> {
        let mut best = vec![f64::INFINITY; WIDE * HIGH];
        let start = index(START.position());
        best[start] = 0.0;
        let mut waiting = BinaryHeap::from([Waiting(0.0, start)]);
        let mut shortest: Option<f64> = None;
        while let Some(Waiting(length, at)) = waiting.pop() {
            if at / WIDE == HIGH - 1 {
                let whole = length + place(at).distance(GOAL);
                shortest = Some(shortest.map_or(whole, |least: f64| least.min(whole)));
            }
            if length > best[at] {
                continue;
            }
            for (next, step) in around(at, 2) {
                let through = length + step;
                if self.clearance[next] >= KEPT && through < best[next] {
                    best[next] = through;
                    waiting.push(Waiting(through, next));
                }
            }
        }
        shortest
    }
}

fn place(index: usize) -> Point {
    Point::new(CORNER.x + STEP * (index % WIDE) as f64, CORNER.y + STEP * (index / WIDE) as f64)
}

fn index(at: Point) -> usize {
    let along = |x: f64| libm::round(x / STEP) as usize;
    along(at.y - CORNER.y) * WIDE + along(at.x - CORNER.x)
}

/// The points around one and how far they are: those of a square of `2 reach + 1` on a side.
fn around(at: usize, reach: usize) -> impl Iterator<Item = (usize, f64)> {
    let (row, column) = (at / WIDE, at % WIDE);
    let rows = row.saturating_sub(reach)..=(row + reach).min(HIGH - 1);
    rows.flat_map(move |y| {
        let columns = column.saturating_sub(reach)..=(column + reach).min(WIDE - 1);
        columns.map(move |x| {
            let apart = hypot(x.abs_diff(column) as f64, y.abs_diff(row) as f64);
            (y * WIDE + x, STEP * apart)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(world: &World) -> String {
        let rows = world.rows.map(|bits| format!("{bits:x}")).join(" ");
        format!("{} {} {} {rows}", world.number, world.path_length, world.passable)
    }

    #[test]
    fn what_is_written_is_read_again() {
        let worlds = [generate(1), generate(2)];
        let text = format!("# two\n{}\n\n{}\n", line(&worlds[0]), line(&worlds[1]));
        assert_eq!(read(&text).unwrap(), worlds);
    }

    #[test]
    fn a_wrong_line_is_told_with_its_number_and_what_is_wrong() {
        let good = line(&generate(3));
        let cases = [
            (good.replacen("3 ", "three ", 1), "line 3: \"three\" is no number of a world"),
            (good[..good.len() - 9].trim().to_owned(), "line 3: row 64 of 64 is missing"),
            (format!("{good} 1"), "line 3: \"1\" stands behind the 64 rows"),
            (
                good.replacen("3fffffff", "7fffffff", 1),
                "line 3: \"7fffffff\" is no row of 30 bits in hexadecimal",
            ),
            ("3 -1".to_owned(), "line 3: \"-1\" is no length of a path in metres"),
        ];
        for (bad, what) in cases {
            let said = read(&format!("# worlds\n{good}\n{bad}\n")).unwrap_err();
            assert_eq!(said.to_string(), what);
        }
        assert_eq!(read("# nothing\n").unwrap_err().to_string(), "there is no world in it");
    }

    #[test]
    fn generated_worlds_are_walled_passable_different_and_the_same_again() {
        let worlds: Vec<World> = (0..20).map(generate).collect();
        for world in &worlds {
            assert_eq!(*world, generate(world.number));
            assert!(world.passable >= PASSABLE, "{}", world.number);
            assert!((9.999..14.0).contains(&world.path_length), "{}: {}", world.number, world.path_length);
            assert_eq!(world.rows[0], (1 << COLUMNS) - 1);
            assert!(world.rows.iter().all(|bits| bits & 1 == 1 && bits >> (COLUMNS - 1) == 1));
            assert!(world.rows[1..FIELD].iter().all(|bits| bits.count_ones() == 2), "the apron is clear");
            let near = world.cylinders().map(|c| c.distance(START.position())).fold(9.0, f64::min);
            assert!(near > 1.0);
        }
        assert!(worlds.windows(2).all(|pair| pair[0].rows != pair[1].rows));
        // The published ones have 181 to 365 cylinders, 263 in the mean.
        let counts = worlds.iter().map(|world| world.cylinders().count());
        let mean = counts.clone().sum::<usize>() as f64 / 20.0;
        assert!((230.0..300.0).contains(&mean), "{mean}");
        assert!(counts.clone().all(|count| (160..400).contains(&count)), "{:?}", counts.collect::<Vec<_>>());
    }

    #[test]
    fn the_score_is_a_half_at_a_metre_a_second_and_a_quarter_at_half_of_that() {
        let world = World { path_length: 11.0, ..generate(1) };
        for (speed, score) in [(2.0, 0.5), (1.0, 0.5), (0.5, 0.25), (0.3, 0.15), (0.01, 0.125)] {
            assert!((world.score(11.0 / speed) - score).abs() < 1e-12, "{speed}");
        }
    }
}

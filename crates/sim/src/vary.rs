//! What a seed changes: entries of the files, clutter that is moved about, and free starts.
//!
//! A draw is a function of the files and the seed. When it leaves no free way, the next attempt of the same seed is made.

use types::geometry::{PI, Pose};
use types::value::{Entry, Mistake, Row, Span, Table, TableReader, Value};
use types::{Point, geometry::TAU};

use crate::free_way;
use crate::outline;
use crate::plan::WorldPlan;
use crate::read::read_pose;
use crate::shape::{self, Segment};
use types::chance::Stream;

/// The way that must be free has this width (m): a robot of 0.45 m and 0.17 m on either side, which a sonar tells from touching.
pub const FREE_WIDTH: f64 = 0.8;
/// Attempts until a seed is given up.
const ATTEMPTS: u64 = 200;
/// Attempts to find a new place for one thing, or a start.
const PLACES: u64 = 80;
/// What is moved keeps this far from everything else (m).
const GAP: f64 = 0.05;
/// What is moved keeps this far from the middle of an open door (m).
const DOORSTEP: f64 = 0.9;

/// Entries and their distributions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vary {
    draws: Vec<Draw>,
}

#[derive(Clone, Debug, PartialEq)]
struct Draw {
    path: String,
    at: Span,
    law: Law,
}

/// How an entry is drawn.
#[derive(Clone, Debug, PartialEq)]
enum Law {
    Uniform(f64, f64),
    Normal(f64, f64),
    Factor(f64, f64),
    OneOf(Vec<Entry>),
    Scatter { by: (f64, f64), at_least: usize },
    AnywhereIn(String),
}

/// A world and its robots as a seed has drawn them.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// The world.
    pub plan: WorldPlan,
    /// The tables of the robots, with the drawn entries.
    pub robots: Table,
    /// Where each robot starts, in the order of the tables.
    pub starts: Vec<(String, Pose)>,
    /// How many things were moved.
    pub moved: usize,
    /// How many draws were thrown away because they left no free way.
    pub thrown_away: u64,
}

impl Vary {
    /// Reads a `[vary]` table. Gives nothing when there is a mistake, and all mistakes.
    pub fn read(table: &Table, mistakes: &mut Vec<Mistake>) -> Option<Vary> {
        let before = mistakes.len();
        let mut draws = Vec::new();
        for row in table.rows() {
            let Some(law) = row.entry.value.as_table() else {
                let what = format!("\"{}\" needs a distribution, not {}", row.key, row.entry.value.kind());
                mistakes.push(Mistake::new(row.entry.at, what).help("as in { uniform = [0.5, 1.5] }"));
                continue;
            };
            if let Some(law) = read_law(&row.key, law, row.entry.at, mistakes) {
                draws.push(Draw { path: row.key.clone(), at: row.key_at, law });
            }
        }
        (mistakes.len() == before).then_some(Vary { draws })
    }

    /// Where each draw leads, and where that is written.
    pub fn paths(&self) -> impl Iterator<Item = (&str, Span)> {
        self.draws.iter().map(|draw| (draw.path.as_str(), draw.at))
    }

    /// The draws of both; where both name an entry, `other` counts.
    pub fn with(mut self, other: Vary) -> Vary {
        self.draws.retain(|draw| !other.draws.iter().any(|theirs| theirs.path == draw.path));
        self.draws.extend(other.draws);
        self
    }

    /// Draws a world and its robots.
    ///
    /// `world` is the table of the world file, `robots` names a table for each robot. A path of the form `robot.NAME.entry`
    /// leads into a robot's table, any other into the world (`world.` in front may be left out). A robot starts at its
    /// own `start`, else at that of the world. `through` names the regions to which every robot must find a free way.
    ///
    /// # Errors
    /// All mistakes of the files, or one that says that no draw of this seed leaves a free way.
    pub fn draw(
        &self,
        world: &Table,
        robots: &Table,
        through: &[&str],
        seed: u64,
    ) -> Result<Drawn, Vec<Mistake>> {
        let stream = Stream::new(seed, "vary");
        let mut reasons = Refused::default();
        for attempt in 0..ATTEMPTS {
            match self.attempt(world, robots, through, stream.sample(attempt), &mut reasons)? {
                Some(drawn) => return Ok(Drawn { thrown_away: attempt, ..drawn }),
                // Without chance the next attempt would be the same.
                None if self.draws.is_empty() => break,
                None => {}
            }
        }
        let what = format!("no draw of seed {seed} leaves a free way {FREE_WIDTH} m wide ({reasons})");
        Err(vec![Mistake::new(Span::default(), what).help("leave more room between the things of the world")])
    }

    fn attempt(
        &self,
        world: &Table,
        robots: &Table,
        through: &[&str],
        stream: Stream,
        reasons: &mut Refused,
    ) -> Result<Option<Drawn>, Vec<Mistake>> {
        let (mut world, mut robots) = (world.clone(), robots.clone());
        let mut mistakes = Vec::new();
        for (draw, chance) in self.draws.iter().zip((0..).map(|k| stream.sample(k))) {
            if let Err(mistake) = draw.change(&mut world, &mut robots, chance) {
                mistakes.push(mistake);
            }
        }
        let plan = WorldPlan::read(&world, &mut mistakes);
        let Some(mut plan) = plan.filter(|_| mistakes.is_empty()) else { return Err(mistakes) };
        let mut moved = 0;
        for (draw, chance) in self.draws.iter().zip((0..).map(|k| stream.sample(k))) {
            if let Law::Scatter { by, at_least } = draw.law {
                let movables = movables(&plan, &draw.path);
                if movables.len() < at_least {
                    let what =
                        format!("only {} things are movable, {at_least} are to be moved", movables.len());
                    return Err(vec![
                        Mistake::new(draw.at, what).help("write movable = true where a thing may be moved"),
                    ]);
                }
                let here = scatter(&mut plan, &movables, by, chance);
                moved += here;
                if here < at_least {
                    reasons.scatter += 1;
                    return Ok(None);
                }
            }
        }
        let Some(starts) = self.starts(&plan, &robots, stream)? else {
            reasons.start += 1;
            return Ok(None);
        };
        if !starts.iter().all(|(_, pose)| free_way::exists(&plan, pose.position(), through, FREE_WIDTH)) {
            reasons.way += 1;
            return Ok(None);
        }
        Ok(Some(Drawn { plan, robots, starts, moved, thrown_away: 0 }))
    }

    /// Where each robot starts; nothing when a free start was wanted and not found.
    fn starts(
        &self,
        plan: &WorldPlan,
        robots: &Table,
        stream: Stream,
    ) -> Result<Option<Vec<(String, Pose)>>, Vec<Mistake>> {
        let mut starts: Vec<(String, Pose)> = Vec::new();
        let mut mistakes = Vec::new();
        for (number, row) in robots.rows().iter().enumerate() {
            let own = row.entry.value.as_table().and_then(|table| table.get("start"));
            let free = self.free_start(&format!("robot.{}.start", row.key)).or_else(|| {
                if own.is_none() {
                    self.free_start("start").or_else(|| self.free_start("world.start"))
                } else {
                    None
                }
            });
            if let Some((index, region)) = free {
                let chance = stream.sample(index as u64).sample(number as u64);
                match anywhere_in(plan, region, &starts, chance) {
                    Some(pose) => starts.push((row.key.clone(), pose)),
                    None if plan.region(region).is_none() => {
                        let names = plan.regions.iter().map(|region| region.name.as_str());
                        mistakes.push(Mistake::unknown(self.draws[index].at, "region", region, names));
                    }
                    None => return Ok(None),
                }
                continue;
            }
            match own.map(|entry| (entry, read_pose(entry))) {
                None => starts.push((row.key.clone(), plan.start)),
                Some((_, Some(pose))) => starts.push((row.key.clone(), pose)),
                Some((entry, None)) => mistakes.push(
                    Mistake::new(entry.at, "\"start\" must be a place and a heading")
                        .help("as in start = [1.0, 2.0, \"90deg\"]"),
                ),
            }
        }
        if mistakes.is_empty() { Ok(Some(starts)) } else { Err(mistakes) }
    }

    fn free_start(&self, path: &str) -> Option<(usize, &str)> {
        self.draws.iter().enumerate().find_map(|(index, draw)| match &draw.law {
            Law::AnywhereIn(region) if draw.path == path => Some((index, region.as_str())),
            _ => None,
        })
    }
}

/// Why draws were thrown away.
#[derive(Default)]
struct Refused {
    scatter: u32,
    start: u32,
    way: u32,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Refused { scatter, start, way } = self;
        write!(
            f,
            "{scatter} times too few things could be moved, {start} times there was no free start, {way} times no way"
        )
    }
}

impl Draw {
    /// Puts the drawn value into the tables; laws of place are drawn later.
    fn change(&self, world: &mut Table, robots: &mut Table, chance: Stream) -> Result<(), Mistake> {
        let value = match &self.law {
            Law::Uniform(low, high) => Value::Float(chance.between(0, *low, *high)),
            Law::Normal(mean, deviation) => Value::Float(mean + deviation * chance.normal(0)),
            Law::OneOf(entries) => entries[chance.index(0, entries.len())].value.clone(),
            Law::Factor(low, high) => {
                let factor = chance.between(0, *low, *high);
                let entry =
                    entry_mut(world, robots, &self.path).map_err(|what| Mistake::new(self.at, what))?;
                let Some(old) = entry.as_ref().and_then(|entry| entry.value.as_float()) else {
                    let what = format!("\"{}\" has no number that a factor could change", self.path);
                    return Err(
                        Mistake::new(self.at, what).help("write the entry into the file, or use uniform")
                    );
                };
                Value::Float(old * factor)
            }
            Law::Scatter { .. } | Law::AnywhereIn(_) => return Ok(()),
        };
        // What is wrong with a drawn entry is told at its draw: nobody else has written it.
        let entry = Entry { value, at: self.at };
        set_entry(world, robots, &self.path, entry).map_err(|what| Mistake::new(self.at, what))
    }
}

/// Which table a path leads into, and the path in it.
fn root<'t, 'p>(world: &'t mut Table, robots: &'t mut Table, path: &'p str) -> (&'t mut Table, &'p str) {
    match path.strip_prefix("robot.") {
        Some(rest) => (robots, rest),
        None => (world, path.strip_prefix("world.").unwrap_or(path)),
    }
}

/// What a path names, through tables by key and through lists by name or number.
fn entry_mut<'t>(
    world: &'t mut Table,
    robots: &'t mut Table,
    path: &str,
) -> Result<Option<&'t mut Entry>, String> {
    let (table, path) = root(world, robots, path);
    let mut words = path.split('.');
    let first = words.next().unwrap_or_default();
    let mut entry = table.get_mut(first);
    for word in words {
        entry = match entry.map(|entry| &mut entry.value) {
            None => return Ok(None),
            Some(Value::Table(table)) => table.get_mut(word),
            Some(Value::List(list)) => {
                Some(item(list, word).ok_or_else(|| format!("the list has no item \"{word}\""))?)
            }
            Some(other) => return Err(format!("{} has no entry \"{word}\"", other.kind())),
        };
    }
    Ok(entry)
}

fn item<'t>(list: &'t mut [Entry], word: &str) -> Option<&'t mut Entry> {
    let by_name = list.iter().position(|entry| {
        entry.value.as_table().and_then(|table| table.get("name")).and_then(|name| name.value.as_text())
            == Some(word)
    });
    let index = by_name.or_else(|| word.parse().ok())?;
    list.get_mut(index)
}

fn set_entry(world: &mut Table, robots: &mut Table, path: &str, new: Entry) -> Result<(), String> {
    if let Some(entry) = entry_mut(world, robots, path)? {
        *entry = new;
        return Ok(());
    }
    let Some((parent, key)) = path.rsplit_once('.') else { return grow(world, path, new) };
    // A path of one word is a table itself: the robots', or the world's.
    match (parent, entry_mut(world, robots, parent)?) {
        ("world", _) => grow(world, key, new),
        (_, Some(Entry { value: Value::Table(table), .. })) => grow(table, key, new),
        (_, Some(_)) => Err(format!("\"{parent}\" is no table")),
        (_, None) => {
            let (table, path) = root(world, robots, path);
            grow(table, path, new)
        }
    }
}

/// Puts an entry where a path leads, with the tables on the way: all of them stand where the entry does.
fn grow(table: &mut Table, path: &str, entry: Entry) -> Result<(), String> {
    let (key, rest) = path.split_once('.').map_or((path, None), |(key, rest)| (key, Some(rest)));
    if table.get(key).is_none() {
        let value = if rest.is_some() { Value::Table(Table::new()) } else { entry.value.clone() };
        table.push(Row { key: key.to_owned(), key_at: entry.at, entry: Entry { value, at: entry.at } });
    }
    match (rest, table.get_mut(key).map(|entry| &mut entry.value)) {
        (Some(rest), Some(Value::Table(inner))) => grow(inner, rest, entry),
        (Some(rest), Some(other)) => Err(format!("{} has no entry \"{rest}\"", other.kind())),
        _ => Ok(()),
    }
}

/// A thing that can be moved.
#[derive(Clone, Copy, Debug)]
enum Movable {
    Box(usize),
    Round(usize),
    Person(usize),
}

/// The movable things: `box`, `round` or `person` are those of the list, any other word is all.
fn movables(plan: &WorldPlan, path: &str) -> Vec<Movable> {
    let list = path.strip_prefix("world.").unwrap_or(path);
    let wanted = |name: &str| list == name || !["box", "round", "person"].contains(&list);
    let boxes = plan.boxes.iter().enumerate().filter(|(_, item)| item.movable && wanted("box"));
    let rounds = plan.rounds.iter().enumerate().filter(|(_, item)| item.movable && wanted("round"));
    let people = plan.people.iter().enumerate().filter(|(_, item)| item.movable && wanted("person"));
    boxes
        .map(|(k, _)| Movable::Box(k))
        .chain(rounds.map(|(k, _)| Movable::Round(k)))
        .chain(people.map(|(k, _)| Movable::Person(k)))
        .collect()
}

/// The ground that something covers: a convex outline, grown by a radius.
struct Footprint {
    corners: Vec<Point>,
    radius: f64,
}

impl Footprint {
    fn circle(centre: Point, radius: f64) -> Footprint {
        Footprint { corners: vec![centre], radius }
    }

    fn sides(&self) -> impl Iterator<Item = Segment> {
        let n = self.corners.len();
        (0..n).map(move |k| Segment::new(self.corners[k], self.corners[(k + 1) % n]))
    }

    /// Whether two footprints come nearer than `gap` (m).
    fn meets(&self, other: &Footprint, gap: f64) -> bool {
        let near = self.radius + other.radius + gap;
        let contains = |one: &Footprint, two: &Footprint| {
            one.corners.len() > 2 && shape::inside(&one.corners, two.corners[0])
        };
        if contains(self, other) || contains(other, self) {
            return true;
        }
        self.sides().any(|a| {
            other.sides().any(|b| {
                a.meet(b.a, b.along, 1.0).is_some()
                    || a.nearest(b.a).distance(b.a) < near
                    || a.nearest(b.b()).distance(b.b()) < near
                    || b.nearest(a.a).distance(a.a) < near
                    || b.nearest(a.b()).distance(a.b()) < near
            })
        })
    }
}

impl Movable {
    fn at(self, plan: &WorldPlan) -> Point {
        match self {
            Movable::Box(k) => plan.boxes[k].at,
            Movable::Round(k) => plan.rounds[k].at,
            Movable::Person(k) => plan.people[k].at,
        }
    }

    fn place(self, plan: &mut WorldPlan, at: Point) {
        match self {
            Movable::Box(k) => plan.boxes[k].at = at,
            Movable::Round(k) => plan.rounds[k].at = at,
            Movable::Person(k) => plan.people[k].at = at,
        }
    }

    fn footprint(self, plan: &WorldPlan, at: Point) -> Footprint {
        match self {
            Movable::Box(k) => {
                let item = &plan.boxes[k];
                Footprint { corners: shape::rectangle(at, item.size, item.angle).to_vec(), radius: 0.0 }
            }
            Movable::Round(k) => Footprint::circle(at, plan.rounds[k].radius),
            Movable::Person(k) => Footprint::circle(at, plan.people[k].radius),
        }
    }
}

/// Moves the things to free places and gives how many found one.
fn scatter(plan: &mut WorldPlan, movables: &[Movable], by: (f64, f64), chance: Stream) -> usize {
    let fixed = fixed_ground(plan);
    let mut moved = 0;
    for (number, &this) in movables.iter().enumerate() {
        let from = this.at(plan);
        let home = plan.regions.iter().find(|region| region.contains(from)).cloned();
        let chance = chance.sample(number as u64);
        let free = (0..PLACES).find_map(|k| {
            let to =
                from + Point::polar(chance.between(2 * k, by.0, by.1), chance.between(2 * k + 1, -PI, PI));
            let ground = this.footprint(plan, to);
            let at_home = home.as_ref().is_none_or(|home| home.contains(to));
            let free = at_home
                && !fixed.iter().any(|other| other.meets(&ground, GAP))
                && !movables.iter().enumerate().any(|(k, &other)| {
                    k != number && other.footprint(plan, other.at(plan)).meets(&ground, GAP)
                });
            free.then_some(to)
        });
        if let Some(to) = free {
            this.place(plan, to);
            moved += 1;
        }
    }
    moved
}

/// What stays where it is: everything that is not movable, and the steps of the open doors.
fn fixed_ground(plan: &WorldPlan) -> Vec<Footprint> {
    let mut rest = plan.clone();
    rest.boxes.retain(|item| !item.movable);
    rest.rounds.retain(|item| !item.movable);
    let (field, _) = outline::raise(&rest);
    let faces = field.faces.iter();
    let mut ground: Vec<Footprint> = faces
        .map(|face| Footprint { corners: vec![face.segment.a, face.segment.b()], radius: 0.0 })
        .chain(field.posts.iter().map(|post| Footprint::circle(post.circle.centre, post.circle.radius)))
        .collect();
    // The inside of a box is taken too, not only its sides.
    ground.extend(rest.boxes.iter().map(|item| Footprint {
        corners: shape::rectangle(item.at, item.size, item.angle).to_vec(),
        radius: 0.0,
    }));
    let standing = rest.people.iter().filter(|person| !person.movable && person.appears.is_none());
    ground.extend(standing.map(|person| Footprint::circle(person.at, person.radius)));
    for door in &plan.doors {
        if let Some((_, place)) = door.open.and_then(|open| door.places.get(open)) {
            ground.push(Footprint::circle(*place, DOORSTEP));
        }
    }
    ground
}

/// A free pose in a region, with half the free width around it.
fn anywhere_in(plan: &WorldPlan, region: &str, taken: &[(String, Pose)], chance: Stream) -> Option<Pose> {
    let region = plan.region(region)?;
    let (min, max) = region.bounds();
    let mut ground = fixed_ground(plan);
    for this in movables(plan, "") {
        ground.push(this.footprint(plan, this.at(plan)));
    }
    ground.extend(taken.iter().map(|(_, pose)| Footprint::circle(pose.position(), FREE_WIDTH / 2.0)));
    (0..4 * PLACES).find_map(|k| {
        let at = Point::new(chance.between(3 * k, min.x, max.x), chance.between(3 * k + 1, min.y, max.y));
        let robot = Footprint::circle(at, FREE_WIDTH / 2.0);
        (region.contains(at) && !ground.iter().any(|other| other.meets(&robot, GAP)))
            .then(|| Pose::new(at.x, at.y, TAU * chance.uniform(3 * k + 2) - PI))
    })
}

fn read_law(path: &str, table: &Table, at: Span, mistakes: &mut Vec<Mistake>) -> Option<Law> {
    let mut reader = TableReader::new(table, at, format!("the distribution of \"{path}\""));
    let mut laws = Vec::new();
    for (key, law) in
        [("uniform", Law::Uniform as fn(f64, f64) -> Law), ("normal", Law::Normal), ("factor", Law::Factor)]
    {
        if let Some([a, b]) = reader.floats::<2>(key) {
            if (key == "normal" && b < 0.0) || (key != "normal" && b < a) {
                let at = reader.place(key);
                reader.report(Mistake::new(at, format!("\"{key}\" has its numbers in the wrong order")));
            }
            laws.push(law(a, b));
        }
    }
    if let Some(list) = reader.list("one_of") {
        if list.is_empty() {
            let at = reader.place("one_of");
            reader.report(Mistake::new(at, "\"one_of\" needs at least one value"));
        }
        laws.push(Law::OneOf(list.to_vec()));
    }
    if let Some(region) = reader.text("anywhere_in") {
        if path != "start" && !path.ends_with(".start") {
            let at = reader.place("anywhere_in");
            reader.report(
                Mistake::new(at, "\"anywhere_in\" is for a start").help("as in \"robot.h1.start\" = { … }"),
            );
        }
        laws.push(Law::AnywhereIn(region.to_owned()));
    }
    let place = reader.place("scatter");
    if let Some(table) = reader.table("scatter") {
        let mut inner = TableReader::new(table, place, "\"scatter\"");
        let [least, most] = inner.floats::<2>("by").unwrap_or([0.5, 1.5]);
        let at_least = inner.int("at_least").unwrap_or(1).clamp(0, 1_000_000) as usize;
        if !(0.0 <= least && least <= most) {
            let at = inner.place("by");
            inner.report(Mistake::new(at, "\"by\" has its numbers in the wrong order"));
        }
        inner.finish(mistakes);
        laws.push(Law::Scatter { by: (least, most), at_least });
    }
    if laws.len() > 1 || (laws.is_empty() && table.is_empty()) {
        reader.report(Mistake::new(at, format!("\"{path}\" needs one distribution")).help(
            "it can be: uniform, normal, factor = [a, b], one_of = […], scatter = { … }, anywhere_in = \"region\"",
        ));
    }
    reader.finish(mistakes).then(|| laws.pop()).flatten()
}

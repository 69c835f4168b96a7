//! Reading a world from the tables of its file, with all mistakes at once.

use std::collections::BTreeSet;

use types::geometry::Pose;
use types::value::{Entry, Mistake, Span, Table, TableReader, Value};
use types::{Duration, Point};

use crate::colour::{Colour, NAMES};
use crate::plan::{Crowd, Cuboid, Door, Landmark, Leg, Person, Region, Round, Thing, Wall, WorldPlan};
use crate::shape;

/// Coordinates beyond this are mistakes (m).
const FURTHEST: f64 = 1000.0;
/// A world that covers more is a mistake (m²): a hall of 200 m by 200 m, or a corridor of two kilometres. The grid of the rays has
/// four cells for each square metre, the one that looks for a free way four hundred.
const MOST_AREA: f64 = 40_000.0;

impl WorldPlan {
    /// Reads a world. Gives nothing when there is a mistake, and all mistakes.
    pub fn read(table: &Table, mistakes: &mut Vec<Mistake>) -> Option<WorldPlan> {
        let before = mistakes.len();
        let mut r = Reader { inner: TableReader::new(table, Span::default(), "the world"), mistakes };
        let mut plan = WorldPlan::default();
        r.text("name", &mut plan.name);
        r.number("light", 0.0, 3.0, &mut plan.light);
        r.colour("floor", &mut plan.floor);
        r.colour("ceiling", &mut plan.ceiling);
        r.number("ceiling_height", 1.2, 20.0, &mut plan.ceiling_height);
        r.inner.allow("vary");
        r.inner.allow("goal");
        if let Some(entry) = r.inner.entry("start") {
            match read_pose(entry) {
                Some(pose) => plan.start = pose,
                None => r.inner.report(
                    Mistake::new(entry.at, "\"start\" must be a place and a heading")
                        .help("as in start = [1.0, 2.0, \"90deg\"]"),
                ),
            }
        }
        let ceiling = plan.ceiling_height;
        plan.regions = r.each("region", read_region);
        plan.walls = r.each("wall", |r| read_wall(r, ceiling));
        plan.doors = r.each("door", |r| read_door(r, &plan.walls));
        plan.boxes = r.each("box", read_box);
        plan.rounds = r.each("round", read_round);
        plan.things = r.each("thing", |r| read_thing(r, true));
        let mut next = 0;
        plan.landmarks = r.each("landmark", |r| read_landmark(r, &mut next));
        let regions: Vec<&str> = plan.regions.iter().map(|region| region.name.as_str()).collect();
        plan.people = r.each("person", |r| read_person(r, &regions));
        plan.crowds = r.each("people", |r| read_crowd(r, &regions));
        r.finish();
        check_names(table, "regions", &["region"], mistakes);
        check_names(table, "people or things", &["person", "thing", "landmark"], mistakes);
        check_ids(table, &plan.landmarks, mistakes);
        check_area(table, &plan, mistakes);
        (mistakes.len() == before).then_some(plan)
    }
}

/// A [`TableReader`] with the words of a world file.
struct Reader<'a, 'm> {
    inner: TableReader<'a>,
    mistakes: &'m mut Vec<Mistake>,
}

impl<'a> Reader<'a, '_> {
    fn text(&mut self, key: &str, value: &mut String) {
        if let Some(text) = self.inner.text(key) {
            *value = text.to_owned();
        }
    }

    fn number(&mut self, key: &str, least: f64, most: f64, value: &mut f64) {
        if let Some(x) = self.inner.float_in(key, least, most) {
            *value = x;
        }
    }

    fn truth(&mut self, key: &str, value: &mut bool) {
        if let Some(b) = self.inner.bool(key) {
            *value = b;
        }
    }

    fn colour(&mut self, key: &str, value: &mut Colour) {
        let Some(text) = self.inner.text(key) else { return };
        match Colour::read(text) {
            Some(colour) => *value = colour,
            None => {
                let at = self.inner.place(key);
                let names = NAMES.iter().map(|(name, _)| *name);
                self.inner.report(Mistake::unknown(at, "colour", text, names));
            }
        }
    }

    fn angle(&mut self, key: &str, value: &mut f64) {
        let Some(entry) = self.inner.entry(key) else { return };
        match read_angle(&entry.value) {
            Some(angle) => *value = angle,
            None => self.inner.report(not_an_angle(key, entry)),
        }
    }

    fn wanted_point(&mut self, key: &str, value: &mut Point) {
        if self.inner.entry(key).is_none() {
            self.inner.missing(key, "a place such as [1.0, 2.0]");
        }
        if let Some([x, y]) = self.inner.floats::<2>(key) {
            *value = Point::new(x, y);
            self.check_point(key, *value);
        }
    }

    fn check_point(&mut self, key: &str, point: Point) {
        if !(point.x.abs() <= FURTHEST && point.y.abs() <= FURTHEST) {
            let at = self.inner.place(key);
            self.inner.report(Mistake::new(at, format!("\"{key}\" lies more than {FURTHEST} m away")));
        }
    }

    fn points(&mut self, key: &str, least: usize) -> Vec<Point> {
        let points: Vec<Point> = self
            .inner
            .rows_of_floats::<2>(key)
            .unwrap_or_default()
            .into_iter()
            .map(|[x, y]| Point::new(x, y))
            .collect();
        if self.inner.entry(key).is_some() && points.len() < least {
            let at = self.inner.place(key);
            self.inner.report(Mistake::new(at, format!("\"{key}\" needs at least {least} points")));
        }
        points.iter().for_each(|&point| self.check_point(key, point));
        points
    }

    fn duration(&mut self, key: &str, value: &mut Duration) {
        if let Some(span) = self.inner.duration(key) {
            *value = span;
        }
    }

    /// Reads every table of the list `key`.
    fn each<T>(&mut self, key: &str, mut read: impl FnMut(&mut Reader<'a, '_>) -> T) -> Vec<T> {
        let tables = self.inner.tables(key);
        tables.into_iter().map(|(table, at)| self.within(table, at, key, &mut read)).collect()
    }

    fn within<T>(
        &mut self,
        table: &'a Table,
        at: Span,
        key: &str,
        read: &mut impl FnMut(&mut Reader<'a, '_>) -> T,
    ) -> T {
        let what = match table.get("name").and_then(|entry| entry.value.as_text()) {
            Some(name) => format!("{key} \"{name}\""),
            None => format!("the {key}"),
        };
        let mut reader = Reader { inner: TableReader::new(table, at, what), mistakes: self.mistakes };
        let item = read(&mut reader);
        reader.finish();
        item
    }

    fn finish(self) {
        self.inner.finish(self.mistakes);
    }
}

/// Reads an angle: a number in radians, or a text with its unit, such as `"90deg"`.
pub(crate) fn read_angle(value: &Value) -> Option<f64> {
    if let Some(text) = value.as_text() {
        let text = text.trim();
        let (number, scale) = match text.strip_suffix("deg") {
            Some(number) => (number, std::f64::consts::PI / 180.0),
            None => (text.strip_suffix("rad")?, 1.0),
        };
        return number.trim().parse::<f64>().ok().filter(|x| x.is_finite()).map(|x| x * scale);
    }
    value.as_float().filter(|x| x.is_finite())
}

/// The mistake of an entry that should be an angle.
pub(crate) fn not_an_angle(key: &str, entry: &Entry) -> Mistake {
    Mistake::new(
        entry.at,
        format!("\"{key}\" must be an angle, not {} ({})", entry.value.kind(), entry.value),
    )
    .help("as in \"90deg\", or a number in radians")
}

/// Reads a pose: `[x, y]` or `[x, y, angle]`.
pub fn read_pose(entry: &Entry) -> Option<Pose> {
    let list = entry.value.as_list()?;
    let number = |k: usize| list.get(k)?.value.as_float().filter(|x| x.abs() <= FURTHEST);
    let heading = match list.len() {
        2 => 0.0,
        3 => read_angle(&list[2].value)?,
        _ => return None,
    };
    Some(Pose::new(number(0)?, number(1)?, heading))
}

fn read_region(r: &mut Reader<'_, '_>) -> Region {
    let mut region = Region { name: String::new(), polygon: r.points("polygon", 3) };
    r.inner.required_text("name", "the word by which goals and people call it");
    r.text("name", &mut region.name);
    match r.inner.floats::<4>("rect") {
        Some([x0, y0, x1, y1]) => {
            for corner in [Point::new(x0, y0), Point::new(x1, y1)] {
                r.check_point("rect", corner);
            }
            let (centre, size) =
                (Point::new((x0 + x1) / 2.0, (y0 + y1) / 2.0), Point::new((x1 - x0).abs(), (y1 - y0).abs()));
            region.polygon = shape::rectangle(centre, size, 0.0).to_vec();
        }
        None if region.polygon.is_empty() => {
            r.inner.missing("rect", "two corners such as [0, 0, 8, 6], or a \"polygon\"")
        }
        None => {}
    }
    region
}

fn read_wall(r: &mut Reader<'_, '_>, ceiling: f64) -> Wall {
    let mut wall = Wall { height: ceiling, line: r.points("line", 2), ..Wall::default() };
    r.inner.allow("name");
    if wall.line.is_empty() {
        r.inner.missing("line", "its corners such as [[0, 0], [8, 0]]");
    }
    let mut closed = false;
    r.truth("closed", &mut closed);
    if closed && wall.line.len() > 2 {
        wall.line.push(wall.line[0]);
    }
    r.number("thickness", 0.0, 2.0, &mut wall.thickness);
    r.number("height", 0.05, 20.0, &mut wall.height);
    r.colour("colour", &mut wall.colour);
    wall
}

fn read_door(r: &mut Reader<'_, '_>, walls: &[Wall]) -> Door {
    let mut door = Door { name: String::new(), width: 0.9, places: Vec::new(), open: None };
    r.text("name", &mut door.name);
    r.number("width", 0.3, 10.0, &mut door.width);
    match r.inner.table("places") {
        None => r.inner.missing("places", "a table of places such as { east = [8, 1.5] }"),
        Some(places) => {
            let at = r.inner.place("places");
            let mut inner = TableReader::new(places, at, "\"places\"");
            for row in places.rows() {
                let Some([x, y]) = inner.floats::<2>(&row.key) else { continue };
                let place = Point::new(x, y);
                if !walls.iter().any(|wall| crate::outline::opens(wall, place, door.width)) {
                    let what = format!(
                        "the place \"{}\" of door \"{}\" lies on no wall that is wide enough",
                        row.key, door.name
                    );
                    inner.report(
                        Mistake::new(row.entry.at, what)
                            .help("give the middle of the opening, on the line of a wall"),
                    );
                }
                door.places.push((row.key.clone(), place));
            }
            inner.finish(r.mistakes);
        }
    }
    door.open = (!door.places.is_empty()).then_some(0);
    let open = r.inner.entry("open");
    if let Some(Entry { value: Value::Bool(false), .. }) = open {
        door.open = None;
    } else if let Some(word) = r.inner.text("open") {
        door.open = door.places.iter().position(|(name, _)| name == word);
        if door.open.is_none() {
            let names: Vec<&str> = door.places.iter().map(|(name, _)| name.as_str()).collect();
            let at = r.inner.place("open");
            r.inner.report(Mistake::unknown(at, "place of this door", word, names));
        }
    }
    door
}

fn read_box(r: &mut Reader<'_, '_>) -> Cuboid {
    let mut item = Cuboid::default();
    r.text("name", &mut item.name);
    r.wanted_point("at", &mut item.at);
    if let Some([length, depth]) = r.inner.floats::<2>("size") {
        if (0.01..=FURTHEST).contains(&length) && (0.01..=FURTHEST).contains(&depth) {
            item.size = Point::new(length, depth);
        } else {
            let at = r.inner.place("size");
            r.inner.report(Mistake::new(at, "a box is at least 0.01 m long and deep"));
        }
    }
    r.angle("angle", &mut item.angle);
    r.number("height", 0.02, 20.0, &mut item.height);
    r.truth("legs", &mut item.legs);
    r.colour("colour", &mut item.colour);
    item.top = Colour(item.colour.0.map(|channel| channel.saturating_add(28)));
    r.colour("top", &mut item.top);
    r.truth("movable", &mut item.movable);
    item
}

fn read_round(r: &mut Reader<'_, '_>) -> Round {
    let mut item = Round::default();
    r.text("name", &mut item.name);
    r.wanted_point("at", &mut item.at);
    r.number("radius", 0.005, 50.0, &mut item.radius);
    r.number("height", 0.02, 20.0, &mut item.height);
    r.colour("colour", &mut item.colour);
    r.truth("movable", &mut item.movable);
    item
}

fn read_thing(r: &mut Reader<'_, '_>, stands: bool) -> Thing {
    let mut item = Thing::default();
    r.text("name", &mut item.name);
    if stands {
        r.wanted_point("at", &mut item.at);
    }
    r.number("radius", 0.01, 2.0, &mut item.radius);
    r.number("height", 0.0, 10.0, &mut item.height);
    r.colour("colour", &mut item.colour);
    item
}

/// A landmark without a number has the one after that of the landmark before it.
fn read_landmark(r: &mut Reader<'_, '_>, last: &mut u32) -> Landmark {
    let mut item = Landmark { id: last.saturating_add(1), ..Landmark::default() };
    r.text("name", &mut item.name);
    match r.inner.int("id") {
        None => {}
        Some(id) if (1..=1_000_000).contains(&id) => item.id = id as u32,
        Some(id) => {
            let at = r.inner.place("id");
            r.inner.report(Mistake::new(at, format!("\"id\" is {id}, it must lie from 1 to 1000000")));
        }
    }
    *last = item.id;
    r.wanted_point("at", &mut item.at);
    r.angle("facing", &mut item.facing);
    r.number("radius", 0.0, 2.0, &mut item.radius);
    r.number("height", 0.02, 10.0, &mut item.height);
    r.colour("colour", &mut item.colour);
    r.colour("top", &mut item.top);
    r.truth("infrared", &mut item.infrared);
    item
}

fn read_person(r: &mut Reader<'_, '_>, regions: &[&str]) -> Person {
    let mut person = Person::default();
    r.text("name", &mut person.name);
    r.wanted_point("at", &mut person.at);
    r.angle("facing", &mut person.facing);
    r.number("radius", 0.05, 0.5, &mut person.radius);
    r.number("height", 0.5, 2.5, &mut person.height);
    r.colour("shirt", &mut person.shirt);
    r.colour("trousers", &mut person.trousers);
    r.number("speed", 0.01, 5.0, &mut person.speed);
    r.truth("repeat", &mut person.repeat);
    r.truth("movable", &mut person.movable);
    person.gap = r.inner.float_in("gap", 0.3, 20.0);
    person.appears = read_when(r, "appears", regions);
    let at = r.inner.place("carries");
    if let Some(table) = r.inner.table("carries") {
        person.carries =
            Some(r.within(table, at, "thing", &mut |r: &mut Reader<'_, '_>| read_thing(r, false)));
    }
    person.walk = r.each("walk", |r| read_leg(r, regions));
    person
}

fn read_crowd(r: &mut Reader<'_, '_>, regions: &[&str]) -> Crowd {
    let mut crowd = Crowd::default();
    match r.inner.int("count") {
        None => {}
        Some(count) if (1..=200).contains(&count) => crowd.count = count as u32,
        Some(count) => {
            let at = r.inner.place("count");
            r.inner.report(Mistake::new(at, format!("\"count\" is {count}, it must lie from 1 to 200")));
        }
    }
    match read_when(r, "area", regions) {
        Some(area) => crowd.area = area,
        None => r.inner.missing("area", "the region in which they walk"),
    }
    r.number("yields", 0.0, 1.0, &mut crowd.yields);
    r.number("radius", 0.05, 0.5, &mut crowd.radius);
    if let Some([slow, fast]) = r.inner.floats::<2>("speed") {
        if 0.01 <= slow && slow <= fast && fast <= 5.0 {
            crowd.speed = (slow, fast);
        } else {
            let at = r.inner.place("speed");
            r.inner.report(Mistake::new(at, "\"speed\" is the slowest and the fastest, from 0.01 to 5 m/s"));
        }
    }
    crowd
}

fn read_leg(r: &mut Reader<'_, '_>, regions: &[&str]) -> Leg {
    let mut leg = Leg { to: Point::default(), when: read_when(r, "when", regions), wait: Duration::ZERO };
    r.wanted_point("to", &mut leg.to);
    r.duration("wait", &mut leg.wait);
    leg
}

/// The name of a region that must be there.
fn read_when(r: &mut Reader<'_, '_>, key: &str, regions: &[&str]) -> Option<String> {
    let word = r.inner.text(key)?;
    if !regions.contains(&word) {
        let at = r.inner.place(key);
        r.inner.report(Mistake::unknown(at, "region", word, regions.iter().copied()));
    }
    Some(word.to_owned())
}

/// The tables of a list and their places.
fn tables<'t>(table: &'t Table, key: &str) -> impl Iterator<Item = (&'t Table, Span)> {
    let list = table.get(key).and_then(|entry| entry.value.as_list()).unwrap_or_default();
    list.iter().filter_map(|entry| Some((entry.value.as_table()?, entry.at)))
}

/// No two regions and no two things that a goal can name may share a name.
fn check_names(table: &Table, kind: &str, lists: &[&str], mistakes: &mut Vec<Mistake>) {
    let mut taken = BTreeSet::new();
    for (item, _) in lists.iter().flat_map(|list| tables(table, list)) {
        let Some(Entry { value: Value::Text(name), at }) = item.get("name") else { continue };
        if !name.is_empty() && !taken.insert(name) {
            mistakes.push(Mistake::new(*at, format!("two {kind} are called \"{name}\"")));
        }
    }
}

/// No two landmarks may share a number.
fn check_ids(table: &Table, landmarks: &[Landmark], mistakes: &mut Vec<Mistake>) {
    let mut taken = BTreeSet::new();
    for (landmark, (_, at)) in landmarks.iter().zip(tables(table, "landmark")) {
        if !taken.insert(landmark.id) {
            mistakes.push(Mistake::new(at, format!("two landmarks have the number {}", landmark.id)));
        }
    }
}

/// What stands must not cover more than the grids have room for; said once, at what goes too far.
fn check_area(table: &Table, plan: &WorldPlan, mistakes: &mut Vec<Mistake>) {
    let (mut min, mut max) =
        (Point::new(f64::INFINITY, f64::INFINITY), Point::new(-f64::INFINITY, -f64::INFINITY));
    let walls = plan.walls.iter().map(|wall| (wall.line.clone(), wall.thickness));
    let boxes = plan.boxes.iter().map(|item| (vec![item.at], item.size.norm() / 2.0));
    let rounds = plan.rounds.iter().map(|item| (vec![item.at], item.radius));
    let things = plan.things.iter().map(|item| (vec![item.at], item.radius));
    let landmarks = plan.landmarks.iter().map(|item| (vec![item.at], item.radius));
    let places =
        ["wall", "box", "round", "thing", "landmark"].into_iter().flat_map(|list| tables(table, list));
    for ((points, reach), (_, at)) in
        walls.chain(boxes).chain(rounds).chain(things).chain(landmarks).zip(places)
    {
        for point in points {
            min = Point::new(min.x.min(point.x - reach), min.y.min(point.y - reach));
            max = Point::new(max.x.max(point.x + reach), max.y.max(point.y + reach));
        }
        let size = max - min;
        if size.x * size.y > MOST_AREA {
            let what = format!(
                "with this the world is {:.0} m by {:.0} m, and more than {MOST_AREA} m² is too large",
                size.x, size.y
            );
            mistakes.push(Mistake::new(at, what).help("coordinates are in metres"));
            return;
        }
    }
}

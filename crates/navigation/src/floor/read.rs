//! A floor plan as a value of a file.

use types::geometry::Pose;
use types::params::ParamValue;
use types::value::{Entry, Mistake, Span, Table, Value};
use types::{Point, params::Mistakes};

use super::{Block, Disc, FloorPlan, Wall};

/// The lists of a plan: the key, how many numbers an item has at least and at most, and what they are.
const LISTS: [(&str, usize, usize, &str); 3] = [
    ("walls", 4, 5, "[x0, y0, x1, y1] or [x0, y0, x1, y1, thickness]"),
    ("discs", 3, 3, "[x, y, radius]"),
    ("boxes", 4, 5, "[x, y, length, depth] or [x, y, length, depth, angle]"),
];
/// Farther from the origin no floor reaches (m).
const FARTHEST: f64 = 100_000.0;

impl FloorPlan {
    /// Reads the table of a plan; all mistakes at once, each with its place.
    pub fn read(table: &Table, mistakes: &mut Mistakes) -> FloorPlan {
        let mut plan = FloorPlan::default();
        for row in table.rows() {
            let Some((key, least, most, form)) = LISTS.iter().find(|(key, ..)| *key == row.key) else {
                let keys = LISTS.iter().map(|(key, ..)| *key);
                mistakes.push(Mistake::unknown(row.key_at, "list of a floor", &row.key, keys));
                continue;
            };
            let Some(items) = row.entry.value.as_list() else {
                let what = format!("\"{key}\" of a floor is {}, not a list", row.entry.value.kind());
                mistakes.push(Mistake::new(row.entry.at, what).help(format!("it is a list of {form}")));
                continue;
            };
            for item in items {
                match numbers(item).filter(|numbers| (*least..=*most).contains(&numbers.len())) {
                    Some(numbers) => mistakes
                        .extend(plan.add(key, &numbers).err().map(|what| mistake(item.at, what, form))),
                    None => mistakes.push(mistake(
                        item.at,
                        format!("{} cannot be one of the {key} of a floor", item.value),
                        form,
                    )),
                }
            }
        }
        plan
    }

    /// Adds an item of a list, and says what is wrong with it.
    fn add(&mut self, list: &str, item: &[f64]) -> Result<(), String> {
        let last = item.get(4).copied().unwrap_or(0.0);
        if let Some(wrong) = item.iter().find(|x| !x.is_finite() || x.abs() > FARTHEST) {
            return Err(format!("{wrong} is no place or length on a floor"));
        }
        let (x, y) = (item[0], item[1]);
        match list {
            "walls" => {
                let wall = Wall { from: Point::new(x, y), to: Point::new(item[2], item[3]), thickness: last };
                if last < 0.0 {
                    return Err(format!("a wall cannot be {last} m thick"));
                }
                if wall.from == wall.to {
                    return Err(format!("a wall from [{x}, {y}] to the same place has no length"));
                }
                self.walls.push(wall);
            }
            "discs" => {
                if item[2] <= 0.0 {
                    return Err(format!("a disc cannot have a radius of {} m", item[2]));
                }
                self.discs.push(Disc { centre: Point::new(x, y), radius: item[2] });
            }
            _ => {
                if item[2] <= 0.0 || item[3] <= 0.0 {
                    return Err(format!("a box cannot be {} m by {} m", item[2], item[3]));
                }
                self.boxes.push(Block { at: Pose::new(x, y, last), length: item[2], depth: item[3] });
            }
        }
        Ok(())
    }
}

fn mistake(at: Span, what: String, form: &str) -> Mistake {
    Mistake::new(at, what).help(format!("an item is {form}"))
}

fn numbers(item: &Entry) -> Option<Vec<f64>> {
    item.value.as_list()?.iter().map(|entry| entry.value.as_float()).collect()
}

fn list<const N: usize>(items: impl Iterator<Item = ([f64; N], usize)>) -> Value {
    let item = |(item, len): ([f64; N], usize)| {
        Entry::from(Value::List(item[..len].iter().map(|x| Entry::from(Value::Float(*x))).collect()))
    };
    Value::List(items.map(item).collect())
}

impl ParamValue for FloorPlan {
    const KIND: &'static str = "a floor: a table of \"walls\" as [[x0, y0, x1, y1]], of \"discs\" as [[x, y, radius]] and of \"boxes\" as [[x, y, length, depth, angle]]";

    fn from_value(value: &Value) -> Option<FloorPlan> {
        let mut mistakes = Mistakes::new();
        let plan = FloorPlan::read(value.as_table()?, &mut mistakes);
        mistakes.is_empty().then_some(plan)
    }

    fn to_value(&self) -> Value {
        let mut table = Table::new();
        let walls = self.walls.iter().map(|wall| {
            let Wall { from, to, thickness } = *wall;
            ([from.x, from.y, to.x, to.y, thickness], if thickness == 0.0 { 4 } else { 5 })
        });
        let discs = self.discs.iter().map(|disc| ([disc.centre.x, disc.centre.y, disc.radius], 3));
        let boxes = self.boxes.iter().map(|block| {
            let Pose { x, y, heading } = block.at;
            ([x, y, block.length, block.depth, heading], if heading == 0.0 { 4 } else { 5 })
        });
        table.set("walls", list(walls));
        table.set("discs", list(discs));
        table.set("boxes", list(boxes));
        Value::Table(table)
    }
}

//! The floor of an agent: `floor = "world"` and `floor = "office.toml"` become the table that they stand for.
//!
//! An agent that has a parameter `floor` which is a table may be given a name instead. What it stands for goes into the plan, and so into the log:
//! a run is repeated on the same floor, whatever became of the file.

use agents::localizer::FloorPlan;
use runtime::AgentPlan;
use sim::building::Building;
use sim::{Model, WorldPlan};
use types::value::{Entry, Mistake, Span, Table, Value};

use super::library::Shelf;
use super::read::{OF_ROBOT, Reader};
use super::tree;

/// The parameter.
const FLOOR: &str = "floor";
/// The name that stands for what a plan of the simulated building shows.
const OF_WORLD: &str = "world";

/// Puts tables into the place of the names. Agents, robots and the world are known by then.
pub(super) fn read(reader: &mut Reader<'_>) {
    for agent in with_floor(reader) {
        let Some(entry) = reader.plan.agents[agent].params.get(FLOOR).cloned() else { continue };
        let table = match &entry.value {
            Value::Table(table) => Some(table.clone()),
            Value::Text(name) if name == OF_WORLD => of_world(reader, agent, entry.at),
            Value::Text(name) => of_file(reader, name, entry.at),
            // It is said with the other parameters.
            _ => continue,
        };
        // What is wrong in it is told with its places, which are those of a file where it comes from one.
        let before = reader.mistakes.len();
        if let Some(table) = &table {
            FloorPlan::read(table, &mut reader.mistakes);
        }
        match table.filter(|_| reader.mistakes.len() == before) {
            Some(table) => {
                let params = &mut reader.plan.agents[agent].params;
                params.set(FLOOR, Entry { value: Value::Table(table), at: entry.at });
            }
            None => reader.spoiled.push(entry.at),
        }
    }
}

/// The places in the plan of the agents that have a floor.
fn with_floor(reader: &Reader<'_>) -> Vec<usize> {
    let has = |agent: &AgentPlan| {
        let kind = reader.registry.get(&agent.kind)?;
        kind.params.iter().find(|field| field.name == FLOOR)?.default.as_table()?;
        Some(agent.params.get(FLOOR).is_some())
    };
    let agents = reader.plan.agents.iter().enumerate();
    agents.filter(|(_, agent)| has(agent) == Some(true)).map(|(place, _)| place).collect()
}

/// What a plan of the simulated building shows at the height of the laser of the agent's robot.
fn of_world(reader: &mut Reader<'_>, agent: usize, at: Span) -> Option<Table> {
    let Some(world) = &reader.world else {
        // What is wrong with a world that is there has been said.
        if reader.plan.sections.get("world").is_none() {
            let mistake = Mistake::new(at, "there is no world whose floor it could be");
            reader
                .mistakes
                .push(mistake.help(
                    "name one, as in world = \"laboratory\", or a file, as in floor = \"office.toml\"",
                ));
        }
        return None;
    };
    let world = WorldPlan::read(world, &mut Vec::new())?;
    Some(table_of(&world.building(height_of_laser(reader, agent))))
}

/// The height of the laser of the agent's robot (m), or of the only robot; that of a usual one where it has none.
fn height_of_laser(reader: &Reader<'_>, agent: usize) -> f64 {
    let named = reader.plan.agents[agent].robot.as_deref();
    let robot = reader.robots.rows().iter().find(|row| named.is_none_or(|named| named == row.key));
    let gate = reader.registry.get(super::read::ROBOT).map(|kind| kind.params.iter().map(|field| field.name));
    let elsewhere: Vec<&str> = gate.into_iter().flatten().chain(OF_ROBOT).collect();
    let model = robot.and_then(|row| {
        let table = row.entry.value.as_table()?;
        Model::read(table, row.entry.at, &elsewhere, &mut Vec::new())
    });
    model.and_then(|model| model.laser).unwrap_or_default().height
}

fn of_file(reader: &mut Reader<'_>, name: &str, at: Span) -> Option<Table> {
    match Shelf::Floors.find(name, &reader.folder) {
        Ok(found) => {
            let base = reader.sources.add(found.name, found.text);
            tree::read(&reader.sources, base, &mut reader.mistakes)
        }
        Err(mistake) => {
            reader.mistakes.push(Mistake { at, ..mistake });
            None
        }
    }
}

fn table_of(building: &Building) -> Table {
    let list = |numbers: &[f64]| {
        Entry::from(Value::List(numbers.iter().map(|number| Entry::from(Value::Float(*number))).collect()))
    };
    let walls = building.walls.iter().map(|(from, to, thickness)| match *thickness {
        thickness if thickness > 0.0 => list(&[from.x, from.y, to.x, to.y, thickness]),
        _ => list(&[from.x, from.y, to.x, to.y]),
    });
    let discs = building.rounds.iter().map(|(at, radius)| list(&[at.x, at.y, *radius]));
    let boxes = building.boxes.iter().map(|(at, size)| list(&[at.x, at.y, size.x, size.y, at.heading]));
    let mut table = Table::new();
    table.set("walls", Value::List(walls.collect()));
    table.set("discs", Value::List(discs.collect()));
    table.set("boxes", Value::List(boxes.collect()));
    table
}

//! Maps: grids of cells with their place in the world.

use std::path::Path;

use rusqlite::{Connection, OptionalExtension as _, Transaction};
use types::{Pose, Time};

use crate::error::{Result, check_word};
use crate::pattern::LARGEST;
use crate::{KnowledgeError, Listed, seal};

/// A grid of square cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// What it is called.
    pub name: String,
    /// The side of a cell (m), more than zero.
    pub resolution: f64,
    /// Where the outer corner of the first cell lies: `world_from_map` (m, m, rad).
    pub origin: Pose,
    /// Cells in a row, along the map's x.
    pub width: u32,
    /// Rows, along the map's y.
    pub height: u32,
    /// `width × height` cells, row by row from the origin, at most 2²⁸. What a value means is said by who made the map.
    pub cells: Vec<u8>,
    /// When it was made, on the maker's clock.
    pub time: Time,
}

impl Map {
    pub(crate) fn check(&self) -> Result<()> {
        check_word("the name of a map", &self.name)?;
        let wrong = |why: String, help: &str| {
            Err(KnowledgeError::wrong(format!("map \"{}\" {why}", self.name), help))
        };
        if !(self.resolution > 0.0 && self.resolution.is_finite()) {
            return wrong(
                format!("has cells of {} m", self.resolution),
                "give the side of a cell, as in 0.05",
            );
        }
        let Pose { x, y, heading } = self.origin;
        if ![x, y, heading].iter().all(|value| value.is_finite()) {
            return wrong("lies nowhere".into(), "its origin is three numbers (m, m, rad)");
        }
        let needed = u64::from(self.width) * u64::from(self.height);
        if needed == 0 || needed != self.cells.len() as u64 {
            let (width, height, found) = (self.width, self.height, self.cells.len());
            return wrong(format!("of {width} × {height} cells has {found}"), "give each cell a byte");
        }
        if self.cells.len() > LARGEST {
            return wrong(format!("has more than {LARGEST} cells"), "make its cells larger");
        }
        Ok(())
    }

    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        let Pose { x, y, heading } = self.origin;
        let Map { name, time, resolution, width, height, cells, .. } = self;
        let put = seal::put(
            transaction,
            "map",
            &[name, &time.0, resolution, &x, &y, &heading, width, height, cells],
        );
        put.map_err(|error| KnowledgeError::of(file, &error))
    }
}

pub(crate) fn get(file: &Path, connection: &Connection, name: &str) -> Result<Option<Map>> {
    let sql =
        "SELECT name, time, resolution, x, y, heading, width, height, cells, crc FROM map WHERE name = ?1";
    let map = connection
        .query_row(sql, [name], |row| {
            seal::verify(row, 9)?;
            Ok(Map {
                name: name.to_owned(),
                time: Time(row.get(1)?),
                resolution: row.get(2)?,
                origin: Pose { x: row.get(3)?, y: row.get(4)?, heading: row.get(5)? },
                width: row.get(6)?,
                height: row.get(7)?,
                cells: row.get(8)?,
            })
        })
        .optional()
        .map_err(|error| KnowledgeError::of(file, &error))?;
    // Whoever draws a map relies on as many cells as it says.
    match map {
        Some(map) if map.check().is_err() => {
            Err(KnowledgeError::damaged(file, format!("the map \"{name}\" cannot be read")))
        }
        map => Ok(map),
    }
}

pub(crate) fn list(connection: &Connection) -> rusqlite::Result<Vec<Listed>> {
    let mut statement =
        connection.prepare("SELECT name, width, height, resolution FROM map ORDER BY name")?;
    let listed = statement.query_map([], |row| {
        let (width, height): (i64, i64) = (row.get(1)?, row.get(2)?);
        let what = format!("{width} × {height} cells of {} m", row.get::<_, f64>(3)?);
        Ok(Listed { name: row.get(0)?, what })
    })?;
    listed.collect()
}

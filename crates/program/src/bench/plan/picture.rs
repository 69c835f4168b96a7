//! A picture of the potential: when the first way was published, and when the shortest was.

use std::path::Path;

use navigation::path::{Anytime, Cell, Field, Grid, Refined};
use record::figure::{Potential, PotentialPanel};

use super::{Floor, Query};
use crate::error::Failure;

const DOTS_PER_INCH: f64 = 200.0;

/// Draws the query whose first way is the farthest from the shortest, and says where the picture is.
pub(super) fn write(floors: &[Floor], file: &Path) -> Result<String, Failure> {
    let Some((floor, query)) =
        floors.iter().filter_map(roughest).max_by(|a, b| a.2.total_cmp(&b.2)).map(|(f, q, _)| (f, q))
    else {
        return Err(Failure::new("on no map there is a way to be drawn").help("name other maps or queries"));
    };
    let failed = |what: String| {
        Failure::new(format!("{}: {what}", file.display()))
            .help("name a file that can be written: --picture FILE")
    };
    let png = figure(floor, query).draw().png(DOTS_PER_INCH).map_err(|error| failed(error.to_string()))?;
    std::fs::write(file, png).map_err(|error| failed(error.to_string()))?;
    Ok(format!(
        "the potential on {} from column {}, row {} to {}, {}: {}",
        floor.name,
        query.start.x,
        query.start.y,
        query.goal.x,
        query.goal.y,
        file.display()
    ))
}

/// The query of a map whose first way is the longest beside the shortest, and how much longer it is (sides of a cell).
fn roughest(floor: &Floor) -> Option<(&Floor, Query, f64)> {
    let mut field = Field::new(floor.grid.width(), floor.grid.height());
    let more = |query: &Query| {
        let optimum = query.length?;
        field.begin(&floor.grid, query.start, query.goal).ok()?;
        Some((floor, *query, field.best().length() - optimum))
    };
    floor.queries.iter().filter_map(more).max_by(|a, b| a.2.total_cmp(&b.2))
}

/// The potential with the first way and with the last, each as it was when the way was published.
pub(super) fn figure(floor: &Floor, query: Query) -> Potential {
    let mut field = Field::new(floor.grid.width(), floor.grid.height());
    let mut panels = Vec::new();
    if field.begin(&floor.grid, query.start, query.goal).is_ok() {
        panels.push(panel(&floor.grid, &field, "first way"));
        let mut refinements = 1;
        while field.refine() != Refined::Final {
            refinements += 1;
        }
        let s = if refinements == 1 { "" } else { "s" };
        panels.push(panel(&floor.grid, &field, &format!("after {refinements} refinement{s}")));
    }
    Potential { panels, unit: "way to the goal (sides of a cell)".into() }
}

fn panel(grid: &Grid, field: &Field, title: &str) -> PotentialPanel {
    let cells = || {
        let width = grid.width();
        (0..grid.height()).flat_map(move |y| (0..width).map(move |x| Cell::new(x, y)))
    };
    let best = field.best();
    PotentialPanel {
        title: format!(
            "{title}: {:.1} long, quality {:.0} % or better",
            best.length(),
            100.0 * best.quality()
        ),
        columns: grid.width() as usize,
        values: cells().map(|cell| field.potential(cell).unwrap_or(f64::NAN)).collect(),
        closed: cells().map(|cell| grid.is_closed(cell)).collect(),
        way: best.cells().iter().map(|cell| (cell.x, cell.y)).collect(),
    }
}

//! Where a robot can stand.

use libm::ceil;
use types::Point;
use types::chance::Stream;

use super::Distances;

/// Side of a cell where the floor is not too large for it (m).
const CELL: f64 = 0.1;
/// So many cells are looked at at most, 4 bytes each of those that are free.
const CELLS_MOST: f64 = 1_048_576.0;

/// The places of a floor on which a body can stand, to be drawn from.
#[derive(Clone, Debug, Default)]
pub struct FreeFloor {
    /// The free cells, by number.
    cells: Vec<u32>,
    corner: Point,
    cell: f64,
    width: u32,
}

impl FreeFloor {
    /// Where a body of this radius (m) can stand. Looks at every cell once, and takes 4 bytes for each that is free.
    pub fn new(floor: &impl Distances, radius: f64) -> FreeFloor {
        let (low, high) = floor.bounds();
        let size = high - low;
        let cell = CELL.max(libm::sqrt(size.x * size.y / CELLS_MOST));
        let (width, height) = (ceil(size.x / cell).max(1.0) as u32, ceil(size.y / cell).max(1.0) as u32);
        let mut free = FreeFloor { cells: Vec::new(), corner: low, cell, width };
        let is_free = |number: &u32| floor.is_free(free.middle(*number), radius);
        free.cells = (0..width * height).filter(is_free).collect();
        free
    }

    /// How much of it there is (m²).
    pub fn area(&self) -> f64 {
        self.cells.len() as f64 * self.cell * self.cell
    }

    /// A place anywhere on it, by the draws 0 to 2 of a stream; the corner of a floor on which nothing is free.
    pub fn draw(&self, stream: Stream) -> Point {
        let Some(number) = self.cells.get(stream.index(0, self.cells.len())) else { return self.corner };
        let within = Point::new(stream.uniform(1) - 0.5, stream.uniform(2) - 0.5);
        self.middle(*number) + within * self.cell
    }

    fn middle(&self, number: u32) -> Point {
        let (x, y) = (number % self.width, number / self.width);
        self.corner + Point::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * self.cell
    }
}

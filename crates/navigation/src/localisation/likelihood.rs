//! How well the end of a beam suits a map: the likelihood field.
//!
//! In plain words: where a beam ends something should stand. The nearer the nearest thing on the map, the likelier is the pose from which
//! the beam was sent.
//!
//! ```text
//! p(d) = (h exp(−d²/2σ²) + r) / (h + r)        d from the end of the beam to the nearest taken cell, h + r = 1
//! ```
//!
//! r is for what no map knows, people and glass. Distances are exact for the middles of cells (Felzenszwalb and Huttenlocher, "Distance
//! transforms of sampled functions", 2012). It asks not whether something stands on the beam's way, so it is quick, and smooth in the pose.
//! (Thrun, Burgard and Fox, "Probabilistic Robotics", 2005, table 6.3.)

use types::Point;

use crate::mapping::Known;
use crate::mapping::ray::Lattice;

/// What is known of beams and maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldParameters {
    /// σ, standard deviation of the end of a beam (m). 0.1: two cells of a map, and a laser that is better than both.
    pub deviation: f64,
    /// r, share of beams that end at what is not on the map. 0.1: some people about.
    pub random: f64,
}

impl Default for FieldParameters {
    fn default() -> FieldParameters {
        FieldParameters { deviation: 0.1, random: 0.1 }
    }
}

/// A map as beams see it. It does not change.
#[derive(Clone, Debug)]
pub struct LikelihoodField {
    lattice: Lattice,
    /// ln p of each cell, and of all that lies outside.
    logs: Box<[f32]>,
    outside: f32,
    /// Where a robot can be.
    free: Box<[u32]>,
}

impl LikelihoodField {
    /// From what is known of the cells of a lattice; nothing when no cell is free, or nothing stands anywhere.
    pub fn new(
        parameters: FieldParameters,
        lattice: Lattice,
        known: impl Fn(usize) -> Known,
    ) -> Option<LikelihoodField> {
        let cells = 0..lattice.cells();
        let free: Box<[u32]> =
            cells.clone().filter(|cell| known(*cell) == Known::Free).map(|cell| cell as u32).collect();
        let taken = |cell| if known(cell) == Known::Taken { 0.0 } else { f64::INFINITY };
        let mut squares: Vec<f64> = cells.map(taken).collect();
        if free.is_empty() || !squares.contains(&0.0) {
            return None;
        }
        nearest(&mut squares, lattice.columns() as usize);
        let random = parameters.random.clamp(1e-6, 1.0 - 1e-6);
        let spread = 2.0 * parameters.deviation * parameters.deviation / (lattice.side() * lattice.side());
        let log = |square: &f64| libm::log((1.0 - random) * libm::exp(-square / spread) + random) as f32;
        let logs = squares.iter().map(log).collect();
        Some(LikelihoodField { lattice, logs, outside: libm::log(random) as f32, free })
    }

    /// ln p of a beam that ends at a place.
    pub fn log(&self, end: Point) -> f64 {
        f64::from(self.lattice.cell(end).map_or(self.outside, |cell| self.logs[cell]))
    }

    /// How many cells are free.
    pub const fn free(&self) -> usize {
        self.free.len()
    }

    /// The middle of one of the free cells, by its number among them.
    pub fn free_place(&self, number: usize) -> Point {
        self.lattice.middle(self.free[number % self.free.len()] as usize)
    }

    /// Whether a robot can be at a place.
    pub fn is_free(&self, place: Point) -> bool {
        self.lattice.cell(place).is_some_and(|cell| self.free.binary_search(&(cell as u32)).is_ok())
    }

    /// The side of a cell (m).
    pub const fn side(&self) -> f64 {
        self.lattice.side()
    }
}

/// Turns noughts among infinities into the squares of the distances to the nearest nought (sides of a cell).
fn nearest(squares: &mut [f64], columns: usize) {
    let rows = squares.len() / columns;
    let mut envelope = Envelope::new(columns.max(rows));
    for column in 0..columns {
        envelope.pass(squares, column, columns, rows);
    }
    for row in 0..rows {
        envelope.pass(squares, row * columns, 1, columns);
    }
}

/// The lower envelope of parabolas, one for each cell of a line.
struct Envelope {
    line: Vec<f64>,
    vertices: Vec<usize>,
    /// From where on each parabola is the lowest.
    from: Vec<f64>,
}

impl Envelope {
    fn new(longest: usize) -> Envelope {
        Envelope { line: vec![0.0; longest], vertices: vec![0; longest], from: vec![0.0; longest] }
    }

    fn pass(&mut self, squares: &mut [f64], first: usize, step: usize, count: usize) {
        for i in 0..count {
            self.line[i] = squares[first + i * step];
        }
        let mut parabolas = 0;
        for i in (0..count).filter(|i| squares[first + i * step].is_finite()) {
            let height = |i: usize| self.line[i] + (i * i) as f64;
            let meets = |other: usize| (height(i) - height(other)) / (2.0 * (i as f64 - other as f64));
            while parabolas > 0 && meets(self.vertices[parabolas - 1]) <= self.from[parabolas - 1] {
                parabolas -= 1;
            }
            self.from[parabolas] =
                if parabolas == 0 { f64::NEG_INFINITY } else { meets(self.vertices[parabolas - 1]) };
            self.vertices[parabolas] = i;
            parabolas += 1;
        }
        if parabolas == 0 {
            return;
        }
        let mut lowest = 0;
        for i in 0..count {
            while lowest + 1 < parabolas && self.from[lowest + 1] < i as f64 {
                lowest += 1;
            }
            let vertex = self.vertices[lowest];
            let apart = i.abs_diff(vertex) as f64;
            squares[first + i * step] = self.line[vertex] + apart * apart;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn distances_are_those_to_the_nearest_of_all(taken in prop::collection::vec(prop::bool::weighted(0.05), 1..200), columns in 1usize..15) {
            let rows = taken.len().div_ceil(columns);
            let is_taken = |cell: usize| taken.get(cell).copied().unwrap_or(false);
            let mut squares: Vec<f64> = (0..rows * columns).map(|cell| if is_taken(cell) { 0.0 } else { f64::INFINITY }).collect();
            nearest(&mut squares, columns);
            for cell in 0..rows * columns {
                let far = |other: usize| {
                    let (dx, dy) = ((cell % columns).abs_diff(other % columns), (cell / columns).abs_diff(other / columns));
                    (dx * dx + dy * dy) as f64
                };
                let least = (0..rows * columns).filter(|other| is_taken(*other)).map(far).fold(f64::INFINITY, f64::min);
                prop_assert_eq!(squares[cell], least);
            }
        }
    }

    #[test]
    fn likelihood_falls_with_the_distance_and_never_to_nothing() {
        let lattice = Lattice::new(Point::default(), 0.1, 30, 10);
        let known = |cell: usize| if cell % 30 == 20 { Known::Taken } else { Known::Free };
        let field = LikelihoodField::new(FieldParameters::default(), lattice, known).unwrap();
        assert!(field.log(Point::new(2.05, 0.5)).abs() < 1e-6);
        let sigma = field.log(Point::new(2.15, 0.5));
        assert!((sigma - libm::log(0.9 * libm::exp(-0.5) + 0.1)).abs() < 1e-6);
        assert!((field.log(Point::new(0.5, 0.5)) - libm::log(0.1)).abs() < 1e-6);
        assert!((field.log(Point::new(-5.0, 0.5)) - libm::log(0.1)).abs() < 1e-6);
        assert!(
            field.is_free(Point::new(0.5, 0.5))
                && !field.is_free(Point::new(2.05, 0.5))
                && !field.is_free(Point::new(9.0, 0.5))
        );
        assert!(LikelihoodField::new(FieldParameters::default(), lattice, |_| Known::Free).is_none());
        assert!(LikelihoodField::new(FieldParameters::default(), lattice, |_| Known::Taken).is_none());
    }
}

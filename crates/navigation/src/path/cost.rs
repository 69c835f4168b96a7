//! What a way over a grid costs, in whole numbers: sums of it do not depend on their order, so ways of equal length have equal costs.

use super::grid::Cell;

/// A cost, in parts of a side of a cell: 2²⁴ to one. √2 is right to 2.5 · 10⁻⁸, so a way of a thousand cells is to 2.5 · 10⁻⁵: two ways of
/// different length that are compared wrongly differ by less. The longest way over the largest grid, every second cell of it, takes 48 bits.
pub(super) type Cost = u64;

/// One step straight.
pub(super) const STRAIGHT: Cost = 1 << BITS;
/// So many bits has a side of a cell.
pub(super) const BITS: u32 = 24;
/// One step aslant: √2 · 2²⁴ is 23 726 566.41.
pub(super) const ASLANT: Cost = 23_726_566;
/// Where no way is known; costs are added to it without running over.
pub(super) const NEVER: Cost = 1 << 62;

/// What the shortest way over free floor costs: aslant as far as it goes, then straight.
#[inline]
pub(super) fn octile(from: (u32, u32), to: (u32, u32)) -> Cost {
    let (dx, dy) = (from.0.abs_diff(to.0), from.1.abs_diff(to.1));
    STRAIGHT * Cost::from(dx.max(dy)) + (ASLANT - STRAIGHT) * Cost::from(dx.min(dy))
}

/// The length of so many steps straight and aslant (sides of a cell). It is reckoned from whole numbers, so ways of equal length have equal
/// lengths.
pub(super) fn length(straight: u32, aslant: u32) -> f64 {
    f64::from(straight) + f64::from(aslant) * core::f64::consts::SQRT_2
}

/// A cost as a length (sides of a cell).
pub(super) fn sides(cost: Cost) -> f64 {
    cost as f64 / STRAIGHT as f64
}

impl Cell {
    /// The length of the shortest octile way to another over free floor (sides of a cell): aslant as far as it goes, then straight.
    pub fn octile(self, other: Cell) -> f64 {
        let (dx, dy) = (self.x.abs_diff(other.x), self.y.abs_diff(other.y));
        length(dx.max(dy) - dx.min(dy), dx.min(dy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_lengths_but_for_a_part_in_forty_million() {
        assert!((sides(ASLANT) - core::f64::consts::SQRT_2).abs() < 2.5e-8);
        let (a, b) = (Cell::new(7, 900), Cell::new(4000, 3));
        assert!((sides(octile((a.x, a.y), (b.x, b.y))) - a.octile(b)).abs() < 2.5e-5);
        assert_eq!(a.octile(b), 3096.0 + 897.0 * core::f64::consts::SQRT_2);
        // Every second cell of the largest grid aslant.
        assert!(ASLANT * 4096 * 4096 / 2 < 1 << 48 && NEVER.checked_add(NEVER).is_some());
    }
}

//! A bit for each cell of a square grid on a torus, and what morphology needs of it, a word of 64 cells at a time.

use libm::floor;

/// Cells on a side: with cells of 10 cm that is a floor of 25.6 m, with several rooms.
pub(crate) const SIDE: usize = 256;
const WORDS: usize = SIDE / 64;

/// A row of bits, on a ring.
type Row = [u64; WORDS];

/// A bit for each cell; a cell is its row times [`SIDE`] plus its column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Layer(Box<[Row; SIDE]>);

impl Default for Layer {
    fn default() -> Layer {
        Layer(Box::new([[0; WORDS]; SIDE]))
    }
}

impl Layer {
    pub(crate) fn get(&self, cell: usize) -> bool {
        let (row, column) = (cell / SIDE, cell % SIDE);
        self.0[row][column / 64] >> (column % 64) & 1 == 1
    }

    pub(crate) fn set(&mut self, cell: usize, to: bool) {
        let (row, column) = (cell / SIDE, cell % SIDE);
        let word = &mut self.0[row][column / 64];
        *word = *word & !(1 << (column % 64)) | u64::from(to) << (column % 64);
    }

    /// 64 cells in a row, from `cell` on around the torus; a bit for each, the lowest first.
    pub(crate) fn row_from(&self, cell: usize) -> u64 {
        let (row, column) = (&self.0[cell / SIDE], cell % SIDE);
        let (word, shift) = (column / 64, column % 64);
        // Of a shift by 64 nothing is left.
        row[word] >> shift | row[(word + 1) % WORDS] << 1 << (63 - shift)
    }

    /// Sets 64 cells in a row, from `cell` on around the torus, to what `to` says where `which` is set; a bit for each, the lowest first.
    pub(crate) fn set_row(&mut self, cell: usize, which: u64, to: u64) {
        let (row, column) = (cell / SIDE, cell % SIDE);
        let (word, shift) = (column / 64, column % 64);
        let row = &mut self.0[row];
        row[word] = row[word] & !(which << shift) | (to & which) << shift;
        // What does not fit into the word lies in the next; of a shift by 64 nothing is left.
        let (which, to) = (which >> 1 >> (63 - shift), (to & which) >> 1 >> (63 - shift));
        let next = &mut row[(word + 1) % WORDS];
        *next = *next & !which | to;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.iter().all(|row| row.iter().all(|word| *word == 0))
    }

    pub(crate) fn clear(&mut self) {
        self.0.fill([0; WORDS]);
    }

    pub(crate) fn clear_row(&mut self, row: usize) {
        self.0[row] = [0; WORDS];
    }

    pub(crate) fn clear_column(&mut self, column: usize) {
        for row in self.0.iter_mut() {
            row[column / 64] &= !(1 << (column % 64));
        }
    }

    /// How many cells of the square of `2 reach + 1` cells around one are in it.
    pub(crate) fn count(&self, cell: usize, reach: usize) -> u32 {
        let (row, column) = (cell / SIDE, cell % SIDE);
        let mask = (1u64 << (2 * reach + 1)) - 1;
        let first = (column + SIDE - reach) % SIDE;
        (row + SIDE - reach..=row + SIDE + reach)
            .map(|y| (self.row_from(y % SIDE * SIDE + first) & mask).count_ones())
            .sum()
    }

    /// Into `self` what is in one or the other.
    pub(crate) fn unite(&mut self, one: &Layer, other: &Layer) {
        for ((out, one), other) in self.0.iter_mut().zip(one.0.iter()).zip(other.0.iter()) {
            *out = either(*one, *other);
        }
    }

    /// Into `self` what is in `one` and not in `other`.
    pub(crate) fn difference(&mut self, one: &Layer, other: &Layer) {
        for ((out, one), other) in self.0.iter_mut().zip(one.0.iter()).zip(other.0.iter()) {
            *out = std::array::from_fn(|i| one[i] & !other[i]);
        }
    }

    /// Into `self` what is not in `one`.
    pub(crate) fn invert(&mut self, one: &Layer) {
        for (out, one) in self.0.iter_mut().zip(one.0.iter()) {
            *out = one.map(|word| !word);
        }
    }

    /// Into `self` all cells within `radius` (cells) of one that is in `from`.
    pub(crate) fn dilate(&mut self, from: &Layer, radius: f64) {
        self.clear();
        let reach = floor(radius.max(0.0)) as usize;
        for (y, row) in from.0.iter().enumerate() {
            if row.iter().all(|word| *word == 0) {
                continue;
            }
            // From the top of the disc to its middle it grows wider.
            let (mut wide, mut width) = (*row, 0);
            for dy in (0..=reach).rev() {
                while ((width + 1) * (width + 1) + dy * dy) as f64 <= radius * radius {
                    width += 1;
                    wide = widened(wide);
                }
                for y in [y + dy, y + SIDE - dy] {
                    let out = &mut self.0[y % SIDE];
                    *out = either(*out, wide);
                }
            }
        }
    }
}

fn either(a: Row, b: Row) -> Row {
    std::array::from_fn(|i| a[i] | b[i])
}

/// A row and what is next to it.
fn widened(row: Row) -> Row {
    std::array::from_fn(|i| {
        // The lowest bit of a word comes from the one before it, the highest from the one after it.
        let up = row[i] << 1 | row[(i + WORDS - 1) % WORDS] >> 63;
        let down = row[i] >> 1 | row[(i + 1) % WORDS] << 63;
        row[i] | up | down
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn layer(cells: &[usize]) -> Layer {
        let mut layer = Layer::default();
        for cell in cells {
            layer.set(*cell, true);
        }
        layer
    }

    /// How far two cells are apart on the torus, in columns and rows.
    fn apart(a: usize, b: usize) -> (usize, usize) {
        let ring = |a: usize, b: usize| a.abs_diff(b).min(SIDE - a.abs_diff(b));
        (ring(a % SIDE, b % SIDE), ring(a / SIDE, b / SIDE))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn a_dilated_layer_has_the_cells_within_the_radius_and_no_others(
            cells in proptest::collection::vec(0..SIDE * SIDE, 0..12), radius in 0.0..5.0f64,
        ) {
            let mut wide = Layer::default();
            wide.dilate(&layer(&cells), radius);
            for cell in 0..SIDE * SIDE {
                let near = cells.iter().any(|c| {
                    let (dx, dy) = apart(*c, cell);
                    (dx * dx + dy * dy) as f64 <= radius * radius
                });
                prop_assert_eq!(wide.get(cell), near, "cell {}", cell);
            }
        }
    }

    #[test]
    fn a_row_from_any_cell_on_is_what_was_set_there_and_nothing_else() {
        let bits = 0x8000_0000_dead_0001;
        for column in [0, 1, 63, 64, 100, 192, 193, 255] {
            let mut some = Layer::default();
            some.set_row(5 * SIDE + column, u64::MAX, bits);
            assert_eq!(some.row_from(5 * SIDE + column), bits, "{column}");
            let set = (0..SIDE * SIDE).filter(|c| some.get(*c)).count();
            assert_eq!(set as u32, bits.count_ones(), "{column}");
            assert!(some.get(5 * SIDE + column) && some.get(5 * SIDE + (column + 63) % SIDE));
            some.set_row(5 * SIDE + column, 1, 0);
            assert_eq!(some.row_from(5 * SIDE + column), bits - 1, "{column}");
        }
    }

    #[test]
    fn rows_and_columns_are_cleared_and_differences_taken() {
        let full = layer(&(0..SIDE * SIDE).collect::<Vec<_>>());
        let mut some = full.clone();
        some.clear_row(3);
        some.clear_column(70);
        let left = (0..SIDE * SIDE).filter(|c| some.get(*c)).count();
        assert_eq!(left, (SIDE - 1) * (SIDE - 1));
        // The square around a corner of the torus lies in all four of its corners.
        assert_eq!((full.count(0, 2), some.count(0, 2), some.count(3 * SIDE + 70, 1)), (25, 25, 4));
        assert_eq!(some.count(2 * SIDE + 69, 2), 16);
        let mut off = Layer::default();
        off.difference(&full, &some);
        assert_eq!((0..SIDE * SIDE).filter(|c| off.get(*c)).count(), 2 * SIDE - 1);
        assert!(off.get(3 * SIDE) && off.get(70) && !off.get(71));
        let mut inverse = Layer::default();
        inverse.invert(&some);
        assert_eq!(inverse, off);
    }
}

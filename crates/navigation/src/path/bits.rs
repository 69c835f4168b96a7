//! Rows of bits, a word of 64 columns at a time.

use super::grid::Cell;

/// The eight ways to a neighbour, as columns and rows, the straight ones first: east, south, west, north, and those aslant that follow them clockwise
/// (rows counted downwards).
pub(super) const AROUND: [(i32, i32); 8] =
    [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];

/// The way that leads back.
pub(super) const fn opposite(way: usize) -> usize {
    // The straight ones are four in a circle, and so are those aslant.
    way / 4 * 4 + (way + 2) % 4
}

/// A bit for each column of each row; row after row, each begins a word.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Bits {
    width: u32,
    height: u32,
    stride: usize,
    words: Box<[u64]>,
}

impl Bits {
    /// All zero.
    pub(super) fn new(width: u32, height: u32) -> Bits {
        let stride = width.div_ceil(64) as usize;
        Bits { width, height, stride, words: vec![0; stride * height as usize].into_boxed_slice() }
    }

    /// Words in a row.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    pub(super) fn fill(&mut self, word: u64) {
        self.words.fill(word);
    }

    /// Becomes another of the same size.
    pub(super) fn copy_from(&mut self, other: &Bits) {
        self.words.copy_from_slice(&other.words);
    }

    #[inline]
    pub(super) fn row(&self, y: u32) -> &[u64] {
        let first = y as usize * self.stride;
        &self.words[first..first + self.stride]
    }

    /// A row between those above and below it.
    #[inline]
    pub(super) fn three(&self, y: u32) -> &[u64] {
        let first = (y as usize - 1) * self.stride;
        &self.words[first..first + 3 * self.stride]
    }

    pub(super) fn row_mut(&mut self, y: u32) -> &mut [u64] {
        let first = y as usize * self.stride;
        &mut self.words[first..first + self.stride]
    }

    #[inline]
    pub(super) fn get(&self, x: u32, y: u32) -> bool {
        self.words[y as usize * self.stride + (x / 64) as usize] >> (x % 64) & 1 == 1
    }

    pub(super) fn set(&mut self, x: u32, y: u32, to: bool) {
        let word = &mut self.words[y as usize * self.stride + (x / 64) as usize];
        *word = *word & !(1 << (x % 64)) | u64::from(to) << (x % 64);
    }

    /// Which of the neighbours in [`AROUND`] can be stepped to, where a set bit is a closed cell: aslant only where both corners beside the step are
    /// open. A bit for each, the lowest first. The cell is none of the rim.
    #[inline]
    pub(super) fn open_around(&self, x: u32, y: u32) -> u8 {
        OPEN[self.around(x, y)]
    }

    /// Which of them are worth to be stepped to after a step this way, [`NO_WAY`] after none: those that are not reached as soon without this cell, by a way
    /// that goes aslant earlier.
    #[inline]
    pub(super) fn worth_around(&self, x: u32, y: u32, way: usize) -> u8 {
        WORTH[way][self.around(x, y)]
    }

    /// The closed cells of the nine around one, from the left and the top, the lowest bit first.
    #[inline]
    fn around(&self, x: u32, y: u32) -> usize {
        let (first, shift) = (((x - 1) / 64) as usize, (x - 1) % 64);
        let last = ((x + 1) / 64) as usize;
        let three = |y: u32| {
            let row = y as usize * self.stride;
            // Of a shift by 64 nothing is left; where both are the same word, what is shifted in lies above the three.
            (self.words[row + first] >> shift | self.words[row + last] << 1 << (63 - shift)) as usize & 7
        };
        three(y - 1) | three(y) << 3 | three(y + 1) << 6
    }

    /// Becomes the other with columns for rows. Its width is the height of the other.
    pub(super) fn transpose(&mut self, other: &Bits) {
        for y in 0..self.stride {
            for x in 0..other.stride {
                let mut block = [0u64; 64];
                let rows = 64.min(other.height as usize - 64 * y);
                for (i, word) in block[..rows].iter_mut().enumerate() {
                    *word = other.words[(64 * y + i) * other.stride + x];
                }
                turn(&mut block);
                let columns = 64.min(other.width as usize - 64 * x);
                for (i, word) in block[..columns].iter().enumerate() {
                    self.words[(64 * x + i) * self.stride + y] = *word;
                }
            }
        }
    }

    /// Where it differs from another of the same size; becomes like the other word by word.
    pub(super) fn follow(&mut self, other: &Bits, mut differs: impl FnMut(Cell)) {
        for (i, (mine, theirs)) in self.words.iter_mut().zip(&other.words).enumerate() {
            let mut changed = *mine ^ *theirs;
            *mine = *theirs;
            while changed != 0 {
                let x = (i % self.stride * 64) as u32 + changed.trailing_zeros();
                differs(Cell::new(x, (i / self.stride) as u32));
                changed &= changed - 1;
            }
        }
    }
}

/// Whether no bit is set.
pub(super) fn is_empty(row: &[u64]) -> bool {
    row.iter().all(|word| *word == 0)
}

/// Adds what is set in another row.
pub(super) fn unite(row: &mut [u64], other: &[u64]) {
    row.iter_mut().zip(other).for_each(|(word, other)| *word |= other);
}

/// Sets all bits from a column on.
pub(super) fn fill_from(row: &mut [u64], column: u32) {
    let first = (column / 64) as usize;
    row[first] |= u64::MAX << (column % 64);
    row[first + 1..].fill(u64::MAX);
}

/// Sets what is up to so many columns beside a bit that is set. What is shifted beyond the ends is lost.
pub(super) fn widen(row: &mut [u64], by: u32) {
    for _ in 0..by {
        let mut before = 0;
        for i in 0..row.len() {
            let word = row[i];
            let after = row.get(i + 1).copied().unwrap_or(0);
            row[i] = word | word << 1 | before >> 63 | word >> 1 | after << 63;
            before = word;
        }
    }
}

/// Turns a square of 64 rows of 64 bits about its diagonal, halves of halves at a time (Warren, "Hacker's Delight", 7-3).
fn turn(block: &mut [u64; 64]) {
    let (mut half, mut mask) = (32usize, 0x0000_0000_ffff_ffffu64);
    while half > 0 {
        for i in (0..64).filter(|i| i & half == 0) {
            let swap = (block[i] >> half ^ block[i + half]) & mask;
            block[i] ^= swap << half;
            block[i + half] ^= swap;
        }
        half /= 2;
        mask ^= mask << half;
    }
}

/// No step came before.
pub(super) const NO_WAY: usize = 8;

/// For each pattern of closed cells in the square of nine, which neighbours can be stepped to.
const OPEN: [u8; 512] = {
    let mut steps = [0; 512];
    let mut closed = 0;
    while closed < 512 {
        let mut way = 0;
        while way < 8 {
            let (dx, dy) = AROUND[way];
            if open(closed, dx, dy) && open(closed, dx, 0) && open(closed, 0, dy) {
                steps[closed] |= 1 << way;
            }
            way += 1;
        }
        closed += 1;
    }
    steps
};

/// For each way of the step before, [`NO_WAY`] the last, and each pattern, which neighbours are worth a step.
static WORTH: [[u8; 512]; 9] = {
    let mut worth = [[0; 512]; 9];
    let mut before = 0;
    while before < 9 {
        let mut closed = 0;
        while closed < 512 {
            let mut way = 0;
            while way < 8 {
                if OPEN[closed] >> way & 1 == 1
                    && (before == NO_WAY || is_worth(closed, AROUND[before], AROUND[way]))
                {
                    worth[before][closed] |= 1 << way;
                }
                way += 1;
            }
            closed += 1;
        }
        before += 1;
    }
    worth
};

/// Whether a step is worth it after another. After one aslant: what leads on, straight or aslant. After a straight one: ahead, and to a side where what is
/// beside the cell before is closed; elsewhere the side is reached aslant from there (Harabor and Grastien 2011, without the corners).
const fn is_worth(closed: usize, before: (i32, i32), step: (i32, i32)) -> bool {
    let is_ahead = step.0 * before.0 + step.1 * before.1 > 0;
    if before.0 != 0 && before.1 != 0 {
        return is_ahead && (step.0 == 0 || step.0 == before.0) && (step.1 == 0 || step.1 == before.1);
    }
    // What of the step goes to a side.
    let side = (step.0 - step.0 * before.0 * before.0, step.1 - step.1 * before.1 * before.1);
    let is_straight_on = step.0 == before.0 && step.1 == before.1;
    let is_back = step.0 * before.0 + step.1 * before.1 < 0;
    is_straight_on || !is_back && !open(closed, side.0 - before.0, side.1 - before.1)
}

/// Whether a cell of the nine is open, by its way from the middle. The middle itself is passed over.
const fn open(closed: usize, dx: i32, dy: i32) -> bool {
    dx == 0 && dy == 0 || closed >> (3 * (dy + 1) + dx + 1) & 1 == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_way_has_one_that_leads_back() {
        for (way, (dx, dy)) in AROUND.into_iter().enumerate() {
            assert_eq!(AROUND[opposite(way)], (-dx, -dy));
        }
    }

    #[test]
    fn no_corner_is_cut() {
        // Three rows of three; closed are those marked.
        let around = |rows: [&str; 3]| {
            let mut bits = Bits::new(5, 5);
            for (y, row) in rows.iter().enumerate() {
                row.bytes()
                    .enumerate()
                    .for_each(|(x, byte)| bits.set(x as u32 + 1, y as u32 + 1, byte == b'#'));
            }
            let open = bits.open_around(2, 2);
            (0..8).filter(|way| open >> way & 1 == 1).map(|way| AROUND[way]).collect::<Vec<_>>()
        };
        assert_eq!(around(["...", "...", "..."]).len(), 8);
        assert_eq!(around([".#.", "...", "..."]), [(1, 0), (0, 1), (-1, 0), (1, 1), (-1, 1)]);
        assert_eq!(around(["#..", "...", "..."]).len(), 7);
        assert_eq!(around(["...", "#.#", ".#."]), [(0, -1)]);
    }

    #[test]
    fn a_step_is_worth_it_where_no_earlier_one_aslant_leads_as_soon() {
        let around = |rows: [&str; 3], before: (i32, i32)| {
            let mut bits = Bits::new(5, 5);
            for (y, row) in rows.iter().enumerate() {
                row.bytes()
                    .enumerate()
                    .for_each(|(x, byte)| bits.set(x as u32 + 1, y as u32 + 1, byte == b'#'));
            }
            let way = AROUND.iter().position(|way| *way == before).unwrap_or(NO_WAY);
            let worth = bits.worth_around(2, 2, way);
            (0..8).filter(|way| worth >> way & 1 == 1).map(|way| AROUND[way]).collect::<Vec<_>>()
        };
        assert_eq!(around(["...", "...", "..."], (0, 0)).len(), 8);
        assert_eq!(around(["...", "...", "..."], (1, 0)), [(1, 0)]);
        assert_eq!(around(["#..", "...", "..."], (1, 0)), [(1, 0), (0, -1), (1, -1)]);
        assert_eq!(around(["#..", "..#", "..."], (1, 0)), [(0, -1)]);
        assert_eq!(around(["#.#", "...", "..."], (0, 1)), [(1, 0), (0, 1), (-1, 0), (1, 1), (-1, 1)]);
        assert_eq!(around(["...", "...", "..."], (1, -1)), [(1, 0), (0, -1), (1, -1)]);
        assert_eq!(around(["..#", "...", "#.."], (-1, 1)), [(0, 1), (-1, 0)]);
    }

    proptest! {
        #[test]
        fn what_is_turned_has_columns_for_rows(
            width in 1u32..200, height in 1u32..200, set in proptest::collection::vec((0u32..200, 0u32..200), 0..60),
        ) {
            let (mut bits, mut turned) = (Bits::new(width, height), Bits::new(height, width));
            set.iter().filter(|(x, y)| *x < width && *y < height).for_each(|(x, y)| bits.set(*x, *y, true));
            turned.transpose(&bits);
            for y in 0..height {
                for x in 0..width {
                    prop_assert_eq!(bits.get(x, y), turned.get(y, x), "{} {}", x, y);
                }
            }
        }

        #[test]
        fn neighbours_are_found_across_words(x in 1u32..190, set in proptest::collection::vec((0u32..192, 0u32..3), 0..200)) {
            let mut bits = Bits::new(192, 3);
            set.iter().for_each(|(x, y)| bits.set(*x, *y, true));
            let open = |dx: i32, dy: i32| dx == 0 && dy == 0 || !bits.get(x.wrapping_add_signed(dx), 1u32.wrapping_add_signed(dy));
            for (way, (dx, dy)) in AROUND.into_iter().enumerate() {
                let expect = open(dx, dy) && open(dx, 0) && open(0, dy);
                prop_assert_eq!(bits.open_around(x, 1) >> way & 1 == 1, expect);
            }
        }

        #[test]
        fn who_follows_another_is_told_each_cell_that_differs(
            one in proptest::collection::vec((0u32..100, 0u32..5), 0..40),
            other in proptest::collection::vec((0u32..100, 0u32..5), 0..40),
        ) {
            let of = |cells: &[(u32, u32)]| {
                let mut bits = Bits::new(100, 5);
                cells.iter().for_each(|(x, y)| bits.set(*x, *y, true));
                bits
            };
            let (mut follower, before, leader) = (of(&one), of(&one), of(&other));
            let mut told = Vec::new();
            follower.follow(&leader, |cell| told.push(cell));
            prop_assert_eq!(&follower, &leader);
            let all = (0..5).flat_map(|y| (0..100).map(move |x| Cell::new(x, y)));
            let expect: Vec<Cell> = all.filter(|c| before.get(c.x, c.y) != leader.get(c.x, c.y)).collect();
            prop_assert_eq!(told, expect);
        }
    }
}

//! The memory of a local map: cells on a torus, and a bit for each, so that many are looked at together.

use types::Point;

/// Cells on a side of the map.
pub(super) const SIDE: i32 = 128;
const CELLS: usize = (SIDE * SIDE) as usize;
/// Evidence is kept within these: a thing that comes where it was free, or goes, is believed after two or three readings.
pub(super) const EVIDENCE: (i8, i8) = (-2, 6);
/// From this evidence on a cell explains an echo: it was heard from nearby, or often.
pub(super) const SURE: i8 = 3;

/// The bits of a row: as many as a map has cells on a side.
pub(super) type Row = u128;
const _: () = assert!(Row::BITS == SIDE as u32);

/// A bit for each cell, a word for each row of the memory.
type Plane = Box<[Row; SIDE as usize]>;

/// Which of the many places that share the memory of a cell it speaks of: the map is a torus. The low byte counts across, the high one
/// along.
type Tile = u16;

/// What is known of each cell. Few cells are of interest at a time, and looking for them in words spares looking at all the others.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    evidence: Box<[i8; CELLS]>,
    tiles: Box<[Tile; CELLS]>,
    /// When each was heard last, in ticks.
    heard: Box<[i32; CELLS]>,
    /// Where the evidence is not zero.
    known: Plane,
    /// Where it is above zero.
    occupied: Plane,
    /// Where it is enough to explain an echo.
    sure: Plane,
    /// Where it is the least there is.
    free: Plane,
    /// Where the cell speaks of its place in the window: of those within half a map's width of the robot.
    here: Plane,
    /// The lowest cell of the window.
    low: (i32, i32),
}

fn plane() -> Plane {
    Box::new([0; SIDE as usize])
}

impl Cells {
    pub(super) fn new() -> Cells {
        let mut cells = Cells {
            evidence: Box::new([0; CELLS]),
            tiles: Box::new([0; CELLS]),
            heard: Box::new([0; CELLS]),
            known: plane(),
            occupied: plane(),
            sure: plane(),
            free: plane(),
            here: plane(),
            low: (0, 0),
        };
        cells.look_all();
        cells
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.evidence.fill(0);
        self.tiles.fill(0);
        for plane in [&mut self.known, &mut self.occupied, &mut self.sure, &mut self.free] {
            plane.fill(0);
        }
        self.look_all();
    }

    /// Moves the window with the robot, which is in this cell.
    pub(super) fn follow(&mut self, (x, y): (i32, i32)) {
        /// So far out (cells) nobody drives, and numbers do not overflow.
        const FAR: i32 = 1 << 30;
        let around = |i: i32| i.clamp(-FAR, FAR) - SIDE / 2;
        let before = core::mem::replace(&mut self.low, (around(x), around(y)));
        let low = self.low;
        // What comes in on one side lies in the memory of what goes out on the other.
        let entering = |now: i32, before: i32| {
            if now > before { now.max(before + SIDE)..now + SIDE } else { now..before.min(now + SIDE) }
        };
        entering(low.0, before.0).for_each(|ix| self.look_along_column(ix));
        entering(low.1, before.1).for_each(|iy| self.look_along_row(iy));
    }

    fn look_all(&mut self) {
        (self.low.1..self.low.1 + SIDE).for_each(|iy| self.look_along_row(iy));
    }

    /// Sees which cells of a column of the window are spoken of by their memory.
    fn look_along_column(&mut self, ix: i32) {
        let bit = 1 << folded(ix);
        for iy in self.low.1..self.low.1 + SIDE {
            let is_here = self.tiles[slot(ix, iy)] == tile(ix, iy);
            mark(&mut self.here[folded(iy)], bit, is_here);
        }
    }

    /// Sees which cells of a row of the window are spoken of by their memory.
    fn look_along_row(&mut self, iy: i32) {
        let columns = self.low.0..self.low.0 + SIDE;
        let here = columns.filter(|&ix| self.tiles[slot(ix, iy)] == tile(ix, iy));
        self.here[folded(iy)] = here.fold(0, |row, ix| row | 1 << folded(ix));
    }

    /// The place in the memory of a cell, emptied first if it still speaks of another one.
    #[inline]
    pub(super) fn slot_for(&mut self, ix: i32, iy: i32) -> usize {
        let at = slot(ix, iy);
        if self.tiles[at] != tile(ix, iy) {
            self.set(at, 0);
            self.tiles[at] = tile(ix, iy);
            self.heard[at] = 0;
            let within = |i: i32, low: i32| (low..low + SIDE).contains(&i);
            let (row, bit) = place(at);
            mark(&mut self.here[row], bit, within(ix, self.low.0) && within(iy, self.low.1));
        }
        at
    }

    /// The evidence at a place in the memory.
    #[inline]
    pub(super) fn get(&self, at: usize) -> i8 {
        self.evidence[at]
    }

    /// The evidence of a cell; none if its memory speaks of another one.
    #[inline]
    pub(super) fn evidence(&self, ix: i32, iy: i32) -> Option<i8> {
        let at = slot(ix, iy);
        (self.tiles[at] == tile(ix, iy)).then_some(self.evidence[at])
    }

    /// When a cell was heard last, in ticks.
    #[inline]
    pub(super) fn heard(&self, ix: i32, iy: i32) -> i32 {
        self.heard[slot(ix, iy)]
    }

    #[inline]
    pub(super) fn set_heard(&mut self, at: usize, tick: i32) {
        self.heard[at] = tick;
    }

    #[inline]
    pub(super) fn set(&mut self, at: usize, evidence: i8) {
        let was = core::mem::replace(&mut self.evidence[at], evidence);
        let (row, bit) = place(at);
        // The bits change far less often than the evidence.
        let turn = |plane: &mut Plane, test: fn(i8) -> bool| {
            if test(was) != test(evidence) {
                plane[row] ^= bit;
            }
        };
        turn(&mut self.known, |evidence| evidence != 0);
        turn(&mut self.occupied, |evidence| evidence > 0);
        turn(&mut self.sure, |evidence| evidence >= SURE);
        turn(&mut self.free, |evidence| evidence == EVIDENCE.0);
    }

    /// Whether a cell is known to be as free as can be.
    #[inline]
    pub(super) fn is_free(&self, ix: i32, iy: i32) -> bool {
        self.evidence(ix, iy) == Some(EVIDENCE.0)
    }

    /// The columns in row `iy`, of `count` (less than the side) from column `first` on, whose memory has evidence above zero.
    #[inline]
    pub(super) fn occupied_in(&self, iy: i32, first: i32, count: i32) -> Columns {
        Columns { left: halves(turned(self.occupied[folded(iy)], first) & lowest(count)), first }
    }

    /// The same for evidence that explains an echo.
    pub(super) fn sure_in(&self, iy: i32, first: i32, count: i32) -> Columns {
        Columns { left: halves(turned(self.sure[folded(iy)], first) & lowest(count)), first }
    }

    /// The 64 columns of row `iy` from column `first` on: a bit for each that is not known to be as free as can be. All of them are in
    /// the window.
    #[inline]
    pub(super) fn doubtful_from(&self, iy: i32, first: i32) -> u64 {
        let row = folded(iy);
        !turned(self.free[row] & self.here[row], first) as u64
    }

    /// Whether the window takes in a rectangle (both corners are in it); the corners are points in cells.
    pub(super) fn takes_in(&self, low: Point, high: Point) -> bool {
        let within = |from: f64, to: f64, low: i32| from >= f64::from(low) && to < f64::from(low + SIDE);
        within(low.x, high.x, self.low.0) && within(low.y, high.y, self.low.1)
    }

    /// What is known of `count` squares of two cells by two (no more than 64) from the one with the lowest cell (`first`, `iy`) on; both are
    /// even. What is outside the window is not known.
    pub(super) fn squares_in(&self, first: i32, iy: i32, count: i32) -> Squares {
        // What the memory says of the two rows, where it speaks of the window at all.
        let rows = [iy, iy + 1].map(|iy| {
            let window = self.window_in(iy, first);
            (folded(iy), turned(self.here[folded(iy)], first) & window)
        });
        let squares = |plane: &Plane| {
            let [low, high] = rows.map(|(row, here)| turned(plane[row], first) & here);
            even_bits(low | high | (low | high) >> 1)
        };
        let known = squares(&self.known) & lowest(count) as u64;
        let taken = known & squares(&self.sure);
        Squares { known, taken, free: known & !squares(&self.occupied) }
    }

    /// The columns of row `iy` that are in the window, from column `first` on.
    fn window_in(&self, iy: i32, first: i32) -> Row {
        let (x, y) = self.low;
        if !(y..y + SIDE).contains(&iy) {
            return 0;
        }
        lowest((x + SIDE).saturating_sub(first)) & !lowest(x.saturating_sub(first))
    }
}

/// Sets a bit of a row, or takes it out.
#[inline]
fn mark(row: &mut Row, bit: Row, is_set: bool) {
    *row = if is_set { *row | bit } else { *row & !bit };
}

/// A row, turned so that the bit of column `first` is the lowest.
#[inline]
fn turned(row: Row, first: i32) -> Row {
    row.rotate_right(folded(first) as u32)
}

/// So many of the lowest bits.
#[inline]
fn lowest(count: i32) -> Row {
    if count >= SIDE { Row::MAX } else { (1 << count.max(0)) - 1 }
}

/// The row of a place in the memory, and its bit there.
#[inline]
fn place(at: usize) -> (usize, Row) {
    (at / SIDE as usize, 1 << (at % SIDE as usize))
}

#[inline]
fn slot(ix: i32, iy: i32) -> usize {
    folded(iy) * SIDE as usize + folded(ix)
}

/// A row or a column of the torus. The side is a power of two: its bits are the remainder, of negative numbers too.
#[inline]
fn folded(i: i32) -> usize {
    (i & (SIDE - 1)) as usize
}

#[inline]
fn tile(ix: i32, iy: i32) -> Tile {
    // A shift rounds down, as is meant here; a division would round towards zero.
    const SHIFT: u32 = SIDE.trailing_zeros();
    const { assert!(1 << SHIFT == SIDE) };
    Tile::from_le_bytes([(ix >> SHIFT) as u8, (iy >> SHIFT) as u8])
}

/// The two halves of a row: what is done bit by bit is cheaper in words of the machine.
#[inline]
fn halves(row: Row) -> [u64; 2] {
    [row as u64, (row >> 64) as u64]
}

/// Takes the lowest bit out of a row; gives its half and its place there.
#[inline]
fn take_lowest(halves: &mut [u64; 2]) -> Option<(usize, u32)> {
    let half = usize::from(halves[0] == 0);
    let word = halves[half];
    if word == 0 {
        return None;
    }
    halves[half] = word & (word - 1);
    Some((half, word.trailing_zeros()))
}

/// The columns of the set bits of a row, from `first` on.
#[derive(Clone)]
pub(super) struct Columns {
    left: [u64; 2],
    first: i32,
}

impl Iterator for Columns {
    type Item = i32;

    #[inline]
    fn next(&mut self) -> Option<i32> {
        let (half, bit) = take_lowest(&mut self.left)?;
        Some(self.first + 64 * half as i32 + bit as i32)
    }
}

/// The even bits of a row, packed into a word.
#[inline]
fn even_bits(row: Row) -> u64 {
    /// Of `2 size` bits the lower half.
    const fn lower(size: u32) -> u64 {
        u64::MAX / ((1 << size) + 1)
    }
    // Pairs of bits are drawn together, then pairs of pairs, and so on.
    let packed = |half: u64| {
        let drawn = |bits: u64, size: u32| (bits | bits >> size) & lower(2 * size);
        drawn(drawn(drawn(drawn(drawn(half & lower(1), 1), 2), 4), 8), 16)
    };
    let [low, high] = halves(row).map(packed);
    low | high << 32
}

/// A row of squares of two cells by two, a bit for each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Squares {
    /// Of which something was ever known.
    pub known: u64,
    /// In which something surely stands.
    pub taken: u64,
    /// In which surely nothing stands.
    pub free: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_even_bits_of_a_row_are_packed_in_their_order() {
        assert_eq!(
            [even_bits(Row::MAX), even_bits(Row::MAX / 3 * 2), even_bits(1 << 126)],
            [u64::MAX, 0, 1 << 63]
        );
        for bit in 0..128 {
            assert_eq!(even_bits(1 << bit), if bit % 2 == 0 { 1 << (bit / 2) } else { 0 }, "{bit}");
        }
    }
}

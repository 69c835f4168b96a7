//! The memory of a local map: cells on a torus, and a bit for each, so that many are looked at together.

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
#[derive(Clone, Debug)]
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
        for plane in [&mut self.known, &mut self.occupied, &mut self.sure] {
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
        for ix in entering(low.0, before.0) {
            (low.1..low.1 + SIDE).for_each(|iy| self.look(ix, iy));
        }
        for iy in entering(low.1, before.1) {
            (low.0..low.0 + SIDE).for_each(|ix| self.look(ix, iy));
        }
    }

    fn look_all(&mut self) {
        let (x, y) = self.low;
        (y..y + SIDE).for_each(|iy| (x..x + SIDE).for_each(|ix| self.look(ix, iy)));
    }

    /// Sees whether the memory of a cell of the window speaks of it.
    fn look(&mut self, ix: i32, iy: i32) {
        let at = slot(ix, iy);
        self.mark(at, self.tiles[at] == tile(ix, iy));
    }

    /// Notes whether the memory of a cell speaks of its place in the window.
    fn mark(&mut self, at: usize, is_here: bool) {
        let (row, bit) = place(at);
        self.here[row] = if is_here { self.here[row] | bit } else { self.here[row] & !bit };
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
            self.mark(at, within(ix, self.low.0) && within(iy, self.low.1));
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
    }

    /// The columns in row `iy`, of `count` (less than the side) from column `first` on, whose memory has evidence above zero.
    pub(super) fn occupied_in(&self, iy: i32, first: i32, count: i32) -> Columns {
        Columns { left: halves(turned(&self.occupied, iy, first) & lowest(count)), first }
    }

    /// The same for evidence that explains an echo.
    pub(super) fn sure_in(&self, iy: i32, first: i32, count: i32) -> Columns {
        Columns { left: halves(turned(&self.sure, iy, first) & lowest(count)), first }
    }

    /// What is known of `count` squares of two cells by two (no more than 64) from the one with the lowest cell (`first`, `iy`) on; both are
    /// even. What is outside the window is not known.
    pub(super) fn squares_in(&self, first: i32, iy: i32, count: i32) -> Squares {
        let row = |plane: &Plane| {
            let row =
                |iy| turned(plane, iy, first) & turned(&self.here, iy, first) & self.window_in(iy, first);
            let both = row(iy) | row(iy + 1);
            even_bits(both | both >> 1)
        };
        let known = row(&self.known) & lowest(count) as u64;
        let taken = known & row(&self.sure);
        Squares { known, taken, free: known & !row(&self.occupied) }
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

/// The word of a row, turned so that the bit of column `first` is the lowest.
#[inline]
fn turned(plane: &Plane, iy: i32, first: i32) -> Row {
    plane[folded(iy)].rotate_right(folded(first) as u32)
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
    const fn lower(size: u32) -> Row {
        Row::MAX / ((1 << size) + 1)
    }
    // Pairs of bits are drawn together, then pairs of pairs, and so on.
    [1, 2, 4, 8, 16, 32].into_iter().fold(row & lower(1), |row, size| (row | row >> size) & lower(2 * size))
        as u64
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

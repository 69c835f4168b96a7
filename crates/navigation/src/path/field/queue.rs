//! The potential of each cell, and the cells that wait in buckets of about equal keys.
//!
//! A cell that falls while it waits is put into a lower bucket once more; that it was taken is noted at the cell, so the entry that is left behind is passed
//! over; where the cell waits for the next wave by then, it comes early, which is no harm. Where there is no place for more entries, all that wait are ordered anew, and those left behind are gone. Within a bucket the last comes first: it
//! is the one that was just found.

use super::super::cost::{BITS, Cost, NEVER};

/// How many buckets, and how wide each is: a side of a cell. In narrower ones no fewer cells are gone on from, in wider ones more.
const BUCKETS: usize = 2048;
const SHIFT: u32 = BITS;
/// The last bucket holds all that lies beyond; another those that wait for the next wave.
const BEYOND: usize = BUCKETS - 1;
const NEXT_WAVE: usize = BUCKETS;
const NONE: u32 = u32::MAX;

/// A potential has so many bits. Those above it tell the search in which it was noted, counted down: what is left of searches before is more than any potential
/// of this one, as it must be, and nothing has to be cleared.
const POTENTIAL: u32 = 48;
const SEARCHES: u64 = 1 << (64 - POTENTIAL);

/// What is noted of a cell: the neighbour below it in the lowest four bits, whether it waits, whether it is on the best way, and above them the wave in which
/// it has told its neighbours, from 1 on.
const BELOW: u8 = 0b1111;
const WAITS: u8 = 1 << 4;
const ON_WAY: u8 = 1 << 5;
const TOLD: u32 = 6;

/// A cell in a bucket.
#[derive(Clone, Copy, Debug)]
struct Entry {
    cell: u32,
    after: u32,
}

/// The cells with their potential, and their order.
#[derive(Clone, Debug)]
pub(super) struct Queue {
    potentials: Box<[u64]>,
    notes: Box<[u8]>,
    /// The search, counted down, above the bits of a potential.
    search: u64,
    entries: Box<[Entry]>,
    /// How many entries were ever used, how many stand in buckets, and the first of those that are free again.
    used: u32,
    standing: usize,
    free: u32,
    heads: Box<[u32]>,
    /// Where the first bucket begins, the lowest key in it, which can be lower still, and the first bucket that may not be empty.
    base: Cost,
    lowest: Cost,
    first: usize,
    /// No bucket of this wave above this one was ever used.
    last: usize,
}

impl Queue {
    /// For so many cells.
    pub(super) fn new(cells: usize) -> Queue {
        Queue {
            potentials: vec![u64::MAX; cells].into_boxed_slice(),
            notes: vec![0; cells].into_boxed_slice(),
            search: SEARCHES - 1,
            entries: vec![Entry { cell: 0, after: NONE }; 2 * cells].into_boxed_slice(),
            used: 0,
            standing: 0,
            free: NONE,
            heads: vec![NONE; BUCKETS + 1].into_boxed_slice(),
            base: 0,
            lowest: 0,
            first: 0,
            last: 0,
        }
    }

    /// Nothing is known any more.
    pub(super) fn forget(&mut self) {
        match self.search.checked_sub(1) {
            Some(search) => self.search = search,
            None => {
                // Once in 65 536 searches.
                self.potentials.fill(u64::MAX);
                self.search = SEARCHES - 2;
            }
        }
        self.heads[..=self.last].fill(NONE);
        self.heads[NEXT_WAVE] = NONE;
        (self.used, self.standing, self.free) = (0, 0, NONE);
        (self.base, self.lowest, self.first, self.last) = (0, 0, 0, 0);
    }

    /// What a way from a cell costs; [`NEVER`] where none is known.
    #[inline]
    pub(super) fn potential(&self, cell: u32) -> Cost {
        let potential = self.potentials[cell as usize];
        if potential >> POTENTIAL == self.search { potential & ((1 << POTENTIAL) - 1) } else { NEVER }
    }

    /// Whether a potential is lower than what is known.
    #[inline]
    pub(super) fn is_lower(&self, cell: u32, potential: Cost) -> bool {
        self.search << POTENTIAL | potential < self.potentials[cell as usize]
    }

    /// The neighbour to which it goes downhill from a cell that is known.
    #[inline]
    pub(super) fn down(&self, cell: u32) -> u8 {
        self.notes[cell as usize] & BELOW
    }

    /// Takes a lower potential; whether the cell is on the best way.
    #[inline]
    pub(super) fn fall(&mut self, cell: u32, potential: Cost, down: u8) -> bool {
        let note = &mut self.notes[cell as usize];
        let before =
            core::mem::replace(&mut self.potentials[cell as usize], self.search << POTENTIAL | potential);
        if before >> POTENTIAL != self.search {
            *note = 0;
        }
        *note = *note & !BELOW | down;
        *note & ON_WAY != 0
    }

    /// Whether a known cell has told its neighbours in a wave.
    #[inline]
    pub(super) fn has_told(&self, cell: u32, wave: usize) -> bool {
        usize::from(self.notes[cell as usize] >> TOLD) == wave + 1
    }

    /// Notes that a known cell has told its neighbours.
    #[inline]
    pub(super) fn tell(&mut self, cell: u32, wave: usize) {
        let note = &mut self.notes[cell as usize];
        *note = *note & !(u8::MAX << TOLD) | (wave as u8 + 1) << TOLD;
    }

    /// Notes whether a known cell is on the best way.
    pub(super) fn mark(&mut self, cell: u32, is_on_way: bool) {
        let note = &mut self.notes[cell as usize];
        *note = if is_on_way { *note | ON_WAY } else { *note & !ON_WAY };
    }

    /// Whether there is a place for so many more entries. Where there is none, all must be [ordered](Self::order).
    #[inline]
    pub(super) fn has_room(&self, entries: usize) -> bool {
        self.standing + entries <= self.entries.len()
    }

    /// Lets a known cell wait with this key.
    #[inline]
    pub(super) fn wait(&mut self, cell: u32, key: Cost) {
        let bucket = ((key.saturating_sub(self.base) >> SHIFT) as usize).min(BEYOND);
        self.lowest = self.lowest.min(key);
        self.first = self.first.min(bucket);
        self.last = self.last.max(bucket);
        self.enter(cell, bucket);
    }

    /// Lets a known cell wait for the next wave.
    pub(super) fn wait_long(&mut self, cell: u32) {
        self.enter(cell, NEXT_WAVE);
    }

    #[inline]
    fn enter(&mut self, cell: u32, bucket: usize) {
        let place = if self.free == NONE {
            self.used += 1;
            self.used - 1
        } else {
            self.free
        };
        // There is room, or all would have been ordered.
        let Some(entry) = self.entries.get_mut(place as usize) else { return };
        if place == self.free {
            self.free = entry.after;
        }
        *entry = Entry { cell, after: core::mem::replace(&mut self.heads[bucket], place) };
        self.standing += 1;
        self.notes[cell as usize] |= WAITS;
    }

    /// The lowest key that a cell of this wave can have; [`NEVER`] where none waits.
    #[inline]
    pub(super) fn least(&mut self) -> Cost {
        while self.first < BUCKETS && self.heads[self.first] == NONE {
            self.first += 1;
        }
        match self.first {
            0 => self.lowest,
            BUCKETS => NEVER,
            bucket => self.base + ((bucket as Cost) << SHIFT),
        }
    }

    /// Takes a cell of the lowest bucket.
    #[inline]
    pub(super) fn take(&mut self) -> Option<u32> {
        loop {
            if self.least() == NEVER {
                return None;
            }
            let place = self.heads[self.first];
            let entry = &mut self.entries[place as usize];
            self.heads[self.first] = core::mem::replace(&mut entry.after, self.free);
            self.free = place;
            self.standing -= 1;
            let note = &mut self.notes[entry.cell as usize];
            if *note & WAITS != 0 {
                *note &= !WAITS;
                return Some(entry.cell);
            }
        }
    }

    /// Whether of this wave only those wait whose keys are out of reach, without order; they are to be [ordered](Self::order).
    #[inline]
    pub(super) fn is_out_of_reach(&mut self) -> bool {
        self.least();
        self.first == BEYOND
    }

    /// Orders anew all that wait by their keys, those for the next wave among them if it begins. Who has no key waits no more.
    pub(super) fn order(&mut self, is_next_wave: bool, key: impl Fn(u32, Cost) -> Option<Cost>) {
        let (mut chain, mut later, mut base) = (NONE, NONE, NEVER);
        for bucket in (self.first..self.last + 1).chain([NEXT_WAVE]) {
            let mut place = core::mem::replace(&mut self.heads[bucket], NONE);
            while place != NONE {
                let Entry { cell, after } = self.entries[place as usize];
                // The first entry of a cell is as good as the others; its note is set anew when it enters.
                let waits = self.notes[cell as usize] & WAITS != 0;
                let list = if bucket == NEXT_WAVE && !is_next_wave { &mut later } else { &mut chain };
                let key = if waits { key(cell, self.potential(cell)) } else { None };
                self.notes[cell as usize] &= !WAITS;
                let list = match key {
                    Some(key) => {
                        base = base.min(key);
                        list
                    }
                    None => &mut self.free,
                };
                self.entries[place as usize].after = core::mem::replace(list, place);
                place = after;
            }
        }
        (self.base, self.lowest, self.first, self.standing) = (base, base, BUCKETS, 0);
        self.last = 0;
        for (mut place, is_later) in [(later, true), (chain, false)] {
            while place != NONE {
                let Entry { cell, after } = self.entries[place as usize];
                self.entries[place as usize].after = core::mem::replace(&mut self.free, place);
                place = after;
                if is_later {
                    self.wait_long(cell);
                } else if let Some(key) = key(cell, self.potential(cell)) {
                    self.wait(cell, key);
                }
            }
        }
    }

    /// All that wait, for this wave or the next; some of them more than once.
    pub(super) fn waiting(&self) -> impl Iterator<Item = (u32, Cost)> + '_ {
        let entry = |place: u32| (place != NONE).then(|| self.entries[place as usize]);
        let heads = self.heads.get(self.first..=self.last).unwrap_or_default();
        heads
            .iter()
            .chain([&self.heads[NEXT_WAVE]])
            .flat_map(move |head| core::iter::successors(entry(*head), move |at| entry(at.after)))
            .filter(|entry| self.notes[entry.cell as usize] & WAITS != 0)
            .map(|entry| (entry.cell, self.potential(entry.cell)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    const SIDE: Cost = 1 << BITS;

    proptest! {
        /// Against a plain map: what is taken is never more than a bucket away from the least.
        #[test]
        fn it_gives_about_the_least_and_loses_nobody(
            deeds in proptest::collection::vec((0u8..8, 0u32..30, 1u64..600), 0..300),
        ) {
            let mut queue = Queue::new(30);
            let (mut now, mut later) = (BTreeMap::new(), BTreeMap::new());
            queue.forget();
            for (deed, cell, sides) in deeds {
                // A cell only falls, and does not wait for two waves.
                let potential = (sides * SIDE).min(queue.potential(cell));
                if !queue.has_room(1) {
                    queue.order(false, |_, potential| Some(potential));
                }
                match deed {
                    0..4 if !later.contains_key(&cell) => {
                        queue.fall(cell, potential, 0);
                        queue.wait(cell, potential);
                        now.insert(cell, potential);
                    }
                    4 if !now.contains_key(&cell) => {
                        queue.fall(cell, potential, 0);
                        queue.wait_long(cell);
                        later.insert(cell, potential);
                    }
                    0..5 => {}
                    5 | 6 => {
                        if queue.is_out_of_reach() {
                            queue.order(false, |_, potential| Some(potential));
                        }
                        let least = now.values().copied().min();
                        prop_assert!(queue.least() <= least.unwrap_or(NEVER));
                        let taken = queue.take();
                        prop_assert!(taken.is_some() || least.is_none());
                        if let Some(cell) = taken {
                            // One that waits for the next wave can come early, over an entry that was left behind.
                            let potential = now.remove(&cell).or_else(|| later.remove(&cell)).unwrap();
                            let most = least.map(|least| least.max(queue.base) + (1 << SHIFT));
                            prop_assert!(most.is_none_or(|most| potential < most), "{} {:?}", potential, most);
                        }
                    }
                    _ => {
                        // Who is too far is let go.
                        queue.order(true, |_, potential| (potential < 400 * SIDE).then_some(potential));
                        now.append(&mut later);
                        now.retain(|_, potential| *potential < 400 * SIDE);
                    }
                }
                prop_assert!(queue.waiting().count() <= queue.standing);
                let waiting: BTreeMap<u32, Cost> = queue.waiting().collect();
                let all: BTreeMap<u32, Cost> = now.iter().chain(&later).map(|(c, p)| (*c, *p)).collect();
                prop_assert_eq!(waiting, all);
            }
        }
    }

    #[test]
    fn a_new_search_knows_nothing_even_after_65_536_others() {
        let mut queue = Queue::new(3);
        queue.search = 2;
        for _ in 0..4 {
            queue.forget();
            assert_eq!((queue.potential(1), queue.take()), (NEVER, None));
            assert!(queue.is_lower(1, 900 * SIDE));
            assert!(!queue.fall(1, SIDE, 4) && !queue.has_told(1, 0));
            assert!(!queue.is_lower(1, SIDE) && queue.is_lower(1, SIDE - 1));
            queue.mark(1, true);
            queue.tell(1, 0);
            queue.wait(1, SIDE);
            assert!(queue.fall(1, SIDE / 2, 5) && queue.has_told(1, 0) && !queue.has_told(1, 1));
            queue.wait(1, SIDE / 2);
            assert_eq!((queue.down(1), queue.take(), queue.take()), (5, Some(1), None));
        }
        assert_eq!(queue.search, SEARCHES - 3);
    }
}

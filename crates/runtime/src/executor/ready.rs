//! Which agents of an executor have something to do, in data-flow order.

/// A bit for each place in the data flow. Where a chain of agents runs, one is ready at a time: that one stands beside the bits.
#[derive(Debug)]
pub(super) struct ReadySet {
    words: Vec<u64>,
    /// How many bits are set.
    set: u32,
    /// The only one that is ready, while no bit is set: its place, and its slot. Or nobody.
    only: u32,
    only_slot: u32,
    /// Behind the place of the one that was taken last.
    cursor: u32,
    rank_of: Vec<u32>,
    /// The slots in data-flow order.
    order: Vec<u32>,
}

const NOBODY: u32 = u32::MAX;

impl Default for ReadySet {
    fn default() -> ReadySet {
        ReadySet {
            words: Vec::new(),
            set: 0,
            only: NOBODY,
            only_slot: NOBODY,
            cursor: 0,
            rank_of: Vec::new(),
            order: Vec::new(),
        }
    }
}

impl ReadySet {
    /// Says in which order the slots go, and in which place each stands. Who was ready stays so where he still has a place. There is
    /// room for all in `words`, which are zero. What was used before goes back, to be freed elsewhere.
    pub(super) fn set_order(&mut self, order: &mut Vec<u32>, ranks: &mut Vec<u32>, words: &mut Vec<u64>) {
        core::mem::swap(&mut self.order, order);
        core::mem::swap(&mut self.rank_of, ranks);
        core::mem::swap(&mut self.words, words);
        let only = core::mem::replace(&mut self.only, NOBODY);
        (self.set, self.cursor) = (0, 0);
        if only != NOBODY {
            self.mark(self.only_slot);
        }
        for (at, word) in words.iter_mut().enumerate() {
            let mut bits = core::mem::take(word);
            while bits != 0 {
                let rank = at * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if let Some(slot) = order.get(rank) {
                    self.mark(*slot);
                }
            }
        }
    }

    #[inline]
    pub(super) fn rank_of(&self, slot: u32) -> Option<u32> {
        self.rank_of.get(slot as usize).copied().filter(|rank| *rank != NOBODY)
    }

    #[inline]
    pub(super) fn mark(&mut self, slot: u32) {
        let Some(rank) = self.rank_of(slot) else { return };
        if self.is_empty() {
            (self.only, self.only_slot) = (rank, slot);
        } else {
            self.mark_another(rank);
        }
    }

    #[inline(never)]
    fn mark_another(&mut self, rank: u32) {
        let only = core::mem::replace(&mut self.only, NOBODY);
        self.set(rank);
        if only != NOBODY {
            self.set(only);
        }
    }

    fn set(&mut self, rank: u32) {
        if let Some(word) = self.words.get_mut(rank as usize / 64) {
            let bit = 1 << (rank % 64);
            self.set += u32::from(*word & bit == 0);
            *word |= bit;
        }
    }

    pub(super) fn clear(&mut self, rank: u32) {
        if self.only == rank {
            self.only = NOBODY;
        } else if let Some(word) = self.words.get_mut(rank as usize / 64) {
            let bit = 1 << (rank % 64);
            self.set -= u32::from(*word & bit != 0);
            *word &= !bit;
        }
    }

    /// Whether none is ready.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.only == NOBODY && self.set == 0
    }

    /// Whether the agent in this slot is ready.
    pub(super) fn is_marked(&self, slot: u32) -> bool {
        self.rank_of(slot).is_some_and(|rank| {
            self.only == rank
                || self.words.get(rank as usize / 64).is_some_and(|word| word >> (rank % 64) & 1 == 1)
        })
    }

    /// Takes the slot of the first that is ready behind the one taken last, or of the first of all.
    #[inline]
    pub(super) fn take(&mut self) -> Option<u32> {
        if self.only != NOBODY {
            self.cursor = core::mem::replace(&mut self.only, NOBODY) + 1;
            return Some(self.only_slot);
        }
        if self.set == 0 {
            return None;
        }
        self.take_next()
    }

    #[inline(never)]
    fn take_next(&mut self) -> Option<u32> {
        let rank = self.next(self.cursor).or_else(|| self.next(0))?;
        self.clear(rank);
        self.cursor = rank + 1;
        self.order.get(rank as usize).copied()
    }

    /// The first rank at or behind `from` whose bit is set.
    #[inline]
    fn next(&self, from: u32) -> Option<u32> {
        let mut word = from as usize / 64;
        let mut bits = *self.words.get(word)? & (u64::MAX << (from % 64));
        loop {
            if bits != 0 {
                return Some(word as u32 * 64 + bits.trailing_zeros());
            }
            word += 1;
            bits = *self.words.get(word)?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    proptest::proptest! {
        /// Against a set that is searched in the same way.
        #[test]
        fn it_does_what_a_plain_set_does(acts in proptest::collection::vec((0u8..5, 0u32..150), 0..200)) {
            let mut ready = ReadySet::default();
            // Slots stand in the opposite order of the data flow, and slot 0 in none.
            let rank = |slot: u32| 149 - slot;
            let order = |ready: &mut ReadySet| {
                let mut ranks = (0..150).map(|slot| if slot == 0 { NOBODY } else { rank(slot) }).collect();
                ready.set_order(&mut (0..149).map(|rank| 149 - rank).collect(), &mut ranks, &mut vec![0; 3]);
            };
            order(&mut ready);
            let (mut model, mut cursor) = (BTreeSet::new(), 0);
            for (act, number) in acts {
                match act {
                    0 | 1 => {
                        ready.mark(number);
                        if number != 0 {
                            model.insert(rank(number));
                        }
                    }
                    2 => {
                        ready.clear(number);
                        model.remove(&number);
                    }
                    3 => {
                        let wanted = model.range(cursor..).next().or_else(|| model.first()).copied();
                        proptest::prop_assert_eq!(ready.take().map(rank), wanted);
                        cursor = wanted.map_or(cursor, |rank| rank + 1);
                        model.retain(|rank| Some(*rank) != wanted);
                    }
                    _ => {
                        order(&mut ready);
                        cursor = 0;
                    }
                }
                proptest::prop_assert_eq!(ready.is_empty(), model.is_empty());
            }
        }
    }
}

//! Which agents of an executor have something to do, in data-flow order.

/// A bit for each place in the data flow. Where a chain of agents runs, one is ready at a time: that one stands beside the bits.
#[derive(Debug)]
pub(super) struct ReadySet {
    words: Vec<u64>,
    rank_of: Vec<u32>,
    /// The only one that is ready, while no bit is set; or nobody.
    only: u32,
}

const NOBODY: u32 = u32::MAX;

impl Default for ReadySet {
    fn default() -> ReadySet {
        ReadySet { words: Vec::new(), rank_of: Vec::new(), only: NOBODY }
    }
}

impl ReadySet {
    /// Says in which place of the data flow each slot stands, with room for all of them. Nobody is ready then but those in `words`.
    pub(super) fn set_order(&mut self, ranks: &mut Vec<u32>, words: &mut Vec<u64>) {
        core::mem::swap(&mut self.rank_of, ranks);
        core::mem::swap(&mut self.words, words);
        self.only = NOBODY;
    }

    #[inline]
    pub(super) fn rank_of(&self, slot: u32) -> Option<u32> {
        self.rank_of.get(slot as usize).copied().filter(|rank| *rank != NOBODY)
    }

    #[inline]
    pub(super) fn mark(&mut self, slot: u32) {
        let Some(rank) = self.rank_of(slot) else { return };
        if self.is_empty() {
            self.only = rank;
            return;
        }
        let only = core::mem::replace(&mut self.only, NOBODY);
        self.set(rank);
        if only != NOBODY {
            self.set(only);
        }
    }

    fn set(&mut self, rank: u32) {
        if let Some(word) = self.words.get_mut(rank as usize / 64) {
            *word |= 1 << (rank % 64);
        }
    }

    pub(super) fn clear(&mut self, rank: u32) {
        if self.only == rank {
            self.only = NOBODY;
        } else if let Some(word) = self.words.get_mut(rank as usize / 64) {
            *word &= !(1 << (rank % 64));
        }
    }

    /// Whether none is ready.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.only == NOBODY && self.words.iter().all(|word| *word == 0)
    }

    /// Takes the first rank at or behind `from` that is ready, or the first of all.
    #[inline]
    pub(super) fn take(&mut self, from: u32) -> Option<u32> {
        if self.only != NOBODY {
            return Some(core::mem::replace(&mut self.only, NOBODY));
        }
        let rank = self.next(from).or_else(|| self.next(0))?;
        self.clear(rank);
        Some(rank)
    }

    /// All that are ready.
    pub(super) fn iter(&self) -> impl Iterator<Item = u32> {
        let only = (self.only != NOBODY).then_some(self.only);
        let mut from = 0;
        only.into_iter().chain(std::iter::from_fn(move || {
            let rank = self.next(from)?;
            from = rank + 1;
            Some(rank)
        }))
    }

    /// The first rank at or behind `from` whose bit is set.
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
        fn it_does_what_a_plain_set_does(acts in proptest::collection::vec((0u8..4, 0u32..150), 0..200)) {
            let mut ready = ReadySet::default();
            // Slots stand in the opposite order of the data flow, and slot 0 in none.
            let rank = |slot: u32| 149 - slot;
            let mut ranks: Vec<u32> = (0..150).map(|slot| if slot == 0 { NOBODY } else { rank(slot) }).collect();
            ready.set_order(&mut ranks, &mut vec![0; 3]);
            let mut model = BTreeSet::new();
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
                    _ => {
                        let wanted = model.range(number..).next().or_else(|| model.first()).copied();
                        proptest::prop_assert_eq!(ready.take(number), wanted);
                        model.retain(|rank| Some(*rank) != wanted);
                    }
                }
                proptest::prop_assert_eq!(ready.is_empty(), model.is_empty());
                proptest::prop_assert_eq!(ready.iter().collect::<BTreeSet<_>>(), model.clone());
            }
        }
    }
}

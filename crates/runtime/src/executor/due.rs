//! Who is due by the clock, in the order of deadlines.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use types::Time;

/// An agent that is due: its deadline, its place in the data flow, its slot, and when it was released. The one that compares least is next.
pub(super) type Entry = (Time, u32, u32, Time);

/// When so many are due they are put in order at once: it is known then who comes after whom.
pub(super) const MANY: usize = 32;

/// All that are due. Few are kept in a heap, many in a row, and who comes while the row lasts goes to the heap again.
#[derive(Debug, Default)]
pub(crate) struct Due {
    heap: BinaryHeap<Reverse<Entry>>,
    /// The next one last.
    row: Vec<Entry>,
}

impl Due {
    /// Room for so many.
    pub(super) fn with_capacity(room: usize) -> Due {
        Due { heap: BinaryHeap::with_capacity(room), row: Vec::with_capacity(room) }
    }

    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.heap.is_empty() && self.row.is_empty()
    }

    #[inline]
    pub(super) fn push(&mut self, entry: Entry) {
        self.heap.push(Reverse(entry));
    }

    /// Takes the next one out.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<Entry> {
        if self.row.is_empty() {
            if self.heap.len() < MANY {
                return self.heap.pop().map(|Reverse(entry)| entry);
            }
            self.line_up();
        }
        match self.heap.peek() {
            Some(Reverse(first)) if self.row.last().is_none_or(|next| first < next) => {
                self.heap.pop().map(|Reverse(entry)| entry)
            }
            _ => self.row.pop(),
        }
    }

    fn line_up(&mut self) {
        self.row.extend(self.heap.drain().map(|Reverse(entry)| entry));
        self.row.sort_unstable_by(|one, other| other.cmp(one));
    }

    /// The slot of whoever comes `after` so many others, where that is known.
    #[inline]
    pub(super) fn coming(&self, after: usize) -> Option<u32> {
        self.row.len().checked_sub(after + 1).map(|place| self.row[place].2)
    }

    pub(super) fn forget(&mut self, slot: u32) {
        self.heap.retain(|Reverse((_, _, known, _))| *known != slot);
        self.row.retain(|(_, _, known, _)| *known != slot);
    }

    /// Takes over all of another.
    pub(super) fn take_over(&mut self, other: &mut Due) {
        // One by one: `append` of a heap exchanges the two when the other one is longer, and the room would go with it.
        self.heap.extend(other.heap.drain());
        self.row.append(&mut other.row);
        self.row.sort_unstable_by(|one, other| other.cmp(one));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        /// Whoever comes and goes, and when: the next one is the least of those who are there, and who is said to come does come, where nobody
        /// can push in.
        #[test]
        fn the_least_is_next(acts in proptest::collection::vec((0u8..4, 0i64..40, 0u32..80), 0..400)) {
            let (mut due, mut plain) = (Due::with_capacity(4), Vec::<Entry>::new());
            let mut expected = None;
            for (act, time, slot) in acts {
                let entry = (Time(time), slot / 2, slot, Time(0));
                match act {
                    0 => {
                        plain.sort_unstable();
                        let next = (!plain.is_empty()).then(|| plain.remove(0));
                        proptest::prop_assert_eq!(due.pop(), next);
                        if let Some(expected) = expected.take() {
                            proptest::prop_assert_eq!(next.map(|next| next.2), Some(expected));
                        }
                        expected = due.coming(0).filter(|_| due.heap.is_empty());
                    }
                    1 if slot < 4 => {
                        due.forget(slot);
                        plain.retain(|known| known.2 != slot);
                        expected = None;
                    }
                    2 if slot < 4 => {
                        let mut roomy = Due::with_capacity(100);
                        roomy.take_over(&mut due);
                        proptest::prop_assert!(due.is_empty());
                        due = roomy;
                    }
                    _ => {
                        due.push(entry);
                        plain.push(entry);
                        expected = None;
                    }
                }
                proptest::prop_assert_eq!(due.is_empty(), plain.is_empty());
            }
        }
    }

    #[test]
    fn of_many_it_is_known_who_comes() {
        let mut due = Due::with_capacity(100);
        for slot in [7, 3, 5].into_iter().chain(20..60) {
            due.push((Time(1), slot, slot, Time(0)));
        }
        assert_eq!(due.coming(0), None);
        assert_eq!(due.pop().map(|entry| entry.2), Some(3));
        assert_eq!([0, 1, 2].map(|after| due.coming(after)), [Some(5), Some(7), Some(20)]);
        // With room for all from the start, it takes none.
        let room = |due: &Due| (due.heap.capacity(), due.row.capacity());
        assert_eq!(room(&due), room(&Due::with_capacity(100)));
    }
}

//! Cells that wait, the one of least key first; each waits once, and its key can change.

/// So many entries stand below one. Four lie in one or two lines of the cache, and the heap is half as high as one of two.
const BELOW: usize = 4;
/// Where a cell stands that does not wait.
const NOWHERE: u32 = u32::MAX;

/// A heap of cells by their numbers. The memory for all is taken when it is made.
#[derive(Clone, Debug)]
pub(super) struct Heap<K> {
    entries: Vec<(K, u32)>,
    places: Box<[u32]>,
}

impl<K: Copy + PartialOrd> Heap<K> {
    /// For so many cells.
    pub(super) fn new(cells: usize) -> Heap<K> {
        Heap { entries: Vec::with_capacity(cells), places: vec![NOWHERE; cells].into_boxed_slice() }
    }

    /// Nobody waits any more.
    pub(super) fn clear(&mut self) {
        for (_, cell) in self.entries.drain(..) {
            self.places[cell as usize] = NOWHERE;
        }
    }

    /// The least key and whose it is.
    pub(super) fn first(&self) -> Option<(K, u32)> {
        self.entries.first().copied()
    }

    /// All that wait, in no order.
    pub(super) fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.entries.iter().map(|(_, cell)| *cell)
    }

    /// Lets a cell wait with this key, whether it waited or not.
    pub(super) fn put(&mut self, cell: u32, key: K) {
        let place = self.places[cell as usize];
        if place == NOWHERE {
            self.entries.push((key, cell));
            self.rise(self.entries.len() - 1, key, cell);
        } else if key < self.entries[place as usize].0 {
            self.rise(place as usize, key, cell);
        } else {
            self.sink(place as usize, key, cell);
        }
    }

    /// Takes the cell of least key.
    pub(super) fn take(&mut self) -> Option<(K, u32)> {
        let (key, cell) = self.first()?;
        self.remove(cell);
        Some((key, cell))
    }

    /// A cell waits no more.
    pub(super) fn remove(&mut self, cell: u32) {
        let place = core::mem::replace(&mut self.places[cell as usize], NOWHERE) as usize;
        if place == NOWHERE as usize {
            return;
        }
        let Some((key, last)) = self.entries.pop() else { return };
        if place == self.entries.len() {
            return;
        }
        // The last one takes its place, and may belong higher or lower.
        if key < self.entries[place].0 { self.rise(place, key, last) } else { self.sink(place, key, last) }
    }

    /// Gives every one that waits the key that it has now.
    pub(super) fn order(&mut self, mut key: impl FnMut(u32) -> K) {
        self.entries.iter_mut().for_each(|(k, cell)| *k = key(*cell));
        for place in (0..self.entries.len().div_ceil(BELOW)).rev() {
            let (key, cell) = self.entries[place];
            self.sink(place, key, cell);
        }
    }

    fn rise(&mut self, mut place: usize, key: K, cell: u32) {
        while place > 0 {
            let above = (place - 1) / BELOW;
            if self.entries[above].0 <= key {
                break;
            }
            self.set(place, self.entries[above]);
            place = above;
        }
        self.set(place, (key, cell));
    }

    fn sink(&mut self, mut place: usize, key: K, cell: u32) {
        loop {
            let first = BELOW * place + 1;
            let last = (first + BELOW).min(self.entries.len());
            let Some(least) =
                (first..last).reduce(|a, b| if self.entries[b].0 < self.entries[a].0 { b } else { a })
            else {
                break;
            };
            if key <= self.entries[least].0 {
                break;
            }
            self.set(place, self.entries[least]);
            place = least;
        }
        self.set(place, (key, cell));
    }

    fn set(&mut self, place: usize, entry: (K, u32)) {
        self.entries[place] = entry;
        // Whoever was moved knows where it stands now. An order made anew tells those that did not move as well.
        self.places[entry.1 as usize] = place as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;

    proptest! {
        /// Against a map that is searched through each time.
        #[test]
        fn it_gives_the_least_whatever_was_done_before(
            deeds in proptest::collection::vec((0u8..8, 0u32..40, 0u32..100), 0..300),
        ) {
            let mut heap = Heap::new(40);
            let mut plain = BTreeMap::new();
            for (deed, cell, key) in deeds {
                match deed {
                    0..5 => {
                        heap.put(cell, key);
                        plain.insert(cell, key);
                    }
                    5 => {
                        heap.remove(cell);
                        plain.remove(&cell);
                    }
                    6 => {
                        let least = plain.values().min().copied();
                        let taken = heap.take();
                        prop_assert_eq!(taken.map(|(key, _)| key), least);
                        if let Some((key, cell)) = taken {
                            prop_assert_eq!(plain.remove(&cell), Some(key));
                        }
                    }
                    _ => {
                        heap.order(|cell| (cell * 37 + key) % 100);
                        plain.iter_mut().for_each(|(cell, k)| *k = (cell * 37 + key) % 100);
                    }
                }
                prop_assert_eq!(heap.first().map(|(key, _)| key), plain.values().min().copied());
                prop_assert_eq!(heap.iter().count(), plain.len());
            }
            heap.clear();
            prop_assert_eq!(heap.take(), None);
            heap.put(3, 1);
            prop_assert_eq!(heap.take(), Some((1, 3)));
        }
    }
}

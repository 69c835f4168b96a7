//! The names of agents by their numbers: written by the control side, read by anybody without a lock.
//!
//! A number is a place and how often the place was given before. A place is given again when its agent is gone and many others have
//! gone since, so that who was there lately can still be told; the number is another one then, and none is given twice.

use std::collections::VecDeque;
use std::sync::{Mutex, OnceLock, PoisonError};

use types::{AgentId, Name};

use crate::sync::{AtomicU32, AtomicU64, Ordering, named};

const CHUNK: usize = 256;
const CHUNKS: usize = 256;
/// The bits of a number that say the place.
const PLACE: u32 = 16;
/// A place that was given so often is not given again; the numbers above belong to callers from outside.
const MOST: u32 = 0x7fff;
/// So many places stay as they were left, for those who ask who it was.
const REMEMBERED: usize = CHUNK;

/// One place. The number stands there while the name is whole.
#[derive(Debug)]
struct Entry {
    number: AtomicU32,
    here: AtomicU32,
    name: [AtomicU64; 3],
}

type Chunk = Box<[Entry]>;

/// The places that are free, which only the control side asks for.
#[derive(Debug, Default)]
struct Free {
    /// How many places were ever given.
    used: u32,
    /// The numbers that were given last to those whose agents are gone, the longest gone first.
    left: VecDeque<u32>,
}

/// The names of all agents that there are, and of some that were.
#[derive(Debug)]
pub(crate) struct Directory {
    chunks: Box<[OnceLock<Chunk>]>,
    free: Mutex<Free>,
}

impl Entry {
    fn new() -> Entry {
        Entry {
            number: AtomicU32::new(AgentId::NONE.0),
            here: AtomicU32::new(0),
            name: core::array::from_fn(|_| AtomicU64::new(0)),
        }
    }

    fn write(&self, number: u32, name: &str) {
        // Whoever reads a word of the new name sees afterwards that the old number is gone, or that the new one is there.
        self.number.store(AgentId::NONE.0, Ordering::Relaxed);
        for (word, bytes) in self.name.iter().zip(packed(name)) {
            // Pairs with the acquire in `read`.
            word.store(bytes, named("names: word", Ordering::Release));
        }
        self.here.store(1, Ordering::Relaxed);
        // Pairs with the acquire in `read`: with the number the whole name is there.
        self.number.store(number, named("names: number", Ordering::Release));
    }

    /// The name, if the place has that number from before reading to after it.
    fn read(&self, number: u32) -> Option<Name> {
        if self.number.load(Ordering::Acquire) != number {
            return None;
        }
        let words = core::array::from_fn(|i| self.name[i].load(Ordering::Acquire));
        (self.number.load(Ordering::Relaxed) == number).then(|| unpacked(words))
    }
}

/// A name as three words: its bytes, and in the last one its length.
fn packed(name: &str) -> [u64; 3] {
    let name = Name::new(name);
    let mut bytes = [0; 24];
    bytes[..name.as_str().len()].copy_from_slice(name.as_str().as_bytes());
    bytes[23] = name.as_str().len() as u8;
    core::array::from_fn(|i| {
        bytes[i * 8..][..8].iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
    })
}

fn unpacked(words: [u64; 3]) -> Name {
    let mut bytes = [0; 24];
    for (place, word) in bytes.chunks_exact_mut(8).zip(words) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    let len = usize::from(bytes[23]).min(23);
    // It was a text when it was written.
    Name::new(core::str::from_utf8(&bytes[..len]).unwrap_or(""))
}

impl Directory {
    pub(crate) fn new() -> Directory {
        Directory { chunks: (0..CHUNKS).map(|_| OnceLock::new()).collect(), free: Mutex::default() }
    }

    fn entry(&self, number: u32) -> Option<&Entry> {
        let place = number as usize & ((1 << PLACE) - 1);
        self.chunks.get(place / CHUNK)?.get()?.get(place % CHUNK)
    }

    /// A number for a new agent, which nobody had before. Nothing when there are more agents than places.
    pub(crate) fn give(&self, name: &str) -> Option<AgentId> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let full = free.used as usize >= CHUNK * CHUNKS;
        let number = if free.left.len() > REMEMBERED || full {
            free.left.pop_front()? + (1 << PLACE)
        } else {
            free.used += 1;
            free.used - 1
        };
        let place = number as usize & ((1 << PLACE) - 1);
        self.chunks[place / CHUNK].get_or_init(|| (0..CHUNK).map(|_| Entry::new()).collect());
        self.entry(number)?.write(number, name);
        Some(AgentId(number))
    }

    /// The agent is gone. Its name is known for a while still.
    pub(crate) fn take_back(&self, id: AgentId) {
        if let Some(entry) = self.entry(id.0) {
            entry.here.store(0, Ordering::Relaxed);
        }
        if id.0 >> PLACE < MOST {
            self.free.lock().unwrap_or_else(PoisonError::into_inner).left.push_back(id.0);
        }
    }

    /// The name of the agent with this number.
    pub(crate) fn name(&self, id: AgentId) -> Option<Name> {
        self.entry(id.0)?.read(id.0)
    }

    /// The number of the agent of this name, if there is one.
    pub(crate) fn find(&self, name: &str) -> Option<AgentId> {
        // Names are compared as they lie: to read each as a text takes longer than all the rest.
        let sought = packed(name);
        if Name::new(name).as_str() != name {
            // No name is that long.
            return None;
        }
        let entries = self.chunks.iter().map_while(OnceLock::get).flat_map(|chunk| chunk.iter());
        entries
            .filter(|entry| {
                entry.here.load(Ordering::Relaxed) == 1
                    && entry
                        .name
                        .iter()
                        .zip(sought)
                        .all(|(word, sought)| word.load(Ordering::Acquire) == sought)
            })
            .map(|entry| AgentId(entry.number.load(Ordering::Relaxed)))
            .find(|id| *id != AgentId::NONE)
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    #[test]
    fn names_come_back_as_they_were_written() {
        let directory = Directory::new();
        for name in ["", "a", "sonar", "Übergabe", "a.name.of.23.characters"] {
            let id = directory.give(name).unwrap();
            assert_eq!(directory.name(id).unwrap().as_str(), name);
            assert_eq!(directory.find(name), Some(id));
        }
        assert_eq!(directory.find("a.name.of.23.charactersX"), None);
    }

    #[test]
    fn a_hundred_thousand_agents_come_and_go_in_the_same_places_with_numbers_of_their_own() {
        let directory = Directory::new();
        let stays = directory.give("stays").unwrap();
        let mut seen = std::collections::HashSet::from([stays]);
        let mut last = None;
        for n in 0..100_000 {
            let name = format!("guest{n}");
            let id = directory.give(&name).unwrap();
            assert!(seen.insert(id), "{id:?} was given twice");
            assert_eq!(directory.find(&name), Some(id));
            directory.take_back(id);
            assert_eq!(directory.find(&name), None, "it is gone");
            assert_eq!(directory.name(id).unwrap().as_str(), name, "and remembered");
            if let Some((id, name)) = last.replace((id, name)) {
                assert_eq!(directory.name(id).unwrap().as_str(), name);
            }
        }
        assert_eq!(directory.name(stays).unwrap().as_str(), "stays");
        assert!(directory.chunks.iter().filter(|chunk| chunk.get().is_some()).count() <= 2, "it grows");
    }
}

#[cfg(test)]
#[cfg(loom)]
mod model {
    use super::*;
    use crate::sync::weaken;
    use loom::{sync::Arc, thread};

    /// While a place is given to another, whoever asks for the old number gets the old name or none.
    #[test]
    fn a_name_is_read_whole_or_not_at_all() {
        weaken::check(&["names: word", "names: number"], || {
            let entry = Arc::new(Entry::new());
            entry.write(1, "aaaaaaaaaaaaaaaaaaaaaaa");
            let theirs = entry.clone();
            let writer = thread::spawn(move || theirs.write(2, "bbbbbbbbbbbbbbbbbbbbbbb"));
            let (one, two) = (entry.read(1), entry.read(2));
            assert!(one.is_none_or(|name| name.as_str() == "aaaaaaaaaaaaaaaaaaaaaaa"), "torn: {one:?}");
            assert!(two.is_none_or(|name| name.as_str() == "bbbbbbbbbbbbbbbbbbbbbbb"), "torn: {two:?}");
            writer.join().unwrap();
        });
    }
}

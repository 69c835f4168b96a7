//! The names of agents by their numbers: written by the control side, read by anybody without a lock.
//!
//! A number is a place and how often the place was given before. A place is given again when its agent is gone and many others have
//! gone since, so that who was there lately can still be told; the number is another one then, and none is given twice.
//!
//! Places whose names fall together stand in a chain, by which a name is found. A place that is given again moves to another chain; who is
//! on its way through a chain meanwhile may be led astray, sees that by the number of moves, and looks at all places instead.

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

/// How many chains there are: with thousands of agents one is as long as it takes to compare a few words.
const CHAINS: usize = 1 << 10;
/// The end of a chain.
const NOBODY: u32 = u32::MAX;

/// One place. The number stands there while the name is whole.
#[derive(Debug)]
struct Entry {
    number: AtomicU32,
    /// The next place of its chain.
    next: AtomicU32,
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

/// The heads of the chains, and how often places moved: an odd number while one does.
#[derive(Debug)]
struct Chains {
    heads: Box<[AtomicU32]>,
    moves: AtomicU32,
}

/// The names of all agents that there are, and of some that were.
#[derive(Debug)]
pub(crate) struct Directory {
    chunks: Box<[OnceLock<Chunk>]>,
    chains: Chains,
    free: Mutex<Free>,
}

impl Entry {
    fn new() -> Entry {
        Entry {
            number: AtomicU32::new(AgentId::NONE.0),
            next: AtomicU32::new(NOBODY),
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

    /// Whether somebody is here under this name.
    fn is_named(&self, sought: &[u64; 3]) -> bool {
        self.here.load(Ordering::Relaxed) == 1
            && self.name.iter().zip(sought).all(|(word, sought)| word.load(Ordering::Acquire) == *sought)
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

/// The chain in which a name stands.
fn chain_of(name: &[u64; 3]) -> usize {
    // Fibonacci hashing: the upper bits of a product depend on all bits below them.
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    let mixed = name.iter().fold(0, |mixed: u64, word| (mixed.rotate_left(29) ^ word).wrapping_mul(GOLDEN));
    (mixed >> (u64::BITS - CHAINS.trailing_zeros())) as usize
}

impl Chains {
    fn new(chains: usize) -> Chains {
        Chains { heads: (0..chains).map(|_| AtomicU32::new(NOBODY)).collect(), moves: AtomicU32::new(0) }
    }

    /// Puts a place into a chain, and takes it out of the one where it was. Only one thread at a time does so. `next_of` is the word in a
    /// place that names the one behind it.
    fn enter<'a>(
        &'a self,
        place: u32,
        from: Option<usize>,
        to: usize,
        next_of: impl Fn(u32) -> Option<&'a AtomicU32>,
    ) {
        let Some(own) = next_of(place) else { return };
        let moves = self.moves.load(Ordering::Relaxed);
        // Whoever sees a word that is written here sees afterwards that something moves.
        self.moves.store(moves + 1, Ordering::Relaxed);
        if let Some(from) = from {
            let mut before = &self.heads[from];
            loop {
                let next = before.load(Ordering::Relaxed);
                if next == place {
                    // Pairs with the acquire in `walk`.
                    before.store(own.load(Ordering::Relaxed), Ordering::Release);
                    break;
                }
                let Some(behind) = next_of(next) else { break };
                before = behind;
            }
        }
        // Pairs with the acquire in `walk`.
        own.store(self.heads[to].load(Ordering::Relaxed), named("names: move", Ordering::Release));
        // Pairs with the acquire in `walk`: who finds the place finds what is in it and behind it.
        self.heads[to].store(place, named("names: enter", Ordering::Release));
        // Pairs with the acquire at the beginning of `walk`: all of it is done.
        self.moves.store(moves + 2, named("names: moved", Ordering::Release));
    }

    /// Goes through a chain until `is_it`. Nothing is sure when a place moved meanwhile, or when it goes on for ever.
    fn walk<'a>(
        &'a self,
        chain: usize,
        next_of: impl Fn(u32) -> Option<&'a AtomicU32>,
        is_it: impl Fn(u32) -> bool,
    ) -> Walked {
        let moves = self.moves.load(Ordering::Acquire);
        let mut place = self.heads[chain].load(Ordering::Acquire);
        for _ in 0..=CHUNK * CHUNKS {
            let Some(next) = next_of(place) else {
                // What was seen of a move was seen before this.
                let undisturbed = moves.is_multiple_of(2) && self.moves.load(Ordering::Relaxed) == moves;
                return if undisturbed { Walked::Nobody } else { Walked::Unsure };
            };
            if is_it(place) {
                return Walked::Found(place);
            }
            place = next.load(Ordering::Acquire);
        }
        Walked::Unsure
    }
}

/// What became of a walk through a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Walked {
    /// It is at this place.
    Found(u32),
    /// It is at no place of the chain.
    Nobody,
    /// Somebody moved meanwhile.
    Unsure,
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
        Directory {
            chunks: (0..CHUNKS).map(|_| OnceLock::new()).collect(),
            chains: Chains::new(CHAINS),
            free: Mutex::default(),
        }
    }

    fn entry(&self, number: u32) -> Option<&Entry> {
        let place = number as usize & ((1 << PLACE) - 1);
        self.chunks.get(place / CHUNK)?.get()?.get(place % CHUNK)
    }

    /// The word that names the place behind another one in its chain.
    fn next_of(&self, place: u32) -> Option<&AtomicU32> {
        if place == NOBODY { None } else { self.entry(place).map(|entry| &entry.next) }
    }

    /// A number for a new agent, which nobody had before. Nothing when there are more agents than places.
    pub(crate) fn give(&self, name: &str) -> Option<AgentId> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let full = free.used as usize >= CHUNK * CHUNKS;
        let is_given_again = free.left.len() > REMEMBERED || full;
        let number = if is_given_again {
            free.left.pop_front()? + (1 << PLACE)
        } else {
            free.used += 1;
            free.used - 1
        };
        let place = number & ((1 << PLACE) - 1);
        self.chunks[place as usize / CHUNK].get_or_init(|| (0..CHUNK).map(|_| Entry::new()).collect());
        let entry = self.entry(number)?;
        let before = entry.name.each_ref().map(|word| word.load(Ordering::Relaxed));
        let (from, to) = (is_given_again.then(|| chain_of(&before)), chain_of(&packed(name)));
        entry.write(number, name);
        if from != Some(to) {
            self.chains.enter(place, from, to, |place| self.next_of(place));
        }
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
        let is_it = |place| self.entry(place).is_some_and(|entry| entry.is_named(&sought));
        let found = match self.chains.walk(chain_of(&sought), |place| self.next_of(place), is_it) {
            Walked::Found(place) => self.entry(place),
            Walked::Nobody => None,
            Walked::Unsure => self.entries().find(|entry| entry.is_named(&sought)),
        };
        let id = AgentId(found?.number.load(Ordering::Relaxed));
        (id != AgentId::NONE).then_some(id)
    }

    /// All places that were ever given.
    fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.chunks.iter().map_while(OnceLock::get).flat_map(|chunk| chunk.iter())
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

    /// Chains of many, and names that come back at other places.
    #[test]
    fn thousands_are_found_by_name_whoever_came_and_went() {
        let directory = Directory::new();
        let mut here = std::collections::HashMap::new();
        let mut draw = 1u64;
        for _ in 0..40_000 {
            // Knuth's linear congruential generator.
            draw = draw.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let name = format!("agent{}", draw >> 33 & 0xfff);
            match here.remove(&name) {
                Some(id) => directory.take_back(id),
                None => drop(here.insert(name.clone(), directory.give(&name).unwrap())),
            }
        }
        assert!(here.len() > 1500);
        for n in 0..0x1000 {
            let name = format!("agent{n}");
            assert_eq!(directory.find(&name), here.get(&name).copied(), "{name}");
        }
        // Each place stands in one chain.
        let mut seen = std::collections::HashSet::new();
        for head in &directory.chains.heads {
            let mut place = head.load(Ordering::Relaxed);
            while let Some(next) = directory.next_of(place) {
                assert!(seen.insert(place), "{place} twice");
                place = next.load(Ordering::Relaxed);
            }
        }
        assert_eq!(seen.len(), directory.free.lock().unwrap().used as usize);
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

    /// Whoever stays in a chain is found, while a place moves from before one to before another.
    #[test]
    fn who_stays_is_found_or_the_walk_is_unsure() {
        weaken::check(&["names: word", "names: number"], || {
            let chains = Arc::new(Chains::new(2));
            let next: Arc<[AtomicU32; 3]> = Arc::new(core::array::from_fn(|_| AtomicU32::new(NOBODY)));
            // The chain 0 is 1, 0; the chain 1 is 2.
            for (place, chain) in [(0, 0), (1, 0), (2, 1)] {
                chains.enter(place, None, chain, |place| next.get(place as usize));
            }
            let (theirs, places) = (chains.clone(), next.clone());
            let mover =
                thread::spawn(move || theirs.enter(1, Some(0), 1, |place| places.get(place as usize)));
            let walk =
                |chain, sought| chains.walk(chain, |place| next.get(place as usize), |place| place == sought);
            for stays in [(0, 0), (1, 2)] {
                assert_ne!(walk(stays.0, stays.1), Walked::Nobody, "who stays is not there");
            }
            mover.join().unwrap();
            assert_eq!([walk(0, 0), walk(0, 1)], [Walked::Found(0), Walked::Nobody]);
            assert_eq!([walk(1, 1), walk(1, 2)], [Walked::Found(1), Walked::Found(2)]);
        });
    }

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

//! The names of agents by their numbers: written by the control side, read by anybody without a lock.

use std::sync::OnceLock;

use types::{AgentId, Name};

const CHUNK: usize = 256;
const CHUNKS: usize = 4096;

type Chunk = Box<[OnceLock<Name>]>;

/// Numbers are given once and never again, so a name that is written never changes.
#[derive(Debug)]
pub(crate) struct Directory {
    chunks: Box<[OnceLock<Chunk>]>,
}

impl Directory {
    pub(crate) fn new() -> Directory {
        Directory { chunks: (0..CHUNKS).map(|_| OnceLock::new()).collect() }
    }

    /// Remembers the name of a new agent.
    pub(crate) fn remember(&self, id: AgentId, name: &str) {
        if let Some(chunk) = self.chunks.get(id.0 as usize / CHUNK) {
            let chunk = chunk.get_or_init(|| (0..CHUNK).map(|_| OnceLock::new()).collect());
            // Numbers are given once, so nothing stands there yet.
            let _ = chunk[id.0 as usize % CHUNK].set(Name::new(name));
        }
    }

    /// The name of the agent with this number.
    pub(crate) fn name(&self, id: AgentId) -> Option<Name> {
        self.chunks.get(id.0 as usize / CHUNK)?.get()?[id.0 as usize % CHUNK].get().copied()
    }

    /// The number that was last given to an agent of this name.
    pub(crate) fn find(&self, name: &str) -> Option<AgentId> {
        // Names are compared as they lie: to read each as a text takes longer than all the rest.
        let sought = Name::new(name);
        if sought.as_str() != name {
            // No name is that long.
            return None;
        }
        let chunks = self.chunks.iter().map_while(OnceLock::get);
        let names = chunks.flat_map(|chunk| chunk.iter()).map_while(OnceLock::get);
        names.enumerate().filter(|(_, known)| **known == sought).last().map(|(i, _)| AgentId(i as u32))
    }
}

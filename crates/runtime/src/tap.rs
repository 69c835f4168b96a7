//! Listening to an output from outside: a wire that ends on an ordinary thread.

use std::sync::{Arc, Mutex};

use types::Header;

/// A message that was heard, in CDR.
#[derive(Clone, Debug)]
pub struct Heard {
    /// What it carried besides its payload.
    pub header: Header,
    /// The message, as CDR.
    pub cdr: Vec<u8>,
}

/// How many messages wait for a reader; older ones are lost to it.
const WAITING: usize = 256;

#[derive(Debug, Default)]
pub(crate) struct Mailbag {
    heard: std::collections::VecDeque<Heard>,
    lost: u64,
}

/// An output that is listened to. The messages come through the log's ring, so the sender pays no more than for the log.
#[derive(Clone, Debug)]
pub struct Tap {
    name: String,
    definition: types::definition::Definition,
    bag: Arc<Mutex<Mailbag>>,
}

impl Tap {
    pub(crate) fn new(name: &str, definition: types::definition::Definition) -> Tap {
        Tap { name: name.to_owned(), definition, bag: Arc::default() }
    }

    /// The output.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What its messages look like.
    pub fn definition(&self) -> &types::definition::Definition {
        &self.definition
    }

    /// Takes what was heard since the last time, and how many messages were lost because nobody took them.
    pub fn take(&self) -> (Vec<Heard>, u64) {
        let mut bag = self.bag.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        (bag.heard.drain(..).collect(), core::mem::take(&mut bag.lost))
    }

    /// Whether both are the same listener.
    pub(crate) fn is(&self, other: &Tap) -> bool {
        Arc::ptr_eq(&self.bag, &other.bag)
    }

    pub(crate) fn give(&self, heard: Heard) {
        let mut bag = self.bag.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if bag.heard.len() == WAITING {
            bag.heard.pop_front();
            bag.lost += 1;
        }
        bag.heard.push_back(heard);
    }
}

//! Why a decision is what it is: the numbers that it was made from.

use crate::message::{Field, Message};
use crate::text::{Name, Sequence};
use crate::time::Time;

/// A number that an agent tells the decision maker, under a name of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Signal {
    /// What conditions call it.
    pub name: Name,
    /// The number; one that is none (NaN) is unknown.
    pub value: f64,
    /// Until when it holds.
    pub valid_until: Time,
}

/// The value of a signal when a decision was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct Reason {
    /// The signal.
    pub signal: Name,
    /// Its value; 1 and 0 for yes and no.
    pub value: f64,
}

/// A situation that was active before a decision, or after it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(C)]
pub struct Held {
    /// The situation, a key of the decision table.
    pub situation: Name,
    /// Whether it was active before.
    pub was: bool,
    /// Whether it is active now.
    pub is: bool,
}

/// What a decision was made from. With the table it gives the decision again: levels that differ for begin and end need only what was
/// active before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Reasons {
    /// The situations, the highest priority first.
    pub situations: Sequence<Held, MOST_SITUATIONS>,
    /// The signals that were known, of those that the situations need. What is not among them was unknown.
    pub values: Sequence<Reason, MOST_REASONS>,
}

/// How many situations a table has room for, those that are built in among them.
pub const MOST_SITUATIONS: usize = 14;
/// How many signals the conditions of a table can need, those of the built-in situations among them.
pub const MOST_REASONS: usize = 20;

impl Reasons {
    /// What was known of a signal.
    pub fn value(&self, signal: &str) -> Option<f64> {
        self.values.iter().find(|reason| reason.signal.as_str() == signal).map(|reason| reason.value)
    }
}

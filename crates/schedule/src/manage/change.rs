//! That agents run otherwise from now on, and why.

use crate::Exact;
use crate::manage::{Setting, Stage};

/// Other settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The agents that are set otherwise, in their order.
    pub shifts: Vec<Shift>,
    /// Why.
    pub cause: Cause,
    /// The last kind of concession that is needed now; nothing where nobody reckons with it.
    pub stage: Option<Stage>,
    /// Who will miss its deadlines all the same.
    pub missing: Vec<usize>,
}

/// An agent that is set otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shift {
    /// Its place.
    pub agent: usize,
    /// How it ran.
    pub before: Setting,
    /// How it is to run.
    pub after: Setting,
}

/// Why agents are set otherwise.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// These would have missed their deadlines as things were.
    Late(Vec<Late>),
    /// These have missed deadlines.
    Missed(Vec<usize>),
    /// The load has fallen, and stayed so.
    Fallen,
    /// These were given other orders, or other limits.
    Ordered(Vec<usize>),
}

/// Who would have missed its deadline. Times in nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late {
    /// Its place.
    pub agent: usize,
    /// From what makes it run to the end of its step at worst; nothing where that has no bound.
    pub response: Option<Exact>,
    /// How soon it must be done.
    pub deadline: Exact,
}

/// Where settings differ.
pub(super) fn shifts(before: &[Setting], after: &[Setting]) -> Vec<Shift> {
    let pairs = before.iter().zip(after).enumerate();
    pairs
        .filter(|(_, (before, after))| before != after)
        .map(|(agent, (before, after))| Shift { agent, before: *before, after: *after })
        .collect()
}

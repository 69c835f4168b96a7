//! What a decision asks of agents besides the weight of their offers.

use super::decision::MOST_AGENTS;
use crate::message::{Field, Message};
use crate::text::{Name, Sequence};

/// Whether an agent is to work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Activity {
    /// Nothing is said.
    #[default]
    Unsaid = 0,
    /// It is.
    Active = 1,
    /// It is not.
    Inactive = 2,
}

/// What the active situations say of one agent. What none of them says is [`Order::UNSAID`] for a number, [`Activity::Unsaid`] and the
/// empty name: plain values, equal to themselves here and behind CDR.
#[derive(Clone, Copy, Debug, PartialEq, Field)]
#[repr(C)]
pub struct Order {
    /// The agent.
    pub agent: Name,
    /// How much it matters, from 0 to 1; −1 where nothing is said.
    pub importance: f64,
    /// The share of its nominal rate, above 0, to 1; −1 where nothing is said.
    pub rate: f64,
    /// How it is to work, in a word that it knows; empty where nothing is said.
    pub method: Name,
    /// Whether it is to work.
    pub activity: Activity,
}

impl Order {
    /// In the place of a number of which nothing is said.
    pub const UNSAID: f64 = -1.0;

    /// Of this agent nothing is said.
    pub const fn of(agent: Name) -> Order {
        let (importance, rate) = (Order::UNSAID, Order::UNSAID);
        Order { agent, importance, rate, method: Name::EMPTY, activity: Activity::Unsaid }
    }

    /// How much it matters, from 0 to 1, where that is said.
    pub fn importance(&self) -> Option<f64> {
        said(self.importance)
    }

    /// The share of its nominal rate, above 0, to 1, where that is said.
    pub fn rate(&self) -> Option<f64> {
        said(self.rate)
    }

    /// Whether it is to work, where that is said.
    pub fn active(&self) -> Option<bool> {
        match self.activity {
            Activity::Unsaid => None,
            Activity::Active => Some(true),
            Activity::Inactive => Some(false),
        }
    }

    /// How it is to work, where that is said.
    pub fn method(&self) -> Option<&str> {
        Some(self.method.as_str()).filter(|method| !method.is_empty())
    }
}

fn said(number: f64) -> Option<f64> {
    Some(number).filter(|number| *number >= 0.0)
}

impl Default for Order {
    fn default() -> Order {
        Order::of(Name::EMPTY)
    }
}

/// What the active situations say of all agents to which the decision table gives more than a weight. An agent stands in it also
/// when nothing is said of it now: what was said before is over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Orders {
    /// The goal, as in the decision; empty where no active situation says.
    pub goal: Name,
    /// One for each agent, in the order of the table.
    pub orders: Sequence<Order, MOST_AGENTS>,
}

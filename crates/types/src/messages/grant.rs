//! What the resource manager gives.

use crate::message::Message;
use crate::text::{Name, Text};

/// What an agent may use from now on.
#[derive(Clone, Copy, Debug, PartialEq, Message)]
#[repr(C)]
pub struct Grant {
    /// The agent.
    pub agent: Name,
    /// How often it runs, as a share of its nominal rate.
    pub rate: f64,
    /// Its method; empty where it has one alone.
    pub method: Name,
    /// How long its step may take with refinements (s); zero where it makes none.
    pub budget: f64,
    /// Whether it is suspended.
    pub suspended: bool,
    /// Why, cut where it is long.
    pub cause: Text<95>,
}

impl Default for Grant {
    fn default() -> Grant {
        let (agent, method, cause) = (Name::EMPTY, Name::EMPTY, Text::EMPTY);
        Grant { agent, rate: 1.0, method, budget: 0.0, suspended: false, cause }
    }
}

//! In which mode the reactive layer works.

use super::decision::MOST_AGENTS;
use crate::message::{Field, Message};
use crate::text::{Name, Sequence};

/// How one command is made out of the offers of many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Field)]
#[repr(u8)]
pub enum Coordination {
    /// Together: terms of fuzzy logic, the larger side wins.
    #[default]
    Fuzzy = 0,
    /// One against the other: who has the highest priority drives alone.
    Priority = 1,
    /// One above the other: on each axis of the motion the highest that speaks of it suppresses those below.
    Subsumption = 2,
    /// Together: the sum of the wishes as vectors, each by its weight.
    VectorSum = 3,
}

impl Coordination {
    /// All of them.
    pub const ALL: [Coordination; 4] =
        [Coordination::Fuzzy, Coordination::Priority, Coordination::Subsumption, Coordination::VectorSum];

    /// The words of all of them.
    pub const WORDS: [&str; 4] = {
        let [a, b, c, d] = Coordination::ALL;
        [a.word(), b.word(), c.word(), d.word()]
    };

    /// In a word, as it stands in files.
    pub const fn word(self) -> &'static str {
        match self {
            Coordination::Fuzzy => "fuzzy",
            Coordination::Priority => "priority",
            Coordination::Subsumption => "subsumption",
            Coordination::VectorSum => "vector-sum",
        }
    }
}

/// What a mode gives an action.
#[derive(Clone, Copy, Debug, Default, PartialEq, Field)]
#[repr(C)]
pub struct ModeRow {
    /// The action: the agent's name.
    pub agent: Name,
    /// What its offers are multiplied by, from 0 to 1.
    pub weight: f64,
    /// Who stands above whom: the greater above.
    pub priority: u32,
}

/// Whether people drive by hand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct ByHand {
    /// They do, or have just done so.
    pub on: bool,
}

/// The mode and what it means: who is heard, and how their wishes become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Mode {
    /// Its name.
    pub name: Name,
    /// The mode before.
    pub before: Name,
    /// How one command is made.
    pub coordination: Coordination,
    /// Who is heard; nobody else is.
    pub rows: Sequence<ModeRow, MOST_AGENTS>,
}

impl Mode {
    /// What it gives an agent; nothing where the agent is not heard.
    pub fn row(&self, agent: &str) -> Option<&ModeRow> {
        self.rows.iter().find(|row| row.agent.as_str() == agent)
    }
}

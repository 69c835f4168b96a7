//! What every message carries besides its payload.

use crate::time::Time;

/// What sort of thing a message is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Category {
    /// A reading or a state, sent because time went on.
    #[default]
    Data = 0,
    /// A wish that something be done.
    Command = 1,
    /// A call of a service.
    Call = 2,
    /// The answer to a call.
    Answer = 3,
    /// Something happened.
    Event = 4,
}

impl Category {
    /// All categories.
    pub const ALL: [Category; 5] =
        [Category::Data, Category::Command, Category::Call, Category::Answer, Category::Event];

    /// Its name in files and on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            Category::Data => "data",
            Category::Command => "command",
            Category::Call => "call",
            Category::Answer => "answer",
            Category::Event => "event",
        }
    }

    /// The category with this name.
    pub fn named(name: &str) -> Option<Category> {
        Category::ALL.into_iter().find(|category| category.name() == name)
    }
}

/// How urgent a message is; greater goes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Priority {
    /// After everything else.
    Low = 0,
    /// As most messages are.
    #[default]
    Normal = 1,
    /// Before what is normal.
    High = 2,
    /// Before everything else.
    Urgent = 3,
}

impl Priority {
    /// All priorities, the most urgent first.
    pub const ALL: [Priority; 4] = [Priority::Urgent, Priority::High, Priority::Normal, Priority::Low];

    /// Its name in files and on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            Priority::Low => "low",
            Priority::Normal => "normal",
            Priority::High => "high",
            Priority::Urgent => "urgent",
        }
    }

    /// The priority with this name.
    pub fn named(name: &str) -> Option<Priority> {
        Priority::ALL.into_iter().find(|priority| priority.name() == name)
    }
}

/// The number by which the router knows an agent. Numbers are not used again while a system runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct AgentId(pub u32);

impl AgentId {
    /// No agent: for a message that is for everybody, or that nobody in the system sent.
    pub const NONE: AgentId = AgentId(u32::MAX);
}

/// How good a result is: 255 is the best that its sender can do, and what everybody sends who says nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Quality(pub u8);

impl Quality {
    /// The best that its sender can do.
    pub const FULL: Quality = Quality(u8::MAX);

    /// From a share, 0 to 1, to the nearest step; what is no number is nothing.
    pub fn of(share: f64) -> Quality {
        Quality((share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
    }

    /// As a share, from 0 to 1.
    pub fn share(self) -> f64 {
        f64::from(self.0) / 255.0
    }
}

impl Default for Quality {
    fn default() -> Quality {
        Quality::FULL
    }
}

/// What every message carries besides its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Header {
    /// The time that the message speaks of; by default the time of the step that sent it.
    pub stamp: Time,
    /// Counts the messages of one output from zero.
    pub sequence: u64,
    /// Until when the message is of use; [`Time::NEVER`] when it always is.
    pub deadline: Time,
    /// Who sent it.
    pub sender: AgentId,
    /// Whom it is for; [`AgentId::NONE`] when it is for everybody.
    pub recipient: AgentId,
    /// Free for the agents' own use: a filter can choose by it. Ties an answer to its call.
    pub marker: u32,
    /// What sort of thing it is.
    pub category: Category,
    /// How urgent it is.
    pub priority: Priority,
    /// How good the result is that it brings.
    pub quality: Quality,
}

impl Default for Header {
    fn default() -> Header {
        Header {
            stamp: Time::ZERO,
            sequence: 0,
            deadline: Time::NEVER,
            sender: AgentId::NONE,
            recipient: AgentId::NONE,
            marker: 0,
            category: Category::Data,
            priority: Priority::Normal,
            quality: Quality::FULL,
        }
    }
}

/// A choice of messages by their header, made where they are sent: what it refuses never leaves the sender.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Filter {
    /// Only this category.
    pub category: Option<Category>,
    /// Only this priority or a higher one.
    pub least_priority: LeastPriority,
    /// Only this marker.
    pub marker: Option<u32>,
    /// Only messages for this recipient, or for everybody.
    pub recipient: Option<AgentId>,
    /// Only every n-th message that the rest lets through; 0 and 1 let all through.
    pub every: u32,
}

/// A least priority whose default lets all through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeastPriority(pub Priority);

impl Default for LeastPriority {
    fn default() -> LeastPriority {
        LeastPriority(Priority::Low)
    }
}

impl Filter {
    /// Lets everything through.
    pub const ALL: Filter = Filter {
        category: None,
        least_priority: LeastPriority(Priority::Low),
        marker: None,
        recipient: None,
        every: 0,
    };

    /// Whether the header passes. `every` is not looked at: it needs a count, which the route keeps.
    #[inline]
    pub fn passes(&self, header: &Header) -> bool {
        self.category.is_none_or(|category| category == header.category)
            && header.priority >= self.least_priority.0
            && self.marker.is_none_or(|marker| marker == header.marker)
            && self.recipient.is_none_or(|to| to == header.recipient || header.recipient == AgentId::NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quality_is_a_share_to_one_step() {
        for (share, step) in [(0.0, 0), (1.0, 255), (0.6, 153), (2.0, 255), (-1.0, 0), (f64::NAN, 0)] {
            assert_eq!(Quality::of(share), Quality(step), "{share}");
        }
        assert!((Quality::of(0.37).share() - 0.37).abs() <= 0.5 / 255.0);
    }

    #[test]
    fn the_filter_for_all_passes_all_and_others_choose() {
        let header =
            Header { category: Category::Event, priority: Priority::Low, marker: 7, ..Header::default() };
        assert!(Filter::ALL.passes(&header) && Filter::default().passes(&header));
        assert!(!Filter { category: Some(Category::Data), ..Filter::ALL }.passes(&header));
        assert!(!Filter { least_priority: LeastPriority(Priority::High), ..Filter::ALL }.passes(&header));
        assert!(Filter { marker: Some(7), ..Filter::ALL }.passes(&header));
        assert!(
            Filter { recipient: Some(AgentId(1)), ..Filter::ALL }.passes(&header),
            "for everybody is for me too"
        );
        let for_two = Header { recipient: AgentId(2), ..header };
        assert!(!Filter { recipient: Some(AgentId(1)), ..Filter::ALL }.passes(&for_two));
    }
}

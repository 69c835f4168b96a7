//! The log of a run: an MCAP file of profile `ros2`, which the field's viewers and ROS 2's own tools open.
//!
//! ```text
//! header         profile "ros2", library "sinew"
//! metadata       "sinew": name, seed and clock of the run
//! attachment     "plan.toml": the system file
//! chunk          every half second of run time: schemas, channels, and pairs of
//!                  /sinew/headers  what came with the message: sender, sequence, deadline, marker, priority …
//!                  TOPIC           the message, the bytes as ROS 2 defines them
//! …
//! summary        index and counts, written at the end
//! ```
//!
//! A chunk reaches the disk in one piece when it closes, so a run that is killed, and a disk that is full, cost at most the
//! last half second. Such a file lacks its summary: [`Reader`] reads it all the same, [`repair`] makes a whole one of it.
//! The bytes depend on the messages alone: no host time, path or version of a library is in them.

mod disk;
mod info;
mod pieces;
mod reader;
mod records;
mod repair;
mod writer;

use std::collections::BTreeMap;

pub use disk::Sink;
pub use info::{Info, TopicInfo, info};
pub use pieces::{Cause, Damage};
pub use reader::{Channel, DecodeError, Message, ReadError, Reader};
pub use records::{HEADERS, ROSOUT, Severity, message_header, rosout_log};
pub use repair::{RepairError, Repaired, repair};
pub use writer::{ChannelId, Tally, WriteError, Writer};

/// What drove the clock of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// Simulated time, from zero.
    #[default]
    Simulated,
    /// The wall clock, from the Unix epoch.
    Wall,
}

impl Clock {
    /// Its name in files and on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            Clock::Simulated => "sim",
            Clock::Wall => "wall",
        }
    }
}

/// What a log says about its run as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunInfo {
    /// The name of the system.
    pub system: String,
    /// From what chance was drawn; nothing where no chance was.
    pub seed: Option<u64>,
    /// What drove the clock.
    pub clock: Clock,
    /// The system file.
    pub plan: String,
    /// Anything else, by name: the numbers of the agents, say. Keep host time and paths out of it in a simulated run, whose
    /// log is the same bytes each time.
    pub notes: BTreeMap<String, String>,
}

/// Name of the record that holds the run's data.
const METADATA: &str = "sinew";
/// Name of the attachment that holds the system file.
const PLAN: &str = "plan.toml";
/// In front of the names of [`RunInfo::notes`].
const NOTE: &str = "note.";

impl RunInfo {
    fn to_metadata(&self) -> BTreeMap<String, String> {
        let mut map: BTreeMap<String, String> =
            self.notes.iter().map(|(name, text)| (format!("{NOTE}{name}"), text.clone())).collect();
        map.insert("system".into(), self.system.clone());
        map.insert("clock".into(), self.clock.name().into());
        if let Some(seed) = self.seed {
            map.insert("seed".into(), seed.to_string());
        }
        map
    }

    /// All but the plan, which is an attachment of its own.
    fn from_metadata(map: &BTreeMap<String, String>) -> RunInfo {
        let note =
            |(name, text): (&String, &String)| Some((name.strip_prefix(NOTE)?.to_owned(), text.clone()));
        RunInfo {
            system: map.get("system").cloned().unwrap_or_default(),
            seed: map.get("seed").and_then(|seed| seed.parse().ok()),
            clock: if map.get("clock").is_some_and(|clock| clock == "wall") {
                Clock::Wall
            } else {
                Clock::Simulated
            },
            plan: String::new(),
            notes: map.iter().filter_map(note).collect(),
        }
    }
}

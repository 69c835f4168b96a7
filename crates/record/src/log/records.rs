//! The log's own messages: the header of each message, and notes to people.

use types::cdr::{Error, Reader, Writer};
use types::definition::{Definition, Kind};
use types::header::Quality;
use types::message::ros;
use types::{AgentId, Category, Header, Priority, Time};

/// The topic of the headers.
pub const HEADERS: &str = "/sinew/headers";
/// The topic of notes to people, by its name in ROS 2.
pub const ROSOUT: &str = "/rosout";

/// How serious a note is; the numbers are those of `rcl_interfaces/msg/Log`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Severity {
    /// Of interest to those who look for a mistake.
    Debug = 10,
    /// As it should be.
    Info = 20,
    /// Not as it should be, but the run goes on as well as before.
    Warning = 30,
    /// Something failed.
    Error = 40,
    /// The run ends.
    Fatal = 50,
}

/// `sinew_msgs/msg/MessageHeader`: what came with a message besides its bytes. Stands in front of it in the log.
///
/// Times are whole nanoseconds, because `builtin_interfaces/Time` ends in 2038 and a deadline may be never (2⁶³ − 1).
pub fn message_header() -> Definition {
    Definition::new(
        "sinew_msgs/msg/MessageHeader",
        [
            ("channel", Kind::U16),
            ("category", Kind::U8),
            ("priority", Kind::U8),
            ("marker", Kind::U32),
            ("sequence", Kind::U64),
            ("stamp_nanoseconds", Kind::I64),
            ("deadline_nanoseconds", Kind::I64),
            ("sender", Kind::U32),
            ("recipient", Kind::U32),
            ("quality", Kind::U8),
        ],
    )
}

/// `rcl_interfaces/msg/Log`, without its constants.
pub fn rosout_log() -> Definition {
    Definition::new(
        "rcl_interfaces/msg/Log",
        [
            ("stamp", Kind::Struct(ros::time())),
            ("level", Kind::U8),
            ("name", Kind::String),
            ("msg", Kind::String),
            ("file", Kind::String),
            ("function", Kind::String),
            ("line", Kind::U32),
        ],
    )
}

pub(super) fn write_header(channel: u16, header: &Header, out: &mut Writer) {
    out.clear();
    out.put(channel).put(header.category as u8).put(header.priority as u8).put(header.marker);
    out.put(header.sequence).put(header.stamp.0).put(header.deadline.0);
    out.put(header.sender.0).put(header.recipient.0).put(header.quality.0);
}

/// The channel that a header belongs to, and the header.
pub(super) fn read_header(cdr: &[u8]) -> Result<(u16, Header), Error> {
    let mut input = Reader::new(cdr)?;
    let channel = input.get()?;
    let at = input.offset();
    let (category, priority): (u8, u8) = (input.get()?, input.get()?);
    let category = Category::ALL.into_iter().find(|c| *c as u8 == category).ok_or(Error::NoSuchValue(at))?;
    let priority =
        Priority::ALL.into_iter().find(|p| *p as u8 == priority).ok_or(Error::NoSuchValue(at + 1))?;
    let (marker, sequence) = (input.get()?, input.get()?);
    let (stamp, deadline) = (Time(input.get()?), Time(input.get()?));
    let (sender, recipient) = (AgentId(input.get()?), AgentId(input.get()?));
    // Logs of before it was there end here.
    let quality = input.get().map_or(Quality::FULL, Quality);
    Ok((
        channel,
        Header { stamp, sequence, deadline, sender, recipient, marker, category, priority, quality },
    ))
}

pub(super) fn write_note(stamp: Time, severity: Severity, name: &str, text: &str, out: &mut Writer) {
    out.clear();
    out.time(stamp);
    out.put(severity as u8);
    for part in [name, text, "", ""] {
        // A zero ends a text for other programs.
        out.text(part.split('\0').next().unwrap_or_default());
    }
    out.put(0u32);
}

//! One grammar for the command line, `[[at]]` and scripts: a request in words, and back.
//!
//! ```text
//! add NAME is KIND [robot=…] [period=…] [on=a,b] [deadline=…] … [KEY=VALUE…]
//! add NAME is queue [depth=N] [overload=POLICY]
//! remove NAME            restart NAME           replace NAME is KIND [KEY=VALUE…]
//! wire FROM TO [depth=N] [overload=POLICY] [every=N] [priority=LEAST] [marker=N] [category=…] [recipient=AGENT] [serving=N]
//! unwire FROM TO         set NAME KEY=VALUE…    fault TARGET KIND
//! send PORT cdr=HEX      call SERVICE cdr=HEX [within=2s]      quit
//! ```
//!
//! Several requests with a `;` between them are one: they are done together or not at all. So is a `set` of several keys.

mod line;
mod read;
mod value;
mod write;

pub use line::{join, split};
pub(crate) use read::Pairs;
pub use read::parse;
pub use value::{read_value, write_value};
pub use write::words_of;

/// A command, how it is written, and what it does.
#[derive(Clone, Copy, Debug)]
pub struct Usage {
    /// Its first word.
    pub verb: &'static str,
    /// How it is written.
    pub form: &'static str,
    /// What it does.
    pub does: &'static str,
}

const fn usage(verb: &'static str, form: &'static str, does: &'static str) -> Usage {
    Usage { verb, form, does }
}

/// The requests that change a running system: what [`parse`] reads.
pub const CHANGES: [Usage; 13] = [
    usage("add", "add NAME is KIND [robot=…] [period=…] [on=…] [KEY=VALUE…]", "adds an agent"),
    usage("add", "add NAME is queue [depth=N] [overload=…]", "adds a queue"),
    usage("remove", "remove NAME", "removes an agent and its wires; or a queue that nobody needs"),
    usage("restart", "restart NAME", "starts an agent anew"),
    usage("replace", "replace NAME is KIND [KEY=VALUE…]", "puts another agent in the place of one"),
    usage(
        "wire",
        "wire FROM TO [depth=N] [overload=…] [every=N] [priority=…] [marker=N] [category=…] [serving=N]",
        "makes a wire",
    ),
    usage("unwire", "unwire FROM TO", "cuts a wire, when what is on it has arrived"),
    usage(
        "set",
        "set NAME KEY=VALUE…",
        "sets parameters, or the period, deadline, min_gap, wake_gap, cost, method, budget, importance or suspended=true",
    ),
    usage("fault", "fault AGENT|OUTPUT KIND", "makes an agent or an output misbehave; \"ok\" ends it"),
    usage("send", "send PORT cdr=HEX", "sends a message out of a port"),
    usage("call", "call SERVICE cdr=HEX [within=2s]", "calls a service, and does not wait for the answer"),
    usage("force", "force add|set|wire …", "does it also where deadlines are missed by it"),
    usage("quit", "quit", "ends the run"),
];

/// What stands between requests that are done together or not at all.
pub const AND: &str = ";";

/// Pairs of a request, and rows of a table in a value, at most: each is compared with all before it, and people type ten.
pub(crate) const MOST_PAIRS: usize = 4096;

/// The keys of `wire`.
pub(crate) const WIRE_KEYS: [&str; 8] =
    ["depth", "overload", "every", "priority", "marker", "category", "recipient", "serving"];

/// What stands in the place of a type of agent where a queue is added.
pub(crate) const QUEUE: &str = "queue";

#[cfg(test)]
mod tests;

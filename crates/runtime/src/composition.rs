//! What a system is made of, as its agents see it.
//!
//! The control side makes one whenever something has changed, and never changes it again. An agent gets it between two of its steps; so a
//! step sees one state of the system from its beginning to its end, reads it with plain loads, and frees nothing of it.

use std::sync::Arc;

use types::{AgentId, Message};

use crate::agent::PortInfo;
use crate::message_type::MessageType;
use crate::port::Direction;
use crate::request::AgentState;

/// So many of those who left are remembered.
const REMEMBERED: usize = 256;

/// What a system is made of: its agents with their ports, its queues and its wires.
///
/// Look-ups by name or number take the logarithm of the number of agents; those by message type look at every port. Who asks only
/// [when there is news](crate::Router::news) asks seldom enough.
#[derive(Clone, Debug, Default)]
pub struct Composition {
    version: u64,
    /// By name.
    members: Vec<Arc<MemberRow>>,
    /// By number, with their places in `members`.
    by_id: Vec<(AgentId, u32)>,
    queues: Vec<QueueRow>,
    /// In the order of senders, then of receivers.
    wires: Vec<WireRow>,
    /// The last who left, the longest gone first.
    left: Vec<Left>,
}

#[derive(Debug)]
struct MemberRow {
    id: AgentId,
    name: String,
    kind: &'static str,
    doc: &'static str,
    state: AgentState,
    ports: Vec<PortInfo>,
    joined: u64,
}

#[derive(Clone, Debug, PartialEq)]
struct QueueRow {
    name: String,
    message: Option<&'static MessageType>,
}

/// A port by the number of its agent and its place there; a queue by its place among the queues.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum EndRow {
    Port(PortAt),
    Queue(u32),
}

/// From where to where.
pub(crate) type WireRow = (EndRow, EndRow);

/// An agent that is gone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Left {
    /// Its number, which nobody gets again.
    pub id: AgentId,
    /// Its name, which another may have by now.
    pub name: Arc<str>,
    /// The version from which on it is gone.
    pub version: u64,
}

/// A port as a number: it can be kept from step to step, and asked for when its agent is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PortAt {
    /// Whose.
    pub agent: AgentId,
    /// Its place among the ports of the agent, in the order of their declaration.
    pub port: u16,
}

impl Composition {
    /// What a system without anybody is made of.
    pub(crate) const EMPTY: Composition = Composition {
        version: 0,
        members: Vec::new(),
        by_id: Vec::new(),
        queues: Vec::new(),
        wires: Vec::new(),
        left: Vec::new(),
    };

    /// A number that grows with every change.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// All agents, by name.
    pub fn members(&self) -> impl ExactSizeIterator<Item = Member<'_>> {
        self.members.iter().map(|row| Member { row })
    }

    /// The agent of this name.
    pub fn member(&self, name: &str) -> Option<Member<'_>> {
        let at = self.members.binary_search_by(|row| row.name.as_str().cmp(name)).ok()?;
        Some(Member { row: &self.members[at] })
    }

    /// The agent of this number; nothing when it is gone.
    pub fn member_at(&self, id: AgentId) -> Option<Member<'_>> {
        let at = self.by_id.binary_search_by_key(&id, |(id, _)| *id).ok()?;
        self.members.get(self.by_id[at].1 as usize).map(|row| Member { row })
    }

    /// The port of this name, as in `sonar.filtered`.
    pub fn port(&self, name: &str) -> Option<PortSeen<'_>> {
        let (agent, port) = name.rsplit_once('.')?;
        self.member(agent)?.port(port)
    }

    /// The port of this number; nothing when its agent is gone.
    pub fn port_at(&self, at: PortAt) -> Option<PortSeen<'_>> {
        self.member_at(at.agent)?.ports().nth(usize::from(at.port))
    }

    /// All ports, by the names of their agents and in the order of their declaration.
    pub fn ports(&self) -> impl Iterator<Item = PortSeen<'_>> {
        self.members().flat_map(Member::ports)
    }

    /// All outputs that send messages of type `T`.
    pub fn outputs<T: Message>(&self) -> impl Iterator<Item = PortSeen<'_>> {
        let sends = Some(MessageType::of::<T>());
        self.ports().filter(move |port| port.is(Direction::Output) && port.info().shape.output == sends)
    }

    /// All inputs that take messages of type `T`.
    pub fn inputs<T: Message>(&self) -> impl Iterator<Item = PortSeen<'_>> {
        let takes = Some(MessageType::of::<T>());
        self.ports().filter(move |port| port.is(Direction::Input) && port.info().shape.input == takes)
    }

    /// All services that answer questions of type `Q` with answers of type `A`.
    pub fn services<Q: Message, A: Message>(&self) -> impl Iterator<Item = PortSeen<'_>> {
        let (question, answer) = (Some(MessageType::of::<Q>()), Some(MessageType::of::<A>()));
        self.ports().filter(move |port| {
            let shape = &port.info().shape;
            port.is(Direction::Service) && shape.input == question && shape.output == answer
        })
    }

    /// All queues.
    pub fn queues(&self) -> impl ExactSizeIterator<Item = QueueSeen<'_>> {
        self.queues.iter().map(|row| QueueSeen { row })
    }

    /// All wires, those to and from queues too.
    pub fn wires(&self) -> impl Iterator<Item = WireSeen<'_>> {
        self.wires.iter().filter_map(|(from, to)| {
            let (from, to) = (self.end(*from)?, self.end(*to)?);
            Some(WireSeen { from, to })
        })
    }

    fn end(&self, row: EndRow) -> Option<End<'_>> {
        match row {
            EndRow::Port(at) => self.port_at(at).map(End::Port),
            EndRow::Queue(at) => self.queues.get(at as usize).map(|row| End::Queue(QueueSeen { row })),
        }
    }

    /// Whether a wire leads from one port to another without a queue between.
    pub fn is_wired(&self, from: PortAt, to: PortAt) -> bool {
        self.wires.binary_search(&(EndRow::Port(from), EndRow::Port(to))).is_ok()
    }

    /// Who has come since the system was as in that version.
    pub fn joined_since(&self, version: u64) -> impl Iterator<Item = Member<'_>> {
        self.members().filter(move |member| member.row.joined > version)
    }

    /// Who has gone since then, the longest gone first; of the last 256 who went. Who came and went since then is among them.
    pub fn left_since(&self, version: u64) -> impl Iterator<Item = &Left> {
        self.left.iter().filter(move |left| left.version > version)
    }
}

/// An agent as others see it.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    row: &'a MemberRow,
}

impl<'a> Member<'a> {
    /// Its number.
    pub fn id(self) -> AgentId {
        self.row.id
    }

    /// Its name.
    pub fn name(self) -> &'a str {
        &self.row.name
    }

    /// Its type, as system files name it.
    pub fn kind(self) -> &'static str {
        self.row.kind
    }

    /// What the type does.
    pub fn doc(self) -> &'static str {
        self.row.doc
    }

    /// How it is.
    pub fn state(self) -> AgentState {
        self.row.state
    }

    /// The version from which on it is there.
    pub fn joined(self) -> u64 {
        self.row.joined
    }

    /// Its ports, in the order of their declaration.
    pub fn ports(self) -> impl ExactSizeIterator<Item = PortSeen<'a>> {
        (0..self.row.ports.len()).map(move |at| PortSeen { row: self.row, at })
    }

    /// Its port of this name.
    pub fn port(self, name: &str) -> Option<PortSeen<'a>> {
        self.ports().find(|port| port.name() == name)
    }
}

/// A port as others see it.
#[derive(Clone, Copy, Debug)]
pub struct PortSeen<'a> {
    row: &'a MemberRow,
    at: usize,
}

impl<'a> PortSeen<'a> {
    /// Whose it is.
    pub fn agent(self) -> Member<'a> {
        Member { row: self.row }
    }

    /// Its name, without that of the agent.
    pub fn name(self) -> &'static str {
        self.info().name
    }

    /// What is known of it: what it is for, which way messages go, of which types.
    pub fn info(self) -> &'a PortInfo {
        &self.row.ports[self.at]
    }

    /// Its number.
    pub fn at(self) -> PortAt {
        PortAt { agent: self.row.id, port: self.at as u16 }
    }

    fn is(self, direction: Direction) -> bool {
        self.info().shape.direction == direction
    }
}

/// A queue as others see it.
#[derive(Clone, Copy, Debug)]
pub struct QueueSeen<'a> {
    row: &'a QueueRow,
}

impl<'a> QueueSeen<'a> {
    /// Its name.
    pub fn name(self) -> &'a str {
        &self.row.name
    }

    /// What it holds; nothing before anybody is wired to it.
    pub fn message(self) -> Option<&'static MessageType> {
        self.row.message
    }
}

/// Where a wire begins or ends.
#[derive(Clone, Copy, Debug)]
pub enum End<'a> {
    /// At a port.
    Port(PortSeen<'a>),
    /// At a queue.
    Queue(QueueSeen<'a>),
}

impl<'a> End<'a> {
    /// The port, where it is one.
    pub fn port(self) -> Option<PortSeen<'a>> {
        match self {
            End::Port(port) => Some(port),
            End::Queue(_) => None,
        }
    }
}

/// A wire as agents see it.
#[derive(Clone, Copy, Debug)]
pub struct WireSeen<'a> {
    /// From where.
    pub from: End<'a>,
    /// To where.
    pub to: End<'a>,
}

/// An agent on its way into a composition.
pub(crate) struct NewMember<'a> {
    pub id: AgentId,
    pub name: &'a str,
    pub kind: &'static str,
    pub doc: &'static str,
    pub state: AgentState,
    pub ports: &'a [PortInfo],
}

/// What a composition is put together from.
pub(crate) struct Parts<'a> {
    pub members: Vec<NewMember<'a>>,
    pub queues: Vec<(&'a str, Option<&'static MessageType>)>,
    pub wires: Vec<WireRow>,
}

impl Composition {
    /// What comes after this one; nothing when nothing is different. What is the same in both is shared.
    pub(crate) fn next(&self, parts: Parts<'_>) -> Option<Composition> {
        let Parts { members: mut new, queues, mut wires } = parts;
        new.sort_unstable_by(|a, b| a.name.cmp(b.name));
        wires.sort_unstable();
        let version = self.version + 1;
        let members: Vec<Arc<MemberRow>> = new.iter().map(|new| self.row_of(new, version)).collect();
        let queues: Vec<QueueRow> =
            queues.into_iter().map(|(name, message)| QueueRow { name: name.to_owned(), message }).collect();
        let same = self.members.len() == members.len()
            && self.members.iter().zip(&members).all(|(a, b)| Arc::ptr_eq(a, b));
        if same && self.queues == queues && self.wires == wires && self.version > 0 {
            return None;
        }
        let mut by_id: Vec<(AgentId, u32)> =
            members.iter().enumerate().map(|(at, row)| (row.id, at as u32)).collect();
        by_id.sort_unstable();
        let mut left = self.left.clone();
        let is_there = |row: &&Arc<MemberRow>| by_id.binary_search_by_key(&row.id, |(id, _)| *id).is_err();
        left.extend(self.members.iter().filter(is_there).map(|row| Left {
            id: row.id,
            name: row.name.as_str().into(),
            version,
        }));
        left.drain(..left.len().saturating_sub(REMEMBERED));
        Some(Composition { version, members, by_id, queues, wires, left })
    }

    /// The row of an agent: the one that is here already, unless it is another agent or has changed.
    fn row_of(&self, new: &NewMember<'_>, version: u64) -> Arc<MemberRow> {
        let known = self.by_id.binary_search_by_key(&new.id, |(id, _)| *id).ok();
        let known = known.map(|at| &self.members[self.by_id[at].1 as usize]);
        if let Some(known) = known
            && (known.kind, known.state) == (new.kind, new.state)
        {
            return known.clone();
        }
        Arc::new(MemberRow {
            id: new.id,
            name: new.name.to_owned(),
            kind: new.kind,
            doc: new.doc,
            state: new.state,
            ports: new.ports.to_vec(),
            joined: known.map_or(version, |known| known.joined),
        })
    }
}

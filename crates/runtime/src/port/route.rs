//! One wire, as the sender's thread knows it.

use std::sync::Arc;

use types::{Filter, Header, Message, Priority};

use super::{Parcel, Target, WireCounts, WireId, count};
use crate::context::Context;
use crate::fetch::fetch;
use crate::memory::Link;
use crate::queue;
use crate::ring::{self, Overload, Pushed};

/// What became of a message, wire by wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// Wires that took it.
    pub taken: u32,
    /// Wires that gave it back because they were full.
    pub refused: u32,
}

/// The sending end of a wire.
pub(super) struct Route<T: Message> {
    pub(super) target: Target,
    pub(super) counts: Arc<WireCounts>,
    pub(super) overload: Overload,
    /// Whether its filter lets all through, and it is open.
    takes_all: bool,
    /// Whether it is closed for a message that is for another who was chosen.
    closed: bool,
    pub(super) wire: WireId,
    filter: Filter,
    passed: u32,
    /// It goes last: while somebody counts here, the places of a queue are not given to others.
    pub(super) way: Way<T>,
}

/// Where a message is put: rings of values or of links, one for each priority that the output uses, or a queue.
pub(super) enum Way<T: Message> {
    /// Most outputs use one priority.
    Value(ring::Sender<Parcel<T>>),
    Values(Vec<(Priority, ring::Sender<Parcel<T>>)>),
    Link(ring::Sender<Parcel<Link>>),
    Links(Vec<(Priority, ring::Sender<Parcel<Link>>)>),
    Queue(Box<queue::Sender<Parcel<T>>>),
}

impl<T: Message> Route<T> {
    pub(super) fn new(
        wire: WireId,
        filter: Filter,
        overload: Overload,
        target: Target,
        counts: Arc<WireCounts>,
        way: Way<T>,
    ) -> Route<T> {
        let mut route =
            Route { target, counts, overload, takes_all: false, closed: false, wire, filter, passed: 0, way };
        route.close(false);
        route
    }

    /// Closes it for what is sent now, or opens it again.
    pub(super) fn close(&mut self, closed: bool) {
        let all = self.filter.every <= 1 && Filter { every: 0, ..self.filter } == Filter::ALL;
        (self.closed, self.takes_all) = (closed, all && !closed);
    }

    /// Whether it takes all messages as they are, with one priority.
    pub(super) fn is_plain(&self) -> bool {
        self.takes_all && matches!(self.way, Way::Value(_) | Way::Link(_))
    }

    pub(super) fn leads_to_queue(&self) -> bool {
        matches!(self.way, Way::Queue(_))
    }

    /// Has fetched what the next message touches.
    pub(super) fn fetch(&self) {
        fetch(&raw const *self.counts, 1);
        match &self.way {
            Way::Value(ring) => ring.fetch(),
            Way::Link(ring) => ring.fetch(),
            Way::Values(_) | Way::Links(_) | Way::Queue(_) => {}
        }
    }

    #[inline]
    pub(super) fn lets_pass(&mut self, header: &Header) -> bool {
        self.takes_all || self.filter_passes(header)
    }

    fn filter_passes(&mut self, header: &Header) -> bool {
        if self.closed || !self.filter.passes(header) {
            return false;
        }
        if self.filter.every > 1 {
            self.passed = (self.passed + 1) % self.filter.every;
            return self.passed == 1;
        }
        true
    }

    #[inline]
    pub(super) fn put_value(
        &mut self,
        header: &Header,
        fill: impl FnOnce(&mut T),
        sent: &mut Sent,
        context: Option<&Context>,
    ) {
        let ring = match &mut self.way {
            Way::Value(ring) => Some(ring),
            Way::Values(rings) => lane_for(rings, header.priority),
            Way::Link(_) | Way::Links(_) | Way::Queue(_) => None,
        };
        let pushed = match ring {
            Some(ring) => ring.push(|parcel| {
                parcel.header = *header;
                fill(&mut parcel.payload);
            }),
            None => self.put_queued(header, fill, context),
        };
        *sent = self.account(pushed, *sent, context);
    }

    pub(super) fn put_link(
        &mut self,
        header: &Header,
        link: Link,
        sent: &mut Sent,
        context: Option<&Context>,
    ) {
        let ring = match &mut self.way {
            Way::Link(ring) => Some(ring),
            Way::Links(rings) => lane_for(rings, header.priority),
            _ => None,
        };
        let pushed = match ring {
            Some(ring) => ring.push(|parcel| *parcel = Parcel { header: *header, payload: link }),
            None => Pushed::Full,
        };
        *sent = self.account(pushed, *sent, context);
    }

    #[inline(always)]
    pub(super) fn account(&mut self, pushed: Pushed, mut sent: Sent, context: Option<&Context>) -> Sent {
        match pushed {
            Pushed::Stored => {}
            Pushed::Displaced => count(&self.counts.displaced),
            Pushed::Full if self.overload == Overload::Refuse => {
                count(&self.counts.refused);
                sent.refused += 1;
                return sent;
            }
            Pushed::Full => {
                count(&self.counts.dropped);
                return sent;
            }
        }
        count(&self.counts.sent);
        sent.taken += 1;
        let target = &self.target;
        if target.wakes
            && let Some(context) = context
        {
            context.wake(target.executor, target.slot, &target.door);
        }
        sent
    }
}

/// The ring for a priority: its own, or the next lower one that the output declares, or the lowest.
#[inline]
fn lane_for<P>(
    lanes: &mut [(Priority, ring::Sender<Parcel<P>>)],
    priority: Priority,
) -> Option<&mut ring::Sender<Parcel<P>>> {
    if let [(_, only)] = lanes {
        return Some(only);
    }
    let at = lanes.iter().position(|(lane, _)| *lane <= priority).unwrap_or(lanes.len().checked_sub(1)?);
    Some(&mut lanes[at].1)
}

//! What an output keeps back until the end of a step that takes time on a virtual processor.

use types::{AgentId, Header, Message};

use super::chosen::Closed;
use super::{OutputCore, OutputInner, Sent};
use crate::allocations::not_counted;
use crate::context::current;

/// Messages that were sent and are not to be seen yet, in their order.
pub(super) struct Held<T: Message> {
    messages: Vec<Kept<T>>,
    /// The one agent for whom the message is that is being sent.
    pub(super) chosen: Option<AgentId>,
}

struct Kept<T: Message> {
    header: Header,
    chosen: Option<AgentId>,
    head: T,
    row: Vec<T::Element>,
}

impl<T: Message> OutputCore<T> {
    pub(super) fn keep_back(&self) {
        let inner = self.inner();
        if inner.held.is_none() {
            inner.held = Some(Box::new(Held { messages: Vec::new(), chosen: None }));
            inner.changed();
        }
    }

    #[inline(never)]
    pub(super) fn hold_back(
        &self,
        inner: &mut OutputInner<T>,
        header: &Header,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
    ) -> Sent {
        if inner.routes.is_empty() && !self.logs(header.sequence) {
            return Sent::default();
        }
        let mut row = not_counted(|| vec![T::Element::default(); self.rows]);
        let mut head = T::default();
        let len = fill(&mut head, &mut row).min(row.len());
        row.truncate(len);
        if let Some(held) = &mut inner.held {
            let kept = Kept { header: *header, chosen: held.chosen, head, row };
            not_counted(|| held.messages.push(kept));
        }
        Sent::default()
    }

    /// Sends what was kept back, by the way that it would have gone.
    pub(super) fn send_held(&self) {
        let Some(held) = self.inner().held.take() else { return };
        self.inner().changed();
        for Kept { header, chosen, head, row } in held.messages {
            let _closed = chosen.map(|agent| Closed::all_but(agent, self));
            let put = |place: &mut T, room: &mut [T::Element]| {
                *place = head;
                let len = row.len().min(room.len());
                room[..len].copy_from_slice(&row[..len]);
                len
            };
            self.send_any(&header, put, current());
        }
    }
}

//! Sending to one of those who are wired to an output.

use types::cdr::NoElement;
use types::{AgentId, Message};

use super::{Envelope, Output, OutputCore, Sent};

impl<T: Message> Output<T> {
    /// Sends a small message to one agent alone, of those who are wired to this output. Nothing took it and nothing refused it when no wire
    /// leads there, or when its filter lets nothing of the kind pass. What is put into a queue is for whoever takes it: no wire to a
    /// queue is chosen.
    ///
    /// The agent's number is that in the header of what it sends, or [`Step::agent_named`](crate::Step::agent_named) tells it.
    pub fn send_to(&mut self, agent: AgentId, message: T) -> Sent
    where
        T: Message<Element = NoElement>,
    {
        self.fill_to(agent, Envelope::default(), |place, _| {
            *place = message;
            0
        })
    }

    /// The same for a message that is filled in place, with an envelope of its own; whom that names does not matter.
    pub fn fill_to(
        &mut self,
        agent: AgentId,
        envelope: Envelope,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
    ) -> Sent {
        match &self.core {
            Some(core) if agent != AgentId::NONE => core.send_to(agent, envelope, fill),
            _ => Sent::default(),
        }
    }
}

impl<T: Message> OutputCore<T> {
    #[inline(never)]
    fn send_to(
        &self,
        agent: AgentId,
        envelope: Envelope,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
    ) -> Sent {
        let _closed = Closed::all_but(agent, self);
        self.send(Envelope { recipient: agent, ..envelope }, fill)
    }
}

/// The routes that lead to others than the one who was chosen, closed until this goes: also when what fills the message panics.
pub(super) struct Closed<'a, T: Message>(&'a OutputCore<T>);

impl<'a, T: Message> Closed<'a, T> {
    pub(super) fn all_but(agent: AgentId, core: &'a OutputCore<T>) -> Closed<'a, T> {
        let inner = core.inner();
        inner.routes.iter_mut().for_each(|route| route.close(route.target.agent != agent));
        // Filters are asked.
        inner.is_plain = false;
        if let Some(held) = &mut inner.held {
            held.chosen = Some(agent);
        }
        Closed(core)
    }
}

impl<T: Message> Drop for Closed<'_, T> {
    fn drop(&mut self) {
        let inner = self.0.inner();
        inner.routes.iter_mut().for_each(|route| route.close(false));
        if let Some(held) = &mut inner.held {
            held.chosen = None;
        }
        inner.changed();
    }
}

//! What waits to be written to a client: bounded, so that one who does not read costs nobody anything.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

#[derive(Default)]
struct State {
    lines: VecDeque<Arc<str>>,
    bytes: usize,
    closed: bool,
}

impl State {
    fn push(&mut self, line: Arc<str>) {
        self.bytes += line.len();
        self.lines.push_back(line);
    }
}

/// Lines on the way to one client. Answers wait for room, which keeps the client that asked from asking more; events do not
/// wait, and take only half of the room, so that an answer never waits for a flood of them.
pub(crate) struct Outbox {
    state: Mutex<State>,
    changed: Condvar,
    most: usize,
}

impl Outbox {
    /// Room for about `most` bytes.
    pub(crate) fn new(most: usize) -> Arc<Outbox> {
        Arc::new(Outbox { state: Mutex::default(), changed: Condvar::new(), most })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts an answer in, when there is room. Says whether it will still be written.
    pub(crate) fn put(&self, line: Arc<str>) -> bool {
        let mut state = self.state();
        // One line always has room, else a long one could never be said.
        while !state.closed && state.bytes > 0 && state.bytes + line.len() > self.most {
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        if !state.closed {
            state.push(line);
            self.changed.notify_all();
        }
        !state.closed
    }

    /// Puts an event in, if there is room at once.
    pub(crate) fn offer(&self, line: &Arc<str>) -> bool {
        let mut state = self.state();
        let fits = !state.closed && (state.bytes == 0 || state.bytes + line.len() <= self.most / 2);
        if fits {
            state.push(line.clone());
            self.changed.notify_all();
        }
        fits
    }

    /// Takes the next line, when there is one; nothing when the box is closed and empty.
    pub(crate) fn next(&self) -> Option<Arc<str>> {
        let mut state = self.state();
        loop {
            if let Some(line) = state.lines.pop_front() {
                state.bytes -= line.len();
                self.changed.notify_all();
                return Some(line);
            }
            if state.closed {
                return None;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Lets nothing in any more; what is in it is still written.
    pub(crate) fn close(&self) {
        self.state().closed = true;
        self.changed.notify_all();
    }

    /// Closes it and throws away what is in it: nobody reads.
    pub(crate) fn abandon(&self) {
        let mut state = self.state();
        *state = State { closed: true, ..State::default() };
        self.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_leave_room_for_answers_and_a_closed_box_is_emptied() {
        let outbox = Outbox::new(10);
        let line: Arc<str> = "12345".into();
        assert!(outbox.offer(&line) && !outbox.offer(&line), "events have half of the room");
        assert!(outbox.put(line.clone()), "and answers all of it");
        outbox.close();
        assert!(!outbox.put(line.clone()) && !outbox.offer(&line));
        assert!(outbox.next().is_some() && outbox.next().is_some() && outbox.next().is_none());

        let outbox = Outbox::new(1);
        assert!(outbox.put(line.clone()), "one line always has room");
        outbox.abandon();
        assert!(outbox.next().is_none());
    }
}

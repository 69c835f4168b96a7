//! How the control side gets executors to serve their changes, where each has a thread.

use std::sync::Arc;
use std::time::Duration as HostDuration;

use super::{Cell, PATIENCE};
use crate::door::CHANGES;
use crate::os;
use crate::router::Fabric;

/// Serves changes by waking the executor's thread and waiting for it.
pub(super) struct Threads<'a> {
    cells: &'a [Arc<Cell>],
    /// Since when it is waited.
    since: Option<i64>,
}

impl Threads<'_> {
    pub(super) fn new(cells: &[Arc<Cell>]) -> Threads<'_> {
        Threads { cells, since: None }
    }
}

impl Fabric for Threads<'_> {
    fn ring(&mut self, executor: usize) {
        self.cells[executor].door.ring(CHANGES);
    }

    fn wait(&mut self) -> bool {
        let now = os::monotonic();
        let since = *self.since.get_or_insert(now);
        std::thread::park_timeout(HostDuration::from_micros(20));
        now - since < PATIENCE.0
    }
}

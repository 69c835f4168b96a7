//! A resource manager's own end: it sees how loaded system and computer are, and sets what agents may use.
//!
//! It is for an agent of an ordinary executor: looking takes memory and locks.

use core::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::{Direction, Port, PortEnds, PortOptions, PortShape};
use crate::census::{Census, Given, HostReading, SharedHost};
use crate::fetch::Depth;

/// What stands behind it. It belongs to the router and outlives the agent.
#[derive(Default)]
pub(crate) struct ManagerEnd {
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    /// Counts what all managers ask.
    bell: Arc<AtomicU64>,
    census: Option<Arc<Census>>,
    wants: bool,
    asked: Vec<Asked>,
    host: Option<SharedHost>,
    told: HostReading,
}

/// What a manager has asked for.
#[derive(Clone, Debug)]
pub(crate) struct Asked {
    pub given: Vec<Given>,
    pub cause: String,
}

impl ManagerEnd {
    fn inner(&self) -> std::sync::MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to count at this bell, and to read that computer.
    pub(crate) fn acquaint(&self, bell: &Arc<AtomicU64>, host: Option<SharedHost>) {
        let mut inner = self.inner();
        inner.bell = bell.clone();
        inner.host = host;
    }

    /// What was asked since the last time, and whether a census is wanted.
    pub(crate) fn take(&self) -> (Vec<Asked>, bool) {
        let mut inner = self.inner();
        (core::mem::take(&mut inner.asked), core::mem::take(&mut inner.wants))
    }

    pub(crate) fn tell(&self, census: Census, host: Option<HostReading>) {
        let mut inner = self.inner();
        inner.census = Some(Arc::new(census));
        if let Some(host) = host {
            inner.told = host;
        }
    }
}

/// A resource manager's own end.
///
/// ```
/// use runtime::{Agent, Fault, Given, Manager, Step};
///
/// /// Suspends whoever is called "idle" while anybody misses deadlines.
/// #[derive(Agent)]
/// struct Strict {
///     /// What there is.
///     manager: Manager,
/// }
///
/// impl Agent for Strict {
///     fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
///         let Some(census) = self.manager.look() else { return Ok(()) };
///         let late = census.residents.iter().any(|agent| agent.counts.missed > 0);
///         let idle = Given { agent: "idle".into(), is_suspended: late, ..Given::default() };
///         self.manager.give(vec![idle], "somebody was late".into());
///         Ok(())
///     }
/// }
/// ```
#[derive(Default)]
pub struct Manager {
    end: Option<Arc<ManagerEnd>>,
}

impl Manager {
    /// The system as it was when it was asked for last; and asks for the next. The first time there is none yet.
    pub fn look(&self) -> Option<Arc<Census>> {
        let mut inner = self.end.as_ref()?.inner();
        inner.wants = true;
        // Pairs with the acquire where the control side looks.
        inner.bell.fetch_add(1, Ordering::Release);
        inner.census.clone()
    }

    /// What the computer tells of its load since it was asked last.
    pub fn host(&self) -> HostReading {
        let Some(end) = &self.end else { return HostReading::default() };
        let host = end.inner().host.clone();
        match host {
            Some(host) => host.lock().unwrap_or_else(PoisonError::into_inner).read(),
            None => end.inner().told.clone(),
        }
    }

    /// Sets all of this at once, or nothing where any of it is refused: then the next census says why. What people asked for stays known,
    /// and is not checked against the analysis: that is the manager's own matter. `cause` is for the log.
    pub fn give(&self, given: Vec<Given>, cause: String) {
        let Some(end) = &self.end else { return };
        let mut inner = end.inner();
        inner.asked.push(Asked { given, cause });
        // As in `look`.
        inner.bell.fetch_add(1, Ordering::Release);
    }
}

impl Port for Manager {
    fn shape(&self) -> PortShape {
        PortShape { direction: Direction::Manager, input: None, output: None }
    }

    fn create(&self, _: &PortOptions, _: usize) -> PortEnds {
        PortEnds { manager: Some(Arc::default()), ..PortEnds::default() }
    }

    fn bind(&mut self, ends: &PortEnds) {
        self.end.clone_from(&ends.manager);
    }

    fn fetch(&self, _: Depth) {}
}

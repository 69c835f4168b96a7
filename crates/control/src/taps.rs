//! Who listens to which output: one tap of the system for each output, however many clients listen.

use std::collections::HashMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use runtime::{Control, Heard, Refusal, SystemView, Tap};
use types::AgentId;
use types::definition::Definition;

use crate::outbox::Outbox;
use crate::protocol::{lost_event, message_event};
use crate::server::Hooks;

/// How often what was heard is passed on. A tap keeps 256 messages meanwhile, so up to 25 000 a second are heard.
const EVERY: Duration = Duration::from_millis(10);

/// A client who listens, and gets every n-th message as an event.
pub(crate) struct Ear {
    pub(crate) client: u64,
    pub(crate) outbox: Arc<Outbox>,
    pub(crate) every: u64,
    pub(crate) heard: u64,
    pub(crate) lost: u64,
}

struct Listened {
    tap: Tap,
    /// The agent that was listened to; one of the same name may have come since.
    agent: Option<AgentId>,
    ears: Vec<Ear>,
}

#[derive(Default)]
struct State {
    listened: Vec<Listened>,
    names: HashMap<AgentId, String>,
    ended: bool,
}

pub(crate) struct Taps {
    control: Control,
    hooks: Arc<dyn Hooks>,
    state: Mutex<State>,
    changed: Condvar,
}

impl Taps {
    pub(crate) fn new(control: Control, hooks: Arc<dyn Hooks>) -> Taps {
        Taps { control, hooks, state: Mutex::default(), changed: Condvar::new() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the messages of an output look like.
    pub(crate) fn definition(&self, port: &str) -> Result<Definition, Refusal> {
        let state = self.state();
        if let Some(listened) = state.listened.iter().find(|listened| listened.tap.name() == port) {
            return Ok(listened.tap.definition().clone());
        }
        // Under the lock, so that the tap that ends is the one that began here.
        let tap = self.control.tap(port)?;
        self.control.untap(&tap);
        Ok(tap.definition().clone())
    }

    /// Begins to listen. Says what the messages look like.
    pub(crate) fn listen(&self, port: &str, ear: Ear) -> Result<Definition, Refusal> {
        let view = self.control.view()?;
        let mut state = self.state();
        self.renew_in(&mut state, &view);
        let known = state.listened.iter_mut().find(|listened| listened.tap.name() == port);
        if let Some(listened) = known {
            if listened.has_client(ear.client) {
                return Err(Refusal::new(format!("{port} is listened to already")));
            }
            listened.ears.push(ear);
            return Ok(listened.tap.definition().clone());
        }
        let tap = self.control.tap(port)?;
        let definition = tap.definition().clone();
        state.listened.push(Listened { tap, agent: agent_of(&view, port), ears: vec![ear] });
        self.changed.notify_all();
        Ok(definition)
    }

    /// Ends listening of a client to an output. Says whether it did listen.
    pub(crate) fn leave(&self, port: &str, client: u64) -> bool {
        let mut state = self.state();
        let Some(at) = state.listened.iter().position(|listened| listened.tap.name() == port) else {
            return false;
        };
        let did = state.listened[at].has_client(client);
        state.listened[at].ears.retain(|ear| ear.client != client);
        self.sweep(&mut state);
        did
    }

    /// Ends all listening of a client that has gone.
    pub(crate) fn forget(&self, client: u64) {
        let mut state = self.state();
        state.listened.iter_mut().for_each(|listened| listened.ears.retain(|ear| ear.client != client));
        self.sweep(&mut state);
    }

    /// Ends the taps that nobody listens to.
    fn sweep(&self, state: &mut State) {
        state.listened.retain(|listened| {
            if listened.ears.is_empty() && listened.agent.is_some() {
                self.control.untap(&listened.tap);
            }
            !listened.ears.is_empty()
        });
    }

    /// Agents have come or gone: listens to those that took the names of others.
    pub(crate) fn renew(&self) {
        // A system that has ended has no agents to listen to.
        let Ok(view) = self.control.view() else { return };
        self.renew_in(&mut self.state(), &view);
    }

    fn renew_in(&self, state: &mut State, view: &SystemView) {
        for listened in &mut state.listened {
            let agent = agent_of(view, listened.tap.name());
            if agent != listened.agent {
                listened.agent = None;
                if let Ok(tap) = self.control.tap(listened.tap.name()) {
                    (listened.tap, listened.agent) = (tap, agent);
                }
            }
        }
        state.names.clear();
    }

    /// Ends [`pump`](Self::pump).
    pub(crate) fn end(&self) {
        self.state().ended = true;
        self.changed.notify_all();
    }

    /// Passes on what is heard, until the end.
    pub(crate) fn pump(&self) {
        let mut state = self.state();
        while !state.ended {
            state = if state.listened.is_empty() {
                self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
            } else {
                self.pass_on(&mut state);
                self.changed.wait_timeout(state, EVERY).unwrap_or_else(PoisonError::into_inner).0
            };
        }
    }

    fn pass_on(&self, state: &mut State) {
        let State { listened, names, .. } = state;
        for listened in listened {
            let (all, lost) = listened.tap.take();
            if lost > 0 {
                listened.add_lost(lost);
            }
            for heard in &all {
                self.tell(listened, heard, names);
            }
        }
    }

    fn tell(&self, listened: &mut Listened, heard: &Heard, names: &mut HashMap<AgentId, String>) {
        let Listened { tap, ears, .. } = listened;
        // The line is made for the first who wants it.
        let mut line: Option<Arc<str>> = None;
        for Ear { outbox, every, heard: count, lost, .. } in ears {
            *count += 1;
            if !(*count - 1).is_multiple_of(*every) {
                continue;
            }
            let line = line.get_or_insert_with(|| {
                let message = self.hooks.decode(tap.definition(), &heard.cdr);
                message_event(tap.name(), heard, message, |id| self.name(names, id)).into()
            });
            // What was lost is told together with the next message that has room.
            let told = match *lost {
                0 => outbox.offer(line),
                n => outbox.offer(&format!("{}\n{line}", lost_event(tap.name(), n)).into()),
            };
            *lost = if told { 0 } else { *lost + 1 };
        }
    }

    /// The name of an agent. The system is asked once for those that are not known yet.
    fn name(&self, names: &mut HashMap<AgentId, String>, id: AgentId) -> String {
        if !names.contains_key(&id)
            && let Ok(view) = self.control.view()
        {
            names.extend(view.agents.into_iter().map(|agent| (agent.id, agent.name)));
        }
        names.entry(id).or_insert_with(|| format!("#{}", id.0)).clone()
    }
}

impl Listened {
    fn has_client(&self, client: u64) -> bool {
        self.ears.iter().any(|ear| ear.client == client)
    }

    fn add_lost(&mut self, more: u64) {
        for ear in &mut self.ears {
            ear.lost += more;
        }
    }
}

fn agent_of(view: &SystemView, port: &str) -> Option<AgentId> {
    let owner = runtime::owner(port);
    view.agents.iter().find(|agent| agent.name == owner).map(|agent| agent.id)
}

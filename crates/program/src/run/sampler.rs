//! Samples of how long steps take and how late they begin, taken from a running system by looking at it now and then.
//!
//! The figures that the runtime keeps say the extremes and percentiles of all steps; a picture of their spread needs single
//! values. Looking costs the real-time side nothing.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use runtime::Control;
use serde_json::{Value as Json, json};

use super::summary::Summary;

/// How often it looks: fast enough for a picture, and for the control side next to nothing.
const LOOK: HostDuration = HostDuration::from_millis(5);
/// No picture shows more of an agent; later samples take the places of earlier ones in turn.
const MOST: usize = 20_000;

/// Single steps of each agent (ns): how long, and how late.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples(pub(crate) BTreeMap<String, Steps>);

/// Of one agent.
#[derive(Clone, Debug, Default)]
pub(crate) struct Steps {
    pub(crate) exec: Vec<f64>,
    pub(crate) jitter: Vec<f64>,
    seen: u64,
    next: usize,
}

impl Steps {
    fn add(&mut self, exec: f64, jitter: f64) {
        if self.exec.len() < MOST {
            self.exec.push(exec);
            self.jitter.push(jitter);
        } else {
            (self.exec[self.next], self.jitter[self.next]) = (exec, jitter);
            self.next = (self.next + 1) % MOST;
        }
    }
}

/// A thread that looks.
pub(super) struct Sampler {
    over: Arc<AtomicBool>,
    thread: JoinHandle<Samples>,
}

impl Sampler {
    /// Begins to look; without a thread there are no samples.
    pub(super) fn start(control: Control) -> Option<Sampler> {
        let over = Arc::new(AtomicBool::new(false));
        let mine = over.clone();
        let work = move || {
            let mut samples = Samples::default();
            while !mine.load(Ordering::Acquire) {
                let Ok(view) = control.view() else { break };
                for agent in &view.agents {
                    let steps = samples.0.entry(agent.name.clone()).or_default();
                    if agent.exec.n > steps.seen {
                        steps.seen = agent.exec.n;
                        steps.add(agent.exec.last, agent.jitter.last);
                    }
                }
                std::thread::park_timeout(LOOK);
            }
            samples
        };
        let thread = std::thread::Builder::new().name("sinew-sampler".into()).spawn(work).ok()?;
        Some(Sampler { over, thread })
    }

    /// What it saw.
    pub(super) fn end(self) -> Samples {
        self.over.store(true, Ordering::Release);
        self.thread.thread().unpark();
        self.thread.join().unwrap_or_default()
    }
}

/// What the host's clock said of a run: all that must not be in the log of a simulated one.
pub(super) fn to_json(summary: &Summary, samples: &Samples) -> Json {
    let agents = summary.agents.iter().map(|agent| {
        let steps = samples.0.get(&agent.name);
        json!({
            "name": agent.name,
            "exec": super::figure_json("exec", &agent.exec),
            "jitter": super::figure_json("jitter", &agent.jitter),
            "response": super::figure_json("response", &agent.response),
            "samples": {
                "exec_ns": steps.map(|steps| &steps.exec),
                "jitter_ns": steps.map(|steps| &steps.jitter),
            },
        })
    });
    json!({
        "system": summary.system,
        "seed": summary.seed,
        "clock": summary.clock,
        "time_s": summary.time.seconds(),
        "wall_s": summary.wall,
        "agents": agents.collect::<Vec<_>>(),
    })
}

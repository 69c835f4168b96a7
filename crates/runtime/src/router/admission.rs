//! Whether all deadlines are still met when something is changed: what makes somebody miss its own is refused, with the numbers.

use std::collections::HashMap;

use schedule::Exact;
use schedule::sensitivity::largest;
use schedule::system::{Found, Source, System};
use types::{Duration, Time};

use super::{Incident, Reply, Router};
use crate::plan::{AgentPlan, Plan};
use crate::request::{Refusal, Request};
use crate::timetable::{Assumed, timetable, why_unsound};

/// What admission counts with.
#[derive(Clone, Debug, Default)]
pub struct Admission {
    /// How many processors there are.
    pub processors: usize,
    /// What the runtime needs of a processor around each step.
    pub overhead: Duration,
    /// The time between two messages of outputs that send by a clock of their own: a robot's readings.
    pub pace: HashMap<String, Duration>,
    /// Whether what does not fit is admitted all the same, and told.
    pub force: bool,
}

/// After so many steps what was measured counts, and not what was declared.
const MEASURED_AFTER: u64 = 1000;
/// The next step may take longer than all before it: by a fifth.
pub(crate) const WITH_MARGIN: i64 = 120;
/// Steps that are played take what they are said to take.
pub(crate) const AS_PLAYED: i64 = 100;
/// What was measured longer ago than twice this does not count.
const WINDOW: Duration = Duration::secs(10);
/// How often it is looked whether somebody has outgrown what it was admitted with.
const GROWN_EVERY: Duration = Duration::millis(50);

/// A system and what the analysis found of it.
pub(super) struct Judged {
    names: Vec<String>,
    system: System,
    found: Vec<Found>,
}

impl Judged {
    fn miss(&self, name: &str) -> bool {
        self.names.iter().position(|known| known == name).is_some_and(|at| self.misses(at))
    }

    fn misses(&self, at: usize) -> bool {
        self.system.is_in_real_time(at) && !self.found[at].meets
    }

    fn said(&self, at: usize) -> String {
        let deadline = people(self.system.agents[at].deadline);
        match self.found[at].response {
            Some(response) => format!(
                "{} would be done after {} at worst, and has {deadline}",
                self.names[at],
                people(response)
            ),
            None => format!("{} might never be done: more is asked for than there is", self.names[at]),
        }
    }

    /// The least period of an agent with which all that were in time before are so again.
    fn least_period(&self, name: &str, must: &[usize]) -> Option<Duration> {
        let at = self.names.iter().position(|known| known == name)?;
        let nominal = self.system.agents[at].sources.iter().find_map(|source| match source {
            Source::Clock { period } => Some(*period),
            _ => None,
        })?;
        let keeps_pace = self.system.agents[at].deadline == nominal;
        let fits = |slower: Exact| {
            let mut system = self.system.clone();
            let agent = &mut system.agents[at];
            for source in &mut agent.sources {
                if let Source::Clock { period } = source {
                    *period = (*period / slower).ceil();
                }
            }
            if keeps_pace {
                agent.deadline = (nominal / slower).ceil();
            }
            system.analyse().is_ok_and(|found| must.iter().all(|at| found[*at].meets))
        };
        // As a share of the rate that was asked for; what is next to nothing stands for never.
        let least = Exact::new(1, 10_000);
        let share = largest(|share| if share < least { fits(least) } else { fits(share) })?;
        (1e-4..1.0).contains(&share).then(|| Duration((as_nanos(nominal) / share).ceil() as i64))
    }
}

fn as_nanos(time: Exact) -> f64 {
    *time.numer() as f64 / *time.denom() as f64
}

/// A time in milliseconds, to the microsecond.
fn people(time: Exact) -> String {
    format!("{:.3} ms", as_nanos(time) * 1e-6)
}

impl Router {
    /// Counts with this from now on.
    pub(crate) fn set_admission(&mut self, admission: Option<Admission>) {
        self.admission = admission;
    }

    /// What the analysis says of the system as it is; nothing where nobody asks.
    pub(super) fn judged(&mut self) -> Reply<Option<Judged>> {
        if self.admission.is_none() {
            return Ok(None);
        }
        self.look_at_windows();
        let Some(Admission { processors, overhead, pace, .. }) = &self.admission else { return Ok(None) };
        let parts = self.to_plan_as_it_is();
        let plan = Plan {
            agents: parts.0,
            queues: parts.1,
            wires: parts.2,
            executors: self.executors.iter().map(|executor| executor.plan.clone()).collect(),
            ..Plan::default()
        };
        let cost = |agent: &AgentPlan| self.cost_of(agent);
        let pace = |port: &str| pace.get(port).copied();
        let system = timetable(
            &plan,
            &self.registry,
            &Assumed { cost: &cost, processors: *processors, overhead: *overhead, pace: &pace },
        )
        .system;
        let names: Vec<String> = plan.agents.into_iter().map(|agent| agent.name).collect();
        let found = system.analyse().map_err(|unsound| why_unsound(&unsound, &names))?;
        Ok(Some(Judged { names, system, found }))
    }

    /// Brings up to date what real-time agents took of late.
    fn look_at_windows(&mut self) {
        if self.measures.is_none() {
            return;
        }
        let now = self.now;
        if now - self.windows_at < WINDOW / 10 {
            return;
        }
        self.windows_at = now;
        for known in self.agents.values_mut() {
            if self.executors[known.executor].plan.level().is_some() {
                known.long_window.look(&known.stats, now, WINDOW);
            }
        }
    }

    /// Processor time of a step at worst: what was measured of late, once enough was, else what is declared. The budget of an anytime agent
    /// counts whole: it may use it.
    fn cost_of(&self, agent: &AgentPlan) -> Duration {
        let known = self.names.get(&agent.name).and_then(|id| self.agents.get(id));
        let methods = self.registry.get(&agent.kind).map_or(&[][..], |kind| kind.methods);
        let declared = agent.cost_in_all(methods).unwrap_or(Duration::ZERO);
        let Some((known, percent)) = known.zip(self.measures) else { return declared };
        if known.long_window.steps(&known.stats) < MEASURED_AFTER {
            return declared;
        }
        let longest = known.long_window.longest(&known.stats);
        Duration(longest.0 * percent / 100).max(agent.budget.unwrap_or(Duration::ZERO))
    }

    /// Tells whose steps take longer than what they were admitted with by a tenth or more, at once and then each time when it has become a quarter more.
    pub(super) fn note_outgrown(&mut self, now: Time) {
        if self.measures.is_none() || self.admission.is_none() || now - self.grown_at < GROWN_EVERY {
            return;
        }
        self.grown_at = now;
        let mut grown = Vec::new();
        for known in self.agents.values_mut() {
            let Some(admitted) = known.admitted.filter(|admitted| *admitted > Duration::ZERO) else {
                continue;
            };
            let (_, longest) = known.stats.longest();
            if longest > admitted + Duration(admitted.0 / 10) {
                known.admitted = Some(longest + Duration(longest.0 / 4));
                grown.push((known.plan.name.clone(), longest, admitted));
            }
        }
        for (agent, longest, admitted) in grown {
            let millis = |span: Duration| format!("{:.3} ms", span.0 as f64 * 1e-6);
            let what =
                format!("took {} for a step, and was admitted with {}", millis(longest), millis(admitted));
            self.incidents.push(Incident { time: now, agent, what });
        }
    }

    /// Tells what was admitted though it does not fit.
    pub(crate) fn note_forced(&mut self) {
        let refused = self.admit(None, None);
        if let Err(refusal) = refused {
            let what = format!("admitted by force: {}", refusal.what);
            self.incidents.push(Incident { time: self.now, agent: "control".into(), what });
        }
    }

    /// Whether the system as it is may begin.
    pub(crate) fn admit_all(&mut self) -> Reply<()> {
        if self.admission.as_ref().is_some_and(|admission| admission.force) {
            self.note_forced();
            return Ok(());
        }
        self.admit(None, None)
    }

    /// Keeps what agents were counted with; who has been told to have outgrown it stays as it is.
    fn note_admitted(&mut self, judged: &Judged) {
        let Some(Admission { overhead, .. }) = &self.admission else { return };
        let overhead = *overhead;
        for (name, agent) in judged.names.iter().zip(&judged.system.agents) {
            let cost = Duration(agent.cost.to_integer() as i64) - overhead;
            let Some(known) = self.names.get(name).and_then(|id| self.agents.get_mut(id)) else { continue };
            known.admitted = known.admitted.or(Some(cost));
        }
    }

    /// Refuses what was staged where somebody misses its deadline by it who met it before.
    pub(super) fn admit(&mut self, before: Option<&Judged>, request: Option<&str>) -> Reply<()> {
        let Some(judged) = self.judged()? else { return Ok(()) };
        let late =
            |at: &usize| judged.misses(*at) && before.is_none_or(|before| !before.miss(&judged.names[*at]));
        let late: Vec<usize> = (0..judged.names.len()).filter(late).collect();
        if late.is_empty() {
            self.note_admitted(&judged);
            return Ok(());
        }
        let said: Vec<String> = late.iter().take(3).map(|at| judged.said(*at)).collect();
        let more = late.len().saturating_sub(3);
        let more = if more > 0 { format!("; and {more} more") } else { String::new() };
        let name = request.unwrap_or(&judged.names[late[0]]);
        let fits = Some(name).and_then(|name| judged.least_period(name, &late).map(|period| (name, period)));
        let fits = fits.map_or(String::new(), |(name, period)| {
            format!(
                "{name} fits with a period of {}ms or longer; ",
                (as_millis(period) * 1000.0).ceil() / 1000.0
            )
        });
        Err(Refusal::new(format!("the deadlines would not be met: {}{more}", said.join("; ")))
            .help(format!("{fits}--force does it all the same")))
    }
}

fn as_millis(span: Duration) -> f64 {
    span.0 as f64 * 1e-6
}

/// The agent whose timing a request changes, where it does.
pub(super) fn changes_timing(request: &Request) -> Option<&str> {
    match request {
        Request::Add(plan) => Some(&plan.name),
        Request::Set { agent, key, .. }
            if key != "importance" && super::TIMING_KEYS.contains(&key.as_str()) =>
        {
            Some(agent)
        }
        Request::Wire(wire) => Some(crate::plan::owner(&wire.to)),
        Request::All(requests) => requests.iter().find_map(changes_timing),
        _ => None,
    }
}

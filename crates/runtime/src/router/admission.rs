//! Whether all deadlines are still met when something is changed: what makes somebody miss its own is refused, with the numbers.

mod reach;
mod room;

use std::collections::HashMap;
use std::sync::Arc;

use schedule::Exact;
use schedule::sensitivity::largest;
use schedule::system::{Found, Source, System};
use types::{Duration, Time};

use super::{Incident, Reply, Router};
use crate::plan::{AgentPlan, Plan};
use crate::request::Refusal;
use crate::timetable::{Assumed, timetable, why_unsound};

pub(super) use self::reach::Asked;

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

/// A system, and what the analysis found of it.
pub(super) struct Analysed {
    system: System,
    found: Vec<Found>,
}

/// A running system and what the analysis found of it.
pub(super) struct Judged {
    /// Its agents stand in the order of the analysed system's.
    plan: Plan,
    of: Arc<Analysed>,
}

impl Judged {
    fn names(&self) -> impl Iterator<Item = &str> {
        self.plan.agents.iter().map(|agent| agent.name.as_str())
    }

    fn name(&self, at: usize) -> &str {
        &self.plan.agents[at].name
    }

    fn miss(&self, name: &str) -> bool {
        self.names().position(|known| known == name).is_some_and(|at| self.misses(at))
    }

    fn misses(&self, at: usize) -> bool {
        self.of.system.is_in_real_time(at) && !self.of.found[at].meets
    }

    /// How long each in real time takes at worst.
    #[cfg(all(test, not(loom)))]
    pub(super) fn responses(&self) -> std::collections::BTreeMap<String, Option<Exact>> {
        let in_real_time = self.names().enumerate().filter(|(at, _)| self.of.system.is_in_real_time(*at));
        in_real_time.map(|(at, name)| (name.to_owned(), self.of.found[at].response)).collect()
    }

    /// Whether an agent has to be in time: all have but those who were late before.
    fn must(&self, at: usize, before: Option<&Judged>) -> bool {
        before.is_none_or(|before| !before.miss(self.name(at)))
    }

    /// Who has to be in time and is not.
    fn late(&self, before: Option<&Judged>) -> Vec<usize> {
        let all = 0..self.plan.agents.len();
        all.filter(|at| self.misses(*at) && self.must(*at, before)).collect()
    }

    /// How late these are.
    fn missed(&self, late: &[usize]) -> String {
        let said: Vec<String> = late.iter().take(3).map(|at| self.said(*at)).collect();
        let more = late.len().saturating_sub(3);
        let more = if more > 0 { format!("; and {more} more") } else { String::new() };
        format!("the deadlines would not be met: {}{more}", said.join("; "))
    }

    fn said(&self, at: usize) -> String {
        let deadline = people(self.of.system.agents[at].deadline);
        match self.of.found[at].response {
            Some(response) => format!(
                "{} would be done after {} at worst, and has {deadline}",
                self.name(at),
                people(response)
            ),
            None => format!("{} might never be done: more is asked for than there is", self.name(at)),
        }
    }

    /// The least period of an agent with which all that were in time before are so again.
    fn least_period(&self, name: &str, must: &[usize]) -> Option<Duration> {
        let at = self.names().position(|known| known == name)?;
        let nominal = self.of.system.agents[at].sources.iter().find_map(|source| match source {
            Source::Clock { period } => Some(*period),
            _ => None,
        })?;
        let keeps_pace = self.of.system.agents[at].deadline == nominal;
        let fits = |slower: Exact| {
            let mut system = self.of.system.clone();
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

    /// Whether changes are held against deadlines.
    pub(super) fn admits(&self) -> bool {
        self.admission.is_some()
    }

    /// What the analysis says of the system as it is; nothing where nobody asks. What was analysed last is not analysed again.
    pub(super) fn judged(&mut self) -> Reply<Option<Judged>> {
        if self.admission.is_none() {
            return Ok(None);
        }
        self.look_at_windows();
        let parts = self.to_plan_as_it_is();
        let plan = Plan {
            agents: parts.0,
            queues: parts.1,
            wires: parts.2,
            executors: self.executors.iter().map(|executor| executor.plan.clone()).collect(),
            ..Plan::default()
        };
        let system = self.system_of(&plan);
        let of = match self.analysed.take() {
            Some(last) if last.system == system => last,
            _ => {
                self.analyses += 1;
                let found = system.analyse().map_err(|unsound| {
                    let names: Vec<String> = plan.agents.iter().map(|agent| agent.name.clone()).collect();
                    why_unsound(&unsound, &names)
                })?;
                Arc::new(Analysed { system, found })
            }
        };
        self.analysed = Some(of.clone());
        Ok(Some(Judged { plan, of }))
    }

    /// A plan as admission counts it.
    fn system_of(&self, plan: &Plan) -> System {
        let nobody = Admission::default();
        let Admission { processors, overhead, pace, .. } = self.admission.as_ref().unwrap_or(&nobody);
        let cost = |agent: &AgentPlan| self.cost_of(agent);
        let pace = |port: &str| pace.get(port).copied();
        let assumed = Assumed { cost: &cost, processors: *processors, overhead: *overhead, pace: &pace };
        timetable(plan, &self.registry, &assumed).system
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
        let what = match self.judged() {
            Ok(None) => return,
            Ok(Some(judged)) => {
                let late = judged.late(None);
                if late.is_empty() {
                    return self.note_admitted(&judged);
                }
                judged.missed(&late)
            }
            Err(refusal) => refusal.what,
        };
        let what = format!("admitted by force: {what}");
        self.incidents.push(Incident { time: self.now, agent: "control".into(), what });
    }

    /// Whether the system as it is may begin.
    pub(crate) fn admit_all(&mut self) -> Reply<()> {
        if self.admission.as_ref().is_some_and(|admission| admission.force) {
            self.note_forced();
            return Ok(());
        }
        self.admit(None, &Asked::to_begin())
    }

    /// Keeps what agents were counted with; who has been told to have outgrown it stays as it is.
    fn note_admitted(&mut self, judged: &Judged) {
        let Some(Admission { overhead, .. }) = &self.admission else { return };
        let overhead = *overhead;
        for (name, agent) in judged.names().zip(&judged.of.system.agents) {
            let cost = Duration(agent.cost.to_integer() as i64) - overhead;
            let Some(known) = self.names.get(name).and_then(|id| self.agents.get_mut(id)) else { continue };
            known.admitted = known.admitted.or(Some(cost));
        }
    }

    /// The same of those who were admitted because they keep nobody waiting.
    pub(super) fn note_unjudged(&mut self, names: &[String]) {
        for name in names {
            let Some(id) = self.names.get(name).copied() else { continue };
            let cost = self.cost_of(&self.agents[&id].plan);
            self.of_mut(id, |known| known.admitted = known.admitted.or(Some(cost)));
        }
    }

    /// Refuses what was staged where somebody misses its deadline by it who met it before.
    pub(super) fn admit(&mut self, before: Option<&Judged>, asked: &Asked) -> Reply<()> {
        let Some(judged) = self.judged()? else { return Ok(()) };
        let late = judged.late(before);
        let Some(first) = late.first() else {
            self.note_admitted(&judged);
            return Ok(());
        };
        let name = asked.whose.as_deref().unwrap_or_else(|| judged.name(*first));
        let own = judged.least_period(name, &late).map_or(String::new(), |period| {
            format!(
                "{name} fits with a period of {}ms or longer; ",
                (as_millis(period) * 1000.0).ceil() / 1000.0
            )
        });
        let others = self.room_by_others(&judged, before, asked);
        let others = others.map_or(String::new(), |room| format!("; or make room first, {room}"));
        Err(Refusal::new(judged.missed(&late)).help(format!("{own}--force does it all the same{others}")))
    }
}

fn as_millis(span: Duration) -> f64 {
    span.0 as f64 * 1e-6
}

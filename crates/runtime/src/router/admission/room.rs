//! What others could give so that what does not fit does: the least lengthening of their periods within what their plans allow.

use schedule::Exact;
use schedule::manage::{Managed, Orders, Setting, lengthen};
use schedule::system::System;
use types::Duration;

use super::super::Router;
use super::{Asked, Judged};
use crate::plan::{AgentPlan, Plan};

/// Longer periods, and gaps, with which a request fits.
pub(super) struct Room {
    longer: Vec<Longer>,
    /// Whether there is a running system in which they can be set.
    runs: bool,
}

/// One agent that runs less often.
struct Longer {
    agent: String,
    /// Which entry of its plan is longer.
    key: &'static str,
    span: Duration,
}

/// Periods are proposed in so many digits.
const DIGITS: u32 = 3;
/// No more are named in the sentence; the command has all.
const NAMED: usize = 4;

impl Longer {
    fn put(&self, plan: &mut Plan) {
        let Some(agent) = plan.agent_mut(&self.agent) else { return };
        match self.key {
            "period" => agent.period = Some(self.span),
            _ => agent.min_gap = self.span,
        }
    }

    fn said(&self) -> String {
        let Longer { agent, key, span } = self;
        match *key {
            "period" => format!("{agent} every {}", people(*span)),
            _ => format!("steps of {agent} {} apart", people(*span)),
        }
    }
}

/// A name as it is typed into a shell.
fn typed(name: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    if name.chars().all(is_plain) { name.to_owned() } else { format!("'{}'", name.replace('\'', r"'\''")) }
}

fn people(span: Duration) -> String {
    if span >= Duration::secs(1) {
        format!("{} s", span.seconds())
    } else {
        format!("{} ms", span.0 as f64 * 1e-6)
    }
}

impl Room {
    fn sentence(&self) -> String {
        let mut said: Vec<String> = self.longer.iter().take(NAMED).map(Longer::said).collect();
        let more = self.longer.len().saturating_sub(NAMED);
        said.extend((more > 0).then(|| format!("{more} more slower")));
        match said.split_last() {
            Some((last, first)) if !first.is_empty() => format!("with {} and {last}", first.join(", ")),
            _ => format!("with {}", said.concat()),
        }
    }

    /// What sets it, as it is typed; nothing where no option reaches an agent.
    fn command(&self) -> Option<String> {
        let each = |say: &dyn Fn(&Longer) -> String| self.longer.iter().map(say).collect::<Vec<_>>();
        if self.runs {
            let set = |it: &Longer| format!("set {} {}={}", typed(&it.agent), it.key, it.span);
            // Between two requests stands a word that a shell takes for its own where it is not quoted.
            return Some(format!("sinew {}", each(&set).join(" ';' ")));
        }
        // Agents of a group are written in a file of their own.
        let is_reached = |it: &Longer| !it.agent.contains('.') && typed(&it.agent) == it.agent;
        let set = |it: &Longer| format!("--set agent.{}.{}={}", it.agent, it.key, it.span);
        self.longer.iter().all(is_reached).then(|| each(&set).join(" "))
    }
}

impl std::fmt::Display for Room {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.sentence())?;
        self.command().map_or(Ok(()), |command| write!(f, ": {command}"))
    }
}

impl Router {
    /// The least that agents could give of which the request does not say itself when they run; nothing where all of that is not enough. It is
    /// tried: with it everybody is in time who has to be.
    pub(super) fn room_by_others(
        &self,
        judged: &Judged,
        before: Option<&Judged>,
        asked: &Asked,
    ) -> Option<Room> {
        let agents = judged.plan.agents.iter().enumerate();
        let managed: Vec<Managed> = agents.map(|(at, agent)| self.gives(judged, at, agent, asked)).collect();
        if managed.iter().all(|managed| managed.rigid) {
            return None;
        }
        let must: Vec<bool> = (0..managed.len()).map(|at| judged.must(at, before)).collect();
        let system = with_said_deadlines(judged);
        let settings = lengthen(&system, &managed, &must).ok()??;
        // Few digits where these are enough, which is tried.
        let how: [fn(Exact) -> Exact; 3] =
            [|time| in_digits(time, Exact::round), |time| in_digits(time, Exact::ceil), |time| time];
        let runs = asked.whose.is_some();
        let room = |how| Room { longer: longer(judged, &managed, &settings, how), runs };
        how.into_iter().map(room).find(|room| self.is_enough(room, judged, before))
    }

    /// How far an agent may give way in its period, or in the gap between its steps.
    fn gives(&self, judged: &Judged, at: usize, agent: &AgentPlan, asked: &Asked) -> Managed {
        let giving = &agent.giving;
        let is_robot = self.robots.contains(&agent.name);
        if giving.is_rigid || giving.is_suspended || is_robot || asked.own.contains(&agent.name) {
            return Managed::rigid();
        }
        let (present, longest) = match agent.period {
            Some(period) => (Some(exact(period)), agent.period_range.map(|(_, longest)| longest)),
            None => {
                // What it asks for itself goes on as it is.
                let streams = judged.of.found[at].streams.iter().filter(|stream| stream.after.is_some());
                (streams.map(|stream| stream.period.ceil()).min(), giving.gap_max)
            }
        };
        match (present, longest.map(exact)) {
            (Some(present), Some(longest)) if longest > present && giving.elasticity() > 0.0 => Managed {
                rigid: false,
                nominal: Some(present),
                longest: Some(longest),
                elasticity: giving.elasticity(),
                importance: giving.importance(),
                orders: Orders::default(),
                ..Managed::rigid()
            },
            _ => Managed::rigid(),
        }
    }

    /// Whether what is proposed could be set as it is, and with it everybody is in time who has to be.
    fn is_enough(&self, room: &Room, judged: &Judged, before: Option<&Judged>) -> bool {
        let mut plan = judged.plan.clone();
        room.longer.iter().for_each(|longer| longer.put(&mut plan));
        let can_be_set = room.longer.iter().all(|longer| {
            let (Some(known), Some(plan)) = (self.owner_of(&longer.agent), plan.agent(&longer.agent)) else {
                return false;
            };
            let timing = self.timing_for(plan, &known.kind);
            timing.is_ok_and(|timing| self.check_budget(plan, &timing, known.executor).is_ok())
        });
        let must = |at: usize| judged.must(at, before);
        can_be_set && !room.longer.is_empty() && self.system_of(&plan).do_meet(must).unwrap_or(false)
    }
}

/// The system, where a deadline that is said does not go along with a period that is as long: a hair less keeps the two apart.
fn with_said_deadlines(judged: &Judged) -> System {
    let mut system = judged.of.system.clone();
    for (agent, plan) in system.agents.iter_mut().zip(&judged.plan.agents) {
        if plan.deadline.is_some() && plan.deadline == plan.period {
            agent.deadline -= Exact::from_integer(1);
        }
    }
    system
}

fn longer(
    judged: &Judged,
    managed: &[Managed],
    settings: &[Setting],
    how: fn(Exact) -> Exact,
) -> Vec<Longer> {
    let agents = judged.plan.agents.iter().zip(managed).zip(settings);
    agents
        .filter_map(|((agent, managed), setting)| {
            let period = setting.period.filter(|period| managed.nominal.is_some_and(|it| *period > it))?;
            let key = if agent.period.is_some() { "period" } else { "min_gap" };
            let span = how(period).clamp(managed.nominal?, managed.longest?);
            let span = Duration(span.ceil().to_integer() as i64);
            Some(Longer { agent: agent.name.clone(), key, span })
        })
        .collect()
}

/// A time in few digits.
fn in_digits(time: Exact, round: fn(&Exact) -> Exact) -> Exact {
    let digits = time.to_integer().max(1).ilog10() + 1;
    let grain = Exact::from_integer(10_i128.pow(digits.saturating_sub(DIGITS)));
    round(&(time / grain)) * grain
}

fn exact(span: Duration) -> Exact {
    Exact::from_integer(span.0.into())
}

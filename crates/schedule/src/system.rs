//! Agents that share threads, and make each other run.
//!
//! An executor is a thread with a priority that runs its agents one after another: they do not interrupt each other, and each may have to wait for
//! the step of another that has just begun. Whoever is of a higher executor that may run on one of the same processors goes before. An agent
//! runs by the clock, by what comes from outside, at a time that it asked for, or because another one has sent it something: then it inherits the
//! other's period, and is as late as that one's step may end. What makes it run is its *streams*, and each is a task of its own to the tests.
//!
//! The bounds are those of holistic analysis (Tindell and Clark 1994): responses and the lateness that they cause are reckoned in turns until
//! nothing changes. They hold for executors that may run on several processors, too: as long as one waits, one of its processors is at work for
//! those who go before it, as on a single one; and all of its processors are, which gives another bound (Bertogna and Cirinei 2007). The lower of
//! both counts.

use num_traits::Zero;

use crate::Exact;
use crate::exact::common_denominator;
use crate::processors::Mask;
use crate::task::Row;

/// A thread that runs agents. Those without priority run on what is left, and nothing is promised to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Executor {
    /// The greater goes before; nothing for an ordinary thread.
    pub priority: Option<u8>,
    /// Where it may run.
    pub may: Mask,
}

/// What makes an agent run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The clock. A release that was passed over is not made up for.
    Clock {
        /// The time between two.
        period: Exact,
    },
    /// What another agent sends in its steps.
    After {
        /// Its place among the agents.
        agent: usize,
        /// One of so many of its messages; 1 for each.
        every: u32,
        /// The least time between two of them, where it does not send in each step; zero where it does.
        least: Exact,
        /// How many of them wait at most.
        depth: u32,
    },
    /// What another agent sends by a clock of its own, whatever makes it run: a robot its readings.
    Paced {
        /// Its place among the agents.
        agent: usize,
        /// The time between two of them.
        period: Exact,
    },
    /// It asks for the step itself, when it likes.
    Asked {
        /// The least time between two of them.
        least: Exact,
    },
}

impl Source {
    /// Whose messages they are; nothing for the clock, and for what it asks itself.
    pub fn agent(&self) -> Option<usize> {
        match self {
            Source::Clock { .. } | Source::Asked { .. } => None,
            Source::After { agent, .. } | Source::Paced { agent, .. } => Some(*agent),
        }
    }
}

/// An agent as the analysis sees it. Times in nanoseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Agent {
    /// Processor time of a step at worst, with what the runtime does around it.
    pub cost: Exact,
    /// How soon after it was made to run a step must be done.
    pub deadline: Exact,
    /// Its executor.
    pub executor: usize,
    /// What makes it run.
    pub sources: Vec<Source>,
    /// The least time between two steps that others make it run; zero for none.
    pub least_gap: Exact,
}

/// Agents and the threads that run them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct System {
    /// How many processors there are; none is one.
    pub processors: usize,
    /// The threads.
    pub executors: Vec<Executor>,
    /// The agents.
    pub agents: Vec<Agent>,
}

/// What is found of an agent. Times in nanoseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// What makes it run.
    pub streams: Vec<Stream>,
    /// From what made it run to the end of its step at worst; nothing where that is not bounded, or nothing is promised.
    pub response: Option<Exact>,
    /// Whether that is within its deadline.
    pub meets: bool,
}

/// What makes an agent run, as the tests count it: no more than ⌈(w + jitter) / period⌉ in a time of w.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stream {
    /// The time between two on the long run, at least.
    pub period: Exact,
    /// How late one may be.
    pub jitter: Exact,
    /// Whose message it is; nothing for the clock, and for what it asks itself.
    pub after: Option<usize>,
}

/// Why a system cannot be analysed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsound {
    /// Agents that make each other run for ever: each the next one, and the last the first.
    #[error("agents make each other run in a circle")]
    Circle(Vec<usize>),
    /// The times have too great a common denominator.
    #[error("the times cannot be reckoned exactly: take fewer digits")]
    TooFine,
}

/// Responses on several processors are sought in steps of a deadline's 2^-12.
const GRAIN: u32 = 12;
/// More rounds than most sets need: those in which two agents keep each other waiting come near to their responses by small steps.
const ROUNDS: usize = 1000;
/// A response of so many times the longest period is as good as none.
const LONG: i128 = 64;

impl System {
    /// What is found of each agent.
    ///
    /// # Errors
    /// Agents that make each other run in a circle, and times that are too fine.
    pub fn analyse(&self) -> Result<Vec<Found>, Unsound> {
        let whole = Whole::of(self)?;
        let (streams, responses) = whole.settle(|_| false);
        Ok(whole.told(&streams, &responses))
    }

    /// Whether all that run in real time meet their deadlines.
    ///
    /// # Errors
    /// As [`System::analyse`].
    pub fn is_feasible(&self) -> Result<bool, Unsound> {
        self.do_meet(|_| true)
    }

    /// Whether those that are asked for meet their deadlines; who does not run in real time is none of them.
    ///
    /// # Errors
    /// As [`System::analyse`].
    pub fn do_meet(&self, is_asked_for: impl Fn(usize) -> bool) -> Result<bool, Unsound> {
        let whole = Whole::of(self)?;
        let misses = |responses: &[Option<i128>]| {
            let mut all = responses.iter().zip(&whole.agents).enumerate();
            all.any(|(at, (response, agent))| {
                is_asked_for(at)
                    && self.is_in_real_time(at)
                    && response.is_none_or(|response| response > agent.deadline)
            })
        };
        // Responses only grow from round to round: who misses once misses. Not so where lateness makes a burst of messages that a gap keeps apart.
        let grow = !whole.may_burst();
        let (_, responses) = whole.settle(|responses| grow && misses(responses));
        Ok(!misses(&responses))
    }

    /// Whether anything is promised to an agent.
    pub fn is_in_real_time(&self, agent: usize) -> bool {
        self.executors[self.agents[agent].executor].priority.is_some()
    }

    /// How long after what happened at its beginning a chain of agents has answered at worst, in nanoseconds, each of whom reads what the one
    /// before has sent: it runs for it, or finds it at its next release. What the first one waits for is not in it: that is its
    /// own source's. Nothing where an agent has no bound, or does not hear of the one before and has no clock.
    pub fn latency(&self, found: &[Found], chain: &[usize]) -> Option<Exact> {
        let mut sum = Exact::zero();
        for (place, at) in chain.iter().enumerate() {
            let runs_for_it = place == 0 || {
                let before = chain[place - 1];
                self.agents[*at].sources.iter().any(|source| source.agent() == Some(before))
            };
            if !runs_for_it {
                let clocks = self.agents[*at].sources.iter().filter_map(|source| match source {
                    Source::Clock { period } => Some(*period),
                    _ => None,
                });
                // It has just been released when the message comes.
                sum += clocks.min()?;
            }
            sum += found[*at].response?;
        }
        Some(sum)
    }

    /// Whether what one executor does keeps another one waiting.
    pub(crate) fn goes_before(&self, one: usize, other: usize) -> bool {
        let (a, b) = (&self.executors[one], &self.executors[other]);
        one == other
            || (a.priority > b.priority && a.may & b.may != 0)
            || (a.priority == b.priority && a.may & b.may != 0)
    }

    /// Those that make others run before these.
    fn order(&self) -> Result<Vec<usize>, Unsound> {
        const OPEN: u8 = 1;
        const DONE: u8 = 2;
        let mut order = Vec::new();
        let mut state = vec![0u8; self.agents.len()];
        for first in 0..self.agents.len() {
            // Agents, and which of their sources is to be looked at next.
            let mut path = if state[first] == DONE { Vec::new() } else { vec![(first, 0)] };
            while let Some((at, next)) = path.last_mut() {
                let (at, place) = (*at, *next);
                *next += 1;
                state[at] = OPEN;
                match self.agents[at].sources.get(place) {
                    Some(Source::After { agent, .. }) if state[*agent] == OPEN => {
                        let from = path.iter().position(|(on, _)| on == agent).unwrap_or(0);
                        return Err(Unsound::Circle(path[from..].iter().rev().map(|(at, _)| *at).collect()));
                    }
                    Some(Source::After { agent, .. }) if state[*agent] != DONE => path.push((*agent, 0)),
                    Some(_) => {}
                    None => {
                        state[at] = DONE;
                        order.push(at);
                        path.pop();
                    }
                }
            }
        }
        Ok(order)
    }

    fn ticks(&self) -> Option<i128> {
        let times = self.agents.iter().flat_map(|agent| {
            let sources = agent.sources.iter().map(|source| match source {
                Source::Clock { period } | Source::Paced { period, .. } => *period,
                Source::After { least, .. } | Source::Asked { least } => *least,
            });
            [agent.cost, agent.deadline, agent.least_gap].into_iter().chain(sources)
        });
        common_denominator(times)
    }
}

/// The numbers of an agent in whole ticks.
struct Numbers {
    cost: i128,
    deadline: i128,
    least_gap: i128,
    sources: Vec<i128>,
}

impl Numbers {
    fn of(agent: &Agent, ticks: i128) -> Numbers {
        let whole = |time: Exact| (time * Exact::from_integer(ticks)).to_integer();
        let source = |source: &Source| match source {
            Source::Clock { period: between }
            | Source::Paced { period: between, .. }
            | Source::Asked { least: between } => whole(*between).max(1),
            Source::After { least, .. } => whole(*least),
        };
        Numbers {
            cost: whole(agent.cost),
            deadline: whole(agent.deadline),
            least_gap: whole(agent.least_gap),
            sources: agent.sources.iter().map(source).collect(),
        }
    }
}

/// A stream in whole ticks: a row, and whose message it is.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Flow {
    row: Row,
    after: Option<usize>,
    /// How many messages of it may wait.
    depth: u32,
}

struct Whole<'a> {
    system: &'a System,
    ticks: i128,
    agents: Vec<Numbers>,
    /// Those that make others run before these.
    order: Vec<usize>,
}

/// Of each agent what makes it run.
type Streams = Vec<Vec<Flow>>;
/// Of each agent how long it takes at worst; nothing where that is not bounded.
type Responses = Vec<Option<i128>>;

impl Whole<'_> {
    fn of(system: &System) -> Result<Whole<'_>, Unsound> {
        let order = system.order()?;
        let ticks = system.ticks().ok_or(Unsound::TooFine)?;
        let agents = system.agents.iter().map(|agent| Numbers::of(agent, ticks)).collect();
        Ok(Whole { system, ticks, agents, order })
    }

    /// Lateness makes responses longer, and they make others late: from below, until nothing changes, or it is enough. Where that takes too
    /// many rounds everybody is as late as can be.
    fn settle(&self, is_enough: impl Fn(&[Option<i128>]) -> bool) -> (Streams, Responses) {
        let mut responses: Responses = vec![Some(0); self.agents.len()];
        for _ in 0..ROUNDS {
            let streams = self.streams(&responses);
            let next: Responses =
                (0..self.agents.len()).map(|at| self.response(&streams, &responses, at)).collect();
            if next == responses || is_enough(&next) {
                return (streams, next);
            }
            responses = next;
        }
        let open = vec![None; self.agents.len()];
        let streams = self.streams(&open);
        let responses = (0..self.agents.len()).map(|at| self.response(&streams, &open, at)).collect();
        (streams, responses)
    }

    /// Whether it depends on how late others are if the gap between its steps is what bounds an agent.
    fn may_burst(&self) -> bool {
        let with_gap = |at: &usize| self.agents[*at].least_gap > 0;
        if !(0..self.agents.len()).any(|at| with_gap(&at)) {
            return false;
        }
        // Periods, unlike lateness, are the same in all rounds.
        let streams = self.streams(&vec![Some(0); self.agents.len()]);
        (0..self.agents.len()).filter(with_gap).any(|at| {
            let by_others = streams[at].iter().filter(|flow| flow.after.is_some());
            by_others.clone().next().is_some()
                && by_others
                    .map(|flow| self.agents[at].least_gap as f64 / flow.row.period as f64)
                    .sum::<f64>()
                    < 1.0
        })
    }

    /// What makes each agent run when the others take so long.
    fn streams(&self, responses: &[Option<i128>]) -> Streams {
        let mut streams: Streams = vec![Vec::new(); self.agents.len()];
        for at in &self.order {
            let (agent, numbers) = (&self.system.agents[*at], &self.agents[*at]);
            let flow = |period: i128, jitter, after, depth| Flow {
                row: Row { cost: numbers.cost, period, deadline: numbers.deadline, jitter, blocking: 0 },
                after,
                depth,
            };
            let (mut by_clock, mut by_others) = (Vec::new(), Vec::new());
            for (source, number) in agent.sources.iter().zip(&numbers.sources) {
                match source {
                    // Who asks for a step gets it at the time that it named; whoever goes before it does not make it ask sooner.
                    Source::Clock { .. } | Source::Asked { .. } => by_clock.push(flow(*number, 0, None, 0)),
                    Source::Paced { agent, .. } => {
                        let late = responses[*agent].unwrap_or(2 * number).min(2 * number);
                        by_others.push(flow(*number, late, Some(*agent), 1));
                    }
                    Source::After { agent, every, depth, .. } => {
                        for stream in &streams[*agent] {
                            let period = (stream.row.period * i128::from((*every).max(1))).max(*number);
                            let late = lateness(stream, responses[*agent]);
                            by_others.push(flow(period, late, Some(*agent), *depth));
                        }
                    }
                }
            }
            let gap = numbers.least_gap;
            let rate: f64 = by_others.iter().map(|flow| gap as f64 / flow.row.period as f64).sum();
            let burst = by_others.iter().any(|flow| flow.row.jitter > gap);
            if gap > 0 && (rate >= 1.0 || burst) {
                // Steps begin so far apart, whatever comes.
                let after = by_others.first().and_then(|flow| flow.after);
                by_others = vec![flow(gap, 0, after, 0)];
            }
            by_clock.extend(by_others);
            streams[*at] = by_clock;
        }
        streams
    }

    /// From what made an agent run to the end of its step at worst.
    fn response(&self, streams: &Streams, before: &Responses, at: usize) -> Option<i128> {
        if !self.system.is_in_real_time(at) {
            return None;
        }
        let as_on_one = self.response_on_one(streams, at);
        let may = self.system.executors[self.system.agents[at].executor].may;
        let count = self.system.processors.clamp(1, 64);
        match (may & Mask::MAX >> (64 - count)).count_ones() {
            0 | 1 => as_on_one,
            several => {
                let on_several = self.response_on_several(streams, before, at, several.into());
                as_on_one.into_iter().chain(on_several).min()
            }
        }
    }

    /// As long as its executor waits for a processor, all of them are at work for those who go before it. How much work of others falls into a
    /// time says how late they are themselves.
    fn response_on_several(
        &self,
        streams: &Streams,
        before: &Responses,
        at: usize,
        processors: i128,
    ) -> Option<i128> {
        let own = self.system.agents[at].executor;
        let numbers = &self.agents[at];
        let (mut beside, mut above) = (Vec::new(), Vec::new());
        for (other, agent) in self.system.agents.iter().enumerate() {
            if !self.system.goes_before(agent.executor, own) || (other == at && streams[at].len() < 2) {
                continue;
            }
            // Who has no bound himself leaves no more behind than one who passes releases over, or whose mailbox is full.
            let late = |flow: &Flow| match other == at {
                true => flow.row.jitter + numbers.deadline,
                false => lateness(flow, before[other]),
            };
            let work = streams[other].iter().map(|flow| Carried { row: flow.row, late: late(flow) });
            if agent.executor == own { beside.extend(work) } else { above.extend(work) }
        }
        // One step at a time: the one before must be over when the next message comes.
        let room = streams[at].iter().map(|flow| flow.row.period - flow.row.jitter).min()?;
        let limit = room.min(numbers.deadline);
        let sum = |work: &[Carried], ready: i128| work.iter().map(|work| work.within(ready)).sum::<i128>();
        // Where all that falls into a time fits into it, that time is long enough. Only parts of the deadline are tried, and what is told is the
        // work: so that a longer step never gives a shorter response.
        let deadline = numbers.deadline.max(1);
        // The first whole tick of a part that is no less.
        let part = |time: i128| {
            let parts = ((time - 1) << GRAIN) / deadline + 1;
            (parts * deadline + (1 << GRAIN) - 1) >> GRAIN
        };
        let mut ready = part(numbers.cost.max(1));
        while ready <= limit {
            let all = numbers.cost + sum(&beside, ready) + sum(&above, ready) / processors;
            if all <= ready {
                return Some(all);
            }
            ready = part(all);
        }
        None
    }

    /// The same as if all processors were one.
    fn response_on_one(&self, streams: &[Vec<Flow>], at: usize) -> Option<i128> {
        let longest = streams.iter().flatten().map(|flow| flow.row.period).max().unwrap_or(1);
        let limit = longest.max(self.agents[at].deadline).saturating_mul(LONG);
        let own = self.system.agents[at].executor;
        let mut before: Vec<Row> = Vec::new();
        let mut longest_other = 0;
        for (other, agent) in self.system.agents.iter().enumerate() {
            if other == at || !self.system.goes_before(agent.executor, own) {
                continue;
            }
            before.extend(streams[other].iter().map(|flow| flow.row));
            if agent.executor == own {
                longest_other = longest_other.max(self.agents[other].cost);
            }
        }
        let mut worst = Some(0);
        for (place, flow) in streams[at].iter().enumerate() {
            let mut before = before.clone();
            before.extend(
                streams[at].iter().enumerate().filter(|(other, _)| *other != place).map(|(_, flow)| flow.row),
            );
            let own = Row { blocking: longest_other, ..flow.row };
            worst = worst.zip(longest_wait(&own, &before, limit)).map(|(a, b)| a.max(b));
        }
        worst
    }

    fn told(&self, streams: &[Vec<Flow>], responses: &[Option<i128>]) -> Vec<Found> {
        let time = |ticks: i128| Exact::new(ticks, self.ticks);
        let stream = |flow: &Flow| Stream {
            period: time(flow.row.period),
            jitter: time(flow.row.jitter),
            after: flow.after,
        };
        let found = streams.iter().zip(responses).zip(&self.agents);
        found
            .map(|((streams, response), numbers)| Found {
                streams: streams.iter().map(stream).collect(),
                response: response.map(time),
                meets: response.is_some_and(|response| response <= numbers.deadline),
            })
            .collect()
    }
}

/// The work of a stream that is late itself.
struct Carried {
    row: Row,
    /// How long after its arrival a job may end.
    late: i128,
}

impl Carried {
    /// How much of it falls into a time of this length at most: when the first job ends as late as it may, and all others as soon as they may.
    fn within(&self, length: i128) -> i128 {
        let Row { cost, period, .. } = self.row;
        let time = length + self.late - cost;
        let whole = time.max(0) / period;
        whole * cost + (time - whole * period).clamp(0, cost)
    }
}

/// How late what an agent sends may be that runs for such a stream and takes so long.
///
/// Where its response has no bound, or a longer one: releases by the clock that are passed over are not made up for, so its steps begin less than
/// a period late, and end one after another. Of messages no more than the mailbox holds are waiting for it.
fn lateness(stream: &Flow, response: Option<i128>) -> i128 {
    let Row { period, jitter, .. } = stream.row;
    let bound = match stream.after {
        None => 2 * period,
        Some(_) => jitter.saturating_add(period.saturating_mul(i128::from(stream.depth) + 2)),
    };
    response.map_or(bound, |response| jitter.saturating_add(response).min(bound))
}

/// From the moment when a job becomes ready to its end at worst, also where the one before is not done yet; nothing beyond the limit.
fn longest_wait(own: &Row, before: &[Row], limit: i128) -> Option<i128> {
    let share: f64 = before.iter().map(Row::share).sum();
    if share + own.share() > 1.0 + 1e-12 {
        return None;
    }
    let late: f64 = before.iter().map(|row| row.share() * row.jitter as f64).sum();
    let mut worst = 0;
    let mut jobs = 1;
    let mut ready = own.cost + own.blocking;
    loop {
        let work = own.cost.saturating_mul(jobs).saturating_add(own.blocking);
        // It cannot be less: w ≥ work + Σ U (w + J). Rounded down, as far as numbers go.
        let least = (work as f64 + late) / (1.0 - share).max(1e-12) * (1.0 - 1e-9) - 1.0;
        if least > limit as f64 {
            return None;
        }
        ready = ready.max(work).max(least as i128);
        loop {
            let all = before.iter().fold(work, |sum, row| sum.saturating_add(row.work_within(ready.max(1))));
            if all == ready {
                break;
            }
            if all > limit {
                return None;
            }
            ready = all;
        }
        // The last of them became ready no earlier than this after the first.
        let came = ((jobs - 1) * own.period - own.jitter).max(0);
        worst = worst.max(ready - came);
        if ready <= jobs * own.period - own.jitter {
            return Some(worst);
        }
        jobs += 1;
    }
}

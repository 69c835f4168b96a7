//! What an executor under `SCHED_DEADLINE` asks of the kernel: processor time within a deadline, in each period.

use types::Duration;

use crate::executor::Timing;
use crate::plan::AgentPlan;
use crate::request::Refusal;

/// What the runtime needs around a step: waking, choosing, counting.
const AROUND: Duration = Duration::micros(20);
/// The kernel gives no less.
const LEAST: Duration = Duration(1024);
/// The periods that the kernel takes, unless it was told otherwise.
const PERIODS: (Duration, Duration) = (Duration::micros(100), Duration::micros(1 << 22));
/// By what part the kernel's period is shorter than the agent's, where the deadline leaves room for it. The kernel lets a thread whose deadline is
/// shorter than its period go on no sooner than a period after it was woken last: with equal periods all steps after a late one were as late.
const SHORTER: i64 = 32;

/// Processor time that a thread gets within a deadline, in each period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Budget {
    pub runtime: Duration,
    pub deadline: Duration,
    pub period: Duration,
}

impl Budget {
    /// As good as none.
    pub(crate) const NONE: Budget = Budget { runtime: LEAST, deadline: PERIODS.1, period: PERIODS.1 };
}

impl core::fmt::Display for Budget {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "deadline {}/{}/{}", self.runtime, self.deadline, self.period)
    }
}

/// What an agent needs that has an executor under `SCHED_DEADLINE`, or all that is against it.
///
/// One that runs by its period and for messages can have to make a step for each of the two, one after the other; and one more where it says how
/// often it asks for steps itself.
pub(crate) fn budget_of(plan: &AgentPlan, timing: &Timing) -> Result<Budget, Vec<Refusal>> {
    let name = &plan.name;
    let mut against = Vec::new();
    let runs_for_messages = !plan.on.is_empty();
    if runs_for_messages && plan.min_gap <= Duration::ZERO {
        let what = format!("messages make {name} run, and under \"deadline\" it needs a least time between");
        against.push(Refusal::new(what).help("write min_gap = \"10ms\", say"));
    }
    // What can make it run, and how often at most.
    let paces = [timing.period, if runs_for_messages { plan.min_gap } else { Duration::ZERO }, plan.wake_gap];
    let paces = paces.into_iter().filter(|pace| *pace > Duration::ZERO);
    let steps = paces.clone().count().max(1) as i64;
    let pace = paces.min().unwrap_or(Duration::ZERO);
    let (shortest, longest) = PERIODS;
    let is_paced = pace > Duration::ZERO;
    if is_paced && !(shortest..=longest).contains(&pace) {
        against.push(Refusal::new(format!(
            "{name} runs every {pace}; the kernel knows periods from {shortest} to {longest} under \"deadline\""
        )));
    }
    let deadline = if is_paced { timing.deadline.min(pace) } else { timing.deadline };
    if deadline < LEAST {
        against.push(Refusal::new(format!(
            "the deadline of {name} is {deadline}; the kernel gives no less than {LEAST} under \"deadline\""
        )));
    }
    let Some(cost) = plan.cost_in_all(&[]) else {
        let what = format!("{name} has no cost, and under \"deadline\" it gets as much time as it says");
        against.push(Refusal::new(what).help("write cost = \"2ms\", say: what a step takes at worst"));
        return Err(against);
    };
    if cost * steps > deadline {
        let each = match (steps, plan.wake_gap > Duration::ZERO) {
            (1, _) => "",
            (2, false) => " for each of a step by its period and one for a message",
            _ => " for each of the steps that can come at once",
        };
        against.push(Refusal::new(format!("{name} needs {cost}{each}, and has {deadline} for it")));
    }
    if !against.is_empty() {
        return Err(against);
    }
    let needed = whole_micros((cost + Duration(cost.0 / 5) + AROUND) * steps + Duration(999));
    let period = if deadline < pace {
        deadline.max(whole_micros(Duration(pace.0 - pace.0 / SHORTER))).max(shortest)
    } else {
        pace
    };
    Ok(Budget { runtime: needed.min(deadline), deadline, period })
}

fn whole_micros(span: Duration) -> Duration {
    Duration(span.0 / 1000 * 1000)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::router::timing_of;

    fn agent(cost: i64, period: i64, deadline: i64, gap: i64) -> AgentPlan {
        let time = |micros: i64| (micros > 0).then(|| Duration::micros(micros));
        AgentPlan {
            name: "arm".into(),
            cost: time(cost),
            period: time(period),
            deadline: time(deadline),
            min_gap: Duration::micros(gap),
            on: if gap != 0 { vec!["to".into()] } else { Vec::new() },
            ..AgentPlan::default()
        }
    }

    fn told(agent: &AgentPlan) -> String {
        match budget_of(agent, &timing_of(agent).unwrap()) {
            Ok(budget) => budget.to_string(),
            Err(against) => against.into_iter().map(|refusal| refusal.what).collect::<Vec<_>>().join("; "),
        }
    }

    #[test]
    fn an_agent_gets_its_cost_and_something_more_up_to_its_deadline() {
        assert_eq!(told(&agent(2000, 10_000, 0, 0)), "deadline 2420us/10ms/10ms");
        assert_eq!(told(&agent(2000, 32_000, 2100, 0)), "deadline 2100us/2100us/31ms");
        assert_eq!(told(&agent(2000, 32_000, 31_500, 0)), "deadline 2420us/31500us/31500us");
        // By messages alone, within 100 ms as usual; and by the clock as well.
        assert_eq!(told(&agent(1000, 0, 0, 8000)), "deadline 1220us/8ms/8ms");
        assert_eq!(told(&agent(1000, 20_000, 0, 8000)), "deadline 2440us/8ms/8ms");
        assert_eq!(told(&agent(1, 100, 50, 0)), "deadline 22us/50us/100us");
        // And when it asks for it, no sooner than every 5 ms.
        let asks = |agent: AgentPlan| AgentPlan { wake_gap: Duration::millis(5), ..agent };
        assert_eq!(told(&asks(agent(1000, 20_000, 0, 8000))), "deadline 3660us/5ms/5ms");
        assert_eq!(told(&asks(agent(1000, 20_000, 0, 0))), "deadline 2440us/5ms/5ms");
        let all = "arm needs 2ms for each of the steps that can come at once, and has 5ms for it";
        assert_eq!(told(&asks(agent(2000, 20_000, 0, 8000))), all);
    }

    #[test]
    fn all_that_is_against_it_is_told_at_once() {
        let mut event = agent(0, 0, 0, 0);
        event.on.push("to".into());
        let all = "messages make arm run, and under \"deadline\" it needs a least time between; \
            arm has no cost, and under \"deadline\" it gets as much time as it says";
        assert_eq!(told(&event), all);
        assert_eq!(told(&agent(3000, 10_000, 2000, 0)), "arm needs 3ms, and has 2ms for it");
        assert!(told(&agent(3000, 10_000, 0, 5000)).starts_with("arm needs 3ms for each of a step by its"));
        assert!(told(&agent(3000, 5_000_000, 0, 0)).ends_with("from 100us to 4194304us under \"deadline\""));
        let mut short = agent(0, 10_000, 0, 0);
        (short.cost, short.deadline) = (Some(Duration(500)), Some(Duration(600)));
        assert_eq!(
            told(&short),
            "the deadline of arm is 600ns; the kernel gives no less than 1024ns under \"deadline\""
        );
    }
}

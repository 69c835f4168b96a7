//! The coordinator: one command for the drive out of the wishes of many.
//!
//! ```text
//!  offers ──▶ × weight of the decision and of the mode ──▶ veto of safety ──▶ one by the method of the mode ──▶ command
//! ```
//!
//! The methods are those of [`motion::coordination`]: competitive by priority or by layers, cooperative as vectors or by fuzzy logic. Which
//! one counts, and who is heard at all, a mode says, and it may change with every message; without modes the parameter says it, and all are heard.

use motion::coordination::coordinate;
use motion::fusion::{Cause, Held, Inference, Moment, Parameters, Veto};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Coordination, Decision, MOST_AGENTS, Mode, Odometry, Offer, Safety, Twist};
use types::params::Params;
use types::{AgentId, Duration, Sequence, Text, Time};

use crate::shared::{Dated, Offers};

/// How offers are fused.
#[derive(Clone, Debug, Params)]
pub struct CoordinatorParams {
    /// How one command is made while no mode says it: "fuzzy", "vector-sum", "priority" or "subsumption". Without modes all have the same priority, and the greater weight stands above.
    #[param(default = "fuzzy", words = Coordination::WORDS)]
    pub coordination: Text<12>,
    /// What "much" means in speed (m/s). 0.6 is the highest speed of an indoor robot.
    #[param(default = 0.6, min = 0.01, max = 10.0)]
    pub linear_max: f64,
    /// What "much" means in turning (rad/s). 1 turns around in three seconds.
    #[param(default = 1.0, min = 0.01, max = 10.0)]
    pub angular_max: f64,
    /// Change of speed for the greatest "speed up" (m/s). 0.3: no one word takes it from rest to full speed.
    #[param(default = 0.3, min = 0.0, max = 10.0)]
    pub speed_change: f64,
    /// Turn rates below this take no side (rad/s). 0.05: the noise of a controller shall not vote.
    #[param(default = 0.05, min = 0.0, max = 1.0)]
    pub straight: f64,
    /// How long the last command is held when nobody offers one (time). 300 ms bridges one missed reading of a sonar at 4 Hz.
    #[param(default = Duration::millis(300), min = 0.0, max = 10.0)]
    pub hold: Duration,
    /// Words by weighted means of their centres instead of areas: for the hardest real time, but hedges then have no effect.
    #[param(default = false)]
    pub fast_words: bool,
    /// Weight of an agent of which no decision speaks (0 to 1). 1: nobody is silenced by being forgotten in a table.
    #[param(default = 1.0, min = 0.0, max = 1.0)]
    pub unlisted: f64,
    /// A verdict of the safety monitor older than this forbids to move forward (time). 700 ms is two missed readings of a sonar at 4 Hz.
    #[param(default = Duration::millis(700), min = 0.01, max = 60.0)]
    pub safety_age: Duration,
}

impl CoordinatorParams {
    fn fusion(&self) -> Parameters {
        Parameters {
            inference: if self.fast_words { Inference::Sugeno } else { Inference::Mamdani },
            linear_max: self.linear_max,
            angular_max: self.angular_max,
            speed_change: self.speed_change,
            straight: self.straight,
            hold: self.hold,
            ..Parameters::default()
        }
    }
}

fn method<const N: usize>(word: &Text<N>) -> Option<Coordination> {
    Coordination::ALL.into_iter().find(|method| method.word() == word.as_str())
}

/// Chooses and fuses what many agents wish the drive to do: each wish counts with the weight that the decision gives its sender, and
/// safety has its veto before they are fused.
#[derive(Agent)]
pub struct Coordinator {
    /// Wishes in numbers and in words, of any number of agents.
    offers: Input<Offer>,
    /// The weights of the agents, by name.
    decision: Input<Decision>,
    /// Who is heard, who stands above whom, and how one command is made of it. Once wired, nobody is heard before a mode says so.
    mode: Input<Mode>,
    /// What is allowed. Once wired, its silence forbids to move forward.
    safety: Input<Safety>,
    /// How the robot moves: "speed up" begins there.
    odometry: Input<Odometry>,
    /// What the drive shall do.
    #[port(history = 64)]
    command: Output<Twist>,
    params: CoordinatorParams,
    council: Council,
}

impl Agent for Coordinator {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(offer) = self.offers.take() {
            self.council.offers.put(offer.header().sender, *offer, step.now);
        }
        if let Some(decision) = self.decision.latest() {
            self.council.listen(&decision, |name| step.agent_named(name));
        }
        if let Some(mode) = self.mode.latest() {
            self.council.change(&mode, |name| step.agent_named(name));
        } else if self.mode.is_wired() && self.council.mode.is_none() {
            self.council.change(&Mode::default(), |_| None);
        }
        if let Some(received) = self.safety.newest() {
            self.council.safety = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        if let Some(odometry) = self.odometry.latest() {
            self.council.motion = odometry.twist;
        }
        let command = self.council.command(&self.params, self.safety.is_wired(), step.now);
        // After a silence the zero is sent as well: the drive need not wait until the last command is too old.
        self.command.send(command);
        Ok(())
    }
}

/// What was offered and who counts how much.
#[derive(Clone, Copy, Debug, Default)]
struct Council {
    offers: Offers,
    weights: Sequence<(AgentId, f64), MOST_AGENTS>,
    mode: Option<Heard>,
    safety: Option<Dated<Safety>>,
    motion: Twist,
    held: Held,
    silent: bool,
}

/// A mode, with the numbers of the agents that it names.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Heard {
    name: types::Name,
    method: Coordination,
    rows: Sequence<(AgentId, f64, u32), MOST_AGENTS>,
}

impl Council {
    /// Takes over a mode. With another one what was commanded in the last is not held.
    fn change(&mut self, mode: &Mode, find: impl Fn(&str) -> Option<AgentId>) {
        let row =
            |row: &types::messages::ModeRow| Some((find(row.agent.as_str())?, row.weight, row.priority));
        let heard = Heard {
            name: mode.name,
            method: mode.coordination,
            rows: mode.rows.iter().filter_map(row).collect(),
        };
        if self.mode.replace(heard).is_some_and(|before| before.name != heard.name) {
            self.held = Held::default();
        }
    }

    /// Takes over a decision. Names are looked up each time: an agent that was taken out and put in again has another number.
    fn listen(&mut self, decision: &Decision, find: impl Fn(&str) -> Option<AgentId>) {
        let rows = decision.rows.iter();
        self.weights = rows.filter_map(|row| Some((find(row.agent.as_str())?, row.weight))).collect();
    }

    fn command(&mut self, params: &CoordinatorParams, guarded: bool, now: Time) -> Twist {
        let moment = Moment { now, present: self.motion, veto: self.veto(params, guarded, now) };
        let (weights, mode) = (&self.weights, &self.mode);
        let decided = |sender| {
            weights.iter().find(|(known, _)| *known == sender).map_or(params.unlisted, |(_, weight)| *weight)
        };
        let (offers, priorities) = self.offers.ranked(|sender| match mode {
            None => (decided(sender), 0),
            Some(mode) => mode
                .rows
                .iter()
                .find(|(known, ..)| *known == sender)
                .map_or((0.0, 0), |(_, weight, priority)| (weight * decided(sender), *priority)),
        });
        let method = match mode {
            Some(mode) => mode.method,
            None => method(&params.coordination).unwrap_or_default(),
        };
        let fused = coordinate(method, &params.fusion(), offers, priorities, &moment, &mut self.held);
        self.offers.forget_expired(now);
        let silent = fused.cause == Cause::Silence;
        if silent && !self.silent {
            runtime::note!("nobody offers a command that counts: stop");
        }
        self.silent = silent;
        fused.twist
    }

    fn veto(&self, params: &CoordinatorParams, guarded: bool, now: Time) -> Veto {
        match Dated::fresh(&self.safety, now, params.safety_age) {
            Some(safety) => Veto {
                forward: !safety.blind && safety.linear_max > 0.0,
                linear_max: safety.linear_max,
                wider: safety.wider,
            },
            None if guarded => Veto { forward: false, ..Veto::NONE },
            None => Veto::NONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::Row;

    const SAFETY: AgentId = AgentId(1);
    const WALL: AgentId = AgentId(2);

    fn find(name: &str) -> Option<AgentId> {
        match name {
            "safety" => Some(SAFETY),
            "wall" => Some(WALL),
            _ => None,
        }
    }

    fn decide(rows: &[(&str, f64)]) -> Decision {
        let row =
            |(agent, weight): &(&str, f64)| Row { agent: (*agent).into(), weight: *weight, ..Row::default() };
        Decision { rows: rows.iter().map(row).collect(), ..Decision::default() }
    }

    fn wish(linear: f64, angular: f64) -> Offer {
        Offer {
            twist: Twist::new(linear, angular),
            weight: 1.0,
            valid_until: Time::from_seconds(1.0),
            ..Offer::default()
        }
    }

    fn council(rows: &[(&str, f64)]) -> Council {
        let mut council = Council::default();
        council.listen(&decide(rows), find);
        council.offers.put(SAFETY, wish(0.0, 0.7), Time::ZERO);
        council.offers.put(WALL, wish(0.4, -0.2), Time::ZERO);
        council
    }

    #[test]
    fn the_decision_says_whose_wish_counts() {
        let params = CoordinatorParams::default();
        let drive = |rows: &[(&str, f64)]| council(rows).command(&params, false, Time::ZERO);
        assert_eq!(drive(&[("safety", 1.0), ("wall", 0.0)]), Twist::new(0.0, 0.7));
        assert_eq!(drive(&[("safety", 0.0), ("wall", 1.0)]), Twist::new(0.4, -0.2));
        assert_eq!(drive(&[("safety", 0.0)]), Twist::new(0.4, -0.2), "who is not listed counts");
    }

    fn mode(name: &str, coordination: Coordination, rows: &[(&str, u32)]) -> Mode {
        let row = |(agent, priority): &(&str, u32)| types::messages::ModeRow {
            agent: (*agent).into(),
            weight: 1.0,
            priority: *priority,
        };
        Mode { name: name.into(), coordination, rows: rows.iter().map(row).collect(), ..Mode::default() }
    }

    #[test]
    fn a_mode_says_who_is_heard_and_how_and_may_change_while_it_runs() {
        let params = CoordinatorParams::default();
        let mut council = council(&[]);
        let mut drive = |mode: &Mode| {
            council.change(mode, find);
            council.command(&params, false, Time::ZERO)
        };
        let (safety_first, wall_first) = ([("safety", 2), ("wall", 1)], [("safety", 1), ("wall", 2)]);
        let by_priority = |rows| mode("one", Coordination::Priority, rows);
        assert_eq!(drive(&by_priority(&safety_first)), Twist::new(0.0, 0.7));
        assert_eq!(drive(&by_priority(&wall_first)), Twist::new(0.4, -0.2));
        let sum = drive(&mode("sum", Coordination::VectorSum, &wall_first));
        assert!((sum.linear - 0.2).abs() < 1e-12 && (sum.angular - 0.25).abs() < 1e-12, "{sum:?}");
        assert_eq!(
            drive(&by_priority(&[("safety", 1)])),
            Twist::new(0.0, 0.7),
            "who is not named is not heard"
        );
        assert_eq!(
            drive(&mode("idle", Coordination::Priority, &[])),
            Twist::ZERO,
            "at once: nothing is held"
        );
    }

    #[test]
    fn a_name_is_looked_up_with_every_decision() {
        let mut council = Council::default();
        let decision = decide(&[("safety", 0.25), ("wall", 1.0)]);
        council.listen(&decision, |name| find(name).filter(|id| *id == WALL));
        assert_eq!(*council.weights, [(WALL, 1.0)]);
        council.listen(&decision, find);
        assert_eq!(*council.weights, [(SAFETY, 0.25), (WALL, 1.0)]);
        council.listen(&decision, |name| find(name).map(|id| AgentId(id.0 + 10)));
        assert_eq!(*council.weights, [(AgentId(11), 0.25), (AgentId(12), 1.0)], "put in again");
    }

    #[test]
    fn safety_forbids_to_move_but_not_to_turn_and_its_silence_does_too() {
        let params = CoordinatorParams::default();
        let mut council = council(&[("safety", 0.0), ("wall", 1.0)]);
        assert_eq!(council.command(&params, true, Time::ZERO), Twist::new(0.0, -0.2), "unheard");
        let allowed = Safety { linear_max: 0.3, ..Safety::default() };
        council.safety = Some(Dated { value: allowed, stamp: Time::ZERO });
        assert_eq!(council.command(&params, true, Time::ZERO), Twist::new(0.3, -0.2));
        let late = Time::ZERO + params.safety_age + Duration::nanos(1);
        assert_eq!(council.command(&params, true, late), Twist::new(0.0, -0.2), "too old");
        let blind = Safety { blind: true, linear_max: 0.3, ..Safety::default() };
        council.safety = Some(Dated { value: blind, stamp: Time::ZERO });
        assert_eq!(council.command(&params, true, Time::ZERO), Twist::new(0.0, -0.2), "blind");
    }

    #[test]
    fn who_falls_silent_is_held_and_then_stops() {
        let params = CoordinatorParams::default();
        let mut council = council(&[("safety", 0.0), ("wall", 1.0)]);
        let end = Time::from_seconds(1.0);
        council.command(&params, false, end);
        assert_eq!(council.command(&params, false, end + params.hold).linear, 0.4);
        assert_eq!(council.command(&params, false, end + params.hold + Duration::nanos(1)), Twist::ZERO);
    }
}

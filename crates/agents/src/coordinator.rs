//! The coordinator: one command for the drive out of the wishes of many.
//!
//! ```text
//!  offers ──▶ × weight of the decision ──▶ veto of safety ──▶ fusion ──▶ command
//! ```

use motion::fusion::{Cause, Held, Inference, Moment, Parameters, Veto, fuse};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Decision, Odometry, Offer, Safety, Twist};
use types::params::Params;
use types::{AgentId, Duration, Sequence, Time};

use crate::shared::{Dated, Offers};

/// How offers are fused.
#[derive(Clone, Debug, Params)]
pub struct CoordinatorParams {
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

/// Chooses and fuses what many agents wish the drive to do: each wish counts with the weight that the decision gives its sender, and
/// safety has its veto before they are fused.
#[derive(Agent)]
pub struct Coordinator {
    /// Wishes in numbers and in words, of any number of agents.
    offers: Input<Offer>,
    /// The weights of the agents, by name.
    decision: Input<Decision>,
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
    weights: Sequence<(AgentId, f64), 12>,
    safety: Option<Dated<Safety>>,
    motion: Twist,
    held: Held,
    silent: bool,
}

impl Council {
    /// Takes over a decision. Names are looked up each time: an agent that was taken out and put in again has another number.
    fn listen(&mut self, decision: &Decision, find: impl Fn(&str) -> Option<AgentId>) {
        let rows = decision.rows.iter();
        self.weights = rows.filter_map(|row| Some((find(row.agent.as_str())?, row.weight))).collect();
    }

    fn command(&mut self, params: &CoordinatorParams, guarded: bool, now: Time) -> Twist {
        let moment = Moment { now, present: self.motion, veto: self.veto(params, guarded, now) };
        let weights = &self.weights;
        let offers = self.offers.weighed(|sender| {
            weights.iter().find(|(known, _)| *known == sender).map_or(params.unlisted, |(_, weight)| *weight)
        });
        let fused = fuse(&params.fusion(), offers, &moment, &mut self.held);
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

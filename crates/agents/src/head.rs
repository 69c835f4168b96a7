//! The pan-tilt head: the agent in front of its two motors. What they cannot do does not pass.

use motion::fusion::{self, Actuator, Cause, Held, Moment, Veto, fuse};
use runtime::{Agent, Fault, Input, Output, Step};
use types::messages::{Head, Offer, Twist};
use types::params::Params;
use types::{Duration, Time};

use crate::shared::{Dated, Offers};

/// What the head can do.
#[derive(Clone, Debug, Params)]
pub struct HeadParams {
    /// Farthest turn to either side (rad). 1.4 is 80°, what the cables of a common head allow.
    #[param(default = 1.4, min = 0.0, max = 3.2)]
    pub pan_max: f64,
    /// Farthest nod up or down (rad). 0.6 is 34°.
    #[param(default = 0.6, min = 0.0, max = 1.6)]
    pub tilt_max: f64,
    /// Highest speed of both joints (rad/s). 1.5 smears a picture of 15 ms by a degree.
    #[param(default = 1.5, min = 0.01, max = 50.0)]
    pub rate_max: f64,
    /// What "much" means in words (rad/s). 0.8 is as fast as one can follow by eye.
    #[param(default = 0.8, min = 0.01, max = 50.0)]
    pub word_rate: f64,
}

/// Turns the head to where it is wished, as far and as fast as its motors can; orders of people come first.
#[derive(Agent)]
#[agent(kind = "head")]
pub struct PanTilt {
    /// Where to look. The newest wish counts until another comes.
    wishes: Input<Head>,
    /// Orders of people, in words such as "look up a bit" or in rates; while one holds, no wish is heard.
    words: Input<Offer>,
    /// Where the head really looks.
    #[robot("head")]
    position: Input<Head>,
    /// Where the motors shall turn it.
    #[robot("head_to")]
    command: Output<Head>,
    /// Where the head really looks, or was last told to.
    #[port(history = 64)]
    state: Output<Head>,
    params: HeadParams,
    neck: Neck,
}

impl Agent for PanTilt {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(offer) = self.words.take() {
            self.neck.orders.put(offer.header().sender, *offer, step.now);
        }
        if let Some(wish) = self.wishes.latest() {
            self.neck.wish(wish);
        }
        if let Some(received) = self.position.newest() {
            self.neck.position = Some(Dated { value: *received, stamp: received.header().stamp });
        }
        let command = self.neck.command(&self.params, step.now);
        self.command.send(command);
        self.state.send(self.neck.position.map_or(command, |position| position.value));
        Ok(())
    }
}

/// What was wished, and what was commanded.
#[derive(Clone, Copy, Debug, Default)]
struct Neck {
    goal: Option<Head>,
    orders: Offers,
    position: Option<Dated<Head>>,
    commanded: Option<(Head, Time)>,
}

impl Neck {
    /// A wish that is not two numbers is no wish.
    fn wish(&mut self, wish: Head) {
        if wish.pan.is_finite() && wish.tilt.is_finite() {
            self.goal = Some(wish);
        }
    }

    fn command(&mut self, params: &HeadParams, now: Time) -> Head {
        let start = self.position.map_or(Head::default(), |position| position.value);
        let (at, then) = self.commanded.unwrap_or((start, now));
        let dt = (now - then).seconds().clamp(0.0, 1.0);
        if let Some(rates) = self.ordered(params, now) {
            // The person's word leaves its goal behind: when it is over, the head stays there until the next wish.
            let goal = Head { pan: at.pan + rates.angular * dt, tilt: at.tilt + rates.linear * dt };
            self.goal = Some(within(params, goal));
        }
        let goal = within(params, self.goal.unwrap_or(at));
        let most = params.rate_max * dt;
        let next = Head {
            pan: at.pan + (goal.pan - at.pan).clamp(-most, most),
            tilt: at.tilt + (goal.tilt - at.tilt).clamp(-most, most),
        };
        self.commanded = Some((next, now));
        next
    }

    /// Rates that people order: pan as the turn rate, tilt as the speed.
    fn ordered(&mut self, params: &HeadParams, now: Time) -> Option<Twist> {
        self.orders.forget_expired(now);
        let fusion = fusion::Parameters {
            actuator: Actuator::Head,
            linear_max: params.word_rate,
            angular_max: params.word_rate,
            hold: Duration::ZERO,
            ..fusion::Parameters::default()
        };
        let moment = Moment { now, present: Twist::ZERO, veto: Veto::NONE };
        let fused = fuse(&fusion, self.orders.weighed(|_| 1.0), &moment, &mut Held::default());
        matches!(fused.cause, Cause::Offers | Cause::Stop).then_some(fused.twist)
    }
}

fn within(params: &HeadParams, goal: Head) -> Head {
    Head {
        pan: goal.pan.clamp(-params.pan_max, params.pan_max),
        tilt: goal.tilt.clamp(-params.tilt_max, params.tilt_max),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motion::word;
    use types::AgentId;
    use types::messages::Drive;

    /// The commands of a second at 20 Hz.
    fn second(mut neck: Neck) -> Vec<Head> {
        let params = HeadParams::default();
        (0..=20).map(|i| neck.command(&params, Time::ZERO + Duration::millis(50 * i))).collect()
    }

    #[test]
    fn it_turns_no_faster_and_no_farther_than_it_can() {
        let mut neck = Neck::default();
        neck.wish(Head { pan: 3.0, tilt: -0.2 });
        neck.wish(Head { pan: f64::NAN, tilt: 0.0 });
        let commands = second(neck);
        let fastest = commands.windows(2).map(|pair| (pair[1].pan - pair[0].pan).abs()).fold(0.0, f64::max);
        assert!((fastest - 1.5 * 0.05).abs() < 1e-12);
        assert_eq!(*commands.last().unwrap(), Head { pan: 1.4, tilt: -0.2 });
    }

    #[test]
    fn it_begins_where_it_is() {
        let at = Head { pan: 0.5, tilt: 0.1 };
        let neck = Neck { position: Some(Dated { value: at, stamp: Time::ZERO }), ..Neck::default() };
        assert!(second(neck).iter().all(|command| *command == at));
    }

    #[test]
    fn a_persons_word_comes_before_a_wish_while_it_holds() {
        let mut neck = Neck::default();
        neck.wish(Head { pan: 1.0, tilt: 0.0 });
        let word = word::parse("turn right").unwrap();
        let valid_until = Time::ZERO + Duration::millis(500);
        let order = Offer { word, weight: 1.0, valid_until, form: Drive::Linguistic, ..Offer::default() };
        neck.orders.put(AgentId(3), order, Time::ZERO);
        let commands = second(neck);
        let last = commands.last().unwrap();
        assert!(commands[10].pan < -0.1, "{:?}", commands[10]);
        assert_eq!(last.pan, commands[10].pan, "it stays where the person left it");
    }
}

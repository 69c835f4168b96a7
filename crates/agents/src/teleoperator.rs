//! The teleoperator: orders of people who drive the robot by hand.
//!
//! ```text
//!  drive ──▶ order, for as long as it is said ──▶ drive: people come before the robot's wishes, safety before people
//!  release ▶    │
//!               └▶ by hand, or not any more ──▶ process supervisor: mode "teleoperation", and back
//! ```
//!
//! An order goes to the drive at once, without waiting for the mode. It holds for a short time: who drives by hand says it again and again, and
//! who falls silent lets go.

use runtime::{Agent, Fault, Output, Service, Step};
use types::messages::{Answer, ByHand, Halt, Manoeuvre, Offer, Twist};
use types::params::Params;
use types::{Duration, Time};

/// How long orders hold.
#[derive(Clone, Debug, Params)]
pub struct TeleoperatorParams {
    /// How long an order holds that does not say it (time). 500 ms is some repetitions of a key that is held down.
    #[param(default = Duration::millis(500), min = 0.05, max = 10.0)]
    pub hold: Duration,
    /// How long an order may hold at most (time): so far the robot drives on when its person falls silent. 2 s at 0.3 m/s are 0.6 m.
    #[param(default = Duration::secs(2), min = 0.05, max = 60.0)]
    pub longest: Duration,
    /// After the end of the last order they have let go (time). 1 s lets people take another key.
    #[param(default = Duration::secs(1), min = 0.0, max = 60.0)]
    pub rest: Duration,
}

/// Takes orders of people to drive so, and tells that they drive by hand.
#[derive(Agent)]
pub struct Teleoperator {
    /// To drive so, as in sinew call hand.drive linear=0.2 angular=0.1 seconds=1.
    drive: Service<Manoeuvre, Answer>,
    /// They let go of it: the robot goes on by itself, at once.
    release: Service<Halt, Answer>,
    /// The order, for the drive.
    orders: Output<Offer>,
    /// Whether they drive: when that changes, and once a second while they do.
    #[port(history = 64)]
    hand: Output<ByHand>,
    params: TeleoperatorParams,
    grip: Grip,
}

/// While people drive that is told again so often: who hears it may have been started anew.
const TELL_AGAIN: Duration = Duration::secs(1);

impl TeleoperatorParams {
    /// What is answered to an order.
    fn said(&self, asked: &Manoeuvre) -> &'static str {
        if Duration::from_seconds(asked.seconds) > self.longest {
            "by hand, but for no longer than its parameter \"longest\": say it again and again"
        } else {
            "by hand"
        }
    }
}

impl Agent for Teleoperator {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let now = step.now;
        while let Some((asked, call)) = self.drive.take() {
            let made = self.grip.order(&self.params, &asked, now);
            if let Ok(order) = made {
                self.orders.send(order);
            }
            let answer = match made {
                Ok(_) => Answer { accepted: true, task: 0, why: self.params.said(&asked).into() },
                Err(why) => Answer { why: why.into(), ..Answer::default() },
            };
            self.drive.answer(&call, answer);
        }
        while let Some((_, call)) = self.release.take() {
            if let Some(last) = self.grip.release(now) {
                self.orders.send(last);
            }
            let why = "the robot goes on by itself".into();
            self.release.answer(&call, Answer { accepted: true, task: 0, why });
        }
        if let Some(news) = self.grip.news(&self.params, now) {
            self.hand.send(news);
        }
        Ok(())
    }
}

/// The last order, and what was told of it.
#[derive(Clone, Copy, Debug, Default)]
struct Grip {
    /// Until when the last order holds.
    until: Option<Time>,
    told: Option<(ByHand, Time)>,
}

impl Grip {
    fn order(
        &mut self,
        params: &TeleoperatorParams,
        asked: &Manoeuvre,
        now: Time,
    ) -> Result<Offer, &'static str> {
        let Manoeuvre { linear, angular, seconds, distance, angle } = *asked;
        if ![linear, angular, seconds].iter().all(|number| number.is_finite()) || seconds < 0.0 {
            return Err("an order is made of numbers, and its seconds are positive");
        }
        if distance != 0.0 || angle != 0.0 {
            return Err("by hand there are speeds; distances and angles are what navigation.drive takes");
        }
        let hold = if seconds > 0.0 { Duration::from_seconds(seconds) } else { params.hold };
        let until = now + hold.min(params.longest);
        self.until = Some(until);
        Ok(by_hand(Twist::new(linear, angular), until))
    }

    /// An order that is over takes the place of the one that holds.
    fn release(&mut self, now: Time) -> Option<Offer> {
        self.until.take().map(|_| by_hand(Twist::ZERO, now))
    }

    fn news(&mut self, params: &TeleoperatorParams, now: Time) -> Option<ByHand> {
        self.until = self.until.filter(|until| now <= *until + params.rest);
        let hand = ByHand { on: self.until.is_some() };
        let is_news =
            self.told.map_or(hand.on, |(told, at)| told != hand || hand.on && now - at >= TELL_AGAIN);
        is_news.then(|| {
            self.told = Some((hand, now));
            hand
        })
    }
}

fn by_hand(twist: Twist, valid_until: Time) -> Offer {
    Offer { twist, weight: 1.0, valid_until, ..Offer::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    #[test]
    fn who_falls_silent_lets_go_a_second_after_the_order_and_who_goes_on_is_told_again() {
        let (params, mut grip) = (TeleoperatorParams::default(), Grip::default());
        assert_eq!(grip.news(&params, at(0)), None);
        let ahead = Manoeuvre { linear: 0.2, ..Manoeuvre::default() };
        let told: Vec<(i64, bool)> = (0..60)
            .map(|i| 100 * i)
            .filter_map(|millis| {
                // A key is held down for two seconds.
                if millis <= 2000 {
                    let order = grip.order(&params, &ahead, at(millis)).unwrap();
                    assert_eq!((order.twist.linear, order.valid_until), (0.2, at(millis + 500)));
                }
                grip.news(&params, at(millis)).map(|hand| (millis, hand.on))
            })
            .collect();
        assert_eq!(told, [(0, true), (1000, true), (2000, true), (3000, true), (3600, false)]);
    }

    #[test]
    fn who_lets_go_is_not_waited_for_and_no_order_holds_for_long() {
        let (params, mut grip) = (TeleoperatorParams::default(), Grip::default());
        let long = Manoeuvre { angular: 0.5, seconds: 60.0, ..Manoeuvre::default() };
        assert!(params.said(&long).contains("\"longest\""));
        assert_eq!(params.said(&Manoeuvre { seconds: 2.0, ..long }), "by hand");
        assert_eq!(grip.order(&params, &long, at(0)).map(|order| order.valid_until), Ok(at(2000)));
        assert_eq!(grip.news(&params, at(0)), Some(ByHand { on: true }));
        let over = grip.release(at(100)).unwrap();
        assert!(over.valid_until <= at(100) && over.twist == Twist::ZERO);
        assert_eq!(grip.news(&params, at(100)), Some(ByHand { on: false }));
        assert_eq!((grip.release(at(200)), grip.news(&params, at(9000))), (None, None));
        for wrong in [
            Manoeuvre { linear: f64::NAN, ..Manoeuvre::default() },
            Manoeuvre { seconds: -1.0, ..Manoeuvre::default() },
            Manoeuvre { distance: 1.0, ..Manoeuvre::default() },
        ] {
            assert!(grip.order(&params, &wrong, at(300)).is_err(), "{wrong:?}");
        }
        assert_eq!(grip.news(&params, at(300)), None, "what is refused takes nothing into its hands");
    }
}

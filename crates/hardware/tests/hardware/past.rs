//! Nothing that can be asked of a gate moves a robot while its latch is set.

use hardware::driver::{Polled, Sink};
use hardware::simulated::{self, Robot as Body, Truth};
use hardware::{Authority, Cause, Gate, Latch, Listening, Policy};
use proptest::prelude::*;
use sim::{Model, WorldPlan};
use types::messages::{Head, Twist};
use types::{Duration, Pose, Time};

struct Deaf;

impl Sink for Deaf {}

/// What can be asked of a gate and its latch, but for the reset.
#[derive(Clone, Debug)]
enum Act {
    Poll,
    Command(u8, i64, f64, f64),
    Head(f64, f64),
    Policy(i64, bool),
    Apply,
    SetAgain,
    Look,
}

fn acts() -> impl Strategy<Value = Act> {
    let number = || prop_oneof![-2.0..2.0f64, Just(f64::NAN), Just(f64::INFINITY), Just(1e300)];
    prop_oneof![
        3 => Just(Act::Poll),
        // Stamps from long ago to far in the future.
        5 => (0..3u8, -5000..5000i64, number(), number()).prop_map(|(who, age, v, w)| Act::Command(who, age, v, w)),
        1 => (number(), number()).prop_map(|(pan, tilt)| Act::Head(pan, tilt)),
        1 => (0..10_000i64, any::<bool>()).prop_map(|(age, latches)| Act::Policy(age, latches)),
        5 => Just(Act::Apply),
        1 => Just(Act::SetAgain),
        1 => Just(Act::Look),
    ]
}

fn raised() -> (Gate, Truth, Latch) {
    let body = Body { name: "h1".into(), model: Model::h1(), start: Pose::new(4.0, 3.0, 0.3), goal: None };
    let (mut bodies, truth) = simulated::raise(&WorldPlan::hall(8.0, 6.0), 5, &[body]).unwrap();
    let latch = Latch::private();
    (Gate::new(bodies.remove(0), latch.clone()), truth, latch)
}

/// How far the robot went (m), after two seconds more in which whatever was asked would show.
fn went(gate: &mut Gate, truth: &Truth, from: Time) -> f64 {
    for cycle in 0..200 {
        let now = from + Duration::millis(10 * cycle);
        gate.poll(now, &Listening::default(), &mut Deaf).unwrap();
        gate.apply(now).unwrap();
    }
    truth.robot("h1").unwrap().truth.distance
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_command_gets_past_a_set_latch(script in proptest::collection::vec(acts(), 1..60), cause in 0..Cause::ALL.len()) {
        let (mut gate, truth, latch) = raised();
        let mut now = Time::ZERO;
        gate.poll(now, &Listening::default(), &mut Deaf).unwrap();
        latch.set(Cause::ALL[cause], now);
        for act in script {
            now += Duration::millis(7);
            match act {
                Act::Poll => prop_assert!(!gate.poll(now, &Listening::ALL, &mut Deaf).unwrap_or(Polled::default()).ended),
                Act::Command(who, age, v, w) => {
                    let authority = [Authority::Robot, Authority::Person, Authority::Referee][usize::from(who)];
                    gate.command(now, authority, now + Duration::millis(age), Twist::new(v, w));
                }
                Act::Head(pan, tilt) => gate.command_head(now, Head { pan, tilt }).unwrap(),
                Act::Policy(age, latches) => {
                    gate.set_policy(Policy { age_limit: Duration::millis(age), ..Policy::default() }, latches);
                }
                Act::Apply => prop_assert_eq!(gate.apply(now).unwrap().verdict.twist, Twist::ZERO),
                Act::SetAgain => latch.clone().set(Cause::Person, now),
                Act::Look => prop_assert!(gate.latch().is_set() && gate.description().beams == 0),
            }
        }
        prop_assert_eq!(went(&mut gate, &truth, now), 0.0);
    }
}

#[test]
fn the_same_command_moves_a_robot_whose_latch_is_clear() {
    let (mut gate, truth, _) = raised();
    gate.poll(Time::ZERO, &Listening::default(), &mut Deaf).unwrap();
    gate.command(Time::ZERO, Authority::Robot, Time::ZERO, Twist::new(0.3, 0.0));
    assert!(went(&mut gate, &truth, Time::ZERO) > 0.01);
}

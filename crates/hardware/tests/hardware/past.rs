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
    Head(i64, f64, f64),
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
        3 => (-5000..5000i64, number(), number()).prop_map(|(age, pan, tilt)| Act::Head(age, pan, tilt)),
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

/// Everything on the robot that an actuator moves.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Moved {
    /// How far it went (m).
    way: f64,
    /// How far it turned (rad).
    turned: f64,
    /// Where the head looks (rad).
    head: (f64, f64),
}

impl Moved {
    /// Whether nothing moved but what is left of a motor's last lag (m, rad).
    fn is(self, other: Moved) -> bool {
        (self.way - other.way).abs() < 1e-9
            && (self.turned - other.turned).abs() < 1e-9
            && self.head == other.head
    }
}

fn moved(truth: &Truth) -> Moved {
    let robot = truth.robot("h1").unwrap();
    Moved { way: robot.truth.distance, turned: robot.truth.turned, head: (robot.head.pan, robot.head.tilt) }
}

/// So many cycles of a gate that is asked nothing.
fn cycles(gate: &mut Gate, from: Time, count: i64) -> Time {
    for cycle in 0..count {
        let now = from + Duration::millis(10 * cycle);
        gate.poll(now, &Listening::default(), &mut Deaf).unwrap();
        gate.apply(now).unwrap();
    }
    from + Duration::millis(10 * count)
}

/// Has everything move: the wheels on a bow, the head to its side.
fn set_in_motion(gate: &mut Gate, now: Time) -> Time {
    gate.command(now, Authority::Robot, now, Twist::new(0.3, 0.5));
    gate.command_head(now, now, Head { pan: 1.2, tilt: 0.2 }).unwrap();
    cycles(gate, now, 20)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_command_gets_past_a_set_latch(script in proptest::collection::vec(acts(), 1..60), cause in 0..Cause::ALL.len()) {
        let (mut gate, truth, latch) = raised();
        let mut now = set_in_motion(&mut gate, Time::ZERO);
        latch.set(Cause::ALL[cause], now);
        // The wheels need a moment to come to rest, nothing else does.
        now = cycles(&mut gate, now, 300);
        let at_rest = moved(&truth);
        for act in script {
            now += Duration::millis(7);
            match act {
                Act::Poll => prop_assert!(!gate.poll(now, &Listening::ALL, &mut Deaf).unwrap_or(Polled::default()).ended),
                Act::Command(who, age, v, w) => {
                    let authority = [Authority::Robot, Authority::Person, Authority::Referee][usize::from(who)];
                    gate.command(now, authority, now + Duration::millis(age), Twist::new(v, w));
                }
                Act::Head(age, pan, tilt) => gate.command_head(now, now + Duration::millis(age), Head { pan, tilt }).unwrap(),
                Act::Policy(age, latches) => {
                    gate.set_policy(Policy { age_limit: Duration::millis(age), ..Policy::default() }, latches);
                }
                Act::Apply => prop_assert_eq!(gate.apply(now).unwrap().verdict.twist, Twist::ZERO),
                Act::SetAgain => latch.clone().set(Cause::Person, now),
                Act::Look => prop_assert!(gate.latch().is_set() && gate.description().beams == 0),
            }
        }
        // Two seconds more, in which whatever was asked would show; and the reset moves nothing either.
        now = cycles(&mut gate, now, 200);
        latch.reset(now);
        gate.command_head(now, now - Duration::millis(5), Head { pan: -1.0, tilt: 0.0 }).unwrap();
        cycles(&mut gate, now, 100);
        prop_assert!(moved(&truth).is(at_rest), "{:?}, was {at_rest:?}", moved(&truth));
    }
}

#[test]
fn the_same_commands_move_everything_while_the_latch_is_clear() {
    let (mut gate, truth, _) = raised();
    let before = moved(&truth);
    set_in_motion(&mut gate, Time::ZERO);
    let after = moved(&truth);
    assert!(after.way > before.way + 0.01 && after.turned > before.turned + 0.01, "{after:?}");
    assert!(after.head.0 > before.head.0 + 0.01 && after.head.1 > before.head.1 + 0.01, "{after:?}");
}

#[test]
fn a_turning_head_stands_in_the_cycle_that_finds_the_latch_set() {
    for unseen in [false, true] {
        let (mut gate, truth, latch) = raised();
        let now = set_in_motion(&mut gate, Time::ZERO);
        latch.set(Cause::Person, now);
        if unseen {
            latch.reset(now);
            gate.command_head(now, now, Head { pan: -1.0, tilt: 0.0 }).unwrap();
        }
        gate.apply(now).unwrap();
        let head = moved(&truth).head;
        let now = cycles(&mut gate, now, 100);
        assert_eq!(moved(&truth).head, head, "reset before anybody saw it: {unseen}");
        latch.reset(now);
        let now = cycles(&mut gate, now, 1);
        gate.command_head(now, now, Head { pan: -1.0, tilt: 0.0 }).unwrap();
        cycles(&mut gate, now, 10);
        assert!(moved(&truth).head.0 < head.0, "a younger command turns it again");
    }
}

#[test]
fn who_commands_nonsense_again_and_again_is_not_followed_any_more() {
    let (mut gate, truth, latch) = raised();
    let mut now = set_in_motion(&mut gate, Time::ZERO);
    for cycle in 0..3 {
        assert!(!latch.is_set(), "in cycle {cycle}");
        gate.command(now, Authority::Robot, now, Twist::new(f64::NAN, 0.0));
        gate.command(now, Authority::Robot, now, Twist::new(0.3, 0.0));
        now = cycles(&mut gate, now, 1);
    }
    assert!(latch.state().has(Cause::Nonsense));
    now = cycles(&mut gate, now, 300);
    let at_rest = moved(&truth);
    gate.command(now, Authority::Robot, now, Twist::new(0.3, 0.0));
    cycles(&mut gate, now, 100);
    assert!(moved(&truth).is(at_rest));
}

#[test]
fn a_gate_that_is_dropped_leaves_nothing_in_motion() {
    let robot = Body { name: "h1".into(), model: Model::h1(), start: Pose::new(4.0, 3.0, 0.3), goal: None };
    let other = Body { name: "h2".into(), model: Model::h1(), start: Pose::new(1.0, 1.0, 0.3), goal: None };
    let (mut bodies, truth) = simulated::raise(&WorldPlan::hall(8.0, 6.0), 5, &[robot, other]).unwrap();
    let mut second = Gate::new(bodies.remove(1), Latch::private());
    let mut gate = Gate::new(bodies.remove(0), Latch::private());
    let now = set_in_motion(&mut gate, Time::ZERO);
    drop(gate);
    // The world goes on by the other robot's gate.
    let now = cycles(&mut second, now, 300);
    let at_rest = moved(&truth);
    cycles(&mut second, now, 100);
    assert!(moved(&truth).is(at_rest), "{:?}, was {at_rest:?}", moved(&truth));
    assert!(at_rest.head.0 < 1.0, "it was still turning: {at_rest:?}");
}

/// Commands as fast as that for so long (ms), while it is safe to go half as fast.
fn push_on(gate: &mut Gate, authority: Authority, from: i64, millis: i64) -> i64 {
    for t in (from..from + millis).step_by(10) {
        let now = Time(t * 1_000_000);
        gate.poll(now, &Listening::default(), &mut Deaf).unwrap();
        gate.allow(now, now, 0.1);
        gate.command(now, authority, now, Twist::new(0.2, 0.0));
        gate.apply(now).unwrap();
    }
    from + millis
}

#[test]
fn who_does_not_hear_what_is_safe_is_stopped_for_good_unless_it_is_a_person() {
    let (mut gate, truth, latch) = raised();
    gate.set_policy(Policy { guarded: true, ..Policy::default() }, true);
    let end = push_on(&mut gate, Authority::Person, 0, 3000);
    assert!(!latch.is_set() && gate.counts().slowed.get() > 250);
    assert!((truth.robot("h1").unwrap().truth.linear - 0.1).abs() < 0.01);
    let end = push_on(&mut gate, Authority::Robot, end + 500, 900);
    assert!(!latch.is_set(), "it may be late now and then");
    push_on(&mut gate, Authority::Robot, end, 200);
    assert!(latch.state().has(Cause::Heedless));
}

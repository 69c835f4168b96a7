use super::*;
use crate::kinematics::Differential;
use libm::{exp, fmax};
use proptest::prelude::*;
use types::chance::Stream;
use types::geometry::PI;

const STEP: f64 = 0.02;

/// A unicycle that answers with a lag, odometry with systematic errors, and a localizer with noise, every 200 ms.
struct World {
    truth: Pose,
    odometry: Pose,
    motion: Twist,
    lag: f64,
    /// Parts by which a metre counts too long and a radian too large, and what a metre turns it unseen (rad/m).
    errors: [f64; 3],
    /// Deviation of the localizer (m, rad).
    noise: (f64, f64),
    draws: Stream,
    tick: u64,
    /// What the wheels turn without moving it.
    held: bool,
}

impl World {
    fn exact(truth: Pose) -> World {
        let draws = Stream::new(1, "localizer");
        World {
            truth,
            odometry: Pose::default(),
            motion: Twist::ZERO,
            lag: 0.1,
            errors: [0.0; 3],
            noise: (0.0, 0.0),
            draws,
            tick: 0,
            held: false,
        }
    }

    fn real(truth: Pose, seed: u64) -> World {
        World {
            errors: [0.03, -0.02, 0.03],
            noise: (0.005, 0.005),
            draws: Stream::new(seed, "localizer"),
            ..World::exact(truth)
        }
    }

    fn map_from_odometry(&self) -> Pose {
        self.truth.then(self.odometry.inverse())
    }

    fn drive(&mut self, order: Twist) {
        let dt = STEP / 4.0;
        let part = if self.lag > 0.0 { 1.0 - exp(-dt / self.lag) } else { 1.0 };
        for _ in 0..4 {
            self.motion.linear += part * (order.linear - self.motion.linear);
            self.motion.angular += part * (order.angular - self.motion.angular);
            let (way, turn) = (self.motion.linear * dt, self.motion.angular * dt);
            if !self.held {
                self.truth = self.truth.along_arc(way, turn);
            }
            let [long, large, bend] = self.errors;
            self.odometry = self.odometry.along_arc(way * (1.0 + long), turn * (1.0 + large) + way * bend);
        }
        self.tick += 1;
    }

    /// What the localizer finds, every tenth step.
    fn localized(&self) -> Option<Pose> {
        let draw = |k: u64| self.draws.normal(3 * self.tick + k);
        let (place, angle) = self.noise;
        self.tick.is_multiple_of(10).then(|| {
            let seen = Pose::new(
                self.truth.x + place * draw(0),
                self.truth.y + place * draw(1),
                self.truth.heading + angle * draw(2),
            );
            seen.then(self.odometry.inverse())
        })
    }
}

fn parameters() -> Parameters {
    Parameters::new(Limits::indoor(Differential::new(0.1, 0.4)))
}

fn set_off(world: &World, p: Parameters, goal: Goal) -> Goto {
    Goto::new(p, goal, world.map_from_odometry(), world.odometry, Twist::ZERO)
}

/// Goes until it is over and stands; `see` sees every report.
fn go(world: &mut World, goto: &mut Goto, mut see: impl FnMut(&Report)) -> Report {
    for _ in 0..10_000 {
        if let Some(found) = world.localized() {
            assert!(goto.correct(found));
        }
        let report = goto.step(world.odometry, STEP);
        see(&report);
        if report.phase.is_over() && report.twist == Twist::ZERO {
            for _ in 0..50 {
                world.drive(Twist::ZERO);
            }
            return report;
        }
        world.drive(report.twist);
    }
    panic!("it never ends");
}

#[test]
fn a_pose_beside_is_reached_through_all_phases() {
    let mut world = World::exact(Pose::default());
    let goal = Pose::new(-1.0, 1.0, 1.0);
    let mut goto = set_off(&world, parameters(), Goal::pose(goal));
    let mut phases = std::vec::Vec::new();
    let report = go(&mut world, &mut goto, |report| {
        if phases.last() != Some(&report.phase) {
            phases.push(report.phase);
        }
    });
    assert_eq!(phases, [Phase::Turning, Phase::Steering, Phase::Aligning, Phase::Arrived]);
    assert!(report.distance < 0.01 && fabs(report.turn) < 0.02, "{report:?}");
    assert!(world.truth.position().distance(goal.position()) < 0.01, "{:?}", world.truth);
    assert!(fabs(wrap(world.truth.heading - goal.heading)) < 0.02);
}

#[test]
fn a_point_is_reached_without_turning_at_the_end() {
    let mut world = World::exact(Pose::default());
    let mut goto = set_off(&world, parameters(), Goal::point(Point::new(2.0, 1.0)));
    let report = go(&mut world, &mut goto, |_| {});
    assert_eq!(report.phase, Phase::Arrived);
    assert!(world.truth.position().distance(Point::new(2.0, 1.0)) < 0.01, "{:?}", world.truth);
    // It drives while it turns, so the way bends: with h = 0 the direction to the goal grows by about γ α / (k + γ), here a third.
    let direction = libm::atan2(1.0, 2.0);
    assert!(fabs(world.truth.heading - direction * 4.0 / 3.0) < 0.08, "{:?}", world.truth);
}

#[test]
fn wheels_that_turn_without_moving_it_and_a_wall_are_told() {
    // The wheels slip: odometry goes on, the localizer says that it stands.
    let mut world = World { held: true, ..World::exact(Pose::default()) };
    let mut goto = set_off(&world, parameters(), Goal::point(Point::new(2.0, 1.0)));
    let report = go(&mut world, &mut goto, |_| {});
    assert!(report.phase == Phase::Stuck && report.seconds < 8.0, "{report:?}");
    // The wheels stand.
    let mut goto = set_off(&world, parameters(), Goal::point(Point::new(2.0, 1.0)));
    let last = (0..400).map(|_| goto.step(world.odometry, STEP)).last().unwrap();
    assert!(last.phase == Phase::Stuck && last.twist == Twist::ZERO, "{last:?}");
    assert!(fabs(last.seconds - 4.0) < 0.1, "{last:?}");
}

#[test]
fn while_something_else_drives_it_is_patient_and_goes_on_from_there() {
    let world = World::exact(Pose::default());
    let mut goto = set_off(&world, parameters(), Goal::point(Point::new(2.0, 0.0)));
    for _ in 0..1000 {
        let report = goto.step(world.odometry, STEP);
        assert!(
            report.phase == Phase::Steering && fabs(report.twist.linear) <= 0.5 * STEP + 1e-12,
            "{report:?}"
        );
        goto.yielded(Twist::ZERO);
    }
    goto.yielded(Twist::new(0.2, 0.0));
    assert!(goto.step(world.odometry, STEP).twist.linear > 0.2);
}

#[test]
fn what_the_localizer_finds_at_the_last_moment_is_driven_to() {
    for push in [0.028, 0.05, 0.3] {
        let mut world = World::exact(Pose::default());
        let goal = Pose::new(1.5, 0.4, 0.2);
        let mut goto = set_off(&world, parameters(), Goal::pose(goal));
        let (mut pushed, mut again) = (false, false);
        while !goto.phase().is_over() {
            if let Some(found) = world.localized() {
                goto.correct(found);
            }
            let report = goto.step(world.odometry, STEP);
            again |= pushed && report.phase == Phase::Steering;
            if report.phase == Phase::Aligning && report.twist == Twist::ZERO && !pushed {
                world.truth.x -= push;
                pushed = true;
            }
            world.drive(report.twist);
        }
        assert!(again && goto.phase() == Phase::Arrived, "{push}");
        assert!(world.truth.position().distance(goal.position()) < 0.02, "{push}: {:?}", world.truth);
    }
}

#[test]
fn the_end_of_the_time_brakes_as_the_limits_allow() {
    let mut world = World::exact(Pose::default());
    let p = Parameters { time_out: 3.0, ..parameters() };
    let mut goto = set_off(&world, p, Goal::point(Point::new(9.0, 0.0)));
    let (mut speeds, mut over_at) = (std::vec::Vec::new(), 0.0);
    let report = go(&mut world, &mut goto, |report| {
        speeds.push(report.twist.linear);
        if report.phase.is_over() && over_at == 0.0 {
            over_at = report.twist.linear;
        }
    });
    assert!(report.phase == Phase::TimedOut && over_at > 0.25, "{report:?} {over_at}");
    assert!(speeds.windows(2).all(|w| w[0] - w[1] <= 1.0 * STEP + 1e-12));
}

#[test]
fn nonsense_ends_it() {
    let mut goto = set_off(&World::exact(Pose::default()), parameters(), Goal::point(Point::new(1.0, 0.0)));
    assert!(!goto.correct(Pose::new(0.0, f64::NAN, 0.0)));
    assert_eq!(goto.step(Pose::new(f64::NAN, 0.0, 0.0), STEP).phase, Phase::Lost);
    let mut goto =
        set_off(&World::exact(Pose::default()), parameters(), Goal::point(Point::new(f64::NAN, 0.0)));
    let report = goto.step(Pose::default(), STEP);
    assert_eq!((report.phase, report.twist), (Phase::Lost, Twist::ZERO));
}

#[test]
fn a_dock_is_met_within_a_centimetre() {
    let mut worst = 0f64;
    for seed in 0..40 {
        let draw = |k: u64, low: f64, high: f64| Stream::new(seed, "start").between(k, low, high);
        let start = Pose::new(draw(0, -2.0, 1.0), draw(1, -2.0, 2.0), draw(2, -PI, PI));
        let mut world = World { noise: (0.003, 0.003), ..World::real(start, seed) };
        let dock = Pose::new(2.0, 0.5, 0.3);
        let mut goto = set_off(&world, parameters(), Goal::dock(dock));
        let mut fastest = 0f64;
        let report = go(&mut world, &mut goto, |report| {
            if report.phase == Phase::Docking {
                fastest = fmax(fastest, report.twist.linear);
                let at = dock.inverse().transform(report.pose.position());
                assert!(at.x > -0.45 && fabs(at.y) < 0.03, "beside the axis: {at:?}");
            }
        });
        assert_eq!(report.phase, Phase::Arrived, "{seed}");
        assert!(fastest > 0.05 && fastest < 0.11, "{fastest}");
        worst = fmax(worst, world.truth.position().distance(dock.position()));
        assert!(fabs(wrap(world.truth.heading - dock.heading)) < 0.035, "{seed} {:?}", world.truth);
    }
    assert!(worst < 0.01, "{worst}");
}

#[test]
fn a_missed_dock_is_left_and_tried_again_and_then_given_up() {
    let mut world = World::exact(Pose::default());
    let mut goto = set_off(&world, parameters(), Goal::dock(Pose::new(1.0, 0.0, 0.0)));
    let mut pushes = 0;
    let mut phases = std::vec::Vec::new();
    for _ in 0..10_000 {
        if let Some(found) = world.localized() {
            goto.correct(found);
        }
        let report = goto.step(world.odometry, STEP);
        if phases.last() != Some(&report.phase) {
            phases.push(report.phase);
        }
        // Whenever it is nearly there, something pushes it aside.
        if report.phase == Phase::Docking && report.distance < 0.03 {
            world.truth.y += 0.02;
            pushes += 1;
        }
        if report.phase.is_over() {
            break;
        }
        world.drive(report.twist);
    }
    assert!(pushes >= 3);
    assert_eq!(phases.iter().filter(|phase| **phase == Phase::BackingOff).count(), 2, "{phases:?}");
    assert_eq!(phases.last(), Some(&Phase::Stuck));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn every_goal_is_met_within_two_centimetres(
        x in -3f64..3., y in -3f64..3., h in -PI..PI, heading in -PI..PI, with_heading: bool, seed in 0u64..1000, linear: bool, behind in 0..2,
    ) {
        let mut world = World::real(Pose::new(0.5, -0.3, h), seed);
        let goal = Pose::new(x, y, heading);
        let mut p = parameters();
        p.steering.law = if linear { steering::Law::linear(1.0) } else { p.steering.law };
        p.steering.behind = [steering::Behind::Rotate, steering::Behind::Reverse][behind as usize];
        let wanted = if with_heading { Goal::pose(goal) } else { Goal::point(goal.position()) };
        let mut goto = set_off(&world, p, wanted);
        let report = go(&mut world, &mut goto, |_| {});
        prop_assert!(report.phase == Phase::Arrived, "{report:?}");
        let off = world.truth.position().distance(goal.position());
        prop_assert!(off < 0.02, "{off}");
        prop_assert!(!with_heading || fabs(wrap(world.truth.heading - heading)) < 0.03, "{:?}", world.truth);
    }

    #[test]
    fn no_correction_makes_the_order_jump(seed in 0u64..1000, size in 0f64..1., turn in 0f64..1., dock: bool) {
        let draws = Stream::new(seed, "corrections");
        let p = parameters();
        let goal = Pose::new(3.0, 1.0, 0.5);
        let mut world = World::exact(Pose::default());
        let mut goto = set_off(&world, p, if dock { Goal::dock(goal) } else { Goal::pose(goal) });
        let mut before = Twist::ZERO;
        for i in 0..1500u64 {
            if i % 10 == 0 {
                let draw = |k: u64, size: f64| draws.between(3 * i + k, -size, size);
                goto.correct(Pose::new(draw(0, size), draw(1, size), draw(2, turn)));
            }
            let now = goto.step(world.odometry, STEP).twist;
            let (grown, turned) = (fabs(now.linear) - fabs(before.linear), now.angular - before.angular);
            prop_assert!(grown <= p.limits.acceleration * STEP + 1e-9, "{before:?} {now:?}");
            prop_assert!(fabs(now.linear - before.linear) <= p.limits.deceleration * STEP + 1e-9, "{before:?} {now:?}");
            prop_assert!(fabs(turned) <= p.limits.angular_acceleration * STEP + 1e-9, "{before:?} {now:?}");
            before = now;
            world.drive(now);
        }
    }
}

/// What the law itself is asked changes by little with each correction: the blend, not the limits, keeps the order calm.
#[test]
fn the_wish_behind_the_order_is_calm_too() {
    let wildest = |blend: blend::Parameters| {
        let mut p = Parameters { blend, ..parameters() };
        // Limits that never bite.
        p.limits.acceleration = 1e6;
        p.limits.deceleration = 1e6;
        p.limits.angular_acceleration = 1e6;
        let mut world = World { noise: (0.02, 0.02), ..World::exact(Pose::default()) };
        let mut goto = set_off(&world, p, Goal::pose(Pose::new(3.0, 1.0, 0.5)));
        let (mut before, mut worst) = (Twist::ZERO, 0f64);
        for i in 0..400 {
            if let Some(found) = world.localized() {
                goto.correct(found);
            }
            let now = goto.step(world.odometry, STEP).twist;
            if i > 50 {
                worst = fmax(worst, fabs(now.angular - before.angular));
            }
            before = now;
            world.drive(now);
        }
        worst
    };
    let sudden = blend::Parameters { linear_rest: 1e-9, angular_rest: 1e-9, ..blend::Parameters::default() };
    let (blended, sudden) = (wildest(blend::Parameters::default()), wildest(sudden));
    assert!(blended < 3.0 * STEP && sudden > 5.0 * blended, "{blended} {sudden}");
}

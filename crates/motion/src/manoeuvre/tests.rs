use super::*;
use libm::{exp, fmax};
use proptest::prelude::*;

const STEP: f64 = 0.02;

/// A unicycle whose speed and turn rate follow the order with a lag of first order.
#[derive(Clone, Copy, Debug, Default)]
struct Robot {
    pose: Pose,
    motion: Twist,
    lag: f64,
}

impl Robot {
    fn with_lag(lag: f64) -> Robot {
        Robot { lag, ..Robot::default() }
    }

    fn drive(&mut self, order: Twist) {
        let dt = STEP / 10.0;
        let part = if self.lag > 0.0 { 1.0 - exp(-dt / self.lag) } else { 1.0 };
        for _ in 0..10 {
            self.motion.linear += part * (order.linear - self.motion.linear);
            self.motion.angular += part * (order.angular - self.motion.angular);
            self.pose = self.pose.advanced(self.motion.linear, self.motion.angular, dt);
        }
    }
}

/// Drives to the end, calls `see` after each step, and lets the robot roll out.
fn drive(
    robot: &mut Robot,
    parameters: Parameters,
    wanted: Move,
    mut see: impl FnMut(f64, &Robot),
) -> Report {
    let mut manoeuvre = Manoeuvre::new(parameters, wanted).unwrap();
    for _ in 0..10_000 {
        let report = manoeuvre.step(robot.pose, STEP);
        if report.outcome != Outcome::Running {
            (0..50).for_each(|_| robot.drive(Twist::ZERO));
            return report;
        }
        robot.drive(report.twist);
        see(report.seconds, robot);
    }
    panic!("it never ends");
}

#[test]
fn ten_twenty_and_thirty_centimetres_a_second_are_held() {
    for speed in [0.1, 0.2, 0.3, -0.2] {
        let mut robot = Robot::with_lag(0.1);
        let wanted = Move::Velocity { twist: Twist::new(speed, 0.0), seconds: 5.0 };
        let mut worst = 0f64;
        let report = drive(&mut robot, Parameters::default(), wanted, |t, robot| {
            if (2.0..4.9).contains(&t) {
                worst = fmax(worst, fabs(robot.motion.linear - speed));
            }
        });
        assert_eq!(report.outcome, Outcome::Done, "{report:?}");
        assert!(worst < 0.02 * fabs(speed), "{speed}: off by {worst}");
        assert!(fabs(robot.pose.x - 5.0 * speed) < 0.006 && fabs(robot.pose.y) < 1e-6, "{robot:?}");
    }
}

#[test]
fn turns_of_fifteen_degrees_a_second_at_thirty_centimetres_a_second_are_arcs() {
    for degrees in [-15.0f64, -10.0, -5.0, 5.0, 10.0, 15.0] {
        let rate = degrees.to_radians();
        let mut robot = Robot::with_lag(0.1);
        let wanted = Move::Velocity { twist: Twist::new(0.3, rate), seconds: 6.0 };
        let mut worst = 0f64;
        let report = drive(&mut robot, Parameters::default(), wanted, |t, robot| {
            if (2.0..5.9).contains(&t) {
                worst = fmax(worst, fabs(robot.motion.angular - rate));
            }
        });
        let end = Pose::default().along_arc(1.8, rate * 6.0);
        assert_eq!(report.outcome, Outcome::Done);
        assert!(worst < 0.03 * fabs(rate), "{degrees}: off by {worst}");
        assert!(robot.pose.position().distance(end.position()) < 0.01, "{robot:?} {end:?}");
        assert!(fabs(wrap(robot.pose.heading - end.heading)) < 0.012, "{robot:?} {end:?}");
    }
}

#[test]
fn leading_by_the_lag_follows_closer() {
    let wanted = Move::Distance(1.5);
    let furthest = |lag: f64| {
        let mut manoeuvre = Manoeuvre::new(Parameters { lag, ..Parameters::default() }, wanted).unwrap();
        let (mut robot, mut worst) = (Robot::with_lag(0.1), 0f64);
        while let Report { outcome: Outcome::Running, twist, error, .. } = manoeuvre.step(robot.pose, STEP) {
            worst = fmax(worst, fabs(error.x));
            robot.drive(twist);
        }
        worst
    };
    assert!(furthest(0.1) < 0.4 * furthest(0.0), "{} {}", furthest(0.1), furthest(0.0));
}

#[test]
fn a_point_is_reached_with_its_heading() {
    let mut robot = Robot { pose: Pose::new(1.0, -2.0, 0.4), ..Robot::with_lag(0.1) };
    let wanted = Move::To { point: Point::new(-0.5, -1.0), heading: Some(-2.0) };
    let report = drive(&mut robot, Parameters::default(), wanted, |_, _| {});
    assert_eq!((report.outcome, report.leg), (Outcome::Done, 2));
    assert!(robot.pose.position().distance(Point::new(-0.5, -1.0)) < 0.01, "{robot:?}");
    assert!(fabs(robot.pose.heading + 2.0) < 0.015, "{robot:?}");
    // Being there, it has nothing to drive.
    let again = Move::To { point: robot.pose.position(), heading: None };
    assert_eq!(drive(&mut robot, Parameters::default(), again, |_, _| {}).outcome, Outcome::Done);
}

#[test]
fn more_than_a_turn_is_turned_whole() {
    let mut robot = Robot::with_lag(0.1);
    let mut turned = 0.0;
    let mut before = 0.0;
    let report = drive(&mut robot, Parameters::default(), Move::Turn(-3.0 * PI), |_, robot| {
        turned += wrap(robot.pose.heading - before);
        before = robot.pose.heading;
    });
    assert_eq!(report.outcome, Outcome::Done);
    assert!(fabs(turned + 3.0 * PI) < 0.03, "{turned}");
}

#[test]
fn a_push_sideways_is_driven_out_again() {
    let mut manoeuvre = Manoeuvre::new(Parameters::default(), Move::Distance(3.0)).unwrap();
    let mut robot = Robot::with_lag(0.1);
    for i in 0.. {
        let report = manoeuvre.step(robot.pose, STEP);
        if report.outcome != Outcome::Running {
            assert_eq!(report.outcome, Outcome::Done);
            break;
        }
        robot.drive(report.twist);
        if i == 100 {
            robot.pose.y += 0.05;
            robot.pose.heading += 0.1;
        }
    }
    assert!(fabs(robot.pose.y) < 0.002 && fabs(robot.pose.x - 3.0) < 0.006, "{robot:?}");
}

#[test]
fn what_holds_it_is_told() {
    let velocity = Move::Velocity { twist: Twist::new(0.3, 0.1), seconds: 4.0 };
    let to = Move::To { point: types::Point::new(-3.0, 0.0), heading: Some(1.0) };
    // None of it is driven, so all of it is left, however soon it gave up.
    for (wanted, distance, angle) in [
        (Move::Distance(1.0), 1.0, 0.0),
        (Move::Distance(-5.0), 5.0, 0.0),
        (Move::Turn(2.0), 0.0, 2.0),
        (Move::Turn(-7.0), 0.0, -7.0),
        (velocity, 1.2, 0.4),
        (to, 3.0, 1.0),
    ] {
        let mut manoeuvre = Manoeuvre::new(Parameters::default(), wanted).unwrap();
        let last = (0..500).map(|_| manoeuvre.step(Pose::default(), STEP)).last().unwrap();
        assert_eq!((last.outcome, last.twist), (Outcome::Blocked, Twist::ZERO), "{wanted:?}");
        let off = fabs(last.distance - distance) + fabs(last.angle - angle);
        // What it is behind on an arc is measured along a straight line.
        let bent = if wanted == velocity { 1e-3 } else { 1e-9 };
        assert!(off < bent, "{wanted:?}: {} m, {} rad", last.distance, last.angle);
    }
    // A drive that stops short of the end by less than counts as blocked.
    let mut manoeuvre = Manoeuvre::new(Parameters::default(), Move::Distance(0.1)).unwrap();
    let last = (0..500).map(|_| manoeuvre.step(Pose::default(), STEP)).last().unwrap();
    assert_eq!(last.outcome, Outcome::Missed);
    assert!(fabs(last.error.x - 0.1) < 1e-9, "{last:?}");
    let mut manoeuvre = Manoeuvre::new(Parameters::default(), Move::Distance(0.1)).unwrap();
    assert_eq!(manoeuvre.step(Pose::new(f64::NAN, 0.0, 0.0), STEP).outcome, Outcome::Lost);
}

#[test]
fn what_cannot_be_planned_is_refused() {
    let plan = |wanted| Manoeuvre::new(Parameters::default(), wanted).map(drop);
    let fast = Move::Velocity { twist: Twist::new(0.7, 0.0), seconds: 1.0 };
    assert_eq!(plan(fast), Err(Unfit::TooFast));
    assert_eq!(plan(Move::Distance(f64::NAN)), Err(Unfit::Nonsense));
    let before = Move::Velocity { twist: Twist::new(0.1, 0.0), seconds: -1.0 };
    assert_eq!(plan(before), Err(Unfit::Nonsense));
    let still = Move::Velocity { twist: Twist::ZERO, seconds: 2.0 };
    let mut robot = Robot::default();
    let report = drive(&mut robot, Parameters::default(), still, |_, _| {});
    assert!(report.outcome == Outcome::Done && fabs(report.seconds - 2.0) < 0.03, "{report:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_move_ends_where_it_should_and_stays_within_its_bounds(
        x in -3f64..3., y in -3f64..3., h in -3f64..3., distance in -3f64..3., angle in -7f64..7., lag in 0f64..0.15, which in 0..3,
    ) {
        let start = Pose::new(x, y, h);
        let (wanted, end) = match which {
            0 => (Move::Distance(distance), start.along_arc(distance, 0.0)),
            1 => (Move::Turn(angle), start.along_arc(0.0, angle)),
            _ => (Move::To { point: Point::new(y, x), heading: Some(angle) }, Pose::new(y, x, angle)),
        };
        let mut robot = Robot { pose: start, ..Robot::with_lag(lag) };
        let p = Parameters { lag, ..Parameters::default() };
        let mut manoeuvre = Manoeuvre::new(p, wanted).unwrap();
        let report = loop {
            let report = manoeuvre.step(robot.pose, STEP);
            if report.outcome != Outcome::Running {
                break report;
            }
            prop_assert!(fabs(report.twist.linear) <= 1.2 * 0.6 + 1e-9 && fabs(report.twist.angular) <= 1.2 + 1e-9);
            robot.drive(report.twist);
        };
        (0..50).for_each(|_| robot.drive(Twist::ZERO));
        prop_assert!(report.outcome == Outcome::Done, "{report:?}");
        prop_assert!(robot.pose.position().distance(end.position()) < 0.015, "{robot:?} {end:?}");
        prop_assert!(fabs(wrap(robot.pose.heading - end.heading)) < 0.02, "{robot:?} {end:?}");
    }
}

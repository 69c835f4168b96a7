use super::*;
use libm::{cos, fmin, sin};
use proptest::prelude::*;

/// The law alone: no limit, no stop, no turn in place.
fn bare(law: Law) -> Parameters {
    Parameters {
        law,
        behind: Behind::AsLaw,
        linear_max: f64::INFINITY,
        angular_max: f64::INFINITY,
        near: 0.0,
        hysteresis: 0.2,
    }
}

fn slow(law: Law) -> Parameters {
    Parameters { linear_max: 0.3, angular_max: 1.57, ..bare(law) }
}

const CLASSIC: Law = Law::Aicardi { gamma: 3.0, k: 6.0, h: 1.0 };
const BOOK: Law = Law::Linear { rho: 3.0, alpha: 8.0, beta: -1.5 };

#[derive(Clone, Copy, Debug, Default)]
struct Run {
    arrived: Option<f64>,
    path: f64,
    linear_max: f64,
    angular_max: f64,
}

/// Drives to the origin in steps of 1 ms with the order held for `hold` steps, until it is within 10 mm and 0.02 rad of it.
fn drive(parameters: Parameters, start: Pose, hold: usize) -> Run {
    let (mut steering, mut pose, mut run) = (Steering::new(parameters), start, Run::default());
    let mut twist = Twist::ZERO;
    for i in 0..60_000 {
        if pose.position().norm() < 0.01 && fabs(pose.heading) < 0.02 {
            return Run { arrived: Some(i as f64 * 1e-3), ..run };
        }
        if i % hold == 0 {
            twist = steering.step(pose, Pose::default()).twist;
        }
        run.linear_max = fmax(run.linear_max, fabs(twist.linear));
        run.angular_max = fmax(run.angular_max, fabs(twist.angular));
        run.path += fabs(twist.linear) * 1e-3;
        pose = pose.advanced(twist.linear, twist.angular, 1e-3);
    }
    run
}

/// Times to 4 ms and lengths to a millimetre, of an independent simulation with Euler's midpoint rule.
#[test]
fn the_classic_gains_drive_the_reference_trajectories() {
    for (start, time, path, linear, angular) in [
        (Pose::new(-1.0, 0.0, 0.0), 1.533, 0.9900, 3.0000, 0.0),
        (Pose::new(-1.0, 1.0, 0.0), 2.465, 1.4884, 3.3883, 7.7124),
        (Pose::new(0.0, 1.0, 0.0), 3.026, 1.1489, 2.3640, 9.5848),
        (Pose::new(1.0, 1.0, 0.0), 3.497, 1.7558, 3.3183, 11.1372),
        (Pose::new(-1.0, 1.0, PI), 1.891, 1.6664, 3.0000, 13.1372),
    ] {
        let run = drive(bare(CLASSIC), start, 1);
        assert!(fabs(run.arrived.unwrap() - time) < 4e-3, "{start:?} {run:?}");
        assert!(fabs(run.path - path) < 1e-3, "{start:?} {run:?}");
        assert!(fabs(run.linear_max - linear) < 1e-4, "{start:?} {run:?}");
        assert!(fabs(run.angular_max - angular) < 1e-4, "{start:?} {run:?}");
    }
}

#[test]
fn with_limits_and_a_hold_of_20_ms_both_laws_take_the_reference_times() {
    let starts = [Pose::new(-1.0, 1.0, 0.0), Pose::new(1.0, 1.0, 0.0), Pose::new(0.0, 1.0, 0.0)];
    for (law, times) in [(CLASSIC, [6.053, 7.815, 5.599]), (BOOK, [7.753, 10.372, 7.422])] {
        for (start, time) in starts.into_iter().zip(times) {
            let run = drive(slow(law), start, 20);
            assert!(fabs(run.arrived.unwrap() - time) < 6e-3, "{law:?} {start:?} {run:?}");
            assert!(run.linear_max <= 0.3 + 1e-12 && run.angular_max <= 1.57 + 1e-12, "{run:?}");
        }
    }
    let straight = drive(slow(CLASSIC), starts[0], 20);
    assert!(fabs(straight.path - 1.488) < 1e-3, "{straight:?}");
}

#[test]
fn the_classic_gains_bear_a_hold_of_200_ms_and_gentle_ones_300_ms() {
    let starts = [
        Pose::new(-1.0, 0.0, 0.0),
        Pose::new(-1.0, 1.0, 0.0),
        Pose::new(0.0, 1.0, 0.0),
        Pose::new(1.0, 1.0, 0.0),
        Pose::new(-1.0, 1.0, PI),
    ];
    for start in starts {
        assert!(drive(bare(CLASSIC), start, 200).arrived.unwrap() < 3.0, "{start:?}");
        assert!(drive(bare(Law::aicardi(1.0)), start, 300).arrived.unwrap() < 9.0, "{start:?}");
    }
    // What is too long for the classic gains costs several times the time.
    let late = starts[1..].iter().map(|start| drive(bare(CLASSIC), *start, 300).arrived.unwrap_or(60.0));
    late.for_each(|time| assert!(time > 7.0, "{time}"));
}

/// The derivatives of (e, α, θ) under a law.
fn rates(law: Law, at: Polar) -> [f64; 3] {
    let Twist { linear, angular } = law.twist(at);
    let sideways = linear * sin(at.alpha) / at.distance;
    [-linear * cos(at.alpha), sideways - angular, sideways]
}

/// Trace and determinant of the linearised (α, θ) at the goal.
fn linearised(law: Law) -> (f64, f64) {
    let h = 1e-6;
    let at = |alpha, theta| rates(law, Polar { distance: 1.0, theta, alpha });
    let (by_alpha, by_theta) = (at(h, 0.0), at(0.0, h));
    let m = [[by_alpha[1] / h, by_theta[1] / h], [by_alpha[2] / h, by_theta[2] / h]];
    (m[0][0] + m[1][1], m[0][0] * m[1][1] - m[0][1] * m[1][0])
}

#[test]
fn the_poles_near_the_goal_are_those_of_the_books() {
    // Three poles at −3: s² + 6 s + 9.
    let (trace, determinant) = linearised(CLASSIC);
    assert!(fabs(trace + 6.0) < 1e-6 && fabs(determinant - 9.0) < 1e-6, "{trace} {determinant}");
    // s² + (k_α − k_ρ) s − k_ρ k_β.
    let (trace, determinant) = linearised(BOOK);
    assert!(fabs(trace + 5.0) < 1e-6 && fabs(determinant - 4.5) < 1e-6, "{trace} {determinant}");
    assert_eq!((Law::aicardi(3.0), Law::linear(3.0)), (CLASSIC, BOOK));
    let way = rates(CLASSIC, Polar { distance: 0.5, theta: 0.0, alpha: 0.0 });
    assert_eq!(way[0], -1.5);
}

#[test]
fn noise_about_straight_behind_does_not_swing_the_body() {
    let parameters = Parameters { behind: Behind::Rotate, ..slow(Law::aicardi(1.0)) };
    let mut steering = Steering::new(parameters);
    let first = steering.step(Pose::new(1.0, 0.01, 0.0), Pose::default()).twist.angular;
    for i in 0..20 {
        let y = if i % 2 == 0 { -0.05 } else { 0.05 };
        let order = steering.step(Pose::new(1.0, y, 0.0), Pose::default());
        assert!(order.twist.angular * first > 0.0 && order.mode == Mode::Rotating, "{order:?}");
    }
}

#[test]
fn a_goal_behind_is_turned_to_backed_up_to_or_looped_to() {
    let start = Pose::new(1.0, 1.0, 0.0);
    let backward = |p: Parameters| {
        let (mut steering, mut pose, mut least) = (Steering::new(p), start, 0f64);
        for _ in 0..20_000 {
            let twist = steering.step(pose, Pose::default()).twist;
            least = fmin(least, twist.linear);
            pose = pose.advanced(twist.linear, twist.angular, 1e-3);
        }
        assert!(pose.position().norm() < 1e-2 && fabs(pose.heading) < 0.02, "{p:?} {pose:?}");
        least
    };
    for law in [CLASSIC, BOOK] {
        assert!(backward(Parameters { behind: Behind::Reverse, ..slow(law) }) < -0.2);
        assert_eq!(backward(Parameters { behind: Behind::Rotate, ..slow(law) }), 0.0);
    }
    assert!(backward(slow(CLASSIC)) < -0.2);
    assert_eq!(backward(slow(BOOK)), 0.0);
    // Mirrored, the way back is the way there: from (−1, 1) to the goal it takes 7.753 s.
    let run = drive(Parameters { behind: Behind::Reverse, ..slow(BOOK) }, start, 20);
    assert!(fabs(run.arrived.unwrap() - 7.753) < 6e-3, "{run:?}");
}

#[test]
fn at_the_goal_and_from_nonsense_it_stands() {
    let mut steering = Steering::new(slow(CLASSIC));
    let order = steering.step(Pose::new(2.0, 1.0, 0.5), Pose::new(2.0, 1.0, 0.0));
    assert_eq!((order.twist, order.mode), (Twist::ZERO, Mode::Near));
    for bad in [f64::NAN, f64::INFINITY] {
        assert_eq!(steering.step(Pose::new(bad, 0.0, 0.0), Pose::default()).twist, Twist::ZERO);
    }
    assert!(steering.step(Pose::new(-1.0, 0.0, 0.0), Pose::default()).twist.linear > 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn the_lyapunov_function_never_grows_with_limits_or_without(
        x in -3f64..3., y in -3f64..3., heading in -PI..PI, gamma in 0.3f64..3., k in 0.5f64..6., h in 0f64..2., limited: bool,
    ) {
        prop_assume!(x * x + y * y > 0.01);
        let law = Law::Aicardi { gamma, k, h };
        let mut steering = Steering::new(if limited { slow(law) } else { bare(law) });
        let mut pose = Pose::new(x, y, heading);
        let mut before = f64::INFINITY;
        for _ in 0..40_000 {
            let order = steering.step(pose, Pose::default());
            let now = law.lyapunov(order.polar).unwrap();
            // The held order is off by the square of the step.
            prop_assert!(now <= before * (1.0 + 1e-6) + 1e-12, "{before} {now} at {pose:?}");
            before = now;
            if order.polar.distance < 1e-3 {
                break;
            }
            pose = pose.advanced(order.twist.linear, order.twist.angular, 2.5e-4);
        }
    }

    #[test]
    fn every_start_arrives_under_both_laws(
        x in -3f64..3., y in -3f64..3., heading in -PI..PI, linear: bool, behind in 0..3,
    ) {
        prop_assume!(x * x + y * y > 0.01);
        let law = if linear { Law::linear(1.0) } else { Law::aicardi(1.0) };
        let behind = [Behind::AsLaw, Behind::Reverse, Behind::Rotate][behind as usize];
        let run = drive(Parameters { behind, ..slow(law) }, Pose::new(x, y, heading), 20);
        prop_assert!(run.arrived.is_some(), "{run:?}");
    }

    #[test]
    fn a_limit_slows_and_keeps_the_curvature(v in -5f64..5., w in -9f64..9.) {
        let out = saturated(Twist::new(v, w), 0.3, 1.5);
        prop_assert!(fabs(out.linear) <= 0.3 + 1e-12 && fabs(out.angular) <= 1.5 + 1e-12);
        prop_assert!(fabs(out.linear * w - out.angular * v) < 1e-9);
        prop_assert!(out == Twist::new(v, w) || fabs(out.linear) > 0.3 - 1e-9 || fabs(out.angular) > 1.5 - 1e-9);
    }
}

use super::*;
use crate::kinematics::Differential;
use libm::{cos, exp, sin};
use proptest::prelude::*;
use std::vec::Vec;
use types::geometry::{PI, TAU};

const STEP: f64 = 0.02;

fn parameters() -> Parameters {
    Parameters::new(Limits::indoor(Differential::new(0.1, 0.4)))
}

/// Follows until it has arrived; gives where it stands and the largest error across, without the first `settle` metres.
fn follow(p: Parameters, path: &[Point], start: Pose, mut see: impl FnMut(&Report, Pose)) -> Pose {
    let (mut track, mut pose) = (Track::new(p, Twist::ZERO), start);
    for _ in 0..20_000 {
        let report = track.step(path, &[], pose, f64::INFINITY, STEP);
        see(&report, pose);
        if report.mode == Mode::Arrived && report.twist == Twist::ZERO {
            return pose;
        }
        pose = pose.advanced(report.twist.linear, report.twist.angular, STEP);
    }
    panic!("it never arrives: {pose:?}");
}

fn circle(radius: f64, points: usize) -> Vec<Point> {
    (0..=points).map(|i| Point::polar(radius, TAU * i as f64 / points as f64)).collect()
}

#[test]
fn on_a_circle_the_curvature_is_that_of_the_circle() {
    for (radius, reach) in [(1.0, 0.3), (1.0, 0.9), (3.0, 0.6)] {
        let p = Parameters { lookahead_within: (reach, reach), ..parameters() };
        let path = circle(radius, 3600);
        for angle in [0.1f64, 1.0, 2.0, 4.0] {
            let mut track = Track::new(p, Twist::ZERO);
            track.place = Place { piece: (angle / TAU * 3600.0) as usize - 20, part: 0.0 };
            let pose = Pose::new(radius * cos(angle), radius * sin(angle), angle + PI / 2.0);
            let report = track.step(&path, &[], pose, f64::INFINITY, STEP);
            assert!(fabs(report.curvature * radius - 1.0) < 1e-4, "{radius} {reach}: {report:?}");
            assert!(fabs(report.target.distance(pose.position()) - reach) < 1e-9);
            assert!(fabs(report.across) < 1e-5, "{report:?}");
        }
    }
}

#[test]
fn an_error_beside_a_line_decays_as_the_closed_form_says() {
    let reach = 0.5;
    let mut p = Parameters { lookahead_within: (reach, reach), creep: 0.3, speed: 0.3, ..parameters() };
    p.limits.acceleration = 1e6;
    p.limits.angular_acceleration = 1e6;
    let path = [Point::new(0.0, 0.0), Point::new(10.0, 0.0)];
    let (mut track, mut pose, y0) = (Track::new(p, Twist::ZERO), Pose::new(0.0, 0.01, 0.0), 0.01);
    for i in 0..2000 {
        let s = i as f64 * 1e-3 * 0.3 / reach;
        let want = y0 * exp(-s) * (cos(s) + sin(s));
        assert!(fabs(pose.y - want) < 2e-5, "{i}: {} for {want}", pose.y);
        let report = track.step(&path, &[], pose, f64::INFINITY, 1e-3);
        assert!(fabs(report.across - pose.y) < 1e-12);
        pose = pose.advanced(report.twist.linear, report.twist.angular, 1e-3);
    }
}

#[test]
fn a_corner_is_cut_by_less_than_a_third_of_the_lookahead_and_taken_slowly() {
    let path = [Point::new(0.0, 0.0), Point::new(3.0, 0.0), Point::new(3.0, 3.0)];
    let (mut worst, mut slowest) = (0f64, f64::INFINITY);
    let end = follow(parameters(), &path, Pose::default(), |report, pose| {
        worst = fmax(worst, fabs(report.across));
        if pose.position().distance(path[1]) < 0.4 {
            slowest = fmin(slowest, report.twist.linear);
        }
    });
    assert!(worst < 0.2 && worst > 0.02, "{worst}");
    assert!(slowest < 0.25, "{slowest}");
    assert!(end.position().distance(path[2]) < 0.025 && fabs(end.heading - PI / 2.0) < 0.05, "{end:?}");
}

#[test]
fn a_path_that_begins_behind_is_turned_to_in_place() {
    let path = [Point::new(0.0, 0.0), Point::new(-2.0, 0.1)];
    let mut modes = Vec::new();
    let end = follow(parameters(), &path, Pose::default(), |report, pose| {
        if report.mode == Mode::Turning {
            assert!(pose.position().norm() < 1e-9 && report.twist.linear == 0.0);
        }
        if modes.last() != Some(&report.mode) {
            modes.push(report.mode);
        }
    });
    assert_eq!(modes, [Mode::Turning, Mode::Following, Mode::Arrived]);
    assert!(end.position().distance(path[1]) < 0.025, "{end:?}");
}

#[test]
fn a_path_that_crosses_itself_is_followed_in_its_order() {
    // An eight: both loops meet in the middle.
    let eight: Vec<Point> = (0..=200)
        .map(|i| {
            let t = TAU * i as f64 / 200.0;
            Point::new(2.0 * sin(t), 1.5 * sin(2.0 * t))
        })
        .collect();
    let (mut worst, mut before) = (0f64, 0);
    let heading = (eight[1] - eight[0]).bearing();
    let end = follow(parameters(), &eight, Pose::new(0.0, 0.0, heading), |report, _| {
        assert!(report.piece >= before && report.piece <= before + 3, "{} {before}", report.piece);
        before = report.piece;
        worst = fmax(worst, fabs(report.across));
    });
    assert!(before == 199 && worst < 0.1, "{before} {worst}");
    assert!(end.position().norm() < 0.03, "{end:?}");
}

#[test]
fn a_path_that_passes_its_own_end_goes_on() {
    let corners = [(0, 0), (2, 0), (2, 2), (0, 2), (0, 0), (-2, 0), (-2, -2), (0, -2), (0, 0)];
    let path: Vec<Point> = corners.iter().map(|&(x, y)| Point::new(f64::from(x), f64::from(y))).collect();
    let place = Place { piece: 3, part: 0.95 };
    let target = point(&path, ahead(&path, place, Place::default(), Point::new(0.0, 0.1), 0.5));
    assert!(target.y == 0.0 && fabs(target.x + sqrt(0.25 - 0.01)) < 1e-12, "{target:?}");
    let mut worst = 0f64;
    let end = follow(parameters(), &path, Pose::default(), |report, pose| {
        worst = fmax(worst, fabs(report.across));
        if report.piece == 4 {
            assert!(pose.y > -0.2, "{pose:?}");
        }
    });
    assert!(worst < 0.2 && end.position().norm() < 0.03 && end.heading > 1.0, "{worst} {end:?}");
}

#[test]
fn curve_obstacle_and_end_slow_it_in_proportion() {
    let p = parameters();
    let track = Track::new(p, Twist::ZERO);
    let far = Report { left: 5.0, ..Report::default() };
    let speed = |report: Report, clearance: f64| track.regulated(&report, None, clearance).linear;
    assert_eq!(speed(far, f64::INFINITY), 0.4);
    // A radius of 0.45 m is half of 0.9 m.
    assert!(fabs(speed(Report { curvature: -1.0 / 0.45, ..far }, 9.0) - 0.2) < 1e-12);
    assert!(fabs(speed(far, 0.25) - 0.2) < 1e-12 && speed(far, 0.0) == 0.0 && speed(far, -1.0) == 0.0);
    assert_eq!(speed(far, f64::NAN), 0.0);
    assert!(fabs(speed(Report { left: 0.125, ..far }, 9.0) - 0.1) < 1e-12);
    assert_eq!(speed(Report { left: 0.03, ..far }, 9.0), 0.05);
}

#[test]
fn where_the_path_has_speeds_it_drives_at_those_and_turns_no_faster_than_the_drive_can() {
    let track = Track::new(parameters(), Twist::ZERO);
    let far = Report { left: 5.0, ..Report::default() };
    let speed = |report: Report, planned: f64| track.regulated(&report, Some(planned), f64::INFINITY).linear;
    assert_eq!((speed(far, 0.23), speed(far, 9.0), speed(far, 0.0)), (0.23, 0.4, 0.05));
    // A radius of 0.45 m would halve it without speeds; 1 rad/s is no bound there, and one on 0.2 m.
    assert_eq!(speed(Report { curvature: 1.0 / 0.45, ..far }, 0.3), 0.3);
    assert!(fabs(speed(Report { curvature: -5.0, ..far }, 0.3) - 0.2) < 1e-12);
    assert!(fabs(speed(Report { left: 0.125, ..far }, 0.3) - 0.1) < 1e-12, "the end is the end");
    // A quarter of the way up to 0.4 m/s with a constant acceleration it is half as fast.
    let at = |speeds: &[f64], part: f64| planned(speeds, Place { piece: 0, part });
    assert!(fabs(at(&[0.0, 0.4], 0.25).unwrap() - 0.2) < 1e-12);
    assert_eq!((at(&[0.3, 0.3], 0.7), at(&[0.2], 0.5), at(&[], 0.5)), (Some(0.3), Some(0.2), None));
    assert_eq!(at(&[0.3, f64::NAN], 0.7), Some(0.0));
}

#[test]
fn a_path_with_speeds_is_driven_in_the_time_that_they_take() {
    // 3 m up to 0.4 m/s and down again, with 0.1 m/s².
    let path = [0.0, 0.8, 2.2, 3.0].map(|x| Point::new(x, 0.0));
    let speeds = [0.0, 0.4, 0.4, 0.0];
    let mut track = Track::new(Parameters { approach: 0.01, ..parameters() }, Twist::ZERO);
    let (mut pose, mut seconds) = (Pose::default(), 0.0);
    while !track.arrived && seconds < 60.0 {
        let report = track.step(&path, &speeds, pose, f64::INFINITY, STEP);
        let x = pose.x;
        let planned = sqrt(fmin(fmin(0.2 * x, 0.2 * (3.0 - x)), 0.16));
        assert!(report.twist.linear <= fmax(planned, 0.05) + 0.011, "{} at {x}", report.twist.linear);
        pose = pose.advanced(report.twist.linear, report.twist.angular, STEP);
        seconds += STEP;
    }
    // 4 s up, 3.5 s on, 4 s down; at the ends it creeps.
    assert!((10.5..12.0).contains(&seconds), "{seconds}");
}

#[test]
fn it_goes_on_from_what_something_else_drove() {
    let path = [Point::default(), Point::new(5.0, 0.0)];
    let mut track = Track::new(parameters(), Twist::ZERO);
    track.yielded(Twist::new(0.2, 0.0));
    let report = track.step(&path, &[], Pose::default(), f64::INFINITY, STEP);
    assert!(fabs(report.twist.linear - 0.21) < 1e-12, "{report:?}");
}

#[test]
fn without_a_path_or_a_pose_it_brakes() {
    let mut track = Track::new(parameters(), Twist::new(0.3, 0.0));
    let report = track.step(&[], &[], Pose::default(), f64::INFINITY, STEP);
    assert!(report.mode == Mode::Lost && fabs(report.twist.linear - 0.28) < 1e-12, "{report:?}");
    let path = [Point::new(0.0, 0.0), Point::new(f64::NAN, 0.0)];
    assert_eq!(track.step(&path, &[], Pose::default(), 1.0, STEP).mode, Mode::Lost);
    let pose = Pose::new(0.0, f64::NAN, 0.0);
    assert_eq!(track.step(&[Point::default(); 2], &[], pose, 1.0, STEP).mode, Mode::Lost);
    // One point is a path too, and so is one that stands still.
    let there = Point::new(1.0, 0.5);
    for path in [&[there][..], &[there, there, there][..]] {
        let end = follow(parameters(), path, Pose::default(), |_, _| {});
        assert!(end.position().distance(there) < 0.03, "{end:?}");
    }
    // A path that has passed by is gone to all the same.
    let passed = [Point::new(1.0, 1.0), Point::new(1.0, 2.0), Point::new(1.0, 2.0)];
    let end = follow(parameters(), &passed, Pose::new(0.0, 3.0, 0.0), |_, _| {});
    assert!(end.position().distance(passed[1]) < 0.33, "{end:?}");
}

#[test]
fn a_path_that_winds_within_the_lookahead_does_not_hold_it() {
    // One leaves the circle around the body twice, and for a while the two could be taken in turn; the other ends where the body is still
    // beside another piece.
    for turns in [
        [-0.4034273326373867, 0.0, 1.1367741425095135, 0.9238771519919377, 1.1388679281325444, 0.0, 0.0],
        [
            0.0,
            -0.4034273326373867,
            0.8753160355459646,
            1.1367741425095135,
            0.9238771519919377,
            1.1388679281325444,
            0.0,
        ],
    ] {
        let mut path = Vec::from([Point::default()]);
        let mut heading = 0.0;
        for turn in turns {
            path.push(path[path.len() - 1] + Point::polar(0.2, heading));
            heading += turn;
        }
        let mut seconds = 0.0;
        let start = Pose::new(-0.2786958738374373, 0.0, 0.0);
        let end = follow(parameters(), &path, start, |_, _| seconds += STEP);
        assert!(seconds < 20.0 && end.position().distance(path[7]) < 0.35, "{seconds} {end:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn any_path_is_followed_to_its_end_within_the_limits(
        turns in proptest::collection::vec(-1.4f64..1.4, 1..12), length in 0.2f64..1.5, x in -0.3f64..0.3, y in -0.3f64..0.3, h in -PI..PI,
    ) {
        let mut path = Vec::from([Point::default()]);
        let mut heading = 0.0;
        for turn in turns {
            path.push(path[path.len() - 1] + Point::polar(length, heading));
            heading += turn;
        }
        let p = parameters();
        let (mut track, mut pose, mut before) = (Track::new(p, Twist::ZERO), Pose::new(x, y, h), Report::default());
        let mut arrived = false;
        for _ in 0..10_000 {
            let report = track.step(&path, &[], pose, f64::INFINITY, STEP);
            let Report { twist, .. } = report;
            prop_assert!(twist.linear >= 0.0 && twist.linear <= p.speed + 1e-12 && fabs(twist.angular) <= 1.0 + 1e-12);
            prop_assert!(fabs(twist.linear - before.twist.linear) <= STEP + 1e-12);
            prop_assert!(fabs(twist.angular - before.twist.angular) <= 3.0 * STEP + 1e-12);
            prop_assert!(report.piece >= before.piece);
            // Never farther from the path than it began, but for a corner cut; what winds within the lookahead is cut whole.
            prop_assert!(length < 0.6 || fabs(report.across) < 0.45, "{report:?}");
            pose = pose.advanced(twist.linear, twist.angular, STEP);
            before = report;
            arrived = report.mode == Mode::Arrived;
            if arrived && twist == Twist::ZERO {
                break;
            }
        }
        prop_assert!(arrived, "{before:?}");
        prop_assert!(pose.position().distance(path[path.len() - 1]) < 0.35, "{pose:?}");
    }

    #[test]
    fn the_lookahead_is_exactly_as_far_as_it_should_be(x in -0.2f64..0.2, y in -0.2f64..0.2, part in 0f64..1., reach in 0.3f64..2.) {
        let path: Vec<Point> = (0..30).map(|i| Point::new(i as f64 * 0.2, 0.3 * sin(i as f64 * 0.5))).collect();
        let body = path[3] + Point::new(x, y);
        let place = nearest(&path, Place { piece: 2, part }, 2, body, reach);
        let target = point(&path, ahead(&path, place, Place::default(), body, reach));
        prop_assert!(place.piece > 2 || place.part >= part);
        prop_assert!(fabs(target.distance(body) - reach) < 1e-9);
        // Everything on the path between the two is inside of the circle.
        let (begin, along) = piece(&path, place.piece);
        let nearby = begin + along * place.part;
        prop_assert!(body.distance(nearby) <= reach);
        for index in place.piece + 1..path.len() {
            if path[index].x < target.x {
                prop_assert!(path[index].distance(body) <= reach + 1e-9, "{index}");
            }
        }
    }
}

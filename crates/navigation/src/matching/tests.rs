use super::*;
use crate::floor::{FloorPlan, GridField, PlanField};
use crate::laboratory::{exact, geometry, noisy, room, taken};
use crate::linear::{inverse, product};
use types::chance::Stream;

const NOISE: f64 = 0.01;

/// The bound of Cramér and Rao: what ranges of this noise can tell of the pose, from how they change when it changes.
fn bound(floor: &PlanField, geometry: &Geometry, pose: Pose, beams: usize) -> Matrix {
    let h = 1e-5;
    let shifted = |dx: f64, dy: f64, dh: f64| {
        exact(floor, geometry, Pose::new(pose.x + dx, pose.y + dy, pose.heading + dh), beams)
    };
    let both = [(h, 0.0, 0.0), (0.0, h, 0.0), (0.0, 0.0, h)]
        .map(|(x, y, t)| (shifted(x, y, t), shifted(-x, -y, -t)));
    let mut information = ZERO;
    for beam in 0..beams {
        let slope: Vector = core::array::from_fn(|i| (both[i].0[beam] - both[i].1[beam]) / (2.0 * h));
        // At the edge of a thing the range jumps: that is no slope.
        if slope.iter().all(|slope| slope.abs() < 100.0) {
            for i in 0..3 {
                for j in 0..3 {
                    information[i][j] += slope[i] * slope[j] / (NOISE * NOISE);
                }
            }
        }
    }
    information
}

struct Statistics {
    mean: Vector,
    covariance: Matrix,
    /// The mean of the squared error in deviations, as told: 3 where the covariance is right.
    told: f64,
}

/// Errors of `trials` scans from a pose, each from a guess that is off.
fn statistics(
    floor: &impl Distances,
    ideal: &[f64],
    geometry: &Geometry,
    pose: Pose,
    trials: u64,
    spoil: impl Fn(&mut [f32], Stream),
) -> Statistics {
    let (mut mean, mut covariance, mut told) = ([0.0; 3], ZERO, 0.0);
    let n = trials as f64;
    for trial in 0..trials {
        let draw = Stream::new(trial, "matching");
        let mut ranges = noisy(ideal, NOISE, draw.sample(0));
        spoil(&mut ranges, draw.sample(2));
        let off = draw.sample(1);
        let guess = Pose::new(
            pose.x + off.between(0, -0.12, 0.12),
            pose.y + off.between(1, -0.12, 0.12),
            pose.heading + off.between(2, -0.1, 0.1),
        );
        let found = match_scan(floor, &taken(&ranges, geometry), guess, &MatchParams::default()).unwrap();
        let error = [found.pose.x - pose.x, found.pose.y - pose.y, wrap(found.pose.heading - pose.heading)];
        told += deviation(&found.information, pose, found.pose) / n;
        for i in 0..3 {
            mean[i] += error[i] / n;
            for j in 0..3 {
                covariance[i][j] += error[i] * error[j] / n;
            }
        }
    }
    Statistics { mean, covariance, told }
}

#[test]
fn it_is_as_exact_as_the_bound_of_cramer_and_rao_allows_and_says_so() {
    let floor = PlanField::new(&room()).unwrap();
    for (beams, pose) in
        [(181, Pose::new(2.0, 1.5, 0.3)), (361, Pose::new(3.3, 2.6, -2.0)), (181, Pose::new(5.2, 0.8, 1.9))]
    {
        let geometry = geometry(beams);
        let ideal = exact(&floor, &geometry, pose, beams);
        let found = statistics(&floor, &ideal, &geometry, pose, 400, |_, _| {});
        // Of 361 beams every second is taken.
        let beams_taken = taken(&noisy(&ideal, 0.0, Stream::new(0, "")), &geometry).beams().len();
        let part = beams as f64 / beams_taken as f64;
        let least = inverse(&bound(&floor, &geometry, pose, beams)).unwrap();
        for i in 0..3 {
            let ratio = found.covariance[i][i] / (least[i][i] * part);
            assert!((0.8..1.4).contains(&ratio), "{pose:?} {i}: {ratio} times the bound");
            // The mean of 400 lies within four of its deviations, and two for corners, which pull the points of two walls to one.
            let deviation = (found.covariance[i][i] / 400.0).sqrt();
            assert!(found.mean[i].abs() < 6.0 * deviation, "{pose:?} {i}: off by {}", found.mean[i]);
        }
        assert!((1.8..3.6).contains(&found.told), "{pose:?}: {} of 3", found.told);
        let off = (found.covariance[0][0] + found.covariance[1][1]).sqrt();
        assert!(off < 0.003, "{off} m");
    }
}

#[test]
fn a_fifth_of_the_beams_may_be_wrong() {
    let floor = PlanField::new(&room()).unwrap();
    let (beams, pose) = (181, Pose::new(2.0, 1.5, 0.3));
    let geometry = geometry(beams);
    let ideal = exact(&floor, &geometry, pose, beams);
    let clean = statistics(&floor, &ideal, &geometry, pose, 200, |_, _| {});
    let spoiled = statistics(&floor, &ideal, &geometry, pose, 200, |ranges, draw| {
        for (i, range) in ranges.iter_mut().enumerate() {
            if draw.uniform(i as u64) < 0.2 {
                *range *= draw.between(1000 + i as u64, 0.2, 1.0) as f32;
            }
        }
    });
    for i in 0..3 {
        // A fifth of the beams says nothing, and a few that are wrong by centimetres say a little that is wrong.
        let ratio = spoiled.covariance[i][i] / clean.covariance[i][i];
        assert!(ratio < 2.0, "{i}: {ratio}");
        assert!(spoiled.covariance[i][i].sqrt() < 0.003, "{i}");
    }
}

#[test]
fn a_corridor_without_ends_says_nothing_of_the_place_along_it() {
    let mut plan = FloorPlan::default();
    plan.line(&[Point::new(-50.0, 0.0), Point::new(50.0, 0.0)]);
    plan.line(&[Point::new(-50.0, 2.0), Point::new(50.0, 2.0)]);
    let floor = PlanField::new(&plan).unwrap();
    let geometry = geometry(181);
    let pose = Pose::new(3.0, 0.9, 0.2);
    let ideal = exact(&floor, &geometry, pose, 181);
    for trial in 0..50 {
        let scan = taken(&noisy(&ideal, NOISE, Stream::new(trial, "corridor")), &geometry);
        let guess = Pose::new(3.4, 1.0, 0.1);
        let found = match_scan(&floor, &scan, guess, &MatchParams::default()).unwrap();
        assert_eq!(found.unseen, 1);
        assert!((found.pose.x - guess.x).abs() < 1e-9, "a place was invented: {:?}", found.pose);
        assert!((found.pose.y - pose.y).abs() < 0.006 && (found.pose.heading - pose.heading).abs() < 0.006);
        assert!(found.information[0][0].abs() < 1e-6 && found.information[1][1] > 1e5);
        assert!(found.inliers > 0.99);
    }
}

#[test]
fn an_aslant_corridor_is_corrected_across_and_not_along() {
    let along = Point::polar(1.0, 0.7);
    let across = Point::new(-along.y, along.x);
    let mut plan = FloorPlan::default();
    for side in [-0.8, 0.8] {
        plan.line(&[along * -60.0 + across * side, along * 60.0 + across * side]);
    }
    let floor = PlanField::new(&plan).unwrap();
    let geometry = geometry(361);
    let pose = Pose::new(0.0, 0.0, 0.6);
    let scan =
        taken(&noisy(&exact(&floor, &geometry, pose, 361), NOISE, Stream::new(1, "aslant")), &geometry);
    let guess = across * 0.15 + along * 0.25;
    let found =
        match_scan(&floor, &scan, Pose::new(guess.x, guess.y, 0.55), &MatchParams::default()).unwrap();
    let off = found.pose.position();
    assert!((off.dot(along) - 0.25).abs() < 1e-6 && off.dot(across).abs() < 0.005, "{off:?}");
}

#[test]
fn over_a_learned_grid_it_is_right_to_a_fraction_of_a_cell() {
    let exact_floor = PlanField::new(&room()).unwrap();
    let cell = 0.05;
    // What many scans would leave: the cells through which an outline goes.
    let grid = GridField::new(Point::new(-0.525, -0.525), cell, (142, 112), 1.0, |x, y| {
        let middle = Point::new(-0.5 + cell * f64::from(x), -0.5 + cell * f64::from(y));
        exact_floor.nearest(middle).is_some_and(|nearest| nearest.distance < cell / 2.0)
    });
    let (beams, pose) = (181, Pose::new(2.3, 1.7, 0.5));
    let geometry = geometry(beams);
    let ideal = exact(&exact_floor, &geometry, pose, beams);
    let found = statistics(&grid, &ideal, &geometry, pose, 60, |_, _| {});
    let off = (found.covariance[0][0] + found.covariance[1][1]).sqrt();
    assert!(off < 0.012 && found.covariance[2][2].sqrt() < 0.008, "{off} m, {:?}", found.covariance);
}

#[test]
fn what_is_no_scan_of_the_place_is_told() {
    let floor = PlanField::new(&room()).unwrap();
    let geometry = geometry(181);
    let silent = taken(&[8.0; 181], &geometry);
    let params = MatchParams::default();
    assert_eq!(match_scan(&floor, &silent, Pose::default(), &params), Err(NoMatch::FewReturns));
    let nonsense = taken(&[f32::NAN; 181], &geometry);
    assert_eq!(match_scan(&floor, &nonsense, Pose::default(), &params), Err(NoMatch::FewReturns));
    let far = Pose::new(90.0, 0.0, 0.0);
    let scan = taken(
        &noisy(&exact(&floor, &geometry, Pose::new(2.0, 2.0, 0.0), 181), NOISE, Stream::new(0, "")),
        &geometry,
    );
    assert_eq!(match_scan(&floor, &scan, far, &params), Err(NoMatch::NothingNear));
    // From a wrong place in the room few points lie on anything.
    let found = match_scan(&floor, &scan, Pose::new(4.0, 1.0, 2.0), &params);
    assert!(found.is_err() || found.unwrap().inliers < 0.75, "{found:?}");
}

#[test]
fn of_many_beams_some_are_taken_from_all_sides() {
    let geometry = geometry(361);
    let scan = taken(&[2.0; 361], &geometry);
    assert_eq!(scan.beams().len(), 181);
    let of = |beam: &Beam| beam.direction.bearing();
    let (first, last) = (of(&scan.beams()[0]), of(scan.beams().last().unwrap()));
    assert!((first + last).abs() < 1e-9, "{first} {last}");
    let mut few = Scan::new();
    few.take(&[2.0; 361], &geometry, 30);
    assert_eq!(few.beams().len(), 28);
    let bearings: Vec<f64> = few.beams().iter().map(of).collect();
    // Thirteen beams lie between two of them, so the ends can differ by so much.
    assert!((bearings[0] + bearings[27]).abs() < 13.0 * geometry.angle_step, "{bearings:?}");
    assert!((product(&ZERO, &ZERO)) == ZERO);
}

#[test]
fn the_far_side_of_a_wall_is_not_met() {
    // A robot before a thick wall sees the near side; shifted by the thickness its points would lie on the far one.
    let mut plan = FloorPlan::default();
    plan.walls.push(crate::floor::Wall {
        from: Point::new(3.0, -4.0),
        to: Point::new(3.0, 4.0),
        thickness: 0.12,
    });
    plan.walls.push(crate::floor::Wall {
        from: Point::new(-1.0, 2.0),
        to: Point::new(2.5, 2.0),
        thickness: 0.12,
    });
    let floor = PlanField::new(&plan).unwrap();
    let geometry = geometry(181);
    let pose = Pose::new(1.0, 0.0, 0.1);
    let scan =
        taken(&noisy(&exact(&floor, &geometry, pose, 181), NOISE, Stream::new(1, "far side")), &geometry);
    for off in [0.0, 0.06, 0.12, -0.12] {
        let guess = Pose::new(pose.x + off, pose.y + off, pose.heading);
        let found = match_carefully(&floor, &scan, guess, &MatchParams::default()).unwrap();
        assert!(found.pose.position().distance(pose.position()) < 0.008, "{off}: {:?}", found.pose);
        assert!(found.inliers > 0.98, "{off}: {}", found.inliers);
    }
}

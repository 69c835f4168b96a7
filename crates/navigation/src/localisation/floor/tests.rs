use super::*;
use crate::floor::{FloorPlan, FreeFloor, PlanField};
use crate::laboratory::{Roamer, flat};
use crate::localisation::landmarks::sighting::seen_from;
use crate::localisation::landmarks::{Mark, Marks};
use crate::matching::deviation;
use types::Point;
use types::geometry::{PI, wrap};

/// So many runs. Of 200 all were found, after 12 to 29 scans, and of 100 that were carried elsewhere all were found again.
const SEEDS: u64 = 8;

fn floor() -> PlanField {
    PlanField::new(&flat()).unwrap()
}

fn lost(floor: &PlanField, seed: u64) -> FloorLocalizer<PlanField> {
    FloorLocalizer::new(floor.clone(), FloorParams::default(), Stream::new(seed, "localizer"))
}

fn anywhere(floor: &PlanField, seed: u64) -> Pose {
    let draw = Stream::new(seed, "start");
    let at = FreeFloor::new(floor, 0.4).draw(draw);
    Pose::new(at.x, at.y, draw.between(3, -PI, PI))
}

/// Says where the robot is, and lets it see once.
fn put(localizer: &mut FloorLocalizer<PlanField>, roamer: &Roamer<'_>, pose: Pose) {
    localizer.place(pose, 0.1, 0.1);
    assert_eq!(localizer.update(roamer.odometry, &roamer.look(), &roamer.geometry), Outcome::Fixed);
}

fn go(localizer: &mut FloorLocalizer<PlanField>, roamer: &mut Roamer<'_>) -> Outcome {
    roamer.go();
    localizer.update(roamer.odometry, &roamer.look(), &roamer.geometry)
}

/// One that knows where its robot is, after ten scans on its way.
fn tracked(floor: &PlanField, seed: u64) -> (FloorLocalizer<PlanField>, Roamer<'_>) {
    let mut roamer = Roamer::new(floor, anywhere(floor, seed), seed);
    let mut localizer = lost(floor, seed);
    put(&mut localizer, &roamer, roamer.pose);
    (0..10).for_each(|_| assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed));
    (localizer, roamer)
}

fn off(localizer: &FloorLocalizer<PlanField>, roamer: &Roamer<'_>) -> f64 {
    let pose = localizer.pose().expect("it is known");
    pose.position().distance(roamer.pose.position()) + 0.3 * wrap(pose.heading - roamer.pose.heading).abs()
}

#[test]
fn from_a_known_start_it_is_right_to_millimetres_and_knows_how_right() {
    let floor = floor();
    let (mut squares, mut worst, mut told, mut count) = (0.0, 0.0f64, 0.0, 0.0);
    for seed in 0..4 {
        let mut roamer = Roamer::new(&floor, anywhere(&floor, seed), seed);
        let mut localizer = lost(&floor, seed);
        let begin = roamer.pose;
        put(&mut localizer, &roamer, Pose::new(begin.x + 0.05, begin.y - 0.05, begin.heading + 0.03));
        for _ in 0..200 {
            assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed);
            let off = off(&localizer, &roamer);
            let known = crate::linear::inverse(&localizer.covariance()).unwrap();
            told += deviation(&known, roamer.pose, localizer.pose().unwrap());
            (squares, worst, count) = (squares + off * off, worst.max(off), count + 1.0);
        }
    }
    let rms = (squares / count).sqrt();
    assert!(rms < 0.004 && worst < 0.015, "rms {rms}, at most {worst}");
    assert!((1.0..6.0).contains(&(told / count)), "{} of 3", told / count);
}

#[test]
fn from_an_unknown_start_it_is_found_and_nothing_wrong_is_ever_said() {
    let floor = floor();
    let mut needed = Vec::new();
    for seed in 0..SEEDS {
        let mut roamer = Roamer::new(&floor, anywhere(&floor, seed), seed);
        let mut localizer = lost(&floor, seed);
        let found = (0..150).find(|_| {
            let _ = go(&mut localizer, &mut roamer);
            localizer.pose().is_some()
        });
        if let Some(scans) = found {
            assert!(off(&localizer, &roamer) < 0.05, "seed {seed}: {}", off(&localizer, &roamer));
            needed.push(scans);
        }
    }
    needed.sort();
    assert!(needed.len() as u64 * 20 >= 19 * SEEDS, "{} of {SEEDS} found, after {needed:?}", needed.len());
    assert!(needed[needed.len() / 2] < 40, "{needed:?}");
}

#[test]
fn one_that_is_carried_elsewhere_is_lost_in_three_scans_and_found_again() {
    let floor = floor();
    let mut found = 0;
    for seed in 0..SEEDS / 2 {
        let mut roamer = Roamer::new(&floor, anywhere(&floor, seed), seed);
        let mut localizer = lost(&floor, seed);
        put(&mut localizer, &roamer, roamer.pose);
        (0..20).for_each(|_| assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed));
        roamer.pose = anywhere(&floor, 50 + seed);
        for scan in 0..3 {
            assert_eq!(go(&mut localizer, &mut roamer), Outcome::Misfit, "seed {seed} {scan}");
        }
        assert_eq!((localizer.state(), localizer.pose()), (State::Searching, None));
        for _ in 0..80 {
            let _ = go(&mut localizer, &mut roamer);
            if localizer.pose().is_some() {
                assert!(off(&localizer, &roamer) < 0.05, "seed {seed}: {}", off(&localizer, &roamer));
            }
        }
        found += u64::from(localizer.state() == State::Tracking);
    }
    assert!(found * 10 >= 9 * (SEEDS / 2), "{found} of {}", SEEDS / 2);
}

/// What a laser sees when people stand close around it: of eight beams seven end at them.
fn among_people(roamer: &Roamer, number: u64) -> Vec<f32> {
    let draw = Stream::new(7, "people").sample(number);
    let hide = |(i, range): (usize, f32)| {
        let person = draw.between(i as u64 / 12, 0.4, 0.9) as f32;
        if i / 12 % 8 == 0 { range } else { range.min(person + 0.001 * (i % 12) as f32) }
    };
    roamer.look().into_iter().enumerate().map(hide).collect()
}

#[test]
fn people_who_hide_the_floor_do_not_lose_it_but_being_carried_away_among_them_does() {
    let floor = floor();
    for seed in 0..SEEDS / 2 {
        let (mut localizer, mut roamer) = tracked(&floor, seed);
        let mut hidden = 0;
        for scan in 0..100 {
            // It stands and waits; every tenth scan it goes on.
            if scan % 10 == 0 {
                roamer.go();
            }
            let outcome = localizer.update(roamer.odometry, &among_people(&roamer, scan), &roamer.geometry);
            hidden += u32::from(outcome == Outcome::Hidden);
            assert_eq!(localizer.state(), State::Tracking, "seed {seed} {scan}: {outcome:?}");
            assert!(off(&localizer, &roamer) < 0.1, "seed {seed} {scan}: {}", off(&localizer, &roamer));
        }
        assert!(hidden > 20, "seed {seed}: {hidden}");
        roamer.pose = anywhere(&floor, 50 + seed);
        let noticed = (0..500).find(|scan| {
            roamer.go();
            let _ = localizer.update(roamer.odometry, &among_people(&roamer, 1000 + scan), &roamer.geometry);
            localizer.pose().is_none()
        });
        assert!(noticed.is_some(), "seed {seed}");
    }
}

#[test]
fn a_wall_that_was_put_up_close_before_it_hides_most_and_it_still_knows_where_it_is() {
    let floor = floor();
    for seed in 0..SEEDS / 2 {
        let (mut localizer, roamer) = tracked(&floor, seed);
        let geometry = roamer.geometry;
        for scan in 0..1000 {
            // It stands, and the noise of its laser makes each scan another one.
            let wall = |(i, range): (usize, f32)| {
                let angle = geometry.angle_min + geometry.angle_step * i as f64;
                let hidden = 0.7 / libm::cos(angle);
                if angle.abs() < 1.1 { range.min(hidden as f32 + 1e-4 * (scan % 7) as f32) } else { range }
            };
            let ranges: Vec<f32> = roamer.look().into_iter().enumerate().map(wall).collect();
            let outcome = localizer.update(roamer.odometry, &ranges, &geometry);
            assert_eq!(localizer.state(), State::Tracking, "seed {seed} {scan}: {outcome:?}");
            assert!(off(&localizer, &roamer) < 0.05, "seed {seed} {scan}: {}", off(&localizer, &roamer));
        }
    }
}

#[test]
fn where_two_places_look_the_same_it_names_both_and_decides_for_none() {
    let mut plan = FloorPlan::room(8.0, 4.0);
    plan.line(&[Point::new(2.0, 0.0), Point::new(2.0, 2.0)]);
    plan.line(&[Point::new(6.0, 4.0), Point::new(6.0, 2.0)]);
    let floor = PlanField::new(&plan).unwrap();
    for seed in 0..SEEDS / 2 {
        let mut roamer = Roamer::new(&floor, anywhere(&floor, seed), seed);
        let mut localizer = lost(&floor, seed);
        for scan in 0..40 {
            assert_eq!(go(&mut localizer, &mut roamer), Outcome::Searched, "seed {seed} {scan}");
        }
        let turned = Pose::new(8.0 - roamer.pose.x, 4.0 - roamer.pose.y, wrap(roamer.pose.heading + PI));
        let near = |pose: Pose| {
            localizer.places().iter().any(|place| place.pose.position().distance(pose.position()) < 0.05)
        };
        assert!(near(roamer.pose) && near(turned), "seed {seed}: {:?}", localizer.places());
        // Somebody who knows says so.
        localizer.place(turned, 0.1, 0.1);
        assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed);
        assert!(localizer.fix().is_some());
    }
}

#[test]
fn a_laser_that_is_stuck_is_noticed_when_the_robot_moves() {
    let floor = floor();
    let mut roamer = Roamer::new(&floor, Pose::new(2.0, 2.5, 0.3), 1);
    let mut localizer = lost(&floor, 1);
    put(&mut localizer, &roamer, roamer.pose);
    (0..10).for_each(|_| assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed));
    let stuck = roamer.look();
    let pose = localizer.pose();
    assert_eq!(localizer.update(roamer.odometry, &stuck, &roamer.geometry), Outcome::Repeated);
    assert_eq!(
        (localizer.update(roamer.odometry, &stuck, &roamer.geometry), localizer.pose()),
        (Outcome::Repeated, pose)
    );
    for _ in 0..3 {
        roamer.go();
        assert_eq!(localizer.update(roamer.odometry, &stuck, &roamer.geometry), Outcome::Stuck);
    }
    assert_eq!((localizer.state(), localizer.pose()), (State::Lost, None));
    // When it sees again, it is found from where it should be by now.
    let found = (0..40).find(|_| go(&mut localizer, &mut roamer) == Outcome::Fixed);
    assert!(found.is_some_and(|scans| scans < 25), "{found:?}");
    assert!(off(&localizer, &roamer) < 0.02);
}

#[test]
fn without_scans_it_is_lost_and_found_where_its_wheels_took_it() {
    let floor = floor();
    let mut roamer = Roamer::new(&floor, Pose::new(2.0, 2.5, 0.3), 1);
    let mut localizer = lost(&floor, 1);
    put(&mut localizer, &roamer, roamer.pose);
    for _ in 0..5 {
        roamer.go();
    }
    localizer.silence(roamer.odometry);
    assert_eq!((localizer.state(), localizer.pose(), localizer.fix()), (State::Lost, None, None));
    let found = (0..40).find(|_| go(&mut localizer, &mut roamer) == Outcome::Fixed);
    assert!(found.is_some() && off(&localizer, &roamer) < 0.02, "{found:?}");
}

#[test]
fn without_returns_it_goes_on_by_its_wheels_until_they_may_be_too_far_off() {
    let floor = floor();
    let mut roamer = Roamer::new(&floor, Pose::new(2.0, 2.5, 0.3), 1);
    let mut localizer = lost(&floor, 1);
    put(&mut localizer, &roamer, roamer.pose);
    let _ = go(&mut localizer, &mut roamer);
    let mut scans = 0;
    while localizer.state() == State::Tracking {
        assert!(off(&localizer, &roamer) < 0.4, "after {scans}");
        roamer.go();
        // Each is another scan, all of nothing.
        let mut nothing = vec![8.0; 181];
        nothing[scans % 181] = 8.5;
        assert_eq!(
            localizer.update(roamer.odometry, &nothing, &roamer.geometry),
            if localizer.state() == State::Tracking { Outcome::Empty } else { Outcome::Stuck }
        );
        scans += 1;
        assert!(scans < 2000);
    }
    assert!(scans > 20, "{scans}");
    assert_eq!(localizer.pose(), None);
}

#[test]
fn what_another_measures_is_taken_as_far_as_it_agrees() {
    let floor = floor();
    let mut localizer = lost(&floor, 1);
    let information = diagonal([1e4, 1e4, 1e4]);
    assert!(!localizer.correct(Pose::default(), &information), "nothing is known");
    localizer.place(Pose::new(2.0, 2.0, 0.0), 0.1, 0.1);
    // Of equal deviations the mean is taken: here ten to one.
    assert!(localizer.correct(Pose::new(2.1, 2.0, 0.0), &information));
    let x = localizer.pose().unwrap().x;
    assert!((x - (2.0 + 0.1 * 1e4 / (1e4 + 1e2))).abs() < 1e-9, "{x}");
    assert!(!localizer.correct(Pose::new(4.0, 2.0, 0.0), &information), "that is elsewhere");
    assert_eq!(localizer.pose().unwrap().x, x);
    // Of one direction alone nothing else changes.
    assert!(localizer.correct(Pose::new(2.1, 9.0, 1.0), &diagonal([1e4, 0.0, 0.0])));
    assert!(localizer.pose().unwrap().y == 2.0);
}

#[test]
fn dead_reckoning_goes_on_from_the_last_scan() {
    let floor = floor();
    let mut roamer = Roamer::new(&floor, Pose::new(2.0, 2.5, 0.3), 1);
    let mut localizer = lost(&floor, 1);
    put(&mut localizer, &roamer, roamer.pose);
    let _ = go(&mut localizer, &mut roamer);
    let moved = Pose::new(0.1, 0.02, 0.3);
    let predicted = localizer.pose_at(roamer.odometry.then(moved)).unwrap();
    let expected = localizer.pose().unwrap().then(moved);
    assert!(predicted.position().distance(expected.position()) < 1e-12);
}

/// Lets a robot in a corridor whose ends are farther away than its laser reaches drive in it for 20 m. It is said to be 25 cm farther along than
/// it is. Gives how far off it is at most after 4 m, along and across.
fn along_a_corridor(landmarks: bool) -> (f64, f64) {
    let mut plan = FloorPlan::default();
    plan.line(&[Point::new(-30.0, -1.0), Point::new(60.0, -1.0)]);
    plan.line(&[Point::new(-30.0, 1.0), Point::new(60.0, 1.0)]);
    let floor = PlanField::new(&plan).unwrap();
    let mut roamer = Roamer::new(&floor, Pose::new(10.0, 0.1, 0.02), 3);
    let mut localizer = lost(&floor, 3);
    let Pose { x, y, heading } = roamer.pose;
    localizer.place(Pose::new(x + 0.25, y, heading), 0.2, 0.05);
    let marks = (0..10).map(|k| Mark { id: k + 1, at: Point::new(4.0 * f64::from(k), 0.9), facing: 0.0 });
    let parameters = Parameters { range: 0.02, range_part: 0.0, bearing: 0.01, ..Parameters::default() };
    let mut watch = Watch::new(Marks::new(marks.clone(), 2.0), parameters);
    let mut worst = (0.0f64, 0.0f64);
    for tenth in 0..250u64 {
        let _ = go(&mut localizer, &mut roamer);
        let draw = Stream::new(5, "landmarks").sample(tenth);
        let seen = marks.clone().map(|mark| (mark.id, seen_from(roamer.pose, mark.at)));
        let near = seen.filter(|(_, seen)| seen.range < 3.0 && seen.bearing.abs() < 0.6);
        // None tells its name.
        let told: Vec<_> = near
            .map(|(id, seen)| LandmarkSighting {
                range: (seen.range + 0.02 * draw.normal(2 * u64::from(id))) as f32,
                bearing: (seen.bearing + 0.01 * draw.normal(2 * u64::from(id) + 1)) as f32,
                ..LandmarkSighting::default()
            })
            .collect();
        if landmarks {
            localizer.sees(&mut watch, Time(200_000_000 * (1 + tenth as i64)), roamer.odometry, &told);
        }
        let pose = localizer.pose().expect("it is known");
        let off = pose.position() - roamer.pose.position();
        if tenth >= 50 {
            worst = (worst.0.max(off.x.abs()), worst.1.max(off.y.abs()));
        }
    }
    worst
}

#[test]
fn along_a_corridor_landmarks_tell_what_the_scan_does_not() {
    let ((by_wheels, across), (along, still)) = (along_a_corridor(false), along_a_corridor(true));
    assert!(by_wheels > 0.2, "it goes on as it began: {by_wheels}");
    // A landmark is told to 2 cm; while the robot turns it sees none, and the wheels are a hundredth off on 4 m and more.
    assert!(along < 0.1, "{along}");
    assert!(across < 0.02 && still < 0.02, "the walls tell that: {across} {still}");
}

#[test]
fn two_landmarks_end_a_search_in_a_place_that_looks_like_another() {
    // A hall that looks the same from both of its ends.
    let floor = PlanField::new(&FloorPlan::room(6.0, 4.5)).unwrap();
    let mut roamer = Roamer::new(&floor, Pose::new(2.0, 2.0, 0.3), 1);
    let mut localizer = lost(&floor, 1);
    (0..30).for_each(|_| assert_eq!(go(&mut localizer, &mut roamer), Outcome::Searched));
    let places = [(1u32, Point::new(5.8, 4.3)), (2, Point::new(5.8, 0.2))];
    let marks = places.map(|(id, at)| Mark { id, at, facing: 0.0 });
    let parameters = Parameters { range: 0.02, range_part: 0.0, bearing: 0.01, ..Parameters::default() };
    let mut watch = Watch::new(Marks::new(marks, 2.0), parameters);
    let seen = places.map(|(id, at)| {
        let seen = seen_from(roamer.pose, at);
        let (range, bearing) = (seen.range as f32 + 0.01, seen.bearing as f32 - 0.005);
        LandmarkSighting { id, range, bearing, side: 0 }
    });
    assert!(localizer.sees(&mut watch, Time::ZERO, roamer.odometry, &seen));
    assert_eq!(go(&mut localizer, &mut roamer), Outcome::Fixed, "the next scan confirms it");
    assert!(off(&localizer, &roamer) < 0.02, "{}", off(&localizer, &roamer));
}

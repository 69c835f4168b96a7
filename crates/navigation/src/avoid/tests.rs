//! The laws of avoidance against what follows from their equations by hand.

use super::nearness::{self, NearnessDiagram, speed};
use super::sectors::{SECTOR, bearing};
use super::*;
use libm::{asin, atan2, fabs, hypot};
use proptest::prelude::*;
use types::Point;
use types::geometry::{PI, wrap};
use types::messages::{Avoidance, Situation};

const ROUND: Body = Body::Round { radius: 0.2 };

/// A round robot of 0.2 m that keeps 0.5 m, needs 0.44 m to pass, at 1 m/s and 1 rad/s.
fn diagram() -> NearnessDiagram {
    NearnessDiagram::new(nearness::Parameters {
        linear_max: 1.0,
        angular_max: 1.0,
        goal_tolerance: 0.1,
        ..nearness::Parameters::new(ROUND)
    })
}

/// What is seen of a wall from `a` to `b`, so finely that no sector is left out.
fn wall(around: &mut Sectors, a: (f64, f64), b: (f64, f64)) {
    for i in 0..=2000 {
        let t = f64::from(i) / 2000.0;
        around.add_point(Point::new(a.0 + (b.0 - a.0) * t, a.1 + (b.1 - a.1) * t));
    }
}

/// From one end to the other.
type Wall = ((f64, f64), (f64, f64));

fn around(walls: &[Wall]) -> Sectors {
    let mut around = Sectors::new();
    walls.iter().for_each(|(a, b)| wall(&mut around, *a, *b));
    around
}

fn degrees(rad: f64) -> f64 {
    rad * 180.0 / PI
}

#[test]
fn hsgr_goes_straight_to_the_goal_by_the_law_of_the_speed() {
    let out = diagram().step(Some(&Sectors::new()), Point::polar(3.0, PI / 4.0));
    assert_eq!(out.situation, Situation::HighSafetyGoalInRegion);
    // 45° of 90° leave half of the speed, and ask for half of the turn.
    assert!(fabs(out.direction - PI / 4.0) < 1e-12);
    assert!(fabs(out.twist.linear - 0.5) < 1e-12 && fabs(out.twist.angular - 0.5) < 1e-12, "{out:?}");
}

#[test]
fn hswr_passes_the_end_of_a_wall_at_the_security_distance() {
    // A wall across the way, 1.5 m ahead, ends to the left at y = 0.4; the goal is behind it.
    let around = around(&[((1.5, -2.5), (1.5, 0.4))]);
    let out = diagram().step(Some(&around), Point::new(4.0, 0.0));
    assert_eq!(out.situation, Situation::HighSafetyWideRegion);
    // By the end of the wall in its sector, turned left by atan((w/2 + d_s)/D).
    let corner = sectors::sector(atan2(0.4, 1.5));
    let distance = around.distances()[corner];
    let expected = bearing(corner) + atan2(0.22 + 0.5, distance);
    assert!(fabs(out.direction - expected) < 1e-12, "{} {}", degrees(out.direction), degrees(expected));
    assert!(fabs(distance - hypot(0.4, 1.5)) < 0.02);
    // Standing off: the way passes the corner no nearer than half a passage.
    assert!(distance * libm::sin(out.direction - bearing(corner)) > 0.22);
}

#[test]
fn hsnr_goes_through_the_middle_of_a_gap() {
    // Two walls leave a gap of 1.2 m around y = 0.9, 1.5 m ahead. The goal lies in front of nothing: far to the right of the gap.
    let around = around(&[((1.5, 1.5), (1.5, 4.0)), ((1.5, 0.3), (1.5, -4.0))]);
    let out = diagram().step(Some(&around), Point::new(4.0, 0.0));
    assert_eq!(out.situation, Situation::HighSafetyNarrowRegion);
    let (right, left) = (atan2(0.3, 1.5), atan2(1.5, 1.5));
    assert!(fabs(out.direction - (right + left) / 2.0) <= SECTOR, "{}", degrees(out.direction));
    assert!(fabs(out.region_right - right) <= SECTOR && fabs(out.region_left - left) <= SECTOR);
}

#[test]
fn lsgr_turns_from_the_goal_by_what_is_missing_of_the_security_distance() {
    // A post on the left, 0.45 m away from the centre: 0.25 m from the edge, half of the security distance.
    let mut around = Sectors::new();
    around.add_point(Point::polar(0.45, PI / 3.0));
    let out = diagram().step(Some(&around), Point::new(3.0, 0.0));
    assert_eq!(out.situation, Situation::LowSafetyGoalInRegion);
    // ½ · 0° + ½ · (60° − 180°) = −60°; of the speed, half is left by the distance and a third by the turn.
    assert!(fabs(degrees(out.direction) + 60.0) < 1e-9, "{}", degrees(out.direction));
    assert!(fabs(out.twist.linear - 0.5 / 3.0) < 1e-9 && fabs(out.twist.angular + 2.0 / 3.0) < 1e-9);
    assert!(fabs(out.left - 0.5) < 1e-9 && out.right == 1.0);
}

#[test]
fn ls1_turns_from_the_way_into_the_region_by_what_is_missing_of_the_security_distance() {
    // The wall of HSWR, and a post on the right at half of the security distance.
    let mut around = around(&[((1.5, -2.5), (1.5, 0.4))]);
    around.add_point(Point::polar(0.45, -PI / 2.0));
    let out = diagram().step(Some(&around), Point::new(4.0, 0.0));
    assert_eq!(out.situation, Situation::LowSafetyOneSide);
    let corner = sectors::sector(atan2(0.4, 1.5));
    let free = bearing(corner) + atan2(0.72, around.distances()[corner]);
    // Opposite to the post is 90°.
    assert!(fabs(out.direction - (0.5 * free + 0.5 * PI / 2.0)) < 1e-9, "{}", degrees(out.direction));
}

#[test]
fn ls2_leans_to_the_side_where_there_is_more_room() {
    // Posts beside it: 0.1 m on the left, 0.3 m on the right of its edge.
    let mut around = Sectors::new();
    around.add_point(Point::polar(0.3, PI / 2.0));
    around.add_point(Point::polar(0.5, -PI / 2.0));
    let out = diagram().step(Some(&around), Point::new(3.0, 0.0));
    assert_eq!(out.situation, Situation::LowSafetyTwoSides);
    // (0.2 − 0.6)/(0.2 + 0.6) · 90° = −45°.
    assert!(fabs(degrees(out.direction) + 45.0) < 1e-9, "{}", degrees(out.direction));
    // 0.2 of the speed by the distance, half of that by the turn.
    assert!(fabs(out.twist.linear - 0.1) < 1e-9);
}

#[test]
fn in_the_middle_of_a_corridor_it_goes_straight_on() {
    let around = around(&[((-4.0, 0.5), (4.0, 0.5)), ((-4.0, -0.5), (4.0, -0.5))]);
    let out = diagram().step(Some(&around), Point::new(2.0, 0.0));
    assert_eq!(out.situation, Situation::LowSafetyTwoSides);
    assert!(fabs(out.direction) < 1e-9);
}

#[test]
fn a_goal_in_front_of_a_wall_is_gone_to_and_one_in_a_closed_room_outside_is_not() {
    let room = [
        ((2.0, -2.0), (2.0, 2.0)),
        ((-2.0, -2.0), (-2.0, 2.0)),
        ((-2.0, 2.0), (2.0, 2.0)),
        ((-2.0, -2.0), (2.0, -2.0)),
    ];
    let around = around(&room);
    let out = diagram().step(Some(&around), Point::new(1.0, 0.0));
    assert_eq!(out.situation, Situation::HighSafetyGoalInRegion);
    let out = diagram().step(Some(&around), Point::new(3.0, 0.0));
    assert_eq!((out.situation, out.twist), (Situation::NoWay, types::messages::Twist::ZERO));
}

#[test]
fn a_gap_that_is_too_narrow_is_passed_over_for_the_next_one() {
    // 0.3 m are too little for 0.44 m; behind the wall on the right there is a wide gap.
    let around =
        around(&[((1.5, 0.15), (1.5, 3.9)), ((1.5, -0.15), (1.5, -1.2)), ((1.5, -2.6), (1.5, -5.0))]);
    let out = diagram().step(Some(&around), Point::new(4.0, 0.0));
    assert!(out.direction < atan2(-1.2, 1.5) + SECTOR, "{}", degrees(out.direction));
}

#[test]
fn the_speed_never_exceeds_its_highest_however_far_the_obstacle_and_never_turns_negative() {
    let parameters = nearness::Parameters { linear_max: 0.3, gain: 3.0, ..nearness::Parameters::new(ROUND) };
    // 0.3 · (1/2) · (2/3) by the published law with gain 1.
    let published = nearness::Parameters { gain: 1.0, ..parameters };
    assert!(fabs(speed(&published, PI / 6.0, 0.5).linear - 0.1) < 1e-12);
    assert_eq!(speed(&parameters, 0.0, 4.0).linear, 0.3);
    assert_eq!(speed(&parameters, 0.0, 0.5).linear, 0.3);
    assert_eq!(speed(&parameters, 0.0, -0.2).linear, 0.0);
    assert_eq!(speed(&parameters, 3.0, 1.0).linear, 0.0);
}

#[test]
fn who_sees_nothing_stands_and_says_so() {
    for out in [diagram().step(None, Point::new(2.0, 0.0)), smooth().step(None, Point::new(2.0, 0.0))] {
        assert_eq!((out.situation, out.twist), (Situation::Blind, types::messages::Twist::ZERO));
    }
}

/// A smooth one for the same robot: threats reach 0.8 m.
fn smooth() -> SmoothNearness {
    SmoothNearness::new(smooth::Parameters {
        linear_max: 1.0,
        angular_max: 1.0,
        ..smooth::Parameters::new(ROUND)
    })
}

#[test]
fn the_smooth_one_goes_straight_where_nothing_is_near() {
    let out = smooth().step(Some(&Sectors::new()), Point::new(3.0, 0.0));
    assert_eq!((out.twist.linear, out.twist.angular), (1.0, 0.0));
    // At 15° half of the speed is left.
    let out = smooth().step(Some(&Sectors::new()), Point::polar(3.0, PI / 12.0));
    assert!(fabs(out.twist.linear - 0.5) < 1e-12 && fabs(out.twist.angular - 1.0 / 6.0) < 1e-12);
}

#[test]
fn the_smooth_one_turns_from_a_single_threat_by_its_strength() {
    // 0.4 m from the edge at 60° on the left: D_s = min(5 · 0.4, 0.8) = 0.8, s = ½, Δ = s · (60° − 180°) = −60°.
    let mut around = Sectors::new();
    around.add_point(Point::polar(0.6, PI / 3.0));
    let out = smooth().step(Some(&around), Point::new(3.0, 0.0));
    assert!(fabs(degrees(out.direction) + 60.0) < 1e-9, "{}", degrees(out.direction));
    // 0.08 m away: D_s = 0.4, s = 0.8, Δ = −96°, held at −90°.
    let mut around = Sectors::new();
    around.add_point(Point::polar(0.28, PI / 3.0));
    let out = smooth().step(Some(&around), Point::new(3.0, 0.0));
    assert!(fabs(degrees(out.direction) + 90.0) < 1e-9 && out.twist.linear == 0.0);
}

#[test]
fn the_smooth_one_stands_off_the_corner_of_a_wall_that_is_in_the_way() {
    let around = around(&[((1.5, -2.5), (1.5, 0.2))]);
    let out = smooth().step(Some(&around), Point::new(4.0, 0.0));
    let corner = sectors::sector(atan2(0.2, 1.5));
    let expected = bearing(corner) + asin((0.8 + 0.2) / around.distances()[corner]);
    assert!(fabs(out.free - expected) < 1e-9, "{} {}", degrees(out.free), degrees(expected));
}

#[test]
fn a_long_robot_does_not_swing_its_rear_into_a_post_beside_it() {
    let body = Body::Rectangle { front: 0.255, rear: 0.255, half_width: 0.215 };
    let mut diagram = NearnessDiagram::new(nearness::Parameters::new(body));
    let mut around = Sectors::new();
    // 5 cm beside its rear on the right: turning left would sweep it. The shell is 3 cm.
    around.add_point(Point::new(-0.2, -0.265));
    let out = diagram.step(Some(&around), Point::polar(3.0, PI / 3.0));
    assert!(out.direction > 0.0 && out.twist.angular == 0.0, "{out:?}");
    // Beside the front half it may: the front swings away from it.
    let mut around = Sectors::new();
    around.add_point(Point::new(0.1, -0.265));
    let out = diagram.step(Some(&around), Point::polar(3.0, PI / 3.0));
    assert!(out.direction > 0.0 && out.twist.angular > 0.0, "{out:?}");
    // At the corner in front it may only turn.
    let mut around = Sectors::new();
    around.add_point(Point::new(0.285, 0.245));
    let out = diagram.step(Some(&around), Point::polar(3.0, -PI / 3.0));
    assert!(out.twist.linear == 0.0 && out.twist.angular < 0.0, "{out:?}");
    // In the shell it stands.
    let mut around = Sectors::new();
    around.add_point(Point::new(0.28, 0.0));
    assert_eq!(diagram.step(Some(&around), Point::new(3.0, 0.0)).situation, Situation::Touching);
}

fn mirrored(out: Avoidance) -> Avoidance {
    let mut twin = out;
    twin.twist.angular = -out.twist.angular;
    (twin.direction, twin.goal, twin.free) = (-out.direction, -out.goal, -out.free);
    (twin.left, twin.right) = (out.right, out.left);
    twin
}

fn alike(a: &Avoidance, b: &Avoidance) -> bool {
    let close = |a: f64, b: f64| fabs(a - b) < 1e-6;
    a.situation == b.situation
        && close(a.twist.linear, b.twist.linear)
        && close(a.twist.angular, b.twist.angular)
        && close(wrap(a.direction), wrap(b.direction))
        && close(a.left, b.left)
        && close(a.right, b.right)
}

/// Places around the robot: in the middle of sectors, none straight ahead or behind, none of two at one place.
fn posts() -> impl Strategy<Value = Vec<(usize, f64)>> {
    proptest::collection::vec((1usize..90, 0usize..2, 0.15f64..4.0), 1..40).prop_map(|posts| {
        posts.into_iter().map(|(i, side, range)| (if side == 0 { i } else { 180 - i }, range)).collect()
    })
}

fn placed(posts: &[(usize, f64)], mirror: bool) -> Sectors {
    let mut around = Sectors::new();
    for (i, range) in posts {
        let side = if mirror { -1.0 } else { 1.0 };
        around.add_point(Point::polar(*range, side * bearing(*i)));
    }
    around
}

proptest! {
    #[test]
    fn the_mirror_image_of_a_place_gives_the_mirror_image_of_the_motion(
        posts in posts(), distance in 0.5f64..5.0, goal in 0.01f64..1.5
    ) {
        let (place, twin) = (placed(&posts, false), placed(&posts, true));
        let (at, twin_at) = (Point::polar(distance, goal), Point::polar(distance, -goal));
        let pairs = [
            (diagram().step(Some(&place), at), diagram().step(Some(&twin), twin_at)),
            (smooth().step(Some(&place), at), smooth().step(Some(&twin), twin_at)),
        ];
        for (one, other) in pairs {
            // What lies on the line of the way, or right beside the robot or behind it, is on either side of it by rounding alone.
            let on_line = |i: usize| fabs(libm::sin(2.0 * (bearing(i) - one.free))) < 1e-6;
            if posts.iter().any(|(i, _)| on_line(*i)) || fabs(one.free) > PI - 1e-6 {
                continue;
            }
            prop_assert!(alike(&mirrored(one), &other), "{one:?}\n{other:?}");
        }
    }

    #[test]
    fn nobody_drives_forward_with_something_at_the_edge_and_nobody_faster_than_allowed(
        posts in posts(), touching in 0usize..180, distance in 0.5f64..5.0, goal in -3f64..3.0, long in any::<bool>()
    ) {
        let body = if long { Body::Rectangle { front: 0.255, rear: 0.255, half_width: 0.215 } } else { ROUND };
        let mut around = placed(&posts, false);
        let at = Point::polar(distance, goal);
        let mut diagram = NearnessDiagram::new(nearness::Parameters { linear_max: 0.8, ..nearness::Parameters::new(body) });
        let mut smooth = SmoothNearness::new(smooth::Parameters { linear_max: 0.8, ..smooth::Parameters::new(body) });
        for out in [diagram.step(Some(&around), at), smooth.step(Some(&around), at)] {
            prop_assert!((0.0..=0.8).contains(&out.twist.linear), "{out:?}");
            prop_assert!(fabs(out.twist.angular) <= PI / 3.0 + 1e-12 && fabs(out.direction) <= PI / 2.0 + 1e-12);
        }
        around.add_point(Point::polar(body.edge(bearing(touching)) - 1e-6, bearing(touching)));
        for out in [diagram.step(Some(&around), at), smooth.step(Some(&around), at)] {
            prop_assert!(out.twist.linear == 0.0, "{out:?}");
        }
    }

    #[test]
    fn what_the_smooth_one_does_hardly_changes_when_a_threat_hardly_moves(
        sector in 1usize..180, range in 0.25f64..1.2, goal in -0.5f64..0.5
    ) {
        let step = |range: f64| {
            let mut around = Sectors::new();
            around.add_point(Point::polar(range, bearing(sector)));
            smooth().step(Some(&around), Point::polar(0.6, goal))
        };
        let (one, other) = (step(range), step(range + 1e-6));
        // Opposite to the way a threat may be passed on either side.
        if fabs(fabs(wrap(bearing(sector) + PI - goal)) - PI) > 2.0 * SECTOR && one.free == other.free {
            prop_assert!(fabs(one.direction - other.direction) < 1e-3, "{one:?}\n{other:?}");
        }
    }
}

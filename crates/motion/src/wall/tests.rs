use super::*;
use proptest::prelude::*;
use std::vec::Vec;
use types::Pose;
use types::geometry::TAU;

const RADIUS: f64 = 0.225;
const STEP: f64 = 0.1;

/// Walls from point to point.
type Walls = [(Point, Point)];

/// The walls of a rectangle.
fn rectangle(x: f64, y: f64, width: f64, height: f64) -> Vec<(Point, Point)> {
    let corners = [
        Point::new(x, y),
        Point::new(x + width, y),
        Point::new(x + width, y + height),
        Point::new(x, y + height),
    ];
    (0..4).map(|i| (corners[i], corners[(i + 1) % 4])).collect()
}

/// Distance from `from` in the direction `bearing` to the nearest wall.
fn cast(walls: &Walls, from: Point, bearing: f64) -> f64 {
    let ray = Point::polar(1.0, bearing);
    let hit = |(a, b): &(Point, Point)| {
        let along = *b - *a;
        let across = ray.cross(along);
        let (t, s) = ((*a - from).cross(along) / across, (*a - from).cross(ray) / across);
        (t > 0.0 && (0.0..=1.0).contains(&s)).then_some(t)
    };
    walls.iter().filter_map(hit).fold(f64::INFINITY, fmin)
}

fn clearance(walls: &Walls, body: Point) -> f64 {
    let to = |(a, b): &(Point, Point)| {
        let along = *b - *a;
        let part = fmin(fmax((body - *a).dot(along) / along.dot(along), 0.0), 1.0);
        body.distance(*a + along * part)
    };
    walls.iter().map(to).fold(f64::INFINITY, fmin)
}

/// What `count` beams hear, each the nearest within its cone.
fn hear(walls: &Walls, pose: Pose, count: usize, cone: f64) -> Vec<(f64, f64)> {
    (0..count)
        .map(|i| {
            let bearing = TAU * i as f64 / count as f64;
            let rays = if cone > 0.0 { 15 } else { 1 };
            let ray = |k: usize| cone * (2.0 * k as f64 / (rays - 1).max(1) as f64 - 1.0);
            let range = (0..rays)
                .map(|k| {
                    cast(walls, pose.position(), pose.heading + bearing + if rays > 1 { ray(k) } else { 0.0 })
                })
                .fold(f64::INFINITY, fmin);
            (bearing, range)
        })
        .collect()
}

/// Follows for `seconds`, and tells the poses.
fn follow(p: &Parameters, walls: &Walls, start: Pose, beams: usize, seconds: f64) -> Vec<Pose> {
    let mut poses = Vec::from([start]);
    let mut pose = start;
    for _ in 0..(seconds / STEP) as usize {
        let heard = hear(walls, pose, beams, p.cone);
        let ring = Ring::Beams(&heard);
        let twist = drive(p, &steer(p, ring, look(p, ring)), p.speed);
        pose = pose.advanced(twist.linear, twist.angular, STEP);
        poses.push(pose);
    }
    poses
}

/// How far it turned in all (rad).
fn turned(poses: &[Pose]) -> f64 {
    poses.windows(2).map(|two| wrap(two[1].heading - two[0].heading)).sum()
}

const LASER: usize = 360;
const SONARS: usize = 12;

fn laser() -> Parameters {
    Parameters::new(RADIUS, 0.0)
}

fn sonars() -> Parameters {
    Parameters::new(RADIUS, PI / 12.0)
}

fn long_wall(y: f64) -> Vec<(Point, Point)> {
    Vec::from([(Point::new(-50.0, y), Point::new(50.0, y))])
}

#[test]
fn along_a_straight_wall_it_keeps_its_distance() {
    for (p, beams, near) in [(laser(), LASER, 0.01), (sonars(), SONARS, 0.04)] {
        for (side, from, heading) in
            [(Side::Left, 0.9, 0.0), (Side::Left, 0.3, 0.3), (Side::Right, 0.8, -0.4)]
        {
            let p = Parameters { side, ..p };
            let wall = long_wall(from * side.sign());
            let poses = follow(&p, &wall, Pose::new(0.0, 0.0, heading), beams, 25.0);
            let last = poses[poses.len() - 1];
            let distance = fabs(from * side.sign() - last.y);
            assert!(fabs(distance - p.keep) < near, "{side:?} from {from}: {distance}");
            assert!(fabs(last.heading) < 0.05 && last.x > 5.0, "{last:?}");
            let least = poses.iter().map(|pose| clearance(&wall, pose.position())).fold(f64::INFINITY, fmin);
            assert!(least > RADIUS + 0.04, "{least}");
        }
    }
}

#[test]
fn around_a_box_it_goes_at_its_distance() {
    let walls = rectangle(-1.0, -1.0, 2.0, 2.0);
    for (p, beams, band) in [(laser(), LASER, (0.4, 0.55)), (sonars(), SONARS, (0.32, 0.7))] {
        let p = Parameters { side: Side::Right, ..p };
        let poses = follow(&p, &walls, Pose::new(-0.5, -1.45, PI), beams, 60.0);
        let away: Vec<f64> = poses.iter().map(|pose| clearance(&walls, pose.position())).collect();
        let (least, most) = away.iter().fold((f64::INFINITY, 0.0), |(l, m), d| (fmin(l, *d), fmax(m, *d)));
        assert!(turned(&poses) < -TAU, "{}", turned(&poses));
        assert!(least > band.0 && most < band.1, "{least} {most}");
    }
}

#[test]
fn inside_of_a_room_it_turns_before_each_corner() {
    let walls = rectangle(0.0, 0.0, 5.0, 4.0);
    for (p, beams) in [(laser(), LASER), (sonars(), SONARS)] {
        let poses = follow(&p, &walls, Pose::new(0.45, 2.0, PI / 2.0), beams, 90.0);
        let least = poses.iter().map(|pose| clearance(&walls, pose.position())).fold(f64::INFINITY, fmin);
        // With the wall on its left it goes round clockwise.
        assert!(turned(&poses) < -TAU, "{}", turned(&poses));
        assert!(least > RADIUS + 0.02, "{least}");
    }
}

#[test]
fn without_a_wall_it_goes_straight_on() {
    let heard = hear(&[], Pose::default(), SONARS, PI / 12.0);
    let (p, ring) = (sonars(), Ring::Beams(&heard));
    assert_eq!(look(&p, ring), None);
    assert_eq!(drive(&p, &steer(&p, ring, None), p.speed), Twist::new(p.speed, 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_wall_is_seen_where_it_is(distance in 0.3f64..1.0, heading in -0.5f64..0.5) {
        let wall = long_wall(distance);
        for (p, beams, off, turn) in [(laser(), LASER, 1e-9, 1e-9), (sonars(), SONARS, 0.03, 0.1)] {
            let heard = hear(&wall, Pose::new(0.0, 0.0, heading), beams, p.cone);
            let seen = look(&p, Ring::Beams(&heard)).unwrap();
            prop_assert!(fabs(seen.distance - distance) < off, "{beams}: {seen:?}");
            prop_assert!(fabs(seen.bearing - (PI / 2.0 - heading)) < turn, "{beams}: {seen:?}");
        }
    }

    #[test]
    fn the_right_side_is_the_image_of_the_left(x in 0.3f64..3., y in 0.3f64..2.5, heading in -3f64..3.) {
        let (room, image) = (rectangle(0.0, 0.0, 4.0, 3.0), rectangle(0.0, -3.0, 4.0, 3.0));
        let order = |side: Side, walls: &Walls, pose: Pose| {
            let p = Parameters { side, ..laser() };
            // So few that none is left out: a denser ring is thinned from one end.
            let heard = hear(walls, pose, 120, 0.0);
            let ring = Ring::Beams(&heard);
            drive(&p, &steer(&p, ring, look(&p, ring)), p.speed)
        };
        let left = order(Side::Left, &room, Pose::new(x, y, heading));
        let right = order(Side::Right, &image, Pose::new(x, -y, -heading));
        prop_assert!(fabs(left.linear - right.linear) < 1e-6 && fabs(left.angular + right.angular) < 1e-6, "{left:?} {right:?}");
    }
}

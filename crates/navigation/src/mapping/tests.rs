use super::*;
use proptest::prelude::*;
use types::chance::Stream;
use types::geometry::TAU;

/// A room of 6 × 4 m with a wall that stands into it, and a cupboard that is closed.
const WALLS: [(Point, Point); 9] = [
    (Point::new(0.0, 0.0), Point::new(6.0, 0.0)),
    (Point::new(6.0, 0.0), Point::new(6.0, 4.0)),
    (Point::new(6.0, 4.0), Point::new(0.0, 4.0)),
    (Point::new(0.0, 4.0), Point::new(0.0, 0.0)),
    (Point::new(3.02, 0.0), Point::new(3.02, 2.2)),
    (Point::new(4.52, 3.02), Point::new(5.52, 3.02)),
    (Point::new(5.52, 3.02), Point::new(5.52, 3.52)),
    (Point::new(5.52, 3.52), Point::new(4.52, 3.52)),
    (Point::new(4.52, 3.52), Point::new(4.52, 3.02)),
];

/// How far a beam comes: where it meets lines, exactly.
fn range(from: Point, direction: f64) -> f64 {
    let way = Point::polar(1.0, direction);
    let meet = |(a, b): &(Point, Point)| {
        let (along, to) = (*b - *a, *a - from);
        let across = way.cross(along);
        let (far, part) = (to.cross(along) / across, to.cross(way) / across);
        (far > 0.0 && (0.0..=1.0).contains(&part)).then_some(far)
    };
    WALLS.iter().filter_map(meet).fold(f64::INFINITY, f64::min)
}

fn scan(sensor: Pose, noise: f64, number: u64) -> Vec<Beam> {
    let stream = Stream::new(3, "beams").sample(number);
    let beam = |i: u32| {
        let bearing = TAU * f64::from(i) / 360.0;
        let range =
            range(sensor.position(), sensor.heading + bearing) + noise * stream.normal(u64::from(i) * 2);
        Beam { bearing, range, echo: true }
    };
    (0..360).map(beam).collect()
}

/// A map, and where the beams ended that made it.
fn mapped(noise: f64) -> (Occupancy, Vec<Point>) {
    let mut ends = Vec::new();
    let lattice = Lattice::covering(Point::new(-1.0, -1.0), Point::new(7.0, 5.0), 0.05);
    let mut map = Occupancy::new(Parameters::default(), lattice);
    for i in 0..60u32 {
        let part = f64::from(i) / 60.0;
        // Through both halves, over the end of the wall between them.
        let at = Point::new(0.8 + 4.4 * part, 2.9 - 1.6 * libm::fabs(2.0 * part - 1.0));
        let sensor = Pose::new(at.x, at.y, part * 5.0);
        let beams = scan(sensor, noise, u64::from(i));
        let end = |beam: &Beam| at + Point::polar(beam.range, sensor.heading + beam.bearing);
        ends.extend(beams.iter().map(end));
        map.see(sensor, beams.into_iter());
    }
    (map, ends)
}

/// Distance to the nearest wall (m).
fn from_wall(point: Point) -> f64 {
    let far = |(a, b): &(Point, Point)| {
        let along = *b - *a;
        let part = ((point - *a).dot(along) / along.dot(along)).clamp(0.0, 1.0);
        point.distance(*a + along * part)
    };
    WALLS.iter().map(far).fold(f64::INFINITY, f64::min)
}

fn is_inside(point: Point) -> bool {
    let in_room = (0.0..6.0).contains(&point.x) && (0.0..4.0).contains(&point.y);
    let in_cupboard = (4.52..5.52).contains(&point.x) && (3.02..3.52).contains(&point.y);
    in_room && !in_cupboard
}

#[test]
fn walls_are_taken_the_inside_is_free_and_what_nobody_saw_unknown() {
    for noise in [0.0, 0.01] {
        let (map, ends) = mapped(noise);
        let lattice = *map.lattice();
        let (mut walls, mut inside, mut outside) = ([0usize; 2], [0usize; 2], [0usize; 2]);
        for cell in 0..lattice.cells() {
            let (middle, known) = (lattice.middle(cell), map.known(cell));
            let far = from_wall(middle);
            if far > 0.1 {
                let count = if is_inside(middle) { &mut inside } else { &mut outside };
                count[0] += 1;
                count[1] +=
                    usize::from(known == if is_inside(middle) { Known::Free } else { Known::Unknown });
            }
            if known == Known::Taken {
                assert!(far < 0.05 + 4.0 * noise, "{middle:?} is {far} m from a wall");
            }
        }
        for (a, b) in WALLS {
            for i in 0..=100 {
                let at = a + (b - a) * (f64::from(i) / 100.0);
                // Behind the cupboard nobody looks.
                if ends.iter().filter(|end| end.distance(at) < 0.04).count() < 5 {
                    continue;
                }
                let near = [-0.04, 0.0, 0.04];
                let taken =
                    near.iter().flat_map(|dx| near.iter().map(move |dy| Point::new(at.x + dx, at.y + dy)));
                walls[0] += 1;
                walls[1] += usize::from(taken.into_iter().any(|point| map.at(point) == Known::Taken));
            }
        }
        assert!(walls[0] > 600 && walls[1] as f64 > 0.97 * walls[0] as f64, "walls {walls:?}");
        assert!(inside[1] as f64 > 0.97 * inside[0] as f64, "inside {inside:?}");
        assert_eq!(outside[0], outside[1], "outside");
    }
}

#[test]
fn who_walked_by_is_outvoted_and_a_door_that_closes_is_learnt() {
    let lattice = Lattice::new(Point::default(), 0.1, 50, 10);
    let mut map = Occupancy::new(Parameters::default(), lattice);
    let sensor = Pose::new(0.05, 0.55, 0.0);
    let mut see = |range: f64, times: u32| {
        for _ in 0..times {
            map.see(sensor, [Beam { bearing: 0.0, range, echo: true }].into_iter());
        }
        [map.at(Point::new(2.05, 0.55)), map.at(Point::new(4.05, 0.55)), map.at(Point::new(4.55, 0.55))]
    };
    use Known::{Free, Taken, Unknown};
    assert_eq!(see(4.0, 5), [Free, Taken, Unknown]);
    assert_eq!(see(2.0, 1), [Free, Taken, Unknown], "somebody for one scan");
    assert_eq!(see(2.0, 9), [Taken, Taken, Unknown], "the door is closed, and hides what is behind");
    assert_eq!(see(4.0, 20), [Free, Taken, Unknown], "and open again");
}

#[test]
fn what_sends_nothing_back_tells_only_what_is_free_as_far_as_one_looks() {
    let lattice = Lattice::new(Point::default(), 0.1, 100, 10);
    let mut map = Occupancy::new(Parameters { reach: 5.0, ..Parameters::default() }, lattice);
    for _ in 0..3 {
        map.see(Pose::new(0.05, 0.55, 0.0), [Beam { bearing: 0.0, range: 8.0, echo: false }].into_iter());
    }
    assert_eq!(
        [4.8, 5.2, 8.0].map(|x| map.at(Point::new(x, 0.55))),
        [Known::Free, Known::Unknown, Known::Unknown]
    );
    assert!(map.probability(map.lattice().cell(Point::new(1.0, 0.55)).unwrap()) < 0.3);
}

proptest! {
    #[test]
    fn any_beams_from_anywhere_are_taken(
        x in prop::num::f64::ANY, y in -9.0..9.0f64, heading in prop::num::f64::ANY,
        beams in prop::collection::vec((prop::num::f64::ANY, prop::num::f64::ANY, any::<bool>()), 0..20)
    ) {
        let mut map = Occupancy::new(Parameters::default(), Lattice::new(Point::new(-2.0, -2.0), 0.1, 40, 40));
        let beams = beams.into_iter().map(|(bearing, range, echo)| Beam { bearing, range, echo });
        map.see(Pose::new(x, y, heading), beams);
        prop_assert!((0..map.lattice().cells()).all(|cell| (0.0..=1.0).contains(&map.probability(cell))));
    }
}

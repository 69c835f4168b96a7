//! Draws one figure of each kind from made-up data into the folder that is named: `cargo run --example figures -- FOLDER`.

use std::error::Error;
use std::f64::consts::PI;
use std::path::PathBuf;

use record::figure::{
    AgentTiming, Band, BandRow, Bands, Drawing, Event, Map, PeriodRow, Periods, Picture, RateBand, Region,
    Series, Span, Timing, Trajectory, Velocity, Waypoint,
};
use types::geometry::{Point, Pose, wrap};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("name a folder for the figures")?);
    std::fs::create_dir_all(&folder)?;
    let way = drive();
    let figures: [(&str, Picture); 6] = [
        ("trajectory", trajectory(&way).draw()),
        ("velocity", velocity(&way).draw()),
        ("timing", timing().draw()),
        ("periods", periods().draw()),
        ("bands", bands_of_runs().draw()),
        ("map", map(&way).draw()),
    ];
    for (name, picture) in figures {
        std::fs::write(folder.join(format!("{name}.svg")), picture.svg())?;
        std::fs::write(folder.join(format!("{name}.png")), picture.png(220.0)?)?;
    }
    Ok(())
}

/// Numbers from −1 to 1 that look like chance and are the same each time.
fn noise(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43758.5453;
    2.0 * (x - x.floor()) - 1.0
}

fn point(x: f64, y: f64) -> Point {
    Point { x, y }
}

fn walls() -> Vec<(Point, Point)> {
    let corners = [
        [(0.0, 0.0), (5.0, 0.0)],
        [(0.0, 0.0), (0.0, 6.0)],
        [(0.0, 6.0), (5.0, 6.0)],
        [(5.0, 0.0), (5.0, 2.4)],
        [(5.0, 3.6), (5.0, 6.0)],
        [(5.0, 2.0), (13.0, 2.0)],
        [(5.0, 4.2), (10.5, 4.2)],
        [(13.0, 2.0), (13.0, 7.5)],
        [(10.5, 4.2), (10.5, 7.5)],
        [(10.5, 7.5), (13.0, 7.5)],
    ];
    corners.map(|[a, b]| (point(a.0, a.1), point(b.0, b.1))).to_vec()
}

/// Steers through the points with a limited turn rate.
fn drive() -> Vec<(Waypoint, f64, f64)> {
    let goals = [
        (3.2, 1.0),
        (3.6, 2.6),
        (6.0, 3.0),
        (11.0, 3.1),
        (11.8, 4.4),
        (11.7, 6.4),
        (11.3, 5.4),
        (11.6, 3.4),
        (8.0, 3.0),
    ];
    let mut pose = Pose { x: 1.0, y: 4.8, heading: -1.2 };
    let (mut out, mut next, mut speed) = (Vec::new(), 0, 0.0f64);
    for i in 0..1600 {
        let goal = goals[next];
        let (dx, dy) = (goal.0 - pose.x, goal.1 - pose.y);
        if dx.hypot(dy) < 0.3 {
            next += 1;
            if next == goals.len() {
                break;
            }
        }
        let error = wrap(dy.atan2(dx) - pose.heading);
        let turn = (1.6 * error).clamp(-0.9, 0.9) + 0.03 * noise(i);
        let wanted = if error.abs() > 0.8 { 0.05 } else { 0.35 };
        speed += (wanted - speed).clamp(-0.05, 0.03);
        out.push((Waypoint { time: i as f64 * 0.1, pose }, speed, turn));
        pose = pose.advanced(speed, turn, 0.1);
    }
    out
}

fn bands(end: f64) -> Vec<Band> {
    let spans = [
        (0.0, 11.0, "wander"),
        (11.0, 13.5, "avoid"),
        (13.5, 30.0, "wall-following"),
        (30.0, 45.0, "track"),
        (45.0, end, "wall-following"),
    ];
    spans.map(|(from, to, agent)| Band { from, to, agent: agent.into() }).to_vec()
}

fn events() -> Vec<Event> {
    let all = [
        (11.0, "obstacle ahead"),
        (19.0, "door passed"),
        (30.0, "red object seen"),
        (43.0, "U-turn"),
        (45.0, "object lost"),
    ];
    all.map(|(time, text)| Event { time, text: text.into() }).to_vec()
}

fn sonar(way: &[(Waypoint, f64, f64)]) -> Vec<Point> {
    let mut points = Vec::new();
    for (i, (waypoint, ..)) in way.iter().enumerate().step_by(5) {
        for ray in 0..12 {
            let angle = waypoint.pose.heading + f64::from(ray) * PI / 6.0;
            points.extend(hit(waypoint.pose, angle, 2.5).map(|range| {
                let range = range + 0.03 * noise(i * 12 + ray as usize);
                point(waypoint.pose.x + range * angle.cos(), waypoint.pose.y + range * angle.sin())
            }));
        }
    }
    points
}

/// Distance to the first wall.
fn hit(from: Pose, angle: f64, limit: f64) -> Option<f64> {
    let (c, s) = (angle.cos(), angle.sin());
    let crossing = |(a, b): &(Point, Point)| {
        let (ex, ey) = (b.x - a.x, b.y - a.y);
        let across = c * ey - s * ex;
        let (ax, ay) = (a.x - from.x, a.y - from.y);
        let (range, along) = ((ax * ey - ay * ex) / across, (ax * s - ay * c) / across);
        (range > 0.0 && (0.0..=1.0).contains(&along)).then_some(range)
    };
    walls().iter().filter_map(crossing).filter(|range| *range < limit).min_by(f64::total_cmp)
}

fn trajectory(way: &[(Waypoint, f64, f64)]) -> Trajectory {
    let drawing = Drawing {
        segments: walls(),
        circles: vec![(point(2.4, 3.2), 0.3), (point(4.0, 4.9), 0.25)],
        polygons: vec![vec![point(0.2, 0.3), point(1.8, 0.3), point(1.8, 1.1), point(0.2, 1.1)]],
        regions: vec![Region {
            corners: vec![point(10.7, 5.6), point(12.8, 5.6), point(12.8, 7.3), point(10.7, 7.3)],
            name: "goal region".into(),
        }],
        labels: vec![
            (point(1.2, 5.6), "laboratory".into()),
            (point(7.0, 2.25), "corridor".into()),
            (point(1.0, 0.7), "table".into()),
        ],
    };
    Trajectory {
        drawing,
        path: way.iter().map(|step| step.0).collect(),
        bands: bands(way.len() as f64 * 0.1),
        points: sonar(way),
        outline_every: 4.0,
        goal: Some(point(11.7, 6.4)),
        events: events(),
        ..Trajectory::default()
    }
}

/// A quantity of a step with its number.
type Quantity<'a> = &'a dyn Fn(usize, &(Waypoint, f64, f64)) -> f64;

fn velocity(way: &[(Waypoint, f64, f64)]) -> Velocity {
    let series = |name: &str, value: Quantity<'_>| Series {
        name: name.into(),
        points: way.iter().enumerate().map(|(i, step)| (step.0.time, value(i, step))).collect(),
    };
    Velocity {
        speed: vec![
            series("measured", &|i, step| step.1 + 0.012 * noise(i)),
            series("commanded", &|_, step| if step.2.abs() > 0.8 { 0.05 } else { 0.35 }),
        ],
        angular_speed: vec![
            series("measured", &|i, step| step.2 + 0.05 * noise(i + 7)),
            series("commanded", &|_, step| step.2),
        ],
        heading: vec![series("measured", &|_, step| step.0.pose.heading)],
        bands: bands(way.len() as f64 * 0.1),
        events: events(),
    }
}

/// Counts values in classes of an eighth of a doubling: their upper ends (s), and how many values.
fn histogram(values: &[f64]) -> Vec<(f64, u64)> {
    let mut classes = std::collections::BTreeMap::new();
    for value in values {
        *classes.entry((value.log2() * 8.0).floor() as i32).or_insert(0) += 1;
    }
    classes.into_iter().map(|(class, count)| ((f64::from(class + 1) / 8.0).exp2(), count)).collect()
}

fn timing() -> Timing {
    let agent = |name: &str, typical: f64, wide: f64, deadline: Option<f64>, misses, seed: usize| {
        let draw = |i: usize, typical: f64, wide: f64| {
            let bell = (0..4).map(|k| noise(i * 4 + k + seed * 1000)).sum::<f64>();
            typical * (wide * bell).exp()
        };
        let execution: Vec<f64> = (0..6000).map(|i| draw(i, typical, wide)).collect();
        let late = |i: usize| if i.is_multiple_of(900) { 40.0 } else { 1.0 };
        let jitter: Vec<f64> = (0..6000).map(|i| draw(i + 7000, 4e-6, 0.5) * late(i)).collect();
        AgentTiming {
            name: name.into(),
            execution: histogram(&execution),
            jitter: histogram(&jitter),
            execution_max: execution.into_iter().reduce(f64::max),
            jitter_max: jitter.into_iter().reduce(f64::max),
            deadline,
            misses,
            releases: 6000,
        }
    };
    Timing {
        agents: vec![
            agent("safety-monitor", 3e-6, 0.3, Some(5e-3), 0, 1),
            agent("sonar", 2.2e-5, 0.25, Some(0.05), 0, 2),
            agent("wall-following", 8e-6, 0.4, Some(0.1), 0, 3),
            agent("image-tracking", 9e-3, 0.2, Some(2e-2), 12, 4),
            agent("coordinator", 1.2e-6, 0.3, Some(0.01), 0, 5),
            agent("decision", 4e-5, 0.7, None, 0, 6),
        ],
    }
}

fn periods() -> Periods {
    let row = |name: &str, period: &dyn Fn(f64) -> f64, cost: f64, seed: usize| {
        let (mut time, mut row) = (0.0, PeriodRow { name: name.into(), ..PeriodRow::default() });
        let mut i = seed;
        while time < 2.0 {
            let begin = time + 0.002 * (1.0 + noise(i));
            let end = begin + cost * (1.0 + 0.4 * noise(i + 3));
            row.releases.push(time);
            row.steps.push((begin, end));
            if end > time + 0.85 * period(time) {
                row.misses.push(time + period(time));
            }
            time += period(time);
            i += 1;
        }
        row
    };
    Periods {
        rows: vec![
            row("sonar", &|_| 0.25, 0.004, 10),
            row("camera", &|_| 1.0 / 15.0, 0.02, 20),
            row("image-tracking", &|t| if t < 1.0 { 1.0 / 15.0 } else { 2.0 / 15.0 }, 0.046, 30),
            row("wall-following", &|_| 0.1, 0.006, 40),
            row("coordinator", &|_| 0.05, 0.002, 50),
            row("decision", &|_| 0.25, 0.012, 60),
        ],
        window: None,
    }
}

/// Three runs of eight agents: in the first all keep their rates and miss, in the second all give way, in the third some rest.
fn bands_of_runs() -> Bands {
    let load = |t: f64| if (30.0..70.0).contains(&t) { 1.0 } else { 0.0 };
    let names =
        ["safety", "sonar", "wall-follower", "camera", "image-tracker", "face", "path-planner", "decision"];
    let row = |run: usize, i: usize| {
        let misses: Vec<f64> = (0..600)
            .filter(|k| {
                let chance = (noise(k * 8 + i + run * 5000) + 1.0) / 2.0;
                i > 2 && chance < load(*k as f64 * 0.2) * [0.4, 0.02, 0.004][run] * (i as f64 / 4.0)
            })
            .map(|k| k as f64 * 0.2)
            .collect();
        let lower = 1.0 - 0.11 * i as f64;
        let rate = match (run, i) {
            (1, 2..) => vec![(0.0, 1.0), (30.5, lower), (52.0, 0.8 * lower), (71.0, 1.0)],
            (2, 5 | 6) => vec![(0.0, 1.0), (32.0, 0.0), (74.0, 0.5), (80.0, 1.0)],
            (2, 3..) => vec![(0.0, 1.0), (31.0, 0.5), (72.0, 1.0)],
            _ => vec![(0.0, 1.0)],
        };
        let rests = run == 2 && matches!(i, 5 | 6);
        BandRow {
            name: names[i].into(),
            said: format!("{:.1} %, {}", 100.0 - misses.len() as f64 / 6.0, misses.len()),
            suspended: if rests { vec![(32.0, 74.0)] } else { Vec::new() },
            rate,
            misses,
        }
    };
    let titles = ["fixed rates", "rates that give way", "rates that give way, and priorities by use"];
    let band = |(run, title): (usize, &str)| RateBand {
        title: title.into(),
        rows: (0..names.len()).map(|i| row(run, i)).collect(),
    };
    let span = |from, to, label: &str| Span { from, to, label: label.into() };
    Bands {
        bands: titles.into_iter().enumerate().map(band).collect(),
        spans: vec![span(30.0, 60.0, "image work × 3"), span(50.0, 70.0, "foreign load")],
        window: Some((0.0, 120.0)),
    }
}

fn map(way: &[(Waypoint, f64, f64)]) -> Map {
    let mut points = Vec::new();
    for (i, (waypoint, ..)) in way.iter().enumerate().step_by(4) {
        for ray in 0..181usize {
            let angle = waypoint.pose.heading + (ray as f64 - 90.0).to_radians();
            points.extend(hit(waypoint.pose, angle, 8.0).map(|range| {
                let range = range + 0.02 * noise(i * 181 + ray);
                point(waypoint.pose.x + range * angle.cos(), waypoint.pose.y + range * angle.sin())
            }));
        }
    }
    let drift = |i: usize, w: &Waypoint| point(w.pose.x + 0.0008 * i as f64, w.pose.y - 0.0011 * i as f64);
    Map {
        points,
        points_name: "laser".into(),
        paths: vec![
            ("corrected".into(), way.iter().map(|step| point(step.0.pose.x, step.0.pose.y)).collect()),
            ("odometry".into(), way.iter().enumerate().map(|(i, step)| drift(i, &step.0)).collect()),
        ],
        drawing: Drawing::default(),
    }
}

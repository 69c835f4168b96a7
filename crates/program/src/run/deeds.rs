//! What the reactive layer can be asked to do, in the whole system and measured against the truth: to come to the very end of a planned path, to
//! dock, to follow a wall, to get out of a dead end, and to be driven by hand.

use types::messages::Progress;

use super::trial::{Trial, ended, ends, nothing_touched, run, tried};

/// Something of this size in the world.
fn thing(name: &str, x: f64, y: f64, length: f64, width: f64) -> String {
    format!("call world.add name={name} x={x} y={y} length={length} width={width}")
}

#[test]
fn planned_paths_end_within_a_centimetre_of_their_goals_and_are_driven_as_fast_as_planned() {
    let goals = [(9.0, 3.0), (4.0, 6.3), (1.5, 1.2), (8.0, 4.6), (7.4, 7.0), (2.2, 3.1)];
    let words: Vec<String> =
        goals.iter().map(|(x, y)| format!("call navigation.go x={x} y={y} mode=path")).collect();
    let requests: Vec<(i64, &str)> = (0..).zip(&words).map(|(i, go)| (1 + 40 * i, go.as_str())).collect();
    let trial = tried("paths", &requests, 245);
    for task in 1..=6 {
        let outcome = ends(&trial.summary, task, Progress::Arrived);
        assert!(outcome.off.unwrap() < 0.01, "{outcome:?}");
    }
    nothing_touched(&trial.summary);
    // Twelve metres and more of way, of which only the beginnings, the ends and the curves are slower than 0.4 m/s.
    let fast = trial.commands.iter().filter(|(_, twist)| twist.linear > 0.38).count();
    let moving = trial.commands.iter().filter(|(_, twist)| twist.linear > 0.0).count();
    assert!(fast as f64 > 0.4 * moving as f64, "{fast} of {moving}");
    assert!(trial.commands.iter().all(|(_, twist)| twist.linear <= 0.4 + 1e-9));
}

#[test]
fn sixty_docks_are_met_within_a_centimetre_and_half_a_degree_with_wheels_that_slip() {
    let words = ["goals", "--set", "agent.tour.dock=true", "--set", "agent.tour.random=60"];
    let summary = run("docks", &words, None, 1800).summary;
    assert_eq!(summary.tasks.len(), 60);
    for task in &summary.tasks {
        assert_eq!(task.last.progress, Progress::Arrived, "{task:?}");
        assert!(task.off.unwrap() < 0.01 && task.turned.unwrap() < 0.5f64.to_radians(), "{task:?}");
    }
    nothing_touched(&summary);
}

#[test]
fn a_heading_that_is_said_is_turned_to_in_every_mode() {
    for mode in ["goto", "path", "goto+avoid", "move"] {
        let go = format!("call navigation.go x=4 y=3.5 heading=1.57 mode={mode}");
        let summary = tried(&format!("heading-{mode}"), &[(1, &go)], 60).summary;
        let outcome = ends(&summary, 1, Progress::Arrived);
        let turned = outcome.turned.unwrap_or_else(|| panic!("{mode}: {outcome:?}"));
        assert!(turned < 2f64.to_radians(), "{mode}: {outcome:?}");
    }
}

#[test]
fn among_people_it_turns_to_the_heading_that_was_asked_for_and_tells_the_true_rest() {
    let summary = run("crowd-turns", &["crowd"], None, 300).summary;
    let arrived = summary.tasks.iter().filter(|task| task.last.progress == Progress::Arrived);
    let mut turned = 0;
    for task in arrived {
        let off = task.off.unwrap();
        assert!((off - task.last.distance).abs() < 0.05, "{task:?}");
        if let Some(left) = task.turned {
            turned += 1;
            assert!(left < 3f64.to_radians() && task.last.angle.abs() < 0.02, "{task:?}");
        }
    }
    assert!(turned >= 2, "{:?}", summary.tasks);
    nothing_touched(&summary);
}

#[test]
fn a_place_is_driven_to_by_the_wheels_alone() {
    let go = "call navigation.go x=3.5 y=3.5 heading=-1.5708 turned=true mode=move";
    let summary = tried("by-wheels", &[(1, go)], 15).summary;
    let outcome = ends(&summary, 1, Progress::Arrived);
    // It is aligned within 0.01 rad by what it believes; its gyro is off by 0.002 rad/s, and nothing puts that right for ten seconds.
    assert!(outcome.off.unwrap() < 0.02 && outcome.turned.unwrap() < 0.031, "{outcome:?}");
    nothing_touched(&summary);
}

#[test]
fn a_wall_is_followed_at_its_distance_as_well_as_the_laser_tells_it() {
    let go = "call navigation.go x=1.2 y=2.2 heading=1.5708 turned=true mode=goto";
    let wall = "call navigation.wall side=left distance=0.8 seconds=60";
    let trial = tried("wall", &[(1, go), (20, wall)], 85);
    let outcome = ends(&trial.summary, 2, Progress::Arrived);
    assert!((outcome.at - 80.0).abs() < 0.5, "{outcome:?}");
    nothing_touched(&trial.summary);
    // How far it is from what it is beside, away from corners: the wall on the left, the shelf, the wall behind it.
    let beside = trial.way.iter().filter(|(time, _)| *time > 22.0).filter_map(|(_, at)| {
        let is_between = |x: f64, low: f64, high: f64| (low..=high).contains(&x);
        match (at.x, at.y) {
            (x, y) if x < 1.5 && is_between(y, 3.0, 5.5) => Some((0, x - 0.08)),
            (x, y) if y > 6.0 && is_between(x, 3.0, 4.0) => Some((1, 7.4 - y)),
            (x, y) if y > 6.5 && is_between(x, 6.5, 7.4) => Some((2, 7.92 - y)),
            _ => None,
        }
    });
    let mut off: [Vec<f64>; 3] = Default::default();
    beside.for_each(|(which, distance)| off[which].push(distance - 0.8));
    // One beam is 1 cm wrong, what is nearest of the ten beams of a direction by no more than three times that, and the line through the directions once more.
    let noise = 0.01;
    for (which, off) in off.iter().enumerate() {
        assert!(off.len() > 20, "{which}: it never came there, {:?}", trial.way.last());
        let mean = off.iter().sum::<f64>() / off.len() as f64;
        let worst = off.iter().fold(0.0_f64, |worst, off| worst.max(off.abs()));
        assert!(mean.abs() < 4.0 * noise && worst < 6.0 * noise, "{which}: {mean} m, at most {worst} m");
    }
}

#[test]
fn a_robot_gets_out_of_a_dead_end_and_comes_to_its_goal() {
    let walls =
        [thing("a", 5.2, 1.5, 0.1, 1.2), thing("b", 4.2, 0.95, 2.0, 0.1), thing("c", 4.2, 2.05, 2.0, 0.1)];
    let mut requests = vec![(1, "call navigation.go x=7 y=1.5 mode=goto+avoid")];
    requests.extend(walls.iter().map(|wall| (1, wall.as_str())));
    let summary = tried("dead-end", &requests, 120).summary;
    let outcome = ends(&summary, 1, Progress::Arrived);
    assert!(outcome.off.unwrap() < 0.02, "{outcome:?}");
    assert!(summary.noted.iter().any(|noted| noted.what.contains("try to get out")), "{:?}", summary.noted);
    nothing_touched(&summary);
}

#[test]
fn a_robot_that_is_boxed_in_tries_four_times_and_tells_that_it_cannot_get_out() {
    // Eight posts around it, half a metre apart: it sees out, and is 0.68 m wide.
    let posts = (0..8).map(|i| {
        let at =
            types::Point::new(2.0, 2.0) + types::Point::polar(0.9, f64::from(i) * types::geometry::PI / 4.0);
        thing(&format!("post-{i}"), at.x, at.y, 0.1, 0.1)
    });
    let posts: Vec<String> = posts.collect();
    let mut requests = vec![(1, "call navigation.go x=9.5 y=1.5 mode=goto+avoid")];
    requests.extend(posts.iter().map(|post| (1, post.as_str())));
    let summary = tried("boxed-in", &requests, 115).summary;
    let outcome = ends(&summary, 1, Progress::Unreachable);
    // Five times the patience of 8 s, and four times at most 3 s to back off, 3 s to turn and 10 s ahead.
    assert!(outcome.last.seconds < 104.0, "{outcome:?}");
    assert!(summary.noted.iter().any(|noted| noted.what.contains("try to get out")), "{:?}", summary.noted);
    nothing_touched(&summary);
}

/// The modes that were entered, one after another, with the time (s).
fn modes(trial: &Trial) -> Vec<(f64, String)> {
    let mut modes: Vec<(f64, String)> = Vec::new();
    for (time, mode) in &trial.modes {
        if modes.last().is_none_or(|(_, last)| last != mode.name.as_str()) {
            modes.push((*time, mode.name.as_str().to_owned()));
        }
    }
    modes
}

#[test]
fn a_person_takes_the_robot_from_its_way_at_once_and_it_goes_on_when_the_person_falls_silent() {
    let go = "call navigation.go x=9.5 y=1.5 mode=goto";
    let trial = tried("by-hand", &[(1, go), (6, "call hand.drive angular=-0.5 seconds=2")], 60);
    let entered = modes(&trial);
    let names: Vec<&str> = entered.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["idle", "goto", "teleoperation", "goto"]);
    assert!((6.0..6.2).contains(&entered[2].0), "{entered:?}");
    // Two seconds of the order, one in which it waits for another, and a step.
    assert!((9.0..9.3).contains(&entered[3].0), "{entered:?}");
    let during = |from: f64, to: f64| {
        trial.commands.iter().filter(move |(time, _)| (from..to).contains(time)).map(|(_, twist)| *twist)
    };
    // The order is driven within the limits of the drive, at once: it does not wait for the mode.
    let first = trial.commands.iter().find(|(time, twist)| *time >= 6.0 && twist.angular < -0.05).unwrap().0;
    assert!(first < 6.1, "{first}");
    assert!(during(7.0, 8.0).all(|twist| twist.linear == 0.0 && (twist.angular + 0.5).abs() < 1e-9));
    assert!(during(8.5, 9.0).all(|twist| twist.linear == 0.0 && twist.angular == 0.0), "no action is heard");
    let outcome = ends(&trial.summary, 1, Progress::Arrived);
    assert!(outcome.off.unwrap() < 0.02, "{outcome:?}");
    nothing_touched(&trial.summary);
}

#[test]
fn who_lets_go_is_not_waited_for_and_half_a_manoeuvre_is_not_driven_again() {
    let requests = [
        (1, "call navigation.drive distance=2 linear=0.2"),
        (4, "call hand.drive linear=0.1 seconds=2"),
        (5, "call hand.release"),
    ];
    let trial = tried("released", &requests, 20);
    let entered = modes(&trial);
    let names: Vec<&str> = entered.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["idle", "move", "teleoperation", "move"]);
    assert!((5.0..5.2).contains(&entered[3].0), "{entered:?}");
    ends(&trial.summary, 1, Progress::Halted);
    let at = |time: f64| trial.way.iter().find(|(then, _)| *then >= time).unwrap().1;
    assert!(at(6.5).position().distance(at(19.0).position()) < 1e-3, "it stands");
    assert!((0.4..1.0).contains(&(at(19.0).x - 2.0)), "{:?}", at(19.0));
}

#[test]
fn a_task_that_comes_while_a_person_drives_is_done_when_the_person_lets_go() {
    let requests = [
        (1, "call hand.drive angular=0.3 seconds=2"),
        (2, "call navigation.go x=4 y=2 mode=goto"),
        (5, "call processes.change name=teleoperation"),
    ];
    let trial = tried("while-by-hand", &requests, 10);
    let names: Vec<String> = modes(&trial).into_iter().map(|(_, name)| name).collect();
    assert_eq!(names, ["idle", "teleoperation", "goto", "teleoperation"]);
    // It is asked for by its name as well, and then nobody waits.
    assert_eq!(ended(&trial.summary, 1).last.progress, Progress::Halted);
    nothing_touched(&trial.summary);
}

#[test]
fn a_person_does_not_drive_it_into_a_wall() {
    let go = "call navigation.go x=1.5 y=2 heading=3.14159 turned=true mode=goto";
    let ahead = "call hand.drive linear=0.3 seconds=1.5";
    let mut requests = vec![(1, go)];
    requests.extend((20..32).map(|time| (time, ahead)));
    let trial = tried("hand-at-wall", &requests, 40);
    nothing_touched(&trial.summary);
    let last = trial.way.last().unwrap().1;
    assert!((0.42..0.9).contains(&last.x), "before the wall: {last:?}");
}

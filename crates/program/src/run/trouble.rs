//! What becomes of a goal when something goes wrong on the way: the scenario `reactive` with other requests.

use types::messages::Progress;

use super::summary::Summary;
use super::trial::{asked, ended, ends, nothing_touched};

/// How far the robot went (m).
fn way(summary: &Summary) -> f64 {
    summary.robots[0].truth.unwrap().distance
}

/// A goal to which nothing is in the way.
const FREE: &str = "call navigation.go x=9.5 y=1.5 mode=goto";

#[test]
fn slipping_wheels_and_a_push_are_made_good_by_the_localizer() {
    let slip = "call world.slip robot=r left=0.0 right=0.2 seconds=3";
    let push = "call world.push robot=r left=-0.4 turn=0.3";
    for (name, trouble) in [("slip", slip), ("push", push)] {
        let summary = asked(name, &[(1, FREE), (8, trouble)], 60);
        let off = ends(&summary, 1, Progress::Arrived).off.unwrap();
        assert!(off < 0.02, "{name}: {off} m off");
        nothing_touched(&summary);
    }
}

#[test]
fn a_robot_that_is_carried_elsewhere_finds_itself_and_its_goal() {
    let carried = "call world.put name=r x=9.5 y=6.5 heading=-2.0";
    let summary = asked("carried", &[(2, carried), (12, "call navigation.go x=9.5 y=1.5 mode=goto")], 60);
    let off = ends(&summary, 1, Progress::Arrived).off.unwrap();
    assert!(off < 0.02, "{off} m off");
    nothing_touched(&summary);
}

#[test]
fn with_a_laser_that_is_off_or_stuck_or_tells_nonsense_it_stands_and_says_that_it_is_lost() {
    for kind in ["off", "stuck", "garbage"] {
        let summary = asked(kind, &[(1, FREE), (8, &format!("fault r.scan {kind}"))], 40);
        let last = ended(&summary, 1).last.progress;
        assert!(matches!(last, Progress::Lost | Progress::Unreachable), "{kind}: {:?}", summary.tasks);
        nothing_touched(&summary);
        // From there on it stands: it is far from its goal.
        assert!(way(&summary) < 6.0, "{kind}: {} m", way(&summary));
    }
}

#[test]
fn behind_a_latch_a_task_ends_and_to_reset_it_moves_nothing() {
    for mode in ["goto", "goto+avoid", "path"] {
        let go = format!("call navigation.go x=8 y=2 mode={mode}");
        for (name, requests) in [
            ("before", [(1, go.as_str()), (3, "stop"), (10, "reset")]),
            ("behind", [(1, "stop"), (3, go.as_str()), (10, "reset")]),
        ] {
            let summary = asked(&format!("{name}-{mode}"), &requests, 40);
            assert_eq!(
                ended(&summary, 1).last.progress,
                Progress::Halted,
                "{name} {mode}: {:?}",
                summary.tasks
            );
            // Two seconds on the way at 0.3 m/s, or none.
            let most = if name == "before" { 0.7 } else { 0.001 };
            assert!(way(&summary) < most, "{name} {mode}: {} m", way(&summary));
        }
    }
    let requests = [(1, "stop"), (10, "reset"), (12, "call navigation.go x=4 y=2 mode=goto")];
    ends(&asked("after-reset", &requests, 40), 1, Progress::Arrived);
}

#[test]
fn without_its_emergency_stop_it_drives_nowhere_whoever_commands() {
    // Straight at the crate.
    let requests = [
        (1, "call navigation.go x=4 y=5.2 turned=true heading=0 mode=goto+avoid"),
        (30, "call navigation.go x=9.5 y=5.2 mode=goto"),
        (31, "fault stop off"),
    ];
    let summary = asked("no-stop", &requests, 60);
    nothing_touched(&summary);
    assert_ne!(ended(&summary, 2).last.progress, Progress::Arrived);
    let by_hand = [(1, "remove stop"), (3, "call hand.drive linear=0.3 seconds=2")];
    let summary = asked("no-stop-by-hand", &by_hand, 10);
    assert!(way(&summary) < 0.001, "{} m", way(&summary));
}

#[test]
fn a_wall_that_is_put_up_before_it_stops_it_and_it_still_knows_where_it_is() {
    let wall = "call world.add name=wall x=7 y=2 length=0.2 width=2";
    let around = "call navigation.go x=9 y=2 mode=path";
    let requests = [(1, "call navigation.go x=9 y=2 mode=goto"), (3, wall), (120, around)];
    let summary = asked("wall-before-it", &requests, 200);
    ends(&summary, 1, Progress::Unreachable);
    let off = ends(&summary, 2, Progress::Arrived).off.unwrap();
    assert!(off < 0.05, "{off} m off");
    nothing_touched(&summary);
}

#[test]
fn a_goal_inside_an_obstacle_cannot_be_reached_whichever_way_it_goes() {
    for mode in ["goto", "path", "goto+avoid"] {
        let go = format!("call navigation.go x=6 y=5.2 seconds=90 mode={mode}");
        let summary = asked(&format!("inside-{mode}"), &[(1, &go)], 100);
        let last = ended(&summary, 1).last.progress;
        assert!(matches!(last, Progress::Unreachable | Progress::TimedOut), "{mode}: {:?}", summary.tasks);
        nothing_touched(&summary);
    }
}

#[test]
fn a_goal_that_is_walled_in_on_the_way_cannot_be_reached_and_a_wall_beside_the_way_does_not_matter() {
    let go = "call navigation.go x=10.5 y=6.8 mode=path";
    let wall = |name: &str, x: f64, y: f64, length: f64, width: f64| {
        format!("call world.add name={name} x={x} y={y} length={length} width={width}")
    };
    // Around the goal on two sides; the walls of the room are the others.
    let [left, below] = [wall("left", 9.3, 6.75, 0.1, 2.4), wall("below", 10.6, 5.6, 2.7, 0.1)];
    let summary = asked("walled", &[(1, go), (4, &left), (4, &below)], 200);
    ends(&summary, 1, Progress::Unreachable);
    nothing_touched(&summary);
    let beside = wall("beside", 4.5, 2.2, 0.1, 1.6);
    let summary = asked("beside", &[(1, go), (4, &beside)], 120);
    let off = ends(&summary, 1, Progress::Arrived).off.unwrap();
    assert!(off < 0.05, "{off} m off");
    nothing_touched(&summary);
}

#[test]
fn an_action_that_dies_makes_the_robot_stand_and_a_new_goal_is_reached_when_it_is_back() {
    let again = "call navigation.go x=9.5 y=1.5 mode=goto";
    let summary = asked("dies", &[(1, FREE), (6, "fault goto panic"), (12, again)], 60);
    ends(&summary, 1, Progress::Halted);
    ends(&summary, 2, Progress::Arrived);
    nothing_touched(&summary);
}

#[test]
fn a_real_time_supervisor_that_dies_makes_the_robot_stand_and_takes_the_next_goal() {
    let again = "call navigation.go x=9.5 y=1.5 mode=goto";
    let summary = asked("door", &[(1, FREE), (6, "fault supervisor panic"), (12, again)], 60);
    ends(&summary, 2, Progress::Arrived);
    nothing_touched(&summary);
}

#[test]
fn a_robot_that_stands_latched_tells_of_each_task_what_is_left_and_why() {
    let requests = [
        (1, "stop"),
        (2, "call navigation.drive distance=5"),
        (8, "call navigation.drive angle=1.5"),
        (14, "call navigation.wall side=right distance=0.8 seconds=60"),
        (30, "call navigation.wall side=right distance=0.8 seconds=5"),
    ];
    let summary = asked("latched", &requests, 40);
    let ended = [1, 2, 3, 4].map(|task| ends(&summary, task, Progress::Halted).last);
    assert!((ended[0].distance - 5.0).abs() < 0.01, "{:?}", ended[0]);
    assert!((ended[1].angle - 1.5).abs() < 0.01, "{:?}", ended[1]);
    assert!(ended.iter().all(|last| last.why.as_str().contains("sinew reset ends it")), "{ended:?}");
    assert!(way(&summary) < 1e-6);
}

#[test]
fn a_robot_that_runs_into_a_wall_on_its_way_has_driven_what_it_has_driven() {
    let summary = asked("into-the-step", &[(1, "call navigation.drive distance=1000")], 60);
    // What it ran into has set the latch.
    let outcome = ends(&summary, 1, Progress::Halted);
    assert!((outcome.last.distance + way(&summary) - 1000.0).abs() < 0.3, "{outcome:?}, {}", way(&summary));
}

#[test]
fn what_cannot_be_done_ends_with_its_reason_and_leaves_what_is_being_done() {
    let requests = [
        (1, "call navigation.go x=8 y=2"),
        (2, "call navigation.go"),
        (3, "call navigation.go x=9"),
        (4, "call navigation.go x=50 y=50"),
        (5, "call navigation.go x=5 y=2 mode=idle"),
        (6, "call navigation.go x=5 y=2 mode=teleoperation"),
        (7, "call navigation.go x=5 y=2 mode=wall-following"),
        (8, "call navigation.go x=5 y=2 mode=gotto"),
        (60, "call navigation.drive linear=5 seconds=2"),
    ];
    let summary = asked("refused", &requests, 65);
    let off = ends(&summary, 1, Progress::Arrived).off.unwrap();
    assert!(off < 0.02, "{off} m off");
    let whys = [2, 3, 4, 5, 6].map(|task| ends(&summary, task, Progress::Refused).last.why);
    let expected = [
        "nobody in the mode \"idle\" goes to a place; that is done in: goto, goto+avoid",
        "nobody in the mode \"teleoperation\" goes to a place; that is done in: goto, goto+avoid",
        "nobody in the mode \"wall-following\" goes to a place; that is done in: goto, goto+avoid",
        "there is no mode \"gotto\"; did you mean \"goto\"?",
        "5 m/s is faster than the move action's linear_max of 0.5 m/s",
    ];
    assert_eq!(whys.each_ref().map(|why| why.as_str()), expected);
    assert_eq!(summary.tasks.len(), 6, "the others had no number: {:?}", summary.tasks);
}

#[test]
fn a_goal_that_another_replaces_is_told_to_have_been_replaced() {
    let requests = [(1, "call navigation.go x=8 y=2"), (4, "call navigation.go x=3 y=5")];
    let summary = asked("replaced", &requests, 60);
    let first = ends(&summary, 1, Progress::Replaced);
    assert_eq!(first.last.why.as_str(), "task 2 has taken its place");
    assert!((4.0..4.2).contains(&first.at) && first.last.distance > 3.0, "{first:?}");
    ends(&summary, 2, Progress::Arrived);
    let noted = "task 1 is replaced by task 2";
    assert!(summary.noted.iter().any(|note| note.what.contains(noted)), "{:?}", summary.noted);
}

#[test]
fn a_goal_that_makes_no_sense_moves_nothing() {
    let summary =
        asked("senseless", &[(1, "call navigation.go x=1e9 y=0"), (2, "call navigation.drive")], 10);
    assert!(summary.tasks.is_empty(), "{:?}", summary.tasks);
    assert!(way(&summary) < 1e-6);
}

//! When a goal is met, and when it fails.

use super::people::led;
use super::*;

fn goal(text: &str, plan: &WorldPlan) -> Goal {
    let mut mistakes = Vec::new();
    let goal = Goal::read(&common::table(text), Span::default(), plan, &mut mistakes);
    goal.unwrap_or_else(|| panic!("{mistakes:?}"))
}

#[test]
fn a_goal_is_met_stage_by_stage_and_says_what_is_missing() {
    let plan = led();
    let goal = goal(
        r#"within = "100s"
           stage = [{ inside = "mark" }, { near = "guide", distance = 1.6, hold = "1s" },
                    { follows = "guide", distance = 1.7, time = "2s" }, { turned = "90deg" }]"#,
        &plan,
    );
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = goal.begin();
    let mut seen = vec![goal.why(&progress)];
    let mut step = |world: &mut Simulator, linear: f64, angular: f64, seconds: i32| {
        for _ in 0..seconds * 100 {
            drive(world, id, linear, angular, 0.01);
            goal.watch(&mut progress, world, id);
        }
        seen.push(goal.why(&progress));
        progress.stages_done()
    };
    assert_eq!(step(&mut world, 0.4, 0.0, 4), 0);
    assert_eq!(step(&mut world, 0.4, 0.0, 3), 1);
    assert_eq!(step(&mut world, 0.35, 0.0, 4), 2);
    assert_eq!(step(&mut world, 0.35, 0.0, 4), 3);
    assert_eq!(step(&mut world, 0.0, -1.0, 1), 3);
    assert_eq!(step(&mut world, 0.0, -1.0, 1), 4);
    assert!(progress.met() && progress.decided());
    assert_eq!(seen[0], "stage 1 of 4: the robot was not inside \"mark\"");
    assert!(
        seen[2].starts_with("stage 2 of 4: the robot was not within 1.6 m of \"guide\" for 1s (now 2.2"),
        "{}",
        seen[2]
    );
    assert!(seen[5].starts_with("stage 4 of 4: the robot had turned by 5"), "{}", seen[5]);
    assert!(seen[6].starts_with("all 4 stages met after 16.5"), "{}", seen[6]);
}

#[test]
fn a_goal_fails_by_time_and_by_touching() {
    let plan = led();
    let short = goal("within = \"2s\"\nstage = [{ inside = \"end\" }]", &plan);
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = short.begin();
    while !short.watch(&mut progress, &world, id) {
        world.step();
    }
    assert!(!progress.met());
    assert_eq!(short.why(&progress), "stage 1 of 1: the robot was not inside \"end\" when the 2s were over");
    let statue = Person { at: Point::new(1.0, 0.0), ..Person::default() };
    let plan = WorldPlan { people: vec![statue], regions: plan.regions, ..WorldPlan::default() };
    let (mut world, id) = alone(&plan, exact(), Pose::default());
    let mut progress = short.begin();
    while !short.watch(&mut progress, &world, id) {
        drive(&mut world, id, 0.6, 0.0, 0.01);
    }
    assert!(short.why(&progress).contains("touched something"), "{}", short.why(&progress));
}

#[test]
fn the_mistakes_of_a_goal_name_the_right_word() {
    let mut mistakes = Vec::new();
    let text = r#"stage = [{ inside = "mrak" }, { near = "ballon" }, { inside = "mark", turned = "x" }, {}]"#;
    assert_eq!(Goal::read(&common::table(text), Span::default(), &led(), &mut mistakes), None);
    let said = mistakes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(said.contains("did you mean \"mark\"") && said.contains("did you mean \"balloon\""), "{said}");
    assert_eq!(mistakes.len(), 4, "{said}");
}

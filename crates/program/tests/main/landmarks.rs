//! The scenario `landmarks` against the truth: a robot with wheels that are wrong and no laser, localised by tubes in its camera's picture and infrared.

use types::Pose;
use types::messages::Whereabouts;

use super::localizer::{play, quantile};

const SCENARIO: &str = include_str!("../../../../scenarios/landmarks.toml");

/// Beside the scenario: a localizer that hears infrared alone, and a witness.
const BESIDE: &str = r#"
[agent.ears]
is = "localizer"
robot = "h1"
period = "100ms"
landmarks = [[1, 1.2, 1.2, -1.5708], [2, 6.0, 1.2, -1.5708], [3, 10.8, 1.2, -1.5708], [4, 15.6, 1.2, -1.5708]]
known_start = true
x = 0.0
y = -0.4
track = 0.36

[agent.witness]
is = "witness"
period = "50ms"

[wires]
"localizer.state" = [{ to = "witness.state", depth = 16 }]
"ears.pose" = [{ to = "witness.other", depth = 16 }]
"#;

const BEGIN: Pose = Pose::new(0.0, -0.4, 0.0);

fn text() -> String {
    let wires = [
        ("[wires]\n", BESIDE),
        (
            "\"odometry.odometry\" = [",
            "\"odometry.odometry\" = [\"ears.odometry\", { to = \"witness.reckoned\", depth = 16 }, ",
        ),
        ("\"localizer.pose\" = [", "\"localizer.pose\" = [{ to = \"witness.pose\", depth = 16 }, "),
    ];
    wires.iter().fold(SCENARIO.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "the scenario has changed: {from}");
        text.replacen(from, to, 1)
    })
}

#[test]
fn past_tubes_that_all_look_the_same_it_knows_where_it_is_to_centimetres_and_by_infrared_to_the_reach_of_it()
{
    let diary = play(&text(), BEGIN, 3, None, 240);
    let diary = diary.lock().unwrap();
    assert!(diary.way() > 70.0, "two rounds: {} m", diary.way());
    assert!(diary.states(0.0, 240.0).all(|state| state == Whereabouts::Tracking));
    // By its wheels alone: one is larger by a hundredth, that is 0.01/0.36 rad in each metre, and after 37 m it looks the other way.
    let began: Vec<_> = diary.reckoned.iter().map(|(stamp, pose)| (*stamp, BEGIN.then(*pose))).collect();
    let (reckoned, _) = diary.off(&began, 0.0, 240.0);
    let (drifted, reach) = (quantile(&reckoned, 1.0), quantile(&reckoned, 0.5));
    assert!(drifted > 5.0 && reach > 2.83, "{drifted} {reach} m");
    // By its camera: half a pixel is Z²/(f D)/2, with f = 277 px and D = 0.35 m: 2 cm at 2 m, where it sees the tubes mostly, 5 cm at 3.2 m, 8 cm at 4 m, where it
    // sees them first. It is never blind for long: they are 4.8 m apart.
    let (places, heading) = diary.off(&diary.poses, 0.0, 240.0);
    let (half, most, worst) = (quantile(&places, 0.5), quantile(&places, 0.95), quantile(&places, 1.0));
    assert!(places.len() > 4000, "{}", places.len());
    assert!(half < 0.02 && most < 0.05 && worst < 0.1, "{half} {most} {worst} m");
    // What is 5 cm beside the ray to a tube at 2 m looks turned by so much, twice over.
    assert!(heading < 0.1, "{heading} rad");
    // By infrared: in the quarter of a circle of 2 m from which a checkpoint is heard, no two places are farther apart than 2 m times √2.
    let (ears, _) = diary.off(&diary.others, 0.0, 240.0);
    assert!(ears.len() > 2000 && quantile(&ears, 1.0) < 2.83, "{} m", quantile(&ears, 1.0));
}

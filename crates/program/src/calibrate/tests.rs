use super::*;

const ODOMETRY: &str = include_str!("../../../../docs/calibration/odometry.toml");
const LANDMARK: &str = include_str!("../../../../docs/calibration/landmark.toml");

fn odometry_of(text: &str) -> Result<Answer, Failure> {
    odometry::fit(&Read::parse("o.toml", text)?)
}

fn landmark_of(text: &str) -> Result<Answer, Failure> {
    landmark::fit(&Read::parse("l.toml", text)?)
}

/// The first mistake, with its line.
fn wrong(answer: Result<Answer, Failure>) -> (usize, String) {
    let failure = answer.unwrap_err();
    assert_eq!(failure.code, 2);
    let problem = &failure.problems[0];
    (problem.place.as_ref().map_or(0, |place| place.line), problem.what.clone())
}

#[test]
fn the_example_of_odometry_gives_the_wheels_that_it_was_made_with() {
    let answer = odometry_of(ODOMETRY).unwrap();
    // The example was made with radii of 0.0499 m and 0.0501 m, 0.344 m apart, and rounded, with noise of millimetres.
    let of = |part: &str, key: &str| answer.json[part]["drive"][key].as_f64().unwrap();
    for part in ["square", "stretches"] {
        assert!(
            (of(part, "right_radius") - of(part, "left_radius") - 0.0002).abs() < 1e-4,
            "{}",
            answer.json
        );
        assert!((of(part, "track") - 0.344).abs() < 1.2e-3, "{}", answer.json);
    }
    assert!((of("stretches", "left_radius") - 0.0499).abs() < 5e-5);
    assert!((of("stretches", "right_radius") - 0.0501).abs() < 5e-5);
    // What is printed can be pasted.
    let pasted = Read::parse("p.toml", answer.text.split("\n\n").next().unwrap()).unwrap();
    assert_eq!(pasted.tree.rows().len(), 3);
}

#[test]
fn the_example_of_the_landmark_is_fitted_to_millimetres() {
    let answer = landmark_of(LANDMARK).unwrap();
    assert!(answer.json["rms_pinhole_m"].as_f64().unwrap() > 0.05);
    assert!(answer.json["rms_m"].as_f64().unwrap() < 0.02, "{}", answer.json);
    let pasted = Read::parse("p.toml", &answer.text).unwrap();
    let keys: Vec<&str> = pasted.tree.rows().iter().map(|row| row.key.as_str()).collect();
    assert_eq!(keys, ["scale", "h", "a", "holds"]);
}

#[test]
fn what_is_wrong_is_told_with_its_line() {
    let robot = "[robot]\nleft_radius = 0.05\nright_radius = 0.05\ntrack = 0.3\nticks_per_turn = 100\n";
    for (text, line, what) in [
        (
            format!("{robot}[square]\nside = 4\nclockwise = [[1]]\ncounterclockwise = []\n"),
            8,
            "a row of \"clockwise\" must be two numbers, not [1]",
        ),
        (
            format!("{robot}[square]\nside = 4\nclockwise = [[0.1, 0]]\ncounterclockwise = []\n"),
            6,
            "there are no squares driven counter-clockwise; it takes both ways around, five of each are usual",
        ),
        (robot.to_owned(), 1, "there is nothing to calibrate from"),
        (
            format!("{robot}[[stretch]]\nleft = 1\nright = 1\nx = 1\ny = 0\n"),
            6,
            "stretch 1 needs \"turn\", how far it turned (rad)",
        ),
        (
            robot.replace("0.3", "-0.3") + "[[stretch]]\nleft = 1\nright = 1\nx = 1\ny = 0\nturn = 0\n",
            4,
            "\"track\" is -0.3, it must be greater than zero",
        ),
        (
            format!("{robot}[[stretch]]\nleft = 1\nright = 1\nx = nan\ny = 0\nturn = 0\n"),
            9,
            "\"x\" is NaN, which is no number to reckon with",
        ),
        ("[robot\n".to_owned(), 1, ""),
    ] {
        let (at, told) = wrong(odometry_of(&text));
        assert_eq!(at, line, "{told}");
        assert!(what.is_empty() || told == what, "{told}");
    }
    for (text, line, what) in [
        (
            "focal = 350\nwidth = 0.3\nsamples = [[100, 1],\n [50, -2]]\n",
            4,
            "sample 2 is not of a tube in front of the camera: pixels and metres must be greater than zero",
        ),
        ("focal = 350\nwidth = 0.3\n", 1, "there is no \"samples\", pairs of pixels and metres"),
        ("focal = 0\nwidth = 0.3\nsamples = []\n", 1, "\"focal\" is 0, it must be greater than zero"),
        (
            "focal = 350\nwidth = 0.3\nsamples = [[100, 1]]\n",
            3,
            "1 different distances in the picture are too few, it takes 6 and better twice as many",
        ),
    ] {
        assert_eq!(wrong(landmark_of(text)), (line, what.to_owned()));
    }
}

proptest::proptest! {
    #[test]
    fn garbage_never_panics(text in "(\\[robot\\]\n|\\[square\\]\n|\\[\\[stretch\\]\\]\n|(left|right|x|y|turn|side|track|focal|width|ticks_per_turn|left_radius|right_radius) = -?[0-9]{1,3}(\\.5)?\n|(samples|clockwise|counterclockwise) = \\[(\\[[1-9],[1-9]\\],){0,8}\\]\n|[a-z= \\[]{0,6}\n){0,14}") {
        let _ = odometry_of(&text);
        let _ = landmark_of(&text);
    }
}

//! The wheels of a robot, from squares and from stretches.

use std::fmt::Write as _;

use motion::Differential;
use navigation::calibration::square::{Ends, Squares, squares};
use navigation::calibration::wheels::{Stretch, Wheels, wheels};
use serde_json::{Value as Json, json};
use types::Point;
use types::value::{Mistake, Span, Table, TableReader};

use super::{Answer, Read, length, number, pairs};
use crate::error::Failure;

/// A part of the file that was read, with its place.
struct Measured {
    drive: Differential,
    ticks_per_turn: f64,
    square: Option<(f64, [Vec<Point>; 2], Span)>,
    stretches: Vec<Stretch>,
    stretches_at: Span,
}

pub(super) fn fit(read: &Read) -> Result<Answer, Failure> {
    let mut list = Vec::new();
    let Some(measured) = measured(&read.tree, &mut list).filter(|_| list.is_empty()) else {
        return Err(read.wrong(list));
    };
    let mut answer = Answer { text: String::new(), json: json!({}) };
    if let Some((side, [clockwise, counterclockwise], at)) = &measured.square {
        let ends = Ends { clockwise, counterclockwise };
        let found = squares(measured.drive, *side, ends)
            .map_err(|error| read.wrong(vec![Mistake::new(*at, error.to_string())]))?;
        tell_square(&mut answer, &found);
    }
    if !measured.stretches.is_empty() {
        let found = wheels(&measured.stretches, measured.ticks_per_turn)
            .map_err(|error| read.wrong(vec![Mistake::new(measured.stretches_at, error.to_string())]))?;
        tell_stretches(&mut answer, &found);
    }
    Ok(answer)
}

fn measured(tree: &Table, list: &mut Vec<Mistake>) -> Option<Measured> {
    let mut r = TableReader::new(tree, Span::default(), "the file");
    let robot = r.table("robot");
    let square = r.table("square");
    let rows = r.tables("stretch");
    let (robot_at, square_at) = (r.place("robot"), r.place("square"));
    let start = tree.rows().first().map(|row| row.key_at).unwrap_or_default();
    if robot.is_none() {
        r.report(Mistake::new(start, "there is no section [robot]").help(
            "it says what the robot goes by now: left_radius, right_radius, track (m) and ticks_per_turn",
        ));
    }
    if square.is_none() && rows.is_empty() {
        r.report(
            Mistake::new(start, "there is nothing to calibrate from")
                .help("a section [square], or rows of [[stretch]]; docs/calibration/odometry.toml has both"),
        );
    }
    r.finish(list);
    let drive = robot.and_then(|table| robot_of(table, robot_at, list));
    let square = square.and_then(|table| square_of(table, square_at, list));
    let stretches_at = rows.first().map(|(_, at)| *at).unwrap_or_default();
    let stretches = rows.iter().enumerate().filter_map(|(i, (table, at))| stretch_of(i, table, *at, list));
    let stretches = stretches.collect();
    let (drive, ticks_per_turn) = drive?;
    Some(Measured { drive, ticks_per_turn, square, stretches, stretches_at })
}

fn robot_of(table: &Table, at: Span, list: &mut Vec<Mistake>) -> Option<(Differential, f64)> {
    let mut r = TableReader::new(table, at, "[robot]");
    let left_radius = length(&mut r, "left_radius", "the radius of the left wheel (m)");
    let right_radius = length(&mut r, "right_radius", "the radius of the right wheel (m)");
    let track = length(&mut r, "track", "the distance of the wheels (m)");
    let ticks = length(&mut r, "ticks_per_turn", "the counts for one turn of a wheel");
    r.finish(list);
    let drive = Differential { left_radius: left_radius?, right_radius: right_radius?, track: track? };
    Some((drive, ticks?))
}

fn square_of(table: &Table, at: Span, list: &mut Vec<Mistake>) -> Option<(f64, [Vec<Point>; 2], Span)> {
    let mut r = TableReader::new(table, at, "[square]");
    let side = length(&mut r, "side", "the side of the squares (m)");
    let ends = ["clockwise", "counterclockwise"].map(|key| {
        let rows = pairs(&mut r, key, "where runs ended, as in [[0.1, -0.02], [0.12, -0.03]]");
        rows.into_iter().map(|([x, y], _)| Point::new(x, y)).collect::<Vec<_>>()
    });
    r.finish(list);
    Some((side?, ends, at))
}

fn stretch_of(number_of_row: usize, table: &Table, at: Span, list: &mut Vec<Mistake>) -> Option<Stretch> {
    let mut r = TableReader::new(table, at, format!("stretch {}", number_of_row + 1));
    let left = number(&mut r, "left", "counts of the left wheel");
    let right = number(&mut r, "right", "counts of the right wheel");
    let x = number(&mut r, "x", "where it came, ahead (m)");
    let y = number(&mut r, "y", "where it came, to the left (m)");
    let turn = number(&mut r, "turn", "how far it turned (rad)");
    r.finish(list);
    Some(Stretch { left: left?, right: right?, x: x?, y: y?, turn: turn? })
}

/// Lines that can be pasted into what says how the robot is built.
fn lines(drive: Differential) -> String {
    format!(
        "left_radius = {:.6}\nright_radius = {:.6}\ntrack = {:.6}\n",
        drive.left_radius, drive.right_radius, drive.track
    )
}

fn drive_json(drive: Differential) -> Json {
    json!({"left_radius": drive.left_radius, "right_radius": drive.right_radius, "track": drive.track})
}

fn tell_square(answer: &mut Answer, found: &Squares) {
    let [cw, ccw] = found.centres;
    let _ = write!(
        answer.text,
        "# from squares: E_d {:.6}, E_b {:.6}; off by {:+.4} rad at a corner, {:+.4} rad along a side\n\
         # centres: clockwise ({:.4}, {:.4}) m, counter-clockwise ({:.4}, {:.4}) m; lasting {:.4} m, by chance {:.4} m\n{}",
        found.unequal,
        found.track,
        found.corner,
        found.bend,
        cw.x,
        cw.y,
        ccw.x,
        ccw.y,
        found.lasting,
        found.chance,
        lines(found.drive)
    );
    answer.json["square"] = json!({
        "drive": drive_json(found.drive),
        "unequal": found.unequal,
        "track": found.track,
        "corner_rad": found.corner,
        "bend_rad": found.bend,
        "centres_m": [[cw.x, cw.y], [ccw.x, ccw.y]],
        "lasting_m": found.lasting,
        "chance_m": found.chance,
    });
}

fn tell_stretches(answer: &mut Answer, found: &Wheels) {
    if !answer.text.is_empty() {
        answer.text.push('\n');
    }
    let _ = write!(
        answer.text,
        "# from stretches: left over {:.4} m of ways and {:.4} rad of turns (root mean square); condition {:.1}\n{}",
        found.rms[0],
        found.rms[1],
        found.condition,
        lines(found.drive)
    );
    answer.text += "# left over of each stretch: x, y (m), turn (rad)\n";
    for (i, [x, y, turn]) in found.residuals.iter().enumerate() {
        let _ = writeln!(answer.text, "# {:>3}  {x:+.4}  {y:+.4}  {turn:+.4}", i + 1);
    }
    answer.json["stretches"] = json!({
        "drive": drive_json(found.drive),
        "rms": {"way_m": found.rms[0], "turn_rad": found.rms[1]},
        "condition": found.condition,
        "residuals": found.residuals,
    });
}

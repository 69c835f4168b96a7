//! The distance of a two-coloured tube by its size in the picture.

use std::fmt::Write as _;

use navigation::calibration::tube::{Fitted, Sample, TubeError, fit as fit_tube};
use serde_json::json;
use types::value::{Mistake, Span, TableReader};

use super::{Answer, Read, length, pairs};
use crate::error::Failure;

pub(super) fn fit(read: &Read) -> Result<Answer, Failure> {
    let mut list = Vec::new();
    let mut r = TableReader::new(&read.tree, Span::default(), "the file");
    // What is missing in the whole file stands at its first word.
    let start = read.tree.rows().first().map(|row| row.key_at).unwrap_or_default();
    for (key, wanted) in [
        ("focal", "the focal length (px)"),
        ("width", "how far apart the middles of the colours are (m)"),
        ("samples", "pairs of pixels and metres"),
    ] {
        if r.entry(key).is_none() {
            list.push(Mistake::new(start, format!("there is no \"{key}\", {wanted}")));
        }
    }
    if !list.is_empty() {
        return Err(read.wrong(list));
    }
    let focal = length(&mut r, "focal", "the focal length (px)");
    let width = length(&mut r, "width", "how far apart the middles of the colours are (m)");
    let rows = pairs(&mut r, "samples", "pairs of pixels and metres, as in [[131.2, 0.8], [52.5, 2.0]]");
    let all = r.place("samples");
    r.finish(&mut list);
    let (Some(focal), Some(width), true) = (focal, width, list.is_empty()) else {
        return Err(read.wrong(list));
    };
    let samples: Vec<Sample> =
        rows.iter().map(|([pixels, distance], _)| Sample { pixels: *pixels, distance: *distance }).collect();
    let fitted = fit_tube(&samples, focal, width).map_err(|error| {
        let at = match error {
            TubeError::Impossible(number) => rows.get(number - 1).map_or(all, |(_, at)| *at),
            _ => all,
        };
        read.wrong(vec![Mistake::new(at, error.to_string())])
    })?;
    Ok(answer(&samples, &fitted))
}

fn answer(samples: &[Sample], fitted: &Fitted) -> Answer {
    let tube = &fitted.tube;
    let [least, most] = tube.holds;
    let mut text = format!(
        "# left over {:.3e} m by the polynomial, {:.3e} m by the pinhole alone (root mean square); condition {:.1e}\n\
         # it holds from {least} to {most} px\n\
         scale = {}\nh = {:?}\na = {:?}\nholds = {:?}\n\
         # left over of each sample: px, m, m left over\n",
        fitted.rms[1], fitted.rms[0], fitted.condition, tube.scale, tube.h, tube.a, tube.holds
    );
    for (sample, rest) in samples.iter().zip(&fitted.residuals) {
        let _ = writeln!(text, "# {:>9.3}  {:>7.4}  {rest:+.5}", sample.pixels, sample.distance);
    }
    let json = json!({
        "tube": {"scale": tube.scale, "h": tube.h, "a": tube.a, "holds": tube.holds},
        "rms_m": fitted.rms[1],
        "rms_pinhole_m": fitted.rms[0],
        "condition": fitted.condition,
        "residuals_m": fitted.residuals,
    });
    Answer { text, json }
}

//! The landmark finder: tubes of two colours in the pictures of a camera, how far away and in which direction.
//!
//! ```text
//!  rgb or hsi ─▶ regions of both colours ─▶ one right above the other ─┬─▶ direction ─────────────┬─▶ landmarks
//!  head ───────────────────────────────────────────────────────────────┘                          │
//!                           distance of the middles ─▶ polynomial, fitted by `sinew calibrate` ──┘
//! ```
//!
//! It also wishes to look at the nearest one, so that a robot that drives past keeps it in the picture for as long as its neck can turn.
//!
//! The polynomial ([`navigation::calibration::tube`]) tells the distance along the axis of the camera, as the height in a picture does; over the floor
//! the tube is as much farther as the ray to it is oblique. Without a fit it is the pinhole alone, Z = f D / d, and the camera sees the near side of the
//! tube: over its width that is π/4 of its radius before its middle.

use libm::cos;
use navigation::calibration::tube::Tube as Polynomial;
use perception::colour::ColourRange;
use perception::picture::Size;
use perception::target::Camera;
use perception::tube::{Tube, TubeFinder, TubePattern};
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::geometry::{PI, wrap};
use types::messages::{Head, Image, LandmarkSighting, Landmarks};
use types::value::{Mistake, Table};
use types::{Duration, params::Params};

use crate::recogniser::ColourPattern;
use crate::shared::{BODY, Dated, form};

/// Which tubes are looked for, and how far away they are.
#[derive(Clone, Debug, Params)]
#[params(check = whole)]
pub struct LandmarkFinderParams {
    /// Colour of the upper half, as a table of hues in degrees and least saturation and value: { hue_from = 350, hue_to = 10, saturation = 0.35, value = 0.12 }. A green.
    #[param(default = ColourPattern { hue_from: 100.0, hue_to: 160.0, ..ColourPattern::default() })]
    pub upper: ColourPattern,
    /// Colour of the lower half, likewise. A red. Tubes that stand the other way up are none: another finder may look for them.
    #[param(default = ColourPattern::default())]
    pub lower: ColourPattern,
    /// The number that is told of each; 0 where they all look the same.
    #[param(default = 0u32, max = 1000000)]
    pub id: u32,
    /// How far apart the middles of the two halves are on a tube (m). 0.55 is half of the height of a usual one of the simulator.
    #[param(default = 0.55, min = 0.01, max = 10.0)]
    pub width: f64,
    /// Radius of a tube (m). It counts without a fit only: samples are taken to the middle of the tube.
    #[param(default = 0.05, min = 0.0, max = 1.0)]
    pub radius: f64,
    /// Tubes that seem farther are passed over (m). 4: half a pixel of a picture of 320 is 4 to 8 cm there.
    #[param(default = 4.0, min = 0.1, max = 100.0)]
    pub farthest: f64,
    /// Where the head shall look while no tube is seen (rad, to the left): where the next ones come into view.
    #[param(default = 0.0, min = -3.2, max = 3.2)]
    pub rest: f64,
    /// How long a tube that is out of the picture is still looked for (time). 500 ms is seven pictures.
    #[param(default = Duration::millis(500), min = 0.0, max = 60.0)]
    pub patience: Duration,
    /// Focal length times width (px m), as sinew calibrate landmark tells it; 0 for the focal length that comes with the pictures, and no fit.
    #[param(default = 0.0, min = 0.0, max = 1000000.0)]
    pub scale: f64,
    /// The pole h of the fit (px), as told there.
    #[param(default = 0.0, min = -1000000.0, max = 1000000.0)]
    pub h: f64,
    /// The four numbers a of the fit, as told there.
    pub a: Vec<f64>,
    /// The least and the greatest distance in the picture for which the fit holds (px), as told there. Other tubes have a direction and no distance.
    pub holds: Vec<f64>,
}

/// A fit is there as a whole or not at all.
fn whole(params: &LandmarkFinderParams, read: &Table) -> Vec<Mistake> {
    let is_none = params.scale == 0.0 && params.a.is_empty() && params.holds.is_empty();
    if is_none || (params.scale > 0.0 && params.polynomial(1.0).is_some()) {
        return Vec::new();
    }
    let at = ["scale", "a", "holds"].iter().find_map(|key| read.get(key)).map(|entry| entry.at);
    let mistake = Mistake::new(at.unwrap_or_default(), "that is not a whole fit of a tube");
    vec![mistake.help(
        "copy scale, h, a and holds from what sinew calibrate landmark FILE tells: a has four numbers, holds the least and the greatest",
    )]
}

impl LandmarkFinderParams {
    fn pattern(&self) -> TubePattern {
        let [upper, lower]: [ColourRange; 2] = [self.upper.colours(), self.lower.colours()];
        TubePattern { upper, lower }
    }

    /// From pixels to metres, for pictures of a focal length (px).
    fn polynomial(&self, focal: f64) -> Option<Polynomial> {
        if self.scale == 0.0 {
            // A tube of one pixel is nowhere.
            return Some(Polynomial { scale: focal * self.width, h: 0.0, a: [0.0; 4], holds: [2.0, 1e6] });
        }
        let (a, holds) = (*self.a.as_array()?, *self.holds.as_array::<2>()?);
        let is_whole = a.iter().all(|a| a.is_finite())
            && holds[0] > 0.0
            && holds[0] < holds[1]
            && !(holds[0]..=holds[1]).contains(&self.h);
        is_whole.then_some(Polynomial { scale: self.scale, h: self.h, a, holds })
    }
}

/// Finds upright tubes of two colours in the pictures of a camera, and tells how far away each is and in which direction.
#[derive(Agent)]
pub struct LandmarkFinder {
    /// Pictures as hue, saturation and intensity, where somebody makes them anyway.
    hsi: Input<Image>,
    /// Pictures as the camera takes them. They give the same, and are split without being converted.
    rgb: Input<Image>,
    /// Where the head looks; without it the camera looks ahead.
    head: Input<Head>,
    /// The tubes in each picture, with its stamp; a picture without any is told, too.
    #[port(history = 64, interpreted)]
    landmarks: Output<Landmarks>,
    /// A wish where the head shall look.
    look: Output<Head>,
    params: LandmarkFinderParams,
    eye: Eye,
    /// Where the head looked when it was last heard of.
    looks: Head,
    /// Where the nearest tube was last, and when (rad).
    nearest: Option<Dated<f64>>,
}

impl Agent for LandmarkFinder {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.eye.fit(Size::new(320, 240));
        Ok(())
    }

    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let Some(head) = self.head.latest() {
            self.looks = head;
        }
        let Some(picture) = self.rgb.newest().or_else(|| self.hsi.newest()) else { return Ok(()) };
        let stamp = picture.header().stamp;
        // Where the head looked when the picture was taken, not where it looks by now.
        let head = self.head.at(stamp).map_or(self.looks, |found| found.value());
        let seen = self.eye.see(&self.params, &picture, picture.row(), head)?;
        self.landmarks.send_as(Envelope { stamp: Some(stamp), ..Envelope::default() }, seen);
        if let Some(value) = seen.seen.first().and_then(LandmarkSighting::known_bearing) {
            self.nearest = Some(Dated { value, stamp });
        }
        let pan = Dated::fresh(&self.nearest, stamp, self.params.patience).unwrap_or(self.params.rest);
        self.look.send(Head { pan, tilt: 0.0 });
        Ok(())
    }
}

/// What finds tubes in a picture; made for one size of pictures.
#[derive(Default)]
struct Eye(Option<TubeFinder>);

impl Eye {
    /// Makes room for pictures of this size; nothing when there is already.
    fn fit(&mut self, size: Size) -> &mut TubeFinder {
        if self.0.as_ref().is_some_and(|finder| finder.size() != size) {
            self.0 = None;
        }
        self.0.get_or_insert_with(|| TubeFinder::new(size))
    }

    fn see(
        &mut self,
        params: &LandmarkFinderParams,
        picture: &Image,
        row: &[u8],
        head: Head,
    ) -> Result<Landmarks, Fault> {
        const WRONG: Fault = Fault::new(
            "a landmark finder needs whole pictures: RGB at \"rgb\", or those of the output \"hsi\" of a camera",
        );
        let (form, size) = form(picture, row).ok_or(WRONG)?;
        let camera = Camera { size, horizontal_field_of_view: picture.field_of_view.into() };
        let tubes = self.fit(size).find(row, form, &params.pattern()).map_err(|_| WRONG)?;
        let mut told = Landmarks { frame: BODY.into(), ..Landmarks::default() };
        for tube in tubes {
            let seen = sighting(params, &camera, head, tube);
            if seen.known_range().is_none_or(|range| range <= params.farthest) {
                // There is room for as many as can be found.
                let _ = told.seen.push(seen);
            }
        }
        // What has no distance comes last.
        let far = |seen: &LandmarkSighting| seen.known_range().unwrap_or(f64::INFINITY);
        told.seen.sort_unstable_by(|a, b| far(a).total_cmp(&far(b)));
        Ok(told)
    }
}

/// Where a tube is.
fn sighting(params: &LandmarkFinderParams, camera: &Camera, head: Head, tube: &Tube) -> LandmarkSighting {
    let (x, y) = tube.middle();
    let (aside, _) = camera.direction(x, y);
    let depth = params.polynomial(camera.focal_length()).filter(|_| tube.whole);
    let range = depth.and_then(|polynomial| polynomial.distance(tube.apart())).map(|depth| {
        let behind = if params.scale == 0.0 { PI / 4.0 * params.radius } else { 0.0 };
        depth / cos(aside) + behind
    });
    LandmarkSighting {
        id: params.id,
        range: range.map_or(f32::NAN, |range| range as f32),
        bearing: wrap(head.pan + aside) as f32,
        side: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::Encoding;

    /// f = 160 / tan(0.5) = 292.9 px.
    const FIELD: f32 = 1.0;

    /// A grey picture with a tube around a column: its halves are so many pixels high, the seam is in the middle.
    fn picture(column: usize, height: usize) -> (Image, Vec<u8>) {
        let image = Image {
            width: 320,
            height: 240,
            encoding: Encoding::Rgb8,
            field_of_view: FIELD,
            ..Image::default()
        };
        let pixel = |i: usize| {
            let (x, y) = (i % 320, i / 320);
            match y {
                _ if x.abs_diff(column) > 4 => [120, 118, 116],
                _ if (120 - height..120).contains(&y) => [40, 150, 60],
                _ if (120..120 + height).contains(&y) => [200, 25, 20],
                _ => [120, 118, 116],
            }
        };
        (image, (0..320 * 240).flat_map(pixel).collect())
    }

    fn seen(params: &LandmarkFinderParams, column: usize, height: usize, head: Head) -> Landmarks {
        let (image, row) = picture(column, height);
        Eye::default().see(params, &image, &row, head).unwrap()
    }

    #[test]
    fn a_tube_is_told_by_the_pinhole_where_there_is_no_fit() {
        let params = LandmarkFinderParams { width: 0.3, ..LandmarkFinderParams::default() };
        let head = Head { pan: 0.4, tilt: 0.0 };
        let told = seen(&params, 250, 40, head);
        let [tube] = told.seen[..] else { panic!("{told:?}") };
        let focal = 160.0 / 0.5f64.tan();
        let aside = -((250.0 - 159.5) / focal).atan();
        let range = focal * 0.3 / 40.0 / aside.cos() + 0.05 * PI / 4.0;
        assert!((f64::from(tube.bearing) - 0.4 - aside).abs() < 1e-5, "{tube:?}");
        assert!((f64::from(tube.range) - range).abs() < 1e-4, "{tube:?} for {range}");
        assert_eq!((told.frame.as_str(), tube.id), ("base_link", 0));
    }

    #[test]
    fn a_fit_tells_the_distance_and_nothing_where_it_does_not_hold() {
        let params = LandmarkFinderParams {
            scale: 100.0,
            h: -20.0,
            a: vec![1.5, 0.0, 0.0, 0.0],
            holds: vec![30.0, 90.0],
            ..LandmarkFinderParams::default()
        };
        let tube = seen(&params, 159, 40, Head::default()).seen[0];
        // Z = f D (1/d + a₁/(d − h)²).
        let depth = 100.0 * (1.0 / 40.0 + 1.5 / 3600.0);
        assert!((f64::from(tube.range) - depth).abs() < 1e-4, "{tube:?} for {depth}");
        let near = seen(&params, 159, 95, Head::default()).seen[0];
        assert_eq!((near.known_range(), near.known_bearing().is_some()), (None, true));
    }

    #[test]
    fn half_a_fit_is_a_mistake() {
        let said = |params: &LandmarkFinderParams| whole(params, &Table::new()).len();
        let fit = LandmarkFinderParams {
            scale: 100.0,
            h: -20.0,
            a: vec![0.0; 4],
            holds: vec![30.0, 90.0],
            ..LandmarkFinderParams::default()
        };
        assert_eq!((said(&fit), said(&LandmarkFinderParams::default())), (0, 0));
        assert_eq!(said(&LandmarkFinderParams { a: vec![0.0; 3], ..fit.clone() }), 1);
        assert_eq!(said(&LandmarkFinderParams { scale: 0.0, ..fit.clone() }), 1);
        assert_eq!(said(&LandmarkFinderParams { h: 50.0, ..fit }), 1, "its pole lies where it holds");
    }

    #[test]
    fn a_picture_without_a_tube_tells_of_none_and_a_grey_one_is_a_fault() {
        let params = LandmarkFinderParams::default();
        assert!(seen(&params, 159, 0, Head::default()).seen.is_empty());
        let (image, row) = picture(159, 0);
        let grey = Image { encoding: Encoding::Mono8, ..image };
        assert!(Eye::default().see(&params, &grey, &row[..320 * 240], Head::default()).is_err());
    }
}

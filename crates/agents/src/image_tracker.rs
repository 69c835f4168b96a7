//! The image tracker: the largest region of a colour is the target; the head keeps it in the middle, the feet come close.
//!
//! ```text
//!  rgb or hsi ─▶ split by hue ─▶ largest region ─▶ bearing, share ─▶ pursuit ─┬─▶ drive (an offer)
//!  head ───────────────────────────────────────────────────────────▶          ├─▶ look (a wish for the head)
//!                                                                             └─▶ target
//! ```

use motion::pursuit::{Mode, Orders, Parameters, Pursuit, Sighting};
use perception::blobs::{BlobFinder, BlobParams};
use perception::colour::{ColourRange, Converter, in_range};
use perception::picture::Size;
use perception::target::{Camera, target};
use runtime::{Agent, Fault, Input, Output, Step};
use types::geometry::wrap;
use types::messages::{Drive, Encoding, Head, Image, Offer, Target};
use types::params::Params;
use types::{Duration, Time};

/// What is tracked, and how.
#[derive(Clone, Debug, Params)]
pub struct TrackerParams {
    /// Where the range of hues begins, going up (degrees). 350: red lies on the seam of the circle.
    #[param(default = 350.0, min = 0.0, max = 360.0)]
    pub hue_from: f64,
    /// Where it ends (degrees). 10, through 0.
    #[param(default = 10.0, min = 0.0, max = 360.0)]
    pub hue_to: f64,
    /// Least saturation (0 to 1). 0.35: skin, wood and brick are reddish but stay below it.
    #[param(default = 0.35, min = 0.0, max = 1.0)]
    pub saturation_min: f64,
    /// Least intensity (0 to 1). 0.12: below it noise makes the hue of a shadow arbitrary.
    #[param(default = 0.12, min = 0.0, max = 1.0)]
    pub intensity_min: f64,
    /// Least area of the target (share of the picture). 0.0005 is a ball of 28 cm at 11 m; what is smaller is a speck.
    #[param(default = 0.0005, min = 0.0, max = 1.0)]
    pub share_min: f64,
    /// Share of the picture at which it is close enough. 0.08 is a ball of 28 cm at 0.9 m for a lens of 60°.
    #[param(default = 0.08, min = 0.0001, max = 1.0)]
    pub share_wanted: f64,
    /// Speed for being twice as far away as wanted (m/s). 0.3 nears a standing target without running over the point.
    #[param(default = 0.3, min = 0.0, max = 5.0)]
    pub approach: f64,
    /// Highest speed (m/s). 0.4 leaves the safety monitor time to see what steps in between.
    #[param(default = 0.4, min = 0.0, max = 5.0)]
    pub linear_max: f64,
    /// Speed of backing off when it is much too close (m/s). 0: few robots see behind.
    #[param(default = 0.0, min = 0.0, max = 1.0)]
    pub back_off: f64,
    /// Farthest turn of the head to either side (rad).
    #[param(default = 1.4, min = 0.0, max = 3.2)]
    pub pan_max: f64,
    /// Farthest nod of the head up or down (rad).
    #[param(default = 0.6, min = 0.0, max = 1.6)]
    pub tilt_max: f64,
    /// How long it must be seen until the desire for it is 1 (s). 0.3 is four pictures: one red reflection raises no desire.
    #[param(default = 0.3, min = 0.0, max = 60.0)]
    pub confirm: f64,
    /// How long it looks for a lost target, while the desire for it fades (s). 5 looks half around.
    #[param(default = 5.0, min = 0.0, max = 600.0)]
    pub patience: f64,
    /// How long a wish of it holds (time). 300 ms is four pictures.
    #[param(default = Duration::millis(300), min = 0.01, max = 60.0)]
    pub hold: Duration,
}

impl TrackerParams {
    fn colours(&self) -> ColourRange {
        ColourRange {
            hue_from: self.hue_from.to_radians(),
            hue_to: self.hue_to.to_radians(),
            saturation_min: self.saturation_min,
            intensity_min: self.intensity_min,
        }
    }

    fn pursuit(&self) -> Parameters {
        Parameters {
            pan_max: self.pan_max,
            tilt_max: self.tilt_max,
            share_wanted: self.share_wanted,
            approach: self.approach,
            linear_max: self.linear_max,
            back_off: self.back_off,
            patience: self.patience,
            ..Parameters::default()
        }
    }
}

/// Finds the largest region of a colour, turns the head to it, comes close and stops before it. Its method "rough" looks at every other pixel of every other line.
#[derive(Agent)]
#[agent(methods(exact = 1.0, rough = 0.5))]
pub struct ImageTracker {
    /// Pictures as hue, saturation and intensity, where somebody makes them anyway.
    hsi: Input<Image>,
    /// Pictures as the camera takes them. They give the same target, and are split without being converted.
    rgb: Input<Image>,
    /// Where the head looks; without it the camera looks ahead.
    head: Input<Head>,
    /// Where the target is and how much it is to be followed.
    #[port(history = 64, interpreted)]
    target: Output<Target>,
    /// A wish to drive to it.
    drive: Output<Offer>,
    /// A wish where the head shall look.
    look: Output<Head>,
    params: TrackerParams,
    eye: Eye,
    hunt: Hunt,
}

impl Agent for ImageTracker {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.eye.fit(Size::new(320, 240));
        if self.rgb.is_wired() {
            self.eye.learn_colours();
        }
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(head) = self.head.latest() {
            self.hunt.head = head;
        }
        let Some(picture) = self.rgb.newest().or_else(|| self.hsi.newest()) else { return Ok(()) };
        let stamp = picture.header().stamp;
        // Where the head looked when the picture was taken, not where it looks by now.
        let head = self.head.at(stamp).map_or(self.hunt.head, |found| found.value());
        let seen = self.eye.see(&self.params, &picture, picture.row(), step.method == ROUGH)?;
        let found = self.hunt.pursue(&self.params, seen, head, stamp);
        self.target.send(found.target);
        self.look.send(found.look);
        if let Some(offer) = found.offer {
            self.drive.send(offer);
        }
        Ok(())
    }
}

/// The place of the method that looks at a quarter of the pixels. It tells directions half as exactly, which is its quality.
const ROUGH: usize = 1;
/// It takes one pixel of so many, in both directions.
const THINNED: usize = 2;

/// What finds the target in a picture; made for one size of pictures.
#[derive(Default)]
struct Eye {
    /// What tells the hue of a pixel; only RGB pictures need it.
    colours: Option<Converter>,
    fine: View,
    rough: View,
    /// The pixels that the rough look takes.
    thinned: Vec<u8>,
}

/// What looks at pictures of one size.
#[derive(Default)]
struct View {
    mask: Vec<u8>,
    finder: Option<BlobFinder<8>>,
}

impl View {
    fn fit(&mut self, size: Size) {
        if self.finder.as_ref().is_none_or(|finder| finder.size() != size) {
            self.finder = Some(BlobFinder::new(size, BlobParams::default()));
            self.mask = vec![0; size.pixels()];
        }
    }
}

/// The size of a picture of which a part is taken.
fn thinned(size: Size) -> Size {
    Size::new(size.width.div_ceil(THINNED), size.height.div_ceil(THINNED))
}

impl Eye {
    /// Makes room for pictures of this size; nothing when there is already.
    fn fit(&mut self, size: Size) {
        self.fine.fit(size);
        self.rough.fit(thinned(size));
        let bytes = 3 * thinned(size).pixels();
        if self.thinned.len() != bytes {
            self.thinned = vec![0; bytes];
        }
    }

    /// Gets ready for RGB pictures; nothing when it is already.
    fn learn_colours(&mut self) {
        self.colours.get_or_insert_default();
    }

    fn see(
        &mut self,
        params: &TrackerParams,
        picture: &Image,
        row: &[u8],
        is_rough: bool,
    ) -> Result<Option<Sighting>, Fault> {
        const WRONG: Fault = Fault::new(
            "the tracker needs whole pictures: RGB at \"rgb\", or those of the output \"hsi\" of a camera",
        );
        let size = Size::new(picture.width as usize, picture.height as usize);
        if row.len() != picture.len() || row.is_empty() || row.len() != 3 * size.pixels() {
            return Err(WRONG);
        }
        self.fit(size);
        let (view, row, size) = if is_rough {
            thin(row, size.width, &mut self.thinned);
            (&mut self.rough, &self.thinned[..], thinned(size))
        } else {
            (&mut self.fine, row, size)
        };
        let range = params.colours();
        match picture.encoding {
            Encoding::Hsi8 => in_range(row, &range, &mut view.mask),
            Encoding::Rgb8 => self.colours.get_or_insert_default().split(row, &range, &mut view.mask),
            _ => return Err(WRONG),
        }
        .map_err(|_| WRONG)?;
        let Some(finder) = &mut view.finder else { return Ok(None) };
        let Some(blob) = finder.largest(&view.mask).map_err(|_| WRONG)? else { return Ok(None) };
        let camera = Camera { size, horizontal_field_of_view: picture.field_of_view.into() };
        let found = target(&blob, &camera);
        let sighting =
            Sighting { bearing: found.bearing, elevation: found.elevation, share: found.area_share };
        Ok((found.area_share >= params.share_min).then_some(sighting))
    }
}

/// Takes one pixel of so many in both directions.
fn thin(row: &[u8], width: usize, into: &mut [u8]) {
    let lines = row.chunks_exact(3 * width).step_by(THINNED);
    let pixels = lines.flat_map(|line| line.as_chunks::<3>().0.iter().step_by(THINNED));
    for (pixel, out) in pixels.zip(into.as_chunks_mut::<3>().0) {
        *out = *pixel;
    }
}

/// The pursuit and how much it is wanted.
#[derive(Clone, Copy, Debug, Default)]
struct Hunt {
    pursuit: Option<(Parameters, Pursuit)>,
    head: Head,
    target: Target,
    last: Option<Time>,
}

/// What the tracker says of a picture.
struct Found {
    target: Target,
    look: Head,
    offer: Option<Offer>,
}

impl Hunt {
    fn pursue(&mut self, params: &TrackerParams, seen: Option<Sighting>, head: Head, stamp: Time) -> Found {
        let dt = self.last.replace(stamp).map_or(0.0, |last| (stamp - last).seconds().clamp(0.0, 1.0));
        let orders = self.step(params, seen, head, dt);
        if let Some(seen) = seen {
            self.target.bearing = wrap(head.pan + seen.bearing);
            self.target.elevation = head.tilt + seen.elevation;
            self.target.share = seen.share;
        }
        self.target.visible = seen.is_some();
        self.target.desire = self.desire(params, orders.mode, dt);
        let wants = orders.mode != Mode::Idle;
        let offer = Offer {
            twist: orders.twist,
            weight: self.target.desire,
            valid_until: stamp + params.hold,
            form: Drive::Numeric,
            ..Offer::default()
        };
        // The head is told an angle: where its rate leads to until the next picture.
        let look = Head { pan: head.pan + orders.pan_rate * dt, tilt: head.tilt + orders.tilt_rate * dt };
        Found { target: self.target, look, offer: wants.then_some(offer) }
    }

    fn step(&mut self, params: &TrackerParams, seen: Option<Sighting>, head: Head, dt: f64) -> Orders {
        let wanted = params.pursuit();
        match &mut self.pursuit {
            Some((known, pursuit)) if *known == wanted => pursuit.step(seen, head, dt),
            // Other parameters begin another pursuit.
            place => place.insert((wanted, Pursuit::new(wanted))).1.step(seen, head, dt),
        }
    }

    /// Grows while the target is seen, fades while it is sought.
    fn desire(&self, params: &TrackerParams, mode: Mode, dt: f64) -> f64 {
        let over = |time: f64| if time > 0.0 { dt / time } else { 1.0 };
        match mode {
            Mode::Idle => 0.0,
            Mode::Tracking | Mode::Arrived => (self.target.desire + over(params.confirm)).min(1.0),
            Mode::Searching => (self.target.desire - over(params.patience)).max(0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An HSI picture of 32 × 24 with red in the given columns of the rows 8 to 15.
    fn picture(columns: core::ops::Range<usize>) -> (Image, Vec<u8>) {
        let image =
            Image { width: 32, height: 24, encoding: Encoding::Hsi8, field_of_view: 1.0, ..Image::default() };
        let pixel = |i: usize| {
            let red = columns.contains(&(i % 32)) && (8..16).contains(&(i / 32));
            if red { [253, 200, 120] } else { [90, 200, 120] }
        };
        (image, (0..32 * 24).flat_map(pixel).collect())
    }

    #[test]
    fn the_largest_red_region_is_seen_in_its_direction() {
        let params = TrackerParams::default();
        let mut eye = Eye::default();
        let mut see = |columns| {
            let (image, row) = picture(columns);
            eye.see(&params, &image, &row, false).unwrap()
        };
        let left = see(0..4).unwrap();
        assert!(left.bearing > 0.4 && left.elevation.abs() < 1e-9, "{left:?}");
        assert!((left.share - 32.0 / 768.0).abs() < 1e-12);
        assert!(see(14..18).unwrap().bearing.abs() < 1e-9);
        assert_eq!(see(0..0), None);
        let (image, row) = picture(0..4);
        assert!(eye.see(&params, &Image { encoding: Encoding::Mono8, ..image }, &row[..768], false).is_err());
    }

    #[test]
    fn a_picture_and_its_conversion_give_the_same_sighting() {
        let params = TrackerParams::default();
        let image = Image { encoding: Encoding::Rgb8, ..picture(0..0).0 };
        let pixel = |i: usize| if (3..9).contains(&(i % 32)) { [200, 25, 20] } else { [120, 110, 100] };
        let rgb: Vec<u8> = (0..32 * 24).flat_map(pixel).collect();
        let mut hsi = vec![0; rgb.len()];
        Converter::new().convert(&rgb, &mut hsi).unwrap();
        let mut eye = Eye::default();
        let seen = eye.see(&params, &image, &rgb, false).unwrap().unwrap();
        assert!((seen.share - 6.0 / 32.0).abs() < 1e-12, "{seen:?}");
        let converted = eye.see(&params, &Image { encoding: Encoding::Hsi8, ..image }, &hsi, false).unwrap();
        assert_eq!(converted, Some(seen));
    }

    #[test]
    fn a_rough_look_finds_the_same_to_two_pixels() {
        let params = TrackerParams::default();
        let mut eye = Eye::default();
        let pixel = 1.0 / 32.0;
        for left in 0..28 {
            let (image, row) = picture(left..left + 4);
            let exact = eye.see(&params, &image, &row, false).unwrap().unwrap();
            let rough = eye.see(&params, &image, &row, true).unwrap().unwrap();
            assert!((exact.bearing - rough.bearing).abs() < 2.2 * pixel, "{left}: {exact:?} {rough:?}");
            assert!((exact.share - rough.share).abs() < 0.02, "{left}: {exact:?} {rough:?}");
        }
        let (image, row) = picture(0..0);
        assert_eq!(eye.see(&params, &image, &row, true).unwrap(), None);
    }

    fn at(millis: i64) -> Time {
        Time::ZERO + Duration::millis(millis)
    }

    #[test]
    fn desire_grows_with_seeing_and_fades_with_seeking() {
        let params = TrackerParams::default();
        let mut hunt = Hunt::default();
        let seen = Some(Sighting { bearing: 0.2, elevation: 0.0, share: 0.01 });
        let mut desires = Vec::new();
        for i in 0..=10 {
            let found = hunt.pursue(&params, seen.filter(|_| i < 5), Head::default(), at(100 * i));
            desires.push((100.0 * found.target.desire).round() as i32);
            assert_eq!(found.target.visible, i < 5);
            let offer = found.offer.unwrap();
            assert!(offer.twist.angular > 0.0, "to the left, also while it is sought");
            assert_eq!(offer.weight, found.target.desire);
        }
        assert_eq!(desires, [0, 33, 67, 100, 100, 98, 96, 94, 92, 90, 88]);
        let given_up =
            (11..80).map(|i| hunt.pursue(&params, None, Head::default(), at(100 * i))).last().unwrap();
        assert!(given_up.offer.is_none() && given_up.target.desire == 0.0);
    }

    #[test]
    fn the_head_is_told_an_angle_nearer_to_the_target() {
        let mut hunt = Hunt::default();
        let head = Head { pan: 0.3, tilt: 0.0 };
        let seen = Some(Sighting { bearing: 0.3, elevation: 0.1, share: 0.01 });
        hunt.pursue(&TrackerParams::default(), seen, head, at(0));
        let found = hunt.pursue(&TrackerParams::default(), seen, head, at(66));
        assert!(found.look.pan < 0.6 && found.look.tilt > 0.0, "{:?}", found.look);
        assert!((found.target.bearing - 0.6).abs() < 1e-12, "the pan is part of the bearing");
    }
}

//! The recogniser: says whether a thing of a colour and a shape is in the picture, and where.
//!
//! ```text
//!  rgb or hsi ─▶ pixels, all or some ─▶ regions of the colour ─▶ the largest of the shape ─▶ sighting
//!  head ──────────────────────────────────────────────────────────────────────────────────▶
//! ```
//!
//! It has two methods: "exact" looks at every pixel, "rough" at every fourth in both directions. What rough is worth is said, with its reason,
//! at [`perception::recognise::Method::quality`].

use perception::colour::ColourRange;
use perception::picture::Size;
use perception::recognise::{Method, Pattern, Recogniser as Finder, Seen};
use perception::target::{Camera, target};
use runtime::{Agent, Fault, Input, Output, Step};
use types::Name;
use types::geometry::wrap;
use types::messages::{Head, Image, Sighting};
use types::params::{ParamValue, Params};
use types::value::{Table, Value};

use crate::shared::form;

/// A range of colours, as a file gives it: `{ hue_from = 350, hue_to = 10, saturation = 0.35, value = 0.12 }`, hues in degrees and going up,
/// the others the least from 0 to 1. What is left out is as in the default, which is red.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourPattern {
    /// Where the hues begin (degrees, 0 to 360).
    pub hue_from: f64,
    /// Where they end, through 0 where that is less (degrees, 0 to 360).
    pub hue_to: f64,
    /// Least saturation (0 to 1).
    pub saturation: f64,
    /// Least intensity (0 to 1).
    pub value: f64,
}

impl Default for ColourPattern {
    fn default() -> ColourPattern {
        let red = ColourRange::default();
        ColourPattern {
            hue_from: 350.0,
            hue_to: 10.0,
            saturation: red.saturation_min,
            value: red.intensity_min,
        }
    }
}

impl ColourPattern {
    pub(crate) fn colours(&self) -> ColourRange {
        ColourRange {
            hue_from: self.hue_from.to_radians(),
            hue_to: self.hue_to.to_radians(),
            saturation_min: self.saturation,
            intensity_min: self.value,
        }
    }

    /// The place of a number, and the most that it may be.
    fn number(&mut self, key: &str) -> Option<(&mut f64, f64)> {
        match key {
            "hue_from" => Some((&mut self.hue_from, 360.0)),
            "hue_to" => Some((&mut self.hue_to, 360.0)),
            "saturation" => Some((&mut self.saturation, 1.0)),
            "value" => Some((&mut self.value, 1.0)),
            _ => None,
        }
    }
}

impl ParamValue for ColourPattern {
    const KIND: &'static str = "a table of \"hue_from\" and \"hue_to\" from 0 to 360 and of \"saturation\" and \"value\" from 0 to 1";

    fn from_value(value: &Value) -> Option<ColourPattern> {
        let mut pattern = ColourPattern::default();
        for row in value.as_table()?.rows() {
            let (place, most) = pattern.number(&row.key)?;
            *place = row.entry.value.as_float().filter(|x| (0.0..=most).contains(x))?;
        }
        Some(pattern)
    }

    fn to_value(&self) -> Value {
        let mut table = Table::new();
        let mut pattern = *self;
        for key in ["hue_from", "hue_to", "saturation", "value"] {
            if let Some((number, _)) = pattern.number(key) {
                table.set(key, Value::Float(*number));
            }
        }
        Value::Table(table)
    }
}

/// What is looked for.
#[derive(Clone, Debug, Params)]
pub struct RecogniserParams {
    /// What it is called in the sightings, as "ball" or "face".
    #[param(default = "thing")]
    pub what: Name,
    /// Its colour, as a table of hues in degrees and least saturation and value: { hue_from = 350, hue_to = 10, saturation = 0.35, value = 0.12 } is the default, a red.
    #[param(default = ColourPattern::default())]
    pub pattern: ColourPattern,
    /// Least area (share of the picture). 0.0005 is a ball of 28 cm at 11 m; what is smaller is a speck.
    #[param(default = 0.0005, min = 0.0, max = 1.0)]
    pub share_min: f64,
    /// How round it is at least (0 to 1): 1 a disc, 0.75 a face, 0.3 a board. 0: any shape is right. Something round half behind another has about 0.5.
    #[param(default = 0.0, min = 0.0, max = 1.0)]
    pub roundness_min: f64,
}

/// Looks for a thing of a colour and a shape in the pictures of a camera, and says where it is and how sure that is.
#[derive(Agent)]
#[agent(methods("exact" = 1.0, "rough" = 0.6))]
pub struct Recogniser {
    /// Pictures as hue, saturation and intensity, where somebody makes them anyway.
    hsi: Input<Image>,
    /// Pictures as the camera takes them. They give the same sighting, and are split without being converted.
    rgb: Input<Image>,
    /// Where the head looks; without it the camera looks ahead.
    head: Input<Head>,
    /// Whether it is in the picture, and where.
    #[port(history = 64, interpreted)]
    sighting: Output<Sighting>,
    params: RecogniserParams,
    eye: Eye,
    /// Where the head looked when it was last heard of.
    looks: Head,
    last: Sighting,
}

/// What the methods are, in the order in which the agent names them.
const METHODS: [Method; 2] = [Method::Exact, Method::Rough];

impl Agent for Recogniser {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.eye.fit(Size::new(320, 240));
        Ok(())
    }

    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(head) = self.head.latest() {
            self.looks = head;
        }
        let Some(picture) = self.rgb.newest().or_else(|| self.hsi.newest()) else { return Ok(()) };
        // Where the head looked when the picture was taken, not where it looks by now.
        let head = self.head.at(picture.header().stamp).map_or(self.looks, |found| found.value());
        let method = METHODS.get(step.method).copied().unwrap_or_default();
        let seen = self.eye.see(&self.params, &picture, picture.row(), method)?;
        self.last = sighting(&self.params, &picture, head, seen, self.last);
        self.sighting.send(self.last);
        Ok(())
    }
}

/// What finds the thing in a picture; made for one size of pictures.
#[derive(Default)]
struct Eye(Option<Finder>);

impl Eye {
    /// Makes room for pictures of this size; nothing when there is already.
    fn fit(&mut self, size: Size) -> &mut Finder {
        if self.0.as_ref().is_some_and(|finder| finder.size() != size) {
            self.0 = None;
        }
        self.0.get_or_insert_with(|| Finder::new(size))
    }

    fn see(
        &mut self,
        params: &RecogniserParams,
        picture: &Image,
        row: &[u8],
        method: Method,
    ) -> Result<Option<Seen>, Fault> {
        const WRONG: Fault = Fault::new(
            "a recogniser needs whole pictures: RGB at \"rgb\", or those of the output \"hsi\" of a camera",
        );
        let (form, size) = form(picture, row).ok_or(WRONG)?;
        let pattern = Pattern {
            colour: params.pattern.colours(),
            share_min: params.share_min,
            roundness_min: params.roundness_min,
        };
        self.fit(size).find(row, form, &pattern, method).map_err(|_| WRONG)
    }
}

/// What is said of a picture; where nothing is seen, with the numbers of the last time.
fn sighting(
    params: &RecogniserParams,
    picture: &Image,
    head: Head,
    seen: Option<Seen>,
    last: Sighting,
) -> Sighting {
    let Some(seen) = seen else {
        return Sighting { what: params.what, visible: false, confidence: 0.0, ..last };
    };
    let size = Size::new(picture.width as usize, picture.height as usize);
    let camera = Camera { size, horizontal_field_of_view: picture.field_of_view.into() };
    let found = target(&seen.blob, &camera);
    Sighting {
        what: params.what,
        bearing: wrap(head.pan + found.bearing),
        elevation: head.tilt + found.elevation,
        share: seen.share,
        confidence: seen.confidence,
        visible: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::Encoding;

    const WIDTH: usize = 320;
    const HEIGHT: usize = 240;

    fn image(encoding: Encoding) -> Image {
        let (width, height) = (WIDTH as u32, HEIGHT as u32);
        Image { width, height, encoding, field_of_view: 1.0, ..Image::default() }
    }

    /// A grey picture with a disc of a colour.
    fn picture(x: f64, y: f64, radius: f64, colour: [u8; 3]) -> Vec<u8> {
        let inside = |i: usize| ((i % WIDTH) as f64 - x).hypot((i / WIDTH) as f64 - y) <= radius;
        (0..WIDTH * HEIGHT).flat_map(|i| if inside(i) { colour } else { [120, 118, 116] }).collect()
    }

    const RED: [u8; 3] = [200, 25, 20];

    fn seen(params: &RecogniserParams, row: &[u8], method: Method) -> Option<Seen> {
        Eye::default().see(params, &image(Encoding::Rgb8), row, method).unwrap()
    }

    #[test]
    fn it_says_what_it_sees_in_the_direction_of_the_head() {
        let params = RecogniserParams { what: "ball".into(), ..RecogniserParams::default() };
        let row = picture(60.0, 119.5, 12.0, RED);
        let head = Head { pan: 0.3, tilt: 0.1 };
        let first = sighting(
            &params,
            &image(Encoding::Rgb8),
            head,
            seen(&params, &row, Method::Exact),
            Sighting::default(),
        );
        // f = 160 / tan(0.5).
        let bearing = 0.3 + ((159.5 - 60.0) / (160.0 / 0.5f64.tan())).atan();
        assert!((first.bearing - bearing).abs() < 1e-3 && (first.elevation - 0.1).abs() < 1e-3, "{first:?}");
        assert!(first.visible && first.what.as_str() == "ball" && first.confidence > 0.9);
        let gone = sighting(&params, &image(Encoding::Rgb8), Head::default(), None, first);
        assert_eq!(gone, Sighting { visible: false, confidence: 0.0, ..first });
    }

    #[test]
    fn the_rough_method_is_exact_but_for_a_block_and_less_sure() {
        let params = RecogniserParams::default();
        for radius in [6.0, 10.0, 25.0] {
            let row = picture(200.7, 80.2, radius, RED);
            let [exact, rough] = METHODS.map(|method| seen(&params, &row, method).unwrap());
            let (dx, dy) = (exact.blob.x - rough.blob.x, exact.blob.y - rough.blob.y);
            assert!(dx.abs() <= 4.0 && dy.abs() <= 4.0, "{radius}: {dx} {dy}");
            assert!(rough.confidence < exact.confidence, "{radius}");
        }
    }

    #[test]
    fn another_pattern_finds_another_thing() {
        let blue = Value::Table({
            let mut table = Table::new();
            table.set("hue_from", Value::Float(200.0));
            table.set("hue_to", Value::Int(250));
            table
        });
        let mut params = RecogniserParams::default();
        let row = picture(100.0, 100.0, 20.0, [30, 60, 200]);
        assert_eq!(seen(&params, &row, Method::Exact), None);
        assert_eq!(params.set("pattern", &blue), Some(Ok(())));
        assert!(seen(&params, &row, Method::Exact).is_some());
        assert_eq!(params.pattern.saturation, 0.35, "what is left out is as before");
        assert_eq!(ColourPattern::from_value(&params.pattern.to_value()), Some(params.pattern));
        for (key, value) in [("hue_from", 400.0), ("value", -0.1), ("hue", 3.0)] {
            let mut table = Table::new();
            table.set(key, Value::Float(value));
            let refused = params.set("pattern", &Value::Table(table)).unwrap().unwrap_err();
            assert!(refused.to_string().contains("\"hue_from\""), "{refused}");
        }
    }

    #[test]
    fn a_picture_of_another_kind_is_a_fault() {
        let mut eye = Eye::default();
        let params = RecogniserParams::default();
        let grey = image(Encoding::Mono8);
        assert!(eye.see(&params, &grey, &vec![0; grey.len()], Method::Exact).is_err());
        assert!(eye.see(&params, &image(Encoding::Rgb8), &[0; 12], Method::Exact).is_err());
    }
}

//! The camera agent: a picture becomes what others look for in it, and only what somebody listens to.
//!
//! ```text
//!            ┌─▶ rgb (a copy)
//!  image ────┼─▶ hsi
//!  (robot)   └─▶ intensity ─┬─▶ edges
//!                           └─▶ motion (against the picture before)
//! ```

use perception::colour::Converter;
use perception::edges::sobel;
use perception::motion::{self, MotionParams};
use perception::picture::Size;
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::Message;
use types::messages::{Encoding, Image};
use types::params::Params;

/// Bytes of the largest coloured picture: 640 × 480.
pub const BYTES_MAX: usize = 640 * 480 * 3;

/// What counts as a change.
#[derive(Clone, Debug, Params)]
pub struct CameraParams {
    /// Least difference of intensity of a pixel that has changed (steps of a byte). 24 is three standard deviations of the noise of a web camera.
    #[param(default = 24u8, min = 1, max = 255)]
    pub difference_min: u8,
}

/// What has changed between two pictures. It speaks of the robot's surroundings only while robot and head stand still.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct PictureMotion {
    /// Share of the pixels that have changed, from 0 to 1.
    pub share: f64,
    /// Where the middle of the change is: from −1 (left edge) to 1 (right edge).
    pub x: f64,
    /// From −1 (lower edge) to 1 (upper edge).
    pub y: f64,
}

/// Gives pictures as hue, saturation and intensity, their edges, and what moves in them; each only while somebody listens.
#[derive(Agent)]
pub struct Camera {
    /// Pictures of the robot's camera.
    #[robot("image")]
    image: Input<Image>,
    /// The pictures as they are. It costs a copy: who needs nothing else listens to the robot's own port.
    #[port(rows = BYTES_MAX, raw)]
    rgb: Output<Image>,
    /// Hue, saturation and intensity.
    #[port(rows = BYTES_MAX, filtered)]
    hsi: Output<Image>,
    /// How strong the change of intensity is at each pixel.
    #[port(rows = BYTES_MAX / 3, filtered)]
    edges: Output<Image>,
    /// What has changed since the picture before.
    #[port(interpreted)]
    motion: Output<PictureMotion>,
    params: CameraParams,
    /// Made when the agent starts: its tables take some milliseconds, which nobody shall spend who only asks for the ports.
    converter: Option<Converter>,
    darkroom: Darkroom,
}

impl Agent for Camera {
    fn start(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.darkroom.fit(BYTES_MAX / 3);
        self.converter.get_or_insert_default();
        Ok(())
    }

    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        const WRONG: Fault = Fault::new("the camera agent needs whole RGB pictures of at most 640 × 480");
        let Some(picture) = self.image.newest() else { return Ok(()) };
        let (image, row) = (*picture, picture.row());
        if image.encoding != Encoding::Rgb8
            || row.len() != image.len()
            || row.is_empty()
            || row.len() > BYTES_MAX
        {
            return Err(WRONG);
        }
        let envelope = Envelope { stamp: Some(picture.header().stamp), ..Envelope::default() };
        if self.rgb.has_listeners() {
            self.rgb.fill_as(envelope, |head, room| {
                *head = image;
                room[..row.len()].copy_from_slice(row);
                row.len()
            });
        }
        let mut done = Ok(());
        if let Some(converter) = &self.converter
            && self.hsi.has_listeners()
        {
            self.hsi.fill_as(envelope, |head, room| {
                *head = Image { encoding: Encoding::Hsi8, ..image };
                done = converter.convert(row, &mut room[..row.len()]);
                row.len()
            });
        }
        let (edges, moves) = (self.edges.has_listeners(), self.motion.has_listeners());
        if !edges && !moves {
            self.darkroom.forget();
            return done.map_err(|_| WRONG);
        }
        let size = Size::new(image.width as usize, image.height as usize);
        self.darkroom.develop(row, size);
        if edges {
            self.edges.fill_as(envelope, |head, room| {
                *head = Image { encoding: Encoding::Mono8, ..image };
                done = done.and(sobel(self.darkroom.now(), size, &mut room[..size.pixels()]));
                size.pixels()
            });
        }
        if moves && let Some(found) = self.darkroom.motion(&self.params).map_err(|_| WRONG)? {
            self.motion.send_as(envelope, found);
        }
        done.map_err(|_| WRONG)
    }
}

/// The intensities of this picture and of the one before.
#[derive(Default)]
struct Darkroom {
    pictures: [Vec<u8>; 2],
    mask: Vec<u8>,
    /// Which of the two is this one.
    newer: usize,
    /// The sizes of both, where they hold a picture.
    sizes: [Option<Size>; 2],
}

impl Darkroom {
    /// Makes room, before the first picture comes.
    fn fit(&mut self, pixels: usize) {
        self.pictures.iter_mut().chain([&mut self.mask]).for_each(|buffer| buffer.resize(pixels, 0));
    }

    fn forget(&mut self) {
        self.sizes = [None; 2];
    }

    /// Takes over the intensities of a coloured picture: the rounded mean of the three channels.
    fn develop(&mut self, rgb: &[u8], size: Size) {
        self.newer = 1 - self.newer;
        self.sizes[self.newer] = Some(size);
        for (pixel, out) in rgb.as_chunks::<3>().0.iter().zip(&mut self.pictures[self.newer]) {
            let sum: u16 = pixel.iter().map(|channel| u16::from(*channel)).sum();
            *out = ((sum + 1) / 3) as u8;
        }
    }

    fn now(&self) -> &[u8] {
        let pixels = self.sizes[self.newer].map_or(0, Size::pixels);
        &self.pictures[self.newer][..pixels]
    }

    /// What has changed; nothing without a picture of the same size before.
    fn motion(&mut self, params: &CameraParams) -> Result<Option<PictureMotion>, perception::WrongLength> {
        let [Some(size), before] = [self.sizes[self.newer], self.sizes[1 - self.newer]] else {
            return Ok(None);
        };
        if before != Some(size) {
            return Ok(None);
        }
        let pixels = size.pixels();
        let (before, now) = (&self.pictures[1 - self.newer][..pixels], &self.pictures[self.newer][..pixels]);
        let params = MotionParams { difference_min: params.difference_min };
        let found = motion::motion(before, now, size, &params, &mut self.mask[..pixels])?;
        // The edges of the picture are half a pixel beyond the centres of the outermost ones.
        let from_middle = |at: f64, length: usize| (2.0 * at + 1.0) / length as f64 - 1.0;
        let (x, y) = found
            .centre
            .map_or((0.0, 0.0), |(x, y)| (from_middle(x, size.width), -from_middle(y, size.height)));
        Ok(Some(PictureMotion { share: f64::from(found.changed) / pixels as f64, x, y }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dark picture of 8 × 4 with one bright pixel.
    fn picture(bright: usize) -> Vec<u8> {
        (0..32).flat_map(|i| if i == bright { [250, 200, 151] } else { [10, 10, 10] }).collect()
    }

    #[test]
    fn a_change_is_found_where_it_is_once_there_is_a_picture_before() {
        let size = Size::new(8, 4);
        let mut room = Darkroom::default();
        room.fit(32);
        room.develop(&picture(99), size);
        assert_eq!(room.motion(&CameraParams::default()).unwrap(), None);
        room.develop(&picture(7), size);
        assert_eq!(room.now()[7], 200, "601 / 3, rounded");
        // The upper right pixel: its centre is an eighth of half the width inside the right edge.
        let expect = PictureMotion { share: 1.0 / 32.0, x: 0.875, y: 0.75 };
        assert_eq!(room.motion(&CameraParams::default()).unwrap(), Some(expect));
        room.forget();
        room.develop(&picture(7), size);
        assert_eq!(room.motion(&CameraParams::default()).unwrap(), None, "nobody listened meanwhile");
    }

    #[test]
    fn pictures_of_another_size_are_not_compared() {
        let mut room = Darkroom::default();
        room.fit(32);
        room.develop(&picture(1), Size::new(8, 4));
        room.develop(&picture(1), Size::new(4, 8));
        assert_eq!(room.motion(&CameraParams::default()).unwrap(), None);
    }
}

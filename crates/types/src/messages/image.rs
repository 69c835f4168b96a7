//! Pictures.

use alloc::vec::Vec;

use crate::cdr::{Error, Reader, Writer};
use crate::definition::{Definition, Kind};
use crate::message::{Message, ros};
use crate::text::Name;
use crate::time::Time;

/// What the bytes of a picture mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Encoding {
    /// Red, green, blue, a byte each.
    #[default]
    Rgb8 = 0,
    /// One byte: how bright.
    Mono8 = 1,
    /// Hue (256 steps to the full circle), saturation, intensity, a byte each.
    Hsi8 = 2,
}

impl Encoding {
    /// Bytes of a pixel.
    pub const fn bytes(self) -> usize {
        match self {
            Encoding::Rgb8 | Encoding::Hsi8 => 3,
            Encoding::Mono8 => 1,
        }
    }

    /// Its name to ROS 2, which has no name for HSI.
    pub const fn ros(self) -> &'static str {
        match self {
            Encoding::Rgb8 => "rgb8",
            Encoding::Mono8 => "mono8",
            Encoding::Hsi8 => "8UC3",
        }
    }
}

/// A picture: the bytes, row by row from the upper left, are the row behind it; to ROS 2 a `sensor_msgs/Image`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Image {
    /// The frame of the camera.
    pub frame: Name,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What the bytes mean.
    pub encoding: Encoding,
    /// Opening of the view from side to side (rad).
    pub field_of_view: f32,
}

impl Image {
    /// Bytes that a picture of this form has.
    pub const fn len(&self) -> usize {
        self.width as usize * self.height as usize * self.encoding.bytes()
    }

    /// Whether it has no pixels.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Message for Image {
    type Element = u8;
    const NAME: &'static str = "sensor_msgs/msg/Image";

    fn definition() -> Definition {
        Definition::new(
            Self::NAME,
            [
                ("header", Kind::Struct(ros::header())),
                ("height", Kind::U32),
                ("width", Kind::U32),
                ("encoding", Kind::String),
                ("is_bigendian", Kind::U8),
                ("step", Kind::U32),
                ("data", Kind::Sequence(Kind::U8.into())),
            ],
        )
    }

    fn encode(&self, row: &[u8], stamp: Time, out: &mut Writer) {
        out.header(stamp, self.frame.as_str());
        out.put(self.height).put(self.width).text(self.encoding.ros());
        // A width from elsewhere may be any number; no picture is so wide that this changes it.
        out.put(0u8).put(self.width.saturating_mul(self.encoding.bytes() as u32)).row(row);
    }

    /// The opening of the view is not part of a `sensor_msgs/Image`: it comes back as zero.
    fn decode(input: &mut Reader<'_>, row: &mut Vec<u8>) -> Result<Image, Error> {
        let (_, frame) = input.header()?;
        let frame = Name::new(frame);
        let (height, width) = (input.get()?, input.get()?);
        let at = input.offset();
        let name = input.text()?;
        let encoding =
            [Encoding::Rgb8, Encoding::Mono8, Encoding::Hsi8].into_iter().find(|e| e.ros() == name);
        let (_big_endian, _step): (u8, u32) = (input.get()?, input.get()?);
        input.row(row)?;
        Ok(Image {
            frame,
            width,
            height,
            encoding: encoding.ok_or(Error::NoSuchValue(at))?,
            field_of_view: 0.0,
        })
    }

    /// Pixels are no measured numbers to CDR, so they are spoilt here: noise all over, or a picture that is too dark.
    fn disturb(&mut self, row: &mut [u8], wild: bool, draw: &mut dyn FnMut() -> f64) {
        for pixel in row {
            *pixel = if wild { (draw() * 256.0) as u8 } else { *pixel / 3 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_that_no_picture_has_overflows_nothing() {
        let wide = Image { width: u32::MAX, ..Image::default() };
        let mut out = Writer::new();
        wide.encode(&[], Time::ZERO, &mut out);
        let again = Image::decode(&mut Reader::new(out.bytes()).unwrap(), &mut Vec::new());
        assert_eq!(again.map(|image| image.width), Ok(u32::MAX));
    }
}

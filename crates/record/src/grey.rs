//! Grey pictures in files, as maps are drawn in them: PNG and PGM.

use std::io::Cursor;

use png::{BitDepth, ColorType, Decoder, Limits, Transformations};

/// More pixels than this are no map (2²⁸).
const MOST: u64 = 1 << 28;

/// A picture of 8 bits a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grey {
    /// Pixels in a row, at least one.
    pub width: u32,
    /// Rows, at least one.
    pub height: u32,
    /// `width × height` pixels from the upper left, 0 is black.
    pub pixels: Vec<u8>,
}

/// Why bytes are no picture.
#[derive(Debug, thiserror::Error)]
pub enum GreyError {
    /// They begin as neither PNG nor PGM do.
    #[error("it is neither PNG nor PGM")]
    Form,
    /// The PNG is damaged, or too large.
    #[error("the PNG cannot be read: {0}")]
    Png(#[from] png::DecodingError),
    /// The PGM is not as it must be.
    #[error("the PGM cannot be read: {0}")]
    Pgm(&'static str),
    /// It has no pixels, or too many.
    #[error("a picture of {width} × {height} pixels cannot be read: it needs 1 to {MOST}")]
    Size {
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

impl Grey {
    /// Reads a PNG of any colours, whose grey is the mean of red, green and blue, or a PGM of up to 8 bits. What is transparent
    /// counts as if it were not.
    ///
    /// # Errors
    /// When the bytes are no such picture.
    pub fn read(bytes: &[u8]) -> Result<Grey, GreyError> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => read_png(bytes),
            [b'P', b'2' | b'5', ..] => read_pgm(bytes),
            _ => Err(GreyError::Form),
        }
    }

    /// The bytes of a PGM file.
    pub fn to_pgm(&self) -> Vec<u8> {
        let mut out = format!("P5\n{} {}\n255\n", self.width, self.height).into_bytes();
        out.extend_from_slice(&self.pixels);
        out
    }
}

fn check_size(width: u32, height: u32) -> Result<usize, GreyError> {
    let pixels = u64::from(width) * u64::from(height);
    if (1..=MOST).contains(&pixels) { Ok(pixels as usize) } else { Err(GreyError::Size { width, height }) }
}

fn read_png(bytes: &[u8]) -> Result<Grey, GreyError> {
    // Four channels of two bytes each at most.
    let limits = Limits { bytes: 8 * MOST as usize };
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    check_size(width, height)?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or(GreyError::Size { width, height })?];
    let frame = reader.next_frame(&mut pixels)?;
    debug_assert_eq!(frame.bit_depth, BitDepth::Eight);
    pixels.truncate(frame.buffer_size());
    let mean =
        |pixel: &[u8]| ((u16::from(pixel[0]) + u16::from(pixel[1]) + u16::from(pixel[2]) + 1) / 3) as u8;
    let pixels = match frame.color_type {
        ColorType::Grayscale | ColorType::Indexed => pixels,
        ColorType::GrayscaleAlpha => pixels.chunks_exact(2).map(|pixel| pixel[0]).collect(),
        ColorType::Rgb => pixels.chunks_exact(3).map(mean).collect(),
        ColorType::Rgba => pixels.chunks_exact(4).map(mean).collect(),
    };
    Ok(Grey { width, height, pixels })
}

fn read_pgm(bytes: &[u8]) -> Result<Grey, GreyError> {
    let plain = bytes[1] == b'2';
    let mut rest = &bytes[2..];
    let short = GreyError::Pgm("its head is cut short");
    let Some([width, height, most]) =
        number(&mut rest).and_then(|width| Some([width, number(&mut rest)?, number(&mut rest)?]))
    else {
        return Err(short);
    };
    if !(1..=255).contains(&most) {
        return Err(GreyError::Pgm("its pixels have more than 8 bits"));
    }
    let count = check_size(width, height)?;
    let cut = GreyError::Pgm("it has fewer pixels than it says");
    let mut pixels: Vec<u8> = if plain {
        let mut pixels = Vec::new();
        for _ in 0..count {
            let Some(pixel) = number(&mut rest) else { return Err(cut) };
            pixels.push(pixel.min(most) as u8);
        }
        pixels
    } else {
        // One blank ends the head.
        let Some(pixels) = rest.get(1..).and_then(|rest| rest.get(..count)) else { return Err(cut) };
        pixels.to_vec()
    };
    if most < 255 {
        let scale = |pixel: u8| (u32::from(pixel).min(most) * 255 + most / 2) / most;
        pixels.iter_mut().for_each(|pixel| *pixel = scale(*pixel) as u8);
    }
    Ok(Grey { width, height, pixels })
}

/// The next number of a head, behind blanks and comments.
fn number(rest: &mut &[u8]) -> Option<u32> {
    loop {
        match rest.first()? {
            b'#' => {
                let line = rest.iter().position(|&byte| byte == b'\n')?;
                *rest = &rest[line..];
            }
            byte if byte.is_ascii_whitespace() => *rest = &rest[1..],
            _ => break,
        }
    }
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let (number, behind) = rest.split_at(digits);
    *rest = behind;
    std::str::from_utf8(number).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn grey(width: u32, height: u32, pixels: &[u8]) -> Grey {
        Grey { width, height, pixels: pixels.to_vec() }
    }

    fn png(colour: ColorType, pixels: &[u8]) -> Vec<u8> {
        crate::picture::encode(2, 1, colour, png::Compression::Fast, pixels).unwrap()
    }

    #[test]
    fn a_map_is_read_from_any_of_its_forms() {
        for (bytes, pixels) in [
            (b"P5 2 1 255\n\x00\xff".to_vec(), [0, 255]),
            (b"P5\n# a map\n2 1\n1\n\x00\x01".to_vec(), [0, 255]),
            (b"P2\n2 1\n255\n 7\n254 ".to_vec(), [7, 254]),
            (png(ColorType::Grayscale, &[3, 205]), [3, 205]),
            (png(ColorType::GrayscaleAlpha, &[3, 0, 205, 255]), [3, 205]),
            (png(ColorType::Rgb, &[1, 2, 3, 255, 255, 255]), [2, 255]),
            (png(ColorType::Rgba, &[1, 2, 3, 9, 0, 0, 3, 9]), [2, 1]),
        ] {
            assert_eq!(Grey::read(&bytes).unwrap(), grey(2, 1, &pixels), "{:?}", &bytes[..2]);
        }
    }

    #[test]
    fn what_is_no_picture_is_told() {
        for (bytes, said) in [
            (b"".to_vec(), "it is neither PNG nor PGM"),
            (b"P6 1 1 255\n123".to_vec(), "it is neither PNG nor PGM"),
            (b"P5 2".to_vec(), "the PGM cannot be read: its head is cut short"),
            (b"P5 2 2 255\n123".to_vec(), "the PGM cannot be read: it has fewer pixels than it says"),
            (b"P5 2 2 65535\n12341234".to_vec(), "the PGM cannot be read: its pixels have more than 8 bits"),
            (b"P5 0 2 255\n".to_vec(), "a picture of 0 × 2 pixels cannot be read: it needs 1 to 268435456"),
            (b"P5 4000000000 4000000000 255\n".to_vec(), "a picture of 4000000000 × 4000000000"),
        ] {
            let error = Grey::read(&bytes).unwrap_err().to_string();
            assert!(error.starts_with(said), "{error}");
        }
        let whole = png(ColorType::Grayscale, &[3, 205]);
        assert!(matches!(Grey::read(&whole[..whole.len() - 20]), Err(GreyError::Png(_))));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(pixels in prop::collection::vec(any::<u8>(), 1..50)) {
            let grey = grey(pixels.len() as u32, 1, &pixels);
            prop_assert_eq!(Grey::read(&grey.to_pgm()).unwrap(), grey);
        }

        #[test]
        fn any_bytes_are_read_or_refused(head in "P[25][ 0-9#\n]{0,20}", bytes in prop::collection::vec(any::<u8>(), 0..50)) {
            let _ = Grey::read(&[head.as_bytes(), &bytes].concat());
        }
    }
}

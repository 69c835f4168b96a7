//! The size of a picture, and the one way in which a buffer can be wrong.

use core::fmt;

/// Width and height of a picture in pixels. Pictures are stored row by row, the top row first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// A buffer does not have the length that the picture or the ring of sensors asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrongLength {
    /// Which buffer it is.
    pub buffer: &'static str,
    /// Elements it must have.
    pub expected: usize,
    /// Elements it has.
    pub got: usize,
}

impl Size {
    /// A picture of `width` × `height` pixels.
    pub const fn new(width: usize, height: usize) -> Size {
        Size { width, height }
    }

    /// Pixels in the picture.
    pub const fn pixels(self) -> usize {
        self.width * self.height
    }
}

impl fmt::Display for WrongLength {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the buffer `{}` has {} elements and must have {}", self.buffer, self.got, self.expected)
    }
}

impl core::error::Error for WrongLength {}

/// Refuses a buffer of the wrong length before any of it is read or written.
pub(crate) fn check(buffer: &'static str, got: usize, expected: usize) -> Result<(), WrongLength> {
    if got == expected { Ok(()) } else { Err(WrongLength { buffer, expected, got }) }
}

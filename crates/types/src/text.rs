//! Texts and rows of values with their capacity in the type: plain data that a message may hold.

use core::fmt;
use core::ops::{Deref, DerefMut};

/// A text of at most `N` bytes, held in place.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(C)]
pub struct Text<const N: usize> {
    len: u8,
    bytes: [u8; N],
}

/// The name of an agent, a robot or a frame.
pub type Name = Text<23>;

impl<const N: usize> Text<N> {
    /// The empty text.
    pub const EMPTY: Text<N> = Text { len: 0, bytes: [0; N] };

    /// As much of `text` as has room, cut between characters.
    pub fn new(text: &str) -> Text<N> {
        let mut end = text.len().min(N).min(255);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; N];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Text { len: end as u8, bytes }
    }

    /// As much of what is to be written as has room, without memory of its own: `Text::format(format_args!("{x} m"))`.
    pub fn format(what: fmt::Arguments<'_>) -> Text<N> {
        let mut text = Text::EMPTY;
        // Writing into a text cannot fail: what has no room is cut.
        let _ = fmt::Write::write_fmt(&mut text, what);
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        core::str::from_utf8(&self.bytes[..usize::from(self.len)]).unwrap_or_default()
    }

    /// Whether there is no text.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
}

/// Adds as much as has room.
impl<const N: usize> fmt::Write for Text<N> {
    fn write_str(&mut self, more: &str) -> fmt::Result {
        let at = usize::from(self.len);
        let mut end = more.len().min(N.min(255) - at);
        while !more.is_char_boundary(end) {
            end -= 1;
        }
        self.bytes[at..at + end].copy_from_slice(&more.as_bytes()[..end]);
        self.len += end as u8;
        Ok(())
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Text<N> {
        Text::EMPTY
    }
}

impl<const N: usize> From<&str> for Text<N> {
    fn from(text: &str) -> Text<N> {
        Text::new(text)
    }
}

impl<const N: usize> fmt::Display for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// A row of at most `N` values, held in place.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Sequence<T, const N: usize> {
    len: u32,
    items: [T; N],
}

impl<T: Copy + Default, const N: usize> Sequence<T, N> {
    /// An empty row.
    pub fn new() -> Sequence<T, N> {
        Sequence { len: 0, items: [T::default(); N] }
    }

    /// Adds a value at the end; gives it back when the row is full.
    pub fn push(&mut self, item: T) -> Result<(), T> {
        match self.items.get_mut(self.len as usize) {
            Some(place) => {
                *place = item;
                self.len += 1;
                Ok(())
            }
            None => Err(item),
        }
    }

    /// Makes the row `len` values long (at most `N`); new values are the default ones.
    pub fn resize(&mut self, len: usize) {
        let len = len.min(N);
        for item in &mut self.items[(self.len as usize).min(len)..len] {
            *item = T::default();
        }
        self.len = len as u32;
    }

    /// Empties the row.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// How many values have room.
    pub const fn capacity(&self) -> usize {
        N
    }
}

impl<T: Copy + Default, const N: usize> Default for Sequence<T, N> {
    fn default() -> Self {
        Sequence::new()
    }
}

impl<T, const N: usize> Deref for Sequence<T, N> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        &self.items[..(self.len as usize).min(N)]
    }
}

impl<T, const N: usize> DerefMut for Sequence<T, N> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.items[..(self.len as usize).min(N)]
    }
}

impl<T: Copy + Default, const N: usize> FromIterator<T> for Sequence<T, N> {
    /// The first `N` values.
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        let mut row = Sequence::new();
        for item in items.into_iter().take(N) {
            let _ = row.push(item);
        }
        row
    }
}

impl<T: fmt::Debug, const N: usize> fmt::Debug for Sequence<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

impl<T: PartialEq, const N: usize> PartialEq for Sequence<T, N> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_between_characters() {
        assert_eq!(Text::<4>::new("köln").as_str(), "köl");
        assert_eq!(Text::<2>::new("kö").as_str(), "k");
        assert_eq!(Name::new("wall").as_str(), "wall");
        assert_eq!(Text::<6>::format(format_args!("{} {}", 12, "köln")).as_str(), "12 kö");
        assert_eq!(Text::<3>::format(format_args!("{} {}", 12, "köln")).as_str(), "12 ");
    }

    #[test]
    fn a_full_row_gives_the_value_back() {
        let mut row: Sequence<u8, 2> = [1, 2, 3].into_iter().collect();
        assert_eq!(row.push(4), Err(4));
        assert_eq!(*row, [1, 2]);
        row.resize(1);
        row.resize(2);
        assert_eq!(*row, [1, 0]);
    }
}

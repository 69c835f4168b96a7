//! Common Data Representation as ROS 2 uses it: little-endian, each number aligned to its size (OMG DDS-XTYPES, XCDR1).

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use crate::definition::Kind;
use crate::text::{Sequence, Text};
use crate::time::{Duration, Time};

/// The four bytes in front of every message: plain CDR, little-endian.
pub const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

/// Writes values behind each other into a buffer.
#[derive(Debug, Default)]
pub struct Writer {
    bytes: Vec<u8>,
}

/// Reads what a [`Writer`], or any ROS 2 program, wrote.
#[derive(Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
}

/// The bytes are not what was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// They end too early: this many more were needed at this offset.
    Short {
        /// Offset of the value.
        at: usize,
        /// Its size.
        needed: usize,
    },
    /// The first four bytes name another encoding.
    Encapsulation([u8; 2]),
    /// A text is not UTF-8, or does not end with a zero.
    NoText(usize),
    /// A row or text is longer than has room.
    TooLong {
        /// Offset of its length.
        at: usize,
        /// Its length.
        len: usize,
        /// What has room.
        room: usize,
    },
    /// A number stands for nothing.
    NoSuchValue(usize),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Short { at, needed } => {
                write!(f, "the message ends early: {needed} more bytes are needed at byte {at}")
            }
            Error::Encapsulation(found) => {
                write!(f, "the encoding {:02x}{:02x} is not plain CDR (0001 or 0000)", found[0], found[1])
            }
            Error::NoText(at) => write!(f, "the text at byte {at} is not UTF-8 that ends with a zero"),
            Error::TooLong { at, len, room } => {
                write!(f, "the row at byte {at} has {len} values, there is room for {room}")
            }
            Error::NoSuchValue(at) => write!(f, "the number at byte {at} stands for nothing"),
        }
    }
}

impl core::error::Error for Error {}

/// A value that can stand in a message.
pub trait Field: Sized {
    /// Its type to other programs.
    fn kind() -> Kind;
    /// Writes it.
    fn write(&self, out: &mut Writer);
    /// Reads it.
    fn read(input: &mut Reader<'_>) -> Result<Self, Error>;
    /// Spoils the numbers in it, to see who notices: `wild` ones are far out or none at all, others look right. `draw` gives
    /// numbers from 0 to 1. What is no measured number stays as it is.
    fn disturb(&mut self, wild: bool, draw: &mut dyn FnMut() -> f64) {
        let _ = (wild, draw);
    }
}

/// A spoilt number in place of `x`.
fn spoilt(x: f64, wild: bool, draw: &mut dyn FnMut() -> f64) -> f64 {
    let chance = draw();
    match (wild, (chance * 4.0) as u32) {
        (false, _) => x * (0.5 + chance) + 0.1 * (draw() - 0.5),
        (true, 0) => f64::NAN,
        (true, 1) => f64::INFINITY,
        (true, 2) => -1e6 * draw(),
        (true, _) => 1e6 * draw(),
    }
}

impl Writer {
    /// Begins a message: the four bytes that name the encoding.
    pub fn new() -> Writer {
        let mut writer = Writer::default();
        writer.clear();
        writer
    }

    /// Begins the next message in the same buffer.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.bytes.extend_from_slice(&ENCAPSULATION);
    }

    /// What was written, from the four bytes on.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Fills up to a multiple of `size`, counted from behind the first four bytes.
    pub fn align(&mut self, size: usize) {
        let behind = self.bytes.len() - ENCAPSULATION.len();
        self.bytes.resize(self.bytes.len() + behind.next_multiple_of(size) - behind, 0);
    }

    /// Writes a text: its length with the closing zero, its bytes, the zero.
    pub fn text(&mut self, text: &str) {
        (text.len() as u32 + 1).write(self);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    /// Writes a counted row.
    pub fn row<T: Element>(&mut self, row: &[T]) {
        (row.len() as u32).write(self);
        T::write_all(row, self);
    }

    /// Writes a value: for chains of them.
    pub fn put<T: Field>(&mut self, value: T) -> &mut Writer {
        value.write(self);
        self
    }

    /// Writes `n` zero bytes behind an alignment to 8: the doubles that a planar robot does not know.
    pub fn zeros_f64(&mut self, n: usize) {
        for _ in 0..n {
            0f64.write(self);
        }
    }

    /// Writes a time as ROS 2's `builtin_interfaces/Time`.
    pub fn time(&mut self, time: Time) {
        let (sec, nanosec) = split(time.0);
        sec.write(self);
        nanosec.write(self);
    }

    /// Writes a `std_msgs/Header`.
    pub fn header(&mut self, stamp: Time, frame: &str) {
        self.time(stamp);
        self.text(frame);
    }
}

/// Whole seconds, rounded down, and the nanoseconds that are left.
fn split(nanos: i64) -> (i32, u32) {
    (nanos.div_euclid(1_000_000_000) as i32, nanos.rem_euclid(1_000_000_000) as u32)
}

impl<'a> Reader<'a> {
    /// Begins to read a message; refuses what is not plain CDR.
    pub fn new(bytes: &'a [u8]) -> Result<Reader<'a>, Error> {
        match bytes {
            [0, order @ (0 | 1), _, _, ..] => {
                Ok(Reader { bytes, at: ENCAPSULATION.len(), big_endian: *order == 0 })
            }
            [a, b, _, _, ..] => Err(Error::Encapsulation([*a, *b])),
            _ => Err(Error::Short { at: 0, needed: ENCAPSULATION.len() - bytes.len() }),
        }
    }

    fn take(&mut self, n: usize) -> Result<&'a [u8], Error> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let short = Error::Short { at: self.at, needed: n.saturating_sub(rest.len()) };
        let taken = rest.get(..n).ok_or(short)?;
        self.at += n;
        Ok(taken)
    }

    fn align(&mut self, size: usize) {
        self.at = (self.at - ENCAPSULATION.len()).next_multiple_of(size) + ENCAPSULATION.len();
    }

    /// Reads a text.
    pub fn text(&mut self) -> Result<&'a str, Error> {
        let at = self.at;
        let len = u32::read(self)? as usize;
        let bytes = self.take(len)?;
        let (last, text) = bytes.split_last().ok_or(Error::NoText(at))?;
        let text = core::str::from_utf8(text).map_err(|_| Error::NoText(at))?;
        if *last == 0 { Ok(text) } else { Err(Error::NoText(at)) }
    }

    /// Reads the length of a row, of which there can be no more than bytes are left.
    pub fn len(&mut self, size_of_element: usize) -> Result<usize, Error> {
        let len = u32::read(self)? as usize;
        let room = self.bytes.len().saturating_sub(self.at);
        let needed = len.saturating_mul(size_of_element.max(1));
        if needed > room { Err(Error::Short { at: self.at, needed: needed - room }) } else { Ok(len) }
    }

    /// Reads a counted row to the end of `into`.
    pub fn row<T: Element>(&mut self, into: &mut Vec<T>) -> Result<(), Error> {
        let len = self.len(core::mem::size_of::<T>())?;
        into.reserve(len);
        for _ in 0..len {
            into.push(T::read(self)?);
        }
        Ok(())
    }

    /// Reads a value.
    pub fn get<T: Field>(&mut self) -> Result<T, Error> {
        T::read(self)
    }

    /// Passes over `n` doubles.
    pub fn skip_f64(&mut self, n: usize) -> Result<(), Error> {
        for _ in 0..n {
            f64::read(self)?;
        }
        Ok(())
    }

    /// Reads a `builtin_interfaces/Time`.
    pub fn time(&mut self) -> Result<Time, Error> {
        let sec = i32::read(self)?;
        let nanosec = u32::read(self)?;
        Ok(Time(i64::from(sec) * 1_000_000_000 + i64::from(nanosec)))
    }

    /// Reads a `std_msgs/Header`: the stamp and the frame.
    pub fn header(&mut self) -> Result<(Time, &'a str), Error> {
        Ok((self.time()?, self.text()?))
    }

    /// The offset of the next byte.
    pub fn offset(&self) -> usize {
        self.at
    }
}

/// A plain number: what a long row is made of.
pub trait Element: Field + Copy + Default + Send + Sync + core::fmt::Debug + 'static {
    /// Writes a whole row of them without its length.
    fn write_all(row: &[Self], out: &mut Writer) {
        for value in row {
            value.write(out);
        }
    }
}

macro_rules! number {
    ($($t:ty => $kind:ident),*) => { $( number! { @ $t => $kind; } )* };
    (@ $t:ty => $kind:ident; $($disturb:item)?) => {
        impl Field for $t {
            fn kind() -> Kind {
                Kind::$kind
            }
            fn write(&self, out: &mut Writer) {
                out.align(size_of::<$t>());
                out.bytes.extend_from_slice(&self.to_le_bytes());
            }
            fn read(input: &mut Reader<'_>) -> Result<$t, Error> {
                input.align(size_of::<$t>());
                let mut bytes = [0; size_of::<$t>()];
                bytes.copy_from_slice(input.take(size_of::<$t>())?);
                Ok(if input.big_endian { <$t>::from_be_bytes(bytes) } else { <$t>::from_le_bytes(bytes) })
            }
            $($disturb)?
        }
    };
}

number! { u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, u64 => U64, i64 => I64 }

macro_rules! measured {
    ($($t:ty => $kind:ident),*) => { $(
        number! { @ $t => $kind;
            fn disturb(&mut self, wild: bool, draw: &mut dyn FnMut() -> f64) {
                *self = spoilt(f64::from(*self), wild, draw) as $t;
            }
        }
    )* };
}

measured! { f32 => F32, f64 => F64 }

impl Element for f32 {}
impl Element for f64 {}
impl Element for u16 {}
impl Element for u8 {
    fn write_all(row: &[u8], out: &mut Writer) {
        out.bytes.extend_from_slice(row);
    }
}

/// The element of a message that has no long row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoElement;

/// The row that is not there.
pub type NoRow = Vec<NoElement>;

impl Field for NoElement {
    fn kind() -> Kind {
        Kind::U8
    }
    fn write(&self, _: &mut Writer) {}
    fn read(_: &mut Reader<'_>) -> Result<NoElement, Error> {
        Ok(NoElement)
    }
}

impl Element for NoElement {}

impl Field for bool {
    fn kind() -> Kind {
        Kind::Bool
    }
    fn write(&self, out: &mut Writer) {
        u8::from(*self).write(out);
    }
    fn read(input: &mut Reader<'_>) -> Result<bool, Error> {
        Ok(u8::read(input)? != 0)
    }
}

impl<const N: usize> Field for Text<N> {
    fn kind() -> Kind {
        Kind::String
    }
    fn write(&self, out: &mut Writer) {
        out.text(self.as_str());
    }
    fn read(input: &mut Reader<'_>) -> Result<Text<N>, Error> {
        let at = input.at;
        let text = input.text()?;
        if text.len() > N {
            Err(Error::TooLong { at, len: text.len(), room: N })
        } else {
            Ok(Text::new(text))
        }
    }
}

impl Field for String {
    fn kind() -> Kind {
        Kind::String
    }
    fn write(&self, out: &mut Writer) {
        out.text(self);
    }
    fn read(input: &mut Reader<'_>) -> Result<String, Error> {
        Ok(input.text()?.into())
    }
}

impl<T: Field + Copy + Default, const N: usize> Field for Sequence<T, N> {
    fn kind() -> Kind {
        Kind::Sequence(T::kind().into())
    }
    fn write(&self, out: &mut Writer) {
        (self.len() as u32).write(out);
        for value in self.iter() {
            value.write(out);
        }
    }
    fn read(input: &mut Reader<'_>) -> Result<Sequence<T, N>, Error> {
        let at = input.at;
        let len = input.len(1)?;
        let mut row = Sequence::new();
        for _ in 0..len {
            row.push(T::read(input)?).map_err(|_| Error::TooLong { at, len, room: N })?;
        }
        Ok(row)
    }
    fn disturb(&mut self, wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.iter_mut().for_each(|value| value.disturb(wild, draw));
    }
}

impl<T: Field + Copy + Default, const N: usize> Field for [T; N] {
    fn kind() -> Kind {
        Kind::Array(T::kind().into(), N)
    }
    fn write(&self, out: &mut Writer) {
        for value in self {
            value.write(out);
        }
    }
    fn read(input: &mut Reader<'_>) -> Result<[T; N], Error> {
        let mut row = [T::default(); N];
        for value in &mut row {
            *value = T::read(input)?;
        }
        Ok(row)
    }
    fn disturb(&mut self, wild: bool, draw: &mut dyn FnMut() -> f64) {
        self.iter_mut().for_each(|value| value.disturb(wild, draw));
    }
}

impl Field for Time {
    fn kind() -> Kind {
        Kind::Struct(crate::message::ros::time())
    }
    fn write(&self, out: &mut Writer) {
        out.time(*self);
    }
    fn read(input: &mut Reader<'_>) -> Result<Time, Error> {
        input.time()
    }
}

impl Field for Duration {
    fn kind() -> Kind {
        Kind::Struct(crate::message::ros::duration())
    }
    fn write(&self, out: &mut Writer) {
        out.time(Time(self.0));
    }
    fn read(input: &mut Reader<'_>) -> Result<Duration, Error> {
        Ok(Duration(input.time()?.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `std_msgs/Header { stamp: 1.000000002, frame_id: "ab" }` and a double behind it, laid out by hand from the
    /// rules of XCDR1: alignment counts from behind the four bytes.
    #[test]
    fn numbers_are_aligned_to_their_size() {
        let mut out = Writer::new();
        out.header(Time(1_000_000_002), "ab");
        out.put(1.0f64);
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            1, 0, 0, 0,  2, 0, 0, 0,
            3, 0, 0, 0,  b'a', b'b', 0,
            0,
            0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
        ];
        assert_eq!(out.bytes(), expected);
    }

    #[test]
    fn short_and_foreign_bytes_are_refused() {
        assert_eq!(Reader::new(&[0, 3, 0, 0]).err(), Some(Error::Encapsulation([0, 3])));
        assert_eq!(Reader::new(&[0, 1]).err(), Some(Error::Short { at: 0, needed: 2 }));
        let mut reader = Reader::new(&[0, 1, 0, 0, 255, 255, 255, 255, 1]).unwrap();
        assert!(
            matches!(reader.row::<f64>(&mut Vec::new()), Err(Error::Short { .. })),
            "a length that cannot be is no allocation"
        );
    }

    proptest::proptest! {
        #[test]
        fn what_is_written_is_read_back(a: u8, b: f64, c: i16, text in "[a-zäöü]{0,7}", row: Vec<f32>, t in -5_000_000_000i64..5_000_000_000) {
            let text: Text<14> = Text::new(&text);
            let mut out = Writer::new();
            out.put(a).put(b).put(text).put(c).put(Time(t));
            out.row(&row);
            let mut input = Reader::new(out.bytes()).unwrap();
            proptest::prop_assert_eq!(input.get::<u8>(), Ok(a));
            proptest::prop_assert_eq!(input.get::<f64>().unwrap().to_bits(), b.to_bits());
            proptest::prop_assert_eq!(input.get::<Text<14>>(), Ok(text));
            proptest::prop_assert_eq!(input.get::<i16>(), Ok(c));
            proptest::prop_assert_eq!(input.get::<Time>(), Ok(Time(t)));
            let mut back = Vec::new();
            input.row(&mut back).unwrap();
            proptest::prop_assert_eq!(back.iter().map(|x: &f32| x.to_bits()).collect::<Vec<_>>(), row.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
        }

        #[test]
        fn garbage_never_panics(bytes: Vec<u8>) {
            if let Ok(mut input) = Reader::new(&bytes) {
                let _ = input.header();
                let _ = input.row::<f32>(&mut Vec::new());
                let _ = input.get::<Sequence<u16, 4>>();
            }
        }
    }
}

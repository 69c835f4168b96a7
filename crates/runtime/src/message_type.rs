//! A message type with its type erased: what the router and the log know of it.

#![allow(unsafe_code)]

use std::any::TypeId;
use std::marker::PhantomData;

use types::cdr::{self, Writer};
use types::definition::Definition;
use types::message::is_large;
use types::{Message, Time};

/// The greatest size of a message that travels by value (bytes).
pub const LARGEST_BY_VALUE: usize = 1024;

/// A message type with its type erased. Two are equal when they stand for the same Rust type.
pub struct MessageType {
    /// The name of the Rust type.
    pub rust_name: fn() -> &'static str,
    /// Its name to other programs, as in `geometry_msgs/msg/Twist`.
    pub name: &'static str,
    id: fn() -> TypeId,
    /// Size of its head (bytes).
    pub size: usize,
    /// Whether it has a row behind it, and so always stays in memory.
    pub large: bool,
    /// Its fields to other programs.
    pub definition: fn() -> Definition,
    encode: unsafe fn(&[u64], &[u64], usize, Time, &mut Writer),
}

struct Of<T>(PhantomData<T>);

impl<T: Message> Of<T> {
    const TYPE: MessageType = MessageType {
        rust_name: std::any::type_name::<T>,
        name: T::NAME,
        id: TypeId::of::<T>,
        size: size_of::<T>(),
        large: size_of::<T::Element>() > 0,
        definition: T::definition,
        encode: encode::<T>,
    };
}

/// # Safety
/// `head` holds the bytes of a `T`, `row` those of `len` of its elements.
unsafe fn encode<T: Message>(head: &[u64], row: &[u64], len: usize, stamp: Time, out: &mut Writer) {
    debug_assert!(size_of_val(head) >= size_of::<T>() && size_of_val(row) >= len * size_of::<T::Element>());
    // SAFETY: the caller's promise; both are plain values, and words are at least as aligned as they are (checked when the
    // type is made a port).
    unsafe {
        let head = &*head.as_ptr().cast::<T>();
        let row = core::slice::from_raw_parts(row.as_ptr().cast::<T::Element>(), len);
        head.encode(row, stamp, out);
    }
}

impl MessageType {
    /// The erased form of `T`.
    pub const fn of<T: Message>() -> &'static MessageType {
        const {
            assert!(
                align_of::<T>() <= 8 && align_of::<T::Element>() <= 8,
                "a message is aligned to at most eight bytes"
            );
            assert!(
                size_of::<T>() <= LARGEST_BY_VALUE,
                "a message of more than 1024 bytes does not travel by value: give it a row (Message::Element) and it goes by link"
            );
            &Of::<T>::TYPE
        }
    }

    /// The short name of the Rust type.
    pub fn short_name(&self) -> &'static str {
        let full = (self.rust_name)();
        full.rsplit("::").next().unwrap_or(full)
    }

    /// Encodes a message whose bytes came from a [`crate::trace::Record`] of an output of this type.
    ///
    /// # Safety
    /// The words are those that an output of this type wrote.
    pub(crate) unsafe fn encode(&self, head: &[u64], row: &[u64], len: usize, stamp: Time, out: &mut Writer) {
        // SAFETY: the caller's promise.
        unsafe { (self.encode)(head, row, len, stamp, out) }
    }
}

impl PartialEq for MessageType {
    fn eq(&self, other: &MessageType) -> bool {
        (self.id)() == (other.id)()
    }
}

impl std::fmt::Debug for MessageType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.short_name())
    }
}

/// Reads a message from CDR.
pub(crate) fn decode<T: Message>(bytes: &[u8]) -> Result<(T, Vec<T::Element>), cdr::Error> {
    let mut row = Vec::new();
    let head = T::decode(&mut cdr::Reader::new(bytes)?, &mut row)?;
    debug_assert!(is_large::<T>() || row.is_empty());
    Ok((head, row))
}

//! What makes a type a message.

use alloc::vec::Vec;
use core::fmt::Debug;

use crate::cdr::{Element, Error, Field as _, NoElement, Reader, Writer};
use crate::definition::Definition;
use crate::time::{Duration, Time};

pub use macros::{Field, Message};

/// A message: plain data without heap, and for a large one a row of plain elements behind it (pixels, ranges).
///
/// `#[derive(Message)]` writes all of it for a struct whose fields are [`crate::cdr::Field`]s; the name to other programs is
/// then `sinew_msgs/msg/` and the name of the type. Types that ROS 2 defines too are written by hand to match its definition.
///
/// ```
/// use types::{Message, message::describe};
///
/// /// How warm it is.
/// #[derive(Clone, Copy, Debug, Default, Message)]
/// pub struct Warmth {
///     /// In °C.
///     pub celsius: f64,
/// }
/// assert_eq!(describe::<Warmth>().text(), "float64 celsius\n");
/// ```
///
/// A type with heap cannot be one, because it cannot be copied by its bytes:
///
/// ```compile_fail
/// #[derive(Clone, Debug, Default, types::Message)]
/// pub struct Names {
///     pub names: Vec<String>,
/// }
/// ```
pub trait Message: Copy + Default + Debug + Send + Sync + 'static {
    /// What the row behind it is made of; [`NoElement`] for a small message, which has none.
    type Element: Element;

    /// Its name to other programs, as in `geometry_msgs/msg/Twist`.
    const NAME: &'static str;

    /// Its fields to other programs.
    fn definition() -> Definition;

    /// Writes it as CDR. `row` is the row behind it, `stamp` that of the header, for definitions that hold one.
    fn encode(&self, row: &[Self::Element], stamp: Time, out: &mut Writer);

    /// Reads what [`encode`](Self::encode) or another program wrote; the row is added to `row`.
    fn decode(input: &mut Reader<'_>, row: &mut Vec<Self::Element>) -> Result<Self, Error>;

    /// Spoils the measured numbers in it, as [`crate::cdr::Field::disturb`] does.
    fn disturb(&mut self, row: &mut [Self::Element], wild: bool, draw: &mut dyn FnMut() -> f64) {
        row.iter_mut().for_each(|element| element.disturb(wild, draw));
    }

    /// The value between two others, `ratio` of the way from the `earlier` to the `later`; nothing for types that cannot say.
    fn between(earlier: &Self, later: &Self, ratio: f64) -> Option<Self> {
        let _ = (earlier, later, ratio);
        None
    }

    /// The value a span after the last; nothing for types that cannot say.
    fn beyond(last: &Self, span: Duration) -> Option<Self> {
        let _ = (last, span);
        None
    }
}

/// Whether messages of the type have a row behind them and so always stay in memory, with links sent in their place.
pub fn is_large<T: Message>() -> bool {
    core::any::TypeId::of::<T::Element>() != core::any::TypeId::of::<NoElement>()
}

/// The definition of a type, as a function to be named where a type is erased.
pub fn describe<T: Message>() -> Definition {
    T::definition()
}

/// Definitions that ROS 2 shares between messages.
pub mod ros {
    use crate::definition::{Definition, Kind};

    /// `builtin_interfaces/Time`.
    pub fn time() -> Definition {
        Definition::new("builtin_interfaces/msg/Time", [("sec", Kind::I32), ("nanosec", Kind::U32)])
    }

    /// `builtin_interfaces/Duration`.
    pub fn duration() -> Definition {
        Definition::new("builtin_interfaces/msg/Duration", [("sec", Kind::I32), ("nanosec", Kind::U32)])
    }

    /// `std_msgs/Header`.
    pub fn header() -> Definition {
        Definition::new("std_msgs/msg/Header", [("stamp", Kind::Struct(time())), ("frame_id", Kind::String)])
    }

    /// `geometry_msgs/Vector3`.
    pub fn vector() -> Definition {
        Definition::new("geometry_msgs/msg/Vector3", [("x", Kind::F64), ("y", Kind::F64), ("z", Kind::F64)])
    }

    /// `geometry_msgs/Point`.
    pub fn point() -> Definition {
        Definition::new("geometry_msgs/msg/Point", [("x", Kind::F64), ("y", Kind::F64), ("z", Kind::F64)])
    }

    /// `geometry_msgs/Quaternion`.
    pub fn quaternion() -> Definition {
        let fields = [("x", Kind::F64), ("y", Kind::F64), ("z", Kind::F64), ("w", Kind::F64)];
        Definition::new("geometry_msgs/msg/Quaternion", fields)
    }
}

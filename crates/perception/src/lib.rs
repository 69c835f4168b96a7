//! From raw sensor readings to what a robot acts on: pictures to coloured blobs, echoes to distances and risks.
//!
//! Values in, values out. Every buffer belongs to the caller; what needs scratch is a struct that is made once from
//! the size of the picture, and no call allocates. There is no clock in here: time comes in as an argument.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`colour`] | RGB picture | HSI picture, mask of a colour range |
//! | [`blobs`] | mask | connected regions with area, centre, box and orientation |
//! | [`edges`] | intensity picture | strength of the edges |
//! | [`motion`] | two intensity pictures | mask, number and centre of the changed pixels |
//! | [`recognise`] | picture, colour and shape | the largest region that has both, from all pixels or some |
//! | [`thin`] | picture | every n-th pixel of it, and regions of those in the whole |
//! | [`tube`] | picture and two colours | the upright tubes that have both, one above the other |
//! | [`target`] | blob and camera | bearing, elevation, share of the picture |
//! | [`sonar`] | ring of ranges | filtered ranges, risk per direction |
//! | [`local_map`] | echoes while the robot moves | where something is around it |
//! | [`laser`] | laser scan | ring of ranges around the robot |
#![forbid(unsafe_code)]

pub mod blobs;
pub mod colour;
pub mod edges;
pub mod laser;
mod lead;
pub mod local_map;
pub mod motion;
pub mod picture;
pub mod recognise;
pub mod sonar;
mod split;
pub mod target;
pub mod thin;
pub mod tube;

pub use picture::{Size, WrongLength};

/// What tests of several modules share.
#[cfg(test)]
mod test {
    use proptest::strategy::Strategy;

    /// Numbers of a range in single precision.
    ///
    /// They are drawn in double precision: proptest's own ranges of `f32` fail an assertion of theirs once in some ten million draws.
    pub(crate) fn single(range: core::ops::Range<f64>) -> impl Strategy<Value = f32> {
        range.prop_map(|x| x as f32)
    }
}

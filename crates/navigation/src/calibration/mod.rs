//! What a robot must know of itself, from measurements of it: its wheels, and how far away what its camera sees is.
//!
//! | module | from | to |
//! |---|---|---|
//! | [`square`] | where it truly ends after squares driven both ways around | how unequal its wheels are, and its track (UMBmark) |
//! | [`wheels`] | counts of the wheels, and the true way and turn of each stretch | the radius of each wheel, and the track |
//! | [`tube`] | heights of a two-coloured tube in the picture, and its true distances | distance by height |
//!
//! Here memory is taken: to calibrate is no step of a robot that runs. Every fit gives what is left over, so that one sees whether to trust it.

mod least_squares;
pub mod square;
pub mod tube;
pub mod wheels;

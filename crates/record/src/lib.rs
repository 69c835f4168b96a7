//! What stays of a run: its log, which other programs can open, and figures of it.
//!
//! - [`log`] writes and reads MCAP files with ROS 2's own messages in them, and mends files that a crash cut short.
//! - [`schema`] and [`dynamic`] turn the bytes of any message into a tree of values and back, by its definition alone.
//! - [`picture`] packs camera pictures.
//! - [`grey`] reads grey pictures from files, as maps are drawn in them.
//! - [`figure`] draws what happened, as PNG and SVG.
#![forbid(unsafe_code)]

pub mod dynamic;
pub mod figure;
pub mod grey;
pub mod log;
pub mod picture;
pub mod schema;

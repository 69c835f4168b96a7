//! Ways over a grid of free and closed cells: planners for every need, smoothing, and a time table for the drive.
//!
//! Steps are octile: to one of eight neighbours, aslant only where both corners beside the step are open. A straight step is as long as the side of a
//! cell, one aslant √2 times that. The body of the robot is in the grid: what stands somewhere closes the cells around it, and so the rest reckons
//! with a point.
//!
//! | planner | for | gives |
//! |---|---|---|
//! | [`Jump`] | one query on any grid | the shortest way, soonest |
//! | [`Field`] | a robot that must go now | a way at once, then better ones up to the shortest, and how good it is at least |
//! | [`DStarLite`] | a goal that stays while obstacles and robot move | the shortest way anew, from what has changed alone |
//! | [`Ara`] | the same as the field, by the book | ways with a proven bound, as rare as its rounds |
//! | [`AStar`] | comparison | the shortest way |
//! | [`Dijkstra`] | many goals at once | the shortest ways to all cells |
//!
//! All have one face, [`Planner`]; those that have a way before they are done also [`Anytime`].

mod a_star;
mod ara;
mod best_first;
mod bits;
mod cost;
mod d_star_lite;
mod dijkstra;
mod field;
mod grid;
mod heap;
mod jump;
pub mod moving_ai;
mod nodes;
mod planner;
mod way;

pub use a_star::AStar;
pub use ara::{Ara, AraParams};
pub use d_star_lite::DStarLite;
pub use dijkstra::Dijkstra;
pub use field::Field;
pub use grid::{Cell, Grid, LARGEST};
pub use jump::Jump;
pub use planner::{Anytime, NoPath, Planner, Refined};
pub use way::Path;

#[cfg(test)]
mod tests;

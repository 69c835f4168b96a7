//! Ready-made agents in whole systems.

#![allow(clippy::unwrap_used)] // a test may

mod asking;
mod deciding;
mod localizing;
mod reacting;
mod seeing;

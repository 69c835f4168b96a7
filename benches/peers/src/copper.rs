//! Copper: the work of our hop benches as its tasks, and its own example.
//!
//! Each application is made by copper's macro from a file beside this one, with copper's own defaults unless said.

mod caterpillar;
mod hop;
mod log;
mod logged;
mod part;
mod tasks;

pub(crate) use caterpillar::{
    FIGURES as CATERPILLAR_FIGURES, PACED_FIGURES as CATERPILLAR_PACED_FIGURES, measure as caterpillar,
    paced as caterpillar_paced,
};
pub(crate) use hop::{FIGURES as HOP_FIGURES, measure as hop};
pub(crate) use logged::{FIGURES as LOGGED_FIGURES, measure as hop_logged};

use cu29::prelude::CuError;

use crate::document::{Document, Figure};
use crate::machine::Granted;

/// The other system.
pub(crate) const PEER: &str = "copper";

fn document(granted: Granted, figures: Vec<Figure>) -> Document {
    Document { peer: PEER, version: env!("VERSION_CU29").to_owned(), granted: vec![granted], figures }
}

fn failed(error: impl Into<CuError>) -> String {
    error.into().to_string()
}

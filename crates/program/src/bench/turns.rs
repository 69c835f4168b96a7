//! Rounds in which ours and theirs take turns on the machine.

use std::ffi::OsStr;

use super::outcome::Outcome;
use super::peers::{self, PeerFigure, Peers};
use crate::error::Failure;

/// The other system's side. After its first failure it has no more turns.
pub(super) struct Turns {
    peers: Option<Peers>,
    failure: Option<Failure>,
}

/// What the other system measured in a round.
pub(super) struct Round(Vec<PeerFigure>);

impl Turns {
    pub(super) fn new(peers: Option<Peers>) -> Turns {
        Turns { peers, failure: None }
    }

    /// Does one measurement with the other system, if it is there.
    pub(super) fn round<W: AsRef<OsStr>>(&mut self, name: &str, args: &[W]) -> Option<Round> {
        let peers = self.peers.as_ref().filter(|_| self.failure.is_none())?;
        match peers.measure(name, args) {
            Ok(figures) => Some(Round(figures)),
            Err(failure) => {
                self.failure = Some(failure);
                None
            }
        }
    }

    /// The values of one figure of a round.
    pub(super) fn take(&mut self, round: &mut Option<Round>, name: &str, unit: &str) -> Vec<f64> {
        let Some(Round(figures)) = round else { return Vec::new() };
        peers::take(figures, name, unit).unwrap_or_else(|failure| {
            self.failure = Some(failure);
            Vec::new()
        })
    }

    /// Adds the ratio of all rounds, or says that there is none.
    pub(super) fn compare(self, outcome: &mut Outcome, name: &'static str, rounds: Vec<(f64, f64)>) {
        if rounds.is_empty() || self.failure.is_some() {
            outcome.without(name, self.failure);
        } else {
            outcome.compare(name, rounds);
        }
    }

    /// What went wrong.
    pub(super) fn failure(self) -> Option<Failure> {
        self.failure
    }
}

/// The mean.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

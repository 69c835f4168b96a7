//! The tasks of the hop: a source, one that hands on, a sink.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use cu29::bincode::{Decode, Encode};
use cu29::prelude::*;
use serde::{Deserialize, Serialize};

use crate::machine::room;

/// A message of 64 bytes.
#[derive(Clone, Copy, Debug, Default, Encode, Decode, Serialize, Deserialize, Reflect)]
pub(super) struct Parcel {
    /// Counts up from 1.
    number: u64,
    /// Whatever fills it up.
    load: [u64; 7],
}

/// So many latencies are kept in one run.
const ROOM: u64 = 1 << 20;

/// Whether the source stamps its messages and the sink keeps how long they took. Off, a task reads no clock of its own.
static STAMPED: AtomicBool = AtomicBool::new(false);

/// What the sink saw until it was stopped.
static SEEN: Mutex<Seen> = Mutex::new(Seen { taken: 0, missing: 0, spans: Vec::new() });

/// What a sink saw.
#[derive(Default)]
pub(super) struct Seen {
    /// How many messages came.
    pub(super) taken: u64,
    /// How many did not, by the numbers of those that came.
    pub(super) missing: u64,
    /// How long stamped messages were under way (ns, by copper's clock).
    pub(super) spans: Vec<u64>,
}

/// Turns stamping on or off, from the next iteration on.
pub(super) fn stamp(on: bool) {
    STAMPED.store(on, Ordering::Relaxed);
}

/// What the last sink that was stopped has seen.
pub(super) fn seen() -> Seen {
    std::mem::take(&mut *SEEN.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Sends a parcel each time.
#[derive(Reflect)]
pub(super) struct Source {
    number: u64,
}

impl Freezable for Source {}

impl CuSrcTask for Source {
    type Resources<'r> = ();
    type Output<'m> = output_msg!(Parcel);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Source { number: 0 })
    }

    fn process(&mut self, context: &CuContext, output: &mut Self::Output<'_>) -> CuResult<()> {
        self.number += 1;
        if STAMPED.load(Ordering::Relaxed) {
            output.tov = Tov::Time(context.now());
        }
        output.set_payload(Parcel { number: self.number, ..Parcel::default() });
        Ok(())
    }
}

/// Hands a parcel on.
#[derive(Reflect)]
pub(super) struct Hand;

impl Freezable for Hand {}

impl CuTask for Hand {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Parcel);
    type Output<'m> = output_msg!(Parcel);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Hand)
    }

    fn process(
        &mut self,
        _: &CuContext,
        input: &Self::Input<'_>,
        output: &mut Self::Output<'_>,
    ) -> CuResult<()> {
        if let Some(parcel) = input.payload() {
            output.tov = input.tov;
            output.set_payload(*parcel);
        }
        Ok(())
    }
}

/// Takes parcels and says how long they were under way.
#[derive(Reflect)]
pub(super) struct Sink {
    last: u64,
    taken: u64,
    missing: u64,
    #[reflect(ignore)]
    spans: Vec<u64>,
}

impl Freezable for Sink {}

impl CuSinkTask for Sink {
    type Resources<'r> = ();
    type Input<'m> = input_msg!(Parcel);

    fn new(_: Option<&ComponentConfig>, (): Self::Resources<'_>) -> CuResult<Self> {
        Ok(Sink { last: 0, taken: 0, missing: 0, spans: room(ROOM) })
    }

    fn process(&mut self, context: &CuContext, input: &Self::Input<'_>) -> CuResult<()> {
        let Some(parcel) = input.payload() else { return Ok(()) };
        if let Tov::Time(sent) = input.tov
            && self.spans.len() < self.spans.capacity()
        {
            self.spans.push((context.now() - sent).as_nanos());
        }
        self.missing += parcel.number - self.last - 1;
        self.last = parcel.number;
        self.taken += 1;
        Ok(())
    }

    fn stop(&mut self, _: &CuContext) -> CuResult<()> {
        let seen = Seen { taken: self.taken, missing: self.missing, spans: std::mem::take(&mut self.spans) };
        *SEEN.lock().unwrap_or_else(PoisonError::into_inner) = seen;
        Ok(())
    }
}

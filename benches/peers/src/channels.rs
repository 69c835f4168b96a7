//! Channels, send and receive in one thread: nobody waits, so this is what the queue itself costs.

use crate::document::{Document, Figure};
use crate::machine::{means, settle};
use crate::rings::Parcel;
use crate::settings::Settings;

/// The other systems.
pub(crate) const PEER: &str = "channels";

/// Means of a block.
pub(crate) const FIGURES: &[&str] = &["rtrb", "sync_channel", "crossbeam", "flume", "tokio", "mpsc"];

/// Messages through each where nobody says how many, and how many make a mean.
const ITERATIONS: u64 = 1_000_000;
const BLOCK: u64 = 1000;
/// Places in each that is bounded.
const ROOM: usize = 64;

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let granted = settle("channels", settings, 0);
    let blocks = settings.iterations_or(ITERATIONS).div_ceil(BLOCK);
    let figures = vec![
        {
            let (mut sender, mut receiver) = rtrb::RingBuffer::<Parcel>::new(ROOM);
            figure("rtrb", blocks, |parcel| sender.push(parcel).is_ok(), || receiver.pop().ok())?
        },
        {
            let (sender, receiver) = std::sync::mpsc::sync_channel::<Parcel>(ROOM);
            figure("sync_channel", blocks, |parcel| sender.send(parcel).is_ok(), || receiver.recv().ok())?
        },
        {
            let (sender, receiver) = crossbeam_channel::bounded::<Parcel>(ROOM);
            figure("crossbeam", blocks, |parcel| sender.send(parcel).is_ok(), || receiver.recv().ok())?
        },
        {
            let (sender, receiver) = flume::bounded::<Parcel>(ROOM);
            figure("flume", blocks, |parcel| sender.send(parcel).is_ok(), || receiver.recv().ok())?
        },
        {
            let (sender, mut receiver) = tokio::sync::mpsc::channel::<Parcel>(ROOM);
            figure("tokio", blocks, |parcel| sender.try_send(parcel).is_ok(), || receiver.try_recv().ok())?
        },
        {
            #[allow(clippy::disallowed_methods, reason = "it is measured, and holds one message at a time")]
            let (sender, receiver) = std::sync::mpsc::channel::<Parcel>();
            figure("mpsc", blocks, |parcel| sender.send(parcel).is_ok(), || receiver.recv().ok())?
        },
    ];
    Ok(Document { peer: PEER, version: versions(), granted: vec![granted], figures })
}

fn versions() -> String {
    format!(
        "rtrb {}, std {}, crossbeam-channel {}, flume {}, tokio {}",
        env!("VERSION_RTRB"),
        env!("VERSION_RUST"),
        env!("VERSION_CROSSBEAM"),
        env!("VERSION_FLUME"),
        env!("VERSION_TOKIO")
    )
}

/// Sends and takes; each message must be the one that was sent.
fn figure(
    name: &'static str,
    blocks: u64,
    mut send: impl FnMut(Parcel) -> bool,
    mut take: impl FnMut() -> Option<Parcel>,
) -> Result<Figure, String> {
    let (mut number, mut wrong) = (0, 0);
    let values = means(blocks, BLOCK, || {
        number += 1;
        let sent = send(std::hint::black_box([number; 8]));
        let came = std::hint::black_box(take());
        wrong += u64::from(!sent || came.is_none_or(|parcel| parcel[0] != number));
    });
    if wrong > 0 {
        return Err(format!("{name}: {wrong} messages did not come"));
    }
    Ok(Figure::new(name, "ns", values))
}

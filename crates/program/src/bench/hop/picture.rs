//! A picture of 230 400 bytes from its producer to its consumer through short-term memory, beside 64 bytes that travel by value; and both
//! beside iceoryx2, where a thread sends the same bytes to itself through shared memory.
//!
//! A hop is timed from the sender's last look at the clock, when it has filled the message, to the receiver's first, when it has the
//! message before it. What both do with the bytes is their own affair, so neither touches them, and the time is told beside the message.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Output, Plan, Registry, Step};
use types::Duration;
use types::messages::Image;

use super::CPU;
use crate::bench::Setting;
use crate::bench::outcome::{Outcome, median};
use crate::bench::parcel::{self, Parcel, Shelf, live, now, room};
use crate::bench::turns::Turns;
use crate::error::Failure;

/// Bytes of a picture: 320 by 240, in three colours.
const BYTES: usize = 320 * 240 * 3;
/// Messages of a round, the time between them, and rounds.
const MESSAGES: usize = 2000;
const PERIOD: Duration = Duration::micros(100);
const ROUNDS: usize = 7;
const WARM_UP: usize = 100;

/// When the message that is under way was sent (ns).
type Stamp = Arc<AtomicU64>;

/// Sends small messages.
#[derive(Agent)]
struct Small {
    /// The message.
    out: Output<Parcel>,
    stamp: Stamp,
}

impl Agent for Small {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send_with(|parcel, _| {
            parcel.number = 1;
            self.stamp.store(now(), Ordering::Relaxed);
            0
        });
        Ok(())
    }
}

/// Sends pictures.
#[derive(Agent)]
struct Large {
    /// The picture.
    #[port(rows = BYTES)]
    out: Output<Image>,
    stamp: Stamp,
}

impl Agent for Large {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send_with(|image, _| {
            (image.width, image.height) = (320, 240);
            self.stamp.store(now(), Ordering::Relaxed);
            BYTES
        });
        Ok(())
    }
}

/// Takes either.
#[derive(Agent)]
struct Taker {
    /// Small ones.
    small: Input<Parcel>,
    /// Large ones.
    large: Input<Image>,
    stamp: Stamp,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Taker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        // Both ends run on one thread, so the stamp is that of this message.
        while self.small.take().is_some() {
            let span = now().saturating_sub(self.stamp.load(Ordering::Relaxed));
            self.shelf.keep(&mut self.spans, span as f64);
        }
        while let Some(image) = self.large.take() {
            let span = now().saturating_sub(self.stamp.load(Ordering::Relaxed));
            if image.row().len() != BYTES {
                return Err(Fault::new("a picture has come in part"));
            }
            self.shelf.keep(&mut self.spans, span as f64);
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(self.spans.get(WARM_UP..).unwrap_or_default());
    }
}

/// Hops of pictures, or of small messages (ns).
fn hops(pictures: bool, messages: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let mut plan = Plan::new("picture");
    let taker = if pictures {
        let sender = plan.add::<Large>("sender", Default::default());
        let taker = plan.add::<Taker>("taker", Default::default());
        plan.wire(&sender.out, &taker.large);
        "large"
    } else {
        let sender = plan.add::<Small>("sender", Default::default());
        let taker = plan.add::<Taker>("taker", Default::default());
        plan.wire(&sender.out, &taker.small);
        "small"
    };
    plan.every("sender", PERIOD);
    plan.on("taker", taker);
    super::on_one_executor(&mut plan);
    let shelf = Shelf::default();
    let kept = shelf.clone();
    let [small, large, taken] = [(); 3].map({
        let stamp = Stamp::default();
        move |()| stamp.clone()
    });
    let registry = Registry::new([
        AgentType::made_by(move |params| Small { stamp: small.clone(), ..Small::build(params) })
            .named("small"),
        AgentType::made_by(move |params| Large { stamp: large.clone(), ..Large::build(params) })
            .named("large"),
        AgentType::made_by(move |params| Taker {
            stamp: taken.clone(),
            spans: room(messages + WARM_UP),
            shelf: kept.clone(),
            ..Taker::build(params)
        })
        .named("taker"),
    ]);
    let options = shelf.until_full(PERIOD * (messages + WARM_UP) as i64);
    parcel::run(live(&plan, &registry, options)?, outcome)?;
    let hops = shelf.take();
    if hops.is_empty() {
        return Err(Failure::new("no message came").code(1));
    }
    Ok(hops)
}

/// Rounds of both and of iceoryx2, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let messages = setting.of(MESSAGES, 500);
    let mut turns = Turns::new(setting.peers.clone());
    let args = ["--iterations".to_owned(), messages.to_string(), "--cpu".to_owned(), format!("{CPU},1")];
    let (mut small, mut large, mut rounds) = (Vec::new(), Vec::new(), Vec::new());
    let mut beside = [(); 2].map(|()| Beside::default());
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let few = hops(false, messages, outcome)?;
        let many = hops(true, messages, outcome)?;
        let ours = [median(few.clone()), median(many.clone())];
        rounds.push((ours[1], ours[0]));
        small.extend(few);
        large.extend(many);
        let mut round = turns.round("iceoryx2", &args);
        for (which, figure) in ["hop_64", "hop_230400"].into_iter().enumerate() {
            let theirs = turns.take(&mut round, figure, "ns");
            if !theirs.is_empty() {
                beside[which].rounds.push((ours[which], median(theirs.clone())));
                beside[which].theirs.extend(theirs);
            }
        }
    }
    outcome.figure("hop64", "ns", small);
    outcome.figure("picture", "ns", large);
    outcome.compare("picture/hop64", rounds);
    let names = [("hop64_iceoryx2", "hop64/iceoryx2"), ("picture_iceoryx2", "picture/iceoryx2")];
    let failure = turns.failure();
    for (beside, (figure, ratio)) in beside.into_iter().zip(names) {
        outcome.figure(figure, "ns", beside.theirs);
        if failure.is_some() || beside.rounds.is_empty() {
            outcome.without(ratio, failure.clone());
        } else {
            outcome.compare(ratio, beside.rounds);
        }
    }
    Ok(())
}

/// What iceoryx2 did, and ours and theirs of each round.
#[derive(Default)]
struct Beside {
    theirs: Vec<f64>,
    rounds: Vec<(f64, f64)>,
}

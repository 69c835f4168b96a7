//! A picture of 230 400 bytes from its producer to its consumer through short-term memory, beside 64 bytes that travel by value.
//!
//! A hop is timed from the sender's last look at the clock before it lets go of the message to the receiver's first look after it
//! has the message before it; what both do with the bytes is their own affair, and the same for any size.

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Output, Plan, Registry, Step};
use types::Duration;
use types::messages::Image;

use crate::bench::Setting;
use crate::bench::outcome::{Outcome, median};
use crate::bench::parcel::{self, Parcel, Shelf, for_so_long, keep, live, now, room};
use crate::error::Failure;

/// Bytes of a picture: 320 by 240, in three colours.
const BYTES: usize = 320 * 240 * 3;
/// Messages of a round, the time between them, and rounds.
const MESSAGES: usize = 2000;
const PERIOD: Duration = Duration::micros(100);
const ROUNDS: usize = 7;
const WARM_UP: usize = 100;
/// The bytes of a row in which the time stands.
const STAMP: usize = 8;

/// Sends small messages.
#[derive(Agent)]
struct Small {
    /// The message.
    out: Output<Parcel>,
}

impl Agent for Small {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send_with(|parcel, _| {
            parcel.sent = now();
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
}

impl Agent for Large {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send_with(|image, row| {
            (image.width, image.height) = (320, 240);
            row[..STAMP].copy_from_slice(&now().to_ne_bytes());
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
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Taker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.small.take() {
            keep(&mut self.spans, now().saturating_sub(parcel.sent) as f64);
        }
        while let Some(image) = self.large.take() {
            let mut stamp = [0; STAMP];
            stamp.copy_from_slice(&image.row()[..STAMP]);
            keep(&mut self.spans, now().saturating_sub(u64::from_ne_bytes(stamp)) as f64);
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
    let registry = Registry::new([
        AgentType::of::<Small>(),
        AgentType::of::<Large>(),
        AgentType::made_by(move |params| Taker {
            spans: room(messages + WARM_UP),
            shelf: kept.clone(),
            ..Taker::build(params)
        })
        .named("taker"),
    ]);
    let limit = PERIOD * (messages + WARM_UP) as i64;
    parcel::run(live(&plan, &registry, for_so_long(limit))?, outcome)?;
    let hops = shelf.take();
    if hops.is_empty() {
        return Err(Failure::new("the machine stood still: no message came").code(1));
    }
    Ok(hops)
}

/// Rounds of both, in turns.
pub(super) fn measure(setting: &Setting<'_>, outcome: &mut Outcome) -> Result<(), Failure> {
    let messages = setting.of(MESSAGES, 500);
    let (mut small, mut large, mut rounds) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..setting.of(ROUNDS, if setting.shorter > 100 { 1 } else { 3 }) {
        let few = hops(false, messages, outcome)?;
        let many = hops(true, messages, outcome)?;
        rounds.push((median(many.clone()), median(few.clone())));
        small.extend(few);
        large.extend(many);
    }
    outcome.figure("hop64", "ns", small);
    outcome.figure("picture", "ns", large);
    outcome.compare("picture/hop64", rounds);
    Ok(())
}

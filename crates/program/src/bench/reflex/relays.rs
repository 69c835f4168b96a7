//! The places of the agents of a chain with agents that only hand on: what is left is the runtime's.

use runtime::{Agent, AgentType, Declare as _, Fault, Input, Output, Plan, Registry, Step};
use types::Time;

use super::{CYCLE, WARM_UP, place};
use crate::bench::outcome::Outcome;
use crate::bench::parcel::{self, Parcel, Shelf, live, now, room};
use crate::error::Failure;

/// Where the chain begins and ends when its agents do nothing.
#[derive(Agent)]
struct Ends {
    /// What is back.
    back: Input<Parcel>,
    /// What goes.
    out: Output<Parcel>,
    next: Time,
    cycle: u64,
    spans: Vec<f64>,
    shelf: Shelf,
}

impl Agent for Ends {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if let Some(parcel) = self.back.take() {
            let span = now().saturating_sub(parcel.sent);
            if parcel.number > WARM_UP {
                self.shelf.keep(&mut self.spans, span as f64);
            }
        }
        if step.now >= self.next {
            self.next = step.now + CYCLE / 2;
            self.cycle += 1;
            self.out.send(Parcel { sent: now(), number: self.cycle, ..Parcel::default() });
        }
        Ok(())
    }

    fn stop(&mut self, _: &mut Step) {
        self.shelf.put(&self.spans);
    }
}

/// Hands on.
#[derive(Agent)]
struct Relay {
    /// What comes.
    take: Input<Parcel>,
    /// What goes.
    give: Output<Parcel>,
}

impl Agent for Relay {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(parcel) = self.take.take() {
            self.give.send(*parcel);
        }
        Ok(())
    }
}

/// Gives how long each round through the chain took (ns).
pub(super) fn run(contacts: usize, outcome: &mut Outcome) -> Result<Vec<f64>, Failure> {
    let shelf = Shelf::default();
    let kept = shelf.clone();
    let registry = Registry::new([
        AgentType::made_by(move |params| Ends {
            spans: room(contacts),
            shelf: kept.clone(),
            ..Ends::build(params)
        })
        .named("ends"),
        AgentType::of::<Relay>(),
    ]);
    let mut plan = Plan::new("reflex");
    let ends = plan.add::<Ends>("ends", Default::default());
    let hands = ["sensor", "safety", "coordinator"].map(|name| plan.add::<Relay>(name, Default::default()));
    plan.wire(&ends.out, &hands[0].take);
    plan.wire(&hands[0].give, &hands[1].take);
    plan.wire(&hands[1].give, &hands[2].take);
    plan.wire(&hands[2].give, &ends.back);
    plan.every("ends", CYCLE);
    plan.on("ends", "back");
    for name in ["sensor", "safety", "coordinator"] {
        plan.on(name, "take");
    }
    place(&mut plan, [("ends", 0), ("sensor", 1), ("safety", 2), ("coordinator", 2)]);
    let options = shelf.until_full(CYCLE * (contacts as i64 + WARM_UP as i64));
    parcel::run(live(&plan, &registry, options)?, outcome)?;
    Ok(shelf.take())
}

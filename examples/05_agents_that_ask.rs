//! Lesson 5: an agent sees who there is, wires itself to whom it likes, and speaks to one of many.

#![allow(clippy::print_stdout)] // a lesson talks

use sinew::prelude::*;
use sinew::runtime::{AgentPlan, Refusal, Request, TimedRequest};
use sinew::types::messages::{Battery, Twist};

/// Uses up its battery, and stops when it is told to.
#[derive(Agent)]
struct Cart {
    /// What is left.
    battery: Output<Battery>,
    /// How fast to go.
    orders: Input<Twist>,
    used: f64,
}

impl Agent for Cart {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        if self.orders.take().is_some() {
            println!("at {}: {} stops", step.now, step.name_of(step.agent).unwrap_or_default());
        }
        self.used += 0.25;
        self.battery.send(Battery { charge: 1.0 - self.used, ..Battery::default() });
        Ok(())
    }
}

/// Watches all batteries, whoever has one.
#[derive(Agent)]
struct Watch {
    /// What is left, of everybody.
    batteries: Input<Battery>,
    /// How fast to go.
    orders: Output<Twist>,
    /// Who there is.
    router: Router,
}

impl Agent for Watch {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let before = self.router.version();
        if let Some(system) = self.router.news() {
            for new in system.joined_since(before).filter(|agent| agent.kind() == "cart") {
                println!("at {}: {} is new", step.now, new.name());
                for port in new.ports() {
                    // Asked for now, and done or refused later.
                    match port.name() {
                        "battery" => self.router.subscribe(&self.batteries, port).map_err(Fault::of)?,
                        _ => self.router.connect(&self.orders, port).map_err(Fault::of)?,
                    };
                }
            }
        }
        while let Some((_, decision)) = self.router.decision() {
            println!("at {}: {decision:?}", step.now);
        }
        while let Some(battery) = self.batteries.take() {
            if battery.charge < 0.3 {
                // All carts are wired to this output; one of them gets it.
                let cart = battery.header().sender;
                self.orders.send_to(cart, Twist::ZERO);
            }
        }
        Ok(())
    }
}

/// The only thing that is asked of this system: one cart more.
fn one_more(words: &[String]) -> Result<Request, Refusal> {
    let (name, period) = (words.concat(), Some(Duration::secs(1)));
    Ok(Request::Add(AgentPlan { name, kind: "cart".into(), period, ..AgentPlan::default() }))
}

fn main() -> Result<(), sinew::runtime::CannotRun> {
    let mut plan = Plan::new("lesson 5");
    plan.add::<Cart>("red", Default::default());
    plan.every("red", Duration::secs(1));
    plan.add::<Watch>("watch", Default::default());
    // It runs when there is news, and when a battery tells of itself. No wire is in the plan.
    ["router", "batteries"].iter().for_each(|port| plan.on("watch", port));
    let (at, place) = (Duration::millis(1500), Default::default());
    plan.requests.push(TimedRequest { at, words: vec!["blue".into()], place });
    let options = Options { limit: Some(Duration::millis(4200)), parse: one_more, ..Options::default() };
    Simulation::new(&plan, &registry![Cart, Watch], options)?.run()?;
    Ok(())
}

// Output:
// at 0.000 s: red is new
// at 0.000 s: Done
// at 0.000 s: Done
// at 1.500 s: blue is new
// at 1.500 s: Done
// at 1.500 s: Done
// at 3.000 s: red stops
// at 4.000 s: red stops

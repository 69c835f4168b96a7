//! Lesson 3: an agent may die; the system does not. Its mailbox outlives it, and its successor takes over.

#![allow(clippy::print_stdout)] // a lesson talks

use sinew::prelude::*;
use sinew::types::messages::Battery;

/// Counts.
#[derive(Agent)]
struct Count {
    /// The count, as a charge.
    out: Output<Battery>,
    n: f64,
}

impl Agent for Count {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += 1.0;
        self.out.send(Battery { charge: self.n, ..Battery::default() });
        Ok(())
    }
}

/// Does not like the number three.
#[derive(Agent)]
struct Superstitious {
    /// What it hears.
    count: Input<Battery>,
}

impl Agent for Superstitious {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(count) = self.count.take() {
            println!("at {}: {}", step.now, count.charge);
            assert!(count.charge != 3.0, "three!");
        }
        Ok(())
    }
}

fn main() -> Result<(), sinew::runtime::CannotRun> {
    let mut plan = Plan::new("lesson 3");
    let count = plan.add::<Count>("count", Default::default());
    let hears = plan.add::<Superstitious>("superstitious", Default::default());
    plan.wire(&count.out, &hears.count);
    plan.every("count", Duration::millis(40));
    plan.on("superstitious", "count");
    let options = Options { limit: Some(Duration::millis(240)), ..Options::default() };
    let report = Simulation::new(&plan, &registry![Count, Superstitious], options)?.run()?;
    for incident in &report.incidents {
        // What was said, without the place in the source.
        println!(
            "{} {}: {}",
            incident.time,
            incident.agent,
            incident.what.split(" (").next().unwrap_or_default()
        );
    }
    Ok(())
}

// Output:
// at 0.000 s: 1
// at 0.040 s: 2
// at 0.080 s: 3
// at 0.180 s: 4
// at 0.180 s: 5
// at 0.200 s: 6
// at 0.240 s: 7
// 0.080 s superstitious: panic: three!
// 0.180 s superstitious: started again

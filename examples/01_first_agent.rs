//! Lesson 1: an agent has ports and a step. A plan wires agents; a simulation runs it in simulated time.

#![allow(clippy::print_stdout)] // a lesson talks

use sinew::prelude::*;
use sinew::types::messages::Twist;

/// Wants to drive faster and faster.
#[derive(Agent)]
struct Accelerate {
    /// The wish.
    drive: Output<Twist>,
    speed: f64,
}

impl Agent for Accelerate {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.speed += 0.1;
        self.drive.send(Twist::new(self.speed, 0.0));
        Ok(())
    }
}

/// Says what it hears.
#[derive(Agent)]
struct Speak {
    /// What it hears.
    wish: Input<Twist>,
}

impl Agent for Speak {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some(wish) = self.wish.take() {
            println!("at {} somebody wants {:.1} m/s", step.now, wish.linear);
        }
        Ok(())
    }
}

fn main() -> Result<(), sinew::runtime::CannotRun> {
    let mut plan = Plan::new("lesson 1");
    let accelerate = plan.add::<Accelerate>("accelerate", Default::default());
    let speak = plan.add::<Speak>("speak", Default::default());
    // The compiler checks that both ends are of one type.
    plan.wire(&accelerate.drive, &speak.wish);
    plan.every("accelerate", Duration::millis(250)); // periodic
    plan.on("speak", "wish"); // runs when a message comes

    let options = Options { limit: Some(Duration::secs(1)), ..Options::default() };
    let report = Simulation::new(&plan, &registry![Accelerate, Speak], options)?.run()?;
    println!("{}", report.ended);
    Ok(())
}

// Output:
// at 0.000 s somebody wants 0.1 m/s
// at 0.250 s somebody wants 0.2 m/s
// at 0.500 s somebody wants 0.3 m/s
// at 0.750 s somebody wants 0.4 m/s
// at 1.000 s somebody wants 0.5 m/s
// the time is over

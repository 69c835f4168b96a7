//! Lesson 4: a call never blocks. The answer, or the news that none came in time, arrives like a message.

#![allow(clippy::print_stdout)] // a lesson talks

use sinew::prelude::*;
use sinew::types::messages::Twist;

/// Halves speeds; takes its time over fast ones.
#[derive(Agent)]
struct Halve {
    /// Half of a speed.
    half: Service<Twist, Twist>,
}

impl Agent for Halve {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some((question, call)) = self.half.take() {
            // What is not answered, the caller hears of when its time is over.
            if question.linear < 2.5 {
                self.half.answer(&call, Twist::new(question.linear / 2.0, 0.0));
            }
        }
        Ok(())
    }
}

/// Asks for the half of 1, 2 and 3.
#[derive(Agent)]
struct Ask {
    /// Half of a speed.
    half: Client<Twist, Twist>,
    asked: f64,
}

impl Agent for Ask {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        while let Some((_, reply)) = self.half.reply() {
            match reply {
                Reply::Answer(half) => println!("at {}: {}", step.now, half.linear),
                Reply::TimeOut => println!("at {}: no answer", step.now),
            }
        }
        if step.now.seconds() >= self.asked && self.asked < 3.0 {
            self.asked += 1.0;
            if self.half.call(Twist::new(self.asked, 0.0), Duration::millis(300)).is_err() {
                println!("nobody answers calls");
            }
        }
        Ok(())
    }
}

fn main() -> Result<(), sinew::runtime::CannotRun> {
    let mut plan = Plan::new("lesson 4");
    let halve = plan.add::<Halve>("halve", Default::default());
    let ask = plan.add::<Ask>("ask", Default::default());
    plan.wire(&ask.half, &halve.half);
    plan.on("halve", "half");
    plan.every("ask", Duration::secs(1));
    let options = Options { limit: Some(Duration::secs(3)), ..Options::default() };
    Simulation::new(&plan, &registry![Halve, Ask], options)?.run()?;
    Ok(())
}

// Output:
// at 0.000 s: 0.5
// at 1.000 s: 1
// at 2.300 s: no answer

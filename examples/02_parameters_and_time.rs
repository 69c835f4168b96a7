//! Lesson 2: parameters are documented settings with a range. They, and the period, change while the system runs; what is
//! wrong is refused with the reason.

#![allow(clippy::print_stdout)] // a lesson talks

use sinew::prelude::*;
use sinew::runtime::{Refusal, Request, TimedRequest, value_of};
use sinew::types::value::Span;

/// Says how fast it would drive.
#[derive(Agent)]
struct Cruise {
    params: CruiseParams,
}

/// How it drives.
#[derive(Clone, Debug, Params)]
struct CruiseParams {
    /// Speed (m/s).
    #[param(default = 0.3, min = 0.0, max = 1.0)]
    speed: f64,
}

impl Agent for Cruise {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        println!("at {}: {} m/s", step.now, self.params.speed);
        Ok(())
    }
}

/// A timed request of a plan is written in words; here, only `set AGENT KEY VALUE`.
fn parse(words: &[String]) -> Result<Request, Refusal> {
    match words {
        [set, agent, key, value] if set == "set" => {
            Ok(Request::Set { agent: agent.clone(), key: key.clone(), value: value_of(value) })
        }
        _ => Err(Refusal::new("this lesson knows only: set AGENT KEY VALUE")),
    }
}

fn at(millis: i64, words: &str) -> TimedRequest {
    let words = words.split(' ').map(str::to_owned).collect();
    TimedRequest { at: Duration::millis(millis), words, place: Span::default() }
}

fn main() -> Result<(), sinew::runtime::CannotRun> {
    let mut plan = Plan::new("lesson 2");
    plan.add::<Cruise>("cruise", CruiseParams::default());
    plan.every("cruise", Duration::millis(200));
    plan.requests = vec![
        at(300, "set cruise speed 0.5"),
        at(500, "set cruise speed 5"),
        at(500, "set cruise spede 0.1"),
        at(700, "set cruise period 100ms"),
    ];
    let options = Options { limit: Some(Duration::secs(1)), parse, ..Options::default() };
    let report = Simulation::new(&plan, &registry![Cruise], options)?.run()?;
    for incident in &report.incidents {
        println!("{}", incident.what);
    }
    Ok(())
}

// Output:
// at 0.000 s: 0.3 m/s
// at 0.200 s: 0.3 m/s
// at 0.400 s: 0.5 m/s
// at 0.600 s: 0.5 m/s
// at 0.800 s: 0.5 m/s
// at 0.900 s: 0.5 m/s
// at 1.000 s: 0.5 m/s
// asked: set cruise speed 0.5
// asked: set cruise speed 5; refused: "speed" must lie from 0 to 1, not 5
// asked: set cruise spede 0.1; refused: there is no parameter of cruise "spede"; did you mean "speed"?
// asked: set cruise period 100ms

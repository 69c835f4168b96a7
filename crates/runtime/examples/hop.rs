//! How long one iteration source → 3 → sink takes in simulated time, every step timed and counted.
use runtime::*;
use types::Duration;
use types::messages::Offer;

/// Makes offers.
#[derive(Agent)]
struct Source {
    /// What it makes.
    out: Output<Offer>,
}
impl Agent for Source {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.out.send_with(|offer, _| {
            offer.weight += 1.0;
            0
        });
        Ok(())
    }
}
/// Passes offers on.
#[derive(Agent)]
struct Pass {
    /// What comes.
    from: Input<Offer>,
    /// What goes.
    to: Output<Offer>,
}
impl Agent for Pass {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(offer) = self.from.take() else { return Ok(()) };
        self.to.send_with(|place, _| {
            *place = *offer;
            0
        });
        Ok(())
    }
}
/// Takes offers.
#[derive(Agent)]
struct Sink {
    /// What comes.
    from: Input<Offer>,
    sum: f64,
}
impl Agent for Sink {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        if let Some(offer) = self.from.take() {
            self.sum += offer.weight;
        }
        Ok(())
    }
}

fn main() {
    let mut plan = Plan::new("hop");
    let source = plan.add::<Source>("source", NoParams);
    let a = plan.add::<Pass>("a", NoParams);
    let b = plan.add::<Pass>("b", NoParams);
    let c = plan.add::<Pass>("c", NoParams);
    let sink = plan.add::<Sink>("sink", NoParams);
    plan.wire(&source.out, &a.from);
    plan.wire(&a.to, &b.from);
    plan.wire(&b.to, &c.from);
    plan.wire(&c.to, &sink.from);
    plan.every("source", Duration::micros(10));
    for agent in ["a", "b", "c", "sink"] {
        plan.on(agent, "from");
    }
    for agent in &mut plan.agents {
        agent.executor = Some("control".into());
    }
    let options = Options { limit: Some(Duration::secs(10)), ..Options::default() };
    let report = Simulation::new(&plan, &registry![Source, Pass, Sink], options).and_then(Simulation::run);
    match report {
        Ok(report) => println!(
            "{} B: {:.1} ns an iteration",
            size_of::<Offer>(),
            report.wall * 1e9 / report.view.agents[0].counts.releases as f64
        ),
        Err(error) => println!("{error}"),
    }
}

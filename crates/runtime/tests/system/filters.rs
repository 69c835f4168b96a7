//! Which messages pass a wire.

use runtime::{Agent, Envelope, Fault, Input, Output, Plan, Sent, Simulation, Step, WirePlan, registry};
use types::messages::{Image, Twist};
use types::{AgentId, Duration, Time};

use crate::{Sink, Source, at, chain, heard, options, sink, types};

#[test]
fn a_filter_for_every_third_message_counts_each_message_once() {
    for (test, wires) in [("every-alone", 1), ("every-beside", 2)] {
        let mut plan = chain(test);
        let to_relay = plan.wires.iter_mut().find(|wire| wire.to == "relay.from").unwrap();
        to_relay.filter.every = 3;
        if wires == 2 {
            // A second route takes the other way through the output.
            plan.add::<Sink>("beside", sink("nobody asks"));
            plan.on("beside", "count");
            plan.wires.push(WirePlan::new("source.out", "beside.count"));
        }
        Simulation::new(&plan, &types(), options(100)).unwrap().run().unwrap();
        let numbers: Vec<i64> = heard(test).iter().map(|(_, twist)| twist.linear as i64).collect();
        assert_eq!(numbers, [1, 4, 7, 10], "{test}");
    }
}

/// Sends to the agents with the numbers 1 and 2 and to everybody, in turn.
#[derive(Agent)]
pub(crate) struct Postman {
    /// The count, as a speed.
    out: Output<Twist>,
    n: u32,
}

impl Agent for Postman {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.n += 1;
        let recipient = [AgentId::NONE, AgentId(1), AgentId(2)][self.n as usize % 3];
        let envelope = Envelope { recipient, ..Envelope::default() };
        self.out.send_as(envelope, Twist::new(f64::from(self.n), 0.0));
        Ok(())
    }
}

#[test]
fn a_filter_for_a_recipient_passes_what_is_for_it_or_for_everybody() {
    let mut plan = Plan::new("recipients");
    plan.add::<Postman>("postman", Default::default());
    plan.every("postman", Duration::millis(10));
    for (name, recipient) in [("one", Some("one")), ("two", Some("two")), ("all", None), ("spy", Some("one"))]
    {
        plan.add::<Sink>(name, sink(&format!("recipients-{name}")));
        plan.on(name, "count");
        let mut wire = WirePlan::new("postman.out", format!("{name}.count"));
        wire.filter.recipient = recipient.map(str::to_owned);
        plan.wires.push(wire);
    }
    plan.requests = vec![at(55, "remove one"), at(56, "unwire postman.out spy.count"), at(57, "remove one")];
    let report = Simulation::new(&plan, &types(), options(80)).unwrap().run().unwrap();
    let heard = |name: &str| -> Vec<f64> {
        heard(&format!("recipients-{name}")).iter().map(|(_, twist)| twist.linear).collect()
    };
    assert_eq!(heard("one"), [1.0, 3.0, 4.0, 6.0]);
    assert_eq!(heard("two"), [2.0, 3.0, 5.0, 6.0, 8.0, 9.0]);
    assert_eq!(heard("all"), (1..10).map(f64::from).collect::<Vec<_>>());
    assert_eq!(heard("spy"), heard("one"), "whoever is wired so hears what is for another");
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    let refused = "asked: remove one; refused: the wire from postman.out to spy.count takes what is for one";
    assert_eq!(
        said,
        [
            &format!("{refused}; cut that wire first"),
            "asked: unwire postman.out spy.count",
            "asked: remove one"
        ]
    );
    assert_eq!(report.view.wires[0].filter.recipient.as_deref(), Some("two"), "people see the name");

    plan.wires[0].filter.recipient = Some("oen".into());
    let said = Simulation::new(&plan, &types(), options(80)).map(drop).unwrap_err().to_string();
    assert_eq!(said, "the plan has 1 mistakes, the first: there is no agent \"oen\"; did you mean \"one\"?");
}

#[test]
fn who_was_given_up_comes_back_under_its_number_and_its_wires_go_on_counting() {
    let mut plan = Plan::new("recipient-back");
    plan.add::<Postman>("postman", Default::default());
    plan.every("postman", Duration::millis(10));
    for name in ["one", "two", "spy"] {
        let test = if name == "two" { "recipient-back-two".into() } else { format!("recipient-back-{name}") };
        plan.add::<Sink>(name, sink(&test));
        plan.on(name, "count");
        plan.agent_mut(name).unwrap().executor = Some(["reflex", "control", "vision"][name.len() % 3].into());
    }
    plan.agent_mut("one").unwrap().executor = Some("ordinary".into());
    for (to, recipient) in [("one", "one"), ("spy", "one"), ("two", "two")] {
        let mut wire = WirePlan::new("postman.out", format!("{to}.count"));
        wire.filter.recipient = Some(recipient.into());
        plan.wires.push(wire);
    }
    plan.requests = vec![at(105, "fault one hang")];
    let report = Simulation::new(&plan, &types(), options(3000)).unwrap().run().unwrap();
    let one = &report.view.agents[1];
    assert_eq!((one.id, one.counts.hangs, one.counts.restarts), (AgentId(1), 1, 1), "{:?}", report.incidents);
    let heard = |name: &str| -> Vec<f64> {
        heard(&format!("recipient-back-{name}")).iter().map(|(_, twist)| twist.linear).collect()
    };
    let all: Vec<f64> = (1..=301).filter(|n| n % 3 != 2).map(f64::from).collect();
    assert_eq!(heard("spy"), all, "whoever hears what is for it");
    let (first, last) = (heard("one")[0], heard("one").last().copied());
    assert_eq!((first, last), (all[0], all.last().copied()), "it hears again");
    let wire = &report.view.wires[0];
    assert_eq!(wire.sent + wire.refused, all.len() as u64, "{wire:?}");
    assert_eq!(wire.sent, wire.taken + wire.dropped, "what lay in its mailbox is counted: {wire:?}");
    assert_eq!(wire.taken, heard("one").len() as u64);
}

/// Sends to the agents `one` and `two` and to everybody in turn.
#[derive(Agent)]
struct Chooser {
    /// Speeds.
    out: Output<Twist>,
    /// Speeds, to one alone.
    alone: Output<Twist>,
    /// Pictures.
    #[port(rows = 4, history = 2)]
    picture: Output<Image>,
    n: u32,
}

impl Agent for Chooser {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        self.n += 1;
        let (one, two) = (step.agent_named("one"), step.agent_named("two"));
        let (one, two) = (one.ok_or(Fault::new("no one"))?, two.ok_or(Fault::new("no two"))?);
        let speed = Twist::new(f64::from(self.n), 0.0);
        let sent = |taken| Sent { taken, refused: 0 };
        if step.now == Time::ZERO + Duration::millis(60) {
            // What fills a message may die of it: the others are wired as before to whoever comes after.
            self.out.fill_to(one, Envelope::default(), |_, _| panic!("no speed"));
        }
        match self.n % 4 {
            0 => {
                assert_eq!((self.out.send_to(one, speed), self.alone.send_to(one, speed)), (sent(1), sent(0)))
            }
            1 => assert_eq!((self.out.send(speed), self.alone.send(speed)), (sent(3), sent(1))),
            2 => drop((self.out.send_to(two, speed), self.alone.send_to(two, speed))),
            _ => assert_eq!(
                (self.out.send_to(AgentId(77), speed), self.out.send_to(AgentId::NONE, speed)),
                (sent(0), sent(0))
            ),
        }
        let chosen = if self.n.is_multiple_of(2) { one } else { two };
        let n = self.n as u8;
        let taken = self.picture.fill_to(chosen, Envelope::default(), |_, row| {
            row.fill(n);
            4
        });
        assert_eq!(taken, sent(1));
        Ok(())
    }
}

/// Says what it sees as speeds.
#[derive(Agent)]
struct Looker {
    /// Pictures.
    picture: Input<Image>,
    /// Speeds.
    count: Input<Twist>,
    /// Speeds again.
    out: Output<Twist>,
}

impl Agent for Looker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        while let Some(picture) = self.picture.take() {
            let seen = Twist::new(f64::from(picture.row()[3]), 1.0);
            drop(picture);
            self.out.send(seen);
        }
        while let Some(twist) = self.count.take() {
            let twist = *twist;
            self.out.send(twist);
        }
        Ok(())
    }
}

#[test]
fn what_is_for_one_reaches_one_alone_and_filters_stay_as_they_were() {
    let mut plan = Plan::new("chosen");
    plan.add::<Chooser>("chooser", Default::default());
    plan.every("chooser", Duration::millis(10));
    for name in ["one", "two", "three"] {
        plan.add::<Looker>(name, Default::default());
        plan.add::<Sink>(&format!("sink-{name}"), sink(&format!("chosen-{name}")));
        ["picture", "count"].iter().for_each(|input| plan.on(name, input));
        plan.on(&format!("sink-{name}"), "count");
        plan.wires.push(WirePlan::new(format!("{name}.out"), format!("sink-{name}.count")));
        plan.wires.push(WirePlan::new("chooser.picture", format!("{name}.picture")));
        let mut wire = WirePlan::new("chooser.out", format!("{name}.count"));
        // Every second of what is for it, chosen or not.
        wire.filter.every = if name == "two" { 2 } else { 0 };
        plan.wires.push(wire);
    }
    plan.wires.push(WirePlan::new("chooser.alone", "two.count"));
    let types = registry![Chooser, Looker, Sink, Source];
    let report = Simulation::new(&plan, &types, options(330)).unwrap().run().unwrap();
    let chooser = report.view.agents.iter().find(|agent| agent.name == "chooser").unwrap();
    assert_eq!((chooser.counts.panics, chooser.counts.restarts), (1, 1), "{:?}", report.incidents);
    let heard = |name: &str, kind: f64| -> Vec<i64> {
        let heard = heard(&format!("chosen-{name}"));
        heard
            .iter()
            .filter(|(_, twist)| twist.angular == kind)
            .map(|(_, twist)| twist.linear as i64)
            .collect()
    };
    // It dies in its seventh step, and its successor counts anew.
    assert_eq!(heard("one", 0.0)[..7], [1, 4, 5, 1, 4, 5, 8]);
    assert_eq!(
        heard("two", 0.0)[..9],
        [1, 1, 2, 5, 5, 6, 1, 1, 2],
        "what comes by the other wire is no second one"
    );
    assert_eq!(heard("three", 0.0)[..5], [1, 5, 1, 5, 9], "only what is for everybody");
    assert_eq!(heard("one", 1.0)[..5], [2, 4, 6, 2, 4]);
    assert_eq!(heard("two", 1.0)[..5], [1, 3, 5, 1, 3]);
    assert_eq!(heard("three", 1.0), [0i64; 0]);
}

//! The world is changed while it runs, by calls from outside.

use hardware::simulated::{self, Robot as Body, SERVICES};
use hardware::{Berth, Gate, Latch, Robot};
use runtime::{AgentPlan, Options, Plan, Registry, Request, Simulation};
use sim::{Model, WorldPlan};
use types::messages::{WorldAnswer, WorldName, WorldPlace, WorldPush, WorldSlip, WorldThing};
use types::{Duration, Message, Pose, Time};

fn bytes(message: &impl Message) -> Vec<u8> {
    let mut out = types::cdr::Writer::new();
    message.encode(&[], Time::ZERO, &mut out);
    out.bytes().to_vec()
}

#[test]
fn calls_change_the_world_and_are_refused_with_the_reason() {
    let body = Body { name: "h1".into(), model: Model::h1(), start: Pose::new(5.0, 5.0, 0.0), goal: None };
    let (mut bodies, truth) = simulated::raise(&WorldPlan::hall(10.0, 10.0), 7, &[body]).unwrap();
    let hands = bodies[0].hands();
    let gate = Gate::new(bodies.remove(0), Latch::private());
    let registry = Registry::new([Berth::with(gate).agent_type("robot"), hands.agent_type("world")]);
    let mut plan = Plan::new("hands");
    plan.add::<Robot>("h1", Default::default());
    plan.every("h1", hardware::robot::CYCLE);
    plan.on("h1", "drive");
    plan.agents.push(AgentPlan {
        name: "world".into(),
        kind: "world".into(),
        on: SERVICES.map(str::to_owned).to_vec(),
        ..AgentPlan::default()
    });
    let simulation = Simulation::new(&plan, &registry, Options::default()).unwrap();
    let control = simulation.control();
    let runs = std::thread::Builder::new()
        .name("run".into())
        .spawn(move || simulation.run().map(|_| ()).map_err(|error| error.to_string()))
        .unwrap();
    let call = |service: &str, question: Vec<u8>| {
        let answer = control.call(service, question, Duration::secs(2)).unwrap();
        WorldAnswer::decode(&mut types::cdr::Reader::new(&answer).unwrap(), &mut Vec::new()).unwrap()
    };
    let wall =
        WorldThing { name: "wall".into(), x: 6.0, y: 5.0, length: 0.1, width: 2.0, ..WorldThing::default() };
    assert_eq!(
        call("world.add", bytes(&wall)),
        WorldAnswer { done: true, part: 1.0, ..WorldAnswer::default() }
    );
    let inside = WorldThing { name: "b".into(), x: 5.1, ..wall };
    let refused = call("world.add", bytes(&inside));
    assert!(!refused.done && refused.why.as_str() == "it would stand in h1", "{refused:?}");
    let taken = call("world.add", bytes(&wall));
    assert!(taken.why.as_str().contains("there is a wall already"), "{taken:?}");
    let colour = WorldThing { name: "c".into(), colour: "reddish".into(), ..wall };
    assert!(call("world.add", bytes(&colour)).why.as_str().contains("colour"));
    assert_eq!(truth.added().len(), 1);
    assert_eq!(truth.snapshot().added[0].name.as_str(), "wall");
    // Pushed ahead it comes up to the wall: 5.95 m less its radius.
    let push = WorldPush { robot: "h1".into(), ahead: 1.0, ..WorldPush::default() };
    let pushed = call("world.push", bytes(&push));
    assert!(pushed.done && (pushed.part - 0.725).abs() < 1e-6, "{pushed:?}");
    let touched = truth.robot("h1").unwrap().truth;
    assert_eq!((touched.collisions, touched.bumped), (0, 1));
    let nobody = WorldSlip { robot: "h7".into(), ..WorldSlip::default() };
    assert_eq!(call("world.slip", bytes(&nobody)).why.as_str(), "there is no h7");
    let long = WorldSlip { robot: "h1".into(), seconds: f64::NAN, ..WorldSlip::default() };
    assert!(!call("world.slip", bytes(&long)).done);
    assert!(call("world.slip", bytes(&WorldSlip { seconds: 1.0, left: 0.5, ..long })).done);
    let away = WorldPlace { name: "h1".into(), x: 2.0, y: 2.0, heading: 1.0 };
    assert!(call("world.put", bytes(&away)).done);
    assert_eq!(truth.robot("h1").unwrap().truth.pose, Pose::new(2.0, 2.0, 1.0));
    assert!(call("world.remove", bytes(&WorldName { name: "wall".into() })).done);
    assert!(!call("world.remove", bytes(&WorldName { name: "wall".into() })).done);
    assert_eq!(truth.added().len(), 0);
    control.request(Request::Quit).unwrap();
    runs.join().unwrap().unwrap();
}

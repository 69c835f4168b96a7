//! The emergency stop while everything else is busy.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hardware::simulated::{self, Robot as Body};
use hardware::{Berth, Cause, Gate, Latch, Robot};
use runtime::{
    Agent, Fault, Incident, Live, NoParams, Observer, Options, Output, Plan, Step, Verdict, registry,
};
use sim::{Model, WorldPlan};
use types::messages::Twist;
use types::{Duration, Pose, Time};

/// Drives ahead, whatever happens.
#[derive(Agent)]
struct Pusher {
    /// Where to drive.
    drive: Output<Twist>,
}

impl Agent for Pusher {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        self.drive.send(Twist::new(0.4, 0.0));
        Ok(())
    }
}

/// Never comes back from its step, as long as the test lasts.
#[derive(Agent)]
struct Hog {
    over: Arc<AtomicBool>,
}

impl Agent for Hog {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        spin(&self.over);
        Ok(())
    }
}

fn spin(over: &AtomicBool) {
    while !over.load(Ordering::Relaxed) {
        std::hint::spin_loop();
    }
}

/// Keeps the thread of the control side from its first look until the test is over.
struct Blocked(Arc<AtomicBool>);

impl Observer for Blocked {
    fn every(&self) -> Duration {
        Duration::millis(10)
    }

    fn observe(&mut self, _: Time, _: &[Incident]) -> Verdict {
        spin(&self.0);
        Verdict::End("the test is over".into())
    }
}

#[test]
fn a_stop_reaches_the_wheels_while_control_an_executor_and_every_processor_are_busy() {
    let body = Body { name: "h1".into(), model: Model::h1(), start: Pose::new(2.0, 5.0, 0.0), goal: None };
    let (mut bodies, truth) = simulated::raise(&WorldPlan::hall(50.0, 10.0), 7, &[body]).unwrap();
    let latch = Latch::private();
    let gate = Gate::new(bodies.remove(0), latch.clone());
    let counts = gate.counts();
    let over = Arc::new(AtomicBool::new(false));
    let (mut plan, mut registry) = (Plan::new("busy"), registry![Robot, Pusher]);
    let robot = plan.add::<Robot>("h1", Default::default());
    plan.agent_mut("h1").unwrap().kind = "h1".to_owned();
    plan.every("h1", hardware::robot::CYCLE);
    let pusher = plan.add::<Pusher>("pusher", Default::default());
    plan.every("pusher", Duration::millis(50));
    plan.wire(&pusher.drive, &robot.drive);
    let _ports = plan.add::<Hog>("hog", Default::default());
    plan.every("hog", Duration::secs(1));
    let hog = plan.agent_mut("hog").unwrap();
    (hog.kind, hog.executor) = ("hog".to_owned(), Some("vision".to_owned()));
    let flag = over.clone();
    let make = move |_: NoParams| {
        let mut hog = <Hog as runtime::Declare>::build(NoParams);
        hog.over = flag.clone();
        hog
    };
    registry.extend([Berth::with(gate).agent_type("h1"), runtime::AgentType::made_by(make).named("hog")]);

    let options = Options { observer: Box::new(Blocked(over.clone())), ..Options::default() };
    let live = Live::new(&plan, &registry, options).unwrap();
    let moment = || truth.robot("h1").unwrap().truth;
    std::thread::scope(|scope| {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        (0..2 * processors).for_each(|_| drop(scope.spawn(|| spin(&over))));
        let run = scope.spawn(move || live.run());
        let until = |what: &dyn Fn() -> bool| {
            while !what() {
                std::thread::park_timeout(std::time::Duration::from_millis(1));
            }
        };
        until(&|| truth.robot("h1").is_some_and(|robot| robot.truth.distance > 0.05));
        latch.set(Cause::Person, Time::ZERO);
        let (commands, way) = (counts.latched.get(), moment().distance);
        // What is pushed on after that does not arrive; the wheels come to rest by themselves.
        until(&|| counts.latched.get() > commands + 10);
        let at_rest = moment().distance;
        until(&|| counts.latched.get() > commands + 20);
        let after = moment().distance;
        over.store(true, Ordering::Relaxed);
        let report = run.join().unwrap().unwrap();
        assert_eq!(report.ended, "the test is over");
        // 0.5 s lie between the two; at its speed it would have gone 0.2 m.
        assert!(after - at_rest < 0.005, "{way} m at the stop, then {at_rest} and {after} m");
        assert_eq!(counts.latch_sets.get(), 1);
    });
}

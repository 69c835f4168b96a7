//! What who asks for a task is answered, and what becomes of the tasks: navigation, both supervisors and two actions in a system.

use std::sync::{Arc, Mutex};

use agents::navigation::NavigationParams;
use agents::process_supervisor::{ModeTable, ProcessParams};
use agents::{GotoAction, MoveAction, Navigation, ProcessSupervisor, RealTimeSupervisor};
use runtime::{
    Agent, AgentType, Client, Declare, Fault, Input, NoParams, Output, Plan, Reply, Simulation, Step,
    registry,
};
use types::messages::{Answer, Goal, Manoeuvre, Odometry, Progress, Report};
use types::value::{Table, Value};
use types::{Duration, Time};

/// What was told, and how the calls were answered, in order.
#[derive(Default)]
struct Told {
    answers: Vec<Answer>,
    reports: Vec<Report>,
}

type Heard = Arc<Mutex<Told>>;

/// Stands where it is, and asks for something else every second.
#[derive(Agent)]
struct Asker {
    /// Where it is.
    odometry: Output<Odometry>,
    /// To places.
    go: Client<Goal, Answer>,
    /// For manoeuvres.
    drive: Client<Manoeuvre, Answer>,
    /// What becomes of it.
    report: Input<Report>,
    heard: Heard,
    asked: usize,
}

impl Agent for Asker {
    fn step(&mut self, step: &mut Step) -> Result<(), Fault> {
        let mut heard = self.heard.lock().unwrap();
        self.odometry.send(Odometry { frame: "odom".into(), ..Odometry::default() });
        while let Some((_, reply)) = self.go.reply() {
            let Reply::Answer(answer) = reply else { return Err(Fault::new("no answer")) };
            heard.answers.push(answer);
        }
        while let Some((_, reply)) = self.drive.reply() {
            let Reply::Answer(answer) = reply else { return Err(Fault::new("no answer")) };
            heard.answers.push(answer);
        }
        while let Some(report) = self.report.take() {
            heard.reports.push(*report);
        }
        let within = Duration::secs(1);
        if step.now < Time::from_seconds(1.0 + self.asked as f64) {
            return Ok(());
        }
        self.asked += 1;
        let place = Goal { x: 3.0, y: 1.0, ..Goal::default() };
        let asked = match self.asked {
            1 => self.go.call(place, within).is_ok(),
            2 => self.go.call(Goal { mode: "gotto".into(), ..place }, within).is_ok(),
            3 => self.go.call(Goal { mode: "move-only".into(), ..place }, within).is_ok(),
            4 => self.go.call(Goal { mode: "nobody".into(), ..place }, within).is_ok(),
            5 => self.go.call(Goal::default(), within).is_ok(),
            6 => {
                let fast = Manoeuvre { linear: 5.0, seconds: 2.0, ..Manoeuvre::default() };
                self.drive.call(fast, within).is_ok()
            }
            7 => self.go.call(place, within).is_ok(),
            _ => true,
        };
        if asked { Ok(()) } else { Err(Fault::new("nobody can be asked")) }
    }
}

/// The modes, each with one agent.
fn modes(rows: &[(&str, &str)]) -> ModeTable {
    let mut table = Table::new();
    for (mode, agent) in rows {
        let mut row = Table::new();
        row.set(agent, Value::Float(1.0));
        table.set(mode, Value::Table(row));
    }
    ModeTable::new(&table)
}

/// Those that must not take memory.
const REAL_TIME: [&str; 3] = ["goto", "move", "supervisor"];

fn run() -> (runtime::Report, Heard) {
    let mut plan = Plan::new("asking");
    let asker = plan.add::<Asker>("asker", Default::default());
    let params = NavigationParams { goto_mode: "goto".into(), frame: "odom".into(), ..Default::default() };
    let navigation = plan.add::<Navigation>("navigation", params);
    let modes = modes(&[("goto", "goto"), ("move", "move"), ("move-only", "move"), ("nobody", "gone")]);
    let processes =
        plan.add::<ProcessSupervisor>("processes", ProcessParams { modes, ..ProcessParams::default() });
    let supervisor = plan.add::<RealTimeSupervisor>("supervisor", Default::default());
    let goto = plan.add::<GotoAction>("goto", Default::default());
    let mover = plan.add::<MoveAction>("move", Default::default());
    plan.wire(&asker.go, &navigation.go);
    plan.wire(&asker.drive, &navigation.drive);
    plan.wire(&navigation.report, &asker.report);
    plan.wire(&navigation.task, &processes.tasks);
    plan.wire(&processes.refused, &navigation.refused);
    plan.wire(&processes.mode, &supervisor.mode);
    plan.wire(&processes.task, &supervisor.task);
    plan.wire(&supervisor.status, &navigation.status);
    plan.wire(&asker.odometry, &goto.odometry);
    plan.wire(&asker.odometry, &mover.odometry);
    plan.wire(&supervisor.modes, &goto.mode);
    plan.wire(&supervisor.modes, &mover.mode);
    plan.wire(&supervisor.tasks, &goto.task);
    plan.wire(&supervisor.tasks, &mover.task);
    plan.wire(&goto.report, &supervisor.reports);
    plan.wire(&mover.report, &supervisor.reports);
    for name in ["asker", "goto", "move", "supervisor"] {
        plan.every(name, Duration::millis(20));
    }
    for name in ["navigation", "processes"] {
        plan.every(name, Duration::millis(50));
    }
    for name in REAL_TIME {
        plan.agent_mut(name).unwrap().executor = Some("reflex".into());
    }
    let heard = Heard::default();
    let own = heard.clone();
    let mut registry = registry![Navigation, ProcessSupervisor, RealTimeSupervisor, GotoAction, MoveAction];
    registry.extend([AgentType::made_by(move |_: NoParams| {
        let mut asker = <Asker as Declare>::build(NoParams);
        asker.heard = own.clone();
        asker
    })]);
    let options = runtime::Options { limit: Some(Duration::secs(20)), ..Default::default() };
    let report = Simulation::new(&plan, &registry, options).unwrap().run().unwrap();
    (report, heard)
}

#[test]
fn who_asks_is_answered_what_will_become_of_it_and_every_task_ends_with_its_reason_and_no_memory() {
    let (report, heard) = run();
    let heard = heard.lock().unwrap();
    let answers: Vec<(bool, u32, &str)> =
        heard.answers.iter().map(|answer| (answer.accepted, answer.task, answer.why.as_str())).collect();
    let expected = [
        (true, 1, "goto"),
        (false, 0, "there is no mode \"gotto\"; did you mean \"goto\"?"),
        (false, 0, "nobody in the mode \"move-only\" goes to a place; that is done in: goto"),
        (false, 0, "the mode \"nobody\" needs \"gone\", which is not there or not alive"),
        (false, 0, "x and y are needed, as in x=3 y=1"),
        (false, 0, "5 m/s is faster than the move action's linear_max of 0.5 m/s"),
        (true, 6, "goto"),
    ];
    assert_eq!(answers, expected);
    let over = heard.reports.iter().filter(|report| report.progress.is_over());
    let ends: Vec<(u32, Progress, &str)> =
        over.map(|report| (report.task, report.progress, report.why.as_str())).collect();
    // What was refused before it began has replaced nothing; a robot that does not move is told to be held in the end.
    assert_eq!(ends.len(), 3, "{ends:?}");
    assert_eq!(ends[0].0, 1);
    assert_eq!((ends[1].0, ends[1].1, ends[1].2), (5, Progress::Refused, expected[5].2));
    assert_eq!((ends[2].0, ends[2].1), (6, Progress::Unreachable));
    assert!(ends[2].2.contains("latch"), "{ends:?}");
    assert!(report.view.allocations_watched, "by the allocator of this program");
    for agent in report.view.agents.iter().filter(|agent| REAL_TIME.contains(&agent.name.as_str())) {
        assert!(agent.counts.releases > 300 && agent.counts.allocations == 0, "{}", agent.name);
    }
}

//! Executors that run by their agent's deadline.

use runtime::{AgentView, ExecutorPlan, Live, Report};
use std::sync::{MutexGuard, PoisonError};

use super::*;

/// The kernel has so much to give and no more: one test at a time asks for it.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds a source with an executor of its own, both of this name.
fn by_deadline(plan: &mut Plan, name: &str, period: Duration, cost: Duration) {
    plan.add::<Source>(name, SourceParams::default());
    plan.every(name, period);
    let agent = plan.agent_mut(name).unwrap();
    (agent.executor, agent.cost) = (Some(name.to_owned()), Some(cost));
    plan.executors.push(ExecutorPlan::by_deadline(name));
}

/// Runs a system until `done` says so of what the agents look like, or for twenty seconds. Asks for something once before it looks.
fn run_until(
    plan: &Plan,
    request: Option<&str>,
    done: impl Fn(&[AgentView]) -> bool + Send + 'static,
) -> (Report, Option<Refusal>) {
    let options = Options { limit: Some(Duration::secs(20)), ..options(0) };
    let live = Live::new(plan, &types(), options).unwrap();
    let control = live.control();
    let request =
        request.map(|words| parse(&words.split(' ').map(str::to_owned).collect::<Vec<_>>()).unwrap());
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        // Who has made a step has asked for what it needs.
        let stepped = |agents: &[AgentView]| agents.iter().all(|agent| agent.counts.releases > 2);
        while control.view().is_ok_and(|view| !stepped(&view.agents)) {
            std::thread::yield_now();
        }
        let refused = request.and_then(|request| control.request(request).err());
        while control.view().is_ok_and(|view| !done(&view.agents)) {
            std::thread::yield_now();
        }
        let _ = control.request(Request::Quit);
        refused
    });
    let report = live.run().unwrap();
    (report, asker.unwrap().join().unwrap())
}

/// Whether nobody has got anything, and nobody will.
fn is_denied(agents: &[AgentView]) -> bool {
    agents.iter().all(|agent| agent.granted.starts_with("ordinary"))
}

fn is_granted(agent: &AgentView) -> bool {
    agent.asked == agent.granted
}

/// Whether the machine gives anything at all, which is told where it does not.
#[allow(clippy::print_stdout)] // for those who look at the test
fn is_given(report: &Report) -> bool {
    let given = report.view.agents.iter().any(|agent| agent.granted.starts_with("deadline "));
    if !given {
        let agent = &report.view.agents[0];
        println!("skipped: asked for {}, granted {}", agent.asked, agent.granted);
    }
    given
}

/// The policy of each thread of this name, as the kernel tells it.
fn policies(name: &str) -> Vec<String> {
    let threads = std::fs::read_dir("/proc/self/task").unwrap().flatten().map(|thread| thread.path());
    let named = |thread: &std::path::PathBuf| {
        std::fs::read_to_string(thread.join("comm")).is_ok_and(|comm| comm.trim() == name)
    };
    let policy = |thread: std::path::PathBuf| {
        let stat = std::fs::read_to_string(thread.join("stat")).unwrap_or_default();
        // The 41st field; the second is the name, in brackets.
        stat.rsplit(')').next().and_then(|rest| rest.split_whitespace().nth(38)).unwrap_or("none").to_owned()
    };
    let mut policies: Vec<String> = threads.filter(named).map(policy).collect();
    policies.sort_unstable();
    policies
}

#[test]
fn the_kernel_is_asked_for_the_agents_cost_by_its_deadline() {
    let _alone = alone();
    let mut plan = Plan::new("by-deadline");
    by_deadline(&mut plan, "arm", Duration::millis(16), Duration::millis(1));
    plan.agent_mut("arm").unwrap().deadline = Some(Duration::millis(8));
    let seen = Arc::new(Mutex::new(Vec::new()));
    let saw = seen.clone();
    let (report, _) = run_until(&plan, None, move |agents| {
        let policies = policies("sinew-arm");
        // The spare thread waits by a priority, if it may, when it has come so far.
        let at_rest = policies == ["1", "6"] || is_denied(agents);
        *saw.lock().unwrap() = policies;
        agents[0].counts.releases > 20 && at_rest
    });
    let arm = &report.view.agents[0];
    assert!(arm.counts.releases > 20, "{report:#?}");
    assert_eq!(arm.asked, "deadline 1220us/8ms/15500us");
    if is_given(&report) {
        assert_eq!(arm.granted, arm.asked);
        assert_eq!(*seen.lock().unwrap(), ["1", "6"]);
    }
}

/// What so many processors have is asked for twice over, in parts of six tenths.
#[test]
fn what_the_kernel_has_not_is_refused_aloud_and_the_system_runs() {
    let _alone = alone();
    let mut plan = Plan::new("too-much");
    let processors = std::thread::available_parallelism().unwrap().get();
    for at in 0..2 * processors {
        by_deadline(&mut plan, &format!("arm{at}"), Duration::millis(20), Duration::micros(9980));
    }
    let (report, _) = run_until(&plan, None, |agents| agents.iter().all(|agent| agent.counts.releases > 10));
    let agents = &report.view.agents;
    assert!(agents.iter().all(|agent| agent.counts.releases > 10), "{report:#?}");
    assert!(agents.iter().all(|agent| agent.asked == "deadline 11996us/20ms/20ms"));
    let (given, refused): (Vec<&AgentView>, Vec<&AgentView>) =
        agents.iter().partition(|agent| is_granted(agent));
    assert!(!refused.is_empty(), "{agents:#?}");
    if is_given(&report) {
        assert!(!given.is_empty());
        let why = std::io::Error::from_raw_os_error(16);
        let ordinary = format!("ordinary ({why})");
        assert!(refused.iter().all(|agent| agent.granted == ordinary), "{refused:#?}");
    }
}

/// All that there is belongs to somebody: who takes over gets it only when it has been taken from the thread that hangs.
#[test]
fn the_thread_that_takes_over_gets_what_the_one_that_hangs_had() {
    let _alone = alone();
    let mut plan = Plan::new("by-deadline-hang");
    let processors = std::thread::available_parallelism().unwrap().get();
    for at in 0..processors {
        by_deadline(&mut plan, &format!("arm{at}"), Duration::millis(20), Duration::micros(14_000));
    }
    let (report, refused) = run_until(&plan, Some("fault arm0 hang"), |agents| {
        let arm = &agents[0].counts;
        (arm.hangs, arm.restarts) == (1, 1) && (is_granted(&agents[0]) || is_denied(agents))
    });
    assert_eq!(refused, None);
    let arm = &report.view.agents[0];
    assert_eq!((arm.counts.hangs, arm.counts.restarts), (1, 1), "{report:#?}");
    if is_given(&report) {
        assert!(report.view.agents.iter().all(is_granted), "{:#?}", report.view.agents);
    }
}

#[test]
fn another_period_is_another_budget() {
    let _alone = alone();
    let mut plan = Plan::new("by-deadline-period");
    by_deadline(&mut plan, "arm", Duration::millis(10), Duration::millis(1));
    let (report, refused) =
        run_until(&plan, Some("set arm period 20ms"), |agents| is_granted(&agents[0]) || is_denied(agents));
    assert_eq!(refused, None);
    assert_eq!(report.view.agents[0].asked, "deadline 1220us/20ms/20ms");
    if is_given(&report) {
        assert!(is_granted(&report.view.agents[0]), "{:#?}", report.view.agents);
    }
}

#[test]
fn who_comes_to_an_empty_executor_is_asked_for_and_who_leaves_needs_nothing() {
    let _alone = alone();
    let mut plan = Plan::new("by-deadline-late");
    by_deadline(&mut plan, "arm", Duration::millis(10), Duration::millis(1));
    let late = AgentPlan { name: "late".into(), ..plan.agents[0].clone() };
    let options = Options { limit: Some(Duration::secs(20)), ..options(0) };
    let live = Live::new(&plan, &types(), options).unwrap();
    let control = live.control();
    let asker = std::thread::Builder::new().name("asker".into()).spawn(move || {
        let wait_until = |done: &dyn Fn(&[AgentView]) -> bool| {
            while control.view().is_ok_and(|view| !done(&view.agents)) {
                std::thread::yield_now();
            }
        };
        let ran = |agents: &[AgentView]| agents[0].counts.releases > 2;
        wait_until(&|agents| ran(agents) && (is_granted(&agents[0]) || is_denied(agents)));
        let was_given = control.view().is_ok_and(|view| is_granted(&view.agents[0]));
        control.request(parse(&["remove".into(), "arm".into()]).unwrap()).unwrap();
        // Its threads are as ordinary ones, but for the spare one that waits by a priority.
        let empty = || policies("sinew-arm");
        wait_until(&|_| !was_given || empty() == ["0", "1"]);
        let seen = empty();
        control.request(Request::Add(late)).unwrap();
        wait_until(&|agents| ran(agents) && (is_granted(&agents[0]) || is_denied(agents)));
        let _ = control.request(Request::Quit);
        seen
    });
    let report = live.run().unwrap();
    let seen = asker.unwrap().join().unwrap();
    if is_given(&report) {
        assert!(is_granted(&report.view.agents[0]), "{:#?}", report.view.agents);
        assert_eq!(seen, ["0", "1"]);
    }
}

#[test]
fn what_does_not_go_by_deadline_is_told_at_once() {
    let mut plan = Plan::new("mistakes");
    by_deadline(&mut plan, "arm", Duration::millis(10), Duration::millis(1));
    assert_eq!(runtime::check(&plan, &types()), []);
    let executor = &mut plan.executors[0];
    (executor.priority, executor.cpus, executor.spin) = (Some(50), vec![0], Duration::micros(5));
    by_deadline(&mut plan, "tight", Duration::millis(10), Duration::millis(11));
    by_deadline(&mut plan, "dear", Duration::millis(10), Duration::millis(1));
    plan.agent_mut("dear").unwrap().cost = None;
    plan.add::<Source>("more", SourceParams::default());
    plan.every("more", Duration::millis(5));
    plan.agent_mut("more").unwrap().executor = Some("arm".into());
    let said: Vec<String> = runtime::check(&plan, &types()).iter().map(ToString::to_string).collect();
    let wanted = [
        "executor \"arm\" has \"priority\" under policy \"deadline\"",
        "executor \"arm\" has \"cpus\" under policy \"deadline\"",
        "executor \"arm\" has \"spin\" under policy \"deadline\"",
        "tight needs 11ms, and has 10ms for it",
        "dear has no cost, and under \"deadline\"",
        "executor \"arm\" runs by the deadline of arm, and has no room for more",
        "more has no cost",
    ];
    assert_eq!(said.len(), wanted.len(), "{said:#?}");
    for (said, wanted) in said.iter().zip(wanted) {
        assert!(said.starts_with(wanted), "{said}");
    }
}

#[test]
fn a_change_that_does_not_go_by_deadline_is_refused() {
    let mut plan = Plan::new("refused");
    by_deadline(&mut plan, "reflex", Duration::millis(10), Duration::millis(4));
    let asked = [
        "set reflex period 3ms",
        "set reflex period 5ms",
        "add second source",
        "remove reflex",
        "add second source",
    ];
    plan.requests = (5..).zip(asked).map(|(time, words)| super::at(time, words)).collect();
    let report = Simulation::new(&plan, &types(), options(30)).unwrap().run().unwrap();
    let said: Vec<&str> = report.incidents.iter().map(|incident| incident.what.as_str()).collect();
    let wanted = [
        "asked: set reflex period 3ms; refused: reflex needs 4ms, and has 3ms for it",
        "asked: set reflex period 5ms",
        "asked: add second source; refused: executor \"reflex\" runs by the deadline of reflex, and has no room for second",
        "asked: remove reflex",
        "asked: add second source; refused: second has no cost, and under \"deadline\" it gets as much time as it says",
    ];
    for (said, wanted) in said.iter().zip(wanted) {
        assert!(said.starts_with(wanted), "{said}");
    }
    assert_eq!(said.len(), wanted.len(), "{said:#?}");
}

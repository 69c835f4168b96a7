//! Burdens on the wall clock: processes of their own that take processors away from the run, at their times.
//!
//! Such a process is this program again, as a system of one agent that works its share of every period. So it asks for its priority as any
//! executor does, and ends with its time, or with the process that began it.

use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration as HostDuration;

use clap::Args;
use runtime::{Agent, Burden, Declare as _, ExecutorPlan, Fault, Live, Options, Plan, Step, registry};
use types::Duration;
use types::params::Params;

use crate::cli::duration;
use crate::error::Failure;
use crate::terminal;

/// How often it is looked whether one begins or ends.
const LOOK: HostDuration = HostDuration::from_millis(5);

/// What such a process is told.
#[derive(Args, Clone, Debug)]
pub(crate) struct BurdenArgs {
    #[arg(long)]
    priority: u8,
    #[arg(long, value_delimiter = ',')]
    cpus: Vec<usize>,
    #[arg(long, value_parser = duration)]
    work: Duration,
    #[arg(long, value_parser = duration)]
    period: Duration,
    #[arg(long = "for", value_parser = duration)]
    limit: Duration,
}

/// How much it works.
#[derive(Clone, Debug, Params)]
struct WorkParams {
    /// How long it works in a step (time). 1 ms is a tenth of a processor at the usual period.
    #[param(default = Duration::millis(1))]
    work: Duration,
}

/// Keeps its processor busy.
#[derive(Agent)]
struct Work {
    params: WorkParams,
}

impl Agent for Work {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let begun = terminal::host_now();
        while begun.elapsed().as_nanos() < self.params.work.0 as u128 {
            std::hint::spin_loop();
        }
        Ok(())
    }
}

/// Is such a process.
pub(crate) fn burden(args: &BurdenArgs) -> Result<ExitCode, Failure> {
    let mut plan = Plan::new("burden");
    let executor = ExecutorPlan { cpus: args.cpus.clone(), ..ExecutorPlan::new("work", Some(args.priority)) };
    plan.executors.push(executor);
    let _ = plan.add::<Work>(Work::KIND, WorkParams { work: args.work });
    plan.every(Work::KIND, args.period);
    if let Some(agent) = plan.agent_mut(Work::KIND) {
        agent.executor = Some("work".to_owned());
    }
    let options = Options { limit: Some(args.limit), ..Options::default() };
    let live =
        Live::new(&plan, &registry![Work], options).map_err(|error| Failure::new(error.to_string()))?;
    live.run().map_err(|error| Failure::new(error.to_string()))?;
    Ok(ExitCode::SUCCESS)
}

/// The burdens of a run, while it lasts.
pub(super) struct Burdens {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Burdens {
    /// Begins them at their times, counted from now.
    pub(super) fn start(burdens: Vec<Burden>) -> Option<Burdens> {
        if burdens.is_empty() {
            return None;
        }
        let over = Arc::new(AtomicBool::new(false));
        let ends = over.clone();
        let begun = terminal::host_now();
        let work = move || {
            let mut waiting = burdens;
            let mut children: Vec<Child> = Vec::new();
            while !ends.load(Ordering::Acquire) {
                let now = Duration(begun.elapsed().as_nanos() as i64);
                let (due, later): (Vec<Burden>, Vec<Burden>) =
                    waiting.into_iter().partition(|burden| burden.from <= now);
                waiting = later;
                children.extend(due.iter().filter_map(|burden| begin(burden, now)));
                std::thread::park_timeout(LOOK);
            }
            for mut child in children {
                // One that has ended by itself needs neither.
                let _ = child.kill();
                let _ = child.wait();
            }
        };
        let thread = std::thread::Builder::new().name("sinew-burdens".into()).spawn(work);
        match thread {
            Ok(thread) => Some(Burdens { over, thread: Some(thread) }),
            Err(error) => {
                terminal::tell(&format!("warning: no burden will be there: {error}"));
                None
            }
        }
    }
}

fn begin(burden: &Burden, now: Duration) -> Option<Child> {
    let cpus: Vec<String> = burden.cpus.iter().map(ToString::to_string).collect();
    let left = (burden.until - now).min(Duration::secs(3600));
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.args(["burden", "--priority", &burden.priority.to_string()]);
    if !cpus.is_empty() {
        command.args(["--cpus", &cpus.join(",")]);
    }
    command.args(["--work", &burden.work().to_string(), "--period", &burden.period.to_string()]);
    command.args(["--for", &left.to_string()]);
    command.stdin(Stdio::null()).stdout(Stdio::null());
    match command.spawn() {
        Ok(child) => Some(child),
        Err(error) => {
            terminal::tell(&format!("warning: the burden \"{}\" cannot begin: {error}", burden.name));
            None
        }
    }
}

impl Drop for Burdens {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            // One that panicked has said so.
            let _ = thread.join();
        }
    }
}

//! `sinew doctor`: what this machine can do for real time, what is missing, and how to mend it.
//!
//! ```text
//!   files of the kernel ──▶ Machine ──┐
//!   a thread that asks  ──▶ granted ──┴─▶ lines ──▶ text, or JSON
//! ```

use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

mod machine;
pub(crate) mod probe;

pub use machine::Machine;

/// How one thing is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// As real time wants it.
    Good,
    /// Real time is possible, with more jitter than need be.
    Weak,
    /// Without it there is no real time.
    Missing,
    /// It cannot be seen from here.
    Unseen,
}

impl State {
    /// Its name on the screen.
    pub const fn name(self) -> &'static str {
        match self {
            State::Good => "ok",
            State::Weak => "weak",
            State::Missing => "missing",
            State::Unseen => "unseen",
        }
    }
}

/// What is said of one thing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The thing.
    pub name: &'static str,
    /// How it is.
    pub state: State,
    /// What was found.
    pub found: String,
    /// How to mend it, where that is needed.
    pub mend: Option<String>,
}

/// What was found on a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Examination {
    /// One for each thing.
    pub lines: Vec<Line>,
}

/// Examines this machine. For a moment it starts a real-time thread, to see whether it may.
pub fn examine() -> Examination {
    let mut examination = Examination::of(&Machine::read(Path::new("/")), &probe::granted(), &run_folder());
    examination.lines.push(around_a_step(probe::overhead()));
    examination
}

/// What the runtime needs of a processor besides the steps.
fn around_a_step(found: Option<probe::Overhead>) -> Line {
    let micros = |span: types::Duration| format!("{:.1} µs", span.seconds() * 1e6);
    let found = found.map(|found| {
        format!(
            "{} of processor time, 99 of 100 within {}: the first is what admission counts",
            micros(found.median),
            micros(found.most)
        )
    });
    match found {
        Some(found) => line("around a step", State::Good, found, ""),
        None => line("around a step", State::Unseen, "could not be measured", ""),
    }
}

/// Where running systems leave what others may find.
fn run_folder() -> PathBuf {
    match runtime::RunFolder::open() {
        Ok(folder) => folder.path().to_owned(),
        Err(_) => PathBuf::new(),
    }
}

impl Examination {
    /// Judges a machine. `granted` is what a thread got that asked for priority 70, `run_folder` is empty where there is none.
    pub fn of(machine: &Machine, granted: &str, run_folder: &Path) -> Examination {
        let lines = vec![
            kernel(machine),
            cores(machine),
            priority(machine, granted),
            memory(machine),
            throttling(machine),
            governor(machine),
            clock(machine),
            slack(machine),
            quota(machine),
            folder(machine, run_folder),
        ];
        Examination { lines }
    }

    /// Whether there is real time at all.
    pub fn real_time(&self) -> bool {
        self.lines.iter().all(|line| line.state != State::Missing)
    }

    /// The sentence at the end.
    pub fn verdict(&self) -> &'static str {
        match (self.real_time(), self.lines.iter().any(|line| line.state == State::Weak)) {
            (true, false) => "This machine can do real time.",
            (true, true) => "This machine can do real time, with more jitter than need be.",
            (false, _) => "This machine cannot do real time as it is. Systems run all the same, and say so.",
        }
    }

    /// What people read.
    pub fn to_text(&self) -> String {
        let width = self.lines.iter().map(|line| line.name.len()).max().unwrap_or(0);
        let mut out = String::new();
        for line in &self.lines {
            out.push_str(&format!("{:<7}  {:<width$}  {}\n", line.state.name(), line.name, line.found));
            if let Some(mend) = &line.mend {
                out.push_str(&format!("{:<7}  {:<width$}  → {mend}\n", "", ""));
            }
        }
        format!("{out}\n{}\n", self.verdict())
    }

    /// `{"real_time","verdict","lines":[{"name","state","found","mend"}]}`.
    pub fn to_json(&self) -> Json {
        let line = |line: &Line| json!({"name": line.name, "state": line.state.name(), "found": line.found, "mend": line.mend});
        let lines: Vec<Json> = self.lines.iter().map(line).collect();
        json!({"real_time": self.real_time(), "verdict": self.verdict(), "lines": lines})
    }
}

fn line(name: &'static str, state: State, found: impl Into<String>, mend: &str) -> Line {
    let mend = (matches!(state, State::Weak | State::Missing) && !mend.is_empty()).then(|| mend.to_owned());
    Line { name, state, found: found.into(), mend }
}

fn kernel(machine: &Machine) -> Line {
    let state = match machine.preemption.as_deref() {
        Some("PREEMPT_RT") => State::Good,
        Some(_) => State::Weak,
        None => State::Unseen,
    };
    let model = machine.preemption.as_deref().unwrap_or("preemption not told");
    let mend = "a kernel with PREEMPT_RT bounds its own delays (Debian: apt install linux-image-rt-amd64)";
    line("kernel", state, format!("{} {model}", machine.kernel), mend)
}

fn cores(machine: &Machine) -> Line {
    let state = if machine.cores > 1 { State::Good } else { State::Weak };
    let mend = "with one core everything waits for everything: use a machine of two or more";
    let isolated = match &machine.isolated {
        Some(list) => format!(", {list} kept free of other work"),
        None => String::new(),
    };
    line("cores", state, format!("{}{isolated}", machine.cores), mend)
}

fn priority(machine: &Machine, granted: &str) -> Line {
    let state = if granted.starts_with("fifo") { State::Good } else { State::Missing };
    let limit = machine.limit("Max realtime priority").unwrap_or("not told");
    let mend = "allow it: in /etc/security/limits.d/realtime.conf write \"@realtime - rtprio 95\", add yourself to the group \
        realtime, log in again; in a container --cap-add=SYS_NICE --ulimit rtprio=95";
    line("priority", state, format!("asked for fifo 70, got {granted} (limit {limit})"), mend)
}

fn memory(machine: &Machine) -> Line {
    const ENOUGH: u64 = 256 << 20;
    let limit = machine.limit("Max locked memory");
    let state = match limit {
        Some("unlimited") => State::Good,
        _ if machine.can_lock_all => State::Good,
        Some(bytes) if bytes.parse::<u64>().is_ok_and(|bytes| bytes >= ENOUGH) => State::Good,
        Some(_) => State::Weak,
        None => State::Unseen,
    };
    let found = match limit {
        _ if machine.can_lock_all => "any amount can be locked, as this user may".to_owned(),
        Some(bytes) => match bytes.parse::<u64>() {
            Ok(bytes) => format!("{} MiB can be locked", bytes >> 20),
            Err(_) => "any amount can be locked".to_owned(),
        },
        None => "limit not told".to_owned(),
    };
    let mend = "a page that is not there costs a step milliseconds: write \"@realtime - memlock unlimited\" in \
        /etc/security/limits.d/realtime.conf; in a container --ulimit memlock=-1";
    line("memory", state, found, mend)
}

fn throttling(machine: &Machine) -> Line {
    let (state, found) = match machine.rt_runtime_us {
        Some(-1) => (State::Good, "off".to_owned()),
        Some(us) => (
            State::Weak,
            format!("real-time threads stop after {us} us of every {} us", machine.rt_period_us),
        ),
        None => (State::Unseen, "not told".to_owned()),
    };
    let mend = "a busy executor is held up for the rest of the period: sysctl kernel.sched_rt_runtime_us=-1, where you trust \
        your agents";
    line("throttling", state, found, mend)
}

fn governor(machine: &Machine) -> Line {
    let (state, found) = match machine.governors.as_slice() {
        [] => (State::Unseen, "the frequency is not ours to set".to_owned()),
        governors if governors.iter().all(|governor| governor == "performance") => {
            (State::Good, "performance".to_owned())
        }
        governors => (State::Weak, governors.join(", ")),
    };
    line("governor", state, found, "a core that slept wakes up slowly: cpupower frequency-set -g performance")
}

fn clock(machine: &Machine) -> Line {
    let fast = ["tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page", "riscv_clocksource"];
    match machine.clock_source.as_deref() {
        Some(source) => {
            let state = if fast.contains(&source) { State::Good } else { State::Weak };
            let mend = "reading this clock takes a microsecond: boot with clocksource=tsc tsc=reliable, if the processor allows";
            line("clock", state, source, mend)
        }
        None => line("clock", State::Unseen, "not told", ""),
    }
}

fn slack(machine: &Machine) -> Line {
    match machine.timer_slack_ns {
        // Executors set it to 1 ns for themselves.
        Some(ns) => line("timer slack", State::Good, format!("{ns} ns; executors set their own to 1 ns"), ""),
        None => line("timer slack", State::Unseen, "not told; executors set their own to 1 ns", ""),
    }
}

fn quota(machine: &Machine) -> Line {
    match machine.quota.as_deref() {
        None | Some("max") => line("quota", State::Good, "no limit on processor time", ""),
        Some(quota) => {
            let mend = "the group is stopped when its share is used up, whatever its priorities: raise cpu.max, or run the \
                container without --cpus";
            line("quota", State::Missing, format!("cpu.max is {quota}"), mend)
        }
    }
}

fn folder(machine: &Machine, folder: &Path) -> Line {
    if folder.as_os_str().is_empty() {
        let mend = "set XDG_RUNTIME_DIR to a folder of your own with mode 0700, or make /dev/shm writable";
        return line("run folder", State::Missing, "there is none", mend);
    }
    let kind = machine.file_system_of(folder);
    let state = match kind {
        Some("tmpfs" | "ramfs") => State::Good,
        Some(_) => State::Missing,
        None => State::Unseen,
    };
    let mend = "the latch must lie in memory, or setting it can wait for a disk: set XDG_RUNTIME_DIR to a folder on tmpfs";
    line(
        "run folder",
        state,
        format!("{} on {}", folder.display(), kind.unwrap_or("an unknown file system")),
        mend,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine() -> Machine {
        Machine {
            kernel: "6.12.0".into(),
            preemption: Some("PREEMPT_RT".into()),
            cores: 4,
            limits: vec![
                ("Max locked memory".into(), "unlimited".into()),
                ("Max realtime priority".into(), "95".into()),
            ],
            rt_runtime_us: Some(-1),
            rt_period_us: 1_000_000,
            governors: vec!["performance".into()],
            clock_source: Some("tsc".into()),
            timer_slack_ns: Some(50_000),
            quota: Some("max".into()),
            mounts: vec![("/".into(), "ext4".into()), ("/run/user/7".into(), "tmpfs".into())],
            ..Machine::default()
        }
    }

    fn states(machine: &Machine, granted: &str, folder: &str) -> Vec<(&'static str, State)> {
        let lines = Examination::of(machine, granted, Path::new(folder)).lines;
        lines.iter().filter(|line| line.state != State::Good).map(|line| (line.name, line.state)).collect()
    }

    #[test]
    fn a_machine_that_has_it_all_is_told_so() {
        assert_eq!(states(&machine(), "fifo 70", "/run/user/7/sinew"), []);
        let examination = Examination::of(&machine(), "fifo 70", Path::new("/run/user/7/sinew"));
        assert_eq!(examination.verdict(), "This machine can do real time.");
        assert!(examination.lines.iter().all(|line| line.mend.is_none()));
    }

    #[test]
    fn each_thing_that_is_missing_is_named_and_can_be_mended() {
        type Change = fn(&mut Machine);
        let cases: [(&str, State, Change); 8] = [
            ("kernel", State::Weak, |m| m.preemption = Some("PREEMPT_DYNAMIC".into())),
            ("cores", State::Weak, |m| m.cores = 1),
            ("memory", State::Weak, |m| m.limits[0].1 = "8388608".into()),
            ("throttling", State::Weak, |m| m.rt_runtime_us = Some(950_000)),
            ("governor", State::Weak, |m| m.governors = vec!["powersave".into()]),
            ("clock", State::Weak, |m| m.clock_source = Some("hpet".into())),
            ("quota", State::Missing, |m| m.quota = Some("50000 100000".into())),
            ("run folder", State::Missing, |m| m.mounts.truncate(1)),
        ];
        for (name, state, change) in cases {
            let mut machine = machine();
            change(&mut machine);
            assert_eq!(states(&machine, "fifo 70", "/run/user/7/sinew"), [(name, state)]);
            let lines = Examination::of(&machine, "fifo 70", Path::new("/run/user/7/sinew")).lines;
            assert_eq!(lines.iter().filter(|line| line.mend.is_some()).count(), 1, "{name}");
        }
        let refused = "ordinary (Operation not permitted (os error 1))";
        assert_eq!(states(&machine(), refused, "/run/user/7/sinew"), [("priority", State::Missing)]);
        assert!(!Examination::of(&machine(), refused, Path::new("")).real_time());
    }

    #[test]
    fn the_text_and_the_json_say_the_same() {
        let examination = Examination::of(&machine(), "ordinary", Path::new("/run/user/7/sinew"));
        let (text, json) = (examination.to_text(), examination.to_json());
        assert!(text.starts_with("ok       kernel       6.12.0 PREEMPT_RT\n"), "{text}");
        assert!(
            text.contains("missing  priority     asked for fifo 70, got ordinary (limit 95)\n"),
            "{text}"
        );
        assert_eq!((&json["real_time"], &json["lines"][2]["state"]), (&false.into(), &"missing".into()));
        assert!(json["lines"][2]["mend"].as_str().unwrap().starts_with("allow it"));
    }

    #[test]
    fn this_machine_can_be_examined() {
        let examination = examine();
        assert_eq!(examination.lines.len(), 11);
        let around = &examination.lines[10];
        assert!(
            around.name == "around a step" && around.found.contains("µs of processor time"),
            "{around:?}"
        );
        let priority = &examination.lines[2].found;
        assert!(priority.contains("got fifo 70") || priority.contains("got ordinary"), "{priority}");
    }
}

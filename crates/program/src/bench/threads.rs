//! What the kernel knows of the threads of this process.

use std::fs;

/// What a thread has used so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Used {
    /// Its name, of which the kernel keeps 15 letters.
    pub(super) name: String,
    /// How often it gave its processor away to wait for something.
    pub(super) sleeps: u64,
    /// How long it had a processor (ns).
    pub(super) run: u64,
    /// Of that, what the kernel did for it (s), in ticks of its clock.
    pub(super) system: f64,
}

/// Ticks of the kernel's clock in a second, as it tells them to programs.
const TICKS: f64 = 100.0;

/// All threads that live.
pub(super) fn all() -> Vec<Used> {
    let Ok(tasks) = fs::read_dir("/proc/self/task") else { return Vec::new() };
    tasks.flatten().filter_map(|task| used(&task.path())).collect()
}

fn used(task: &std::path::Path) -> Option<Used> {
    let read = |file: &str| fs::read_to_string(task.join(file)).ok();
    let status = read("status")?;
    let sleeps = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"))?;
    let run = read("schedstat").and_then(|text| text.split(' ').next()?.parse().ok());
    // Behind the name, which can hold anything but ends with the last bracket, the kernel's share is the thirteenth.
    let stat = read("stat")?;
    let system = stat.rsplit_once(')')?.1.split_whitespace().nth(12)?.parse::<f64>().ok()?;
    Some(Used {
        name: read("comm")?.trim_end().to_owned(),
        sleeps: sleeps.trim().parse().ok()?,
        run: run.unwrap_or(0),
        system: system / TICKS,
    })
}

/// How often each of the threads with names that begin so gave its processor away to wait.
pub(super) fn sleeps(begin: &str) -> Vec<f64> {
    all().into_iter().filter(|used| used.name.starts_with(begin)).map(|used| used.sleeps as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thread_that_sleeps_is_seen() {
        let name = "bench-dozes";
        let thread = super::super::parcel::thread(name, || {
            crate::terminal::pause(std::time::Duration::from_millis(5));
            all()
        });
        let seen = thread.unwrap().join().unwrap();
        let own = seen.iter().find(|used| used.name == name).unwrap();
        assert!(own.sleeps > 0 && own.run > 0, "{own:?}");
    }
}

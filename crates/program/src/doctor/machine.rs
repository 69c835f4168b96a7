//! What the kernel says of a machine in its files.

use std::fs;
use std::path::{Path, PathBuf};

/// What is known of a machine. What is not told is empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Machine {
    /// The kernel's version.
    pub kernel: String,
    /// Its preemption model, as in `PREEMPT_RT`.
    pub preemption: Option<String>,
    /// Processors that this process may use.
    pub cores: usize,
    /// Processors that are kept free of other work, as in `2-3`.
    pub isolated: Option<String>,
    /// The limits of this process: name and soft limit.
    pub limits: Vec<(String, String)>,
    /// Whether memory may be locked whatever the limit says.
    pub can_lock_all: bool,
    /// How long real-time threads may run in a period (µs); -1 for always.
    pub rt_runtime_us: Option<i64>,
    /// That period (µs).
    pub rt_period_us: i64,
    /// The frequency governors, each once.
    pub governors: Vec<String>,
    /// The clock source.
    pub clock_source: Option<String>,
    /// How late sleeps of an ordinary thread may end (ns).
    pub timer_slack_ns: Option<u64>,
    /// The tightest processor quota of its control groups, as in `50000 100000`; `max` for none.
    pub quota: Option<String>,
    /// Where file systems are mounted, and of which kind they are.
    pub mounts: Vec<(PathBuf, String)>,
}

/// Number of the capability that lets memory be locked without limit (`CAP_IPC_LOCK` in `linux/capability.h`).
const IPC_LOCK: u32 = 14;

impl Machine {
    /// Reads the files below `root`, which is `/` on a live machine.
    pub fn read(root: &Path) -> Machine {
        let text = |path: &str| fs::read_to_string(root.join(path)).ok().map(|text| text.trim().to_owned());
        let status = text("proc/self/status").unwrap_or_default();
        Machine {
            kernel: text("proc/sys/kernel/osrelease").unwrap_or_else(|| "kernel not told".to_owned()),
            preemption: preemption(text("sys/kernel/realtime"), text("proc/sys/kernel/version")),
            cores: allowed(&status).unwrap_or(1),
            isolated: text("sys/devices/system/cpu/isolated").filter(|list| !list.is_empty()),
            limits: limits(&text("proc/self/limits").unwrap_or_default()),
            can_lock_all: capable(&status, IPC_LOCK),
            rt_runtime_us: number(text("proc/sys/kernel/sched_rt_runtime_us")),
            rt_period_us: number(text("proc/sys/kernel/sched_rt_period_us")).unwrap_or(1_000_000),
            governors: governors(&root.join("sys/devices/system/cpu")),
            clock_source: text("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            timer_slack_ns: number(text("proc/self/timerslack_ns")),
            quota: quota(root, &text("proc/self/cgroup").unwrap_or_default()),
            mounts: mounts(&text("proc/mounts").unwrap_or_default()),
        }
    }

    /// A limit of this process by the kernel's name for it.
    pub fn limit(&self, name: &str) -> Option<&str> {
        self.limits.iter().find(|(known, _)| known == name).map(|(_, limit)| limit.as_str())
    }

    /// The kind of file system in which a path lies.
    pub fn file_system_of(&self, path: &Path) -> Option<&str> {
        let around = self.mounts.iter().filter(|(mount, _)| path.starts_with(mount));
        // Of two mounts at one place the later one counts.
        around.max_by_key(|(mount, _)| mount.components().count()).map(|(_, kind)| kind.as_str())
    }
}

fn number<T: std::str::FromStr>(text: Option<String>) -> Option<T> {
    text?.parse().ok()
}

/// The kernel tells its model in its version; one with real time says so in a file as well.
fn preemption(realtime: Option<String>, version: Option<String>) -> Option<String> {
    if realtime.as_deref() == Some("1") {
        return Some("PREEMPT_RT".to_owned());
    }
    let version = version?;
    Some(
        version
            .split_whitespace()
            .find(|word| word.starts_with("PREEMPT"))
            .unwrap_or("no preemption")
            .to_owned(),
    )
}

/// Processors in `Cpus_allowed_list: 0-3,6`.
fn allowed(status: &str) -> Option<usize> {
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?.trim();
    list.split(',')
        .map(|range| match range.split_once('-') {
            Some((first, last)) => {
                Some(last.parse::<usize>().ok()?.checked_sub(first.parse::<usize>().ok()?)? + 1)
            }
            None => range.parse::<usize>().ok().map(|_| 1),
        })
        .sum()
}

fn capable(status: &str, capability: u32) -> bool {
    let set = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    set.and_then(|set| u64::from_str_radix(set.trim(), 16).ok()).is_some_and(|set| set >> capability & 1 == 1)
}

/// The table of limits: its columns are at least two spaces apart.
fn limits(text: &str) -> Vec<(String, String)> {
    let columns = |line: &str| -> Option<(String, String)> {
        let mut columns = line.split("  ").map(str::trim).filter(|column| !column.is_empty());
        Some((columns.next()?.to_owned(), columns.next()?.to_owned()))
    };
    text.lines().skip(1).filter_map(columns).collect()
}

fn governors(cpus: &Path) -> Vec<String> {
    let folders = fs::read_dir(cpus).into_iter().flatten().flatten();
    let read = |entry: fs::DirEntry| fs::read_to_string(entry.path().join("cpufreq/scaling_governor")).ok();
    let mut governors: Vec<String> = folders.filter_map(read).map(|text| text.trim().to_owned()).collect();
    governors.sort();
    governors.dedup();
    governors
}

/// The tightest quota on the way up from the control group of this process, in version 2 of control groups or in version 1.
fn quota(root: &Path, cgroup: &str) -> Option<String> {
    let mut tightest: Option<(f64, String)> = None;
    for line in cgroup.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (mount, second) = match controllers {
            "" => ("sys/fs/cgroup", true),
            "cpu" | "cpu,cpuacct" => ("sys/fs/cgroup/cpu", false),
            _ => continue,
        };
        for group in Path::new(path.trim_start_matches('/')).ancestors() {
            let folder = root.join(mount).join(group);
            let text =
                |file: &str| fs::read_to_string(folder.join(file)).ok().map(|text| text.trim().to_owned());
            let found = if second {
                text("cpu.max")
            } else {
                text("cpu.cfs_quota_us")
                    .zip(text("cpu.cfs_period_us"))
                    .map(|(quota, period)| format!("{quota} {period}"))
            };
            let Some(found) = found else { continue };
            let share = share(&found);
            if tightest.as_ref().is_none_or(|(least, _)| share < *least) {
                tightest = Some((share, if share.is_finite() { found } else { "max".to_owned() }));
            }
        }
    }
    tightest.map(|(_, quota)| quota)
}

/// The processors that `50000 100000` allows; without end for `max 100000` and `-1 100000`.
fn share(quota: &str) -> f64 {
    let mut numbers = quota.split_whitespace().map(|word| word.parse::<f64>().ok());
    match (numbers.next().flatten(), numbers.next().flatten()) {
        (Some(quota), Some(period)) if quota > 0.0 && period > 0.0 => quota / period,
        _ => f64::INFINITY,
    }
}

fn mounts(text: &str) -> Vec<(PathBuf, String)> {
    let mount = |line: &str| -> Option<(PathBuf, String)> {
        let mut words = line.split(' ').skip(1);
        Some((PathBuf::from(words.next()?.replace("\\040", " ")), words.next()?.to_owned()))
    };
    text.lines().filter_map(mount).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_machine_are_understood() {
        let root = std::env::temp_dir().join(format!("sinew-machine-{}", std::process::id()));
        for (path, text) in [
            ("proc/sys/kernel/osrelease", "6.12.9-rt\n"),
            ("proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian 6.12.9\n"),
            ("proc/self/status", "Name:\tx\nCapEff:\t0000000000004000\nCpus_allowed_list:\t0-2,6\n"),
            (
                "proc/self/limits",
                "Limit                     Soft Limit           Hard Limit           Units     \n\
                 Max locked memory         8388608              unlimited            bytes     \n\
                 Max realtime priority     95                   99                             \n",
            ),
            ("proc/sys/kernel/sched_rt_runtime_us", "950000\n"),
            ("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n"),
            ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n"),
            ("proc/self/cgroup", "0::/a/b\n"),
            ("sys/fs/cgroup/a/cpu.max", "50000 100000\n"),
            ("sys/fs/cgroup/a/b/cpu.max", "max 100000\n"),
            ("proc/mounts", "x / ext4 rw 0 0\ntmpfs /dev/shm tmpfs rw 0 0\n"),
        ] {
            let file = root.join(path);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, text).unwrap();
        }
        let machine = Machine::read(&root);
        fs::remove_dir_all(&root).unwrap();
        assert_eq!(
            (machine.kernel.as_str(), machine.preemption.as_deref()),
            ("6.12.9-rt", Some("PREEMPT_DYNAMIC"))
        );
        assert_eq!((machine.cores, machine.can_lock_all), (4, true));
        assert_eq!(machine.limit("Max locked memory"), Some("8388608"));
        assert_eq!(machine.limit("Max realtime priority"), Some("95"));
        assert_eq!((machine.rt_runtime_us, machine.rt_period_us), (Some(950_000), 1_000_000));
        assert_eq!(machine.governors, ["powersave"]);
        assert_eq!(machine.quota.as_deref(), Some("50000 100000"));
        assert_eq!(machine.file_system_of(Path::new("/dev/shm/sinew-7")), Some("tmpfs"));
        assert_eq!(machine.file_system_of(Path::new("/home")), Some("ext4"));
        assert_eq!((machine.clock_source, machine.isolated), (None, None));
    }

    #[test]
    fn a_quota_of_the_first_version_is_understood() {
        assert_eq!(share("-1 100000"), f64::INFINITY);
        assert_eq!(share("150000 100000"), 1.5);
    }

    #[test]
    fn a_real_time_kernel_says_so() {
        assert_eq!(preemption(Some("1".into()), None).as_deref(), Some("PREEMPT_RT"));
        assert_eq!(preemption(None, Some("#1 SMP".into())).as_deref(), Some("no preemption"));
        assert_eq!(preemption(None, None), None);
    }
}

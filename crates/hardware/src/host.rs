//! The computer as a sensor: how loaded its processors and its memory are, from what the kernel tells in `/proc`.
//!
//! Times of processors and threads are differences between two readings. Of other processes only threads with a real-time priority are looked
//! at one by one, since only they take anything from ours; who they are is looked for once a second.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use procfs::process::{Process, Task, all_processes};
use procfs::{Current, CurrentSI, KernelStats, Meminfo, WithCurrentSystemInfo as _};
use runtime::{Foreign, Host, HostReading};

/// How often it is looked who has a real-time priority.
const LOOK_FOR_OTHERS: Duration = Duration::from_secs(1);
/// Who takes less of a processor is not worth a word.
const LEAST_SHARE: f32 = 0.005;
/// Scheduling policies as `/proc/PID/stat` numbers them.
const FIFO: u32 = 1;
/// See [`FIFO`].
const ROUND_ROBIN: u32 = 2;
/// See [`FIFO`].
const DEADLINE: u32 = 6;

/// Reads `/proc`. What the kernel does not tell is left out.
#[derive(Default)]
pub struct ProcHost {
    /// When it was read last.
    read_at: Option<Instant>,
    /// When others were looked for last.
    looked_at: Option<Instant>,
    /// Busy and all ticks of each processor.
    processors: Vec<(u64, u64)>,
    /// What this process has used of processors (s).
    own: f64,
    others: HashMap<i32, Other>,
}

/// A thread of another process with a real-time priority.
struct Other {
    task: Task,
    name: String,
    priority: u8,
    may: u64,
    /// What it had used of processors (ns).
    used: u64,
}

impl ProcHost {
    /// A sensor that has read nothing yet: its first reading has no shares.
    pub fn new() -> ProcHost {
        ProcHost::default()
    }

    fn processors(&mut self) -> Vec<f32> {
        let Ok(stats) = KernelStats::current() else { return Vec::new() };
        let now = stats.cpu_time.iter().map(|cpu| {
            let idle = cpu.idle + cpu.iowait.unwrap_or(0);
            let busy = cpu.user + cpu.nice + cpu.system + cpu.irq.unwrap_or(0) + cpu.softirq.unwrap_or(0);
            (busy, busy + idle)
        });
        let now: Vec<(u64, u64)> = now.collect();
        let share = |(now, before): (&(u64, u64), &(u64, u64))| {
            let all = now.1.saturating_sub(before.1).max(1);
            (now.0.saturating_sub(before.0) as f32 / all as f32).min(1.0)
        };
        let shares = now.iter().zip(&self.processors).map(share).collect();
        self.processors = now;
        shares
    }

    fn look_for_others(&mut self, now: Instant) {
        if self.looked_at.is_some_and(|at| now - at < LOOK_FOR_OTHERS) {
            return;
        }
        self.looked_at = Some(now);
        let Ok(all) = all_processes() else { return };
        let own = std::process::id() as i32;
        let mut seen = Vec::new();
        let others = all.flatten().filter(|process| process.pid != own);
        let tasks = others.filter_map(|process| process.tasks().ok()).flat_map(|tasks| tasks.flatten());
        for task in tasks {
            let Ok(stat) = task.stat() else { continue };
            let policy = stat.policy.unwrap_or(0);
            if ![FIFO, ROUND_ROBIN, DEADLINE].contains(&policy) {
                continue;
            }
            seen.push(task.tid);
            let priority = if policy == DEADLINE { 0 } else { stat.rt_priority.unwrap_or(0) as u8 };
            let may = allowed(&task);
            let entry = self.others.entry(task.tid).or_insert_with(|| {
                let used = used(&task);
                Other { name: stat.comm.clone(), priority, may, used, task }
            });
            (entry.priority, entry.may) = (priority, may);
        }
        self.others.retain(|tid, _| seen.contains(tid));
    }

    fn burdens(&mut self, length: f32) -> Vec<Foreign> {
        let others = self.others.values_mut().map(|other| {
            let now = used(&other.task);
            let before = std::mem::replace(&mut other.used, now);
            let share = now.saturating_sub(before) as f32 * 1e-9 / length.max(1e-3);
            Foreign {
                name: other.name.clone(),
                priority: other.priority,
                may: other.may,
                share: share.min(1.0),
            }
        });
        let mut burdens: Vec<Foreign> = others.filter(|other| other.share >= LEAST_SHARE).collect();
        burdens.sort_by(|a, b| b.share.total_cmp(&a.share));
        burdens
    }
}

impl Host for ProcHost {
    fn read(&mut self) -> HostReading {
        #[allow(clippy::disallowed_methods)] // a driver of the computer reads its clock
        let now = Instant::now();
        let length = self.read_at.map_or(0.0, |at| (now - at).as_secs_f32());
        let is_first = self.read_at.replace(now).is_none();
        let processors = self.processors();
        self.look_for_others(now);
        let burdens = self.burdens(length);
        let stat = Process::myself().and_then(|process| process.stat());
        let ticks = procfs::ticks_per_second() as f64;
        let own = stat.as_ref().map_or(0.0, |stat| (stat.utime + stat.stime) as f64 / ticks);
        let own_share = (own - std::mem::replace(&mut self.own, own)) as f32 / length.max(1e-3);
        let foreign = (processors.iter().sum::<f32>() - own_share).max(0.0);
        let memory = stat.map_or(0, |stat| stat.rss_bytes().get());
        let free = Meminfo::current().ok().and_then(|memory| memory.mem_available);
        let cpu = procfs::CpuPressure::current().ok().map(|pressure| pressure.some.avg10 / 100.0);
        let pressed = procfs::MemoryPressure::current().ok().map(|pressure| pressure.some.avg10 / 100.0);
        HostReading {
            processors: if is_first { Vec::new() } else { processors },
            foreign: if is_first { 0.0 } else { foreign },
            burdens: if is_first { Vec::new() } else { burdens },
            memory,
            memory_free: free.unwrap_or(0),
            pressure_cpu: cpu,
            pressure_memory: pressed,
        }
    }
}

/// What a thread has used of processors (ns).
fn used(task: &Task) -> u64 {
    task.schedstat().map_or(0, |stat| stat.sum_exec_runtime)
}

/// The processors on which a thread may run, as bits; all where the kernel does not say.
fn allowed(task: &Task) -> u64 {
    let lists = task.status().ok().and_then(|status| status.cpus_allowed_list);
    let bits = lists.into_iter().flatten().flat_map(|(from, to)| from..=to);
    let mask = bits.fold(0u64, |mask, cpu| mask | 1u64 << (cpu & 63));
    if mask == 0 { u64::MAX } else { mask }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_tells_of_this_computer_what_the_kernel_does() {
        let mut host = ProcHost::new();
        let first = host.read();
        assert!(first.processors.is_empty() && first.burdens.is_empty(), "no shares before the second");
        let mut sum = 0u64;
        (0..20_000_000u64).for_each(|n| sum = std::hint::black_box(sum.wrapping_mul(31).wrapping_add(n)));
        let second = host.read();
        let there = std::thread::available_parallelism().unwrap().get();
        assert!(second.processors.len() >= there, "{second:?}");
        assert!(second.processors.iter().all(|share| (0.0..=1.0).contains(share)), "{second:?}");
        assert!(second.memory > 1 << 20 && second.memory < 1 << 40, "{second:?}");
        assert!(second.memory_free > 0, "{second:?}");
    }
}

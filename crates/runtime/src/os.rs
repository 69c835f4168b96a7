//! What the runtime asks of the operating system: futexes, scheduling, memory locking, whose process it is. Linux.

#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use core::sync::atomic::AtomicU8;
#[cfg(not(loom))]
use core::sync::atomic::AtomicU32;
use core::sync::atomic::{AtomicI32, Ordering};
use std::io;

use types::Duration;

use crate::budget::Budget;

/// Waits while `word` is `expected`, until it is woken or `until` (monotonic clock, nanoseconds) has come.
#[cfg(not(loom))]
pub(crate) fn futex_wait(word: &AtomicU32, expected: u32, until: Option<i64>) {
    let timeout = until.map(|nanos| libc::timespec {
        tv_sec: nanos.div_euclid(1_000_000_000),
        tv_nsec: nanos.rem_euclid(1_000_000_000),
    });
    let timeout = timeout.as_ref().map_or(core::ptr::null(), core::ptr::from_ref);
    // SAFETY: `word` outlives the call, and the timeout is a valid pointer or null. FUTEX_WAIT_BITSET takes an absolute
    // monotonic time. Whatever it answers, the caller looks at the word again.
    unsafe {
        libc::syscall(
            libc::SYS_futex,
            word.as_ptr(),
            libc::FUTEX_WAIT_BITSET | libc::FUTEX_PRIVATE_FLAG,
            expected,
            timeout,
            core::ptr::null::<u32>(),
            u32::MAX,
        );
    }
}

/// Wakes the thread that waits on `word`.
#[cfg(not(loom))]
pub(crate) fn futex_wake(word: &AtomicU32) {
    // SAFETY: `word` is a valid address; waking touches nothing else.
    unsafe {
        libc::syscall(libc::SYS_futex, word.as_ptr(), libc::FUTEX_WAKE | libc::FUTEX_PRIVATE_FLAG, 1);
    }
}

fn clock(which: libc::clockid_t) -> i64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is a valid place for the answer.
    unsafe { libc::clock_gettime(which, &mut now) };
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// The monotonic clock (ns).
pub(crate) fn monotonic() -> i64 {
    clock(libc::CLOCK_MONOTONIC)
}

/// The time of day since the Unix epoch (ns).
pub(crate) fn realtime() -> i64 {
    clock(libc::CLOCK_REALTIME)
}

fn checked(result: libc::c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Gives the calling thread a real-time priority (1 to 99), first in first out. Under ThreadSanitizer it keeps the one it has: who waits for a
/// lock of the sanitizer spins, and from above would never let a thread go on that has it.
pub(crate) fn set_fifo(priority: u8) -> io::Result<()> {
    if cfg!(tsan) {
        return Ok(());
    }
    let param = libc::sched_param { sched_priority: priority.into() };
    // SAFETY: zero is the calling thread; `param` is valid.
    checked(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &param) })
}

/// Gives a thread, zero for the calling one, a budget under `SCHED_DEADLINE`. Threads that it makes are ordinary ones: else it could make none. As for a
/// priority, not under ThreadSanitizer.
pub(crate) fn set_deadline(thread: i32, budget: Budget) -> io::Result<()> {
    if cfg!(tsan) {
        return Ok(());
    }
    let attributes = libc::sched_attr {
        size: size_of::<libc::sched_attr>() as u32,
        sched_policy: libc::SCHED_DEADLINE as u32,
        sched_flags: libc::SCHED_FLAG_RESET_ON_FORK as u64,
        sched_nice: 0,
        sched_priority: 0,
        sched_runtime: budget.runtime.0 as u64,
        sched_deadline: budget.deadline.0 as u64,
        sched_period: budget.period.0 as u64,
    };
    // SAFETY: the number names a thread or none; the attributes are valid and say how long they are.
    checked(unsafe { libc::syscall(libc::SYS_sched_setattr, thread, &raw const attributes, 0) } as libc::c_int)
}

/// The budget that a thread, zero for the calling one, has under `SCHED_DEADLINE`, if it runs under that.
pub(crate) fn deadline_of(thread: i32) -> Option<Budget> {
    // SAFETY: all zero is a valid value of plain numbers.
    let mut attributes: libc::sched_attr = unsafe { core::mem::zeroed() };
    let size = size_of::<libc::sched_attr>();
    // SAFETY: the number names a thread or none; the place is valid and of the size that is told.
    checked(unsafe { libc::syscall(libc::SYS_sched_getattr, thread, &raw mut attributes, size, 0) }
        as libc::c_int)
    .ok()?;
    let time = |nanos: u64| Duration(nanos as i64);
    (attributes.sched_policy == libc::SCHED_DEADLINE as u32).then(|| Budget {
        runtime: time(attributes.sched_runtime),
        deadline: time(attributes.sched_deadline),
        period: time(attributes.sched_period),
    })
}

/// Makes the calling thread an ordinary one.
pub(crate) fn set_ordinary() -> io::Result<()> {
    let param = libc::sched_param { sched_priority: 0 };
    // SAFETY: zero is the calling thread; `param` is valid.
    checked(unsafe { libc::sched_setscheduler(0, libc::SCHED_OTHER, &param) })
}

/// Lets a thread run only when nothing else wants to: for one that does not come back.
pub(crate) fn set_idle(thread: i32) -> io::Result<()> {
    if deadline_of(thread).is_some() {
        // The kernel keeps the budget of a thread that leaves the policy until its deadline has come, and gives it to nobody else; what a change
        // takes away is free at once.
        let _ = set_deadline(thread, Budget::NONE);
    }
    let param = libc::sched_param { sched_priority: 0 };
    // SAFETY: the number names a thread of this process or none; `param` is valid.
    checked(unsafe { libc::sched_setscheduler(thread, libc::SCHED_IDLE, &param) })
}

/// The policy and priority that the calling thread has now.
pub(crate) fn granted() -> (i32, i32) {
    let mut param = libc::sched_param { sched_priority: 0 };
    // SAFETY: zero is the calling thread; `param` is a valid place.
    unsafe {
        libc::sched_getparam(0, &mut param);
        (libc::sched_getscheduler(0), param.sched_priority)
    }
}

/// Keeps the calling thread on the given processors.
pub(crate) fn set_affinity(cpus: &[usize]) -> io::Result<()> {
    // SAFETY: an all-zero set is a valid empty one; CPU_SET checks its bounds; the size is that of the set.
    unsafe {
        let mut set: libc::cpu_set_t = core::mem::zeroed();
        for cpu in cpus {
            libc::CPU_SET(*cpu, &mut set);
        }
        checked(libc::sched_setaffinity(0, size_of::<libc::cpu_set_t>(), &set))
    }
}

/// How many processors the machine can have.
pub(crate) fn processors() -> usize {
    // SAFETY: the call takes a number.
    let count = unsafe { libc::sysconf(libc::_SC_NPROCESSORS_CONF) };
    usize::try_from(count).unwrap_or(1).max(1)
}

/// The processor on which the calling thread runs. No system call where the kernel tells it in the thread's own memory.
#[inline]
pub(crate) fn processor() -> usize {
    // SAFETY: the call has no arguments. Where it is not known it answers −1, which is no processor either.
    unsafe { libc::sched_getcpu() as usize }
}

/// How long the calling thread has had a processor (ns). A system call.
pub(crate) fn thread_time() -> u64 {
    clock(libc::CLOCK_THREAD_CPUTIME_ID) as u64
}

/// How long the calling thread has had a processor, in all. A system call: not for every step.
pub fn processor_time() -> types::Duration {
    types::Duration(thread_time() as i64)
}

/// The number of the user in whose name the process acts.
pub(crate) fn user() -> u32 {
    // SAFETY: the call has no arguments and cannot fail.
    unsafe { libc::geteuid() }
}

/// The number by which the kernel knows the calling thread.
pub(crate) fn thread_id() -> i32 {
    // SAFETY: the call has no arguments and cannot fail.
    unsafe { libc::syscall(libc::SYS_gettid) as i32 }
}

/// Makes the calling thread's sleeps end when they should: ordinary threads have 50 µs of slack.
pub(crate) fn exact_timers() {
    // SAFETY: the option takes one number.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1) };
}

/// Keeps all memory of the process, present and future, in place.
pub(crate) fn lock_memory() -> io::Result<()> {
    // SAFETY: the call takes flags only.
    checked(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) })
}

/// Where the heap is large, puts it into large pages, if the kernel gives them. The steps of thousands of agents go from page to page, and to
/// look up where a page is takes as long as what is read there.
pub(crate) fn gather_heap() {
    /// From here on it is worth the time that it takes, a millisecond for each ten megabytes.
    const LARGE: usize = 16 << 20;
    const PAGE: usize = 2 << 20;
    /// The kernel's number, since 6.1.
    const MADV_COLLAPSE: libc::c_int = 25;
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    for line in maps.lines().filter(|line| line.ends_with("[heap]")) {
        let ends = line.split(' ').next().and_then(|ends| ends.split_once('-'));
        let address = |text: &str| usize::from_str_radix(text, 16).ok();
        let Some((Some(begin), Some(end))) = ends.map(|(begin, end)| (address(begin), address(end))) else {
            continue;
        };
        let (begin, end) = (begin.next_multiple_of(PAGE), end / PAGE * PAGE);
        if end.saturating_sub(begin) >= LARGE {
            // SAFETY: the range is mapped, and neither call changes what stands there. Where the kernel refuses, it stays as it is.
            unsafe {
                libc::madvise(begin as *mut libc::c_void, end - begin, libc::MADV_HUGEPAGE);
                libc::madvise(begin as *mut libc::c_void, end - begin, MADV_COLLAPSE);
            }
        }
    }
}

/// Touches the stack ahead, so that no page of it is missing later.
#[inline(never)]
pub(crate) fn touch_stack() {
    const AHEAD: usize = 256 * 1024;
    let mut pages = [0u8; AHEAD];
    for byte in pages.iter_mut().step_by(4096) {
        // SAFETY: a plain local; volatile so that it is not left out.
        unsafe { core::ptr::write_volatile(byte, 1) };
    }
}

/// The command that makes a barrier everywhere, once it is known which one this kernel has.
static BARRIER: AtomicI32 = AtomicI32::new(libc::MEMBARRIER_CMD_PRIVATE_EXPEDITED);

/// Asks a kernel for a barrier on every processor: the quick one, for which a process registers once, or the slow one, or none.
fn find_barrier(ask: impl Fn(libc::c_int) -> io::Result<()>) -> io::Result<libc::c_int> {
    let quick = ask(libc::MEMBARRIER_CMD_REGISTER_PRIVATE_EXPEDITED)
        .and_then(|()| ask(libc::MEMBARRIER_CMD_PRIVATE_EXPEDITED));
    match quick {
        Ok(()) => Ok(libc::MEMBARRIER_CMD_PRIVATE_EXPEDITED),
        Err(_) => ask(libc::MEMBARRIER_CMD_GLOBAL).map(|()| libc::MEMBARRIER_CMD_GLOBAL),
    }
}

fn membarrier(command: libc::c_int) -> io::Result<()> {
    // SAFETY: the commands take no pointers.
    checked(unsafe { libc::syscall(libc::SYS_membarrier, command, 0, 0) } as libc::c_int)
}

/// Once at start: allows [`barrier_everywhere`]. Where it fails there is no such thing, and who needs it must do without.
pub(crate) fn register_barrier() -> io::Result<()> {
    find_barrier(membarrier).map(|command| BARRIER.store(command, Ordering::Relaxed))
}

/// A full memory barrier on every processor that runs a thread of this process.
#[cfg(not(loom))]
pub(crate) fn barrier_everywhere() {
    // It was tried when it was registered, and does not fail later.
    let _ = membarrier(BARRIER.load(Ordering::Relaxed));
}

/// The time stamp counter where it goes at one rate on all processors, else the monotonic clock: cheap enough for every step.
#[inline(always)]
pub(crate) fn ticks() -> u64 {
    #[cfg(target_arch = "x86_64")]
    if STEADY.load(Ordering::Relaxed) == YES {
        // SAFETY: every x86-64 processor has the instruction.
        return unsafe { core::arch::x86_64::_rdtsc() };
    }
    other_ticks()
}

/// Whether the time stamp counter is used: not known before it is asked for the first time.
#[cfg(target_arch = "x86_64")]
static STEADY: AtomicU8 = AtomicU8::new(0);
#[cfg(target_arch = "x86_64")]
const NO: u8 = 1;
#[cfg(target_arch = "x86_64")]
const YES: u8 = 2;

#[cold]
#[inline(never)]
fn other_ticks() -> u64 {
    #[cfg(target_arch = "x86_64")]
    if STEADY.load(Ordering::Relaxed) != NO {
        STEADY.store(if is_steady() { YES } else { NO }, Ordering::Relaxed);
        return ticks();
    }
    monotonic() as u64
}

/// Whether the processor says of its time stamp counter that it neither stops nor changes its rate. Some virtual machines keep that to
/// themselves; there the clock of the system is read, which costs more and is right.
#[cfg(target_arch = "x86_64")]
fn is_steady() -> bool {
    use core::arch::x86_64::__cpuid;
    const POWER: u32 = 0x8000_0007;
    const INVARIANT_TSC: u32 = 1 << 8;
    __cpuid(0x8000_0000).eax >= POWER && __cpuid(POWER).edx & INVARIANT_TSC != 0
}

/// The monotonic clock (ns) and [`ticks`] at one instant: the first try in which nothing happened between, or the best of a few.
pub(crate) fn monotonic_and_ticks() -> (i64, u64) {
    /// Three readings take less than this, where nothing disturbs them.
    const UNDISTURBED: u64 = 500;
    let mut best = (u64::MAX, 0, 0);
    for _ in 0..4 {
        let (before, time, after) = (ticks(), monotonic(), ticks());
        let between = after.saturating_sub(before);
        if between < best.0 {
            best = (between, time, before + between / 2);
        }
        if between < UNDISTURBED {
            break;
        }
    }
    (best.1, best.2)
}

/// Nanoseconds in a tick of [`ticks`], measured against the monotonic clock.
pub(crate) fn nanos_per_tick() -> f64 {
    static RATE: std::sync::OnceLock<f64> = std::sync::OnceLock::new();
    *RATE.get_or_init(|| {
        let (begin, begun) = monotonic_and_ticks();
        while monotonic() - begin < 2_000_000 {
            core::hint::spin_loop();
        }
        let (end, ended) = monotonic_and_ticks();
        (end - begin) as f64 / ended.saturating_sub(begun).max(1) as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_asked_for_the_quick_barrier_then_for_the_slow_one_and_then_there_is_none() {
        use libc::{MEMBARRIER_CMD_GLOBAL as SLOW, MEMBARRIER_CMD_PRIVATE_EXPEDITED as QUICK};
        let denied = || io::Error::from_raw_os_error(libc::EPERM);
        let kernel = |can: &'static [libc::c_int]| {
            move |command| if can.contains(&command) { Ok(()) } else { Err(denied()) }
        };
        const REGISTER: libc::c_int = libc::MEMBARRIER_CMD_REGISTER_PRIVATE_EXPEDITED;
        let found = |can| find_barrier(kernel(can)).ok();
        assert_eq!(found(&[REGISTER, QUICK, SLOW]), Some(QUICK));
        assert_eq!(found(&[REGISTER, SLOW]), Some(SLOW));
        assert_eq!(found(&[QUICK, SLOW]), Some(SLOW), "without registering it is none");
        assert_eq!(found(&[REGISTER]), None);
        assert_eq!(found(&[]), None);
        assert!(find_barrier(membarrier).is_ok(), "on the machine of the test");
    }
}

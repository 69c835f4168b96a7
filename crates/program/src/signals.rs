//! The signals that end a run: Ctrl-C, the end of the session, and what service managers send.
//!
//! ```text
//!   SIGINT, SIGTERM, SIGHUP ──▶ one thread in real time ──▶ latches of the robots ──▶ flag: the run shall end
//!                                                     └──▶ a second signal: the process ends at once
//! ```
//!
//! No other thread takes them. A signal for a process goes to its main thread where that would have it, and an ordinary thread may
//! wait long for a processor; the thread here is as urgent as the gates.

#![allow(unsafe_code)]

use std::io;
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use hardware::Latch;
use hardware::latch::Cause;
use types::Time;

/// The priority of the thread that waits for signals: that of the gates.
const PRIORITY: i32 = 90;
/// What a process returns that a signal ended.
const ENDED: i32 = 130;

/// What the signals do.
#[derive(Clone, Debug)]
pub(crate) struct Signals {
    asked_to_end: Arc<AtomicBool>,
    latches: Arc<OnceLock<Vec<Latch>>>,
}

impl Signals {
    /// Takes the signals, for this thread and all that it starts from now on. Someone who had the end of the session ignored (`nohup`)
    /// keeps that.
    pub(crate) fn take() -> io::Result<Signals> {
        let signals = Signals { asked_to_end: Arc::default(), latches: Arc::default() };
        let mut wanted = vec![libc::SIGINT, libc::SIGTERM];
        if !is_ignored(libc::SIGHUP) {
            wanted.push(libc::SIGHUP);
        }
        // A file that may not grow any more is an error of the write, as on a full disk, and no reason to leave a robot alone.
        // SAFETY: no handler is given, only that the signal be ignored.
        let _ = unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
        let set = set_of(&wanted);
        // SAFETY: the set is initialised, and nobody asks for the mask of before.
        let refused = unsafe { libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut()) };
        if refused != 0 {
            return Err(io::Error::from_raw_os_error(refused));
        }
        let mine = signals.clone();
        std::thread::Builder::new().name("sinew-signals".into()).spawn(move || mine.wait(&set))?;
        Ok(signals)
    }

    /// Set by the first signal.
    pub(crate) fn asked_to_end(&self) -> &Arc<AtomicBool> {
        &self.asked_to_end
    }

    /// The latches that a signal sets from now on: those of the one run of this process.
    pub(crate) fn stop(&self, latches: Vec<Latch>) {
        // There is one run that drives robots, so nobody was here before.
        let _ = self.latches.set(latches);
    }

    fn wait(&self, set: &libc::sigset_t) {
        let wish = libc::sched_param { sched_priority: PRIORITY };
        // SAFETY: the parameter is a valid one of this thread's own. Without the right to it the thread waits as an ordinary one.
        let _ = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const wish) };
        loop {
            let mut number = 0;
            // SAFETY: the set is initialised, and the number is this thread's own.
            if unsafe { libc::sigwait(set, &raw mut number) } != 0 {
                continue;
            }
            self.act();
        }
    }

    fn act(&self) {
        for latch in self.latches.get().into_iter().flatten() {
            latch.set(Cause::Signal, Time::ZERO);
        }
        if self.asked_to_end.swap(true, Ordering::Release) {
            // SAFETY: it ends the process, and whatever would have been cleaned up is what did not end in time.
            unsafe { libc::_exit(ENDED) };
        }
    }
}

fn set_of(signals: &[libc::c_int]) -> libc::sigset_t {
    let mut set = MaybeUninit::uninit();
    // SAFETY: sigemptyset initialises the set, and the signals are such as exist.
    unsafe {
        libc::sigemptyset(set.as_mut_ptr());
        for signal in signals {
            libc::sigaddset(set.as_mut_ptr(), *signal);
        }
        set.assume_init()
    }
}

fn is_ignored(signal: libc::c_int) -> bool {
    let mut action = MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: asked without a new action it only fills in the old one; all zero is a valid action too.
    unsafe {
        libc::sigaction(signal, std::ptr::null(), action.as_mut_ptr());
        action.assume_init().sa_sigaction == libc::SIG_IGN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_sets_the_latches_before_the_run_is_asked_to_end() {
        let signals = Signals { asked_to_end: Arc::default(), latches: Arc::default() };
        let latch = Latch::private();
        signals.stop(vec![latch.clone()]);
        signals.act();
        assert!(latch.state().has(Cause::Signal) && signals.asked_to_end().load(Ordering::Acquire));
    }
}

//! Many runs of one scenario, on all cores.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::error::Failure;
use crate::terminal;

/// Does each of `count` runs, which are called `what` while they go on, and gives what became of them by their number, from 0 on. Those that were
/// not begun when somebody interrupted are missing; after a failure no more are begun.
pub(super) fn each<T: Send>(
    what: &'static str,
    count: usize,
    asked_to_end: &AtomicBool,
    one: impl Fn(usize) -> Result<T, Failure> + Sync,
) -> Result<BTreeMap<usize, T>, Failure> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from).min(count);
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let failed = Mutex::new(None);
    let bar = terminal::progress(count as u64, what);
    let work = || {
        while !asked_to_end.load(Ordering::Relaxed) {
            let number = next.fetch_add(1, Ordering::Relaxed);
            if number >= count || failed.lock().unwrap_or_else(PoisonError::into_inner).is_some() {
                return;
            }
            match one(number) {
                Ok(outcome) => {
                    done.lock().unwrap_or_else(PoisonError::into_inner).insert(number, outcome);
                    bar.inc(1);
                }
                Err(failure) => *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure),
            }
        }
    };
    std::thread::scope(|scope| {
        for core in 0..cores {
            let thread = std::thread::Builder::new().name(format!("sinew-{what}-{core}"));
            if thread.spawn_scoped(scope, work).is_err() && core == 0 {
                let failure = Failure::new("no thread could be started for the runs").code(1);
                *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
            }
        }
    });
    bar.finish_and_clear();
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(failure) => Err(failure),
        None => Ok(done.into_inner().unwrap_or_else(PoisonError::into_inner)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_done_once_and_stands_under_its_number() {
        let begun = AtomicUsize::new(0);
        let done = each("runs", 50, &AtomicBool::new(false), |number| {
            begun.fetch_add(1, Ordering::Relaxed);
            Ok(number * number)
        });
        assert_eq!(done.unwrap(), (0..50).map(|number| (number, number * number)).collect());
        assert_eq!(begun.into_inner(), 50);
    }

    #[test]
    fn after_a_failure_and_after_an_interrupt_no_more_are_begun() {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let begun = AtomicUsize::new(0);
        let failed = each("runs", 10_000, &AtomicBool::new(false), |number| {
            begun.fetch_add(1, Ordering::Relaxed);
            if number == 3 { Err(Failure::new("the third")) } else { Ok(()) }
        });
        assert_eq!(failed.unwrap_err().problems[0].what, "the third");
        assert!(begun.into_inner() < 10_000);
        let interrupted = AtomicBool::new(false);
        let done = each("runs", 10_000, &interrupted, |number| {
            interrupted.store(number == 3 || interrupted.load(Ordering::Relaxed), Ordering::Relaxed);
            Ok(())
        });
        let done = done.unwrap();
        assert!(done.contains_key(&3) && done.len() <= 4 + 2 * cores, "{}", done.len());
    }
}

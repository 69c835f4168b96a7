//! The one shim through which the lock-free parts name their atomics, cells and futexes, so that loom checks the code that ships.
//!
//! Every ordering that a protocol needs has a name here, by which a model can weaken it: then the model must fail, or the ordering
//! is not needed, or the model does not look where it should.

#[cfg(loom)]
pub(crate) use explored::{AtomicU32, AtomicU64};
#[cfg(loom)]
pub(crate) use loom::{
    cell::UnsafeCell,
    sync::atomic::{Ordering, fence},
};

#[cfg(not(loom))]
pub(crate) use core::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// `loom`'s form of a cell over the one of the standard library: access through a closure that gets a pointer.
#[cfg(not(loom))]
#[derive(Debug, Default)]
pub(crate) struct UnsafeCell<T>(core::cell::UnsafeCell<T>);

#[cfg(not(loom))]
impl<T> UnsafeCell<T> {
    pub(crate) const fn new(value: T) -> UnsafeCell<T> {
        UnsafeCell(core::cell::UnsafeCell::new(value))
    }

    #[inline(always)]
    pub(crate) fn with<R>(&self, read: impl FnOnce(*const T) -> R) -> R {
        read(self.0.get())
    }

    #[inline(always)]
    pub(crate) fn with_mut<R>(&self, write: impl FnOnce(*mut T) -> R) -> R {
        write(self.0.get())
    }
}

/// An ordering that a protocol needs, under the name by which a model weakens it.
#[cfg(not(loom))]
#[inline(always)]
pub(crate) const fn named(_: &'static str, ordering: Ordering) -> Ordering {
    ordering
}

#[cfg(loom)]
pub(crate) use weaken::named;

/// The end of a step and the look at whose the core is stay in this order for whoever makes [`heavy_barrier`]; by itself it costs nothing.
#[inline(always)]
pub(crate) fn light_barrier() {
    #[cfg(not(loom))]
    core::sync::atomic::compiler_fence(Ordering::SeqCst);
    #[cfg(loom)]
    weaken::barrier("light barrier");
}

/// A full barrier on every processor that runs this process: the other half of [`light_barrier`].
pub(crate) fn heavy_barrier() {
    #[cfg(not(loom))]
    crate::os::barrier_everywhere();
    #[cfg(loom)]
    weaken::barrier("heavy barrier");
}

/// A word on which a thread can sleep.
#[derive(Debug)]
pub(crate) struct Futex {
    pub(crate) word: AtomicU32,
    /// In a model a lock and a condition stand for the kernel, which looks at the word and goes to sleep in one.
    #[cfg(loom)]
    kernel: (loom::sync::Mutex<()>, loom::sync::Condvar),
}

impl Futex {
    pub(crate) fn new(value: u32) -> Futex {
        Futex {
            word: AtomicU32::new(value),
            #[cfg(loom)]
            kernel: (loom::sync::Mutex::new(()), loom::sync::Condvar::new()),
        }
    }

    /// Sleeps while the word is `expected`, until it is woken or the time (monotonic, ns) has come. It may return for no reason.
    #[inline]
    pub(crate) fn wait(&self, expected: u32, until: Option<i64>) {
        #[cfg(not(loom))]
        crate::os::futex_wait(&self.word, expected, until);
        #[cfg(loom)]
        {
            let _ = until;
            let looking = self.kernel.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if self.word.load(Ordering::Relaxed) == expected {
                drop(self.kernel.1.wait(looking));
            }
        }
    }

    /// Wakes the thread that sleeps on it.
    #[inline]
    pub(crate) fn wake(&self) {
        #[cfg(not(loom))]
        crate::os::futex_wake(&self.word);
        #[cfg(loom)]
        {
            let _looking = self.kernel.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            self.kernel.1.notify_one();
        }
    }
}

/// `loom`'s atomics, where every access is a place at which another thread may go on.
///
/// Of the accesses to an atomic `loom` remembers the last one alone when it looks for other orders: a thread that loads and then
/// stores hides from it that the store could have come before the load of another thread, and whole orders are never tried. An
/// access to one atomic that all share, with no meaning for memory, makes it try them all.
#[cfg(loom)]
mod explored {
    use super::Ordering;
    use loom::sync::atomic as plain;

    loom::lazy_static! {
        static ref TURN: plain::AtomicU32 = plain::AtomicU32::new(0);
    }

    pub(super) fn turn() {
        TURN.fetch_add(1, Ordering::Relaxed);
    }

    macro_rules! atomic {
        ($name:ident, $number:ty) => {
            #[derive(Debug, Default)]
            pub(crate) struct $name(plain::$name);

            #[allow(dead_code)]
            impl $name {
                pub(crate) fn new(value: $number) -> $name {
                    $name(plain::$name::new(value))
                }
                pub(crate) fn load(&self, ordering: Ordering) -> $number {
                    turn();
                    self.0.load(ordering)
                }
                pub(crate) fn store(&self, value: $number, ordering: Ordering) {
                    turn();
                    self.0.store(value, ordering);
                }
                pub(crate) fn swap(&self, value: $number, ordering: Ordering) -> $number {
                    turn();
                    self.0.swap(value, ordering)
                }
                pub(crate) fn fetch_or(&self, value: $number, ordering: Ordering) -> $number {
                    turn();
                    self.0.fetch_or(value, ordering)
                }
                pub(crate) fn fetch_and(&self, value: $number, ordering: Ordering) -> $number {
                    turn();
                    self.0.fetch_and(value, ordering)
                }
                pub(crate) fn fetch_sub(&self, value: $number, ordering: Ordering) -> $number {
                    turn();
                    self.0.fetch_sub(value, ordering)
                }
                pub(crate) fn compare_exchange(
                    &self,
                    from: $number,
                    to: $number,
                    ordering: Ordering,
                    otherwise: Ordering,
                ) -> Result<$number, $number> {
                    turn();
                    self.0.compare_exchange(from, to, ordering, otherwise)
                }
            }
        };
    }

    atomic!(AtomicU32, u32);
    atomic!(AtomicU64, u64);
}

/// Models with one ordering weakened.
#[cfg(loom)]
pub(crate) mod weaken {
    use super::{Ordering, fence};
    use std::collections::BTreeSet;
    use std::sync::{Mutex, PoisonError};

    /// The name of the ordering that is relaxed, and all names that were met.
    static WEAK: Mutex<(Option<&'static str>, BTreeSet<&'static str>)> = Mutex::new((None, BTreeSet::new()));
    /// One model at a time: the name above is for the whole process.
    static ONE: Mutex<()> = Mutex::new(());
    /// Nearly all mistakes show with two interruptions.
    const MOST: usize = 3;

    fn is_weak(name: &'static str) -> bool {
        let mut weak = WEAK.lock().unwrap_or_else(PoisonError::into_inner);
        weak.1.insert(name);
        weak.0 == Some(name)
    }

    pub(crate) fn named(name: &'static str, ordering: Ordering) -> Ordering {
        if is_weak(name) { Ordering::Relaxed } else { ordering }
    }

    pub(super) fn barrier(name: &'static str) {
        if !is_weak(name) {
            fence(Ordering::SeqCst);
        }
    }

    /// A search in which a thread is interrupted so many times at most where it could go on. LOOM_MAX_PREEMPTIONS says another number.
    fn bounded(preemptions: usize) -> loom::model::Builder {
        let mut builder = loom::model::Builder::new();
        builder.preemption_bound = builder.preemption_bound.or(Some(preemptions));
        builder
    }

    /// Runs a model as it ships and no more, where there are too many orders for all of it.
    pub(crate) fn run(preemptions: usize, model: impl Fn() + Sync + Send + 'static) {
        // What it meets is not for the models that weaken.
        let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        bounded(preemptions).check(model);
    }

    /// Runs a model as it ships, then once for each ordering that it met, weakened; says for each what the model found.
    /// Those in `spare` are met but do not matter to this model: another one needs them.
    pub(crate) fn check(spare: &[&str], model: impl Fn() + Sync + Send + Copy + 'static) {
        let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let run = |weak: Option<&'static str>| {
            WEAK.lock().unwrap_or_else(PoisonError::into_inner).0 = weak;
            let model = move || {
                // Made by the first thread, so that it orders nothing between the others.
                super::explored::turn();
                model();
            };
            let found = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| bounded(MOST).check(model)));
            WEAK.lock().unwrap_or_else(PoisonError::into_inner).0 = None;
            found.map_err(|what| {
                let text = what.downcast_ref::<String>().cloned();
                text.or_else(|| what.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default()
            })
        };
        WEAK.lock().unwrap_or_else(PoisonError::into_inner).1.clear();
        if let Err(what) = run(None) {
            panic!("as it ships: {what}");
        }
        let met: Vec<&'static str> =
            WEAK.lock().unwrap_or_else(PoisonError::into_inner).1.iter().copied().collect();
        let mut missed = Vec::new();
        for name in met.into_iter().filter(|name| !spare.contains(name)) {
            match run(Some(name)) {
                Err(what) => println!("  without \"{name}\": {}", what.lines().next().unwrap_or_default()),
                Ok(()) => missed.push(name),
            }
        }
        assert!(missed.is_empty(), "weakened, and nothing was found: {missed:?}");
    }
}

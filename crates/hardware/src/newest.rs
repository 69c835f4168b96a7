//! Hands the newest value from one thread to others that may be slow, and never makes the first one wait.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// One place for what is newest, one for what is being written, and two for readers who are still at something older.
const PLACES: usize = 4;

#[derive(Debug)]
struct Shared<T> {
    places: [Mutex<T>; PLACES],
    newest: AtomicUsize,
}

/// The end where values go in. There is one.
#[derive(Debug)]
pub(crate) struct Publisher<T>(Arc<Shared<T>>);

/// An end where the newest value comes out. There may be many.
#[derive(Debug)]
pub(crate) struct Newest<T>(Arc<Shared<T>>);

impl<T> Clone for Newest<T> {
    fn clone(&self) -> Newest<T> {
        Newest(self.0.clone())
    }
}

/// A pair of ends. All places begin as clones of `first`.
pub(crate) fn newest<T: Clone>(first: T) -> (Publisher<T>, Newest<T>) {
    let places = core::array::from_fn(|_| Mutex::new(first.clone()));
    let shared = Arc::new(Shared { places, newest: AtomicUsize::new(0) });
    (Publisher(shared.clone()), Newest(shared))
}

impl<T> Publisher<T> {
    /// Writes a value over some earlier one, in place. Nobody is waited for: locks are only tried, by both sides, so no thread
    /// ever sleeps on one or has to be woken. False where every place was held by a reader; then nothing is published.
    pub(crate) fn publish(&self, write: impl FnOnce(&mut T)) -> bool {
        let newest = self.0.newest.load(Ordering::Relaxed);
        for step in 1..PLACES {
            let place = (newest + step) % PLACES;
            let Ok(mut value) = self.0.places[place].try_lock() else { continue };
            write(&mut value);
            drop(value);
            // Release: partner of the acquire in `read`; the lock orders the value itself.
            self.0.newest.store(place, Ordering::Release);
            return true;
        }
        false
    }
}

impl<T> Newest<T> {
    /// Looks at the newest value. Another look is needed only when three newer ones came in the meantime.
    pub(crate) fn read<R>(&self, look: impl Fn(&T) -> R) -> R {
        loop {
            let place = self.0.newest.load(Ordering::Acquire);
            let value = match self.0.places[place].try_lock() {
                Ok(value) => value,
                // A writer that panicked left a value that is whole in memory, if old in parts.
                Err(std::sync::TryLockError::Poisoned(value)) => value.into_inner(),
                Err(std::sync::TryLockError::WouldBlock) => {
                    std::thread::yield_now();
                    continue;
                }
            };
            // The writer may have come round to this place and written what it has not yet published: whoever saw that would
            // next see the value before it. While the lock is held the place stays what it is.
            if self.0.newest.load(Ordering::Acquire) == place {
                return look(&value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_see_whole_values_that_never_grow_older() {
        let (publisher, newest) = newest((0u64, 0u64));
        std::thread::scope(|scope| {
            for _ in 0..2 {
                let newest = newest.clone();
                scope.spawn(move || {
                    let mut last = 0;
                    while last < 20_000 {
                        let (a, b) = newest.read(|value| *value);
                        assert_eq!(b, 3 * a, "torn");
                        assert!(a >= last, "{a} after {last}");
                        last = a;
                    }
                });
            }
            for n in 1..=20_000 {
                // The last one must arrive, or the readers would look for it for ever.
                while !publisher.publish(|value| *value = (n, 3 * n)) {
                    std::hint::spin_loop();
                }
            }
        });
    }

    #[test]
    fn a_reader_that_holds_a_value_does_not_stop_the_writer() {
        let (publisher, newest) = newest(0);
        newest.read(|held| {
            for n in 1..=10 {
                assert!(publisher.publish(|value| *value = n));
            }
            assert_eq!((*held, newest.read(|value| *value)), (0, 10));
        });
    }
}

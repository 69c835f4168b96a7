//! Who has the last word on a change: the executor that begins it, or the control side that takes it back.
//!
//! An executor may be in a step that lasts. Whoever asked for a change does not wait for ever: it is taken back, and the request
//! refused. Then the executor must never do it, however late it comes upon it; and when it has begun, it is too late to take it back.

use crate::sync::{AtomicU64, Ordering};

/// The number of the last change that was decided. Changes are numbered from one, and decided in that order.
#[derive(Debug, Default)]
pub(crate) struct Turn(AtomicU64);

impl Turn {
    /// Decides the change with this number. False when the other side has done so; each side asks once.
    ///
    /// Both sides exchange the same word, so one of them is second. Nothing else passes through it: the change itself goes through
    /// the rings, which order what they pass on.
    #[inline]
    pub(crate) fn decide(&self, number: u64) -> bool {
        self.0.compare_exchange(number - 1, number, Ordering::Relaxed, Ordering::Relaxed).is_ok()
    }
}

#[cfg(test)]
#[cfg(loom)]
#[allow(unsafe_code)] // the model touches what a change touches
mod model {
    use super::*;
    use crate::ring::ring;
    use crate::sync::{UnsafeCell, weaken};
    use loom::{sync::Arc, thread};

    struct Place(UnsafeCell<u32>);
    // SAFETY: that nobody touches it at once is what the model is to show.
    unsafe impl Sync for Place {}
    // SAFETY: a plain number.
    unsafe impl Send for Place {}

    /// The control side takes a change back at any moment and then uses what the change would have used; the executor comes upon it
    /// before, meanwhile, or after, and on the next one.
    #[test]
    fn a_change_is_done_or_taken_back_and_never_both() {
        weaken::check(&["ring: refuse, look", "ring: refuse, give back"], || {
            let (turn, place) = (Arc::new(Turn::default()), Arc::new(Place(UnsafeCell::new(0))));
            let (mut changes, mut asked) = ring::<Option<u64>>(2, false);
            let (mut answers, mut answered) = ring::<Option<(u64, bool)>>(2, false);
            let (theirs, there) = (turn.clone(), place.clone());
            let executor = thread::spawn(move || {
                let mut done = 0;
                while done < 2 {
                    if !asked.advance() {
                        thread::yield_now();
                        continue;
                    }
                    let number = asked.current_mut().take().expect("an empty change");
                    let mine = theirs.decide(number);
                    if mine {
                        // SAFETY: as above.
                        there.0.with_mut(|place| unsafe { *place += 1 });
                    }
                    answers.push(|slot| *slot = Some((number, mine)));
                    done += 1;
                }
            });
            let mut done = 0;
            for number in 1..=2 {
                changes.push(|slot| *slot = Some(number));
                if turn.decide(number) {
                    // Taken back, before anybody began: what it would have changed is this side's.
                    // SAFETY: as above.
                    place.0.with_mut(|place| unsafe { *place += 10 });
                } else {
                    loop {
                        if answered.advance() {
                            let (of, mine) = answered.current_mut().take().expect("an empty answer");
                            if of == number {
                                assert!(mine, "nobody has decided");
                                done += 1;
                                break;
                            }
                        } else {
                            thread::yield_now();
                        }
                    }
                }
            }
            executor.join().unwrap();
            // SAFETY: the other thread has ended.
            let sum = place.0.with(|place| unsafe { *place });
            assert_eq!(sum, done + 10 * (2 - done));
        });
    }
}

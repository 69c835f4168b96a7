//! An output that was made to misbehave: what it keeps, and what it sends in place of a message.
//!
//! All memory for it is taken on the control side, so that a fault in a running system disturbs nothing but what it is meant to.

use types::chance::Stream;
use types::{Message, Time};

use super::OutputFault;

/// How many messages late those of an output come that was made to delay them.
const MESSAGES_LATE: u64 = 3;

/// A message that is kept.
pub(super) struct Kept<T: Message> {
    pub(super) head: T,
    row: Box<[T::Element]>,
    len: usize,
    /// The time that it speaks of.
    pub(super) stamp: Time,
}

impl<T: Message> Kept<T> {
    fn new(rows: usize) -> Kept<T> {
        let row = vec![T::Element::default(); rows].into_boxed_slice();
        Kept { head: T::default(), row, len: 0, stamp: Time::ZERO }
    }

    fn fill(&mut self, stamp: Time, fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize) {
        self.stamp = stamp;
        self.len = fill(&mut self.head, &mut self.row).min(self.row.len());
    }

    /// The part of its row that is in use.
    pub(super) fn row(&self) -> &[T::Element] {
        &self.row[..self.len]
    }
}

/// A fault of an output, with all the memory that it needs.
pub(super) struct Faulty<T: Message> {
    fault: OutputFault,
    /// The message that is being spoilt, or those that are kept.
    kept: Box<[Kept<T>]>,
    /// How many were kept.
    count: u64,
}

impl<T: Message> Faulty<T> {
    /// For messages whose rows are as long as this at most.
    pub(super) fn new(fault: OutputFault, rows: usize) -> Faulty<T> {
        let places = match fault {
            OutputFault::Delayed => MESSAGES_LATE + 1,
            OutputFault::Stuck => 2,
            _ => 1,
        };
        Faulty { fault, kept: (0..places).map(|_| Kept::new(rows)).collect(), count: 0 }
    }

    /// What goes out in place of the message that `fill` makes; nothing where none does. `draws` are those of this message.
    pub(super) fn in_place_of(
        &mut self,
        stamp: Time,
        draws: Stream,
        fill: impl FnOnce(&mut T, &mut [T::Element]) -> usize,
    ) -> Option<&Kept<T>> {
        let place = |count: u64| (count % (MESSAGES_LATE + 1)) as usize;
        match self.fault {
            OutputFault::Off => return None,
            OutputFault::Intermittent if draws.uniform(0) < 0.5 => return None,
            OutputFault::Stuck => {
                // The first value, said anew; the others are made all the same, as the sender knows nothing of its fault.
                self.kept[self.count.min(1) as usize].fill(stamp, fill);
                self.kept[0].stamp = stamp;
                self.count += 1;
            }
            OutputFault::Delayed => {
                self.kept[place(self.count)].fill(stamp, fill);
                self.count += 1;
                let old = self.count.checked_sub(MESSAGES_LATE + 1)?;
                return Some(&self.kept[place(old)]);
            }
            OutputFault::None | OutputFault::Intermittent => self.kept[0].fill(stamp, fill),
            OutputFault::Garbage | OutputFault::Wrong => {
                let kept = &mut self.kept[0];
                kept.fill(stamp, fill);
                let wild = self.fault == OutputFault::Garbage;
                let mut number = 0;
                kept.head.disturb(&mut kept.row[..kept.len], wild, &mut || {
                    number += 1;
                    draws.uniform(number)
                });
            }
        }
        Some(&self.kept[0])
    }
}

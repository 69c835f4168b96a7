//! Who waits at a queue, and who of them is called.
//!
//! ```text
//!              wait                     call: highest rank first
//!   busy ────────────────► waiting ───────────────────────────► busy, and told
//!    ▲ │                      │                                   ▲
//!    │ │ pass                 │ stop waiting                      │
//!    │ └────► passing ────────┼───────────────────────────────────┘
//!    │           │            │    call: only for a new message, when nobody waits
//!    └───────────┴────────────┘
//! ```
//!
//! Both sides change the same word, so of a sender who has put a message in and a receiver who is about to wait one comes second:
//! either the sender sees that somebody waits, or the receiver, who looks once more, sees the message.

use crate::sync::{AtomicU64, Ordering, named};

/// The most receivers of a queue.
pub(crate) const SEATS: usize = if cfg!(loom) { 3 } else { 32 };

/// A bit for each receiver: in the lower half whether it waits, in the upper half whether it left to others what there was.
pub(super) struct Calls {
    word: AtomicU64,
    ranks: Box<[AtomicU64]>,
}

const fn waiting(seat: u32) -> u64 {
    1 << seat
}

const fn passing(seat: u32) -> u64 {
    1 << (seat + 32)
}

impl Calls {
    pub(super) fn new() -> Calls {
        Calls { word: AtomicU64::new(0), ranks: (0..SEATS).map(|_| AtomicU64::new(0)).collect() }
    }

    pub(super) fn set_rank(&self, seat: u32, rank: u32) {
        self.ranks[seat as usize].store(rank.into(), Ordering::Relaxed);
    }

    /// The receiver waits. It looks for messages once more after this.
    pub(super) fn wait(&self, seat: u32) {
        // Pairs with the release in `call` and `close`: what was put in or closed before that is seen after this.
        self.word.fetch_or(waiting(seat), named("queue: wait", Ordering::Acquire));
    }

    /// It does not wait any more. Whether it was called meanwhile does not matter to one that looks for messages anyway.
    #[inline]
    pub(super) fn stop_waiting(&self, seat: u32) {
        let both = waiting(seat) | passing(seat);
        // Nobody else sets these bits.
        if self.word.load(Ordering::Relaxed) & both != 0 {
            self.word.fetch_and(!both, Ordering::Relaxed);
        }
    }

    /// The same for one that will not look: if it was called, the message for which that was is seen after this.
    pub(super) fn withdraw(&self, seat: u32) {
        let both = waiting(seat) | passing(seat);
        // Pairs with the release in `call`.
        self.word.fetch_and(!both, named("queue: withdraw", Ordering::Acquire));
    }

    /// It was closed, and does not wait. If it does after all, it sees that it was closed.
    pub(super) fn close(&self, seat: u32) {
        // Pairs with the acquire in `wait`.
        self.word.fetch_and(!(waiting(seat) | passing(seat)), named("queue: close", Ordering::Release));
    }

    /// It leaves what there is to others.
    pub(super) fn pass(&self, seat: u32) {
        self.word.fetch_or(passing(seat), Ordering::Relaxed);
    }

    /// Everything that was put in by those who called before is seen after this.
    pub(super) fn look(&self) {
        self.word.fetch_or(0, Ordering::Acquire);
    }

    /// Calls the first who waits, by rank; for a new message, when nobody does, the first who left the last one to others.
    #[inline]
    pub(super) fn call(&self, is_new: bool) -> Option<u32> {
        // A change that changes nothing: one that waits after it sees the message. Pairs with the acquire in `wait` and `withdraw`.
        let mut word = self.word.fetch_or(0, named("queue: call", Ordering::Release));
        loop {
            let (waits, passes) = (word as u32, if is_new { (word >> 32) as u32 } else { 0 });
            let (seat, bit) = match (self.first(waits), self.first(passes)) {
                (Some(seat), _) => (seat, waiting(seat)),
                (None, Some(seat)) => (seat, passing(seat)),
                (None, None) => return None,
            };
            // An exchange hands on what was released before it.
            match self.word.compare_exchange(word, word & !bit, Ordering::Relaxed, Ordering::Relaxed) {
                Ok(_) => return Some(seat),
                Err(now) => word = now,
            }
        }
    }

    /// The one with the lowest rank of those in the mask.
    fn first(&self, mut mask: u32) -> Option<u32> {
        let mut best = None;
        while mask != 0 {
            let seat = mask.trailing_zeros();
            mask &= mask - 1;
            let rank = self.ranks[seat as usize].load(Ordering::Relaxed);
            if best.is_none_or(|(least, _)| rank < least) {
                best = Some((rank, seat));
            }
        }
        best.map(|(_, seat)| seat)
    }
}

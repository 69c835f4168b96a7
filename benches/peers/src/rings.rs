//! The rings of `rtrb`, in one thread: what a message costs at least, to one receiver and to 64.

use rtrb::{Consumer, Producer, RingBuffer};

use crate::document::{Document, Figure};
use crate::machine::{means, settle};
use crate::settings::Settings;

/// The other system.
pub(crate) const PEER: &str = "rtrb";

/// `push_pop`: one message to one receiver and out again. `fanout64`: one message into 64 rings and out of each; `fanout64_push`
/// and `fanout64_pop` are its two sides. All are means of a block.
pub(crate) const FIGURES: &[&str] = &["push_pop", "fanout64", "fanout64_push", "fanout64_pop"];

/// A message of 64 bytes.
pub(crate) type Parcel = [u64; 8];

/// Messages to one receiver where nobody says how many; to 64 receivers go a sixteenth of them.
const ITERATIONS: u64 = 1_000_000;
const BLOCK: u64 = 1000;
const FANOUT_BLOCK: u64 = 100;
/// Receivers of the fan-out, and places in each ring.
const RECEIVERS: usize = 64;
const ROOM: usize = 64;

/// Measures.
pub(crate) fn measure(settings: &Settings) -> Result<Document, String> {
    let granted = settle("rtrb", settings, 0);
    let iterations = settings.iterations_or(ITERATIONS);
    let mut one = Fanout::to(1);
    let push_pop = means(iterations.div_ceil(BLOCK), BLOCK, || {
        one.push();
        one.pop();
    });
    let mut many = Fanout::to(RECEIVERS);
    let blocks = (iterations / 16).div_ceil(FANOUT_BLOCK);
    let fanout = means(blocks, FANOUT_BLOCK, || {
        many.push();
        many.pop();
    });
    // The rings hold a block of this length at most, so sending and taking are timed in turns.
    let (mut push, mut pop) = (Vec::new(), Vec::new());
    for _ in 0..blocks {
        push.extend(means(1, ROOM as u64, || many.push()));
        pop.extend(means(1, ROOM as u64, || many.pop()));
    }
    if one.lost + many.lost > 0 {
        return Err(format!("{} messages were lost", one.lost + many.lost));
    }
    Ok(Document {
        peer: PEER,
        version: env!("VERSION_RTRB").to_owned(),
        granted: vec![granted],
        figures: vec![
            Figure::new("push_pop", "ns", push_pop),
            Figure::new("fanout64", "ns", fanout),
            Figure::new("fanout64_push", "ns", push),
            Figure::new("fanout64_pop", "ns", pop),
        ],
    })
}

/// A sender with a ring to each of its receivers.
struct Fanout {
    rings: Vec<(Producer<Parcel>, Consumer<Parcel>)>,
    sent: u64,
    taken: u64,
    lost: u64,
}

impl Fanout {
    fn to(receivers: usize) -> Fanout {
        Fanout { rings: (0..receivers).map(|_| RingBuffer::new(ROOM)).collect(), sent: 0, taken: 0, lost: 0 }
    }

    /// Sends the next message to all.
    fn push(&mut self) {
        self.sent += 1;
        let parcel = std::hint::black_box([self.sent; 8]);
        for (sender, _) in &mut self.rings {
            self.lost += u64::from(sender.push(parcel).is_err());
        }
    }

    /// Takes the next message at all receivers.
    fn pop(&mut self) {
        self.taken += 1;
        for (_, receiver) in &mut self.rings {
            let parcel = std::hint::black_box(receiver.pop());
            self.lost += u64::from(parcel.ok().is_none_or(|parcel| parcel[0] != self.taken));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_pushed_comes_out_in_order_and_the_rest_is_counted() {
        let mut fanout = Fanout::to(3);
        (0..ROOM).for_each(|_| fanout.push());
        (0..ROOM).for_each(|_| fanout.pop());
        assert_eq!(fanout.lost, 0);
        fanout.pop();
        assert_eq!(fanout.lost, 3);
    }
}

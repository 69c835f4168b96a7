//! Weights by place and heading, in a table of fixed size.

use types::Pose;
use types::geometry::{TAU, whole, wrap};

/// A bin that holds something.
#[derive(Clone, Copy, Debug, Default)]
struct Slot {
    /// The filling of the table in which it was taken; others are free.
    filling: u32,
    key: (i32, i32, i32),
    weight: f64,
    /// The weighted sum of what is in it, and of the headings against the first of them.
    x: f64,
    y: f64,
    first: f64,
    turn: f64,
}

/// Bins over (x, y, heading); open addressing, at least two slots for each particle.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    slots: Vec<Slot>,
    /// Those that hold something.
    taken: Vec<u32>,
    filling: u32,
    side: f64,
    angle: f64,
}

impl Bins {
    /// Bins for at most so many particles, with a side (m) and an angle (rad).
    pub(super) fn new(most: usize, (side, angle): (f64, f64)) -> Bins {
        let slots = vec![Slot::default(); (2 * most).next_power_of_two()];
        Bins { slots, taken: Vec::with_capacity(most), filling: 1, side, angle }
    }

    pub(super) fn clear(&mut self) {
        self.filling = self.filling.wrapping_add(1);
        self.taken.clear();
        if self.filling == 0 {
            self.slots.fill(Slot::default());
            self.filling = 1;
        }
    }

    /// How many bins hold something.
    pub(super) fn len(&self) -> usize {
        self.taken.len()
    }

    pub(super) fn add(&mut self, pose: Pose, weight: f64) {
        let turns = whole(wrap(pose.heading) / self.angle).rem_euclid(whole(TAU / self.angle).max(1));
        let key = (whole(pose.x / self.side), whole(pose.y / self.side), turns);
        let mask = self.slots.len() - 1;
        let mut at = hash(key) as usize & mask;
        // There are more slots than particles, so a free one is found.
        while self.slots[at].filling == self.filling && self.slots[at].key != key {
            at = (at + 1) & mask;
        }
        let slot = &mut self.slots[at];
        if slot.filling != self.filling {
            *slot = Slot { filling: self.filling, key, first: pose.heading, ..Slot::default() };
            self.taken.push(at as u32);
        }
        slot.weight += weight;
        slot.x += weight * pose.x;
        slot.y += weight * pose.y;
        slot.turn += weight * wrap(pose.heading - slot.first);
    }

    /// The mean of what is in the heaviest bin.
    pub(super) fn heaviest(&self) -> Option<Pose> {
        let taken = self.taken.iter().map(|at| &self.slots[*at as usize]).filter(|slot| slot.weight > 0.0);
        // Of equal ones the lowest key, whatever slot it fell into.
        let heaviest = taken.max_by(|a, b| a.weight.total_cmp(&b.weight).then(b.key.cmp(&a.key)))?;
        let Slot { weight, x, y, first, turn, .. } = *heaviest;
        Some(Pose::new(x / weight, y / weight, wrap(first + turn / weight)))
    }
}

/// The finaliser of murmur3 over the three numbers.
fn hash((x, y, turns): (i32, i32, i32)) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77)
        ^ (turns as u32).wrapping_mul(0xc2b2_ae3d);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

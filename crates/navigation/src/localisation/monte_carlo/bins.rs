//! Which bins of place and heading guesses fill: a table of fixed size with open addresses.

use libm::floor;
use types::Pose;
use types::geometry::TAU;

/// Sides of a bin: half a metre, and an eighth of a turn.
const SIDE: f64 = 0.5;
const SECTORS: f64 = 8.0;

/// A bin that is filled.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bin {
    key: [i32; 3],
    count: u32,
    /// One of its guesses.
    guess: Pose,
}

/// Bins and how many guesses are in each.
#[derive(Clone, Debug)]
pub(super) struct Bins {
    table: Vec<Option<Bin>>,
    filled: usize,
}

impl Bins {
    /// For so many guesses at most.
    pub(super) fn new(most: usize) -> Bins {
        Bins { table: vec![None; (2 * most).next_power_of_two()], filled: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.table.fill(None);
        self.filled = 0;
    }

    pub(super) fn add(&mut self, guess: Pose) {
        let turn = guess.heading / TAU * SECTORS;
        let key = [guess.x / SIDE, guess.y / SIDE, turn].map(|x| floor(x) as i32);
        let mask = self.table.len() - 1;
        let mut place = scrambled(key) as usize & mask;
        // The table is never more than half full, so an empty place comes soon.
        loop {
            match &mut self.table[place] {
                Some(bin) if bin.key == key => {
                    bin.count += 1;
                    return;
                }
                Some(_) => place = (place + 1) & mask,
                empty => {
                    *empty = Some(Bin { key, count: 1, guess });
                    self.filled += 1;
                    return;
                }
            }
        }
    }

    /// How many bins have a guess.
    pub(super) const fn filled(&self) -> usize {
        self.filled
    }

    /// A guess in the bin with the most.
    pub(super) fn fullest(&self) -> Pose {
        let fullest = self.table.iter().flatten().max_by_key(|bin| bin.count);
        fullest.map_or(Pose::default(), |bin| bin.guess)
    }
}

/// Bins beside each other shall not lie beside each other in the table.
fn scrambled(key: [i32; 3]) -> u64 {
    let mut sum = 0u64;
    for part in key {
        sum = (sum ^ u64::from(part as u32)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        sum ^= sum >> 29;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_fill_the_bins_that_they_are_in() {
        let mut bins = Bins::new(100);
        for i in 0..60 {
            let x = f64::from(i % 6);
            bins.add(Pose::new(x + 0.1, -0.2, 0.1));
        }
        for _ in 0..5 {
            bins.add(Pose::new(2.2, -0.3, 0.2));
        }
        bins.add(Pose::new(2.2, -0.3, -3.0));
        assert_eq!(bins.filled(), 7);
        assert_eq!(libm::floor(bins.fullest().x), 2.0);
        bins.clear();
        assert_eq!(bins.filled(), 0);
    }
}

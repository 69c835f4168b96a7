//! What is being added up while offers are fused.

use super::Inference;
use crate::fuzzy::{self, Claim, Set};
use libm::{fmax, fmin};

/// Everything that the offers say, by axis and form.
#[derive(Default)]
pub(super) struct Sums {
    /// Speeds in numbers.
    pub(super) linear: Mean,
    /// Turn rates in numbers.
    pub(super) angular: Mean,
    /// Words for a speed.
    pub(super) along: Words,
    /// Words for a change of the speed.
    pub(super) speed: Words,
    /// Words for a turn.
    pub(super) turn: Words,
}

/// A weighted mean in the making.
#[derive(Default)]
pub(super) struct Mean {
    sum: f64,
    weight: f64,
}

impl Mean {
    pub(super) fn add(&mut self, value: f64, weight: f64) {
        self.sum += value * weight;
        self.weight += weight;
    }

    pub(super) fn value(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| self.sum / self.weight)
    }
}

/// The words on one axis: a set for each sign for Mamdani, a mean for Sugeno. Most offers are in numbers, and the sets are large: there
/// is none before the first word.
#[derive(Default)]
pub(super) struct Words {
    positive: Option<Set>,
    negative: Option<Set>,
    singletons: Mean,
    /// The largest weight of a word.
    pub(super) weight: f64,
}

impl Words {
    pub(super) fn add(&mut self, claim: Claim, sign: f64, weight: f64) {
        let set = if sign > 0.0 { &mut self.positive } else { &mut self.negative };
        set.get_or_insert(Set::EMPTY).add(claim, fmin(weight, 1.0));
        self.singletons.add(sign * claim.term.centre(), weight);
        self.weight = fmax(self.weight, weight);
    }

    pub(super) fn value(&self, inference: Inference) -> Option<f64> {
        // A word without weight is not heard, so without weight there is no word.
        if self.weight == 0.0 {
            return None;
        }
        match inference {
            Inference::Sugeno => self.singletons.value(),
            // Claims of the negative side were made on its mirror image.
            Inference::Mamdani => {
                let [positive, negative] =
                    [&self.positive, &self.negative].map(|set| set.as_ref().unwrap_or(const { &Set::EMPTY }));
                fuzzy::centroid_of_two_sides(positive, negative)
            }
        }
    }
}

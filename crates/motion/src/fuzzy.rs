//! Fuzzy terms, hedges and inference on the universe [−1, 1].

use libm::{fabs, fmax, fmin, sqrt};

/// Points of the grid on which sets are sampled: steps of 0.02.
pub const POINTS: usize = 101;

/// Half the width of a term's triangle.
pub const HALF_WIDTH: f64 = 0.33;

/// The largest value of min(√m, 1 − m²), by which "slightly" is divided: t = √m solves t = 1 − t⁴.
const SLIGHTLY_PEAK: f64 = 0.724_491_959_000_515_6;

/// The seven terms: triangles of half width 0.33, those at the ends shouldered. Negative is right or slower.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Term {
    /// Around −1.
    NegativeBig,
    /// Around −0.66.
    NegativeMedium,
    /// Around −0.33.
    NegativeSmall,
    /// Around 0.
    Zero,
    /// Around 0.33.
    PositiveSmall,
    /// Around 0.66.
    PositiveMedium,
    /// Around 1.
    PositiveBig,
}

impl Term {
    /// All terms, from the lowest.
    pub const ALL: [Term; 7] = [
        Term::NegativeBig,
        Term::NegativeMedium,
        Term::NegativeSmall,
        Term::Zero,
        Term::PositiveSmall,
        Term::PositiveMedium,
        Term::PositiveBig,
    ];

    /// Where the term is fully true.
    pub const fn centre(self) -> f64 {
        match self {
            Term::NegativeBig => -1.0,
            Term::NegativeMedium => -0.66,
            Term::NegativeSmall => -0.33,
            Term::Zero => 0.0,
            Term::PositiveSmall => 0.33,
            Term::PositiveMedium => 0.66,
            Term::PositiveBig => 1.0,
        }
    }

    /// Degree, from 0 to 1, to which `x` belongs to the term.
    pub fn membership(self, x: f64) -> f64 {
        let beyond = match self {
            Term::NegativeBig => x <= -1.0,
            Term::PositiveBig => x >= 1.0,
            _ => false,
        };
        if beyond { 1.0 } else { fmax(0.0, 1.0 - fabs(x - self.centre()) / HALF_WIDTH) }
    }
}

/// A word that reshapes a set (Zadeh).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Hedge {
    /// m
    #[default]
    Plain,
    /// m²
    Very,
    /// m³
    Extremely,
    /// √m, also "more or less"
    Somewhat,
    /// min(√m, 1 − m²), scaled to reach one: near the term, but not its heart.
    Slightly,
    /// 1 − m
    Not,
}

impl Hedge {
    /// The membership after the hedge, for a membership from 0 to 1.
    pub fn apply(self, membership: f64) -> f64 {
        match self {
            Hedge::Plain => membership,
            Hedge::Very => membership * membership,
            Hedge::Extremely => membership * membership * membership,
            Hedge::Somewhat => sqrt(membership),
            Hedge::Slightly => fmin(sqrt(membership), 1.0 - membership * membership) / SLIGHTLY_PEAK,
            Hedge::Not => 1.0 - membership,
        }
    }
}

/// A term with its hedge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// The term.
    pub term: Term,
    /// What is done to it.
    pub hedge: Hedge,
}

impl Claim {
    /// The term as it is.
    pub const fn plain(term: Term) -> Claim {
        Claim { term, hedge: Hedge::Plain }
    }

    /// Degree, from 0 to 1, to which `x` is what is claimed.
    pub fn membership(self, x: f64) -> f64 {
        self.hedge.apply(self.term.membership(x))
    }
}

/// A fuzzy set on the grid: sample i stands at −1 + 0.02 i. Between samples it is a straight line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Set([f64; POINTS]);

/// Area and first moment of a part of a set.
#[derive(Clone, Copy, Debug, Default)]
struct Mass {
    area: f64,
    moment: f64,
}

impl Set {
    /// No value belongs to it.
    pub const EMPTY: Set = Set([0.0; POINTS]);

    /// Where sample `i` stands.
    pub fn position(i: usize) -> f64 {
        (i as f64 - 50.0) / 50.0
    }

    /// The samples.
    pub const fn samples(&self) -> &[f64; POINTS] {
        &self.0
    }

    /// Mamdani's rule: the claim clipped at `weight` (0 to 1), joined by the larger of the two.
    pub fn add(&mut self, claim: Claim, weight: f64) {
        for (i, sample) in self.0.iter_mut().enumerate() {
            *sample = fmax(*sample, fmin(weight, claim.membership(Set::position(i))));
        }
    }

    /// What of the set lies on one side of zero: 1 for above, −1 for below. The zero itself is on neither.
    pub fn side(&self, sign: f64) -> Set {
        let mut half = *self;
        for (i, sample) in half.0.iter_mut().enumerate() {
            if Set::position(i) * sign <= 0.0 {
                *sample = 0.0;
            }
        }
        half
    }

    /// Area under the set.
    pub fn area(&self) -> f64 {
        self.mass(0, POINTS - 1).area
    }

    /// The centroid ∫ z m dz / ∫ m dz, exact for the straight lines between the samples; `None` for an empty set.
    ///
    /// The plain sum Σ z m / Σ m counts the two end samples twice as much as the integral does, which shows for shouldered terms.
    pub fn centroid(&self) -> Option<f64> {
        self.mass(0, POINTS - 1).centre()
    }

    /// The centroid of the connected part with the largest area, the lower one of equals; `None` for an empty set.
    ///
    /// Where a set has two humps, the plain centroid lies between them, which may be the one place that nobody claimed.
    pub fn centroid_of_largest_area(&self) -> Option<f64> {
        let mut best = Mass::default();
        let mut from = 0;
        while from < POINTS {
            if self.0[from] <= 0.0 {
                from += 1;
                continue;
            }
            let mut to = from;
            while to + 1 < POINTS && self.0[to + 1] > 0.0 {
                to += 1;
            }
            // The slopes down to the neighbours at zero belong to the hump.
            let part = self.mass(from.saturating_sub(1), (to + 1).min(POINTS - 1));
            // Mirror images differ in the last digit; that is no reason to prefer one.
            if part.area > best.area + 1e-12 {
                best = part;
            }
            from = to + 1;
        }
        best.centre()
    }

    fn mass(&self, from: usize, to: usize) -> Mass {
        let mut sum = Mass::default();
        for i in from..to {
            let (a, b, x) = (self.0[i], self.0[i + 1], Set::position(i));
            let width = Set::position(i + 1) - x;
            let area = (a + b) / 2.0 * width;
            sum.area += area;
            sum.moment += x * area + (a + 2.0 * b) / 6.0 * width * width;
        }
        sum
    }
}

impl Mass {
    fn centre(self) -> Option<f64> {
        (self.area > 0.0).then(|| self.moment / self.area)
    }
}

/// The centroid of a set that holds `positive` above zero and the mirror image of `negative` below it; `None` if both are empty.
///
/// Both are cut at zero, so that a term never reaches over to the other side.
pub fn centroid_of_two_sides(positive: &Set, negative: &Set) -> Option<f64> {
    let (above, below) = (positive.side(1.0).mass(0, POINTS - 1), negative.side(1.0).mass(0, POINTS - 1));
    Mass { area: above.area + below.area, moment: above.moment - below.moment }.centre()
}

/// Mamdani's inference over weighted claims (weights 0 to 1): clip, join by the larger, centroid. `None` when nothing is claimed.
pub fn mamdani(claims: &[(Claim, f64)]) -> Option<f64> {
    let mut set = Set::EMPTY;
    for &(claim, weight) in claims {
        set.add(claim, weight);
    }
    set.centroid()
}

/// Sugeno's inference of order zero: the weighted mean of the centres, Σ w z / Σ w. `None` when no weight is positive.
///
/// A hundred times cheaper than Mamdani's. A hedge has no effect, since a singleton has no shape.
pub fn sugeno(claims: &[(Claim, f64)]) -> Option<f64> {
    let (mut sum, mut weights) = (0.0, 0.0);
    for &(claim, weight) in claims {
        sum += weight * claim.term.centre();
        weights += weight;
    }
    (weights > 0.0).then(|| sum / weights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use Term::*;

    fn claim(term: Term, hedge: Hedge) -> Claim {
        Claim { term, hedge }
    }

    #[test]
    fn sugeno_weighs_the_centres() {
        assert_eq!(sugeno(&[(Claim::plain(NegativeSmall), 1.0)]), Some(-0.33));
        let both = sugeno(&[(Claim::plain(NegativeSmall), 0.5), (Claim::plain(PositiveBig), 0.5)]).unwrap();
        assert!(fabs(both - 0.335) < 1e-15);
        assert_eq!(sugeno(&[]), None);
    }

    #[test]
    fn one_clipped_inner_term_gives_its_centre_at_every_weight() {
        for term in &Term::ALL[1..6] {
            for percent in 1..=100 {
                let z = mamdani(&[(Claim::plain(*term), percent as f64 / 100.0)]).unwrap();
                // 0.33 lies between two points of the grid, so the sampled triangle leans by less than a tenth of a step.
                assert!(fabs(z - term.centre()) < 2e-3, "{term:?} at {percent} %: {z}");
            }
        }
    }

    /// scikit-fuzzy 0.5.0: x = linspace(-1, 1, 101); m = fmax over the rules of fmin(weight, hedge(trimf)); defuzz(x, m, 'centroid').
    #[test]
    fn mamdani_agrees_with_scikit_fuzzy() {
        let cases: [(&[(Claim, f64)], f64); 6] = [
            (&[(Claim::plain(PositiveSmall), 1.0), (Claim::plain(PositiveBig), 0.5)], 0.477_801_536_919),
            (&[(Claim::plain(NegativeSmall), 1.0), (Claim::plain(PositiveBig), 0.5)], -0.002_038_088_874),
            (&[(claim(NegativeBig, Hedge::Very), 0.8)], -0.914_952_600_917),
            (
                &[(claim(PositiveBig, Hedge::Extremely), 1.0), (Claim::plain(PositiveMedium), 0.4)],
                0.719_600_285_193,
            ),
            (
                &[(claim(PositiveMedium, Hedge::Somewhat), 0.7), (Claim::plain(PositiveSmall), 0.3)],
                0.574_550_308_376,
            ),
            (&[(claim(Zero, Hedge::Not), 0.5), (Claim::plain(PositiveBig), 1.0)], 0.040_761_814_446),
        ];
        for (claims, want) in cases {
            let z = mamdani(claims).unwrap();
            assert!(fabs(z - want) < 1e-11, "{claims:?}: {z} for {want}");
        }
    }

    #[test]
    fn of_two_humps_the_larger_is_taken_and_never_the_middle() {
        let mut set = Set::EMPTY;
        set.add(Claim::plain(NegativeMedium), 1.0);
        set.add(Claim::plain(PositiveMedium), 0.5);
        let z = set.centroid_of_largest_area().unwrap();
        assert!(fabs(z + 0.66) < 2e-3, "{z}");
        assert!(set.centroid().unwrap() > -0.2);
        assert_eq!(Set::EMPTY.centroid_of_largest_area(), None);
    }

    #[test]
    fn slightly_reaches_one_and_is_empty_at_the_heart() {
        let peak = SLIGHTLY_PEAK * SLIGHTLY_PEAK;
        assert!(fabs(Hedge::Slightly.apply(peak) - 1.0) < 1e-12);
        assert_eq!(Hedge::Slightly.apply(1.0), 0.0);
    }

    proptest::proptest! {
        #[test]
        fn hedges_stay_in_range_and_in_order(m in 0f64..=1.0) {
            let h = |hedge: Hedge| hedge.apply(m);
            proptest::prop_assert!(h(Hedge::Extremely) <= h(Hedge::Very) && h(Hedge::Very) <= m && m <= h(Hedge::Somewhat));
            for hedge in [Hedge::Slightly, Hedge::Not, Hedge::Extremely, Hedge::Somewhat] {
                proptest::prop_assert!((-1e-12..=1.0 + 1e-12).contains(&h(hedge)));
            }
        }
    }
}

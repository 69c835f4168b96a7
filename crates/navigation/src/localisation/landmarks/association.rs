//! Which landmark was seen, when it does not say.
//!
//! In plain words: it is the one that fits best, if it fits at all, and if no other fits nearly as well. A sighting that could be of two is
//! better left out than taken for the wrong one, since what is wrong once makes the next ones wrong too.
//!
//! Each landmark is as likely as the density of its innovation y with covariance S: −2 ln p = yᵀ S⁻¹ y + ln |S| + const. (Bar-Shalom and
//! Fortmann, "Tracking and Data Association", 1988: nearest neighbour with a validation gate.)

use libm::log;
use types::Point;

use super::filter::{Filter, Parameters};
use super::sighting::{Sight, Sighting, surprise};

/// So much less likely the second must be (difference of −2 ln p). 6 is a ratio of 20 to one.
pub const MARGIN: f64 = 6.0;

/// Something whose place is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Landmark {
    /// Its place (m).
    pub at: Point,
    /// Covariance of its place (m²).
    pub spread: [[f64; 2]; 2],
}

impl Landmark {
    /// Known exactly.
    pub const fn exact(at: Point) -> Landmark {
        Landmark { at, spread: [[0.0; 2]; 2] }
    }

    /// A sighting of it.
    pub const fn seen(&self, sighting: Sighting) -> Sight {
        Sight::Of(sighting, self.at, self.spread)
    }
}

/// What a sighting is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Association {
    /// The landmark with this number.
    One(usize),
    /// This or that, the likelier first.
    Either(usize, usize),
    /// None that is known.
    None,
}

/// Which of the landmarks it is. One within the [gate](Parameters::gate) is chosen when the next best is less likely by [`MARGIN`].
pub fn associate(
    filter: &Filter,
    parameters: &Parameters,
    seen: Sighting,
    landmarks: &[Landmark],
) -> Association {
    let mut best: [Option<(usize, f64)>; 2] = [None; 2];
    for (number, landmark) in landmarks.iter().enumerate() {
        let Some((far, unlikely)) = misfit(filter, parameters, &landmark.seen(seen)) else { continue };
        if far > parameters.gate && best[0].is_none_or(|(_, least)| unlikely > least + MARGIN) {
            continue;
        }
        if best[0].is_none_or(|(_, least)| unlikely < least) {
            best = [Some((number, unlikely)), best[0]];
        } else if best[1].is_none_or(|(_, second)| unlikely < second) {
            best[1] = Some((number, unlikely));
        }
    }
    let [Some((first, least)), second] = best else { return Association::None };
    let fits = misfit(filter, parameters, &landmarks[first].seen(seen))
        .is_some_and(|(far, _)| far <= parameters.gate);
    match second {
        _ if !fits => Association::None,
        Some((second, unlikely)) if unlikely < least + MARGIN => Association::Either(first, second),
        _ => Association::One(first),
    }
}

/// Squared Mahalanobis distance, and −2 ln p without its constant.
fn misfit(filter: &Filter, parameters: &Parameters, sight: &Sight) -> Option<(f64, f64)> {
    let (expected, noise) = filter.expect(parameters, sight)?;
    let spread = filter.innovation_spread(&expected, noise);
    let far = surprise(&expected, spread)?;
    Some((far, far + log(spread.determinant())))
}

#[cfg(test)]
mod tests {
    use super::super::sighting::seen_from;
    use super::*;
    use types::Pose;

    const PLACES: [Point; 3] = [Point::new(3.0, 0.0), Point::new(3.0, 0.4), Point::new(0.0, 4.0)];

    fn which(pose: Pose, deviation: f64, of: Point) -> Association {
        let parameters = Parameters::default();
        let v = deviation * deviation;
        let filter = Filter::new(&parameters, pose, [[v, 0.0, 0.0], [0.0, v, 0.0], [0.0, 0.0, v]]);
        associate(&filter, &parameters, seen_from(pose, of), &PLACES.map(Landmark::exact))
    }

    #[test]
    fn one_that_fits_alone_is_told_and_two_that_could_be_are_not() {
        let pose = Pose::new(0.0, 0.0, 0.2);
        assert_eq!(
            which(pose, 0.01, PLACES[1]),
            Association::One(1),
            "the other is 8 standard deviations off"
        );
        assert_eq!(which(pose, 0.2, PLACES[1]), Association::Either(1, 0));
        assert_eq!(which(pose, 0.2, PLACES[2]), Association::One(2));
        assert_eq!(which(pose, 0.01, Point::new(-2.0, -2.0)), Association::None);
    }
}

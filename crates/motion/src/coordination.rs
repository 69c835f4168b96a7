//! Whose wish is driven: four ways to make one command of the offers of many.
//!
//! | method | who drives |
//! |---|---|
//! | [`Coordination::Priority`] | competitive: of those that hold, the offer of the highest priority, whole |
//! | [`Coordination::Subsumption`] | competitive: on each axis the highest that speaks of it; it suppresses those below for as long as it holds |
//! | [`Coordination::VectorSum`] | cooperative: (v, ω) = Σ wᵢ (vᵢ, ωᵢ) / max(1, Σ wᵢ) |
//! | [`Coordination::Fuzzy`] | cooperative: [`fuse`], where left and right are never averaged |
//!
//! Among equal priorities the greater weight is above, then the earlier in the row. Whatever the method: what has expired, makes no sense or
//! has no weight does not count; "stop" with any weight overrides all; what safety allows bounds every offer before it is weighed; and
//! without any offer the last command is held for a while, then the robot stops.
//!
//! Sources: Brooks, A robust layered control system for a mobile robot, 1986 (suppression with a time constant, which here is how long an
//! offer holds); Arkin, Behavior-Based Robotics, 1998, chapter 4 (arbitration and superposition).

use types::messages::{Coordination, Drive, Offer, Twist};

use crate::fusion::{Axes, Cause, Fate, Fused, Held, Moment, Parameters, axes, fuse, hold, refuse};

/// Makes one command of `offers`, each with the weight that somebody gives it; `priorities` has one number for each, the greater above.
///
/// What has no priority is below all. The shares of the result explain the first [`SHARES_MAX`](crate::fusion::SHARES_MAX) offers.
pub fn coordinate(
    method: Coordination,
    parameters: &Parameters,
    offers: &[(Offer, f64)],
    priorities: &[u32],
    moment: &Moment,
    held: &mut Held,
) -> Fused {
    let heard = |i: usize| axes(parameters, &offers[i], moment).ok();
    let somebody_says_stop = || (0..offers.len()).any(|i| heard(i).is_some_and(|axes| axes.stop));
    if method == Coordination::Fuzzy || somebody_says_stop() {
        return fuse(parameters, offers, moment, held);
    }
    let above = |speaks: fn(&Axes) -> bool| {
        let rank = |i: usize| priorities.get(i).copied().unwrap_or(0);
        let weight = |i: usize| offers[i].0.weight * offers[i].1;
        let those = (0..offers.len()).filter(|&i| heard(i).as_ref().is_some_and(speaks));
        // The earlier stands above the later of the same rank and weight: it is only displaced by what is above it.
        those.reduce(|best, i| {
            let is_above = rank(i) > rank(best) || rank(i) == rank(best) && weight(i) > weight(best);
            if is_above { i } else { best }
        })
    };
    let alone = |i: usize| alone(parameters, &offers[i], moment);
    let (twist, vetoed, along, around) = match method {
        Coordination::VectorSum => return sum(parameters, offers, moment, held),
        Coordination::Priority => {
            let Some(best) = above(|_| true) else { return silence(parameters, offers, moment, held) };
            let fused = alone(best);
            (fused.twist, fused.vetoed, Some(best), Some(best))
        }
        _ => {
            let (along, around) = (above(|axes| axes.along), above(|axes| axes.around));
            let Some(some) = along.or(around) else { return silence(parameters, offers, moment, held) };
            // What nobody speaks of is as it is where the one speaks alone.
            let (first, second) = (alone(along.unwrap_or(some)), alone(around.unwrap_or(some)));
            let twist = Twist::new(first.twist.linear, second.twist.angular);
            (twist, first.vetoed || second.vetoed, along, around)
        }
    };
    let mut out = explained(parameters, offers, moment);
    for (i, share) in out.shares_mut().iter_mut().enumerate().filter(|(_, share)| share.fate == Fate::Fused) {
        share.linear = f64::from(u8::from(along == Some(i)));
        share.angular = f64::from(u8::from(around == Some(i)));
        if share.linear + share.angular == 0.0 {
            share.fate = Fate::Outvoted;
        }
    }
    (out.twist, out.cause, out.vetoed) = (twist, Cause::Offers, vetoed);
    hold(held, twist, moment);
    out
}

/// The command if nobody else were there. Of numbers it is these, to the last bit; of words their weight is a part.
fn alone(parameters: &Parameters, row: &(Offer, f64), moment: &Moment) -> Fused {
    let (offer, weight) = *row;
    let row = match offer.form {
        Drive::Numeric => (Offer { weight: 1.0, ..offer }, 1.0),
        Drive::Linguistic => (offer, weight),
    };
    fuse(parameters, &[row], moment, &mut Held::default())
}

/// The sum of all wishes as vectors, bounded by the greatest of them: weights above one in sum make a mean.
fn sum(parameters: &Parameters, offers: &[(Offer, f64)], moment: &Moment, held: &mut Held) -> Fused {
    let mut out = explained(parameters, offers, moment);
    let (mut twist, mut weights) = (Twist::ZERO, 0.0);
    for row in offers {
        let Ok(Axes { weight, .. }) = axes(parameters, row, moment) else { continue };
        let alone = alone(parameters, row, moment);
        twist.linear += weight * alone.twist.linear;
        twist.angular += weight * alone.twist.angular;
        weights += weight;
        out.vetoed |= alone.vetoed;
    }
    if weights == 0.0 {
        return silence(parameters, offers, moment, held);
    }
    let scale = libm::fmax(weights, 1.0);
    out.twist = Twist::new(twist.linear / scale, twist.angular / scale);
    out.cause = Cause::Offers;
    for (share, row) in out.shares_mut().iter_mut().zip(offers).filter(|(share, _)| share.fate == Fate::Fused)
    {
        let part = row.0.weight * row.1 / weights;
        (share.linear, share.angular) = (part, part);
    }
    hold(held, out.twist, moment);
    out
}

/// Nobody counts: what [`fuse`] makes of that.
fn silence(parameters: &Parameters, offers: &[(Offer, f64)], moment: &Moment, held: &mut Held) -> Fused {
    fuse(parameters, offers, moment, held)
}

/// A result without a command, in which it stands of each offer whether it counts.
fn explained(parameters: &Parameters, offers: &[(Offer, f64)], moment: &Moment) -> Fused {
    let mut out = Fused::of(offers.len());
    for (i, row) in offers.iter().enumerate() {
        if let Err(fate) = axes(parameters, row, moment) {
            refuse(&mut out, i, fate);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fusion::{SHARES_MAX, Veto};
    use crate::word;
    use proptest::prelude::*;
    use std::vec::Vec;
    use types::{Duration, Time};

    const NOW: Moment = Moment { now: Time(1_000_000_000), present: Twist::ZERO, veto: Veto::NONE };

    fn numbers(linear: f64, angular: f64, weight: f64) -> (Offer, f64) {
        let twist = Twist::new(linear, angular);
        (
            Offer { twist, weight: 1.0, valid_until: NOW.now + Duration::millis(100), ..Offer::default() },
            weight,
        )
    }

    fn words(text: &str) -> (Offer, f64) {
        let (offer, weight) = numbers(0.0, 0.0, 1.0);
        (Offer { word: word::parse(text).unwrap(), form: Drive::Linguistic, ..offer }, weight)
    }

    fn made(method: Coordination, offers: &[(Offer, f64)], priorities: &[u32], moment: &Moment) -> Fused {
        coordinate(method, &Parameters::default(), offers, priorities, moment, &mut Held::default())
    }

    #[test]
    fn the_highest_priority_drives_alone_and_the_next_when_it_has_expired() {
        let mut offers = [numbers(0.5, 0.0, 1.0), numbers(0.1, -0.8, 0.2), numbers(0.3, 0.9, 1.0)];
        let priorities = [1, 3, 2];
        let first = made(Coordination::Priority, &offers, &priorities, &NOW);
        assert_eq!((first.twist, first.cause), (Twist::new(0.1, -0.8), Cause::Offers));
        let fates: Vec<Fate> = first.shares().iter().map(|share| share.fate).collect();
        assert_eq!(fates, [Fate::Outvoted, Fate::Fused, Fate::Outvoted]);
        offers[1].0.valid_until = Time(999_999_999);
        let second = made(Coordination::Priority, &offers, &priorities, &NOW);
        assert_eq!((second.twist, second.expired), (Twist::new(0.3, 0.9), 1));
    }

    #[test]
    fn a_layer_suppresses_only_the_axis_that_it_speaks_of() {
        // Below somebody drives on, above somebody only says where to turn.
        let offers = [numbers(0.5, 0.3, 1.0), words("turn right")];
        let both = made(Coordination::Subsumption, &offers, &[1, 2], &NOW);
        assert_eq!(both.twist.linear, 0.5);
        assert!(both.twist.angular < -0.2, "{:?}", both.twist);
        let whole = made(Coordination::Priority, &offers, &[1, 2], &NOW);
        assert_eq!(
            whole.twist.linear, 0.0,
            "the whole command is that of the one above: it turns on the spot"
        );
        let below = made(Coordination::Subsumption, &offers, &[2, 1], &NOW);
        assert_eq!(below.twist, Twist::new(0.5, 0.3), "numbers speak of both");
    }

    #[test]
    fn vectors_add_up_to_a_mean_and_never_to_more_than_the_greatest() {
        let sum = |offers: &[(Offer, f64)]| made(Coordination::VectorSum, offers, &[], &NOW).twist;
        assert_eq!(sum(&[numbers(0.4, 0.0, 0.5)]), Twist::new(0.2, 0.0), "half a weight is half a wish");
        let close = |a: Twist, b: Twist| (a.linear - b.linear).abs() + (a.angular - b.angular).abs() < 1e-12;
        // (0.75 · 0.4 + 0.75 · 0.2) / 1.5 and (0.75 · 0.6 − 0.75 · 0.2) / 1.5
        assert!(close(sum(&[numbers(0.4, 0.6, 0.75), numbers(0.2, -0.2, 0.75)]), Twist::new(0.3, 0.2)));
        // Left and right cancel out: where that is not wanted, fuzzy is the method.
        assert!(close(sum(&[numbers(0.4, 0.6, 1.0), numbers(0.4, -0.6, 1.0)]), Twist::new(0.4, 0.0)));
        let fuzzy = made(Coordination::Fuzzy, &[numbers(0.4, 0.6, 1.0), numbers(0.4, -0.6, 0.9)], &[], &NOW);
        assert!(fuzzy.twist.angular > 0.5, "{:?}", fuzzy.twist);
    }

    #[test]
    fn stop_overrides_whoever_stands_above_and_silence_is_held_then_a_stop() {
        for method in Coordination::ALL {
            let offers = [numbers(0.5, 0.2, 1.0), words("stop")];
            let stopped = made(method, &offers, &[9, 1], &NOW);
            assert_eq!((stopped.twist, stopped.cause), (Twist::ZERO, Cause::Stop), "{}", method.word());
            let mut held = Held::default();
            let parameters = Parameters::default();
            let moving =
                coordinate(method, &parameters, &[numbers(0.5, 0.2, 1.0)], &[1], &NOW, &mut held).twist;
            assert_eq!(moving, Twist::new(0.5, 0.2), "{}", method.word());
            for (after, expected) in [(300, (moving, Cause::Held)), (301, (Twist::ZERO, Cause::Silence))] {
                let later = Moment { now: NOW.now + Duration::millis(after), ..NOW };
                let fused = coordinate(method, &parameters, &[], &[], &later, &mut held);
                assert_eq!((fused.twist, fused.cause), expected, "{}", method.word());
            }
        }
    }

    proptest! {
        #[test]
        fn no_method_passes_what_safety_forbids_or_what_makes_no_sense(
            method in 0usize..4,
            rows in proptest::collection::vec((-1.0..1.0f64, -1.0..1.0f64, 0.0..1.5f64, 0u32..4, 0u8..8), 0..SHARES_MAX + 3),
            linear_max in 0.0..0.5f64,
            forward: bool,
        ) {
            let spoiled = |kind: u8, mut row: (Offer, f64)| {
                match kind {
                    0 => row.0.twist.linear = f64::NAN,
                    1 => row.0.valid_until = Time(0),
                    2 => row.1 = -1.0,
                    3 => row.0.weight = f64::INFINITY,
                    _ => {}
                }
                row
            };
            let offers: Vec<_> = rows.iter().map(|r| spoiled(r.4, numbers(r.0, r.1, r.2))).collect();
            let priorities: Vec<u32> = rows.iter().map(|r| r.3).collect();
            let veto = Veto { forward, linear_max, wider: 0.0 };
            let fused = made(Coordination::ALL[method], &offers, &priorities, &Moment { veto, ..NOW });
            let allowed = if forward { linear_max } else { 0.0 };
            prop_assert!(fused.twist.linear <= allowed + 1e-12, "{:?}", fused.twist);
            let good: Vec<_> = rows.iter().filter(|r| r.4 > 3 && r.2 > 0.0).collect();
            prop_assert!(fused.twist.linear.is_finite() && fused.twist.angular.is_finite());
            let most = good.iter().map(|r| r.1.abs()).fold(0.0, f64::max);
            prop_assert!(fused.twist.angular.abs() <= most + 1e-12, "{:?}", fused.twist);
            prop_assert_eq!(fused.cause == Cause::Offers, !good.is_empty());
            prop_assert_eq!(fused.shares().len(), rows.len().min(SHARES_MAX));
            for (share, row) in fused.shares().iter().zip(&rows) {
                prop_assert!(matches!(share.fate, Fate::Fused | Fate::Outvoted) == (row.4 > 3 && row.2 > 0.0));
            }
        }
    }
}

//! One command out of many offers, in numbers and in words.
//!
//! ```text
//!  offers ──▶ fit to drive? ──▶ safety veto ──▶ stop? ──▶ left or right ──▶ means ──▶ command
//!             expired, refused  "turn, not      wins       larger area      in numbers
//!             or without weight  forward"       alone      wins             and in words
//! ```
//!
//! The weight of an offer times that of the decision maker is what counts. Offers in words go through the terms of
//! [`crate::fuzzy`]: a word about the speed relative to the present one, the others on a scale of the highest speed or turn rate.
//! A wish to turn left and one to turn right are never averaged, since the mean may lead straight into what both avoid.

use crate::fuzzy::Claim;
use crate::kinematics::{Twist, is_finite};
use crate::word;
use libm::{fabs, fmax, fmin};
use types::Time;
use types::messages::{Direction, Drive, Offer, Verb, Word};
use types::time::Duration;

mod sums;
use sums::Sums;

/// How many offers the result explains one by one; the rest count all the same.
pub const SHARES_MAX: usize = 16;

/// What the two axes of a command move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Actuator {
    /// Linear is the speed of the body, angular its turn rate.
    #[default]
    Base,
    /// Linear is the tilt rate of a head (rad/s, up positive), angular its pan rate. It knows "turn" and "stop".
    Head,
}

/// How words become numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Inference {
    /// Clip, join, centroid on 101 points: a hedge has its effect.
    #[default]
    Mamdani,
    /// Weighted mean of the terms' centres: for the hardest real time.
    Sugeno,
}

/// How to fuse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// What is commanded.
    pub actuator: Actuator,
    /// How words become numbers.
    pub inference: Inference,
    /// What "much" means along: speed (m/s) of a base, tilt rate (rad/s) of a head.
    pub linear_max: f64,
    /// What "much" means in turning (rad/s).
    pub angular_max: f64,
    /// Change of speed for the greatest "speed up" (m/s).
    pub speed_change: f64,
    /// Turn rates below this count as straight and take no side (rad/s).
    pub straight: f64,
    /// How long the last command is held when nobody offers one.
    pub hold: Duration,
}

impl Default for Parameters {
    /// An indoor base: 0.6 m/s and 1 rad/s as in [`crate::limits::Limits::indoor`]. The greatest change is half of the highest speed,
    /// so no one word takes it from rest to full. Straight is below a twentieth of the turn rate: the noise of a controller should not
    /// vote. 0.3 s of holding bridges one missed reading of a 4 Hz sensor and rolls on for 18 cm at most.
    fn default() -> Parameters {
        Parameters {
            actuator: Actuator::Base,
            inference: Inference::Mamdani,
            linear_max: 0.6,
            angular_max: 1.0,
            speed_change: 0.3,
            straight: 0.05,
            hold: Duration::millis(300),
        }
    }
}

/// What safety allows; applied to every offer before they are fused, and to a held command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Veto {
    /// Whether moving forward is allowed; turning and backing always are.
    pub forward: bool,
    /// Highest forward speed (m/s).
    pub linear_max: f64,
    /// The side with more room: positive for left, 0 for either. It decides between left and right when forward is forbidden, and
    /// between equals.
    pub wider: f64,
}

impl Veto {
    /// Nothing is forbidden.
    pub const NONE: Veto = Veto { forward: true, linear_max: f64::INFINITY, wider: 0.0 };

    fn apply(&self, linear: f64) -> f64 {
        let most = if self.forward { fmax(self.linear_max, 0.0) } else { 0.0 };
        // A bound that is not a number must not let anything through.
        if self.linear_max.is_nan() { fmin(linear, 0.0) } else { fmin(linear, most) }
    }
}

/// What became of an offer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Fate {
    /// It has a part in the command.
    #[default]
    Fused,
    /// It was too old.
    Expired,
    /// Not finite, without sense, or nothing for this actuator.
    Refused,
    /// Its weight is zero.
    Silent,
    /// The other side won.
    Outvoted,
    /// Somebody said stop.
    Overridden,
}

/// The part that an offer has in the command.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Share {
    /// Its place in the slice of offers.
    pub offer: usize,
    /// What became of it.
    pub fate: Fate,
    /// Its part of the weight that made the speed, from 0 to 1.
    pub linear: f64,
    /// Its part of the weight that made the turn rate, from 0 to 1.
    pub angular: f64,
}

/// Where the command comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Cause {
    /// From the offers.
    Offers,
    /// Somebody said stop.
    Stop,
    /// Nobody offered anything; the last command is held.
    Held,
    /// Nobody offered anything for too long.
    #[default]
    Silence,
}

/// The command and its explanation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fused {
    /// What is to be driven.
    pub twist: Twist,
    /// Where it comes from.
    pub cause: Cause,
    /// How many offers had expired.
    pub expired: usize,
    /// How many were refused.
    pub refused: usize,
    /// Whether the veto took something away.
    pub vetoed: bool,
    shares: [Share; SHARES_MAX],
    listed: usize,
}

impl Fused {
    /// The share of each offer, of the first [`SHARES_MAX`].
    pub fn shares(&self) -> &[Share] {
        &self.shares[..self.listed]
    }

    /// Of so many offers, of which nothing is said yet.
    pub(crate) fn of(offers: usize) -> Fused {
        let mut out = Fused { listed: offers.min(SHARES_MAX), ..Fused::default() };
        (0..out.listed).for_each(|i| out.shares[i].offer = i);
        out
    }

    pub(crate) fn shares_mut(&mut self) -> &mut [Share] {
        &mut self.shares[..self.listed]
    }
}

/// The last command, for holding it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Held {
    last: Option<(Twist, Time)>,
}

/// What the command is given for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Now.
    pub now: Time,
    /// How the actuator moves at present.
    pub present: Twist,
    /// What safety says.
    pub veto: Veto,
}

/// Fuses offers, each with the weight that the decision maker gives it.
///
/// - An expired offer is dropped and counted. One that is not finite, makes no sense or has a weight that is negative or no number is
///   refused and counted. One without weight is silent.
/// - "Stop" with any weight overrides all.
/// - If some turn left and some right, the side with the larger sum of areas w (2 − w) wins, that of a term clipped at w. While forward
///   is forbidden the wider side wins. Equals go to the wider side, then to the side to which it turns already, then left. An offer in
///   numbers that loses is dropped whole, as its speed was meant for its turn.
/// - Numbers are averaged by weight. Words on one axis are inferred together and join with the largest of their weights.
/// - Where nobody speaks of the speed, the present one stays. Where nobody speaks of turning, it goes straight if somebody said "go", and
///   turns on if only the speed was spoken of.
/// - Without any offer the last command is held for a while, then it stops.
pub fn fuse(parameters: &Parameters, offers: &[(Offer, f64)], moment: &Moment, held: &mut Held) -> Fused {
    let mut out = Fused { listed: offers.len().min(SHARES_MAX), ..Fused::default() };
    let round = Round { parameters, offers, moment };
    let tally = round.tally(&mut out);
    if tally.stop {
        for share in out.shares[..out.listed].iter_mut().filter(|share| share.fate == Fate::Fused) {
            let said_stop = matches!(round.wish(&offers[share.offer].0), Some(Wish::Stop));
            share.fate = if said_stop { Fate::Fused } else { Fate::Overridden };
        }
        out.cause = Cause::Stop;
        held.last = Some((Twist::ZERO, moment.now));
    } else if tally.live {
        out.twist = round.mean(round.winner(&tally), &mut out);
        out.cause = Cause::Offers;
        held.last = Some((out.twist, moment.now));
    } else if let Some((twist, since)) =
        held.last.filter(|(_, since)| moment.now - *since <= parameters.hold && moment.now >= *since)
    {
        let linear = round.permitted(twist.linear, &mut out.vetoed);
        out.twist = Twist { linear, ..twist };
        out.cause = Cause::Held;
        held.last = Some((out.twist, since));
    }
    out
}

/// Of what an offer that counts speaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axes {
    /// Of the speed.
    pub(crate) along: bool,
    /// Of turning.
    pub(crate) around: bool,
    /// It says stop.
    pub(crate) stop: bool,
    /// Its weight times that which it was given.
    pub(crate) weight: f64,
}

/// Of what an offer speaks, or why it does not count.
pub(crate) fn axes(parameters: &Parameters, row: &(Offer, f64), moment: &Moment) -> Result<Axes, Fate> {
    let round = Round { parameters, offers: &[], moment };
    let (wish, weight) = round.live(row)?;
    let (along, around) = (wish.along() > 0.0, wish.around() > 0.0);
    Ok(Axes { along, around, stop: wish == Wish::Stop, weight })
}

/// Notes and counts that an offer does not count.
pub(crate) fn refuse(out: &mut Fused, offer: usize, fate: Fate) {
    out.expired += usize::from(fate == Fate::Expired);
    out.refused += usize::from(fate == Fate::Refused);
    if let Some(share) = out.shares_mut().get_mut(offer) {
        share.fate = fate;
    }
}

/// Keeps a command as the last one.
pub(crate) fn hold(held: &mut Held, twist: Twist, moment: &Moment) {
    held.last = Some((twist, moment.now));
}

/// What an offer wishes, on the axes it speaks of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Wish {
    Stop,
    Numbers(Twist),
    /// A claim on the axis, with its sign.
    Linear(Claim, f64),
    Angular(Claim, f64),
    Speed(Claim, f64),
}

impl Wish {
    /// 1 if it speaks of the speed.
    fn along(&self) -> f64 {
        if matches!(self, Wish::Numbers(_) | Wish::Linear(..) | Wish::Speed(..)) { 1.0 } else { 0.0 }
    }

    /// 1 if it speaks of turning.
    fn around(&self) -> f64 {
        if matches!(self, Wish::Numbers(_) | Wish::Angular(..)) { 1.0 } else { 0.0 }
    }
}

#[derive(Default)]
struct Tally {
    stop: bool,
    live: bool,
    left: f64,
    right: f64,
}

/// One call of [`fuse`].
struct Round<'a> {
    parameters: &'a Parameters,
    offers: &'a [(Offer, f64)],
    moment: &'a Moment,
}

impl Round<'_> {
    fn wish(&self, offer: &Offer) -> Option<Wish> {
        match offer.form {
            Drive::Numeric => is_finite(offer.twist).then_some(Wish::Numbers(offer.twist)),
            Drive::Linguistic => self.word(&offer.word),
        }
    }

    fn word(&self, word: &Word) -> Option<Wish> {
        use Direction as D;
        if !word::makes_sense(word) {
            return None;
        }
        let claim = word::claim(word.amount);
        match (word.verb, word.direction, self.parameters.actuator) {
            (Verb::Stop, _, _) => Some(Wish::Stop),
            (Verb::Turn, D::Left, _) => Some(Wish::Angular(claim, 1.0)),
            (Verb::Turn, D::Right, _) => Some(Wish::Angular(claim, -1.0)),
            (Verb::Turn, D::Up, Actuator::Head) => Some(Wish::Linear(claim, 1.0)),
            (Verb::Turn, D::Down, Actuator::Head) => Some(Wish::Linear(claim, -1.0)),
            (Verb::Go, D::Forward, Actuator::Base) => Some(Wish::Linear(claim, 1.0)),
            (Verb::Go, D::Back, Actuator::Base) => Some(Wish::Linear(claim, -1.0)),
            (Verb::Speed, D::Up, Actuator::Base) => Some(Wish::Speed(claim, 1.0)),
            (Verb::Speed, D::Down, Actuator::Base) => Some(Wish::Speed(claim, -1.0)),
            _ => None,
        }
    }

    /// What the offer can still do: its wish and its weight, or why it has none.
    fn live(&self, (offer, decision): &(Offer, f64)) -> Result<(Wish, f64), Fate> {
        if offer.valid_until < self.moment.now {
            return Err(Fate::Expired);
        }
        let weight = offer.weight * decision;
        let wish = self.wish(offer).filter(|_| weight >= 0.0 && weight.is_finite()).ok_or(Fate::Refused)?;
        if weight == 0.0 { Err(Fate::Silent) } else { Ok((wish, weight)) }
    }

    fn tally(&self, out: &mut Fused) -> Tally {
        let mut tally = Tally::default();
        for (i, offer) in self.offers.iter().enumerate() {
            let live = self.live(offer);
            if i < out.listed {
                out.shares[i] = Share { offer: i, fate: live.err().unwrap_or_default(), ..Share::default() };
            }
            match live {
                Err(Fate::Expired) => out.expired += 1,
                Err(Fate::Refused) => out.refused += 1,
                Err(_) => {}
                Ok((Wish::Stop, _)) => tally.stop = true,
                Ok((wish, weight)) => {
                    tally.live = true;
                    let w = fmin(weight, 1.0);
                    let area = w * (2.0 - w);
                    let side = self.side(&wish);
                    tally.left += if side > 0.0 { area } else { 0.0 };
                    tally.right += if side < 0.0 { area } else { 0.0 };
                }
            }
        }
        tally
    }

    /// 1 for a wish to turn left, −1 for right, 0 for neither.
    fn side(&self, wish: &Wish) -> f64 {
        match wish {
            Wish::Numbers(twist) if fabs(twist.angular) > self.parameters.straight => sign(twist.angular),
            Wish::Angular(_, side) => *side,
            _ => 0.0,
        }
    }

    /// The side that may turn, 0 if there is no contest.
    fn winner(&self, tally: &Tally) -> f64 {
        let veto = &self.moment.veto;
        if tally.left == 0.0 || tally.right == 0.0 {
            0.0
        } else if !veto.forward && veto.wider != 0.0 {
            sign(veto.wider)
        } else if fabs(tally.left - tally.right) > 1e-9 {
            sign(tally.left - tally.right)
        } else if veto.wider != 0.0 {
            sign(veto.wider)
        } else {
            sign(self.moment.present.angular)
        }
    }

    fn permitted(&self, linear: f64, vetoed: &mut bool) -> f64 {
        let allowed =
            if self.parameters.actuator == Actuator::Head { linear } else { self.moment.veto.apply(linear) };
        *vetoed |= allowed != linear;
        allowed
    }

    fn mean(&self, winner: f64, out: &mut Fused) -> Twist {
        let mut sums = Sums::default();
        for (i, offer) in self.offers.iter().enumerate() {
            let Ok((wish, weight)) = self.live(offer) else { continue };
            let outvoted = self.side(&wish) * winner < 0.0;
            if !outvoted {
                self.add(&mut sums, wish, weight, &mut out.vetoed);
            }
            if i < out.listed {
                let (along, around) =
                    if outvoted { (0.0, 0.0) } else { (wish.along() * weight, wish.around() * weight) };
                let fate = if outvoted { Fate::Outvoted } else { Fate::Fused };
                out.shares[i] = Share { offer: i, fate, linear: along, angular: around };
            }
        }
        normalise(&mut out.shares[..out.listed]);
        self.infer(&mut sums, &mut out.vetoed)
    }

    fn add(&self, sums: &mut Sums, wish: Wish, weight: f64, vetoed: &mut bool) {
        match wish {
            Wish::Numbers(twist) => {
                sums.linear.add(self.permitted(twist.linear, vetoed), weight);
                sums.angular.add(twist.angular, weight);
            }
            Wish::Linear(claim, sign) => sums.along.add(claim, sign, weight),
            Wish::Speed(claim, sign) => sums.speed.add(claim, sign, weight),
            Wish::Angular(claim, sign) => sums.turn.add(claim, sign, weight),
            Wish::Stop => {}
        }
    }

    /// Turns the words into numbers, joins them with the others, and fills in what nobody spoke of.
    fn infer(&self, sums: &mut Sums, vetoed: &mut bool) -> Twist {
        let Parameters { inference, linear_max, angular_max, actuator, .. } = *self.parameters;
        if let Some(value) = sums.along.value(inference) {
            sums.linear.add(self.permitted(value * linear_max, vetoed), sums.along.weight);
        }
        if let Some(value) = sums.speed.value(inference) {
            sums.linear.add(self.permitted(self.changed(value), vetoed), sums.speed.weight);
        }
        if let Some(value) = sums.turn.value(inference) {
            sums.angular.add(value * angular_max, sums.turn.weight);
        }
        let present = if is_finite(self.moment.present) { self.moment.present } else { Twist::ZERO };
        // A head that is told to pan has no reason to go on tilting.
        let unsaid_linear = if actuator == Actuator::Base { present.linear } else { 0.0 };
        let only_speed = sums.speed.weight > 0.0 && sums.along.weight == 0.0;
        let unsaid_angular = if only_speed { present.angular } else { 0.0 };
        Twist {
            linear: self.permitted(sums.linear.value().unwrap_or(unsaid_linear), vetoed),
            angular: sums.angular.value().unwrap_or(unsaid_angular),
        }
    }

    /// The present speed, made larger or smaller by `change` from −1 to 1; slowing down ends at rest and never reverses.
    fn changed(&self, change: f64) -> f64 {
        let present = if self.moment.present.linear.is_finite() { self.moment.present.linear } else { 0.0 };
        let size = fmax(fabs(present) + change * self.parameters.speed_change, 0.0);
        sign(present) * size
    }
}

fn sign(value: f64) -> f64 {
    if value < 0.0 { -1.0 } else { 1.0 }
}

fn normalise(shares: &mut [Share]) {
    let (mut linear, mut angular) = (0.0, 0.0);
    for share in shares.iter() {
        linear += share.linear;
        angular += share.angular;
    }
    for share in shares {
        share.linear /= if linear > 0.0 { linear } else { 1.0 };
        share.angular /= if angular > 0.0 { angular } else { 1.0 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NOW: Time = Time(1_000_000_000);

    fn numbers(linear: f64, angular: f64, weight: f64) -> (Offer, f64) {
        let twist = Twist { linear, angular };
        (Offer { twist, weight, valid_until: NOW, form: Drive::Numeric, ..Offer::default() }, 1.0)
    }

    fn words(text: &str, weight: f64) -> (Offer, f64) {
        let word = word::parse(text).unwrap();
        (Offer { word, weight, valid_until: NOW, form: Drive::Linguistic, ..Offer::default() }, 1.0)
    }

    fn moment(present: Twist) -> Moment {
        Moment { now: NOW, present, veto: Veto::NONE }
    }

    fn fused(offers: &[(Offer, f64)], moment: &Moment) -> Fused {
        fuse(&Parameters::default(), offers, moment, &mut Held::default())
    }

    fn assert_close(twist: Twist, linear: f64, angular: f64) {
        assert!(
            fabs(twist.linear - linear) < 2e-3 && fabs(twist.angular - angular) < 2e-3,
            "{twist:?} for {linear} {angular}"
        );
    }

    #[test]
    fn words_become_terms() {
        let standing = moment(Twist::ZERO);
        assert_close(fused(&[words("turn right a little bit", 1.0)], &standing).twist, 0.0, -0.33);
        assert_close(fused(&[words("go forward", 0.4)], &standing).twist, 0.66 * 0.6, 0.0);
        let rolling = moment(Twist { linear: 0.2, angular: 0.3 });
        assert_close(fused(&[words("increase speed", 1.0)], &rolling).twist, 0.2 + 0.66 * 0.3, 0.3);
        assert_close(fused(&[words("slow down very much", 1.0)], &rolling).twist, 0.0, 0.3);
        assert_close(fused(&[words("turn left", 1.0)], &rolling).twist, 0.2, 0.66);
    }

    #[test]
    fn numbers_of_one_side_are_averaged_by_weight_and_decision() {
        let mut second = numbers(0.4, 0.8, 1.0);
        second.1 = 0.5;
        let out = fused(&[numbers(0.1, 0.2, 0.5), second, numbers(0.1, 0.2, 1.0)], &moment(Twist::ZERO));
        assert_close(out.twist, (0.05 + 0.2 + 0.1) / 2.0, (0.1 + 0.4 + 0.2) / 2.0);
        assert!(fabs(out.shares()[1].angular - 0.25) < 1e-12);
    }

    #[test]
    fn left_and_right_give_the_larger_side_and_never_the_mean() {
        let out = fused(&[numbers(0.3, 0.8, 0.6), numbers(0.5, -0.8, 0.5)], &moment(Twist::ZERO));
        assert_eq!((out.twist, out.shares()[1].fate), (Twist { linear: 0.3, angular: 0.8 }, Fate::Outvoted));
        // The areas of two at 0.5 are 0.75 each, that of one at 1 is 1.
        let out = fused(
            &[words("turn right", 1.0), words("turn left", 0.5), numbers(0.0, 0.66, 0.5)],
            &moment(Twist::ZERO),
        );
        assert_close(out.twist, 0.0, 0.66);
    }

    #[test]
    fn stop_overrides_whatever_its_weight() {
        let out = fused(
            &[words("turn right a little bit", 1.0), words("stop", 0.01)],
            &moment(Twist { linear: 0.5, angular: 0.0 }),
        );
        assert_eq!((out.twist, out.cause), (Twist::ZERO, Cause::Stop));
        assert_eq!((out.shares()[0].fate, out.shares()[1].fate), (Fate::Overridden, Fate::Fused));
    }

    #[test]
    fn the_veto_comes_before_the_mean() {
        let veto = Veto { forward: true, linear_max: 0.1, wider: 0.0 };
        let offers = [numbers(0.5, 0.0, 1.0), numbers(-0.1, 0.0, 1.0)];
        let out = fused(&offers, &Moment { veto, ..moment(Twist::ZERO) });
        // After it, 0.2 m/s would have been cut to 0.1; before it, (0.1 − 0.1)/2 is rest.
        assert_eq!((out.twist.linear, out.vetoed), (0.0, true));
        let blocked = Veto { forward: false, linear_max: 1.0, wider: -0.4 };
        let offers = [numbers(0.5, 0.6, 1.0), numbers(0.5, -0.4, 0.1)];
        let out = fused(&offers, &Moment { veto: blocked, ..moment(Twist::ZERO) });
        assert_close(out.twist, 0.0, -0.4);
    }

    #[test]
    fn silence_holds_and_then_stops() {
        let mut held = Held::default();
        let parameters = Parameters::default();
        let at = |millis: i64| Moment { now: NOW + Duration::millis(millis), ..moment(Twist::ZERO) };
        let offer = [numbers(0.3, 0.1, 1.0)];
        fuse(&parameters, &offer, &at(0), &mut held);
        let later = fuse(&parameters, &offer, &at(200), &mut held);
        assert_eq!(
            (later.twist, later.cause, later.expired),
            (Twist { linear: 0.3, angular: 0.1 }, Cause::Held, 1)
        );
        let late = fuse(&parameters, &[], &at(301), &mut held);
        assert_eq!((late.twist, late.cause), (Twist::ZERO, Cause::Silence));
    }

    #[test]
    fn nonsense_is_refused_and_counted() {
        let offers = [
            numbers(f64::NAN, 0.0, 1.0),
            numbers(0.1, 0.0, -1.0),
            words("look up", 1.0),
            numbers(0.2, 0.0, 1.0),
        ];
        let out = fused(&offers, &moment(Twist::ZERO));
        assert_eq!((out.refused, out.twist.linear), (3, 0.2));
    }

    #[test]
    fn a_head_turns_up_and_knows_no_speed() {
        let parameters = Parameters { actuator: Actuator::Head, ..Parameters::default() };
        let offers = [words("look up", 1.0), words("turn left a bit", 1.0), words("go", 1.0)];
        let out = fuse(&parameters, &offers, &moment(Twist::ZERO), &mut Held::default());
        assert_close(out.twist, 0.66 * 0.6, 0.33);
        assert_eq!(out.refused, 1);
    }

    #[test]
    fn sugeno_and_mamdani_agree_on_a_single_inner_term() {
        let parameters = Parameters { inference: Inference::Sugeno, ..Parameters::default() };
        let out = fuse(
            &parameters,
            &[words("turn right a little bit", 1.0)],
            &moment(Twist::ZERO),
            &mut Held::default(),
        );
        assert!(fabs(out.twist.angular + 0.33) < 1e-12);
    }

    proptest! {
        #[test]
        fn no_command_passes_the_veto_and_none_leaves_the_span_of_the_offers(
            wishes in prop::collection::vec((-0.5f64..0.8, -1f64..1., 0.01f64..1.), 1..20),
            bound in 0f64..0.5, forward: bool
        ) {
            let offers: std::vec::Vec<_> = wishes.iter().map(|&(v, w, weight)| numbers(v, w, weight)).collect();
            let veto = Veto { forward, linear_max: bound, wider: 0.0 };
            let out = fused(&offers, &Moment { veto, ..moment(Twist::ZERO) });
            let most = if forward { bound } else { 0.0 };
            prop_assert!(out.twist.linear <= most + 1e-12, "{:?}", out.twist);
            let of_a_side = |side: f64| wishes.iter().any(|w| w.1 * side > 0.05);
            // With both sides offered the result may be near straight only as far as straight offers pull it.
            let straight = wishes.iter().any(|w| fabs(w.1) <= 0.05);
            if of_a_side(1.0) && of_a_side(-1.0) && !straight {
                prop_assert!(fabs(out.twist.angular) > 0.05, "{:?}", out.twist);
            }
        }
    }
}

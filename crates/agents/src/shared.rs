//! What several agents need.

use motion::fusion::SHARES_MAX;
use motion::ring::Ring;
use perception::picture::Size;
use perception::recognise::Form;
use perception::sonar::{RiskParams, risk};
use types::geometry::TAU;
use types::messages::{Encoding, Image, Offer, Ranges, Risk};
use types::{AgentId, Duration, Time};

/// The frame of the robot's body, at whose origin all distances begin.
pub(crate) const BODY: &str = "base_link";

/// How the pixels of a picture in colour are to be read, and its size; nothing where it has no colours, or is not whole.
pub(crate) fn form(picture: &Image, row: &[u8]) -> Option<(Form, Size)> {
    let form = match picture.encoding {
        Encoding::Rgb8 => Form::Rgb,
        Encoding::Hsi8 => Form::Hsi,
        Encoding::Mono8 => return None,
    };
    let is_whole = row.len() == picture.len() && !row.is_empty();
    is_whole.then(|| (form, Size::new(picture.width as usize, picture.height as usize)))
}

/// Ranges in the form that the laws of motion take.
pub(crate) fn ring(ranges: &Ranges) -> Ring<'_> {
    Ring::Sweep {
        angle_min: ranges.angle_min.into(),
        angle_step: ranges.angle_step.into(),
        ranges: &ranges.values,
    }
}

/// Bearing (rad) and distance from the robot's centre (m) of what was heard. Silence is no echo.
pub(crate) fn echoes(ranges: &Ranges) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    let silent = f64::from(ranges.range_max);
    bearings(ranges).filter(move |(_, range)| *range < silent)
}

/// Bearing (rad) and distance from the robot's centre (m) in each direction, silence among them.
pub(crate) fn bearings(ranges: &Ranges) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    let bearing = move |i: usize| f64::from(ranges.angle_min) + i as f64 * f64::from(ranges.angle_step);
    ranges.values.iter().enumerate().map(move |(i, range)| (bearing(i), f64::from(*range)))
}

/// Ranges in `directions` around the robot, the first straight ahead, of which nothing is known yet.
pub(crate) fn blank(directions: usize, range_min: f32, range_max: f32) -> Ranges {
    let mut ranges = Ranges {
        frame: BODY.into(),
        angle_min: 0.0,
        angle_step: (TAU / directions.max(1) as f64) as f32,
        range_min,
        range_max,
        ..Ranges::default()
    };
    ranges.values.resize(directions);
    ranges.values.fill(f32::NAN);
    ranges
}

/// The reading before, to see what approaches.
#[derive(Clone, Debug, Default)]
pub(crate) struct Before(Option<(Time, Ranges)>);

impl Before {
    /// The reading before, and the time since then (s). A ring of other directions is none.
    fn of(&self, ranges: &Ranges, stamp: Time) -> Option<(f64, &Ranges)> {
        let (then, before) =
            self.0.as_ref().filter(|(_, before)| before.values.len() == ranges.values.len())?;
        Some(((stamp - *then).seconds(), before))
    }

    /// The time since the reading before (s); zero where there is none.
    pub(crate) fn since(&self, ranges: &Ranges, stamp: Time) -> f64 {
        self.of(ranges, stamp).map_or(0.0, |(dt, _)| dt)
    }

    /// The risk in each direction, from the change since the reading before; `ranges` takes its place. Nothing where the
    /// algorithm has no room for so many directions.
    pub(crate) fn risk(&mut self, ranges: Ranges, stamp: Time, params: &RiskParams) -> Option<Risk> {
        let (dt, before) = self.of(&ranges, stamp).unwrap_or((0.0, &ranges));
        let mut out = Risk { angle_min: ranges.angle_min, angle_step: ranges.angle_step, ..Risk::default() };
        out.values.resize(ranges.values.len());
        risk(&before.values, &ranges.values, dt, params, &mut out.values).ok()?;
        self.0 = Some((stamp, ranges));
        Some(out)
    }
}

/// A value and the time that it speaks of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dated<T> {
    pub(crate) value: T,
    pub(crate) stamp: Time,
}

impl<T: Copy> Dated<T> {
    /// The value, unless it is older than `age`.
    pub(crate) fn fresh(held: &Option<Dated<T>>, now: Time, age: Duration) -> Option<T> {
        held.as_ref().filter(|dated| now - dated.stamp <= age).map(|dated| dated.value)
    }
}

/// The last offer of each sender. A newer one replaces the older one of the same sender.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offers {
    senders: [AgentId; SHARES_MAX],
    /// What each of them offers, with the weight that was last given to it. They lie as they are fused, so that nothing is copied.
    rows: [(Offer, f64); SHARES_MAX],
    /// Who stands above whom, in the same order.
    priorities: [u32; SHARES_MAX],
    len: usize,
    /// Offers that found no place among those that still hold.
    pub(crate) turned_away: u64,
}

impl Default for Offers {
    fn default() -> Offers {
        Offers {
            senders: [AgentId::NONE; SHARES_MAX],
            rows: [(Offer::default(), 0.0); SHARES_MAX],
            priorities: [0; SHARES_MAX],
            len: 0,
            turned_away: 0,
        }
    }
}

impl Offers {
    /// Keeps an offer. With all places taken it replaces one that has expired; without such a one it is turned away and counted.
    pub(crate) fn put(&mut self, sender: AgentId, offer: Offer, now: Time) {
        let place = if let Some(known) = self.senders[..self.len].iter().position(|known| *known == sender) {
            known
        } else if self.len < SHARES_MAX {
            self.len += 1;
            self.len - 1
        } else if let Some(expired) = self.rows.iter().position(|(held, _)| held.valid_until < now) {
            expired
        } else {
            self.turned_away += 1;
            return;
        };
        self.senders[place] = sender;
        self.rows[place].0 = offer;
    }

    /// Drops what has expired, so that old offers are not counted again in every step.
    pub(crate) fn forget_expired(&mut self, now: Time) {
        let mut kept = 0;
        for i in 0..self.len {
            if self.rows[i].0.valid_until >= now {
                self.senders[kept] = self.senders[i];
                self.rows[kept] = self.rows[i];
                kept += 1;
            }
        }
        self.len = kept;
    }

    /// The offers, each with what `weight` says of its sender.
    pub(crate) fn weighed(&mut self, weight: impl Fn(AgentId) -> f64) -> &[(Offer, f64)] {
        self.ranked(|sender| (weight(sender), 0)).0
    }

    /// The offers, each with the weight that `standing` gives its sender, and their priorities.
    pub(crate) fn ranked(&mut self, standing: impl Fn(AgentId) -> (f64, u32)) -> (&[(Offer, f64)], &[u32]) {
        let rows = &mut self.rows[..self.len];
        let priorities = &mut self.priorities[..self.len];
        for (((_, weighs), rank), sender) in rows.iter_mut().zip(priorities.iter_mut()).zip(&self.senders) {
            (*weighs, *rank) = standing(*sender);
        }
        (rows, priorities)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn until(millis: i64) -> Offer {
        Offer { weight: 1.0, valid_until: Time::ZERO + Duration::millis(millis), ..Offer::default() }
    }

    #[test]
    fn a_sender_has_one_offer_and_the_expired_make_room() {
        let mut offers = Offers::default();
        offers.put(AgentId(0), until(10), Time::ZERO);
        offers.put(AgentId(0), until(20), Time::ZERO);
        for i in 1..SHARES_MAX as u32 {
            offers.put(AgentId(i), until(50), Time::ZERO);
        }
        offers.put(AgentId(99), until(50), Time::ZERO);
        assert_eq!((offers.len, offers.turned_away), (SHARES_MAX, 1), "nothing has expired");
        let later = Time::ZERO + Duration::millis(30);
        offers.put(AgentId(99), until(50), later);
        assert_eq!((offers.len, offers.turned_away), (SHARES_MAX, 1), "the first made room");
        offers.forget_expired(Time::ZERO + Duration::millis(51));
        assert_eq!(offers.len, 0);
    }

    #[test]
    fn what_has_other_directions_is_not_the_reading_before() {
        let (mut before, params) = (Before::default(), RiskParams::default());
        let later = Time::ZERO + Duration::millis(250);
        let (four, five) = (blank(4, 0.1, 5.0), blank(5, 0.1, 5.0));
        assert_eq!(before.since(&four, later), 0.0, "there is none");
        let risk = before.risk(four, Time::ZERO, &params).unwrap();
        assert_eq!(
            (risk.values.len(), before.since(&four, later), before.since(&five, later)),
            (4, 0.25, 0.0)
        );
        assert_eq!(before.risk(five, later, &params).unwrap().values.len(), 5);
        assert_eq!((before.since(&four, later), before.since(&five, later)), (0.0, 0.0));
    }

    #[test]
    fn an_old_value_is_none() {
        let held = Some(Dated { value: 7, stamp: Time::ZERO });
        assert_eq!(Dated::fresh(&held, Time::ZERO + Duration::millis(5), Duration::millis(5)), Some(7));
        assert_eq!(Dated::fresh(&held, Time::ZERO + Duration::millis(6), Duration::millis(5)), None);
    }
}

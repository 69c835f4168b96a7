//! Whether what the sensors say can be true. What cannot is as good as nothing, and who hears nothing stands.
//!
//! | what is heard | why it cannot be true |
//! |---|---|
//! | a number that is none, or a place metres from the last | no wheels drive like that |
//! | nothing from the wheels for some time | they were heard before |
//! | a velocity, and always the same place | who moves comes away |
//! | the same echoes to the last digit, elsewhere | a sensor that moves hears something else, if only its noise |

use types::messages::{Echoes, LaserScan, Odometry, Ranges};
use types::{Duration, Pose, Sequence, Time};

use crate::shared::{Dated, echoes};

/// Why the robot's own senses are not believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Doubt {
    /// Odometry has fallen silent.
    Silent,
    /// Odometry tells of motions that nothing on wheels can make.
    Jumps,
    /// Odometry tells of a motion and of no other place.
    Stays,
    /// The ranges stay the same while the robot moves.
    Frozen,
}

/// Odometry that is older than this has fallen silent. 300 ms is fifteen readings of wheels at 50 Hz.
const SILENT: Duration = Duration::millis(300);
/// For so long after a jump it is not believed: two readings of a sonar at 4 Hz must have been made after it.
const DOUBTED: Duration = Duration::millis(600);
/// Nothing that these agents drive is faster than this (m/s, rad/s).
const FASTEST: (f64, f64) = (20.0, 20.0);
/// How far a place may be from where the velocity leads (m): slip, and the noise of the wheels.
const SLIP: f64 = 0.1;
/// Who should have come so far (m, rad) by its velocity and has not come away at all is told the same again and again: five readings of
/// wheels at 50 Hz at a slow walk.
const COME: (f64, f64) = (0.03, 0.1);
/// Farther than this (m, rad) from where they were heard first, the same echoes cannot be true.
const ELSEWHERE: (f64, f64) = (0.06, 0.1);
/// Fewer echoes than this can be the same by chance.
const ECHOES: usize = 3;

/// What is believed of odometry and of two rings of ranges.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Trust {
    odometry: Option<Dated<Odometry>>,
    /// When it last told of what cannot be.
    jumped: Option<Time>,
    /// How far it should have come (m, rad) since it told of another place.
    stays: (f64, f64),
    rings: [Again; 2],
}

/// A ring or a scan that may be the same again and again.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Again {
    stamp: Option<Time>,
    values: u64,
    /// Where it was heard first.
    place: Option<Pose>,
    frozen: bool,
}

impl Again {
    /// Takes over a scan, seen from where the robot was.
    pub(crate) fn scan(&mut self, scan: &LaserScan, row: &[f32], stamp: Time, place: Option<Pose>) {
        let met = row.iter().filter(|range| **range < scan.range_max).count();
        self.hear(digest(row), met, stamp, place);
    }

    /// Whether it is the same as elsewhere.
    pub(crate) fn is_frozen(&self) -> bool {
        self.frozen
    }

    /// Takes over what was heard, a number that differs where it differs, with so many echoes.
    fn hear(&mut self, values: u64, echoes: usize, stamp: Time, place: Option<Pose>) {
        if self.stamp.replace(stamp) == Some(stamp) {
            return;
        }
        if values != self.values || echoes < ECHOES {
            *self = Again { stamp: Some(stamp), values, place, frozen: false };
        } else if let (Some(here), Some(there)) = (place, self.place) {
            let far = (here.position() - there.position()).norm() > ELSEWHERE.0;
            let turned = types::geometry::wrap(here.heading - there.heading).abs() > ELSEWHERE.1;
            self.frozen |= far || turned;
        }
    }
}

impl Trust {
    /// Hears odometry; whether it can be true.
    pub(crate) fn hear(&mut self, odometry: &Odometry, stamp: Time, now: Time) -> bool {
        let before = self.odometry.replace(Dated { value: *odometry, stamp });
        let twist = odometry.twist;
        let is_possible = is_finite(odometry.pose)
            && twist.linear.abs() <= FASTEST.0
            && twist.angular.abs() <= FASTEST.1
            && before.is_none_or(|before| leads(&before, odometry, stamp));
        if !is_possible {
            self.jumped = Some(now);
        }
        match before.filter(|before| is_possible && before.value.pose == odometry.pose) {
            Some(before) => {
                let span = (stamp - before.stamp).seconds().max(0.0);
                self.stays.0 += twist.linear.abs() * span;
                self.stays.1 += twist.angular.abs() * span;
            }
            None => self.stays = (0.0, 0.0),
        }
        is_possible
    }

    /// Hears one of two rings, from where the robot is.
    pub(crate) fn ring(&mut self, which: usize, ranges: &Ranges, stamp: Time, place: Option<Pose>) {
        self.rings[which].hear(digest(&ranges.values), echoes(ranges).count(), stamp, place);
    }

    /// What cannot be believed now.
    pub(crate) fn doubt(&self, now: Time) -> Option<Doubt> {
        if self.jumped.is_some_and(|jumped| now - jumped <= DOUBTED) {
            Some(Doubt::Jumps)
        } else if self.odometry.as_ref().is_some_and(|heard| now - heard.stamp > SILENT) {
            Some(Doubt::Silent)
        } else if self.stays.0 > COME.0 || self.stays.1 > COME.1 {
            Some(Doubt::Stays)
        } else {
            self.rings.iter().any(|ring| ring.frozen).then_some(Doubt::Frozen)
        }
    }
}

/// Whether the place follows from the one before at either velocity.
fn leads(before: &Dated<Odometry>, after: &Odometry, stamp: Time) -> bool {
    let span = (stamp - before.stamp).seconds().max(0.0);
    let speed = before.value.twist.linear.abs().max(after.twist.linear.abs());
    let way = (after.pose.position() - before.value.pose.position()).norm();
    // A robot that speeds up drives farther than at the speed of before: twice as far is farther than any can.
    way <= SLIP + 2.0 * speed * span
}

fn is_finite(pose: Pose) -> bool {
    pose.x.is_finite() && pose.y.is_finite() && pose.heading.is_finite()
}

/// A number that differs where values differ (FNV-1a).
fn digest(values: &[f32]) -> u64 {
    let step = |sum: u64, value: &f32| (sum ^ u64::from(value.to_bits())).wrapping_mul(0x0100_0000_01b3);
    values.iter().fold(0xcbf2_9ce4_8422_2325, step)
}

/// No transducer sits farther from the middle of its robot than this (m).
const FARTHEST_MOUNT: f64 = 10.0;
/// So much more than its longest range a transducer may tell, for rounding.
const ROUNDING: f32 = 1.01;

/// Whether a ring of sonars can be one: where its transducers sit, and what they heard. One that heard nothing can.
pub(crate) fn can_be(ring: &Echoes) -> bool {
    let (least, most) = (ring.range_min, ring.range_max);
    let sits = |x: f32| f64::from(x).abs() <= FARTHEST_MOUNT;
    let hears = |range: f32| !(range < 0.0 || range.is_finite() && range > most * ROUNDING);
    // Written so that what is no number fails.
    (0.0..most).contains(&least)
        && most.is_finite()
        && (0.0..=7.0).contains(&ring.cone)
        && ring
            .echoes
            .iter()
            .all(|echo| sits(echo.x) && sits(echo.y) && sits(echo.bearing) && hears(echo.range))
}

/// Where the transducers of a ring sat, which does not change while it is listened to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mounts(Option<Sequence<[f32; 3], 32>>);

impl Mounts {
    /// Whether those of this ring sit where they sat in the ring before.
    pub(crate) fn are_where_they_were(&mut self, ring: &Echoes) -> bool {
        let mounts = ring.echoes.iter().map(|echo| [echo.x, echo.y, echo.bearing]).collect();
        self.0.replace(mounts).is_none_or(|before| before == mounts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::blank;
    use types::messages::{Echo, Twist};

    fn at(x: f64, speed: f64) -> Odometry {
        Odometry { pose: Pose::new(x, 0.0, 0.0), twist: Twist::new(speed, 0.0), ..Odometry::default() }
    }

    fn ms(ms: i64) -> Time {
        Time(ms * 1_000_000)
    }

    #[test]
    fn a_drive_is_believed_and_what_no_wheels_do_is_not() {
        let mut trust = Trust::default();
        for i in 0..50 {
            assert!(trust.hear(&at(0.01 * i as f64, 0.5), ms(20 * i), ms(20 * i)));
        }
        assert_eq!(trust.doubt(ms(1000)), None);
        assert!(!trust.hear(&at(3.0, 0.5), ms(1000), ms(1000)), "two metres and a half in 20 ms");
        assert_eq!(trust.doubt(ms(1010)), Some(Doubt::Jumps));
        for i in 1..50 {
            assert!(trust.hear(&at(3.0, 0.0), ms(1000 + 20 * i), ms(1000 + 20 * i)));
        }
        assert_eq!(trust.doubt(ms(1980)), None, "it is believed again after a while");
        for wild in [at(f64::NAN, 0.0), at(0.0, f64::INFINITY), at(3.0, -1e6)] {
            assert!(!trust.hear(&wild, ms(2000), ms(2000)), "{wild:?}");
        }
    }

    #[test]
    fn a_motion_that_leads_nowhere_is_not_believed() {
        let mut trust = Trust::default();
        let mut hear = |ms_: i64, x: f64, speed: f64| {
            trust.hear(&at(x, speed), ms(ms_), ms(ms_));
            trust.doubt(ms(ms_))
        };
        let stuck: Vec<_> = (0..10).map(|i| hear(20 * i, 1.0, 0.3)).collect();
        assert_eq!(stuck[5], None, "30 mm in 100 ms are no more than that");
        assert_eq!(stuck[6], Some(Doubt::Stays));
        assert_eq!(hear(220, 1.001, 0.3), None, "it comes away");
        assert!((0..500).all(|i| hear(240 + 20 * i, 1.001, 0.0).is_none()), "at rest it stays");
        let mut turning = Trust::default();
        let spin = Odometry { twist: Twist::new(0.0, 1.0), ..Odometry::default() };
        assert!((0..10).all(|i| turning.hear(&spin, ms(20 * i), ms(20 * i))));
        assert_eq!(turning.doubt(ms(180)), Some(Doubt::Stays));
    }

    #[test]
    fn transducers_sit_where_they_sat() {
        let echo = |bearing| Echo { x: 0.2, y: 0.0, bearing, range: 1.0 };
        let ring = |bearing, range| Echoes {
            echoes: [Echo { range, ..echo(bearing) }; 4].into_iter().collect(),
            ..Echoes::default()
        };
        let mut mounts = Mounts::default();
        let heard = [(0.5, 1.0), (0.5, 2.0), (0.6, 2.0), (0.7, 2.0), (0.5, 2.0), (0.5, 1.0)];
        let believed = heard.map(|(bearing, range)| mounts.are_where_they_were(&ring(bearing, range)));
        assert_eq!(believed, [true, true, false, false, false, true]);
    }

    #[test]
    fn who_was_heard_once_must_not_fall_silent() {
        let mut trust = Trust::default();
        assert_eq!(trust.doubt(ms(9000)), None, "without odometry nothing is amiss");
        trust.hear(&at(0.0, 0.0), ms(9000), ms(9000));
        assert_eq!((trust.doubt(ms(9300)), trust.doubt(ms(9301))), (None, Some(Doubt::Silent)));
    }

    #[test]
    fn the_same_echoes_elsewhere_are_not_believed() {
        let mut trust = Trust::default();
        let mut ranges = blank(12, 0.3, 6.2);
        ranges.values.fill(6.2);
        ranges.values[3] = 1.0;
        let here = |x: f64| Some(Pose::new(x, 0.0, 0.0));
        for i in 0..9 {
            trust.ring(0, &ranges, ms(250 * i), here(0.1 * i as f64));
        }
        assert_eq!(trust.doubt(ms(2250)), None, "one echo may be the same by chance, and silence always is");
        ranges.values[4..7].fill(2.0);
        trust.ring(0, &ranges, ms(2500), here(1.0));
        trust.ring(0, &ranges, ms(2500), here(2.0));
        assert_eq!(trust.doubt(ms(2500)), None, "that was one reading, looked at twice");
        trust.ring(0, &ranges, ms(2750), here(1.05));
        assert_eq!(trust.doubt(ms(2750)), None, "at rest, or nearly, it may hear the same");
        trust.ring(0, &ranges, ms(3000), here(1.07));
        assert_eq!(trust.doubt(ms(3000)), Some(Doubt::Frozen));
        trust.ring(0, &ranges, ms(3250), here(1.07));
        assert_eq!(trust.doubt(ms(3250)), Some(Doubt::Frozen), "that it stands now makes it no better");
        ranges.values[4] = 2.001;
        trust.ring(0, &ranges, ms(3500), here(1.07));
        assert_eq!(trust.doubt(ms(3500)), None);
    }

    #[test]
    fn a_ring_out_of_nowhere_is_none() {
        let echo = Echo { x: 0.2, y: 0.0, bearing: 0.5, range: 1.0 };
        let good =
            Echoes { range_min: 0.15, range_max: 6.0, cone: 0.5, echoes: [echo; 4].into_iter().collect() };
        assert!(can_be(&good));
        let silent = |range| Echoes { echoes: [Echo { range, ..echo }; 4].into_iter().collect(), ..good };
        assert!([f32::NAN, f32::INFINITY, 6.0].map(silent).iter().all(can_be), "it heard nothing");
        assert!(![-1.0, 7.0].map(silent).iter().any(can_be));
        let wild = [
            Echoes { range_max: f32::INFINITY, ..good },
            Echoes { range_min: f32::NAN, ..good },
            Echoes { cone: -3.0, ..good },
            Echoes { echoes: [Echo { bearing: f32::NAN, ..echo }; 4].into_iter().collect(), ..good },
            Echoes { echoes: [Echo { x: 1e5, ..echo }; 4].into_iter().collect(), ..good },
        ];
        assert!(!wild.iter().any(can_be));
    }
}

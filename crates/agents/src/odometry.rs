//! The odometry agent: wheel counts, and what a gyro feels, become a pose and a velocity.

use libm::exp;
use motion::heading::{self, Turning};
use motion::kinematics::Differential;
use motion::odometry::{Odometer, Parameters};
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::messages::{Gyro, Odometry, Twist, WheelTicks};
use types::params::Params;
use types::{Pose, Time};

use crate::shared::BODY;

/// The frame in which dead reckoning tells where the robot is: that in which it began.
pub const ODOM: &str = "odom";

/// How wheel counts are read.
#[derive(Clone, Debug, Params)]
pub struct OdometryParams {
    /// Width of the counters (bits). 64 never wraps; a board that counts in 16 bits starts over at 32768.
    #[param(default = 64u32, min = 2, max = 64)]
    pub counter_bits: u32,
    /// Time over which the velocity is smoothed (s). 0.05: at 50 readings a second one count is 1 cm/s, and that would look like a motion.
    #[param(default = 0.05, min = 0.0, max = 2.0)]
    pub smoothing: f64,
    /// Usual bias of the gyro (rad/s); 0 does without one. 0.005 is that of a small one that has warmed up. What it really is the agent learns.
    #[param(default = 0.005, min = 0.0, max = 1.0)]
    pub gyro_bias: f64,
}

/// Tells where the robot believes to be and how it moves, by counting what its wheels do. Where there is a gyro, that tells how far it turned.
#[derive(Agent)]
#[agent(kind = "odometry")]
pub struct DeadReckoning {
    /// Counts of both wheels, and what a count means.
    #[robot("ticks")]
    ticks: Input<WheelTicks>,
    /// The turn rate that the body feels.
    #[robot("gyro")]
    gyro: Input<Gyro>,
    /// The pose in the frame "odom", and the velocity.
    #[port(history = 64, interpreted)]
    odometry: Output<Odometry>,
    params: OdometryParams,
    reckoning: Reckoning,
}

impl Agent for DeadReckoning {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        // The counts are totals, so the newest holds all that came before it.
        let Some(received) = self.ticks.newest() else { return Ok(()) };
        let stamp = received.header().stamp;
        let (mut sum, mut count) = (0.0, 0.0);
        while let Some(felt) = self.gyro.take() {
            (sum, count) = (sum + felt.rate, count + 1.0);
        }
        let rate = (count > 0.0 && self.params.gyro_bias > 0.0).then(|| sum / count);
        let odometry = self.reckoning.update(&self.params, &received, rate, stamp)?;
        self.odometry.send_as(Envelope { stamp: Some(stamp), ..Envelope::default() }, odometry);
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Reckoning {
    odometer: Option<(Parameters, Odometer)>,
    turning: Option<Turning>,
    twist: Twist,
    last: Option<Time>,
}

impl Reckoning {
    fn update(
        &mut self,
        params: &OdometryParams,
        ticks: &WheelTicks,
        rate: Option<f64>,
        stamp: Time,
    ) -> Result<Odometry, Fault> {
        let WheelTicks { left, right, ticks_per_turn, wheel_radius, track } = *ticks;
        if !(ticks_per_turn > 0.0 && wheel_radius > 0.0 && track > 0.0) {
            return Err(Fault::new("the wheels do not say what a count means"));
        }
        let drive = Differential::new(wheel_radius, track);
        let parameters =
            Parameters { counter_bits: params.counter_bits, ..Parameters::new(drive, ticks_per_turn) };
        let pose = self.odometer.map_or(Pose::default(), |(_, odometer)| odometer.pose());
        let odometer = match &mut self.odometer {
            Some((known, odometer)) if *known == parameters => odometer,
            // Another meaning of a count: it goes on from here.
            place => &mut place.insert((parameters, Odometer::new(parameters, pose))).1,
        };
        let dt = self.last.replace(stamp).map_or(0.0, |last| (stamp - last).seconds());
        let turning = self.turning.get_or_insert_with(|| {
            Turning::new(heading::Parameters { bias: params.gyro_bias, ..heading::Parameters::default() })
        });
        let step = odometer.update_with(left, right, |step| turning.turn(step, rate, dt));
        let pose = odometer.pose();
        if dt > 0.0 {
            let part = if params.smoothing > 0.0 { 1.0 - exp(-dt / params.smoothing) } else { 1.0 };
            self.twist.linear += part * (step.distance / dt - self.twist.linear);
            self.twist.angular += part * (step.turn / dt - self.twist.angular);
        }
        Ok(Odometry { frame: ODOM.into(), body: BODY.into(), pose, twist: self.twist })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::Duration;
    use types::geometry::TAU;

    /// A count is a millimetre.
    fn ticks(left: i64, right: i64) -> WheelTicks {
        WheelTicks { left, right, ticks_per_turn: 1000.0 * TAU * 0.1, wheel_radius: 0.1, track: 0.4 }
    }

    #[test]
    fn a_second_straight_on_at_half_a_metre_a_second() {
        let mut reckoning = Reckoning::default();
        let mut last = Odometry::default();
        for i in 0..=50 {
            let stamp = Time::ZERO + Duration::millis(20 * i);
            last = reckoning
                .update(&OdometryParams::default(), &ticks(70 + 10 * i, -30 + 10 * i), None, stamp)
                .unwrap();
        }
        assert!((last.pose.x - 0.5).abs() < 1e-9 && last.pose.y.abs() < 1e-9, "{last:?}");
        assert!((last.twist.linear - 0.5).abs() < 1e-6 && last.twist.angular.abs() < 1e-9, "{last:?}");
        assert_eq!((last.frame.as_str(), last.body.as_str()), ("odom", "base_link"));
    }

    #[test]
    fn counters_that_wrap_make_no_jump() {
        let params = OdometryParams { counter_bits: 16, smoothing: 0.0, ..OdometryParams::default() };
        let mut reckoning = Reckoning::default();
        reckoning.update(&params, &ticks(32_760, 32_760), None, Time::ZERO).unwrap();
        let after =
            reckoning.update(&params, &ticks(-32_766, -32_766), None, Time::from_seconds(1.0)).unwrap();
        assert!(
            (after.pose.x - 0.010).abs() < 1e-9 && (after.twist.linear - 0.010).abs() < 1e-9,
            "{after:?}"
        );
    }

    #[test]
    fn wheels_without_a_meaning_are_a_fault() {
        let nothing = WheelTicks::default();
        assert!(Reckoning::default().update(&OdometryParams::default(), &nothing, None, Time::ZERO).is_err());
    }
}

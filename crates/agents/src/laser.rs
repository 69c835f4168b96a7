//! The laser agent: a scan becomes the same ranges around the robot that a ring of sonars gives.

use perception::laser::{Beams, SaltParams, reduce, remove_salt};
use perception::sonar::RiskParams;
use runtime::{Agent, Envelope, Fault, Input, Output, Step};
use types::Pose;
use types::messages::{DIRECTIONS, LaserScan, Ranges, Risk};
use types::params::Params;

use crate::shared::{Before, blank};

/// The longest scan that is taken (beams).
pub const BEAMS_MAX: usize = 4096;

/// How a scan is reduced and when a direction is risky.
#[derive(Clone, Debug, Params)]
pub struct LaserParams {
    /// Directions around the robot. 36 are 10° each: finer than the robot's own width at a metre.
    #[param(default = 36u32, min = 1, max = 64)]
    pub directions: u32,
    /// Takes out hits that no beam beside them supports. True: mixed pixels at edges and dust are such hits.
    #[param(default = true)]
    pub clean: bool,
    /// Distance from the robot's centre at which the risk is 1 (m). 0.48 leaves 0.25 m to the rim of a robot 0.45 m wide.
    #[param(default = 0.48, min = 0.0, max = 5.0)]
    pub risk_stop: f64,
    /// Distance from the robot's centre beyond which a thing at rest is no risk (m). 1.4 is half the width of a corridor and the robot's radius.
    #[param(default = 1.4, min = 0.0, max = 10.0)]
    pub risk_clear: f64,
    /// The risk is 1 when the stop distance is reached within this time (s). 0.5 is time to see it twice and brake.
    #[param(default = 0.5, min = 0.0, max = 10.0)]
    pub risk_react: f64,
    /// An approach that takes longer than this is no risk (s). 4 is time to go round it.
    #[param(default = 4.0, min = 0.0, max = 60.0)]
    pub risk_late: f64,
    /// Closing speeds below this are scatter (m/s). 0.3 is a scatter of 3 cm between two scans at 10 Hz.
    #[param(default = 0.3, min = 0.0, max = 5.0)]
    pub closing_min: f64,
}

impl LaserParams {
    fn risk(&self) -> RiskParams {
        RiskParams {
            stop_distance: self.risk_stop,
            clear_distance: self.risk_clear,
            react_time: self.risk_react,
            clear_time: self.risk_late,
            speed_min: self.closing_min,
        }
    }
}

/// Gives the distances around the robot and the risk in each direction, from a laser scan.
#[derive(Agent)]
pub struct Laser {
    /// The scan.
    #[robot("scan")]
    scan: Input<LaserScan>,
    /// Distances from the robot's centre to what is nearest in each direction.
    #[port(history = 16, filtered)]
    ranges: Output<Ranges>,
    /// How likely something in a direction will be run into, from the change between two scans.
    #[port(interpreted)]
    risk: Output<Risk>,
    params: LaserParams,
    reduction: Reduction,
    before: Before,
}

impl Agent for Laser {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        let Some(scan) = self.scan.newest() else { return Ok(()) };
        if !self.ranges.has_listeners() && !self.risk.has_listeners() {
            self.before = Before::default();
            return Ok(());
        }
        let stamp = scan.header().stamp;
        let envelope = Envelope { stamp: Some(stamp), ..Envelope::default() };
        let ranges = self.reduction.ranges(&self.params, &scan, scan.row())?;
        self.ranges.send_as(envelope, ranges);
        if self.risk.has_listeners() {
            let risk = self.before.risk(ranges, stamp, &self.params.risk()).ok_or(TOO_LONG)?;
            self.risk.send_as(envelope, risk);
        }
        Ok(())
    }
}

/// The buffers of the reduction, made with the agent so that a step needs no memory.
struct Reduction {
    clean: Vec<f32>,
}

impl Default for Reduction {
    fn default() -> Reduction {
        Reduction { clean: vec![0.0; BEAMS_MAX] }
    }
}

const TOO_LONG: Fault = Fault::new("a scan has more than 4096 beams");

impl Reduction {
    fn ranges(&mut self, params: &LaserParams, scan: &LaserScan, row: &[f32]) -> Result<Ranges, Fault> {
        let clean = self.clean.get_mut(..row.len()).ok_or(TOO_LONG)?;
        let beams = Beams {
            angle_min: scan.angle_min.into(),
            angle_step: scan.angle_step.into(),
            range_min: scan.range_min,
            range_max: scan.range_max,
        };
        // A laser says its longest range where nothing was met, and that is no hit.
        for (out, range) in clean.iter_mut().zip(row) {
            *out = if *range < scan.range_max { *range } else { f32::INFINITY };
        }
        let mut hits = [0.0; BEAMS_MAX];
        let hits = &mut hits[..row.len()];
        if params.clean {
            remove_salt(&beams, clean, &SaltParams::default(), hits).map_err(|_| TOO_LONG)?;
        } else {
            hits.copy_from_slice(clean);
        }
        let mount = Pose::new(scan.mount_x.into(), scan.mount_y.into(), scan.mount_heading.into());
        let mut ranges = blank((params.directions as usize).min(DIRECTIONS), scan.range_min, scan.range_max);
        let seen = reduce(&beams, hits, mount, &mut ranges.values).map_err(|_| TOO_LONG)?;
        for (i, range) in ranges.values.iter_mut().enumerate() {
            // A direction into which no beam looks is unknown, not free.
            *range = if seen.sees(i) { *range } else { f32::NAN };
        }
        Ok(ranges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::geometry::PI;

    /// The front half, a beam a degree.
    fn scan() -> LaserScan {
        LaserScan {
            angle_min: (-PI / 2.0) as f32,
            angle_step: (PI / 180.0) as f32,
            range_min: 0.1,
            range_max: 8.0,
            ..LaserScan::default()
        }
    }

    #[test]
    fn what_lies_behind_the_laser_is_unknown_and_free_is_not_a_hit() {
        let mut row = [8.0; 181];
        row[88..=92].fill(2.0);
        let ranges = Reduction::default().ranges(&LaserParams::default(), &scan(), &row).unwrap();
        assert_eq!((ranges.values[0], ranges.values[5]), (2.0, 8.0));
        assert!(ranges.values[18].is_nan(), "straight behind");
        assert_eq!(ranges.points().count(), 1);
    }

    #[test]
    fn a_stray_point_is_taken_out_on_request() {
        let mut row = [5.0; 181];
        row[90] = 1.0;
        let front = |clean: bool| {
            let params = LaserParams { clean, ..LaserParams::default() };
            Reduction::default().ranges(&params, &scan(), &row).unwrap().values[0]
        };
        assert_eq!((front(true), front(false)), (5.0, 1.0));
    }

    #[test]
    fn a_scan_that_is_too_long_is_a_fault() {
        let row = vec![1.0; BEAMS_MAX + 1];
        assert_eq!(Reduction::default().ranges(&LaserParams::default(), &scan(), &row), Err(TOO_LONG));
    }
}

//! Ranges in many directions around the robot, measured from its centre.

use types::Point;

/// An echo: something at `range` in some direction within the cone around `bearing`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// Direction in which the sensor looks (rad), counter-clockwise from ahead, within ±π.
    pub bearing: f64,
    /// Distance (m), positive; infinite where nothing was heard.
    pub range: f64,
}

impl Echo {
    /// The point, if the thing lies in the middle of the cone.
    pub fn point(self) -> Point {
        Point::polar(self.range, self.bearing)
    }
}

/// A reading of all directions, borrowed from whoever holds it.
///
/// A range that is not a positive number tells nothing and is left out by [`Ring::echoes`]; infinity tells that the way is free. A
/// sensor that reports its greatest range instead of infinity seems to see a thing there, which matters only if that is near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ring<'a> {
    /// Bearing (rad) and range (m) of each beam, in any order.
    Beams(&'a [(f64, f64)]),
    /// Beams at equal steps, as a laser scanner gives them.
    Sweep {
        /// Bearing of the first range (rad).
        angle_min: f64,
        /// From one range to the next (rad); negative for clockwise.
        angle_step: f64,
        /// Distances (m).
        ranges: &'a [f32],
    },
}

impl<'a> Ring<'a> {
    /// Number of beams, silent ones included.
    pub fn len(&self) -> usize {
        match self {
            Ring::Beams(beams) => beams.len(),
            Ring::Sweep { ranges, .. } => ranges.len(),
        }
    }

    /// Whether there is no beam at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The beams that tell something, bearings wrapped.
    pub fn echoes(self) -> impl Iterator<Item = Echo> + Clone + use<'a> {
        (0..self.len()).filter_map(move |i| {
            let (bearing, range) = match self {
                Ring::Beams(beams) => beams[i],
                Ring::Sweep { angle_min, angle_step, ranges } => {
                    (angle_min + angle_step * i as f64, f64::from(ranges[i]))
                }
            };
            let tells = range > 0.0 && bearing.is_finite();
            tells.then(|| Echo { bearing: types::geometry::wrap(bearing), range })
        })
    }

    /// The shortest range among the beams within ±`half_width` (rad) of `bearing`; infinite if there is none.
    pub fn nearest_within(self, bearing: f64, half_width: f64) -> f64 {
        self.echoes()
            .filter(|echo| libm::fabs(types::geometry::wrap(echo.bearing - bearing)) <= half_width)
            .fold(f64::INFINITY, |nearest, echo| libm::fmin(nearest, echo.range))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;
    use types::geometry::PI;

    #[test]
    fn both_forms_tell_the_same() {
        let ranges = [1.0f32, f32::NAN, f32::INFINITY, -1.0, 2.0];
        let sweep = Ring::Sweep { angle_min: -PI / 2.0, angle_step: PI / 4.0, ranges: &ranges };
        let beams = [(-PI / 2.0, 1.0), (0.0, f64::INFINITY), (PI / 2.0, 2.0), (0.3, 0.0)];
        assert_eq!(sweep.echoes().collect::<Vec<_>>(), Ring::Beams(&beams).echoes().collect::<Vec<_>>());
        assert_eq!(sweep.nearest_within(PI / 2.0, 0.1), 2.0);
        assert_eq!(sweep.nearest_within(PI, 0.1), f64::INFINITY);
    }
}

//! Differential drive: two driven wheels on one axle.

pub use types::messages::Twist;

/// Whether both parts are numbers and not infinite.
pub fn is_finite(twist: Twist) -> bool {
    twist.linear.is_finite() && twist.angular.is_finite()
}

/// Both parts times `factor`: another speed on the same path.
pub fn scaled(twist: Twist, factor: f64) -> Twist {
    Twist { linear: twist.linear * factor, angular: twist.angular * factor }
}

/// Turn rates of the two wheels (rad/s), positive when the wheel drives the body forward.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct WheelSpeeds {
    /// Of the left wheel (rad/s).
    pub left: f64,
    /// Of the right wheel (rad/s).
    pub right: f64,
}

impl WheelSpeeds {
    /// The larger of the two magnitudes (rad/s).
    pub fn fastest(self) -> f64 {
        libm::fmax(libm::fabs(self.left), libm::fabs(self.right))
    }
}

/// The geometry of a differential drive.
///
/// With radii r_l, r_r (m), track b (m) and wheel rates w_l, w_r (rad/s):
///
/// ```text
/// linear  = (r_r w_r + r_l w_l) / 2
/// angular = (r_r w_r - r_l w_l) / b
/// ```
///
/// It holds while no wheel slips. The radii are kept apart because unequal wheels bend the path of a robot that means to drive
/// straight, which is the first systematic error that a calibration finds (Borenstein's E_d); the other is a wrong track (E_b).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Differential {
    /// Radius of the left wheel (m), positive.
    pub left_radius: f64,
    /// Radius of the right wheel (m), positive.
    pub right_radius: f64,
    /// Distance of the points where the wheels touch the ground (m), positive.
    pub track: f64,
}

impl Differential {
    /// Equal wheels of `radius` (m), `track` (m) apart.
    pub const fn new(radius: f64, track: f64) -> Differential {
        Differential { left_radius: radius, right_radius: radius, track }
    }

    /// The motion of the body for given wheel rates.
    pub fn twist(&self, wheels: WheelSpeeds) -> Twist {
        let (left, right) = (self.left_radius * wheels.left, self.right_radius * wheels.right);
        Twist { linear: (left + right) / 2.0, angular: (right - left) / self.track }
    }

    /// The wheel rates that give the body a motion.
    pub fn wheels(&self, twist: Twist) -> WheelSpeeds {
        let across = twist.angular * self.track / 2.0;
        WheelSpeeds {
            left: (twist.linear - across) / self.left_radius,
            right: (twist.linear + across) / self.right_radius,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_wheels_go_straight_and_opposite_wheels_turn_in_place() {
        let drive = Differential::new(0.1, 0.4);
        assert_eq!(drive.twist(WheelSpeeds { left: 5.0, right: 5.0 }), Twist::new(0.5, 0.0));
        // 0.1 m · 2 rad/s on a lever of 0.2 m is 1 rad/s.
        assert_eq!(drive.twist(WheelSpeeds { left: -2.0, right: 2.0 }), Twist::new(0.0, 1.0));
    }

    #[test]
    fn a_larger_right_wheel_pulls_to_the_left() {
        let drive = Differential { left_radius: 0.1, right_radius: 0.101, track: 0.4 };
        let twist = drive.twist(WheelSpeeds { left: 3.0, right: 3.0 });
        assert!(twist.angular > 0.0 && libm::fabs(twist.angular - 0.003 / 0.4) < 1e-12, "{twist:?}");
    }

    proptest::proptest! {
        #[test]
        fn wheels_and_twist_are_inverse(
            v in -2f64..2., w in -5f64..5., l in 0.02f64..0.3, r in 0.02f64..0.3, b in 0.1f64..1.
        ) {
            let drive = Differential { left_radius: l, right_radius: r, track: b };
            let back = drive.twist(drive.wheels(Twist::new(v, w)));
            proptest::prop_assert!(libm::fabs(back.linear - v) < 1e-12 && libm::fabs(back.angular - w) < 1e-11);
        }
    }
}

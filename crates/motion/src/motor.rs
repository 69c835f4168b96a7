//! A wheel under speed control, as a simulator or a predictor sees it: exact for a set point that is held over the step.

use libm::{cos, exp, fabs, sin, sqrt};

/// What a wheel did in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moved {
    /// Speed at the end of the step (rad/s).
    pub speed: f64,
    /// Angle turned during the step (rad).
    pub angle: f64,
}

/// First order lag with a limited acceleration.
///
/// ```text
/// τ dω/dt = u − ω,   |dω/dt| ≤ a
/// ```
///
/// u set point (rad/s), ω speed (rad/s), τ time constant (s), a highest acceleration (rad/s²). Solved exactly: a straight ramp
/// while the limit holds, then the exponential. So two half steps are one whole step, whatever their length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// τ (s). Zero follows at once, apart from the limit. A speed loop of a small gear motor closes in 0.05 to 0.2 s.
    pub time_constant: f64,
    /// a (rad/s²); infinity for none.
    pub acceleration_max: f64,
}

impl Default for Lag {
    /// 0.1 s, a common speed loop, and 10 rad/s²: 1 m/s² at a wheel of 0.1 m, where rubber on a smooth floor starts to slip.
    fn default() -> Lag {
        Lag { time_constant: 0.1, acceleration_max: 10.0 }
    }
}

impl Lag {
    /// From `speed` (rad/s) towards `target` (rad/s) for `dt` (s).
    pub fn step(&self, speed: f64, target: f64, dt: f64) -> Moved {
        if dt.is_nan() || dt <= 0.0 {
            return Moved { speed, angle: 0.0 };
        }
        let gap = target - speed;
        let direction = if gap < 0.0 { -1.0 } else { 1.0 };
        // Below this gap the lag asks for less than the limit.
        let free_gap = self.acceleration_max * self.time_constant;
        let ramp_time =
            if fabs(gap) > free_gap { (fabs(gap) - free_gap) / self.acceleration_max } else { 0.0 };
        if dt <= ramp_time {
            let rise = direction * self.acceleration_max;
            return Moved { speed: speed + rise * dt, angle: speed * dt + rise * dt * dt / 2.0 };
        }
        let after_ramp = if ramp_time > 0.0 { target - direction * free_gap } else { speed };
        let ramp_angle = (speed + after_ramp) / 2.0 * ramp_time;
        let rest = self.settle(after_ramp, target, dt - ramp_time);
        Moved { speed: rest.speed, angle: ramp_angle + rest.angle }
    }

    fn settle(&self, speed: f64, target: f64, dt: f64) -> Moved {
        if self.time_constant <= 0.0 {
            return Moved { speed: target, angle: target * dt };
        }
        let left = exp(-dt / self.time_constant);
        let gap = target - speed;
        Moved { speed: target - gap * left, angle: target * dt - gap * self.time_constant * (1.0 - left) }
    }
}

/// Second order lag.
///
/// ```text
/// d²ω/dt² + 2 ζ ω₀ dω/dt + ω₀² ω = K ω₀² u
/// ```
///
/// K gain, ω₀ natural frequency (rad/s), ζ damping. A DC motor with inductance is of this form, u being its voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondOrder {
    /// K: speed for a set point of one.
    pub gain: f64,
    /// ω₀ (rad/s), positive.
    pub natural_frequency: f64,
    /// ζ, positive; below one it overshoots.
    pub damping: f64,
}

/// Speed and its rate of change.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SecondOrderState {
    /// ω (rad/s).
    pub speed: f64,
    /// dω/dt (rad/s²).
    pub acceleration: f64,
}

impl SecondOrder {
    /// From `state` for `dt` (s) with the set point `target` held: the exact solution for every damping.
    pub fn step(&self, state: SecondOrderState, target: f64, dt: f64) -> SecondOrderState {
        let settled = self.gain * target;
        let (gap, rate) = (state.speed - settled, state.acceleration);
        let decay = self.damping * self.natural_frequency;
        // The deviation is e^(-decay t) (gap·C + (rate + decay·gap)·S), where C, S are cos and sin, cosh and sinh, or 1 and t.
        let square = decay * decay - self.natural_frequency * self.natural_frequency;
        let (c, s) = modes(decay, square, dt);
        let push = rate + decay * gap;
        let deviation = gap * c + push * s;
        SecondOrderState {
            speed: settled + deviation,
            acceleration: push * c + gap * square * s - decay * deviation,
        }
    }
}

/// e^(−decay t) times cosh(√q t), and times sinh(√q t)/√q; for a negative q these are cos and sin.
///
/// Written with the two decaying exponentials, so that a stiff over-damped system does not overflow.
fn modes(decay: f64, q: f64, t: f64) -> (f64, f64) {
    let root = sqrt(fabs(q));
    let shrink = exp(-decay * t);
    if root * t < 1e-6 {
        (shrink, shrink * t)
    } else if q > 0.0 {
        let (slow, fast) = (exp((root - decay) * t), exp(-(root + decay) * t));
        ((slow + fast) / 2.0, (slow - fast) / (2.0 * root))
    } else {
        (shrink * cos(root * t), shrink * sin(root * t) / root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_order_lag_is_at_63_percent_after_its_time_constant() {
        let lag = Lag { time_constant: 0.2, acceleration_max: f64::INFINITY };
        assert!(fabs(lag.step(0.0, 1.0, 0.2).speed - 0.632_120_558_828_557_7) < 1e-15);
    }

    #[test]
    fn the_limit_of_acceleration_makes_a_ramp_first() {
        let lag = Lag { time_constant: 0.1, acceleration_max: 10.0 };
        assert_eq!(lag.step(0.0, 10.0, 0.5), Moved { speed: 5.0, angle: 1.25 });
        // The ramp ends at 9 rad/s after 0.9 s; one time constant later 1/e of the last 1 rad/s is left.
        let late = lag.step(0.0, 10.0, 1.0);
        assert!(fabs(late.speed - (10.0 - exp(-1.0))) < 1e-12, "{late:?}");
    }

    /// The motor 1/(0.110356 s² + 0.875350 s + 0.808543), gain 0.944786, against its z transfer function for a held input at
    /// T = 10 ms (scipy.signal.cont2discrete).
    #[test]
    fn a_dc_motor_steps_as_its_z_transfer_function() {
        let (b1, b2) = (3.371_141_596e-4, 3.283_177_943e-4);
        let (a1, a2) = (-1.923_039_438_753, 0.923_743_759_329);
        let motor = SecondOrder { gain: 0.944_786, natural_frequency: 2.706_784, damping: 1.465_218 };
        let mut state = SecondOrderState::default();
        let (mut y1, mut y2, mut u2) = (0.0, 0.0, 0.0);
        for k in 0..500 {
            let u = if k < 250 { 10.0 } else { -4.0 };
            state = motor.step(state, u, 0.01);
            let y = -a1 * y1 - a2 * y2 + b1 * u + b2 * u2;
            (y2, y1, u2) = (y1, y, u);
            assert!(fabs(state.speed - y) < 2e-5, "sample {k}: {} for {y}", state.speed);
        }
    }

    proptest::proptest! {
        #[test]
        fn two_half_steps_of_a_lag_make_the_whole(s in -20f64..20., u in -20f64..20., dt in 0f64..2., tau in 0f64..0.5) {
            let lag = Lag { time_constant: tau, acceleration_max: 15.0 };
            let whole = lag.step(s, u, dt);
            let first = lag.step(s, u, dt / 2.0);
            let second = lag.step(first.speed, u, dt / 2.0);
            proptest::prop_assert!(fabs(whole.speed - second.speed) < 1e-9);
            proptest::prop_assert!(fabs(whole.angle - first.angle - second.angle) < 1e-9);
        }

        #[test]
        fn two_half_steps_of_the_second_order_make_the_whole(
            s in -5f64..5., r in -5f64..5., dt in 0f64..2., z in 0.1f64..3., w in 0.5f64..20.
        ) {
            let motor = SecondOrder { gain: 1.0, natural_frequency: w, damping: z };
            let start = SecondOrderState { speed: s, acceleration: r };
            let whole = motor.step(start, 2.0, dt);
            let halves = motor.step(motor.step(start, 2.0, dt / 2.0), 2.0, dt / 2.0);
            proptest::prop_assert!(fabs(whole.speed - halves.speed) < 1e-8 && fabs(whole.acceleration - halves.acceleration) < 1e-7);
        }
    }
}

//! What the vehicle says of itself once every 10 ms, with the test of whether it can be believed.

use crate::physics::{ActuatorState, State, Time};

/// One state frame of the vehicle. SI units, radians, body axes FRD, earth axes NED.
/// A value that the vehicle does not send is NaN where the field says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Moment of the measurement on the vehicle's clock.
    pub time: Time,
    /// The physical state s^p.
    pub state: State,
    /// Yaw ψ, rad.
    pub yaw: f64,
    /// Observed actuator state z.
    pub actuators: ActuatorState,
    /// Specific force at the centre of gravity, m/s²; may be NaN.
    pub specific_force: [f64; 3],
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    /// Latitude and longitude, degrees; may be NaN.
    pub position: [f64; 2],
    /// Velocity over ground, NED, m/s; may be NaN.
    pub velocity: [f64; 3],
}

impl Telemetry {
    /// A frame of which nothing is known but its time.
    pub fn unknown(time: Time) -> Self {
        let nan = f64::NAN;
        Telemetry {
            time,
            state: State::from_array([nan; 8]),
            yaw: nan,
            actuators: ActuatorState { aileron: nan, aileron_rate: nan, elevator: nan, elevator_rate: nan, throttle: nan },
            specific_force: [nan; 3],
            altitude: nan,
            position: [nan; 2],
            velocity: [nan; 3],
        }
    }

    /// Why this frame cannot be flown on, if it cannot: a value missing, non-finite, or beyond
    /// anything an aircraft of this class can do.
    pub fn defect(&self) -> Option<&'static str> {
        let s = &self.state;
        let z = &self.actuators;
        let within = |x: f64, limit: f64| x.abs() <= limit;
        // Comparisons with NaN are false, so `within` also refuses what is not finite.
        if !(within(s.roll, ANGLE_MAX) && within(s.pitch, PITCH_MAX)) {
            return Some("attitude is not a pair of Euler angles");
        }
        if !(within(s.p, RATE_MAX) && within(s.q, RATE_MAX) && within(s.r, RATE_MAX)) {
            return Some("body rates are beyond any gyroscope");
        }
        if !(s.airspeed >= 0.0 && s.airspeed <= AIRSPEED_MAX) {
            return Some("airspeed is negative, missing or absurd");
        }
        if !(within(s.alpha, ANGLE_MAX) && within(s.beta, ANGLE_MAX)) {
            return Some("air-flow angles are missing or absurd");
        }
        if !(within(z.aileron, SURFACE_MAX) && within(z.elevator, SURFACE_MAX) && z.throttle >= -0.01 && z.throttle <= 1.01) {
            return Some("actuator positions are missing or absurd");
        }
        if !(within(z.aileron_rate, SURFACE_RATE_MAX) && within(z.elevator_rate, SURFACE_RATE_MAX)) {
            return Some("actuator rates are missing or absurd");
        }
        if !within(self.altitude, ALTITUDE_MAX) {
            return Some("altitude is missing or absurd");
        }
        None
    }

    /// Whether every measured value equals that of `earlier` to the bit: a sensor that has stopped.
    pub fn repeats(&self, earlier: &Telemetry) -> bool {
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        let pairs = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| same(*a, *b));
        pairs(&self.state.to_array(), &earlier.state.to_array())
            && same(self.altitude, earlier.altitude)
            && pairs(&self.specific_force, &earlier.specific_force)
    }
}

/// π with the rounding of a 32-bit quaternion, rad.
const ANGLE_MAX: f64 = std::f64::consts::PI + 1e-3;
/// π/2 with the rounding of a 32-bit quaternion, rad.
const PITCH_MAX: f64 = std::f64::consts::FRAC_PI_2 + 1e-3;
/// The full scale of common MEMS gyroscopes, 2000 °/s, in rad/s.
const RATE_MAX: f64 = 34.91;
/// Twice what the X8 reaches in a vertical dive (terminal speed near 60 m/s), m/s.
const AIRSPEED_MAX: f64 = 120.0;
/// A surface beyond a right angle is no surface, rad.
const SURFACE_MAX: f64 = std::f64::consts::FRAC_PI_2;
/// Travel of 1 rad in 1 ms: ten times the peak rate of the X8's 100 rad/s servos, rad/s.
const SURFACE_RATE_MAX: f64 = 1000.0;
/// Above the stratopause of the standard atmosphere the physics has no air, m.
const ALTITUDE_MAX: f64 = 47_000.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Telemetry {
        Telemetry {
            state: State::NEUTRAL,
            yaw: 0.0,
            actuators: ActuatorState::default(),
            specific_force: [0.0, 0.0, -9.81],
            altitude: 600.0,
            ..Telemetry::unknown(Time::from_micros(0))
        }
    }

    #[test]
    fn a_frame_without_position_can_be_flown_on() {
        assert_eq!(good().defect(), None);
    }

    #[test]
    fn each_value_that_is_not_finite_or_absurd_is_a_defect() {
        for bad in [f64::NAN, f64::INFINITY, -1e30] {
            for i in 0..8 {
                let mut frame = good();
                let mut x = frame.state.to_array();
                x[i] = bad;
                frame.state = State::from_array(x);
                assert!(frame.defect().is_some(), "state component {i} = {bad}");
            }
            assert!(Telemetry { altitude: bad, ..good() }.defect().is_some());
            for i in 0..5 {
                let mut z = ActuatorState::default();
                *[&mut z.aileron, &mut z.aileron_rate, &mut z.elevator, &mut z.elevator_rate, &mut z.throttle][i] = bad;
                assert!(Telemetry { actuators: z, ..good() }.defect().is_some(), "actuator component {i} = {bad}");
            }
        }
    }

    #[test]
    fn the_edge_of_the_plausible_is_still_flown() {
        // Inverted in a spin at the gyroscope's full scale: real, and when the pilot is needed most.
        let mut frame = good();
        frame.state.roll = -std::f64::consts::PI;
        frame.state.p = 34.9;
        frame.state.airspeed = 0.0;
        assert_eq!(frame.defect(), None);
    }
}

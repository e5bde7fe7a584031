//! Rate limit on the attitude that is commanded to a flight controller.
//!
//! A step of the commanded bank from one side to the other saturates a flight controller's loops, and the pitch error
//! reaches 20°. A ramp that the loops can follow keeps the attitude inside the envelope.

use greylag_physics::Time;

/// Largest rates of the commanded roll and pitch, rad/s. They are below the rate limits of flight controllers: 70°/s in roll
/// and 60°/s in pitch by default in PX4, 75°/s after an autotune in ArduPilot.
const RATE: [f64; 2] = [45.0 * DEGREE, 20.0 * DEGREE];
/// Longest time step of the ramp, s. A longer time since the last command counts as this long.
const GAP_S: f64 = 0.1;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// The ramp. It stores the last commanded roll and pitch (rad) with their time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AttitudeRamp {
    last: Option<(Time, [f64; 2])>,
}

impl AttitudeRamp {
    /// Resets the ramp while the flight controller flies by itself.
    pub(super) fn rest(&mut self) {
        self.last = None;
    }

    /// Returns the roll and pitch (rad) to command at `now`, on the ramp to the target attitude `wanted`. After a reset the ramp
    /// starts at the measured attitude `seen`.
    pub(super) fn command(&mut self, now: Time, wanted: [f64; 2], seen: [f64; 2]) -> [f64; 2] {
        let (before, from) = self.last.unwrap_or((now, seen));
        let dt = now.since(before).as_secs_f64().min(GAP_S);
        let ramped = std::array::from_fn(|axis| {
            let most = RATE[axis] * dt;
            // no ramp can start from a NaN, so the target is commanded at once
            if from[axis].is_finite() {
                wanted[axis].clamp(from[axis] - most, from[axis] + most)
            } else {
                wanted[axis]
            }
        });
        self.last = Some((now, ramped));
        ramped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64) -> Time {
        Time::from_micros(1000 * ms)
    }

    #[test]
    fn a_step_becomes_a_ramp_that_begins_where_the_aircraft_is() {
        let mut ramp = AttitudeRamp::default();
        let [roll, pitch] = [50.0 * DEGREE, -10.0 * DEGREE];
        let mut got = [0.0; 2];
        for tick in 0..=100 {
            got = ramp.command(at(10 * tick), [roll, pitch], [5.0 * DEGREE, 2.0 * DEGREE]);
            if tick == 50 {
                assert!((got[0] / DEGREE - 27.5).abs() < 1e-9, "{}", got[0] / DEGREE);
                assert!((got[1] / DEGREE + 8.0).abs() < 1e-9, "{}", got[1] / DEGREE);
            }
        }
        assert!((got[0] - roll).abs() < 1e-9 && got[1] == pitch, "reached, and not passed");
    }

    #[test]
    fn a_gap_is_no_licence_to_jump() {
        let mut ramp = AttitudeRamp::default();
        ramp.command(at(0), [0.0; 2], [0.0; 2]);
        let [roll, _] = ramp.command(at(5000), [1.0, 0.0], [0.0; 2]);
        assert!((roll / DEGREE - 4.5).abs() < 1e-9, "{}", roll / DEGREE);
    }

    #[test]
    fn an_attitude_that_is_not_known_and_a_rest_begin_anew() {
        let mut ramp = AttitudeRamp::default();
        assert_eq!(ramp.command(at(0), [0.3, 0.1], [f64::NAN; 2]), [0.3, 0.1]);
        ramp.rest();
        assert_eq!(ramp.command(at(10), [0.3, 0.1], [0.0; 2]), [0.0; 2]);
    }
}

//! Slow integral correction of the attitude that is commanded to a flight controller.
//!
//! The flight controller's loops leave a steady-state error of 0.3° to 1.8°. In steep turns, simulated loops with an
//! elevator feed-forward that does not fit the aircraft leave a pitch error of up to 9° for half a minute.
//!
//! The error is integrated slowly and within narrow bounds, and only while the setpoint is constant and nearly reached.
//! The correction therefore removes constant errors and leaves transients to the flight controller.

use greylag_physics::Time;

/// Time constant of the integrator, s: five times that of a flight controller's attitude loop.
const TIME_S: f64 = 2.5;
/// Largest correction, rad. The simulated loops of PX4 and ArduPlane have an error of this size at 55° of bank and 20°
/// nose down.
const MOST: f64 = 10.0 * DEGREE;
/// Change of the setpoint that restarts the settling time, rad.
const STILL: f64 = 0.5 * DEGREE;
/// Time for which the setpoint must be constant before the error is integrated, s. After a reversal of the bank, PX4's
/// roll oscillates for this time with a period of 5 s.
const SETTLING_S: f64 = 4.0;
/// Error above which integration stops, rad. A larger error is not a steady-state error.
const NEAR: f64 = 12.0 * DEGREE;
/// Change of the setpoint that resets the correction, rad.
const ANOTHER: f64 = 4.0 * DEGREE;
/// Time between two states above which integration is skipped, s.
const GAP_S: f64 = 0.1;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Integral correction of the roll and pitch setpoints.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AttitudeTrim {
    added: [f64; 2],
    /// The roll and pitch setpoint at which the correction was integrated, rad.
    found_at: [f64; 2],
    last: Option<Time>,
    /// The constant setpoint, rad, and the time since which it has been constant.
    standing: Option<([f64; 2], Time)>,
}

impl AttitudeTrim {
    /// Resets the correction while the flight controller flies by itself.
    pub(super) fn rest(&mut self) {
        *self = AttitudeTrim::default();
    }

    /// The roll and pitch to send at `now`, rad, for the setpoint `wanted` and the measured attitude `seen`.
    pub(super) fn command(&mut self, now: Time, wanted: [f64; 2], seen: [f64; 2]) -> [f64; 2] {
        let dt = self.last.replace(now).map_or(0.0, |last| now.since(last).as_secs_f64());
        let stands = self.standing.filter(|(stood, _)| !far(*stood, wanted, STILL));
        let (stood, since) = stands.unwrap_or((wanted, now));
        self.standing = Some((stood, since));
        let settled = now.since(since).as_secs_f64() >= SETTLING_S;
        for axis in 0..2 {
            let added = &mut self.added[axis];
            // the correction of a right turn is wrong in a left turn
            if (self.found_at[axis] - wanted[axis]).abs() > ANOTHER {
                *added = 0.0;
            }
            // difference between the attitude that was sent to the flight controller and the measured attitude
            let left = (wanted[axis] + *added - seen[axis]).abs();
            if settled && dt <= GAP_S && left <= NEAR {
                *added = (*added + (wanted[axis] - seen[axis]) * dt / TIME_S).clamp(-MOST, MOST);
                self.found_at[axis] = wanted[axis];
            }
        }
        std::array::from_fn(|axis| wanted[axis] + self.added[axis])
    }
}

/// Whether two attitudes differ by more than `by` in an axis; true for NaN.
fn far(a: [f64; 2], b: [f64; 2], by: f64) -> bool {
    !a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Roll error at each tick of a simulated flight of 20 s, rad. The flight controller has a time constant of half a
    /// second and a constant error of `error` (rad). `wanted` is the roll setpoint (rad) as a function of time (s). The
    /// flight starts at the setpoint.
    fn flown(error: f64, wanted: impl Fn(f64) -> f64) -> Vec<f64> {
        let (mut trim, mut roll) = (AttitudeTrim::default(), wanted(0.0));
        (0..2000)
            .map(|tick| {
                let at = f64::from(tick) * 0.01;
                let now = Time::from_micros(10_000 * tick as u64);
                let [commanded, _] = trim.command(now, [wanted(at), 0.0], [roll, 0.0]);
                roll += (commanded + error - roll) * 0.02;
                wanted(at) - roll
            })
            .collect()
    }

    #[test]
    fn an_error_that_stays_is_gone_after_some_seconds() {
        // 1.8° is the largest error measured with real firmware. It must fall below a tenth of a degree.
        let errors = flown(1.8 * DEGREE, |_| 0.8);
        assert!(errors[140].abs() > 1.5 * DEGREE, "the controller's own at first");
        assert!(errors[1400..].iter().all(|e| e.abs() < 0.1 * DEGREE), "{}", errors[1400] / DEGREE);
    }

    #[test]
    fn the_trim_is_bounded_and_leaves_manoeuvres_alone() {
        let errors = flown(11.0 * DEGREE, |_| 0.8);
        // At most 10° of the 11° are removed.
        assert!((errors[1999].abs() / DEGREE - 1.0).abs() < 0.01, "{}", errors[1999] / DEGREE);
        assert!(flown(13.0 * DEGREE, |_| 0.8)[1999].abs() > 12.9 * DEGREE, "no error that stays");
        // A setpoint that oscillates at 0.5 Hz is never constant, so no correction is added.
        let sine = |t: f64| 0.3 * (3.1 * t).sin();
        let mut plain = 0.0;
        for (tick, error) in flown(0.01, sine).into_iter().enumerate() {
            let at = tick as f64 * 0.01;
            plain += (sine(at) + 0.01 - plain) * 0.02;
            assert!((error - (sine(at) - plain)).abs() < 1e-12, "{at} s");
        }
    }

    /// The simulated flight controller reaches 95 % of the commanded roll, first in a right turn and then in a left turn.
    #[test]
    fn a_turn_that_is_reversed_is_trimmed_anew() {
        for ramp_s in [0.01, 9.0] {
            let wanted =
                |t: f64| 45.0 * DEGREE * (1.0 - 2.0 * ((t - 20.0) / ramp_s).clamp(0.0, 1.0));
            let (mut trim, mut roll) = (AttitudeTrim::default(), wanted(0.0));
            for tick in 0..5000 {
                let at = f64::from(tick) * 0.01;
                let now = Time::from_micros(10_000 * tick as u64);
                let [commanded, _] = trim.command(now, [wanted(at), 0.0], [roll, 0.0]);
                roll += (0.95 * commanded - roll) * 0.02;
                if tick == 1999 || tick == 4999 {
                    let error = (wanted(at) - roll) / DEGREE;
                    assert!(error.abs() < 0.1, "{error} degrees at {at} s, reversed in {ramp_s} s");
                }
            }
        }
    }

    #[test]
    fn what_is_no_number_and_a_gap_add_nothing() {
        let mut trim = AttitudeTrim::default();
        for tick in 0..1000 {
            let now = Time::from_micros(10_000 * tick);
            assert_eq!(trim.command(now, [0.1, 0.0], [f64::NAN, 0.0]), [0.1, 0.0]);
        }
        let late = Time::from_micros(60_000_000);
        assert_eq!(trim.command(late, [0.1, 0.0], [0.08, 0.0]), [0.1, 0.0]);
    }

    #[test]
    fn the_trim_takes_its_time() {
        // Integration starts after 4 s of settling, with a time constant of 2.5 s. At 7 s, 1.8° · e^(−1.2) = 0.54°
        // remains.
        let left = flown(1.8 * DEGREE, |_| 0.8)[700].abs() / DEGREE;
        assert!((left - 0.54).abs() < 0.05, "{left}");
    }

    /// A correction of 1.8°, integrated in a right turn of 20 s.
    fn trimmed() -> AttitudeTrim {
        let (mut trim, mut roll) = (AttitudeTrim::default(), 0.8);
        for tick in 0..2000 {
            let now = Time::from_micros(10_000 * tick);
            let [commanded, _] = trim.command(now, [0.8, 0.0], [roll, 0.0]);
            roll += (commanded - 1.8 * DEGREE - roll) * 0.02;
        }
        trim
    }

    #[test]
    fn the_trim_of_one_turn_is_not_added_to_another() {
        let at = Time::from_micros(20_000_000);
        let [roll, _] = trimmed().command(at, [0.8, 0.0], [0.8, 0.0]);
        assert!(((roll - 0.8) / DEGREE - 1.8).abs() < 0.1, "{}", roll / DEGREE);
        assert_eq!(trimmed().command(at, [-0.8, 0.0], [0.8, 0.0]), [-0.8, 0.0]);
        // A new engagement starts without a correction.
        let mut trim = trimmed();
        trim.rest();
        assert_eq!(trim.command(at, [0.8, 0.0], [0.8, 0.0]), [0.8, 0.0]);
    }
}

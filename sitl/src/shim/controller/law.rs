//! The attitude loops of a flight stack, and its airspeed and altitude loops for the autonomous modes.
//!
//! Both stacks have the same structure. The attitude error gives a commanded rate, to which the rate of a coordinated turn is
//! added; ArduPlane adds it about the pitch axis alone. The rate error, its integral and the commanded rate (feed-forward) give
//! the deflection. The deflection is scaled down with increasing airspeed. Sources: `FixedwingAttitudeControl` and
//! `FixedwingRateControl` of PX4, August 2025; `AP_RollController` and `AP_PitchController` of ArduPlane 4.8.

use super::Personality;
use crate::plant::{DT_S, Inputs, Travel, Truth};

const GRAVITY: f64 = 9.81;
/// Gains from the airspeed error (m/s) and from its integral (m) to the throttle (0..1).
const AIRSPEED: [f64; 2] = [0.2, 0.1];
/// Airspeed setpoint of the autonomous modes, m/s.
const CRUISE_MPS: f64 = 20.0;
/// Throttle in level flight, 0..1.
const THROTTLE: f64 = 0.2;
/// Gains from altitude error (m) and climb rate (m/s) to pitch (rad), and the limit of that pitch, rad.
const ALTITUDE: [f64; 3] = [0.01, 0.02, 0.15];
/// The X8's elevator in level flight at `CRUISE_MPS`, rad. The pitch integrator starts at this value, as after minutes of level
/// flight.
const LEVEL_RAD: f64 = 0.0685;
/// Travel of the X8's surfaces, rad.
const X8_TRAVEL: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// Largest bank angle for which the turn is coordinated, rad.
const COORDINATED: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// Rate error above which the integrators stop, rad/s, as in PX4. The weight of the error in the integral falls to zero at this
/// value.
const NOT_INTEGRATED: f64 = 400.0 * std::f64::consts::PI / 180.0;

/// Gains of an axis: attitude time constant, s; rate limit, rad/s; torque per rate error; torque per integral of the rate error,
/// and its limit; torque per commanded rate.
#[derive(Clone, Copy, Debug)]
struct Gains {
    time_constant_s: f64,
    most: f64,
    p: f64,
    i: f64,
    bound: f64,
    forward: f64,
}

/// Body rates of a coordinated turn that a stack adds to its commanded rates.
#[derive(Clone, Copy, Debug)]
enum Turns {
    /// About the roll and the pitch axis: PX4.
    BothAxes,
    /// About the pitch axis alone: `AP_RollController` of ArduPlane adds none.
    PitchAlone,
}

/// Gains of the control law that correspond to a stack's parameters for an aircraft like the X8.
#[derive(Clone, Copy, Debug)]
struct Stack {
    roll: Gains,
    pitch: Gains,
    /// Deflection of a torque of 1, rad.
    full_rad: f64,
    /// Cutoff of the low-pass on the commanded rates, Hz; infinite for no low-pass.
    cutoff_hz: f64,
    /// Airspeed for which the gains are tuned, and the lowest airspeed of the gain scaling, m/s.
    scaled_at_mps: f64,
    least_mps: f64,
    turns: Turns,
}

/// PX4's airframe 1036 with the airspeeds of the X8, as in the ULog of the flight that the test below replays.
/// The roll gains are FW_R_TC, FW_R_RMAX, FW_RR_P, _I, _IMAX and _FF; the pitch gains are the corresponding parameters. The
/// others are the X8's travel, FW_AIRSPD_TRIM and FW_AIRSPD_STALL.
const PX4: Stack = Stack {
    roll: Gains { time_constant_s: 0.45, most: 1.22, p: 0.085, i: 0.132, bound: 0.2, forward: 0.4 },
    pitch: Gains { time_constant_s: 0.4, most: 1.05, p: 0.05, i: 0.05, bound: 0.4, forward: 0.4 },
    full_rad: X8_TRAVEL,
    cutoff_hz: f64::INFINITY,
    scaled_at_mps: 18.0,
    least_mps: 11.0,
    turns: Turns::BothAxes,
};

/// ArduPlane's gains for the X8, as in the log of the flight that the test below replays.
/// The roll gains are RLL2SRV_TCONST, _RMAX, RLL_RATE_P, _I, _IMAX and _FF; the pitch gains are the corresponding parameters. The
/// cutoff is RLL_RATE_FLTT. A torque of 1 is 57.3°, and 45° is full travel. The airspeeds are SCALING_SPEED and half of
/// SCALING_SPEED.
const ARDUPILOT: Stack = Stack {
    roll: Gains {
        time_constant_s: 0.45,
        most: 1.57,
        p: 0.08,
        i: 0.15,
        bound: 0.666,
        forward: 0.21,
    },
    pitch: Gains {
        time_constant_s: 0.45,
        most: 1.57,
        p: 0.12,
        i: 0.12,
        bound: 0.666,
        forward: 0.35,
    },
    full_rad: X8_TRAVEL / std::f64::consts::FRAC_PI_4,
    cutoff_hz: 3.0,
    scaled_at_mps: 15.0,
    least_mps: 7.5,
    turns: Turns::PitchAlone,
};

/// The control loops with their states.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    stack: Stack,
    travel: Travel,
    /// Commanded rates after the low-pass, rad/s.
    wanted: [f64; 2],
    /// Torques of the integrators, roll and pitch.
    integral: [f64; 2],
    /// Integral of the airspeed error, m.
    slow: f64,
    /// Altitude setpoint of the mode, m; `None` until `level` sets it.
    altitude: Option<f64>,
}

impl Law {
    /// Loops with the integrators of steady level flight, for surfaces of this travel.
    pub(super) fn new(personality: Personality, travel: Travel) -> Self {
        let stack = match personality {
            Personality::Px4 => PX4,
            Personality::Ardupilot => ARDUPILOT,
        };
        let scale = stack.scaled_at_mps / CRUISE_MPS;
        let level = -LEVEL_RAD / stack.full_rad / (scale * scale);
        Law { stack, travel, wanted: [0.0; 2], integral: [0.0, level], slow: 0.0, altitude: None }
    }

    /// Resets the airspeed and altitude loops for a new mode, and with `forgets` also the integrators of the rate loops.
    /// PX4 and ArduPlane reset these integrators after a mode without rate control alone: real ArduPlane 4.8 went from LOITER to
    /// GUIDED with the integrators that it had.
    pub(super) fn begin(&mut self, forgets: bool) {
        (self.slow, self.altitude) = (0.0, None);
        if forgets {
            self.integral = [0.0; 2];
        }
    }

    /// Commands for an attitude (rad) at a thrust, 0..1; without a thrust, the throttle holds the cruise airspeed.
    pub(super) fn attitude(
        &mut self,
        seen: &Truth,
        roll: f64,
        pitch: f64,
        thrust: Option<f64>,
    ) -> Inputs {
        let share = 1.0 / (1.0 + 1.0 / (std::f64::consts::TAU * self.stack.cutoff_hz * DT_S));
        let rates = self.rates(seen, roll, pitch);
        for (wanted, rate) in self.wanted.iter_mut().zip(rates) {
            *wanted += share * (rate - *wanted);
        }
        let [roll_rate, pitch_rate] = self.wanted;
        let scale = self.stack.scaled_at_mps / seen.airspeed_mps.max(self.stack.least_mps);
        let (gains, full) = ([self.stack.roll, self.stack.pitch], self.stack.full_rad);
        let travels = [self.travel.aileron, self.travel.elevator].map(|t| t.largest_rad() / full);
        let [aileron, elevator] = [(0, roll_rate, seen.p_radps), (1, pitch_rate, seen.q_radps)]
            .map(|(axis, wanted, rate)| {
                let gains = gains[axis];
                let error = wanted - rate;
                let torque = (gains.p * error + self.integral[axis]) * scale * scale
                    + gains.forward * wanted * scale;
                // anti-windup: no integration further into a stop
                if torque.abs() < travels[axis] || torque.signum() != error.signum() {
                    let share = (1.0 - (error / NOT_INTEGRATED).powi(2)).max(0.0);
                    let sum = self.integral[axis] + share * gains.i * error * DT_S;
                    self.integral[axis] = sum.clamp(-gains.bound, gains.bound);
                }
                torque / travels[axis]
            });
        Inputs {
            aileron,
            // a nose-up torque needs the trailing edge up, which is negative
            elevator: -elevator,
            throttle: thrust.unwrap_or_else(|| self.throttle(seen)),
            rudder: 0.0,
        }
        .clamped()
    }

    /// Commanded body rates about x and y that lead to an attitude (rad), rad/s.
    fn rates(&self, seen: &Truth, roll: f64, pitch: f64) -> [f64; 2] {
        let Stack { roll: of_roll, pitch: of_pitch, .. } = self.stack;
        let (now, up) = (seen.roll_rad, seen.pitch_rad);
        let roll_rate = (roll - now) / of_roll.time_constant_s;
        let pitch_rate = (pitch - up) / of_pitch.time_constant_s;
        let airspeed = seen.airspeed_mps.max(self.stack.least_mps);
        let turn = now.clamp(-COORDINATED, COORDINATED).tan() * up.cos() * GRAVITY / airspeed;
        let [p, q] = match self.stack.turns {
            Turns::BothAxes => {
                [roll_rate - up.sin() * turn, now.cos() * pitch_rate + up.cos() * now.sin() * turn]
            }
            // without the body roll rate of a climbing turn, which stays as a roll error
            Turns::PitchAlone => [roll_rate, pitch_rate + now.sin() * turn],
        };
        [p.clamp(-of_roll.most, of_roll.most), q.clamp(-of_pitch.most, of_pitch.most)]
    }

    fn throttle(&mut self, seen: &Truth) -> f64 {
        let error = CRUISE_MPS - seen.airspeed_mps;
        let throttle = THROTTLE + AIRSPEED[0] * error + AIRSPEED[1] * self.slow;
        if (0.0..=1.0).contains(&throttle) {
            self.slow += error * DT_S;
        }
        throttle
    }

    /// Commands that hold wings level at the altitude at which the mode began.
    pub(super) fn level(&mut self, seen: &Truth) -> Inputs {
        let altitude = *self.altitude.get_or_insert(seen.altitude_m);
        let climb = -seen.velocity_ned_mps[2];
        let [by_error, by_climb, most] = ALTITUDE;
        let pitch = by_error * (altitude - seen.altitude_m) - by_climb * climb;
        // 0.015 rad is the pitch of level flight at cruise airspeed.
        self.attitude(seen, 0.0, 0.015 + pitch.clamp(-most, most), None)
    }
}

/// Roll and pitch, rad, of a quaternion NED→FRD; `None` if its norm is not finite or not in 0.5..2.
pub(super) fn roll_and_pitch(q: [f32; 4]) -> Option<[f64; 2]> {
    let q = q.map(f64::from);
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !norm.is_finite() || !(0.5..2.0).contains(&norm) {
        return None;
    }
    let [w, x, y, z] = q.map(|c| c / norm);
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    Some([roll, (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{Plant, PlantOptions, Start};

    /// Seven attitude and thrust setpoints of a real PX4 in OFFBOARD, from its ULog, and the response, from the simulator's
    /// truth.
    const PX4_FLOWN: &str = include_str!("../../../../tests/data/px4_attitude_steps.csv");
    /// Attitude and thrust setpoints of ArduPlane in LOITER, from its log, and the response.
    const ARDUPILOT_FLOWN: &str = include_str!("../../../../tests/data/ardupilot_loiter.csv");
    /// Number of rows of 50 ms that are excluded: the aircraft first has to reach the attitude at which the recording begins.
    const BEGINNING: usize = 200;

    /// Root mean square and largest magnitude of the differences from the recorded roll and pitch, °.
    fn beside(flown: &str, law: &mut Law, plant: &mut Plant) -> [[f64; 2]; 2] {
        let (mut squares, mut most, mut count) = ([0.0; 2], [0.0_f64; 2], 0.0);
        let mut seen = plant.reset(&Start::NEUTRAL).unwrap();
        for (k, line) in flown.lines().skip(1).enumerate() {
            let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            let [roll, pitch] = [row[1], row[2]].map(f64::to_radians);
            let off = [seen.roll_rad.to_degrees() - row[4], seen.pitch_rad.to_degrees() - row[5]];
            if k >= BEGINNING {
                count += 1.0;
                (0..2).for_each(|i| squares[i] += off[i].powi(2));
                most = [most[0].max(off[0].abs()), most[1].max(off[1].abs())];
            }
            for _ in 0..5 {
                let inputs = law.attitude(&seen, roll, pitch, Some(row[3]));
                seen = plant.step(inputs).unwrap();
            }
        }
        [squares.map(|s| (s / count).sqrt()), most]
    }

    #[test]
    fn the_loops_fly_the_attitudes_that_real_controllers_flew() {
        // errors of an earlier version of the loops, roll and pitch: 5.7° and 3.4° rms, 38° at most, for PX4; 3.2° and 2.1° rms,
        // 9° at most, for ArduPlane
        for (personality, flown, bounds) in [
            (Personality::Px4, PX4_FLOWN, [0.6, 0.6, 4.0]),
            (Personality::Ardupilot, ARDUPILOT_FLOWN, [0.8, 0.6, 2.5]),
        ] {
            let mut plant = Plant::new(&PlantOptions::default()).unwrap();
            let mut law = Law::new(personality, plant.travel().unwrap());
            let [rms, most] = beside(flown, &mut law, &mut plant);
            println!("{personality}, roll and pitch: rms {rms:.2?}°, at most {most:.2?}°");
            assert!(rms[0] < bounds[0] && rms[1] < bounds[1], "{personality}");
            assert!(most.iter().all(|of| *of < bounds[2]), "{personality}");
        }
    }
}

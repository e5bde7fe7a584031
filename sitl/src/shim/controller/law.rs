//! The stack's own attitude loops, with the airspeed and altitude loops it flies by itself with.

use crate::plant::{DT_S, Inputs, Travel, Truth};

/// Roll error (rad) and its integral to aileron (rad), roll rate (rad/s) to aileron.
const ROLL: [f64; 3] = [2.5, 0.9, 0.05];
/// Pitch error to elevator (positive is trailing edge down), likewise.
const PITCH: [f64; 3] = [-0.5, -0.8, -0.06];
/// Airspeed error (m/s) and its integral to throttle.
const AIRSPEED: [f64; 2] = [0.2, 0.1];
/// What is held when flying by itself, m/s.
const CRUISE_MPS: f64 = 20.0;
/// Throttle in level flight.
const THROTTLE: f64 = 0.2;
/// Altitude error (m) and climb rate (m/s) to pitch (rad), and the most of it.
const ALTITUDE: [f64; 3] = [0.01, 0.02, 0.15];

/// The loops with their memory.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Law {
    travel: Travel,
    integral: [f64; 3],
    /// The altitude that is held, m.
    altitude: Option<f64>,
}

impl Law {
    /// Loops that have not flown yet, for surfaces of this travel.
    pub(super) fn new(travel: Travel) -> Self {
        Law { travel, ..Law::default() }
    }

    /// Flies an attitude (rad), with a thrust or at cruise.
    pub(super) fn attitude(
        &mut self,
        seen: &Truth,
        roll: f64,
        pitch: f64,
        thrust: Option<f64>,
    ) -> Inputs {
        let errors = [roll - seen.roll_rad, pitch - seen.pitch_rad, CRUISE_MPS - seen.airspeed_mps];
        let aileron = ROLL[0] * errors[0] + ROLL[1] * self.integral[0] - ROLL[2] * seen.p_radps;
        let elevator = PITCH[0] * errors[1] + PITCH[1] * self.integral[1] - PITCH[2] * seen.q_radps;
        let throttle = THROTTLE + AIRSPEED[0] * errors[2] + AIRSPEED[1] * self.integral[2];
        let free = [
            aileron.abs() < self.travel.aileron.largest_rad(),
            elevator.abs() < self.travel.elevator.largest_rad(),
            (0.0..=1.0).contains(&throttle),
        ];
        for axis in 0..3 {
            if free[axis] {
                self.integral[axis] += errors[axis] * DT_S;
            }
        }
        Inputs {
            aileron: aileron / self.travel.aileron.largest_rad(),
            elevator: elevator / self.travel.elevator.largest_rad(),
            throttle: thrust.unwrap_or(throttle),
            rudder: 0.0,
        }
        .clamped()
    }

    /// Flies level at the altitude at which it began.
    pub(super) fn level(&mut self, seen: &Truth) -> Inputs {
        let altitude = *self.altitude.get_or_insert(seen.altitude_m);
        let climb = -seen.velocity_ned_mps[2];
        let [by_error, by_climb, most] = ALTITUDE;
        let pitch = by_error * (altitude - seen.altitude_m) - by_climb * climb;
        // About the pitch of level flight at cruise.
        self.attitude(seen, 0.0, 0.015 + pitch.clamp(-most, most), None)
    }
}

/// Where the loops settle that are asked for `roll` and `pitch` (rad): a real controller's stay off by
/// so much. ArduPlane 4.8 did by 0.1° and 0.3° with level wings, by 1.4° and 0.6° at 45° of bank.
pub(super) fn left_off(roll: f64, pitch: f64) -> [f64; 2] {
    let turning = 1.0 / roll.cos().max(0.5) - 1.0;
    [roll + 0.002 + 0.028 * roll, pitch + 0.005 + 0.014 * turning]
}

/// Roll and pitch, rad, of a quaternion NED→FRD; `None` for one that is none.
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

//! Velocity over ground at the time of a state, carried on by the accelerometers between two velocity messages.

use super::lift::SLOWEST_MPS;
use greylag_link::vehicle::Telemetry;
use greylag_physics::Time;
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::rigid_body::{body_to_horizon, horizon_to_body};

/// Age up to which a velocity over ground is carried on by the accelerometers, s. Velocities come ten times a second, states a
/// hundred times, and a nose that rises by 60°/s would otherwise look like 6° of angle of attack.
const CARRIED_S: f64 = 0.5;
/// An older velocity counts only if the accelerometers say that it has changed by less than this, m/s.
const UNCHANGED_MPS: f64 = 1.0;

/// Difference of an airspeed from that of velocity and wind with which it is wrong, m/s and as a fraction.
const WRONG: (f64, f64) = (5.0, 0.3);

/// Velocity over ground between its messages.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GroundVelocity {
    /// Times of the last state and of the last new velocity; that velocity, and it carried on to the last state, NED, m/s.
    last: Option<(Time, Time, [f64; 3], [f64; 3])>,
}

impl GroundVelocity {
    /// Angle of attack (rad) and airspeed (m/s) of `frame` from attitude, velocity over ground and wind. `None` if one of them is
    /// missing or the airspeed is low.
    pub(super) fn flow(&mut self, frame: &Telemetry) -> Option<[f64; 2]> {
        self.at(frame).and_then(|velocity| flow(frame, velocity))
    }

    /// Airspeed (m/s) in place of the measured one of `frame`, if that is wrong: by more than [`WRONG`] from the one of velocity and
    /// wind, or, if no wind is known, below half the speed over ground.
    pub(super) fn instead(&mut self, frame: &Telemetry) -> Option<f64> {
        let measured = frame.state.airspeed;
        let velocity = self.at(frame)?;
        if let Some([_, airspeed]) = flow(frame, velocity) {
            let limit = WRONG.0.max(WRONG.1 * measured);
            return ((airspeed - measured).abs() > limit).then_some(airspeed);
        }
        let ground = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
        (measured < 0.5 * ground).then_some(ground)
    }

    /// The velocity at the time of `frame`, NED, m/s. `None` if the last one is too old.
    fn at(&mut self, frame: &Telemetry) -> Option<[f64; 3]> {
        let message = frame.velocity;
        let (passed, since, carried) = match self.last {
            Some((before, since, last, carried)) if last == message => {
                (frame.time.since(before).as_secs_f64(), since, carried)
            }
            _ => (0.0, frame.time, message),
        };
        let [x, y, z] = body_to_horizon(&frame.state, frame.specific_force);
        let (sin, cos) = frame.yaw.sin_cos();
        let acceleration = [cos * x - sin * y, sin * x + cos * y, z + STANDARD_GRAVITY];
        let carried: [f64; 3] = std::array::from_fn(|i| carried[i] + passed * acceleration[i]);
        self.last = Some((frame.time, since, message, carried));
        let off = (0..3).map(|i| (carried[i] - message[i]).powi(2)).sum::<f64>().sqrt();
        if frame.time.since(since).as_secs_f64() <= CARRIED_S {
            Some(carried)
        } else {
            (off < UNCHANGED_MPS).then_some(message)
        }
    }
}

/// As [`GroundVelocity::flow`] with the velocity `velocity` over ground, NED, m/s.
fn flow(frame: &Telemetry, velocity: [f64; 3]) -> Option<[f64; 2]> {
    let [north, east, down] = [0, 1, 2].map(|i| velocity[i] - frame.wind[i]);
    let (sin, cos) = frame.yaw.sin_cos();
    let ahead = [cos * north + sin * east, cos * east - sin * north, down];
    let [u, v, w] = horizon_to_body(&frame.state, ahead);
    let airspeed = (u * u + v * v + w * w).sqrt();
    // also false for NaN
    (airspeed > SLOWEST_MPS).then(|| [w.atan2(u), airspeed])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable_at;
    use greylag_physics::State;

    /// A state `k` hundredths of a second after the first, with its pitch (rad) and specific force (m/s²), and a velocity of 20 m/s
    /// to the east.
    fn frame(k: u64, pitch: f64, specific_force: [f64; 3]) -> Telemetry {
        Telemetry {
            state: State { pitch, airspeed: 20.0, ..State::NEUTRAL },
            yaw: std::f64::consts::FRAC_PI_2,
            specific_force,
            velocity: [0.0, 20.0, 0.0],
            wind: [0.0; 3],
            ..usable_at(k)
        }
    }

    #[test]
    fn the_accelerometers_carry_a_velocity_on_for_half_a_second() {
        let mut velocity = GroundVelocity::default();
        // 1 m/s² ahead and 0.5 m/s² upwards
        let at = |velocity: &mut GroundVelocity, k| {
            velocity.at(&frame(k, 0.0, [1.0, 0.0, -STANDARD_GRAVITY - 0.5]))
        };
        let mut last = None;
        for k in 0..=50 {
            last = at(&mut velocity, k);
        }
        let [north, east, down] = last.unwrap();
        assert!(north.abs() < 1e-9 && (east - 20.5).abs() < 1e-9 && (down + 0.25).abs() < 1e-9);
        // after two seconds it has changed by 2.2 m/s
        for k in 51..=200 {
            last = at(&mut velocity, k);
        }
        assert_eq!(last, None);
    }

    #[test]
    fn a_velocity_that_does_not_change_stays_valid() {
        let mut velocity = GroundVelocity::default();
        let pitch = 0.05f64;
        let force = [STANDARD_GRAVITY * pitch.sin(), 0.0, -STANDARD_GRAVITY * pitch.cos()];
        for k in 0..1000 {
            assert!(velocity.at(&frame(k, pitch, force)).is_some());
        }
    }
}

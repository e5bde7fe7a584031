//! Observation of a policy: the fifteen numbers of eq. (28) of \[GSFM26\] and the airspeed error, scaled to order one.

use crate::Target;
use greylag_num::Real;
use greylag_physics::{ActuatorState, State};

/// Number of components of an observation.
pub const OBSERVATIONS: usize = 16;

/// Scale of each component in the order of [`observe`], in rad, m/s, rad/s and throttle (0..1). The components are divided by
/// these scales. In brisk flight, at full deflection and at the start of a hard target they are then of order one.
pub const UNIT: [f64; OBSERVATIONS] =
    [1.0, 0.5, 4.0, 2.0, 1.0, 1.0, 0.2, 0.2, 0.5, 10.0, 0.5, 10.0, 0.5, 0.5, 0.25, 4.0];

/// The scaled observation, in vector lanes, double precision or dual numbers. The order is the state φ θ V p q r α β, the
/// actuators δa δ̇a δe δ̇e δt, then the errors φ* − φ, θ* − θ and V_a* − V_a.
///
/// The paper observes φ* and θ* instead of the errors. The information is the same, because φ and θ are observed too. The
/// errors have their own scales, because they must converge to zero. Airspeed is relative to 16.67 m/s, throttle to one half.
///
/// In the paper the commanded airspeed is the same in every episode and is not observed. A policy trained in this way holds
/// that airspeed whatever airspeed is commanded.
#[inline(always)]
pub fn observe<R: Real>(
    state: &State<R>,
    actuators: &ActuatorState<R>,
    target: &Target<R>,
) -> [R; OBSERVATIONS] {
    let State { roll, pitch, airspeed, p, q, r, alpha, beta } = *state;
    let ActuatorState { aileron, aileron_rate, elevator, elevator_rate, throttle, .. } = *actuators;
    let mut seen = [
        roll,
        pitch,
        airspeed - R::from_f64(State::NEUTRAL.airspeed),
        p,
        q,
        r,
        alpha,
        beta,
        aileron,
        aileron_rate,
        elevator,
        elevator_rate,
        throttle - R::from_f64(0.5),
        target.roll - roll,
        target.pitch - pitch,
        target.airspeed - airspeed,
    ];
    let mut i = 0;
    while i < OBSERVATIONS {
        seen[i] = seen[i].scale(1.0 / UNIT[i]);
        i += 1;
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hard_start_is_of_order_one_and_targets_are_seen_as_what_is_left() {
        let target = Target { roll: 60_f64.to_radians(), pitch: -0.5, airspeed: 16.67 };
        let start = observe(&State::NEUTRAL, &ActuatorState::default(), &target);
        assert!(start.iter().all(|x| x.abs() < 2.2), "{start:?}");
        assert_eq!(start[13..], [60_f64.to_radians() / 0.5, -2.0, 0.0]);
        let there = State { roll: target.roll, pitch: target.pitch, ..State::NEUTRAL };
        assert_eq!(observe(&there, &ActuatorState::default(), &target)[13..], [0.0; 3]);
        let faster = Target { airspeed: 20.67, ..target };
        assert_eq!(observe(&State::NEUTRAL, &ActuatorState::default(), &faster)[15], 1.0);
    }
}

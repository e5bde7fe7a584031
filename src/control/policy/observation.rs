//! The observation, which is the input of a policy (a neural network). It has the fifteen components of eq. (28) of \[GSFM26\]
//! (see `src/lib.rs`) and the airspeed error, all scaled to order one.

use crate::Target;
use greylag_num::Real;
use greylag_physics::{ActuatorState, State};

/// Number of components of an observation.
pub const OBSERVATIONS: usize = 16;

/// Scale by which each component is divided, in the order of [`observe`], in rad, m/s, rad/s and throttle (0..1). In fast
/// manoeuvres, at full deflection and after a step to a large commanded angle, the scaled components are of order one.
pub const UNIT: [f64; OBSERVATIONS] =
    [1.0, 0.5, 4.0, 2.0, 1.0, 1.0, 0.2, 0.2, 0.5, 10.0, 0.5, 10.0, 0.5, 0.5, 0.25, 4.0];

/// The scaled observation. Its components are the state φ θ V p q r α β, the actuators δa δ̇a δe δ̇e δt, then the errors φ* − φ,
/// θ* − θ and V_a* − V_a, where * marks a commanded value. Airspeed is relative to 16.67 m/s, throttle to one half. `R` is
/// double precision, a SIMD vector or a dual number.
///
/// Departs from the paper, which observes φ* and θ* instead of the errors. The information is the same, because φ and θ are
/// observed too. The errors have scales of their own, because they must converge to zero. In the paper the commanded airspeed
/// is the same in every episode and is not observed.
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

//! Checks whether a state frame (one message of telemetry from the vehicle) can be used for control.

use greylag_link::vehicle::limits;
use greylag_link::vehicle::{Faults, Telemetry};

/// Faults that make a frame unusable for control, with their names. A fault of the specific force is not among them, because
/// without it only the checks and corrections by the lift are left out.
const STATE_FAULTS: [(Faults, &str); 6] = [
    (Faults::ATTITUDE, "attitude"),
    (Faults::RATES, "body rates"),
    (Faults::LATE_AIR, LATE_AIR),
    (Faults::AIR, "airspeed or altitude"),
    (Faults::INCIDENCE, "incidence"),
    (Faults::ACTUATORS, "actuators"),
];

/// Name of a temporary fault: after a gap in telemetry, airspeed and altitude arrive later than the rest of the state.
pub(super) const LATE_AIR: &str = "airspeed and altitude are late";

/// The quantity that makes `frame` unusable: one with a fault that the link found, or one that is not finite or not plausible.
/// `None` for a usable frame.
pub(super) fn defect(frame: &Telemetry) -> Option<&'static str> {
    let found = STATE_FAULTS.iter().find(|(fault, _)| frame.faults.contains(*fault));
    found.map(|(_, name)| *name).or_else(|| implausible(frame))
}

fn implausible(frame: &Telemetry) -> Option<&'static str> {
    let (s, z) = (&frame.state, &frame.actuators);
    let actuators = [z.aileron, z.aileron_rate, z.elevator, z.elevator_rate, z.throttle];
    // comparisons with NaN are false, so NaN is refused as well
    if !(s.roll.abs() <= HALF_TURN && s.pitch.abs() <= HALF_TURN / 2.0) {
        Some("attitude")
    } else if !limits::rates([s.p, s.q, s.r]) {
        Some("body rates")
    } else if !limits::air(s.airspeed, frame.altitude) {
        Some("airspeed or altitude")
    } else if !limits::incidence(s.alpha, s.beta) {
        Some("incidence")
    } else if !actuators.iter().all(|x| x.is_finite()) {
        Some("actuators")
    } else {
        None
    }
}

/// Whether state, altitude and specific force of `frame` equal those of `earlier` bit by bit. Sensors that work have noise, so
/// equal values indicate that they are frozen.
pub(super) fn repeats(frame: &Telemetry, earlier: &Telemetry) -> bool {
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
    same(&frame.state.to_array(), &earlier.state.to_array())
        && same(&[frame.altitude], &[earlier.altitude])
        && same(&frame.specific_force, &earlier.specific_force)
}

/// Largest magnitude of the roll angle, rad: π plus a margin for the rounding of a 32-bit quaternion. The limit of the pitch
/// angle is half of it.
const HALF_TURN: f64 = std::f64::consts::PI + 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable;
    use greylag_physics::{ActuatorState, State};

    #[test]
    fn a_frame_without_position_can_be_flown_on() {
        assert_eq!(defect(&usable()), None);
    }

    #[test]
    fn a_fault_of_the_accelerometer_alone_does_not_stop_control() {
        let mut frame = usable();
        frame.faults.insert(Faults::SPECIFIC_FORCE);
        assert_eq!(defect(&frame), None);
        frame.faults.insert(Faults::RATES);
        assert_eq!(defect(&frame), Some("body rates"));
    }

    #[test]
    fn each_value_that_is_not_finite_or_absurd_is_a_defect() {
        for bad in [f64::NAN, f64::INFINITY, -1e30] {
            for i in 0..8 {
                let mut frame = usable();
                let mut x = frame.state.to_array();
                x[i] = bad;
                frame.state = State::from_array(x);
                assert!(defect(&frame).is_some(), "state component {i} = {bad}");
            }
            assert!(defect(&Telemetry { altitude: bad, ..usable() }).is_some());
        }
        for i in 0..5 {
            let mut z = ActuatorState::default();
            *[
                &mut z.aileron,
                &mut z.aileron_rate,
                &mut z.elevator,
                &mut z.elevator_rate,
                &mut z.throttle,
            ][i] = f64::NAN;
            assert!(
                defect(&Telemetry { actuators: z, ..usable() }).is_some(),
                "actuator component {i}"
            );
        }
    }

    #[test]
    fn the_edge_of_the_plausible_is_still_flown() {
        // an inverted spin at a roll rate just below the full scale of gyroscopes (35 rad/s)
        let mut frame = usable();
        frame.state.roll = -std::f64::consts::PI;
        frame.state.p = 34.9;
        frame.state.airspeed = 0.0;
        assert_eq!(defect(&frame), None);
    }

    #[test]
    fn pitch_ends_at_the_vertical_and_roll_at_half_a_turn() {
        use std::f64::consts::{FRAC_PI_2, PI};
        for (roll, pitch, fault) in [
            (PI, FRAC_PI_2, None),
            (-PI, -FRAC_PI_2, None),
            (0.0, 1.58, Some("attitude")),
            (3.15, 0.0, Some("attitude")),
        ] {
            let mut frame = usable();
            (frame.state.roll, frame.state.pitch) = (roll, pitch);
            assert_eq!(defect(&frame), fault, "{roll} {pitch}");
        }
    }
}

//! Checks and limits the companion's actuator command before it reaches the plant.

use super::codec::HilActuatorControls;
use crate::plant::Inputs;

/// Bit MAV_MODE_FLAG_SAFETY_ARMED of `base_mode`.
pub const ARMED: u8 = 128;

/// A valid actuator command: finite, within the actuators' ranges, zero if disarmed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Time stamp of the state frame that the companion answers, µs.
    pub echo_us: u64,
    /// Whether the companion is armed.
    pub armed: bool,
    /// Command for the actuators, after limits; zero while the companion is disarmed.
    pub inputs: Inputs,
    /// Whether a control was outside its range and was limited.
    pub limited: bool,
}

impl Answer {
    /// Reads an answer. `None` if aileron, elevator or throttle is not finite. A non-finite rudder becomes 0.
    pub fn read(message: &HilActuatorControls) -> Option<Self> {
        let [aileron, elevator, throttle, rudder, ..] = message.controls;
        if ![aileron, elevator, throttle].iter().all(|control| control.is_finite()) {
            return None;
        }
        // a companion of an aircraft without a rudder may leave its control unset
        let rudder = if rudder.is_finite() { rudder } else { 0.0 };
        let sent = Inputs {
            aileron: f64::from(aileron),
            elevator: f64::from(elevator),
            throttle: f64::from(throttle),
            rudder: f64::from(rudder),
        };
        let flown = sent.clamped();
        let armed = message.mode & ARMED != 0;
        Some(Answer {
            echo_us: message.time_usec,
            armed,
            inputs: if armed { flown } else { Inputs::default() },
            limited: flown != sent,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(aileron: f32, throttle: f32, mode: u8) -> HilActuatorControls {
        let mut controls = [0.0; 16];
        (controls[0], controls[2]) = (aileron, throttle);
        HilActuatorControls { time_usec: 7, controls, mode, ..Default::default() }
    }

    #[test]
    fn limits_what_is_too_large_and_says_so() {
        let answer = Answer::read(&message(1e30, -0.1, ARMED)).expect("finite");
        assert_eq!(
            (answer.inputs.aileron, answer.inputs.throttle, answer.limited),
            (1.0, 0.0, true)
        );
    }

    #[test]
    fn a_disarmed_answer_moves_nothing() {
        let answer = Answer::read(&message(0.5, 0.5, 64)).expect("finite");
        assert_eq!((answer.inputs, answer.armed), (Inputs::default(), false));
    }

    #[test]
    fn refuses_what_is_not_a_number_but_only_where_it_is_used() {
        assert_eq!(Answer::read(&message(f32::NAN, 0.0, ARMED)), None);
        assert_eq!(Answer::read(&message(0.0, f32::INFINITY, ARMED)), None);
        let mut unused = message(0.0, 0.0, ARMED);
        unused.controls[5] = f32::NAN;
        assert!(Answer::read(&unused).is_some());
    }
}

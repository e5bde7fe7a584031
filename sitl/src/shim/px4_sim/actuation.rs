//! Decodes the actuator message of PX4.

use crate::plant::Inputs;
use crate::shim::codec::HilActuatorControls;
use crate::shim::outputs::OutputMap;

/// Bit MAV_MODE_FLAG_SAFETY_ARMED of `mode`.
const ARMED: u8 = 128;

/// The content of PX4's actuator message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    /// The controller's time, µs.
    pub time_us: u64,
    /// Whether the controller runs in lockstep: bit 0 of the flags.
    pub lockstep: bool,
    /// Whether the controller is armed.
    pub armed: bool,
    /// Commands for the plant; zero if disarmed.
    pub inputs: Inputs,
    /// Whether a control was outside its range and was limited.
    pub limited: bool,
}

impl Actuation {
    /// Decodes a message; `None` if an assigned output is missing or not finite.
    pub fn read(outputs: &OutputMap, message: &HilActuatorControls) -> Option<Self> {
        let control =
            |place: usize| message.controls.get(place).copied().map_or(f64::NAN, f64::from);
        let mixed = outputs.mix(|place, _| control(place))?;
        let armed = message.mode & ARMED != 0;
        Some(Actuation {
            time_us: message.time_usec,
            lockstep: message.flags & 1 != 0,
            armed,
            inputs: if armed { mixed.inputs } else { Inputs::default() },
            limited: mixed.limited,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(mode: u8, last: usize) -> Option<Actuation> {
        let mut message = HilActuatorControls { mode, ..Default::default() };
        (message.controls[0], message.controls[2]) = (1.0, 1.0);
        let map = format!("aileron=1,elevator=2,throttle=3,rudder={last}");
        Actuation::read(&map.parse().unwrap(), &message)
    }

    #[test]
    fn only_an_armed_controller_moves_anything() {
        let armed = Inputs { aileron: 1.0, throttle: 1.0, ..Inputs::default() };
        // A negative zero equals zero.
        assert_eq!(read(129, 4).unwrap().inputs, armed);
        assert_eq!(read(1, 4).unwrap().inputs, Inputs::default());
        assert_eq!(read(129, 17), None, "PX4 has 16 outputs here");
    }
}

//! Step responses of the model: roll rate to aileron and pitch rate to elevator. The polarity check compares the measured rates
//! with them, to see whether the surfaces act in the expected direction.

use greylag_model::{GreyBox, Trim, TrimError, Twin};
use greylag_physics::Command;

/// Number of values of a response: one per state frame of 10 ms, from the frame of the step to 0.4 s after it. By then the roll
/// rate has settled and the pitch rate has nearly settled. Later frames have the last value.
const SPAN: usize = 41;
/// Size of the simulated step of a command (−1..1). It is small enough for a linear response and large compared with rounding.
const STEP: f64 = 0.01;

/// Step responses in straight flight: the change of the roll rate after a unit step of the aileron command, and of the pitch
/// rate after a unit step of the elevator command. Both are in rad/s, with one value per state frame of 10 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct Answers {
    roll: [f64; SPAN],
    pitch: [f64; SPAN],
}

impl Answers {
    /// The responses of `model` in straight flight at the true airspeed `airspeed` (m/s).
    ///
    /// # Errors
    ///
    /// If the model has no straight-flight trim at `airspeed`.
    pub fn of(model: &GreyBox, airspeed: f64) -> Result<Answers, TrimError> {
        // the reference altitude suffices, because 1000 m of altitude change a response by only a tenth
        let altitude = model.airframe.reference.altitude;
        let trim = Trim::straight(model, airspeed, altitude)?;
        let command = model.airframe.actuators.command(&trim.controls);
        let rates = |command: Command| {
            let mut twin = Twin::at_rest(trim.state, &trim.controls, altitude);
            let mut rates = [[0.0; 2]; SPAN];
            for rates in &mut rates {
                *rates = [twin.state.p, twin.state.q];
                twin.step(model, &command);
            }
            rates
        };
        let undisturbed = rates(command);
        let [rolled, pitched] = [
            rates(Command { aileron: command.aileron + STEP, ..command }),
            rates(Command { elevator: command.elevator + STEP, ..command }),
        ];
        let answer = |after: &[[f64; 2]; SPAN], axis: usize| {
            std::array::from_fn(|k| (after[k][axis] - undisturbed[k][axis]) / STEP)
        };
        Ok(Answers { roll: answer(&rolled, 0), pitch: answer(&pitched, 1) })
    }

    /// Change of the rate of `axis` (0 roll, 1 pitch) `states` frames after a unit step, rad/s; 0 before the step.
    pub(super) fn after(&self, axis: usize, states: isize) -> f64 {
        let answer = if axis == 0 { &self.roll } else { &self.pitch };
        match usize::try_from(states) {
            Ok(states) => answer[states.min(SPAN - 1)],
            Err(_) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_aileron_rolls_and_the_elevator_pitches_as_the_simulator_has_it() {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        let answers = Answers::of(&model, 20.0).unwrap();
        // a command appears in the surfaces of the next state, and in the rates of the state after that
        assert_eq!([answers.after(0, -1), answers.after(0, 0), answers.after(0, 1)], [0.0; 3]);
        // Steady roll: Clδa δa · 2 V / (b |Clp|) = 0.1202 · 0.5235 · 40 / (2.1 · 0.4042) = 2.97 rad/s. Sideslip, the
        // product of inertia and the yaw rate reduce it to about half.
        let roll = answers.after(0, 20);
        assert!(roll > 1.0 && roll < 3.0, "{roll}");
        // q̇ = ½ρV² S c Cmδe δe / Jy = −43 rad/s² at first, which makes q = −0.9 rad/s after two steps of 10 ms
        let pitch = answers.after(1, 4);
        assert!(pitch < -0.5 && pitch > -2.0, "{pitch}");
    }
}

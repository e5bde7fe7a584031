//! How far an aircraft's surfaces deflect at full command.

use super::{FULL_DEFLECTION_RAD, Inputs, Plant, PlantError, jsbsim};

/// Steps without flight that an actuator is given to reach its stop: 20 s in steps of 10 ms.
const STEPS: usize = 2000;
/// Steps without movement after which a surface counts as being at its stop: half a second, longer
/// than any delay of an actuator.
const AT_REST: usize = 50;
/// Movement in one step that is none, rad.
const STILL_RAD: f64 = 1e-12;
/// A smaller travel is none, rad.
const LEAST_RAD: f64 = 1e-3;
/// A travel that differs by less from [`FULL_DEFLECTION_RAD`] is that one, rad: an actuator's
/// filter stops short of its end by rounding.
const ROUNDING_RAD: f64 = 1e-9;

/// Deflections at full command: the larger of those at +1 and at −1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Of the aileron, rad.
    pub aileron_rad: f64,
    /// Of the elevator, rad.
    pub elevator_rad: f64,
}

impl Travel {
    /// That of the X8.
    pub const X8: Travel =
        Travel { aileron_rad: FULL_DEFLECTION_RAD, elevator_rad: FULL_DEFLECTION_RAD };
}

impl Default for Travel {
    fn default() -> Self {
        Travel::X8
    }
}

impl Plant {
    /// Measures the travel of the surfaces: commands them fully both ways while the aircraft stands
    /// still in its state, then goes back to where it was.
    ///
    /// # Errors
    /// [`PlantError::Travel`] when a surface does not follow its command.
    pub fn travel(&mut self) -> Result<Travel, PlantError> {
        let before = self.snapshot()?;
        let measured = self.stops(1.0).and_then(|up| Ok((up, self.stops(-1.0)?)));
        self.fdm.set_dt(self.options.step_s);
        self.restore(&before)?;
        let (up, down) = measured?;
        let largest = |surface: usize, property: &str| {
            let travel = up[surface].abs().max(down[surface].abs());
            self.checked(travel, property)
        };
        Ok(Travel {
            aileron_rad: largest(0, &self.options.properties.aileron_position)?,
            elevator_rad: largest(1, &self.options.properties.elevator_position)?,
        })
    }

    fn checked(&self, travel: f64, property: &str) -> Result<f64, PlantError> {
        match travel {
            t if (t - FULL_DEFLECTION_RAD).abs() < ROUNDING_RAD => Ok(FULL_DEFLECTION_RAD),
            t if t.is_finite() && t > LEAST_RAD => Ok(t),
            _ => Err(PlantError::Travel {
                aircraft: self.options.aircraft.clone(),
                property: property.to_owned(),
            }),
        }
    }

    /// Aileron and elevator where they come to rest at `command`, rad.
    fn stops(&mut self, command: f64) -> Result<[f64; 2], PlantError> {
        let inputs = Inputs { aileron: command, elevator: command, throttle: 0.0 };
        // Filters keep the step for which they were laid out; nothing else moves in so short a one.
        self.fdm.set_dt(super::nodes::STILL_S);
        let (mut last, mut at_rest) = ([f64::INFINITY; 2], 0);
        for _ in 0..STEPS {
            self.nodes.command(&mut self.fdm, &inputs).map_err(jsbsim("writing the commands"))?;
            self.fdm.run().map_err(jsbsim("measuring the travel of the surfaces"))?;
            let truth = self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the state"))?;
            let now = [truth.aileron_rad, truth.elevator_rad];
            let moved = now.iter().zip(&last).any(|(a, b)| (a - b).abs() >= STILL_RAD);
            at_rest = if moved { 0 } else { at_rest + 1 };
            if at_rest == AT_REST {
                break;
            }
            last = now;
        }
        Ok(last)
    }
}

//! Measures the travel of an aircraft's surfaces, that is their deflections at full command.

use super::lookup::look;
use super::{FULL_DEFLECTION_RAD, Inputs, Plant, PlantError, jsbsim};

/// Largest number of steps for an actuator to reach its stop while the aircraft is held: 20 s in steps of 10 ms.
const STEPS: usize = 2000;
/// Steps without movement after which a surface counts as being at its stop: 0.5 s in steps of 10 ms, longer than any delay of an
/// actuator.
const AT_REST: usize = 50;
/// Movement per step below which a surface counts as still, rad.
const STILL_RAD: f64 = 1e-12;
/// Travel below which a surface counts as fixed, rad.
const LEAST_RAD: f64 = 1e-3;
/// Largest difference to [`FULL_DEFLECTION_RAD`], rad, that counts as rounding: an actuator's filter stops slightly short of its
/// final value.
const ROUNDING_RAD: f64 = 1e-9;

/// Deflections of a surface at rest at full command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Deflection at the command −1, rad.
    pub least_rad: f64,
    /// Deflection at the command 1, rad.
    pub most_rad: f64,
}

impl Stops {
    /// Stops of equal deflection on both sides, rad.
    pub const fn symmetric(most_rad: f64) -> Stops {
        Stops { least_rad: -most_rad, most_rad }
    }

    /// The larger magnitude of both deflections, rad.
    pub fn largest_rad(&self) -> f64 {
        self.most_rad.abs().max(self.least_rad.abs())
    }
}

/// Travel of all surfaces of an aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Stops of the aileron.
    pub aileron: Stops,
    /// Stops of the elevator.
    pub elevator: Stops,
    /// Stops of the rudder; `None` for an aircraft without one.
    pub rudder: Option<Stops>,
}

impl Travel {
    /// Travel of the X8's surfaces: ±0.5235 rad.
    pub const X8: Travel = Travel {
        aileron: Stops::symmetric(FULL_DEFLECTION_RAD),
        elevator: Stops::symmetric(FULL_DEFLECTION_RAD),
        rudder: None,
    };
}

impl Default for Travel {
    fn default() -> Self {
        Travel::X8
    }
}

impl Plant {
    /// Measures the travel of the surfaces by full commands in both directions, with the aircraft held in its state. The state is
    /// then restored.
    ///
    /// # Errors
    /// [`PlantError::Travel`] if the aileron or elevator does not follow its command.
    pub fn travel(&mut self) -> Result<Travel, PlantError> {
        let before = self.snapshot()?;
        let measured = self.stops(1.0).and_then(|up| Ok((up, self.stops(-1.0)?)));
        self.fdm.set_dt(self.options.step_s);
        self.restore(&before)?;
        let (up, down) = measured?;
        let stops = |surface: usize| Stops {
            least_rad: rounded(down[surface]),
            most_rad: rounded(up[surface]),
        };
        let rudder = stops(2);
        Ok(Travel {
            aileron: self.checked(stops(0), self.aileron_position())?,
            elevator: self.checked(stops(1), &self.options.properties.elevator_position)?,
            rudder: (rudder.largest_rad() > LEAST_RAD).then_some(rudder),
        })
    }

    /// The property from which the aileron position is read.
    fn aileron_position(&self) -> &str {
        let named = &self.options.properties;
        match look(&self.fdm, &named.aileron_position) {
            Some(_) => &named.aileron_position,
            None => named.aileron_fallback(),
        }
    }

    fn checked(&self, stops: Stops, property: &str) -> Result<Stops, PlantError> {
        let travel = stops.largest_rad();
        if travel.is_finite() && travel > LEAST_RAD {
            return Ok(stops);
        }
        Err(PlantError::Travel {
            aircraft: self.options.aircraft.clone(),
            property: property.to_owned(),
        })
    }

    /// Deflections of aileron, elevator and rudder at rest at `command`, rad. Each control is commanded alone, because
    /// two controls of a V-tail or of elevons move the same surfaces, which would reach their stops too early.
    fn stops(&mut self, command: f64) -> Result<[f64; 3], PlantError> {
        let none = Inputs::default();
        Ok([
            self.rest(&Inputs { aileron: command, ..none })?[0],
            self.rest(&Inputs { elevator: command, ..none })?[1],
            self.rest(&Inputs { rudder: command, ..none })?[2],
        ])
    }

    /// Deflections of aileron, elevator and rudder at rest at `inputs`, rad.
    fn rest(&mut self, inputs: &Inputs) -> Result<[f64; 3], PlantError> {
        // Filters keep the step for which they were discretised; the state does not move in a step this short.
        self.fdm.set_dt(super::settling::STILL_S);
        self.come_to_rest(inputs, "measuring the travel of the surfaces")
    }

    /// Runs steps of the present length until the surfaces are at rest at `inputs`; returns their deflections, rad.
    pub(super) fn come_to_rest(
        &mut self,
        inputs: &Inputs,
        doing: &'static str,
    ) -> Result<[f64; 3], PlantError> {
        let (mut last, mut at_rest) = ([f64::INFINITY; 3], 0);
        for _ in 0..STEPS {
            self.nodes.command(&mut self.fdm, inputs).map_err(jsbsim("writing the commands"))?;
            self.fdm.run().map_err(jsbsim(doing))?;
            let truth = self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the state"))?;
            let now = [truth.aileron_rad, truth.elevator_rad, truth.rudder_rad];
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

/// Removes the rounding error of an actuator's filter from a deflection, rad.
fn rounded(deflection: f64) -> f64 {
    if (deflection.abs() - FULL_DEFLECTION_RAD).abs() < ROUNDING_RAD {
        return FULL_DEFLECTION_RAD.copysign(deflection);
    }
    deflection
}

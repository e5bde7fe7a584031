//! Check that the formula of an effect is finite in all flight conditions of an aircraft.
//!
//! A corner is a point at which each variable of the formula is at an end of its range.

use super::variable::Variable;
use super::written::Written;
use crate::airframe::Geometry;
use crate::effects::{Own, Terms};
use crate::point::Base;
use crate::rigid_body::ForceAxes;
use crate::{AirData, Channel, Controls, Point, State};

/// Number of variables up to which all corners are tried. A formula with more variables is tried at the same number of corners.
const ALL_CORNERS: usize = 12;

/// Receives terms and records whether all of them are finite.
struct Finite(bool);

impl Terms<f64> for Finite {
    fn add(&mut self, _: usize, _: Channel, amount: f64) {
        self.0 &= amount.is_finite();
    }
}

/// Checks that an effect is finite at the corners, in the middle of all ranges, and at zero.
///
/// The shape constants (coefficients in which the formula is nonlinear) first have the values of the file. The check is then
/// repeated with each of them in turn at each of its bounds, because a fit may reach a bound.
///
/// # Errors
/// If a term is not finite. The error states the point and the remedy.
pub fn check(effect: &Written) -> Result<(), String> {
    let linear = effect.about.coefficients.len() - effect.about.shape;
    let own = &effect.values[linear..];
    everywhere(effect, own)?;
    for (k, constant) in effect.about.coefficients[linear..].iter().enumerate() {
        for bound in [constant.bounds.0, constant.bounds.1] {
            let mut moved = own.to_vec();
            moved[k] = bound;
            everywhere(effect, &moved).map_err(|why| {
                format!("with {} at its bound {bound}, {why}; or narrow its bounds", constant.name)
            })?;
        }
    }
    Ok(())
}

/// Checks the effect at the corners, in the middle of all ranges, and at zero, with the shape constants `shape`.
fn everywhere(effect: &Written, shape: &[f64]) -> Result<(), String> {
    let variables = effect.variables();
    let tried = 1usize << variables.len().min(ALL_CORNERS);
    for corner in 0..tried {
        // bit k of `corner` selects the end of variable k's range; variables 13, 14, … use the bits of variables 1, 2, …
        let side = |k: usize| corner >> (k % ALL_CORNERS) & 1;
        try_at(effect, shape, &variables, |k, v| v.range()[side(k)])?;
    }
    try_at(effect, shape, &variables, |_, v| 0.5 * (v.range()[0] + v.range()[1]))?;
    try_at(effect, shape, &variables, |_, v| 0.0_f64.clamp(v.range()[0], v.range()[1]))
}

fn try_at(
    effect: &Written,
    shape: &[f64],
    variables: &[Variable],
    value: impl Fn(usize, Variable) -> f64,
) -> Result<(), String> {
    let mut place = Place::default();
    for (k, variable) in variables.iter().enumerate() {
        place.set(*variable, value(k, *variable));
    }
    let mut finite = Finite(true);
    place.visit(|at| effect.basis(at, Own { shape, ..Own::default() }, &mut finite));
    if finite.0 {
        return Ok(());
    }
    let words: Vec<String> = variables
        .iter()
        .enumerate()
        .map(|(k, v)| format!("{} = {}", v.name(), value(k, *v)))
        .collect();
    Err(format!(
        "the formula is not finite at {}; keep divisors and arguments of roots above zero with max",
        words.join(", ")
    ))
}

/// A point of evaluation whose variables can be set individually.
struct Place {
    state: State,
    controls: Controls,
    geometry: Geometry,
    altitude: f64,
    base: Base,
    air: [Option<f64>; 4],
}

impl Default for Place {
    fn default() -> Self {
        let geometry = Geometry { area: 0.75, span: 2.1, chord: 0.3571 };
        let (state, controls) = (State::NEUTRAL, Controls::default());
        Place { state, controls, geometry, altitude: 0.0, base: Base::zero(), air: [None; 4] }
    }
}

impl Place {
    fn set(&mut self, variable: Variable, x: f64) {
        use Variable as V;
        match variable {
            V::Roll => self.state.roll = x,
            V::Pitch => self.state.pitch = x,
            V::Airspeed => self.state.airspeed = x,
            V::RollRate => self.state.p = x,
            V::PitchRate => self.state.q = x,
            V::YawRate => self.state.r = x,
            V::Alpha => self.state.alpha = x,
            V::Beta => self.state.beta = x,
            V::Aileron => self.controls.aileron = x,
            V::Elevator => self.controls.elevator = x,
            V::Rudder => self.controls.rudder = x,
            V::Throttle => self.controls.throttle = x,
            V::RollRateHat => self.air[0] = Some(x),
            V::PitchRateHat => self.air[1] = Some(x),
            V::YawRateHat => self.air[2] = Some(x),
            V::Pressure => self.air[3] = Some(x),
            V::PressureArea => self.air[3] = Some(x / self.geometry.area),
            V::Altitude => self.altitude = x,
            V::Area => self.geometry.area = x,
            V::Span => self.geometry.span = x,
            V::Chord => self.geometry.chord = x,
            V::Thrust => self.base.wrench.add(Channel::BodyX, x),
            V::Lift => self.base.wrench.add(Channel::Lift, x),
            V::AlphaRate => self.base.rate.alpha = x,
            V::BetaRate => self.base.rate.beta = x,
        }
    }

    fn visit(&self, of: impl FnOnce(&Point)) {
        let mut air = AirData::new(&self.state, 1.2, self.altitude, &self.geometry);
        let [p, q, r, pressure] = self.air;
        air.p_hat = p.unwrap_or(air.p_hat);
        air.q_hat = q.unwrap_or(air.q_hat);
        air.r_hat = r.unwrap_or(air.r_hat);
        air.q_s = pressure.map_or(air.q_s, |pressure| pressure * self.geometry.area);
        of(&Point {
            state: &self.state,
            controls: &self.controls,
            air: &air,
            geometry: &self.geometry,
            axes: ForceAxes::Wind,
            base: &self.base,
        });
    }
}

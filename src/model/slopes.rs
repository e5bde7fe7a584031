//! Steps of a model with derivatives with respect to its coefficients, the initial state and the controls, by dual numbers.
//!
//! The equations are compiled for eight derivatives at a time and for one instruction set, because each further copy adds
//! seconds to the compilation.

use super::calls::Forces;
use super::forces::{Place, Sum, Weights, parted};
use super::grey_box::Named;
use super::{GreyBox, Memory, Residual};
use greylag_num::{Dual, Real};
use greylag_physics::effects::Needs;
use greylag_physics::rigid_body::Vector;
use greylag_physics::{AirData, Controls, State, Wrench};

/// Number of derivatives of a [`Sloped`] number.
pub const SLOPES: usize = 8;

/// A number with its derivatives with respect to [`SLOPES`] variables.
pub type Sloped = Dual<SLOPES>;

/// Coefficients of which some are variables.
#[derive(Clone, Copy)]
struct Varied<'a> {
    coefficients: &'a [Named],
    /// For each coefficient, its index among the variables; `None` for a constant.
    variables: &'a [Option<usize>],
}

impl Weights<Sloped> for Varied<'_> {
    #[inline(always)]
    fn weigh(self, place: usize, amount: Sloped) -> Sloped {
        let mut product = amount.scale(self.coefficients[place].value);
        if let Some(variable) = self.variables[place] {
            product.gradient[variable] += amount.value;
        }
        product
    }
}

/// Evaluates the equations with derivatives with respect to coefficients. The list is that of [`Varied`].
#[derive(Clone, Copy)]
struct ByCoefficients<'a>(&'a [Option<usize>]);

impl Forces<Sloped> for ByCoefficients<'_> {
    #[inline(never)]
    fn accelerations(
        self,
        model: &GreyBox,
        state: &State<Sloped>,
        controls: &Controls<Sloped>,
        air: &AirData<Sloped>,
    ) -> (Vector<Sloped>, Vector<Sloped>) {
        let weights = Varied { coefficients: &model.coefficients, variables: self.0 };
        let wrench = model.varied_wrench(&Place { state, controls, air }, weights);
        model.accelerations_under(&wrench, state, air)
    }

    #[inline(never)]
    fn learned(
        self,
        residual: &Residual,
        state: &State<Sloped>,
        controls: &Controls<Sloped>,
    ) -> State<Sloped> {
        residual.rate(state, controls)
    }
}

impl GreyBox {
    /// Returns the state one [`STEP`](crate::STEP) later, as [`step`](GreyBox::step) does, with its derivatives.
    ///
    /// `variables` holds, for each coefficient in the order of [`coefficients`](GreyBox::coefficients), its index among the
    /// variables, or `None` for a constant. A variable coefficient must be one that multiplies a term of the forces and moments:
    /// one in which the model is linear, and which changes neither the controls nor mass and inertia. Derivatives with respect
    /// to other variables enter through `state` and `controls`. `memory` is updated.
    pub fn step_sloped(
        &self,
        variables: &[Option<usize>],
        state: &State<Sloped>,
        controls: &Controls<Sloped>,
        altitude: f64,
        memory: &mut Memory<Sloped>,
    ) -> State<Sloped> {
        self.step_from(state, controls, altitude, memory, ByCoefficients(variables))
    }

    fn varied_wrench(&self, place: &Place<Sloped>, weights: Varied) -> Wrench<Sloped> {
        let wrench = self.varied_sum(place, weights);
        if self.independent == self.terms.len() {
            return wrench;
        }
        let parts = (self.needs() >= Needs::Parts).then(|| {
            parted(place.state, place.controls, place.air).map(|(state, controls, air)| {
                let place = Place { state: &state, controls: &controls, air: &air };
                self.varied_sum(&place, weights)
            })
        });
        self.completed(place, wrench, parts, weights).1
    }

    /// Sum of the effects that need only the point.
    #[inline(never)]
    fn varied_sum(&self, place: &Place<Sloped>, weights: Varied) -> Wrench<Sloped> {
        let mut sum = Sum { weights, first: 0, wrench: Wrench::zero() };
        self.independent_terms(place, &mut sum);
        sum.wrench
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Integrator;

    /// Number of steps of a run. The integrator of JSBSim uses its memory from the second step on.
    const STEPS: usize = 4;
    const STATE: [f64; 8] = [0.3, 0.1, 18.0, 0.4, -0.2, 0.1, 0.05, 0.03];
    const CONTROLS: Controls =
        Controls { aileron: 0.05, elevator: -0.04, throttle: 0.6, rudder: 0.0, lagged: None };

    /// The state after a run from `STATE`, where the angle of attack and the elevator are increased by `by`.
    fn flown(model: &GreyBox, by: [f64; 2]) -> [f64; 8] {
        let mut state = State::from_array(STATE);
        state.alpha += by[0];
        let controls = Controls { elevator: CONTROLS.elevator + by[1], ..CONTROLS };
        let mut memory = Memory::default();
        for _ in 0..STEPS {
            state = model.step(&state, &controls, 100.0, &mut memory);
        }
        state.to_array()
    }

    /// The same with derivatives with respect to the coefficients `names`, then angle of attack and elevator.
    fn sloped(model: &GreyBox, names: [&str; 3]) -> [Sloped; 8] {
        let place = |name: &str| names.iter().position(|n| *n == name);
        let variables: Vec<Option<usize>> =
            model.coefficients().iter().map(|c| place(&c.name)).collect();
        let mut state = State::from_array(STATE.map(Sloped::from_f64));
        state.alpha.gradient[3] = 1.0;
        let mut controls = CONTROLS.map(Sloped::from_f64);
        controls.elevator.gradient[4] = 1.0;
        let mut memory = Memory::default();
        for _ in 0..STEPS {
            state = model.step_sloped(&variables, &state, &controls, 100.0, &mut memory);
        }
        state.to_array()
    }

    #[test]
    fn derivatives_of_a_run_agree_with_finite_differences() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/x8/jsbsim.toml");
        let mut model = GreyBox::load(std::path::Path::new(path)).unwrap();
        let names = ["roll_linear.Clp", "pitch_linear.Cmq", "thrust_linear.Cp_n"];
        let value =
            |name: &str| model.coefficients().iter().find(|c| c.name == name).unwrap().value;
        let values = names.map(value);
        for integrator in [Integrator::Jsbsim, Integrator::Rk4] {
            model.integrator = integrator;
            let found = sloped(&model, names);
            let here = flown(&model, [0.0; 2]);
            assert_eq!(found.map(|x| x.value), here);
            let steps = values.map(|value| 1e-4 * value.abs()).into_iter().chain([1e-5; 2]);
            for (variable, step) in steps.enumerate() {
                let moved = |by: f64| {
                    let mut moved = model.clone();
                    if let Some(name) = names.get(variable) {
                        moved.set_coefficient(name, values[variable] + by);
                    }
                    let by = |place: usize| if variable == place { by } else { 0.0 };
                    flown(&moved, [by(3), by(4)])
                };
                let pairs = moved(-step).into_iter().zip(moved(step));
                for (x, (low, high)) in found.iter().zip(pairs) {
                    let slope = (high - low) / (2.0 * step);
                    let error = (x.gradient[variable] - slope).abs();
                    assert!(error < 1e-6 + 1e-4 * slope.abs(), "{variable}: {error} {slope}");
                }
            }
        }
    }
}

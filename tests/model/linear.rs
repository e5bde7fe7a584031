//! The linear model of a step: one evaluation in vector registers against several with fewer derivatives.

use std::path::Path;

use greylag::model::{GreyBox, Memory, Trim, linearise_step};
use greylag::num::{Dual, Real};
use greylag::physics::{Controls, State};
use nalgebra::SMatrix;

/// The derivatives of a step with respect to input `first` (of eight states and four controls) and the three after it, as
/// rows of the next state.
fn four(model: &GreyBox, x: &[f64; 12], first: usize) -> [[f64; 4]; 8] {
    let x: [Dual<4>; 12] = std::array::from_fn(|i| match i.checked_sub(first) {
        Some(place) if place < 4 => Dual::variable(x[i], place),
        _ => Dual::from_f64(x[i]),
    });
    let state = State::from_array(std::array::from_fn(|i| x[i]));
    let [aileron, elevator, throttle, rudder] = [x[8], x[9], x[10], x[11]];
    let controls = Controls { aileron, elevator, throttle, rudder, lagged: None };
    let next = model.step(&state, &controls, 100.0, &mut Memory::default());
    next.to_array().map(|component| component.gradient)
}

#[test]
fn all_inputs_at_once_give_the_bits_of_four_at_a_time() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    for file in ["x8/learned/model.toml", "x8/prior.toml", "aerosonde/prior.toml"] {
        let model = GreyBox::load(&folder.join(file)).unwrap();
        let trim = Trim::straight(&model, model.airframe.reference.airspeed, 100.0).unwrap();
        let (mut state, controls) = (trim.state, trim.controls);
        for turn in 0..8 {
            let mut x = [controls.rudder; 12];
            x[..8].copy_from_slice(&state.to_array());
            x[8..11].copy_from_slice(&[controls.aileron, controls.elevator, controls.throttle]);
            let parts = [0, 4, 8].map(|first| four(&model, &x, first));
            let linear = linearise_step(&model, &state, &controls, 100.0);
            let part = |row: usize, column: usize| parts[column / 4][row][column % 4];
            // on a processor without AVX2 both are the same code
            assert_eq!(linear.a, SMatrix::<f64, 8, 8>::from_fn(part), "{file}");
            assert_eq!(linear.b, SMatrix::<f64, 8, 4>::from_fn(|i, j| part(i, 8 + j)), "{file}");
            state.roll += 0.2;
            state.alpha += 0.03 * f64::from(turn);
            state.q -= 0.3;
        }
    }
}

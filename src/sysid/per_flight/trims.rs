//! Trims of a flight: constants that are added to the force and moment coefficients of a model, and a relative change of the
//! thrust. They differ between flights of one aircraft, for example because of its loading.
//!
//! The trims are added to a model as an effect (a group of terms) that is not in the catalogue of effects to be searched for. The
//! model need not have coefficients with these names.

use greylag_model::{GreyBox, JoinError};
use greylag_physics::formula::register;

/// A trim with its prior standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    /// Name of the trim: the coefficient to which it is added, or `thrust_share`.
    pub name: &'static str,
    /// Prior standard deviation between flights of one aircraft, dimensionless.
    pub width: f64,
}

const fn trim(name: &'static str, width: f64) -> Trim {
    Trim { name, width }
}

/// The trims in the order of the effect's coefficients, with their prior standard deviations.
///
/// They allow for the following causes:
/// - Lift: half a degree of incidence of a wing that was mounted again, at a lift slope of 4 to 5 per rad.
/// - Pitch: a shift of the centre of gravity by 1 to 2 % of the chord at a lift coefficient of 0.5, or half a degree of elevator.
/// - Roll and yaw: a degree of one surface.
/// - Side force: two degrees of a fin.
/// - Drag: a hatch, tape or a dirty wing.
/// - Thrust: the square of the voltage between a full and a half empty battery, or another propeller.
pub const TRIMS: [Trim; 7] = [
    trim("CD0", 0.005),
    trim("CL0", 0.03),
    trim("CY0", 0.01),
    trim("Cl0", 0.003),
    trim("Cm0", 0.01),
    trim("Cn0", 0.003),
    trim("thrust_share", 0.1),
];

const ID: &str = "flight_trims";

/// Returns `model` with the trims as its last coefficients. Their values are zero.
///
/// # Errors
/// The model already has the effect `flight_trims`.
pub fn joined(model: &GreyBox) -> Result<GreyBox, JoinError> {
    // an error in this built-in text needs no report here: without the effect, `join` fails
    let _ = register::read(include_str!("flight_trims.toml"));
    let mut with = model.clone();
    with.join(ID, &[0.0; TRIMS.len()])?;
    Ok(with)
}

/// Sets the trims of `model`, which [`joined`] has returned, to `values` in the order of `TRIMS`.
pub fn set(model: &mut GreyBox, values: &[f64]) {
    let mut all: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
    let first = all.len().saturating_sub(values.len());
    all[first..].copy_from_slice(values);
    model.set_coefficients(&all);
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::{Channel, Controls, State};

    #[test]
    fn trims_stand_behind_the_models_coefficients_in_their_order() {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let mut with = joined(&model).unwrap();
        let count = model.coefficients().len();
        let names: Vec<&str> =
            with.coefficients()[count..].iter().map(|c| c.name.as_str()).collect();
        let expected: Vec<String> = TRIMS.iter().map(|t| format!("{ID}.{}", t.name)).collect();
        assert_eq!(names, expected);
        let state = State::from_array([0.1, 0.1, 18.0, 0.1, 0.1, 0.1, 0.05, 0.02]);
        let controls =
            Controls { aileron: 0.0, elevator: 0.02, throttle: 0.5, rudder: 0.0, lagged: None };
        let air = model.air(&state, 100.0);
        let before = model.wrench(&state, &controls, &air);
        assert_eq!(with.wrench(&state, &controls, &air), before);
        set(&mut with, &[0.0, 0.03, 0.0, 0.0, 0.01, 0.0, -0.1]);
        let after = with.wrench(&state, &controls, &air);
        let added = |c: Channel| after.get(c) - before.get(c);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(close(added(Channel::Lift), 0.03 * air.q_s));
        assert!(close(added(Channel::Pitch), 0.01 * air.q_s * model.airframe.geometry.chord));
        assert!(close(added(Channel::BodyX), -0.1 * before.get(Channel::BodyX)));
        assert!(close(added(Channel::Roll), 0.0));
    }
}

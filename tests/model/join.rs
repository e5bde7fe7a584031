//! Effects that join a model, and those that are refused.

use std::path::Path;

use greylag::model::{GreyBox, JoinError};
use greylag::physics::State;
use greylag::physics::{Channel, Controls};

fn model() -> GreyBox {
    shipped("jsbsim")
}

fn shipped(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(name).with_extension("toml")).unwrap()
}

/// Joins, and asserts that a refusal leaves the model as it was.
fn refused(model: &mut GreyBox, id: &str, values: &[f64]) -> JoinError {
    let (before, rate) = (model.coefficients().to_vec(), whole(model));
    let error = model.join(id, values).unwrap_err();
    assert_eq!(model.coefficients(), before);
    assert_eq!(whole(model), rate);
    println!("{error}");
    error
}

fn whole(model: &GreyBox) -> State {
    let controls =
        Controls { aileron: 0.1, elevator: 0.05, throttle: 0.4, rudder: 0.0, lagged: None };
    model.rate(&State { alpha: 0.1, q: 0.3, ..State::NEUTRAL }, &controls, 600.0)
}

#[test]
fn what_cannot_join_is_refused_and_changes_nothing() {
    let mut m = model();
    assert!(matches!(refused(&mut m, "drag_alpha3", &[1.0]), JoinError::Unknown { .. }));
    assert!(matches!(refused(&mut m, "drag_beta2", &[0.0, 1.0]), JoinError::Present { .. }));
    assert!(matches!(refused(&mut m, "lift_linear", &[0.0; 4]), JoinError::Present { .. }));
    for values in [&[][..], &[1.0, 2.0], &[f64::NAN], &[f64::INFINITY], &[-1.0], &[11.0]] {
        let error = refused(&mut m, "drag_alpha2", values);
        assert!(matches!(error, JoinError::Values { .. }), "{values:?}");
    }
    let text = refused(&mut m, "thrust_scale", &[2e3]).to_string();
    assert!(text.contains("dCp_n in -1000..1000 N"), "{text}");
}

#[test]
fn an_effect_with_a_table_needs_a_file() {
    let mut m = shipped("prior");
    assert!(matches!(refused(&mut m, "lift_table", &[1.0]), JoinError::Table { .. }));
}

/// jx·jz = 1.0825, so Jxz = −0.9343 + ΔJxz must stay within ±1.0404.
#[test]
fn an_inertia_that_no_body_has_is_refused() {
    let mut m = model();
    assert!(matches!(refused(&mut m, "inertia_xz", &[-0.2]), JoinError::Body { .. }));
    assert!(matches!(refused(&mut m, "inertia_xz", &[2.0]), JoinError::Body { .. }));
    m.join("inertia_xz", &[-0.1]).unwrap();
    assert!((m.body.jxz + 1.0343).abs() < 1e-12);
}

#[test]
fn a_model_has_room_for_three_effects_on_its_inputs() {
    let mut m = model();
    m.join("actuator_lag", &[0.04]).unwrap();
    m.join("dead_zone", &[0.02]).unwrap();
    m.join("time_delay", &[0.03]).unwrap();
    assert!(matches!(refused(&mut m, "backlash", &[0.02]), JoinError::Inputs { .. }));
}

#[test]
fn coefficients_of_a_joined_effect_are_its_own() {
    let mut m = model();
    let plain = whole(&m);
    m.join("mass_error", &[0.25]).unwrap();
    assert!((m.body.mass - 1.25 * 3.364).abs() < 1e-12);
    assert!(m.has("mass_error") && !m.has("cg_shift"));
    assert_ne!(whole(&m), plain);
    // back to nothing, the model is what it was to the bit
    assert!(m.set_coefficient("mass_error.k", 0.0));
    assert_eq!(whole(&m), plain);
    assert!(!m.set_coefficient("mass_error.q", 0.0));
    assert!(m.linear().iter().zip(m.coefficients()).all(|(linear, _)| *linear));
    m.join("lift_stall", &[1.0, 0.2, 50.0]).unwrap();
    let linear: Vec<_> = m.coefficients().iter().zip(m.linear()).rev().take(3).collect();
    assert_eq!(linear.iter().map(|(_, l)| *l).collect::<Vec<_>>(), [false, false, true]);
}

#[test]
fn what_an_effect_replaces_is_zero_and_held() {
    let mut model = shipped("prior");
    let signed = |model: &GreyBox| {
        let named = model.coefficients().iter().find(|c| c.name == "drag_linear.CDde").unwrap();
        (named.value, named.width())
    };
    assert!(signed(&model).0 > 0.0 && signed(&model).1 > 0.0);
    assert_eq!(model.replaced("drag_linear.CDde"), None);
    model.join("drag_elevator_abs", &[0.06]).unwrap();
    assert_eq!(signed(&model), (0.0, 0.0));
    assert_eq!(model.replaced("drag_linear.CDde"), Some("drag_elevator_abs"));
    assert_eq!(model.replaced("drag_linear.CD0"), None);
    // a file that has both has them for a reason
    model.set_coefficient("drag_linear.CDde", 0.03);
    assert_eq!(model.replaced("drag_linear.CDde"), None);
}

#[test]
fn an_inertia_that_overshoots_joins_as_far_as_a_body_bears() {
    let start = shipped("prior-as-printed");
    // +0.9343 less 1.99 would be −1.056, and 1.0404 that of a rod
    assert!(matches!(start.clone().join("inertia_xz", &[-1.99]), Err(JoinError::Body { .. })));
    let mut joined = start.clone();
    joined.join_most("inertia_xz", &[-1.99]).unwrap();
    let room = |m: &GreyBox| 1.0 - m.body.jxz * m.body.jxz / (m.body.jx * m.body.jz);
    assert!(joined.body.jxz < -0.95, "{}", joined.body.jxz);
    assert!(room(&joined) >= room(&start) / 3.0, "{}", room(&joined));
    // what a body bears joins as it is
    let mut exact = start.clone();
    exact.join_most("inertia_xz", &[-1.8686]).unwrap();
    assert_eq!(exact.body.jxz, 0.9343 - 1.8686);
    let values = exact.join_most("thrust_scale", &[f64::NAN]);
    assert!(matches!(values, Err(JoinError::Values { .. })));
}

/// A stall puts a flat plate in the place of the lift; what a curve adds to that stays.
#[test]
fn a_curve_of_lift_counts_beyond_the_stall() {
    let mut stalled = shipped("prior");
    stalled.join("lift_stall", &[1.0, 0.26, 42.0]).unwrap();
    let lift = |model: &GreyBox| {
        let state = State { alpha: 20_f64.to_radians(), ..State::NEUTRAL };
        let air = model.air(&state, 600.0);
        (model.wrench(&state, &Controls::default(), &air).get(Channel::Lift), air.q_s)
    };
    let mut curved = stalled.clone();
    curved.join("lift_curve", &[0.0; 23]).unwrap();
    curved.set_coefficient("lift_curve.CL_p20", 0.08);
    let ((before, _), (after, q_s)) = (lift(&stalled), lift(&curved));
    assert!((after - before - 0.08 * q_s).abs() < 1e-9, "{before} {after}");
}

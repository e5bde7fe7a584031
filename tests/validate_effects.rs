//! Every effect of the catalogue against JSBSim with the same effect hidden in it.
#![cfg(feature = "sitl")]

mod validate_support;

use greylag::model::GreyBox;
use greylag::physics::inputs::{self, InputMemory};
use greylag::physics::{Command, Controls};
use greylag_sitl::hidden::{EFFECTS, Hidden};
use validate_support::{
    controls, histories, inputs as sent, model, plant, rate_on_turning_earth, simulator_rate, state,
};

/// Amplitudes several times what two minutes of flight show, so that an error of the formula cannot
/// hide in the tolerance.
const AMPLITUDES: [(&str, f64); 24] = [
    ("drag_alpha2", 1.5),
    ("drag_beta2", 0.7),
    ("drag_elevator_abs", 0.3),
    ("pitch_break", -3.0),
    ("cg_shift", 0.02),
    ("unsteady_lift", 3.0),
    ("thrust_decay", 0.6),
    ("thrust_scale", -5.0),
    ("thrust_line_offset", 0.03),
    ("motor_torque", 0.5),
    ("propeller_gyro", 0.05),
    ("propwash", 0.8),
    ("aeroelastic_loss", 0.2),
    ("actuator_lag", 0.04),
    ("time_delay", 0.05),
    ("dead_zone", 0.02),
    ("backlash", 0.02),
    ("rate_limit", 0.5),
    ("mass_error", 0.25),
    ("inertia_xz", 0.3),
    ("asymmetry", 0.004),
    ("dihedral_alpha", -0.8),
    ("roll_control_alpha", -0.6),
    ("effectiveness_saturation", -2.0),
];

/// The reference model with the effect at the amplitude that JSBSim hides.
fn amended(id: &str, amplitude: f64) -> GreyBox {
    let mut model = model("jsbsim");
    let add = |model: &mut GreyBox, name: &str| {
        let before = model.coefficients().iter().find(|c| c.name == name).unwrap().value;
        assert!(model.set_coefficient(name, before + amplitude));
    };
    match id {
        // the reference model has these two already
        "drag_beta2" => add(&mut model, "drag_beta2.CDbeta2"),
        "drag_elevator_abs" => add(&mut model, "drag_elevator_abs.CDde"),
        "unsteady_lift" => model.join(id, &[amplitude, -0.5 * amplitude]).unwrap(),
        "asymmetry" => model.join(id, &[amplitude; 3]).unwrap(),
        "roll_control_alpha" => model.join(id, &[amplitude, 0.0]).unwrap(),
        _ => model.join(id, &[amplitude]).unwrap(),
    }
    model
}

/// How far a model's rates are from JSBSim's, scaled by x_c, 1/s.
#[derive(Default)]
struct Gap {
    squares: f64,
    largest: f64,
    points: u32,
    /// Largest with the turning earth taken into account.
    explained: f64,
    /// Largest difference between deflections that act, rad.
    acting: f64,
}

impl Gap {
    fn rms(&self) -> f64 {
        (self.squares / f64::from(self.points)).sqrt()
    }
}

/// Flies `commands` in JSBSim with `hidden` in it, `model` beside it.
fn fly(model: &GreyBox, hidden: &[Hidden], commands: &[Command], gap: &mut Gap) {
    let scale = model.scale();
    let mut plant = plant(hidden);
    let mut memory = InputMemory::at_rest(&Controls::default());
    for command in commands {
        let truth = plant.step(sent(command)).unwrap();
        let acting = model.act(&controls(&truth), &mut memory);
        if !model.acts_at_once() {
            let theirs =
                ["aileron", "elevator"].map(|s| plant.property(&format!("hidden/{s}-1")).unwrap());
            let apart = (acting.aileron - theirs[0]).abs().max((acting.elevator - theirs[1]).abs());
            gap.acting = gap.acting.max(apart);
        }
        let theirs = simulator_rate(&mut plant, &truth);
        let error = |ours: [f64; 8]| -> f64 {
            (0..8).map(|i| ((ours[i] - theirs[i]) / scale[i]).powi(2)).sum()
        };
        let flat = error(model.rate(&state(&truth), &acting, truth.altitude_m).to_array());
        gap.squares += flat;
        gap.largest = gap.largest.max(flat.sqrt());
        gap.points += 1;
        let round = rate_on_turning_earth(model, &truth, &acting);
        gap.explained = gap.explained.max(error(round).sqrt());
    }
}

#[test]
fn validate_every_effect_that_can_be_hidden() {
    let ids: Vec<_> = EFFECTS.iter().map(|e| e.id).collect();
    assert_eq!(ids.len(), AMPLITUDES.len());
    let plain = model("jsbsim");
    let histories = histories();
    for (id, amplitude) in AMPLITUDES {
        let hidden = [Hidden::new(id, amplitude).unwrap()];
        let with = amended(id, amplitude);
        let (mut before, mut after) = (Gap::default(), Gap::default());
        for (_, commands) in &histories {
            fly(&plain, &hidden, commands, &mut before);
            fly(&with, &hidden, commands, &mut after);
        }
        println!(
            "{id:25} {amplitude:6}: rms {:.2e} 1/s, {:.2e} without it; largest {:.2e}, with the turning \
             earth {:.2e}; acting deflections within {:.1e} rad",
            after.rms(),
            before.rms(),
            after.largest,
            after.explained,
            after.acting
        );
    }
}

//! Signature of an effect (a physical contribution to forces and moments). It consists of curves. They show how the effect
//! changes forces and moments over one variable at a time (a sweep), and how it changes the response of the aircraft to a
//! manoeuvre.

use greylag_model::{GreyBox, JoinError, STEP, Trim, TrimError, Twin};
use greylag_physics::effects::Description;
use greylag_physics::rigid_body;
use greylag_physics::{Command, Controls, State};

/// Altitude at which signatures are computed, m. Simulated flights start at the same altitude.
const ALTITUDE: f64 = 600.0;

/// Largest number of sweeps in a signature. The sweeps with the largest changes are selected.
const SWEEPS: usize = 4;

/// Largest number of states that are shown for the manoeuvre. The states with the largest changes are selected.
const STATES: usize = 4;

/// Number of points of a sweep.
const POINTS: usize = 121;

/// Largest negligible change, as a fraction of the range that the quantity has without the effect.
const NOTHING: f64 = 1e-4;

/// Reason why a signature cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum SignatureError {
    /// The effect cannot be added to the model.
    #[error(transparent)]
    Join(#[from] JoinError),
    /// The model has no level trim.
    #[error(transparent)]
    Trim(#[from] TrimError),
    /// The effect is a measurement error, which changes no force.
    #[error(
        "{id} is an error of the measurement: it changes no force, and the reconstruction of a flight decides it"
    )]
    Measurement {
        /// Identifier of the effect.
        id: &'static str,
    },
}

/// Curves of a model without and with an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Signature {
    /// Forces and moments over one variable at a time, the largest change first.
    pub sweeps: Vec<Pair>,
    /// States over time in the [`MANOEUVRE`], the largest change first.
    pub manoeuvre: Vec<Pair>,
}

/// A curve of one quantity over another, without and with the effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Label of the horizontal axis, with its unit.
    pub x_label: &'static str,
    /// Label of the vertical axis, with its unit.
    pub y_label: &'static str,
    /// Values of the horizontal quantity.
    pub x: Vec<f64>,
    /// Vertical values without the effect.
    pub without: Vec<f64>,
    /// Vertical values with the effect.
    pub with: Vec<f64>,
}

/// The manoeuvre of [`Signature::manoeuvre`], in words.
pub const MANOEUVRE: &str = "From level flight: 3-2-1-1 on the elevator from 0.5 s, a doublet of the aileron from \
     4 s, full throttle from 6 s to 8 s, a doublet of the rudder from 8 s.";

/// Labels of the quantities that an effect may change, with their units.
const CHANNELS: [&str; 6] = [
    "drag less thrust by mass, m/s²",
    "lift by mass, m/s²",
    "side force by mass, m/s²",
    "roll acceleration, rad/s²",
    "pitch acceleration, rad/s²",
    "yaw acceleration, rad/s²",
];

const STATE_LABELS: [&str; 8] = [
    "roll, °",
    "pitch, °",
    "airspeed, m/s",
    "p, °/s",
    "q, °/s",
    "r, °/s",
    "angle of attack, °",
    "sideslip, °",
];

/// Flight condition at which accelerations are computed; the altitude is in m.
#[derive(Clone, Copy)]
struct Condition {
    state: State,
    controls: Controls,
    altitude: f64,
}

/// A variable to sweep: label, range in the label's unit, setter.
type Variable = (&'static str, [f64; 2], fn(&mut Condition, f64));

const VARIABLES: [Variable; 12] = [
    ("angle of attack, °", [-25.0, 25.0], |c, x| c.state.alpha = x.to_radians()),
    ("sideslip, °", [-20.0, 20.0], |c, x| c.state.beta = x.to_radians()),
    ("airspeed, m/s", [12.0, 35.0], |c, x| c.state.airspeed = x),
    ("roll, °", [-75.0, 75.0], |c, x| c.state.roll = x.to_radians()),
    ("p, °/s", [-120.0, 120.0], |c, x| c.state.p = x.to_radians()),
    ("q, °/s", [-120.0, 120.0], |c, x| c.state.q = x.to_radians()),
    ("r, °/s", [-120.0, 120.0], |c, x| c.state.r = x.to_radians()),
    ("aileron, °", [-30.0, 30.0], |c, x| c.controls.aileron = x.to_radians()),
    ("elevator, °", [-30.0, 30.0], |c, x| c.controls.elevator = x.to_radians()),
    ("throttle", [0.0, 1.0], |c, x| c.controls.throttle = x),
    ("rudder, °", [-30.0, 30.0], |c, x| c.controls.rudder = x.to_radians()),
    ("altitude, m", [600.0, 607.0], |c, x| c.altitude = x),
];

/// Computes the signature of the effect `about` with the coefficients `values`. If `model` already has the effect, the
/// comparison is with zero coefficients.
///
/// # Errors
/// If the effect is a measurement error or cannot be added to the model, or if the model has no level trim at the airframe's
/// cruise airspeed.
pub fn signature(
    model: &GreyBox,
    about: &Description,
    values: &[f64],
) -> Result<Signature, SignatureError> {
    if about.entry.is_some_and(|entry| entry.example.is_empty()) {
        return Err(SignatureError::Measurement { id: about.id });
    }
    let mut models = [model.clone(), model.clone()];
    if model.has(about.id) {
        set(&mut models[0], about, &vec![0.0; values.len()]);
        set(&mut models[1], about, values);
    } else {
        models[1].join(about.id, values)?;
    }
    let trim = Trim::straight(&models[0], model.airframe.envelope.airspeed_cruise_mps, ALTITUDE)?;
    Ok(Signature { sweeps: sweeps(&models, &trim), manoeuvre: manoeuvre(&models, &trim) })
}

/// Sets the coefficients of the effect `about` in `model`.
fn set(model: &mut GreyBox, about: &Description, values: &[f64]) {
    for (c, value) in about.coefficients.iter().zip(values) {
        model.set_coefficient(&format!("{}.{}", about.id, c.name), *value);
    }
}

fn sweeps(models: &[GreyBox; 2], trim: &Trim) -> Vec<Pair> {
    // sideslip (rad), rates (rad/s) and aileron (rad) are not zero, because effects that depend on their products would
    // otherwise be invisible
    let state = State { beta: 0.07, p: 0.4, q: 0.3, r: 0.3, ..trim.state };
    let controls = Controls { aileron: 0.1, ..trim.controls };
    let from = Condition { state, controls, altitude: ALTITUDE };
    let mut all = Vec::new();
    for (x_label, [low, high], set) in VARIABLES {
        let x: Vec<f64> =
            (0..POINTS).map(|i| low + (high - low) * i as f64 / (POINTS - 1) as f64).collect();
        let made = |model: &GreyBox| -> Vec<[f64; 6]> {
            let at = |x: &f64| {
                let mut condition = from;
                set(&mut condition, *x);
                accelerations(model, &condition)
            };
            x.iter().map(at).collect()
        };
        let [without, with] = [made(&models[0]), made(&models[1])];
        for (k, y_label) in CHANNELS.into_iter().enumerate() {
            let of = |made: &[[f64; 6]]| made.iter().map(|m| m[k]).collect();
            let (without, with) = (of(&without), of(&with));
            all.push(Pair { x_label, y_label, x: x.clone(), without, with });
        }
    }
    plainest(all, SWEEPS)
}

/// Values of [`CHANNELS`] at a flight condition.
fn accelerations(model: &GreyBox, at: &Condition) -> [f64; 6] {
    let air = model.air(&at.state, at.altitude);
    let (acceleration, [l, m, n]) = model.accelerations(&at.state, &at.controls, &air);
    let gravity = rigid_body::gravity_in_body(&at.state, model.atmosphere.gravity);
    let force = std::array::from_fn(|i| acceleration[i] - gravity[i]);
    let [drag, side, lift] = rigid_body::aerodynamic_force(force, &air, model.axes);
    [drag, lift, side, l, m, n]
}

fn manoeuvre(models: &[GreyBox; 2], trim: &Trim) -> Vec<Pair> {
    let time: Vec<f64> = (0..1000).map(|k| k as f64 * STEP).collect();
    let fly = |model: &GreyBox| -> Vec<[f64; 8]> {
        let mut twin = Twin::at_rest(trim.state, &trim.controls, ALTITUDE);
        time.iter()
            .map(|t| {
                let seen = twin.state.to_array();
                twin.step(model, &command(model, trim, *t));
                seen
            })
            .collect()
    };
    let [without, with] = [fly(&models[0]), fly(&models[1])];
    let pairs = STATE_LABELS.into_iter().enumerate().map(|(k, y_label)| {
        let unit = |x: f64| if k == 2 { x } else { x.to_degrees() };
        let of = |flown: &[[f64; 8]]| flown.iter().map(|s| unit(s[k])).collect();
        let (without, with) = (of(&without), of(&with));
        Pair { x_label: "time, s", y_label, x: time.clone(), without, with }
    });
    plainest(pairs.collect(), STATES)
}

/// Command of [`MANOEUVRE`] at `time` (s).
fn command(model: &GreyBox, trim: &Trim, time: f64) -> Command {
    let level = model.airframe.actuators.command(&trim.controls);
    let pulse = |from: f64, to: f64| if (from..to).contains(&time) { 1.0 } else { 0.0 };
    let elevator = pulse(0.5, 1.4) - pulse(1.4, 2.0) + pulse(2.0, 2.3) - pulse(2.3, 2.6);
    let aileron = pulse(4.0, 4.4) - pulse(4.4, 4.8);
    Command {
        aileron: level.aileron + 0.3 * aileron,
        elevator: level.elevator + 0.2 * elevator,
        throttle: trim.controls.throttle.max(pulse(6.0, 8.0)),
        rudder: level.rudder + 0.3 * (pulse(8.0, 8.4) - pulse(8.4, 8.8)),
    }
    .clamped()
}

/// Selects the `most` pairs with the largest changes and sorts them in descending order. A change is divided by the
/// largest range that the vertical quantity has without the effect in any pair.
fn plainest(all: Vec<Pair>, most: usize) -> Vec<Pair> {
    let extent = |values: &[f64]| {
        let fold = |f: fn(f64, f64) -> f64, start| values.iter().copied().fold(start, f);
        let (low, high) = (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY));
        high - low
    };
    let range = |y_label: &str| {
        let of = all.iter().filter(|p| p.y_label == y_label).map(|p| extent(&p.without));
        of.fold(1e-9, f64::max)
    };
    let change = |pair: &Pair| {
        let difference: Vec<f64> =
            pair.with.iter().zip(&pair.without).map(|(with, without)| with - without).collect();
        let largest = difference.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        // a change that varies along the axis is more informative than a constant change, so a constant change counts a tenth
        (extent(&difference) + 0.1 * largest) / range(pair.y_label)
    };
    let mut ranked: Vec<(f64, &Pair)> =
        all.iter().map(|p| (change(p), p)).filter(|(c, _)| *c > NOTHING).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    ranked.into_iter().take(most).map(|(_, pair)| pair.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::{effects, inputs};
    use std::path::Path;

    /// Every effect of the catalogue, with its example values, must change at least one sweep and the manoeuvre. An effect
    /// between actuators and deflections, such as a lag, changes only the manoeuvre.
    #[test]
    fn every_effect_leaves_its_signature() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let catalogue = effects::Kind::ALL.iter().map(|kind| kind.describe());
        for about in catalogue.filter(|about| about.entry.is_some()) {
            let found = signature(&model, &about, about.entry.unwrap().example).unwrap();
            let first = found.sweeps.first().map(|pair| (pair.x_label, pair.y_label));
            println!("{:25} {first:?}", about.id);
            // the X8 has no rudder: the manoeuvre's rudder doublet has no effect
            let moves = about.id == "rudder_linear" || !found.manoeuvre.is_empty();
            assert!(first.is_some() && moves, "{}", about.id);
        }
        for about in inputs::Kind::ALL.iter().map(|kind| kind.describe()) {
            let found = signature(&model, &about, about.entry.unwrap().example).unwrap();
            assert!(found.sweeps.is_empty(), "{} has memory", about.id);
            assert!(!found.manoeuvre.is_empty(), "{}", about.id);
        }
    }

    #[test]
    fn an_error_of_the_measurement_has_none() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let about = crate::flight_path::measurement_effects::MEASUREMENT_EFFECTS[0];
        assert!(matches!(
            signature(&model, &about, &[]),
            Err(SignatureError::Measurement { id: "steady_wind" })
        ));
    }
}

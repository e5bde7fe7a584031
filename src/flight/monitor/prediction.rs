//! Accelerations that the model predicts, with their variances. The monitor compares the measured accelerations with them.

use greylag_link::vehicle::Telemetry;
use greylag_model::GreyBox;
use greylag_physics::Channel as Part;
use greylag_physics::rigid_body::{RigidBody, acceleration_of, gravity_in_body};
use greylag_physics::{AirData, Controls, State};

/// Specific force along body x, y, z (m/s²), then angular acceleration about body x, y, z (rad/s²).
pub type Six = [f64; 6];

/// Standard deviations of the model's inputs: airspeed (relative), surfaces (rad), throttle (0..1). The values are
/// typical of a pitot tube and servos of small aircraft. Each telemetry frame states the standard deviations of α and β.
const AIRSPEED_SD: f64 = 0.02;
const SURFACE_SD: f64 = 0.3 * DEGREE;
const THROTTLE_SD: f64 = 0.02;
/// Gust intensity σ_w (m/s) and scale length L (m), from which the rotation of the air is computed. No sensor measures this
/// rotation. In MIL-F-8785C its standard deviation is σ_p = 1.9 σ_w / √(L b), with the wing span b.
const GUSTS_MPS: f64 = 1.5;
const GUST_SCALE_M: f64 = 533.0;
/// Largest step of the finite differences in α and β, rad. In gusts, a step of one standard deviation could exceed the
/// stall angle, where lift drops.
const INCIDENCE_STEP: f64 = 2.0 * DEGREE;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A model with the standard deviations of its coefficients.
#[derive(Clone, Debug)]
pub struct Predictor {
    model: GreyBox,
    /// Prior standard deviation of each coefficient.
    widths: Vec<f64>,
    /// Standard deviation of the angular velocity of the air, rad/s.
    air_rotation: f64,
}

/// Inputs of the model at one telemetry frame.
#[derive(Clone, Copy, Debug)]
struct Asked {
    state: State,
    controls: Controls,
    altitude: f64,
}

/// A function that adds a step of about one standard deviation to one input of the model.
type Change = fn(&mut Asked, &Deviations);

/// Steps of the inputs whose standard deviations depend on the aircraft or on the telemetry frame.
#[derive(Clone, Copy, Debug)]
struct Deviations {
    /// α and β, rad: their standard deviations, at most `INCIDENCE_STEP`.
    incidence: [f64; 2],
    /// Angular velocity of the air, rad/s.
    air_rotation: f64,
}

const CHANGES: [Change; 10] = [
    |a, sd| a.state.alpha += sd.incidence[0],
    |a, sd| a.state.beta += sd.incidence[1],
    |a, _| a.state.airspeed *= 1.0 + AIRSPEED_SD,
    |a, _| a.controls.aileron += SURFACE_SD,
    |a, _| a.controls.elevator += SURFACE_SD,
    |a, _| a.controls.rudder += SURFACE_SD,
    |a, _| a.controls.throttle += THROTTLE_SD,
    |a, sd| a.state.p += sd.air_rotation,
    |a, sd| a.state.q += sd.air_rotation,
    |a, sd| a.state.r += sd.air_rotation,
];

impl Predictor {
    /// A predictor with the standard deviations of the coefficients of `model`.
    pub fn new(model: GreyBox) -> Self {
        let widths = model.coefficients().iter().map(greylag_model::Named::width).collect();
        let span = model.airframe.geometry.span;
        let air_rotation = 1.9 * GUSTS_MPS / (GUST_SCALE_M * span).sqrt();
        Predictor { model, widths, air_rotation }
    }

    /// The accelerations predicted for the state and controls of `frame`, m/s² and rad/s².
    pub fn mean(&self, frame: &Telemetry) -> Six {
        self.accelerations(&Asked::at(frame))
    }

    /// Variance of the predicted accelerations `mean` at `frame`, m²/s⁴ and rad²/s⁴. It combines the standard
    /// deviations of the coefficients and of the measured inputs.
    pub fn variance(&self, frame: &Telemetry, mean: &Six) -> Six {
        let asked = Asked::at(frame);
        let mut variance = self.of_coefficients(&asked);
        let incidence = frame.incidence_sd.map(|sd| sd.min(INCIDENCE_STEP));
        let steps = Deviations { incidence, air_rotation: self.air_rotation };
        let mut in_steps = [1.0; CHANGES.len()];
        (0..2).for_each(|k| in_steps[k] = (frame.incidence_sd[k] / INCIDENCE_STEP).max(1.0));
        for (change, in_steps) in CHANGES.iter().zip(in_steps) {
            let mut changed = asked;
            change(&mut changed, &steps);
            let moved = self.accelerations(&changed);
            (0..6).for_each(|k| variance[k] += ((moved[k] - mean[k]) * in_steps).powi(2));
        }
        variance
    }

    fn accelerations(&self, asked: &Asked) -> Six {
        let Asked { state, controls, altitude } = asked;
        let air = self.model.air(state, *altitude);
        let (mut linear, mut spin) = self.model.accelerations(state, controls, &air);
        let gravity = gravity_in_body(state, self.model.atmosphere.gravity);
        let learned = self.model.residual.as_ref().map(|r| r.rate(state, controls));
        if let Some(rate) = learned {
            let more = acceleration_of(state, &air, &rate);
            (0..3).for_each(|k| linear[k] += more[k]);
            [rate.p, rate.q, rate.r].iter().zip(&mut spin).for_each(|(more, s)| *s += more);
        }
        let force: [f64; 3] = std::array::from_fn(|k| linear[k] - gravity[k]);
        [force[0], force[1], force[2], spin[0], spin[1], spin[2]]
    }

    fn of_coefficients(&self, asked: &Asked) -> Six {
        let Asked { state, controls, altitude } = asked;
        let air = self.model.air(state, *altitude);
        let mut parts = [0.0; 7];
        self.model.contributions(state, controls, &air, |at, part, amount: f64| {
            parts[part as usize] += (self.widths[at] * amount).powi(2);
        });
        to_accelerations(&parts, &self.model.body, &air)
    }
}

impl Asked {
    fn at(frame: &Telemetry) -> Self {
        let controls = frame.actuators.controls();
        Asked { state: frame.state, controls, altitude: frame.altitude }
    }
}

/// Variances of accelerations from the variances of independent forces (N²) and moments (N² m²). Sideslip is neglected.
fn to_accelerations(parts: &[f64; 7], body: &RigidBody, air: &AirData) -> Six {
    let of = |part: Part| parts[part as usize];
    let (sin2, cos2) = (air.sin_alpha.powi(2), air.cos_alpha.powi(2));
    let (drag, lift) = (of(Part::Drag), of(Part::Lift));
    let mass2 = body.mass.powi(2);
    let gamma2 = (body.jx * body.jz - body.jxz.powi(2)).powi(2);
    let (roll, yaw, cross2) = (of(Part::Roll), of(Part::Yaw), body.jxz.powi(2));
    [
        (cos2 * drag + sin2 * lift + of(Part::BodyX)) / mass2,
        of(Part::Side) / mass2,
        (sin2 * drag + cos2 * lift) / mass2,
        (body.jz.powi(2) * roll + cross2 * yaw) / gamma2,
        of(Part::Pitch) / body.jy.powi(2),
        (cross2 * roll + body.jx.powi(2) * yaw) / gamma2,
    ]
}

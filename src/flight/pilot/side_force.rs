//! Sideslip that the measured side force corrects, for control where no vane measures it.
//!
//! The link estimates the sideslip from attitude, velocity over ground and a wind that lags. In turbulence the air moves sideways
//! within seconds, and the estimate erred by 3.4° beside ArduPlane. The accelerometer shows the side force, whose correlation with
//! the true sideslip was −0.99 there. As with the lift (`lift.rs`), records, the monitor and diagnoses keep the link's estimate.

use super::lift::{Correction, SLOWEST_MPS};
use greylag_link::vehicle::{Faults, Telemetry, VANE_SD};
use greylag_model::{GreyBox, Trim, TrimError, Twin};
use greylag_physics::atmosphere::standard_density;
use greylag_physics::{Controls, State};

/// Steps of the finite differences: angles and deflections (rad), body rates (rad/s).
const STEP: f64 = 0.05;
/// Time constant with which the side force corrects the estimate, s. It is longer than that of the lift, because the side force is
/// a twentieth of it per angle, and the accelerometer's noise as large.
const TIME_S: f64 = 0.1;
/// Least side force by sideslip, m/s² per rad at the airspeed of the curve, with which an error of the accelerometer of 0.2 m/s² is
/// less than 3° of sideslip.
const LEAST: f64 = 4.0;
/// Largest sideslip that follows from a side force, rad. Beyond it the force is seldom linear.
const MOST: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// Side force of a model near straight flight: lateral specific force by dynamic pressure (m/s² per Pa) as a linear function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideForce {
    /// At zero sideslip, body rates and lateral deflections.
    offset: f64,
    /// Per rad of sideslip.
    by_sideslip: f64,
    /// Per p/V and r/V, rad/m.
    by_rates: [f64; 2],
    /// Per rad of aileron and rudder.
    by_surfaces: [f64; 2],
}

impl SideForce {
    /// The side force of `model` at the true airspeed `airspeed` (m/s). `None` if it hardly depends on the sideslip.
    ///
    /// # Errors
    /// If the model has no straight-flight trim at `airspeed`.
    pub fn of(model: &GreyBox, airspeed: f64) -> Result<Option<SideForce>, TrimError> {
        let altitude = model.airframe.reference.altitude;
        let trim = Trim::straight(model, airspeed, altitude)?;
        let pressure = 0.5 * model.atmosphere.density_at(altitude) * airspeed * airspeed;
        let force = |change: &dyn Fn(&mut State, &mut Controls)| {
            let (mut state, mut controls) = (trim.state, trim.controls);
            change(&mut state, &mut controls);
            Twin::at_rest(state, &controls, altitude).specific_force(model)[1] / pressure
        };
        let offset = force(&|_, _| ());
        let per = |change: &dyn Fn(&mut State, &mut Controls)| (force(change) - offset) / STEP;
        let by_sideslip = per(&|state, _| state.beta += STEP);
        let all = SideForce {
            offset,
            by_sideslip,
            by_rates: [per(&|state, _| state.p += STEP), per(&|state, _| state.r += STEP)]
                .map(|x| x * airspeed),
            by_surfaces: [
                per(&|_, controls| controls.aileron += STEP),
                per(&|_, controls| controls.rudder += STEP),
            ],
        };
        Ok((-by_sideslip * pressure >= LEAST).then_some(all))
    }

    /// Sideslip (rad) at which the model has the measured side force of `frame` at the true airspeed `airspeed` (m/s). `None`
    /// without an accelerometer and at a low airspeed.
    fn measured(&self, frame: &Telemetry, airspeed: f64) -> Option<f64> {
        let State { p, r, .. } = frame.state;
        let whole = !frame.faults.contains(Faults::SPECIFIC_FORCE) && airspeed > SLOWEST_MPS;
        let pressure = 0.5 * standard_density(frame.altitude) * airspeed * airspeed;
        let [by_p, by_r] = self.by_rates;
        let [by_aileron, by_rudder] = self.by_surfaces;
        let others = self.offset
            + (by_p * p + by_r * r) / airspeed
            + by_aileron * frame.actuators.aileron
            + by_rudder * frame.actuators.rudder;
        let angle = (frame.specific_force[1] / pressure - others) / self.by_sideslip;
        (whole && angle.is_finite()).then(|| angle.clamp(-MOST, MOST))
    }
}

/// The correction of an estimated sideslip by the measured side force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct BySideForce(Correction);

impl BySideForce {
    /// Sideslip (rad) for control in `frame` at the true airspeed `airspeed` (m/s): that of the frame if a vane measures it or
    /// without `force`.
    pub(super) fn sideslip(
        &mut self,
        force: Option<&SideForce>,
        frame: &Telemetry,
        airspeed: f64,
    ) -> f64 {
        let beta = frame.state.beta;
        match force {
            Some(force) if frame.incidence_sd[1] > VANE_SD[1] => {
                let measured = (frame.specific_force[1], force.measured(frame, airspeed));
                self.0.corrected(frame.time, beta, measured, TIME_S)
            }
            _ => beta,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable_at;
    use greylag_physics::ActuatorState;

    fn model() -> GreyBox {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        GreyBox::load(&std::path::Path::new(root).join("params/x8/jsbsim.toml")).unwrap()
    }

    /// A roll at 20 m/s with some aileron, `k` hundredths of a second after the first state, with the sideslip `estimated` and the
    /// specific force at the sideslip `truth` (rad).
    fn frame(model: &GreyBox, k: u64, estimated: f64, truth: f64) -> Telemetry {
        let altitude = model.airframe.reference.altitude;
        let trim = Trim::straight(model, 20.0, altitude).unwrap();
        let state = State { beta: truth, p: 0.6, r: -0.3, ..trim.state };
        let controls = Controls { aileron: 0.2, ..trim.controls };
        let mut specific_force = Twin::at_rest(state, &controls, altitude).specific_force(model);
        // each state has a new measurement
        specific_force[1] += 1e-9 * k as f64;
        Telemetry {
            state: State { beta: estimated, ..state },
            incidence_sd: [0.02; 2],
            specific_force,
            actuators: ActuatorState { aileron: 0.2, ..Default::default() },
            altitude,
            ..usable_at(k)
        }
    }

    #[test]
    fn the_side_force_tells_the_sideslip() {
        let model = model();
        let force = SideForce::of(&model, 20.0).unwrap().unwrap();
        for truth in [0.1f64, -0.05] {
            let (mut by_force, mut beta) = (BySideForce::default(), 0.0);
            for k in 0..100 {
                beta = by_force.sideslip(Some(&force), &frame(&model, k, 0.03, truth), 20.0);
            }
            assert!((beta - truth).to_degrees().abs() < 0.2, "{truth} {}", beta.to_degrees());
            // without an accelerometer the estimate is believed again
            for k in 100..1100 {
                let mut blind = frame(&model, k, 0.03, truth);
                blind.faults.insert(Faults::SPECIFIC_FORCE);
                beta = by_force.sideslip(Some(&force), &blind, 20.0);
            }
            assert!((beta - 0.03).to_degrees().abs() < 0.1, "{}", beta.to_degrees());
        }
    }

    /// A lossy link repeats the last accelerometer beside new attitudes.
    #[test]
    fn an_old_side_force_corrects_nothing() {
        let model = model();
        let force = SideForce::of(&model, 20.0).unwrap().unwrap();
        let mut by_force = BySideForce::default();
        for k in 0..50 {
            let old = Telemetry {
                specific_force: frame(&model, 0, 0.03, 0.1).specific_force,
                ..frame(&model, k, 0.03, 0.1)
            };
            assert_eq!(by_force.sideslip(Some(&force), &old, 20.0), 0.03);
        }
    }

    #[test]
    fn a_vane_is_not_corrected() {
        let model = model();
        let force = SideForce::of(&model, 20.0).unwrap();
        let mut by_force = BySideForce::default();
        for k in 0..100 {
            let mut seen = frame(&model, k, 0.03, 0.1);
            assert_eq!(by_force.sideslip(None, &seen, 20.0), 0.03);
            seen.incidence_sd = VANE_SD;
            assert_eq!(by_force.sideslip(force.as_ref(), &seen, 20.0), 0.03);
        }
    }

    #[test]
    fn what_is_no_number_corrects_nothing() {
        let model = model();
        let force = SideForce::of(&model, 20.0).unwrap();
        let mut by_force = BySideForce::default();
        for k in 0..50 {
            let bad = Telemetry { specific_force: [f64::NAN; 3], ..frame(&model, k, 0.2, 0.03) };
            assert_eq!(by_force.sideslip(force.as_ref(), &bad, 20.0), 0.2);
        }
    }

    #[test]
    fn a_model_without_side_force_has_none() {
        let mut model = model();
        assert!(model.set_coefficient("side_force_linear.CYbeta", 0.0));
        assert_eq!(SideForce::of(&model, 20.0).unwrap(), None);
    }
}

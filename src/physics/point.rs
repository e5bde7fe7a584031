//! The point (state, controls and airflow) at which the effects of a model are evaluated. An effect is one physical contribution
//! to the forces and moments. A wrench is a set of forces and moments.
//!
//! The effects are evaluated in two passes. The first pass evaluates the effects that depend only on the point. The second pass
//! evaluates the other effects, which also depend on results of the first pass.

use crate::airframe::Geometry;
use crate::rigid_body::{ForceAxes, Vector};
use crate::{Controls, State, Wrench};
use greylag_num::Real;

/// Quantities of the airflow. They are computed once for all effects.
#[derive(Clone, Copy, Debug)]
pub struct AirData<R = f64> {
    /// Dynamic pressure times wing area, ½ρV²S, N.
    pub q_s: R,
    /// Air density ρ, kg/m³.
    pub density: R,
    /// Sine of the angle of attack.
    pub sin_alpha: R,
    /// Cosine of the angle of attack.
    pub cos_alpha: R,
    /// Sine of the sideslip angle.
    pub sin_beta: R,
    /// Cosine of the sideslip angle.
    pub cos_beta: R,
    /// Nondimensional roll rate p̂ = bp/2V.
    pub p_hat: R,
    /// Nondimensional pitch rate q̂ = cq/2V.
    pub q_hat: R,
    /// Nondimensional yaw rate r̂ = br/2V.
    pub r_hat: R,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
}

impl<R: Real> AirData<R> {
    /// The airflow at `state` and `altitude` (m) in air of `density` (kg/m³).
    #[inline(always)]
    pub fn new(state: &State<R>, density: R, altitude: f64, geometry: &Geometry) -> Self {
        let (sin_alpha, cos_alpha) = state.alpha.sin_cos();
        let (sin_beta, cos_beta) = state.beta.sin_cos();
        let per_2v = R::from_f64(0.5) / state.airspeed;
        let (per_span, per_chord) = (per_2v.scale(geometry.span), per_2v.scale(geometry.chord));
        AirData {
            q_s: (density * state.airspeed * state.airspeed).scale(0.5 * geometry.area),
            density,
            sin_alpha,
            cos_alpha,
            sin_beta,
            cos_beta,
            p_hat: state.p * per_span,
            q_hat: state.q * per_chord,
            r_hat: state.r * per_span,
            altitude,
        }
    }
}

/// Inputs from which an effect computes its forces and moments.
#[derive(Clone, Copy, Debug)]
pub struct Point<'a, R = f64> {
    /// State of the aircraft.
    pub state: &'a State<R>,
    /// Deflections and throttle position that act at this instant.
    pub controls: &'a Controls<R>,
    /// Airflow at `state`.
    pub air: &'a AirData<R>,
    /// Wing area, span and chord.
    pub geometry: &'a Geometry,
    /// Axes in which drag, side force and lift act.
    pub axes: ForceAxes,
    /// Inputs of the effects in the second pass. Zero during the first pass.
    pub base: &'a Base<R>,
}

/// Inputs of the effects that depend on more than state, controls and airflow. The sums are taken over the other effects, which
/// the first pass has evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Base<R = f64> {
    /// Sum of the forces and moments of the effects in the first pass.
    pub wrench: Wrench<R>,
    /// Sum of the forces of the effects in the first pass, in body axes, N.
    pub force: Vector<R>,
    /// The part of `wrench` that is due to aileron, elevator and rudder.
    pub deflected: Wrench<R>,
    /// The wrench that the same effects give with neutral surfaces and zero body rates.
    pub still: Wrench<R>,
    /// Time derivative of the state due to all effects of the model, in units of the state per second. It is iterated after the
    /// first pass. Zero if no effect of the model depends on it.
    pub rate: State<R>,
}

impl<R: Real> Base<R> {
    /// The inputs before the first pass: all zero.
    #[inline(always)]
    pub fn zero() -> Self {
        let wrench = Wrench::zero();
        let rate = State::from_array([R::zero(); 8]);
        Base { wrench, force: [R::zero(); 3], deflected: wrench, still: wrench, rate }
    }
}

//! Two ways to evaluate the equations of motion, which are long functions. One is a call of a copy that is compiled once per
//! scalar type. In the other, the equations are inlined into the caller. A third one, with derivatives with respect to the
//! coefficients, is in the module `slopes`.
//!
//! A kernel that is compiled for several instruction sets must inline the equations, because a called copy would not use the
//! kernel's instruction set. In other functions, inlining would only increase the size of the program and the compile time.

use super::{GreyBox, Residual};
use greylag_num::Real;
use greylag_physics::rigid_body::Vector;
use greylag_physics::{AirData, Controls, State};

/// One way to evaluate the forces and the residual of a model.
pub(super) trait Forces<R: Real>: Copy {
    /// Linear acceleration (m/s²) and angular acceleration (rad/s²) in body axes.
    fn accelerations(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>);
    /// Contribution of the learned residual to the time derivative of the state, in units of `State` per second.
    fn learned(self, residual: &Residual, state: &State<R>, controls: &Controls<R>) -> State<R>;
}

/// Calls the copy compiled for the scalar type.
#[derive(Clone, Copy)]
pub(super) struct Called;

/// Inlines the equations into the caller.
#[derive(Clone, Copy)]
pub(super) struct Inlined;

impl<R: Real> Forces<R> for Called {
    fn accelerations(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        model.accelerations(state, controls, air)
    }
    #[inline(never)]
    fn learned(self, residual: &Residual, state: &State<R>, controls: &Controls<R>) -> State<R> {
        residual.rate(state, controls)
    }
}

impl<R: Real> Forces<R> for Inlined {
    #[inline(always)]
    fn accelerations(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        model.accelerations_inlined(state, controls, air)
    }
    #[inline(always)]
    fn learned(self, residual: &Residual, state: &State<R>, controls: &Controls<R>) -> State<R> {
        residual.rate(state, controls)
    }
}

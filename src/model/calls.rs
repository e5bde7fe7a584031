//! Access to the long equations from a function: by calling the copy compiled for a scalar, or inlined.
//!
//! Kernels that are compiled for several instruction sets inline the equations, because a called copy would not use
//! the kernel's instruction set. Elsewhere inlining only increases the program's size and the time to compile it.

use super::{GreyBox, Residual};
use greylag_num::Real;
use greylag_physics::rigid_body::Vector;
use greylag_physics::{AirData, Controls, State};

/// Access to the forces of a model.
pub(super) trait Forces: Copy {
    /// Linear (m/s²) and angular (rad/s²) acceleration, body axes.
    fn accelerations<R: Real>(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>);
    /// The residual's contribution to the state's rates.
    fn learned<R: Real>(
        self,
        residual: &Residual,
        state: &State<R>,
        controls: &Controls<R>,
    ) -> State<R>;
}

/// Calls the copy for the scalar.
#[derive(Clone, Copy)]
pub(super) struct Called;

/// Inlines all of it into the caller.
#[derive(Clone, Copy)]
pub(super) struct Inlined;

impl Forces for Called {
    fn accelerations<R: Real>(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        model.accelerations(state, controls, air)
    }
    #[inline(never)]
    fn learned<R: Real>(
        self,
        residual: &Residual,
        state: &State<R>,
        controls: &Controls<R>,
    ) -> State<R> {
        residual.rate(state, controls)
    }
}

impl Forces for Inlined {
    #[inline(always)]
    fn accelerations<R: Real>(
        self,
        model: &GreyBox,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        model.accelerations_inlined(state, controls, air)
    }
    #[inline(always)]
    fn learned<R: Real>(
        self,
        residual: &Residual,
        state: &State<R>,
        controls: &Controls<R>,
    ) -> State<R> {
        residual.rate(state, controls)
    }
}

//! The weak form of the equations of motion: they are multiplied by a smooth weighting function (the kernel) and integrated by
//! parts over a window of flight. No measured signal has to be differentiated.

pub(super) mod channels;
pub mod columns;
pub mod kernel;
pub mod prepared;
pub mod windows;

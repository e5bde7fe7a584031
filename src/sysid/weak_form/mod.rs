//! The weak form: the equations of motion integrated with smooth kernels. No signal is differentiated.

pub(super) mod channels;
pub mod kernel;
pub mod prepared;
pub mod windows;

//! The weak form: the equations of motion integrated against smooth windows, so that no signal is differentiated.

pub(super) mod channels;
pub mod kernel;
pub mod prepared;
pub mod windows;

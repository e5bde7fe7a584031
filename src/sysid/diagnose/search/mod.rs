//! Forward selection of the effects (physical contributions to forces and moments) that a model lacks: ranking of the candidates,
//! checks, and critical values.

pub(super) mod checks;
pub(crate) mod clocks;
pub(super) mod coarser;
pub(super) mod excitation;
pub(super) mod nulls;
pub(super) mod remainder;
pub(super) mod round;
pub(super) mod settling;
pub(super) mod shape;
pub(super) mod stepwise;
pub(super) mod unexplained;

//! The result of a diagnosis, which finds the physical effects (contributions to forces and moments) that a model lacks: verdict,
//! ranking, confidence intervals, and sentences.

pub(super) mod advice;
pub(super) mod curves;
pub(super) mod decoys;
pub(super) mod detectable;
pub(super) mod impossible;
pub(super) mod measurement;
pub(super) mod per_flight;
pub(super) mod probability;
pub(super) mod ranking;
pub(super) mod result;
pub(super) mod rival;
pub(super) mod run;
pub(super) mod sentences;
pub(super) mod shares;
pub(super) mod verdict;

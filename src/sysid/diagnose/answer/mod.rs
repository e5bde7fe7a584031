//! The result of a diagnosis: verdict, ranking, confidence intervals, and sentences that state them.

pub(super) mod advice;
pub(super) mod curves;
pub(super) mod decoys;
pub(super) mod detectable;
pub(super) mod impossible;
pub(super) mod measurement;
pub(super) mod per_flight;
pub(super) mod ranking;
pub(super) mod result;
pub(super) mod rival;
pub(super) mod run;
pub(super) mod sentences;
pub(super) mod shares;
pub(super) mod verdict;

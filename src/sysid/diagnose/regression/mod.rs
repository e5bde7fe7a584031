//! Linear regression by which the candidates (physical effects that the model may lack) are ranked: regressors, whitening, and
//! elimination of the nuisance parameters (Frisch–Waugh–Lovell).

pub(super) mod catalogue;
pub(super) mod cells;
pub(super) mod columns;
pub(super) mod features;
pub(super) mod gather;
pub(super) mod local;
pub(super) mod noise;
pub(super) mod per_flight;
pub(super) mod projected;
pub(super) mod rank;
pub(super) mod sensors;
pub(super) mod shared;
pub(super) mod whiten;

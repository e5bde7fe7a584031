//! Comparison of models with flights: errors of free runs (open-loop simulations), and the channels and regimes in which a
//! model fails.
//!
//! A channel is a force, a moment or a rate. A regime is a range of a flight condition, such as the angle of attack. The method
//! is described in `docs/explanation/comparison.md`. Models are compared as given, without a fit.

pub mod answer;
pub mod arx;
mod bins;
pub mod bootstrap;
pub mod combination;
pub mod correction;
mod discovery;
mod doubt;
mod error;
mod finding;
mod flight;
pub mod forecast;
pub mod free_run;
mod known;
mod order;
mod power;
mod result;
mod run;
mod runs;
mod sentence;
mod unexplained;
mod usable;
mod verdict;

pub use crate::weak_form::channels::{ChannelId, RegimeVariable};
pub use answer::Answer;
pub use error::CompareError;
pub use result::{
    Abstention, Bin, ChannelResult, ChannelTrace, Comparison, Document, FlightResult, FlightTrace,
    GrowthPoint, HorizonScore, KnownUse, Map, MapCell, ModelResult, ModelTrace, NuisanceResult,
    Regime, RegimeBins, Settings, StateScore,
};
pub use run::{Options, abstentions, compare, compare_and_drop, scores};
pub use unexplained::{Shares, shares};
#[cfg(feature = "study")]
pub(crate) use verdict::unpredicted;

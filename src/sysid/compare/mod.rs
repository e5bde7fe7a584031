//! Comparison of models with flights: free-run errors, and the channels and regimes in which a model fails.
//!
//! The method is described in `docs/explanation/comparison.md`. Models are compared as given, without tuning.

pub mod answer;
pub mod arx;
mod bins;
pub mod bootstrap;
mod discovery;
mod doubt;
mod error;
mod finding;
mod flight;
pub mod forecast;
pub mod free_run;
mod known;
pub mod observer;
mod order;
mod power;
mod result;
mod run;
mod sentence;
mod verdict;

pub use crate::weak_form::channels::{ChannelId, RegimeVariable};
pub use answer::Answer;
pub use error::CompareError;
pub use result::{
    Abstention, Bin, ChannelResult, ChannelTrace, Comparison, Document, FlightResult, FlightTrace,
    GrowthPoint, HorizonScore, KnownUse, Map, MapCell, ModelResult, ModelTrace, NuisanceResult,
    Regime, RegimeBins, Settings, StateScore,
};
pub use run::{Options, abstentions, compare, scores, scores_with};
#[cfg(feature = "study")]
pub(crate) use verdict::unpredicted;

//! Models against flights: how far free runs stray, and in which channel and regime a model fails.
//!
//! The method stands in `docs/explanation/comparison.md`. "Before" is the
//! model as given; tuning it is the business of what ranks missing effects, for which
//! [`columns`](crate::weak_form::windows::columns) gives what to regress on.

pub mod answer;
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
mod power;
mod result;
mod run;
mod sentence;
mod verdict;

pub use crate::weak_form::channels::{ChannelId, RegimeVariable};
pub use answer::Answer;
pub use error::CompareError;
pub use result::{
    Bin, ChannelResult, ChannelTrace, Comparison, Document, FlightResult, FlightTrace, GrowthPoint,
    HorizonScore, KnownUse, Map, MapCell, ModelResult, ModelTrace, NuisanceResult, Regime,
    RegimeBins, Settings, StateScore,
};
pub use run::{Options, abstentions, compare, scores};

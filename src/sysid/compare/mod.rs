//! Models against flights: how far free runs stray, and in which channel and regime a model fails.
//!
//! The method is that of the shared note `missing_effects.md`, steps 3, 4 and 11.

mod result;

pub use result::{
    Bin, ChannelId, ChannelResult, ChannelTrace, Comparison, FlightResult, FlightTrace,
    GrowthPoint, HorizonScore, Map, MapCell, ModelResult, ModelTrace, NuisanceResult, Regime,
    RegimeBins, RegimeVariable, Settings, StateScore,
};

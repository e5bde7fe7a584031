//! Reports: pages of figures and tables, each in one HTML file that needs no network.
//!
//! A [`Page`] contains [`Section`]s under a title, and a section contains [`Figure`]s in order. [`Page::render`] converts a page
//! to one string that includes styles, scripts and data.
//!
//! There is a page for each kind of result:
//! - `AircraftReport`: an aircraft's model.
//! - `EffectReport`: an effect of the catalogue.
//! - [`FlightReport`]: a flight.
//! - [`ComparisonReport`]: a comparison of models with flights.
//! - [`DiagnosisReport`]: a diagnosis of missing effects.
//! - [`AmendmentReport`]: an amended model.
//! - `TrainingReport`: a trained model.
//! - `LearningReport`: trainings of policies.
//! - `EvaluationReport`: an evaluation of controllers.
//! - `CampaignReport`: a campaign.
//!
//! The embedded library uPlot 1.6.32 (MIT, `kit/assets/uPlot.LICENSE`) draws the plots in the browser.
//!
//! All [`TimeFigure`]s of a page have the same time axis. Zoom and cursor are common to them.

mod aircraft_page;
#[cfg(feature = "study")]
mod amendment;
#[cfg(feature = "study")]
mod campaign_page;
mod comparison;
#[cfg(feature = "study")]
mod effect_page;
#[cfg(feature = "study")]
mod diagnosis;
mod kit;
#[cfg(feature = "sitl")]
mod evaluation_page;
mod flight;
#[cfg(feature = "learn")]
mod learning_page;
mod sight;
#[cfg(feature = "learn")]
mod training_page;

pub use aircraft_page::AircraftReport;
#[cfg(feature = "study")]
pub use amendment::AmendmentReport;
#[cfg(feature = "study")]
pub use amendment::page::amendment_page;
#[cfg(feature = "study")]
pub use campaign_page::CampaignReport;
pub use comparison::ComparisonReport;
pub use comparison::page::comparison_page;
#[cfg(feature = "study")]
pub use diagnosis::DiagnosisReport;
#[cfg(feature = "study")]
pub use diagnosis::page::diagnosis_page;
#[cfg(feature = "study")]
pub use effect_page::{EffectReport, facts as effect_facts};
#[cfg(feature = "sitl")]
pub use evaluation_page::EvaluationReport;
#[cfg(feature = "sitl")]
pub use evaluation_page::answer::{best as evaluation_best, sentences as evaluation_answer};
#[cfg(feature = "sitl")]
pub use evaluation_page::names::only_model as evaluation_model;
pub use flight::{
    Difficulty, EnvelopeFlown, Event, EventKind, FlightReport, Segment, SurfaceTravel,
};
pub use kit::answer_box::{AnswerBox, First};
pub use kit::bars::{BarGroup, Bars};
pub use kit::choice::{Choice, ChoiceOption};
pub use kit::curves::{Curves, Range};
pub use kit::drawing::Drawing;
pub use kit::evidence::{Evidence, EvidenceGroup, EvidenceRow};
pub use kit::figure::{Figure, Outcome, Rule, Style, Verdict};
pub use kit::findings::{Finding, Findings, Link};
pub use kit::grid::{Grid, GridCell, GridRow};
pub use kit::heat_map::{HeatCell, HeatMap};
pub use kit::histogram::Histogram;
#[cfg(feature = "sitl")]
pub use kit::html::escape;
pub use kit::intervals::{IntervalBins, IntervalPanel, Intervals};
pub use kit::loop_timing::{Cycle, LoopTiming};
pub use kit::page::{Folding, Page, Section};
pub use kit::probabilities::{Probabilities, ProbabilityRow};
pub use kit::table::{Align, Column, Row, Table};
pub use kit::time_figure::{Band, Mark, Panel, Scale, Series, TimeFigure, Track};
pub use kit::time_line::{Span, States, TimeLine, Tone, TraceLine, Traces};
pub use kit::whiskers::{Whisker, Whiskers};
pub use kit::write::{WriteError, write_new, write_over};
pub use kit::xy::{XyBand, XyFigure, XyMark, XySeries};
#[cfg(feature = "learn")]
pub use learning_page::{LearningReport, Training};
pub use sight::Sight;
#[cfg(feature = "learn")]
pub use training_page::TrainingReport;

//! The report: figures and tables of a flight as one HTML file that needs no network.
//!
//! A [`Page`] is a title over [`Section`]s, a section holds [`Figure`]s in order, and
//! [`Page::render`] turns them into one string with style, script and data inside.
//! [`FlightReport`] is the page of one flight, [`ComparisonReport`] that of models against flights,
//! [`DiagnosisReport`] that of what a model lacks, [`AmendmentReport`] that of a model with it added, `TrainingReport`
//! that of a model that was learned, `LearningReport` that of policies being learned, `EvaluationReport` that of controllers side by side.
//! The plots are drawn in the reader's browser by uPlot
//! 1.6.32 (MIT, `assets/uPlot.LICENSE`), which is embedded.
//!
//! All [`TimeFigure`]s of a page share one clock: their zoom and their cursor are linked.

mod amendment;
mod amendment_page;
mod bars;
mod choice;
mod comparison;
mod comparison_page;
mod comparison_tables;
mod comparison_time;
mod comparison_where;
mod curves;
mod decimate;
mod effect_page;
mod diagnosis;
mod diagnosis_page;
mod diagnosis_proof;
mod diagnosis_suspects;
mod diagnosis_tables;
#[cfg(feature = "sitl")]
mod evaluation_page;
mod evidence;
mod figure;
mod findings;
mod flight;
mod flight_page;
mod flight_targets;
mod flight_verdict;
mod grid;
mod heat_map;
mod histogram;
mod html;
mod intervals;
#[cfg(feature = "learn")]
mod learning_page;
mod loop_timing;
mod numbers;
mod page;
mod sight;
mod table;
mod time_figure;
#[cfg(feature = "learn")]
mod training_page;
mod whiskers;
mod write;
mod xy;

pub use amendment::AmendmentReport;
pub use amendment_page::amendment_page;
pub use bars::{BarGroup, Bars};
pub use choice::{Choice, ChoiceOption};
pub use comparison::ComparisonReport;
pub use comparison_page::comparison_page;
pub use curves::{Curves, Range};
pub use diagnosis::DiagnosisReport;
pub use diagnosis_page::diagnosis_page;
pub use effect_page::{EffectReport, facts as effect_facts};
#[cfg(feature = "sitl")]
pub use evaluation_page::EvaluationReport;
pub use evidence::{Evidence, EvidenceGroup, EvidenceRow};
pub use figure::{Figure, Outcome, Rule, Style, Verdict};
pub use findings::{Finding, Findings, Link};
pub use flight::{Difficulty, Event, EventKind, FlightReport, Segment, SurfaceTravel};
pub use grid::{Grid, GridCell, GridRow};
pub use heat_map::{HeatCell, HeatMap};
pub use histogram::Histogram;
pub use intervals::{IntervalBins, IntervalPanel, Intervals};
#[cfg(feature = "learn")]
pub use learning_page::{LearningReport, Training};
pub use loop_timing::{Cycle, LoopTiming};
pub use page::{Page, Section};
pub use sight::Sight;
pub use table::{Align, Column, Row, Table};
pub use time_figure::{Band, Mark, Panel, Scale, Series, TimeFigure, Track};
#[cfg(feature = "learn")]
pub use training_page::TrainingReport;
pub use whiskers::{Whisker, Whiskers};
pub use write::{WriteError, write_new, write_over};
pub use xy::{XyBand, XyFigure, XyMark, XySeries};

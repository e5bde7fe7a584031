//! Reports as files, with input made to break them.

mod amendment;
mod comparison;
mod diagnosis;
mod flight;
mod report_amendment;
mod report_comparison;
mod report_diagnosis;
mod report_synthetic;

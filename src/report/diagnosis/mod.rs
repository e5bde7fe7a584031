//! Input of the report on a diagnosis.

pub(super) mod page;
pub(super) mod place;
pub(super) mod proof;
pub(super) mod suspects;
pub(super) mod tables;

use crate::Page;
use greylag_sysid::compare::{Answer, Comparison};
use greylag_sysid::diagnose::Diagnosis;

/// A diagnosis of a model's missing effects, with its evidence.
#[derive(Clone, Debug)]
pub struct DiagnosisReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The fall of the error and the changes that cause it; `None` if it is not known.
    pub answer: Option<&'a Answer>,
    /// Comparison of the tuned model, then of the model as given, with the flights of the diagnosis.
    pub failing: Option<&'a Comparison>,
    /// Comparison of the models (as given, tuned, with the asserted effects) with flights that no fit has seen.
    pub held_out: Option<&'a Comparison>,
    /// Path of the model's file.
    pub model_file: String,
    /// The logs' files, as they were given.
    pub log_files: Vec<String>,
    /// The command line that made the diagnosis.
    pub command_line: String,
    /// Further programs or files and their versions or hashes.
    pub versions: Vec<(String, String)>,
}

impl DiagnosisReport<'_> {
    /// The page of the diagnosis.
    pub fn page(&self) -> Page {
        page::diagnosis_page(self)
    }
}

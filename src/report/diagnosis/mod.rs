//! Input of the report on a diagnosis, which searches for effects that a model lacks.

pub(super) mod page;
pub(super) mod place;
pub(super) mod proof;
pub(super) mod suspects;
pub(super) mod tables;

use std::collections::BTreeMap;

use crate::Page;
use greylag_sysid::compare::{Answer, Comparison};
use greylag_sysid::diagnose::Diagnosis;

/// A diagnosis of a model with its evidence.
#[derive(Clone, Debug)]
pub struct DiagnosisReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the diagnosis.
    pub diagnosis: &'a Diagnosis,
    /// The reduction of the error and the changes that cause it; `None` if they are unknown.
    pub answer: Option<&'a Answer>,
    /// Comparison of the tuned model (with re-estimated coefficients) and the model as given with the flights of the diagnosis;
    /// `None` if there is none.
    pub failing: Option<&'a Comparison>,
    /// Comparison of the model as given, the tuned model and the model with the asserted effects with flights that no fit has
    /// used; `None` if there is none.
    pub held_out: Option<&'a Comparison>,
    /// Path of the model file.
    pub model_file: String,
    /// Paths, quoted for a shell, of the files of effects that are not in the catalogue, by the effects' ids.
    pub effect_files: BTreeMap<String, String>,
    /// Paths of the log files, as the user wrote them.
    pub log_files: Vec<String>,
    /// The command line that ran the diagnosis.
    pub command_line: String,
    /// Names and versions or hashes of further programs or files.
    pub versions: Vec<(String, String)>,
}

impl DiagnosisReport<'_> {
    /// Builds the page of the diagnosis.
    pub fn page(&self) -> Page {
        page::diagnosis_page(self)
    }
}

//! Report on a comparison of models with recorded flights.

pub(super) mod page;
pub(super) mod place;
pub(super) mod regimes;
pub(super) mod tables;
pub(super) mod traces;

use crate::Page;
use greylag_sysid::compare::Comparison;

/// A comparison of models with flights, with the files and the command line that produced it.
#[derive(Clone, Debug)]
pub struct ComparisonReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the comparison, with the models' errors.
    pub comparison: &'a Comparison,
    /// Paths of the model files, in the order of the comparison's models.
    pub model_files: Vec<String>,
    /// Paths of the log files, as given.
    pub log_files: Vec<String>,
    /// The command line that ran the comparison.
    pub command_line: String,
    /// Further programs or files with their versions or hashes: name, then version or hash.
    pub versions: Vec<(String, String)>,
}

impl ComparisonReport<'_> {
    /// Builds the page of the comparison.
    pub fn page(&self) -> Page {
        page::comparison_page(self)
    }
}

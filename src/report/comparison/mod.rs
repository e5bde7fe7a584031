//! Input of the report on a comparison.

pub(super) mod page;
pub(super) mod place;
pub(super) mod regimes;
pub(super) mod tables;
pub(super) mod traces;

use crate::Page;
use greylag_sysid::compare::Comparison;

/// A comparison of models with flights, with the files and commands that it comes from.
#[derive(Clone, Debug)]
pub struct ComparisonReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the comparison.
    pub comparison: &'a Comparison,
    /// The models' files, in the order of the comparison's models.
    pub model_files: Vec<String>,
    /// The logs' files, as they were given.
    pub log_files: Vec<String>,
    /// The command line that made the comparison.
    pub command_line: String,
    /// Further programs or files and their versions or hashes.
    pub versions: Vec<(String, String)>,
}

impl ComparisonReport<'_> {
    /// The page of the comparison.
    pub fn page(&self) -> Page {
        page::comparison_page(self)
    }
}

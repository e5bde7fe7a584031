//! Input of the report on an amendment. An amendment adds effects to a model and re-estimates its coefficients from flights.

pub(super) mod page;

use crate::Page;
use greylag_sysid::amend::{Amendment, Prior};
use greylag_sysid::compare::{Answer, Comparison};

/// Result of an amendment and its provenance.
#[derive(Clone, Debug)]
pub struct AmendmentReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the amendment: fit, evidence and scores.
    pub amendment: &'a Amendment,
    /// Summary of the result with the next command; `None` if the page shows the summary that `amendment` gives.
    pub answer: Option<&'a Answer>,
    /// Comparison of the models (as given, re-estimated, with added effects) with flights that no fit has used; `None` if it was
    /// not made.
    pub held_out: Option<&'a Comparison>,
    /// Paths of the model file before the amendment and, if one was written, after it.
    pub model_files: Vec<String>,
    /// Paths of the log files, as given.
    pub log_files: Vec<String>,
    /// Prior knowledge of the coefficients that the fit used.
    pub prior: Prior,
    /// The command line that ran the amendment.
    pub command_line: String,
    /// Names and versions or hashes of further programs or files.
    pub versions: Vec<(String, String)>,
}

impl AmendmentReport<'_> {
    /// Builds the page of the amendment.
    pub fn page(&self) -> Page {
        page::amendment_page(self)
    }
}

//! Input of the report on an amendment.

pub(super) mod page;

use crate::Page;
use greylag_sysid::amend::Amendment;
use greylag_sysid::compare::{Answer, Comparison};

/// Results of an amendment, with the files and commands that they come from.
#[derive(Clone, Debug)]
pub struct AmendmentReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Result of the amendment: fit, evidence and scores.
    pub amendment: &'a Amendment,
    /// The amendment's answer with the command that comes next, where that is known.
    pub answer: Option<&'a Answer>,
    /// Comparison of the models (as given, tuned, amended) with flights that no fit has seen; `None` if none was
    /// made.
    pub held_out: Option<&'a Comparison>,
    /// The model's file before, then after, where one was written.
    pub model_files: Vec<String>,
    /// The logs' files, as they were given.
    pub log_files: Vec<String>,
    /// The command line that made the amendment.
    pub command_line: String,
    /// Further programs or files and their versions or hashes.
    pub versions: Vec<(String, String)>,
}

impl AmendmentReport<'_> {
    /// The page of the amendment.
    pub fn page(&self) -> Page {
        page::amendment_page(self)
    }
}

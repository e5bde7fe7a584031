//! What the report of an amendment is made from.

pub(super) mod page;

use crate::Page;
use greylag_sysid::amend::Amendment;
use greylag_sysid::compare::Comparison;

/// An amended model's story, with where it came from.
#[derive(Clone, Debug)]
pub struct AmendmentReport<'a> {
    /// Title of the page.
    pub title: String,
    /// What was fitted, and what it was worth.
    pub amendment: &'a Amendment,
    /// Models in the order in which they improve (as given, tuned, amended) against flights that no fit
    /// has seen: the growth of their errors, where it was worked out.
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

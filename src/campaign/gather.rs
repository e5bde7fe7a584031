//! Joins what the cells of a campaign gave, and says which are missing.

use std::path::Path;

use super::cell::{Cell, Record};
use super::error::CampaignError;
use super::plan::Plan;
use super::store::{Failure, Standing, Store, Times, whole};

/// How a campaign stands.
#[derive(Clone, Debug, Default)]
pub struct Gathered {
    /// The results, in the order of the cells.
    pub records: Vec<Record>,
    /// What they took, in the same order, where it is known.
    pub times: Vec<Times>,
    /// Cells that failed, and why.
    pub failed: Vec<(String, Failure)>,
    /// Cells that began and are not done.
    pub begun: Vec<String>,
    /// Cells whose results are of another command or of other inputs.
    pub stale: Vec<String>,
    /// Cells of which there is nothing.
    pub missing: Vec<String>,
}

/// Looks at every cell.
///
/// # Errors
/// If a file of the campaign's folder cannot be read.
pub fn gather(plan: &Plan, store: &Store) -> Result<Gathered, CampaignError> {
    let mut all = Gathered::default();
    for cell in &plan.cells {
        all.add(cell, store)?;
    }
    Ok(all)
}

impl Gathered {
    fn add(&mut self, cell: &Cell, store: &Store) -> Result<(), CampaignError> {
        let id = cell.id.clone();
        match store.standing(cell)? {
            Standing::Done(record) => {
                self.records.push(*record);
                self.times.extend(store.times(cell)?);
            }
            Standing::Failed(failure) => self.failed.push((id, failure)),
            Standing::Begun => self.begun.push(id),
            Standing::Stale => self.stale.push(id),
            Standing::Missing => self.missing.push(id),
        }
        Ok(())
    }

    /// Whether every cell is done.
    pub fn is_whole(&self) -> bool {
        let rest = [&self.begun, &self.stale, &self.missing];
        self.failed.is_empty() && rest.iter().all(|cells| cells.is_empty())
    }
}

/// Writes a line for each of `lines`.
///
/// # Errors
/// If the file cannot be written.
pub fn write_lines<T: serde::Serialize>(path: &Path, lines: &[T]) -> Result<(), CampaignError> {
    let mut text = String::new();
    for line in lines {
        text += &serde_json::to_string(line).map_err(|e| CampaignError::content(path, e))?;
        text.push('\n');
    }
    whole(path, text)
}

/// The results in a file that [`write_lines`] wrote.
///
/// # Errors
/// If it cannot be read, or a line of it is no result.
pub fn read_lines(path: &Path) -> Result<Vec<Record>, CampaignError> {
    let text = std::fs::read_to_string(path).map_err(CampaignError::io("cannot read", path))?;
    let line = |(number, line): (usize, &str)| {
        let wrong =
            |e| CampaignError::content(path, format!("line {}: is no result: {e}", number + 1));
        serde_json::from_str(line).map_err(wrong)
    };
    text.lines().enumerate().map(line).collect()
}

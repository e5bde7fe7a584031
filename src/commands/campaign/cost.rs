//! Processor time that a cell of a campaign costs. A cell is one run of this program; a stage is a group of cells with the same
//! command at other settings.
//!
//! The cost is the median over the finished cells of the stage. If none has finished, it is the figure in the campaign file.

use anyhow::Result;

use crate::campaign::file::StageFile;
use crate::campaign::{Plan, Store};
use crate::num::statistics::quantile;

/// Cost of one cell of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Processor time over all cores, s.
    pub core_seconds: f64,
    /// Source of the figure.
    pub from: Source,
}

/// Source of a cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The median over this many finished cells.
    Measured(usize),
    /// The figure in the campaign file.
    Stated,
}

impl Cost {
    /// Cost of one cell of `stage`; `None` if it is unknown. Cells that were interrupted and resumed are left out, because
    /// only the time of their last session is recorded.
    ///
    /// # Errors
    /// If the times of a cell cannot be read.
    pub fn of(plan: &Plan, store: &Store, stage: &StageFile) -> Result<Option<Cost>> {
        let mut measured = Vec::new();
        for cell in plan.of_stage(&stage.name) {
            measured.extend(store.times(cell)?.filter(|t| !t.resumed).map(|t| t.core_seconds));
        }
        if !measured.is_empty() {
            let core_seconds = quantile(&measured, 0.5);
            return Ok(Some(Cost { core_seconds, from: Source::Measured(measured.len()) }));
        }
        Ok(stage.core_seconds.map(|core_seconds| Cost { core_seconds, from: Source::Stated }))
    }
}

impl std::fmt::Display for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Source::Measured(1) => write!(f, "measured on 1 cell"),
            Source::Measured(cells) => write!(f, "measured on {cells} cells"),
            Source::Stated => write!(f, "stated in the file"),
        }
    }
}

/// Formats a duration, given in seconds, as s, min or h.
pub fn time(seconds: f64) -> String {
    match seconds {
        s if s < 99.5 => format!("{s:.0} s"),
        s if s < 99.5 * 60.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

//! A cell: one run of this program within a campaign, and the line that records its result.
//!
//! A campaign is a set of runs over models, controllers and seeds, planned in a file. The file lists stages and axes. A stage is
//! a command with placeholders. An axis is a quantity that is varied, such as the seed, and its values are called levels.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Stands for the path of the campaign's folder in a cell's command line and in recorded commands.
pub const OUT: &str = "$OUT";
/// Number of hexadecimal digits of a cell's identity (a hash) in the name of its folder.
const SHORT: usize = 12;

/// A planned cell: the command of one stage with one level of each axis that the stage varies.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Number of the cell, from 1. A scheduler's job array uses it as its index.
    pub number: usize,
    /// Identifier: stage and levels separated by `/`, such as `dynamics/severe/trainable/1`.
    pub id: String,
    /// Name of its stage.
    pub stage: String,
    /// The level of each axis that the cell's stage varies, including the seed.
    pub levels: BTreeMap<String, String>,
    /// The command line without the program's name. [`OUT`] stands for the path of the campaign's folder.
    pub words: Vec<String>,
    /// SHA-256 of each input file or folder. The key is its path in the command.
    pub inputs: BTreeMap<String, String>,
    /// Numbers of the cells whose folders this cell reads.
    pub after: Vec<usize>,
    /// SHA-256 over the program's version (not its commit), [`words`](Cell::words) and [`inputs`](Cell::inputs). For the
    /// hash, a placeholder replaces this cell's own folder in `words`. The names of the folders of earlier cells contain their
    /// identities. A change of an earlier cell therefore changes this identity as well. Cells with equal identities give equal
    /// results.
    pub identity: String,
}

impl Cell {
    /// Name of the cell's folder. It ends with the first digits of the identity. A cell with another command or input
    /// therefore has another folder.
    pub fn folder(&self) -> String {
        format!("{}-{}", self.stem(), &self.identity[..SHORT.min(self.identity.len())])
    }

    /// The folder's name without the digits of the identity.
    pub fn stem(&self) -> String {
        self.id.replace('/', "-")
    }

    /// The random seed; `None` if the cell's stage does not vary the seed.
    pub fn seed(&self) -> Option<u64> {
        self.levels.get(super::file::SEED)?.parse().ok()
    }

    /// The command line with [`OUT`] replaced by the path `folder`.
    pub fn words_in(&self, folder: &Path) -> Vec<String> {
        let folder = folder.display().to_string();
        self.words.iter().map(|word| word.replace(OUT, &folder)).collect()
    }

    /// The command line as it is recorded: `greylag` and [`words`](Cell::words), separated by spaces.
    pub fn command(&self) -> String {
        self.words.iter().fold("greylag".into(), |line, word| line + " " + word)
    }
}

/// Result of a cell: one line of a campaign's results. It contains neither times nor paths of the machine. A repeated run of
/// the cell therefore gives the same line, bit by bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Name and version of the line's format, [`Record::SCHEMA`].
    pub schema: String,
    /// Name of the campaign.
    pub campaign: String,
    /// Id of the cell.
    pub cell: String,
    /// Name of its stage.
    pub stage: String,
    /// Level of each axis that the cell's stage varies.
    pub levels: BTreeMap<String, String>,
    /// Random seed of the cell; `None` if its stage does not vary the seed.
    pub seed: Option<u64>,
    /// Identity of the cell, see [`Cell::identity`].
    pub identity: String,
    /// Version and build of the program.
    pub program: String,
    /// The command line; `$OUT` stands for the path of the campaign's folder.
    pub command: String,
    /// SHA-256 of each input file or folder. The key is its path in the command.
    pub inputs: BTreeMap<String, String>,
    /// SHA-256 of each output file that later cells may read. The key is the file's name in the cell's folder.
    pub files: BTreeMap<String, String>,
    /// Measured quantities by name, such as `easy.mean_deg`, the mean attitude error at moderate angles in degrees.
    pub metrics: BTreeMap<String, f64>,
    /// Learning curve of a trained policy: the values of each column, by column name. Empty if no policy was trained.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub curve: BTreeMap<String, Vec<f64>>,
}

impl Record {
    /// Name and version of the format that this program writes.
    pub const SCHEMA: &str = "greylag.cell/1";

    /// Whether this is a result of the stage `stage` and has all of `levels` (axis and level).
    pub fn has(&self, stage: &str, levels: &BTreeMap<String, String>) -> bool {
        let same = |(axis, level): (&String, &String)| self.levels.get(axis) == Some(level);
        self.stage == stage && levels.iter().all(same)
    }
}

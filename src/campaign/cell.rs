//! A cell: one command line of a campaign, and its result line.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Placeholder for the campaign's folder in a cell's command line and in recorded commands.
pub const OUT: &str = "$OUT";
/// Number of hexadecimal digits of the identity in a folder name.
const SHORT: usize = 12;

/// A planned cell: one run of a stage's command at one combination of levels.
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
    /// SHA-256 of each input, by its name in the command.
    pub inputs: BTreeMap<String, String>,
    /// Numbers of the cells whose folders this cell reads.
    pub after: Vec<usize>,
    /// SHA-256 over the program's version (not its commit), [`words`](Cell::words) and [`inputs`](Cell::inputs). It
    /// depends on earlier cells, because `words` name their folders and a folder's name contains the identity. The
    /// folder of this cell is excluded. Equal identities mean equal results.
    pub identity: String,
}

impl Cell {
    /// Name of the cell's folder. It contains the start of the identity. A cell with another command or input therefore has
    /// another folder.
    pub fn folder(&self) -> String {
        format!("{}-{}", self.stem(), &self.identity[..SHORT.min(self.identity.len())])
    }

    /// Folder name without the identity.
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

    /// The command line as recorded: `greylag` and the words, separated by spaces.
    pub fn command(&self) -> String {
        self.words.iter().fold("greylag".into(), |line, word| line + " " + word)
    }
}

/// Result of a cell: one line of a campaign's results. It contains no time and no path of a machine. The same cell
/// therefore gives the same line to the bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Name and version of the line's schema.
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
    /// Identity of the cell, [`identity`](Cell::identity).
    pub identity: String,
    /// Version and build of the program.
    pub program: String,
    /// The command line; `$OUT` stands for the path of the campaign's folder.
    pub command: String,
    /// SHA-256 of the cell's inputs, by their names in the command.
    pub inputs: BTreeMap<String, String>,
    /// SHA-256 of the output files that later cells read, by their names in the folder.
    pub files: BTreeMap<String, String>,
    /// Measured quantities by name, such as `easy.mean_deg`.
    pub metrics: BTreeMap<String, f64>,
    /// Learning curve: the values of each column, by column name. Empty without a learning curve.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub curve: BTreeMap<String, Vec<f64>>,
}

impl Record {
    /// The schema that this program writes.
    pub const SCHEMA: &str = "greylag.cell/1";

    /// Whether this is a result of the stage `stage` with all of `levels`.
    pub fn has(&self, stage: &str, levels: &BTreeMap<String, String>) -> bool {
        let same = |(axis, level): (&String, &String)| self.levels.get(axis) == Some(level);
        self.stage == stage && levels.iter().all(same)
    }
}

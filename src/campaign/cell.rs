//! A cell: one command line of a campaign, and its result line.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Placeholder of the campaign's folder in a cell's words and in recorded commands.
pub const OUT: &str = "$OUT";
/// Digits of the identity in a folder name.
const SHORT: usize = 12;

/// A planned cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Its number, from 1: the index of a job array.
    pub number: usize,
    /// Stage and levels: `dynamics/severe/trainable/1`.
    pub id: String,
    /// Name of its stage.
    pub stage: String,
    /// The level of each axis that its stage varies, including the seed.
    pub levels: BTreeMap<String, String>,
    /// The command line without the program's name; [`OUT`] replaces the campaign's folder.
    pub words: Vec<String>,
    /// SHA-256 of each input, by its name in the command.
    pub inputs: BTreeMap<String, String>,
    /// Numbers of the cells whose folders it reads.
    pub after: Vec<usize>,
    /// SHA-256 over the program's version (not its commit), [`words`](Cell::words) and [`inputs`](Cell::inputs).
    /// Earlier cells enter through their folders in `words`, whose names hold their identities; the cell's own folder
    /// does not enter. The same identity means the same result.
    pub identity: String,
}

impl Cell {
    /// Folder name: another command or input gives another folder, so that results do not mix.
    pub fn folder(&self) -> String {
        format!("{}-{}", self.stem(), &self.identity[..SHORT.min(self.identity.len())])
    }

    /// Folder name without the identity.
    pub fn stem(&self) -> String {
        self.id.replace('/', "-")
    }

    /// The seed, if its stage varies it.
    pub fn seed(&self) -> Option<u64> {
        self.levels.get(super::file::SEED)?.parse().ok()
    }

    /// Its words with [`OUT`] replaced by the campaign's folder.
    pub fn words_in(&self, folder: &Path) -> Vec<String> {
        let folder = folder.display().to_string();
        self.words.iter().map(|word| word.replace(OUT, &folder)).collect()
    }

    /// The command as recorded.
    pub fn command(&self) -> String {
        self.words.iter().fold("greylag".into(), |line, word| line + " " + word)
    }
}

/// Result of a cell: a line of a campaign's results. It holds no time and no path of a machine, so that the same cell
/// gives the same line to the bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Schema of the line.
    pub schema: String,
    /// Name of the campaign.
    pub campaign: String,
    /// Id of the cell.
    pub cell: String,
    /// Name of its stage.
    pub stage: String,
    /// Levels of its axes.
    pub levels: BTreeMap<String, String>,
    /// Its random seed.
    pub seed: Option<u64>,
    /// Identity of the cell, [`identity`](Cell::identity).
    pub identity: String,
    /// The program and its build.
    pub program: String,
    /// The command; `$OUT` is the campaign's folder.
    pub command: String,
    /// SHA-256 of its inputs.
    pub inputs: BTreeMap<String, String>,
    /// SHA-256 of its output files that other cells read.
    pub files: BTreeMap<String, String>,
    /// Measured quantities by name.
    pub metrics: BTreeMap<String, f64>,
    /// Points of a learning curve, by column.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub curve: BTreeMap<String, Vec<f64>>,
}

impl Record {
    /// The schema that this program writes.
    pub const SCHEMA: &str = "greylag.cell/1";

    /// Whether it is a result of the stage `stage` with the given levels.
    pub fn has(&self, stage: &str, levels: &BTreeMap<String, String>) -> bool {
        let same = |(axis, level): (&String, &String)| self.levels.get(axis) == Some(level);
        self.stage == stage && levels.iter().all(same)
    }
}

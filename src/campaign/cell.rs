//! A cell: one command line of a campaign, and the line that it gives.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// What stands for the campaign's folder in a cell's words and in recorded commands.
pub const OUT: &str = "$OUT";
/// Digits of the identity in a folder's name.
const SHORT: usize = 12;

/// A cell that is planned.
#[derive(Clone, Debug, PartialEq)]
pub struct Cell {
    /// Its number, from 1: what an array of jobs counts.
    pub number: usize,
    /// Stage and levels: `dynamics/severe/trainable/1`.
    pub id: String,
    /// Its stage.
    pub stage: String,
    /// The level of each axis that its stage varies, the seed too.
    pub levels: BTreeMap<String, String>,
    /// The command line without the program's name; [`OUT`] stands for the campaign's folder.
    pub words: Vec<String>,
    /// SHA-256 of each input, by its name in the command.
    pub inputs: BTreeMap<String, String>,
    /// Numbers of the cells whose folders it reads.
    pub after: Vec<usize>,
    /// SHA-256 over the program's version (not its commit), [`words`](Cell::words) and [`inputs`](Cell::inputs). The
    /// cells before count by their folders in `words`, whose names hold their identities; the cell's own folder does
    /// not count. The same identity means the same result.
    pub identity: String,
}

impl Cell {
    /// The name of its folder: another command or input gives another folder, so results do not mix.
    pub fn folder(&self) -> String {
        format!("{}-{}", self.stem(), &self.identity[..SHORT.min(self.identity.len())])
    }

    /// What its folder is called before the identity.
    pub fn stem(&self) -> String {
        self.id.replace('/', "-")
    }

    /// Its seed, if its stage varies that.
    pub fn seed(&self) -> Option<u64> {
        self.levels.get(super::file::SEED)?.parse().ok()
    }

    /// Its words with the campaign's folder in place of [`OUT`].
    pub fn words_in(&self, folder: &Path) -> Vec<String> {
        let folder = folder.display().to_string();
        self.words.iter().map(|word| word.replace(OUT, &folder)).collect()
    }

    /// Its command as it is recorded.
    pub fn command(&self) -> String {
        self.words.iter().fold("greylag".into(), |line, word| line + " " + word)
    }
}

/// What a cell gave: a line of a campaign's results. It holds no time and no path of a machine, so that the same cell
/// gives the same line to the bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// The layout.
    pub schema: String,
    /// The campaign's name.
    pub campaign: String,
    /// The cell.
    pub cell: String,
    /// Its stage.
    pub stage: String,
    /// Its levels.
    pub levels: BTreeMap<String, String>,
    /// Its seed.
    pub seed: Option<u64>,
    /// The cell's [`identity`](Cell::identity).
    pub identity: String,
    /// The program and its build.
    pub program: String,
    /// Its command; `$OUT` is the campaign's folder.
    pub command: String,
    /// SHA-256 of its inputs.
    pub inputs: BTreeMap<String, String>,
    /// SHA-256 of the files that it wrote and that others read.
    pub files: BTreeMap<String, String>,
    /// What was measured.
    pub metrics: BTreeMap<String, f64>,
    /// Points of a learning curve by their columns.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub curve: BTreeMap<String, Vec<f64>>,
}

impl Record {
    /// The layout that this program writes.
    pub const SCHEMA: &str = "greylag.cell/1";

    /// Whether its levels are those that are asked for.
    pub fn has(&self, stage: &str, levels: &BTreeMap<String, String>) -> bool {
        let same = |(axis, level): (&String, &String)| self.levels.get(axis) == Some(level);
        self.stage == stage && levels.iter().all(same)
    }
}

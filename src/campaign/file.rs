//! The campaign file: axes, seeds, stages, tables and claims.
//!
//! A campaign runs commands of this program many times. An axis is a varied setting, for example the controller. Its
//! levels are the values of the setting. A cell is one command line with one combination of levels.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::error::CampaignError;
use greylag_model::residual::hash;

/// Version of the file schema that this program reads.
const SCHEMA: u32 = 1;
/// Name of the seed axis, which every campaign has.
pub const SEED: &str = "seed";

/// Contents of a campaign file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    schema: u32,
    /// Name of the campaign and of its folder.
    pub name: String,
    /// Purpose in one sentence.
    #[serde(default)]
    pub about: String,
    /// Random seeds: the levels of the seed axis.
    pub seeds: Vec<u64>,
    /// Axes in addition to the seed.
    #[serde(default)]
    pub axes: BTreeMap<String, Vec<Level>>,
    /// Stages in order. A stage may read the output of the stages before it.
    #[serde(rename = "stage")]
    pub stages: Vec<StageFile>,
    /// Tables of summary statistics.
    #[serde(default, rename = "table")]
    pub tables: Vec<TableFile>,
    /// Claims that are tested with the results.
    #[serde(default, rename = "claim")]
    pub claims: Vec<ClaimFile>,
    /// SHA-256 of the file.
    #[serde(skip)]
    pub sha256: String,
}

/// A level of an axis: its name, and the words that it inserts into a command.
#[derive(Clone, Debug, Deserialize)]
#[serde(from = "LevelFile")]
pub struct Level {
    /// Name in tables.
    pub name: String,
    /// Words that the level inserts into a command; may be empty.
    pub words: String,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum LevelFile {
    Word(String),
    Named { name: String, words: String },
}

impl From<LevelFile> for Level {
    fn from(file: LevelFile) -> Level {
        match file {
            LevelFile::Word(word) => Level { name: word.clone(), words: word },
            LevelFile::Named { name, words } => Level { name, words },
        }
    }
}

/// A stage: one command, run for every combination of the levels of its axes. Each run is a cell.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageFile {
    /// Name of the stage. The command of a later stage refers to the output of this stage by the placeholder `{name}`.
    pub name: String,
    /// The axes that the stage varies.
    pub over: Vec<String>,
    /// The command line without `greylag`. It may contain placeholders in braces. `{out}` stands for the output folder of
    /// the cell, `{seed}` for its seed. The name of an axis stands for the words of the cell's level. The name of an earlier
    /// stage stands for the output folder of its cell with the same levels.
    pub command: String,
    /// Input files that the command reads although the command line does not name them.
    #[serde(default)]
    pub inputs: Vec<String>,
    /// Estimated processor time of one cell, s, summed over cores. It is used until the time of a cell has been measured.
    pub core_seconds: Option<f64>,
}

/// A table: a quantity of a stage, summarised over seeds.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableFile {
    /// Title of the table.
    pub title: String,
    /// The cells that the table summarises: the name of their stage, then the levels that they must have, in the form
    /// `stage axis=level …`.
    pub stage: String,
    /// The table has one row for each combination of the levels of these axes. All other axes except the seed divide the
    /// cells of a row into strata, which the bootstrap resamples separately.
    pub rows: Vec<String>,
    /// Names of the summarised quantities in the cells' results, such as `easy.mean_deg`.
    pub metrics: Vec<String>,
    /// Unit of the quantities as text; may be empty.
    #[serde(default)]
    pub unit: String,
    /// Id of the published table in [`super::published`] to compare with; `None` without comparison.
    pub paper: Option<String>,
}

/// A claim: the mean of a quantity is smaller over one group of cells than over another.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClaimFile {
    /// The claim as text.
    pub says: String,
    /// Name of the quantity.
    pub metric: String,
    /// The group that is claimed to have the smaller mean, as stage and levels: `stage axis=level …`.
    pub less: String,
    /// The group that is claimed to have the larger mean, in the same form.
    pub than: String,
}

impl CampaignFile {
    /// Reads a campaign file and checks its contents.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, does not follow the schema, or names an axis, level, stage or published table that
    /// does not exist.
    pub fn load(path: &Path) -> Result<CampaignFile, CampaignError> {
        let text = greylag_physics::text_file::read(path)
            .map_err(|source| CampaignError::Read { path: path.into(), source })?;
        CampaignFile::parse(&text).map_err(|why| CampaignError::File { path: path.into(), why })
    }

    /// Parses and checks the text of a campaign file. The error is a text that describes the fault.
    ///
    /// # Errors
    ///
    /// If the text does not follow the schema, or names an axis, level, stage or published table that does not exist.
    pub fn parse(text: &str) -> Result<CampaignFile, String> {
        let mut file: CampaignFile =
            toml::from_str(text).map_err(|e| greylag_physics::airframe::toml_error(text, &e))?;
        file.sha256 = hash(text.as_bytes());
        file.check()?;
        Ok(file)
    }

    fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("schema {}: this program reads schema {SCHEMA}", self.schema));
        }
        plain("name", &self.name)?;
        distinct("seed", self.seeds.iter().map(ToString::to_string))?;
        distinct("stage", self.stages.iter().map(|s| s.name.clone()))?;
        for (axis, levels) in &self.axes {
            plain("axis", axis)?;
            if [SEED, "out"].contains(&axis.as_str()) {
                return Err(format!(
                    "axis {axis}: every campaign has {{{axis}}}; choose another name"
                ));
            }
            levels.iter().try_for_each(|level| plain("level", &level.name))?;
            distinct(&format!("level of axis {axis}"), levels.iter().map(|l| l.name.clone()))?;
        }
        self.stages.iter().try_for_each(|stage| self.check_stage(stage))?;
        self.tables.iter().try_for_each(|table| self.check_table(table))?;
        self.claims.iter().try_for_each(|claim| {
            let about = |why: String| format!("claim {:?}: {why}", claim.says);
            [&claim.less, &claim.than]
                .into_iter()
                .try_for_each(|of| self.choice(of).map(|_| ()))
                .map_err(about)
        })
    }

    fn check_stage(&self, stage: &StageFile) -> Result<(), String> {
        plain("stage", &stage.name)?;
        if [SEED, "out"].contains(&stage.name.as_str()) || self.axes.contains_key(&stage.name) {
            return Err(format!(
                "stage {0}: in a command {{{0}}} is no folder of a stage; choose another name",
                stage.name
            ));
        }
        distinct(&format!("axis of stage {}", stage.name), stage.over.iter().cloned())?;
        for axis in &stage.over {
            self.known_axis(axis).map_err(|why| format!("stage {}: {why}", stage.name))?;
        }
        match stage.core_seconds {
            Some(s) if !(s.is_finite() && s > 0.0) => Err(format!(
                "stage {}: core_seconds = {s}: give the seconds of a core that a cell takes, or leave it out",
                stage.name
            )),
            _ => Ok(()),
        }
    }

    fn check_table(&self, table: &TableFile) -> Result<(), String> {
        let about = |why: String| format!("table {:?}: {why}", table.title);
        let (stage, _) = self.choice(&table.stage).map_err(about)?;
        let stage = self.stage(&stage).map_err(about)?;
        if let Some(axis) = table.rows.iter().find(|axis| !stage.over.contains(axis)) {
            let over = stage.over.join(", ");
            return Err(about(format!("stage {} does not vary {axis}, only {over}", stage.name)));
        }
        match &table.paper {
            Some(id) if !super::published::tables().contains(&id.as_str()) => Err(about(format!(
                "paper = {id:?} is none of {}",
                super::published::tables().join(", ")
            ))),
            _ => Ok(()),
        }
    }

    fn known_axis(&self, axis: &str) -> Result<(), String> {
        if axis == SEED || self.axes.contains_key(axis) {
            return Ok(());
        }
        let known: Vec<&str> = self.axes.keys().map(String::as_str).chain([SEED]).collect();
        Err(format!("there is no axis {axis}; there are {}", known.join(", ")))
    }

    /// The stage called `name`.
    ///
    /// # Errors
    ///
    /// If the campaign has no such stage. The text of the error lists the stages.
    pub fn stage(&self, name: &str) -> Result<&StageFile, String> {
        self.stages.iter().find(|stage| stage.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.stages.iter().map(|s| s.name.as_str()).collect();
            format!("there is no stage {name}; there are {}", known.join(", "))
        })
    }

    /// Parses `text` of the form `stage axis=level …`. Returns the name of the stage, and the level of each axis in `text`.
    ///
    /// # Errors
    /// If there is no such stage, axis or level, or if the stage does not vary the axis.
    pub fn choice(&self, text: &str) -> Result<(String, BTreeMap<String, String>), String> {
        let about = |why: String| format!("{text:?}: {why}");
        let mut words = text.split_whitespace();
        let stage = self.stage(words.next().unwrap_or_default()).map_err(about)?;
        let levels = levels(words).map_err(about)?;
        levels.iter().try_for_each(|(axis, level)| self.known_level(axis, level)).map_err(about)?;
        if let Some(axis) = levels.keys().find(|axis| !stage.over.contains(axis)) {
            let (name, over) = (&stage.name, stage.over.join(", "));
            return Err(about(format!("stage {name} does not vary {axis}, only {over}")));
        }
        Ok((stage.name.clone(), levels))
    }

    /// Fails if the axis does not exist or does not have the level.
    pub(super) fn known_level(&self, axis: &str, level: &str) -> Result<(), String> {
        self.known_axis(axis)?;
        let known = self.levels(axis);
        match known.iter().any(|l| l.name == level) {
            true => Ok(()),
            false => {
                let names: Vec<&str> = known.iter().map(|l| l.name.as_str()).collect();
                Err(format!("axis {axis} has no level {level}; it has {}", names.join(", ")))
            }
        }
    }

    /// The levels of `axis`. The levels of the seed axis are the seeds. An unknown axis has no levels.
    pub fn levels(&self, axis: &str) -> Vec<Level> {
        if axis != SEED {
            return self.axes.get(axis).cloned().unwrap_or_default();
        }
        let level = |seed: &u64| Level { name: seed.to_string(), words: seed.to_string() };
        self.seeds.iter().map(level).collect()
    }
}

/// Parses words of the form `axis=level`. Returns the level of each axis.
pub(super) fn levels<'a>(
    words: impl Iterator<Item = &'a str>,
) -> Result<BTreeMap<String, String>, String> {
    words
        .map(|word| match word.split_once('=') {
            Some((axis, level)) => Ok((axis.to_owned(), level.to_owned())),
            None => Err(format!("{word}: write axis=level")),
        })
        .collect()
}

/// Fails unless `name` consists of characters that are portable in folder names.
fn plain(what: &str, name: &str) -> Result<(), String> {
    let good = |c: char| c.is_ascii_alphanumeric() || "_-.+".contains(c);
    match !name.is_empty() && name.chars().all(good) {
        true => Ok(()),
        false => Err(format!("{what} {name:?}: use letters, digits, - _ . + only")),
    }
}

fn distinct(what: &str, names: impl Iterator<Item = String>) -> Result<(), String> {
    let mut names: Vec<String> = names.collect();
    if names.is_empty() {
        return Err(format!("there is no {what}; name at least one"));
    }
    names.sort();
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        None => Ok(()),
        Some(pair) => Err(format!("{what} {} is there twice", pair[0])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "schema = 1\nname = \"a\"\nseeds = [1]\n[axes]\nkind = [\"x\"]\nother = [\"y\"]\n\
        [[stage]]\nname = \"last\"\nover = [\"kind\", \"seed\"]\ncommand = \"evaluate {kind}\"\n";

    #[test]
    fn a_choice_of_an_axis_that_the_stage_does_not_vary_is_refused() {
        let file = CampaignFile::parse(TEXT).unwrap();
        assert!(file.choice("last kind=x").is_ok());
        let why = file.choice("last other=y").unwrap_err();
        assert!(why.contains("stage last does not vary other, only kind, seed"), "{why}");
    }

    #[test]
    fn a_stage_whose_placeholder_means_something_else_is_refused() {
        for name in ["out", "seed", "kind"] {
            let text = TEXT.replace("name = \"last\"", &format!("name = \"{name}\""));
            let why = CampaignFile::parse(&text).unwrap_err();
            assert!(why.contains("choose another name"), "{why}");
        }
    }
}

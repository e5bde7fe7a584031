//! Expands a campaign file into cells, the single runs of a campaign.
//!
//! The file lists stages and axes. A stage is a command with placeholders. An axis is a quantity that is varied, such as the
//! seed, and its values are called levels. A cell is the command of one stage with one level of each axis that it varies.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::cell::{Cell, OUT};
use super::error::CampaignError;
use super::file::{CampaignFile, Level, StageFile, levels};
use greylag_model::GreyBox;
use greylag_model::residual::hash;

/// Placeholder in a stage's command. It stands for the output folder of the cell.
const OWN: &str = "{out}";

/// A campaign with its cells.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Contents of the campaign file.
    pub file: CampaignFile,
    /// The cells, ordered so that each cell stands after the cells whose folders it reads.
    pub cells: Vec<Cell>,
}

/// Expands `file`, which was read from `path`, into cells. `find` maps a path in a command to the path of the existing file.
///
/// # Errors
///
/// If a command has an unknown placeholder, or names a file that does not exist or cannot be read, or if two cells of a stage
/// have different seeds and the same command.
pub fn plan(
    file: CampaignFile,
    path: &Path,
    find: &dyn Fn(&Path) -> PathBuf,
) -> Result<Plan, CampaignError> {
    let mut cells: Vec<Cell> = Vec::new();
    let mut hashes = BTreeMap::new();
    for stage in &file.stages {
        for levels in combinations(&file, stage) {
            let about = |why: String| CampaignError::File {
                path: path.into(),
                why: format!("stage {}: {why}", stage.name),
            };
            let draft = Draft { file: &file, stage, levels: &levels, cells: &cells };
            let (words, after) = draft.words().map_err(about)?;
            let mut inputs = BTreeMap::new();
            for name in named_files(&words, stage) {
                if !hashes.contains_key(&name) {
                    hashes.insert(name.clone(), content(&find(Path::new(&name))).map_err(about)?);
                }
                inputs.insert(name.clone(), hashes[&name].clone());
            }
            let new = cell(cells.len() + 1, stage, &levels, words, inputs, after);
            distinct(&cells, &new).map_err(about)?;
            cells.push(new);
        }
    }
    Ok(Plan { file, cells })
}

/// Checks that no cell of `cells` has the stage, the command and the inputs of `new` but another seed. Otherwise copies of one
/// result would count as results of several seeds. Cells with the same seed may have the same command.
fn distinct(cells: &[Cell], new: &Cell) -> Result<(), String> {
    let same = |cell: &&Cell| {
        cell.stage == new.stage
            && cell.identity == new.identity
            && cell.levels.get("seed") != new.levels.get("seed")
    };
    match cells.iter().find(same) {
        Some(old) => Err(format!(
            "cells {} and {} have the same command; write {{seed}} into it",
            old.id, new.id
        )),
        None => Ok(()),
    }
}

impl Plan {
    /// The cell whose number or id is `name`.
    ///
    /// # Errors
    ///
    /// If the campaign has no such cell.
    pub fn cell(&self, name: &str) -> Result<&Cell, String> {
        let number: Option<usize> = name.parse().ok();
        let wanted = |cell: &&Cell| cell.id == name || Some(cell.number) == number;
        self.cells.iter().find(wanted).ok_or_else(|| {
            format!(
                "campaign {} has no cell {name}: it has 1 to {}; `greylag campaign plan` lists them",
                self.file.name,
                self.cells.len()
            )
        })
    }

    /// Numbers of the cells that any of `choices` selects, and of all cells that these read. A choice has the form
    /// `stage axis=level …`, as in a table of the campaign file. No choice selects all cells.
    ///
    /// # Errors
    ///
    /// If there is no such stage, axis or level, or if the stage does not vary the axis.
    pub fn only(&self, choices: &[String]) -> Result<BTreeSet<usize>, String> {
        if choices.is_empty() {
            return Ok((1..=self.cells.len()).collect());
        }
        let mut chosen = BTreeSet::new();
        for choice in choices {
            let (stage, levels) = self.file.choice(choice)?;
            let has = |cell: &&Cell| levels.iter().all(|(a, l)| cell.levels.get(a) == Some(l));
            chosen.extend(self.of_stage(&stage).filter(has).map(|cell| cell.number));
        }
        // a cell reads only cells before it
        for cell in self.cells.iter().rev() {
            if chosen.contains(&cell.number) {
                chosen.extend(&cell.after);
            }
        }
        Ok(chosen)
    }

    /// The cells of a stage.
    pub fn of_stage<'a>(&'a self, stage: &'a str) -> impl Iterator<Item = &'a Cell> {
        self.cells.iter().filter(move |cell| cell.stage == stage)
    }
}

/// Every combination of the levels of a stage's axes. The last axis varies fastest.
fn combinations(file: &CampaignFile, stage: &StageFile) -> Vec<Vec<(String, Level)>> {
    stage.over.iter().fold(vec![Vec::new()], |all, axis| {
        let with = |start: &Vec<(String, Level)>| {
            let add = |level: Level| [start.clone(), vec![(axis.clone(), level)]].concat();
            file.levels(axis).into_iter().map(add).collect::<Vec<_>>()
        };
        all.iter().flat_map(with).collect()
    })
}

/// A cell under construction.
struct Draft<'a> {
    file: &'a CampaignFile,
    stage: &'a StageFile,
    levels: &'a [(String, Level)],
    cells: &'a [Cell],
}

impl Draft<'_> {
    /// The words of the command line, and the numbers of the cells whose folders these words name.
    fn words(&self) -> Result<(Vec<String>, Vec<usize>), String> {
        let (mut words, mut after) = (Vec::new(), Vec::new());
        for word in self.stage.command.split_whitespace() {
            match self.level_of(word) {
                // the text of a level may be several words or none
                Some(level) => {
                    for word in level.words.split_whitespace() {
                        words.push(self.word(word, &mut after)?);
                    }
                }
                None => words.push(self.word(word, &mut after)?),
            }
        }
        after.sort_unstable();
        after.dedup();
        Ok((words, after))
    }

    fn level_of(&self, word: &str) -> Option<&Level> {
        let axis = word.strip_prefix('{')?.strip_suffix('}')?;
        self.levels.iter().find(|(name, _)| name == axis).map(|(_, level)| level)
    }

    /// Returns `word` with its placeholders substituted. Adds the numbers of the cells whose folders it names to `after`.
    fn word(&self, word: &str, after: &mut Vec<usize>) -> Result<String, String> {
        let (mut text, mut rest) = (String::new(), word);
        while let Some(start) = rest.find('{') {
            let end = rest.find('}').filter(|end| *end > start);
            let end = end.ok_or_else(|| format!("{word}: a {{ without its }}"))?;
            let name = &rest[start + 1..end];
            text += &rest[..start];
            text += &match self.levels.iter().find(|(axis, _)| axis == name) {
                Some((_, level)) => level.words.clone(),
                None if name == "out" => OWN.to_owned(),
                None => self.upstream(name, after)?,
            };
            rest = &rest[end + 1..];
        }
        Ok(text + rest)
    }

    /// Returns the folder of a cell of an earlier stage, and adds the number of that cell to `after`. `name` is `stage` or
    /// `stage:axis=level,…`. The cell has the levels given in `name`, and otherwise the levels of the present cell.
    fn upstream(&self, name: &str, after: &mut Vec<usize>) -> Result<String, String> {
        let (stage, chosen) = name.split_once(':').unwrap_or((name, ""));
        let given = levels(chosen.split(',').filter(|part| !part.is_empty()))?;
        given.iter().try_for_each(|(axis, level)| self.file.known_level(axis, level))?;
        let earlier: Vec<&Cell> = self.cells.iter().filter(|c| c.stage == stage).collect();
        let Some(first) = earlier.first() else {
            return Err(format!(
                "{{{name}}} is no axis of this stage and no stage before it; the axes are {}",
                self.stage.over.join(", ")
            ));
        };
        if let Some(axis) = given.keys().find(|axis| !first.levels.contains_key(*axis)) {
            return Err(format!("{{{name}}}: stage {stage} does not vary {axis}"));
        }
        let own: BTreeMap<&String, &String> =
            self.levels.iter().map(|(axis, level)| (axis, &level.name)).collect();
        let wanted = |axis: &String| given.get(axis).or_else(|| own.get(axis).copied());
        if let Some(axis) = first.levels.keys().find(|axis| wanted(axis).is_none()) {
            return Err(format!(
                "{{{name}}} varies {axis}, this stage does not: write {{{stage}:{axis}=LEVEL}}"
            ));
        }
        let same = |cell: &&&Cell| cell.levels.iter().all(|(axis, l)| wanted(axis) == Some(l));
        let Some(cell) = earlier.iter().find(same) else {
            return Err(format!("{{{name}}}: there is no such cell"));
        };
        after.push(cell.number);
        Ok(format!("{OUT}/{}", cell.folder()))
    }
}

fn cell(
    number: usize,
    stage: &StageFile,
    levels: &[(String, Level)],
    words: Vec<String>,
    inputs: BTreeMap<String, String>,
    after: Vec<usize>,
) -> Cell {
    let names = levels.iter().map(|(_, level)| level.name.as_str());
    let id = std::iter::once(stage.name.as_str()).chain(names).collect::<Vec<_>>().join("/");
    let what = (concat!("greylag ", env!("CARGO_PKG_VERSION")), &words, &inputs);
    let identity = hash(format!("{what:?}").as_bytes());
    let levels = levels.iter().map(|(axis, level)| (axis.clone(), level.name.clone())).collect();
    let stage = stage.name.clone();
    let mut cell = Cell { number, id, stage, levels, words, inputs, after, identity };
    let own = format!("{OUT}/{}", cell.folder());
    cell.words.iter_mut().for_each(|word| *word = word.replace(OWN, &own));
    cell
}

/// Input files of a command: the words that contain a slash, and the additional inputs of the stage. Words with a folder of
/// the campaign are excluded.
fn named_files(words: &[String], stage: &StageFile) -> Vec<String> {
    let named = words.iter().filter(|w| w.contains('/') && !w.contains(OUT) && !w.contains(OWN));
    // in `--env model:FOLDER` the path follows the colon
    let path = |word: &String| word.rsplit_once(':').map_or(word.as_str(), |(_, p)| p).to_owned();
    named.map(path).chain(stage.inputs.iter().cloned()).collect()
}

/// SHA-256 of a file, or of all files in a folder. For a model file, the SHA-256 also covers the files that the model reads.
fn content(path: &Path) -> Result<String, String> {
    let cannot = |e: std::io::Error| format!("cannot read {}: {e}", path.display());
    if path.extension().is_some_and(|e| e == "toml")
        && let Ok(model) = GreyBox::load(path)
    {
        return Ok(hash(format!("{} {:?}", model.sha256, model.airframe).as_bytes()));
    }
    if !path.is_dir() {
        return Ok(hash(&std::fs::read(path).map_err(cannot)?));
    }
    let entries = std::fs::read_dir(path).map_err(cannot)?;
    let mut paths = entries
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(cannot)?;
    paths.sort();
    let mut all = String::new();
    for path in paths {
        all += &format!("{:?} {}\n", path.file_name(), content(&path)?);
    }
    Ok(hash(all.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planned(text: &str) -> Result<Plan, CampaignError> {
        let file = CampaignFile::parse(text).unwrap();
        plan(file, Path::new("a.toml"), &|path: &Path| PathBuf::from(path))
    }

    #[test]
    fn a_stage_whose_command_leaves_out_an_axis_is_refused() {
        let text = "schema = 1\nname = \"a\"\nseeds = [1, 2]\n[axes]\nkind = [\"x\"]\n\
            [[stage]]\nname = \"first\"\nover = [\"seed\"]\ncommand = \"collect --out {out}\"\n";
        let why = planned(text).unwrap_err().to_string();
        assert!(why.contains("cells first/1 and first/2 have the same command"), "{why}");
        let seeded = planned(&text.replace("--out", "--seed {seed} --out")).unwrap();
        assert_eq!(seeded.cells.len(), 2);
    }

    #[test]
    fn a_level_that_an_earlier_stage_does_not_vary_is_refused() {
        let text = "schema = 1\nname = \"a\"\nseeds = [1]\n[axes]\nkind = [\"x\"]\n\
            [[stage]]\nname = \"first\"\nover = [\"seed\"]\ncommand = \"collect\"\n\
            [[stage]]\nname = \"last\"\nover = [\"kind\", \"seed\"]\ncommand = \"evaluate {first:kind=x}\"\n";
        let why = planned(text).unwrap_err().to_string();
        assert!(why.contains("stage first does not vary kind"), "{why}");
    }

    #[test]
    fn a_choice_selects_cells_and_those_that_they_read() {
        let text = "schema = 1\nname = \"a\"\nseeds = [1, 2]\n[axes]\nkind = [\"x\", \"y\"]\n\
            [[stage]]\nname = \"first\"\nover = [\"seed\"]\ncommand = \"collect --seed {seed}\"\n\
            [[stage]]\nname = \"last\"\nover = [\"kind\", \"seed\"]\ncommand = \"evaluate {first} {kind}\"\n";
        let plan = planned(text).unwrap();
        let only = |choices: &[&str]| {
            let choices: Vec<String> = choices.iter().map(|c| (*c).to_owned()).collect();
            let ids = |n: &usize| plan.cells[n - 1].id.clone();
            plan.only(&choices).map(|chosen| chosen.iter().map(ids).collect::<Vec<_>>())
        };
        assert_eq!(only(&["last kind=y seed=2"]).unwrap(), ["first/2", "last/y/2"]);
        assert_eq!(
            only(&["last seed=1", "first"]).unwrap(),
            ["first/1", "first/2", "last/x/1", "last/y/1"]
        );
        assert_eq!(only(&[]).unwrap().len(), 6);
        assert!(only(&["first kind=x"]).unwrap_err().contains("does not vary kind"));
    }
}

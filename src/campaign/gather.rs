//! Collects the results of a campaign's cells and lists the cells without a result.
//!
//! A cell is one run of a stage's command at one combination of the levels of the campaign's axes.

use std::path::Path;

use super::cell::{Cell, Record};
use super::error::CampaignError;
use super::plan::Plan;
use super::store::{Failure, Standing, Store, Times, whole};

/// State of a campaign.
#[derive(Clone, Debug, Default)]
pub struct Gathered {
    /// The results, in the order of the cells.
    pub records: Vec<Record>,
    /// Computing times of the finished cells, as far as recorded. [`Times::cell`] is the id of the cell.
    pub times: Vec<Times>,
    /// Ids of the cells that failed permanently, with the reasons.
    pub failed: Vec<(String, Failure)>,
    /// Ids of the cells that have started and have no result.
    pub begun: Vec<String>,
    /// Ids of the cells without a valid result that have a result of another command, input or program version on disk.
    pub stale: Vec<String>,
    /// Ids of the cells that have not started and have no such old result.
    pub missing: Vec<String>,
}

/// Outcome of an import of results.
#[derive(Clone, Debug, Default)]
pub struct Joined {
    /// Number of imported results.
    pub taken: usize,
    /// Number of results that were not imported because their cells already have a result with equal measurements.
    pub twice: usize,
    /// Ids of the cells whose present result has other measurements than the result that was to be imported.
    pub differing: Vec<String>,
    /// Number of results that fit no cell of the plan, because the id, the command, an input or the program version differs.
    pub foreign: usize,
}

/// Reads the state of every cell.
///
/// # Errors
///
/// If a result, a failure record or a time record exists and cannot be read, or if a result belongs to another cell.
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

    /// Imports the results `others`, for instance those of another machine, for the cells of `plan` that have no result yet.
    ///
    /// A present result is never replaced. A result of another command, input or program version is not imported.
    pub fn join(&mut self, plan: &Plan, others: Vec<Record>) -> Joined {
        let mut joined = Joined::default();
        for other in others {
            let of_it = |cell: &Cell| cell.id == other.cell && cell.identity == other.identity;
            if !plan.cells.iter().any(of_it) {
                joined.foreign += 1;
                continue;
            }
            match self.records.iter().find(|own| own.cell == other.cell) {
                Some(own) if own.metrics == other.metrics => joined.twice += 1,
                Some(_) => joined.differing.push(other.cell),
                None => {
                    joined.taken += 1;
                    for rest in [&mut self.begun, &mut self.stale, &mut self.missing] {
                        rest.retain(|id| *id != other.cell);
                    }
                    self.failed.retain(|(id, _)| *id != other.cell);
                    self.records.push(other);
                }
            }
        }
        let place = |record: &Record| plan.cells.iter().position(|cell| cell.id == record.cell);
        self.records.sort_by_cached_key(place);
        joined
    }

    /// Whether every cell has a result.
    pub fn is_whole(&self) -> bool {
        let rest = [&self.begun, &self.stale, &self.missing];
        self.failed.is_empty() && rest.iter().all(|cells| cells.is_empty())
    }
}

/// Writes `lines` to a file, each as one line of JSON.
///
/// # Errors
/// If a line cannot be written as JSON, or the file cannot be written.
pub fn write_lines<T: serde::Serialize>(path: &Path, lines: &[T]) -> Result<(), CampaignError> {
    let mut text = String::new();
    for line in lines {
        text += &serde_json::to_string(line).map_err(|e| CampaignError::content(path, e))?;
        text.push('\n');
    }
    whole(path, text)
}

/// Reads the results from a file written by [`write_lines`].
///
/// # Errors
///
/// If the file cannot be read, or a line is not a valid result or has another schema.
pub fn read_lines(path: &Path) -> Result<Vec<Record>, CampaignError> {
    let text = std::fs::read_to_string(path).map_err(CampaignError::io("cannot read", path))?;
    let line = |(number, line): (usize, &str)| {
        let wrong = |e: String| {
            CampaignError::content(path, format!("line {}: is no result: {e}", number + 1))
        };
        let record: Record = serde_json::from_str(line).map_err(|e| wrong(e.to_string()))?;
        match record.schema == Record::SCHEMA {
            true => Ok(record),
            false => Err(wrong(format!(
                "its schema is {:?}, and this program reads {}",
                record.schema,
                Record::SCHEMA
            ))),
        }
    };
    text.lines().enumerate().map(line).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use super::super::file::CampaignFile;
    use super::super::plan::plan;
    use super::super::tables::{Outcome, findings, summaries};
    use super::*;

    const TEXT: &str = "schema = 1\nname = \"a\"\nseeds = [1, 2, 3]\n[axes]\nkind = [\"x\", \"y\"]\n\
        [[stage]]\nname = \"first\"\nover = [\"seed\"]\ncommand = \"collect --from INPUT --seed {seed} --out {out}\"\n\
        [[stage]]\nname = \"last\"\nover = [\"kind\", \"seed\"]\ncommand = \"evaluate {first} {kind} {first:seed=1}\"\n\
        [[table]]\ntitle = \"t\"\nstage = \"last\"\nrows = [\"kind\"]\nmetrics = [\"easy.mean_deg\"]\n\
        [[claim]]\nsays = \"x is less\"\nmetric = \"easy.mean_deg\"\nless = \"last kind=x\"\nthan = \"last kind=y\"\n";

    fn planned(input: &Path) -> Plan {
        let text = TEXT.replace("INPUT", &input.display().to_string());
        let file = CampaignFile::parse(&text).unwrap();
        plan(file, Path::new("a.toml"), &|path: &Path| PathBuf::from(path)).unwrap()
    }

    /// Claims `cell` and stores a result whose measurement `easy.mean_deg` is `value`.
    fn finish(store: &Store, cell: &Cell, value: f64) {
        let claimed = store.claim(cell).unwrap().unwrap();
        assert!(store.claim(cell).unwrap().is_none(), "a cell is run by one process");
        let record = Record {
            schema: Record::SCHEMA.into(),
            campaign: "a".into(),
            cell: cell.id.clone(),
            stage: cell.stage.clone(),
            levels: cell.levels.clone(),
            seed: cell.seed(),
            identity: cell.identity.clone(),
            program: "greylag".into(),
            command: cell.command(),
            inputs: cell.inputs.clone(),
            files: BTreeMap::new(),
            metrics: [("easy.mean_deg".to_owned(), value)].into(),
            curve: BTreeMap::new(),
        };
        let times = Times {
            cell: cell.id.clone(),
            seconds: 1.0,
            core_seconds: 1.0,
            resumed: claimed.resumed,
            ended_unix_s: 0,
            processor: String::new(),
            program: String::new(),
        };
        claimed.finish(&record, &times).unwrap();
    }

    #[test]
    fn cells_are_gathered_named_and_summed_up() {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("input.csv");
        std::fs::write(&input, "1").unwrap();
        let store = Store::new(&folder.path().join("out"));
        let planned_first = planned(&input);
        assert_eq!(planned_first.cells.len(), 3 + 6);
        let last = &planned_first.cells[4];
        assert_eq!((last.id.as_str(), last.after.as_slice()), ("last/x/2", &[1, 2][..]));
        for (cell, value) in planned_first.cells.iter().zip([0., 0., 0., 1., 2., 3., 11., 12., 13.])
        {
            finish(&store, cell, value);
        }
        let all = gather(&planned_first, &store).unwrap();
        assert!(all.is_whole() && all.records.len() == 9 && all.times.len() == 9);
        let path = folder.path().join("all.jsonl");
        write_lines(&path, &all.records).unwrap();
        assert_eq!(read_lines(&path).unwrap(), all.records);

        let summary = &summaries(&planned_first.file, &all.records)[0];
        assert_eq!(summary.rows[1].ours.mean.value, 12.0);
        assert_eq!(summary.rows[1].runs[2].cell, "last/y/3");
        // a table can be restricted to the cells at one level of an axis
        let mut chosen = planned_first.file.clone();
        (chosen.tables[0].stage, chosen.tables[0].rows) = ("last kind=y".into(), Vec::new());
        let summary = &summaries(&chosen, &all.records)[0];
        assert_eq!((summary.rows.len(), summary.rows[0].ours.mean.value), (1, 12.0));
        let found = &findings(&planned_first.file, &all.records).unwrap()[0];
        assert_eq!(found.outcome, Outcome::Holds, "{}", found.because);
        // if all cells have the same seed, they do not show the spread over seeds
        let mut one = all.records.clone();
        one.iter_mut().for_each(|record| record.seed = Some(1));
        let found = &findings(&planned_first.file, &one).unwrap()[0];
        assert_eq!(found.outcome, Outcome::Undecided, "{}", found.because);
        let found = &findings(&planned_first.file, &all.records[..6]).unwrap()[0];
        assert_eq!(found.outcome, Outcome::NoData);
        assert_eq!(found.because, "no cell of last kind=y has easy.mean_deg");

        // results of another machine are imported for cells without a result
        let (mut partly, mut elsewhere) = (all.clone(), all.records.clone());
        // a decimal parser that rounds inexactly would change the last bit of this value
        elsewhere[1].metrics.insert("easy.mean_deg".to_owned(), 0.001_848_630_997_957_734_2);
        write_lines(&path, &elsewhere).unwrap();
        assert_eq!(read_lines(&path).unwrap(), elsewhere);
        elsewhere[1] = all.records[1].clone();
        elsewhere[0].metrics.insert("easy.mean_deg".to_owned(), 7.0);
        elsewhere[8].identity = "of another input".into();
        let absent = partly.records.split_off(2);
        partly.missing = absent.iter().map(|r| r.cell.clone()).collect();
        let joined = partly.join(&planned_first, elsewhere);
        assert_eq!((joined.taken, joined.twice, joined.foreign), (6, 1, 1));
        assert_eq!(joined.differing, ["first/1"]);
        assert_eq!(partly.missing, [absent[6].cell.as_str()]);
        assert_eq!(partly.records, all.records[..8]);

        // another input changes the identities of the cells, so that the old results are stale
        std::fs::write(&input, "2").unwrap();
        let planned_again = planned(&input);
        finish(&store, &planned_again.cells[0], 0.0);
        store.claim(&planned_again.cells[1]).unwrap().unwrap();
        let all = gather(&planned_again, &store).unwrap();
        assert_eq!(all.records.len(), 1);
        assert_eq!(all.begun, ["first/2"]);
        assert_eq!((all.stale.len(), all.missing.len()), (7, 0));
    }

    #[test]
    fn a_line_that_is_no_result_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jsonl");
        std::fs::write(&path, "{}\n").unwrap();
        assert!(read_lines(&path).unwrap_err().to_string().contains("line 1: is no result"));
        let line = r#"{"schema":"greylag.cell/2","campaign":"a","cell":"c","stage":"s","levels":{},"seed":1,"identity":"",
            "program":"","command":"","inputs":{},"files":{},"metrics":{}}"#;
        std::fs::write(&path, line.replace('\n', "")).unwrap();
        let why = read_lines(&path).unwrap_err().to_string();
        assert!(why.contains("line 1: is no result: its schema is \"greylag.cell/2\""), "{why}");
        std::fs::write(&path, line.replace('\n', "").replace("cell/2", "cell/1")).unwrap();
        assert_eq!(read_lines(&path).unwrap().len(), 1);
    }
}

//! `greylag train curves`: compares the learning curves of trainings.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::Table;

use crate::commands::files::{self, Overwrite};
use crate::commands::outputs;
use crate::learn::policy::learning_curve::{self, CURVE, CurvePoint, best};
use crate::logs::quoted;
use crate::report::{LearningReport, Training};

/// Prefix of the folder of one seed in a training of several seeds.
const SEED: &str = "seed-";

/// Options of `greylag train curves`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Output folders of `greylag train policy`, each with one or several seeds.
    #[arg(required = true)]
    folders: Vec<PathBuf>,
    /// Also draw the curves as an HTML page.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Replace the page if it exists.
    #[arg(long)]
    force: bool,
}

/// Prints the results of the trainings and, with `--report`, draws their curves.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let overwrite = Overwrite::from(arguments.force);
    let seeds = arguments.folders.iter().flat_map(|folder| folders_of_seeds(folder)).flatten();
    let curves = seeds.map(|(_, folder)| folder.join(CURVE));
    outputs::check(&arguments.report, curves, overwrite)?;
    let trainings =
        arguments.folders.iter().map(|f| training(f)).collect::<Result<Vec<Training>>>()?;
    let report = report("Learning curves", &arguments.folders, &trainings);
    let table = report.table();
    let mut printed = Table::new();
    printed.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    printed.set_header(table.columns.iter().map(|c| &c.title));
    printed.add_rows(table.rows.iter().map(|row| &row.cells));
    println!("{printed}");
    if let Some(path) = &arguments.report {
        files::write(path, &report.page().render(), overwrite)?;
        println!("report in {}", path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Draws the curves of the training in `folder` into `page`.
pub fn draw(folder: &Path, page: &Path) -> Result<()> {
    let trainings = [training(folder)?];
    let report = report("Training of a policy", &[folder.to_owned()], &trainings);
    files::write(page, &report.page().render(), Overwrite::Force)
}

/// The page of `trainings`, which were read from `folders` in the same order.
fn report<'a>(title: &str, folders: &[PathBuf], trainings: &'a [Training]) -> LearningReport<'a> {
    let seeds = trainings.iter().map(|t| t.seeds.len()).sum::<usize>();
    LearningReport {
        title: title.into(),
        subtitle: format!("Trainings: {}; policies: {seeds}.", trainings.len()),
        trainings,
        next: next(folders, trainings),
        provenance: vec![
            ("Program".into(), concat!("greylag ", env!("CARGO_PKG_VERSION")).into()),
            ("Command".into(), files::command_line()),
        ],
    }
}

/// The command that scores the best policy of all trainings and seeds: the one with the smallest [`CurvePoint::badness`],
/// the sum of its errors on easy and hard target attitudes.
fn next(folders: &[PathBuf], trainings: &[Training]) -> String {
    let least = |points: &[CurvePoint]| best(points).map_or(f64::INFINITY, |k| points[k].badness());
    let seeds = folders.iter().zip(trainings).flat_map(|(folder, training)| {
        training.seeds.iter().map(move |(seed, points)| (folder, seed, least(points)))
    });
    seeds.min_by(|a, b| a.2.total_cmp(&b.2)).map_or_else(String::new, |(folder, seed, _)| {
        let own = folder.join(format!("{SEED}{seed}"));
        let policy = if own.is_dir() { &own } else { folder };
        format!("greylag evaluate --controller policy lqi --policy {}", quoted(policy))
    })
}

/// The folders with a learning curve, each with its seed: `folder` itself, whose seed is unknown, or its subfolders `seed-N`.
fn folders_of_seeds(folder: &Path) -> Result<Vec<(Option<u64>, PathBuf)>> {
    if folder.join(CURVE).exists() {
        return Ok(vec![(None, folder.to_owned())]);
    }
    let mut seeds = Vec::new();
    let entries = folder.read_dir().with_context(|| format!("cannot read {}", folder.display()))?;
    for entry in entries {
        let entry = entry?;
        let seed = entry
            .file_name()
            .to_string_lossy()
            .strip_prefix(SEED)
            .and_then(|s| s.parse::<u64>().ok());
        seeds.extend(
            seed.filter(|_| entry.path().join(CURVE).exists())
                .map(|seed| (Some(seed), entry.path())),
        );
    }
    seeds.sort();
    Ok(seeds)
}

/// Reads the learning curves in `folder`, see [`folders_of_seeds`].
fn training(folder: &Path) -> Result<Training> {
    let name = folder
        .file_name()
        .map_or_else(|| folder.display().to_string(), |n| n.to_string_lossy().into());
    let mut read = Vec::new();
    for (seed, folder) in folders_of_seeds(folder)? {
        let points = learning_curve::read(&folder.join(CURVE))?;
        // the folder of a training with a single seed does not state that seed
        let seed = seed.map_or("–".into(), |seed| seed.to_string());
        if !points.is_empty() {
            read.push((seed, points));
        }
    }
    if read.is_empty() {
        bail!(
            "{} holds no learning curve ({CURVE}, or {SEED}N/{CURVE} with an evaluation): name a folder \
             that `greylag train policy --out` wrote",
            folder.display()
        );
    }
    Ok(Training { name, seeds: read })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::policy::learning_curve::COLUMNS;

    #[test]
    fn the_seed_zero_has_a_folder_like_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let curve = |easy_deg: f64| format!("{COLUMNS}\n1,1,1,{easy_deg},2,0,1,1,1,0\n");
        for (seed, easy_deg) in [(0, 1.0), (1, 5.0)] {
            let own = folder.path().join(format!("{SEED}{seed}"));
            std::fs::create_dir(&own).unwrap();
            std::fs::write(own.join(CURVE), curve(easy_deg)).unwrap();
        }
        let read = [training(folder.path()).unwrap()];
        let seeds: Vec<&str> = read[0].seeds.iter().map(|(seed, _)| seed.as_str()).collect();
        assert_eq!(seeds, ["0", "1"]);
        let next = next(&[folder.path().to_owned()], &read);
        assert!(next.ends_with("seed-0"), "{next}");
    }
}

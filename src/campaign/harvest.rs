//! Reads the output of a campaign's cell. A cell is one run of a command with one combination of settings. Its command
//! writes its output files into the cell's folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::CampaignError;
use greylag_model::residual::hash;

/// Name of the file with the scores that `greylag evaluate` writes to a cell's folder.
pub const SCORES: &str = "evaluation.json";
/// Name of the file with the model errors that `greylag train dynamics` writes.
const TRAINING: &str = "training.json";
/// Name of the learning curve that `greylag train policy` writes.
const CURVE: &str = "curve.csv";
/// The columns of a learning curve that are read. They do not depend on the speed of the machine.
const COLUMNS: [&str; 5] = ["steps", "easy_deg", "hard_deg", "divergence_rate", "reward"];
/// File extensions of the output that later cells read. Only files with these extensions are hashed.
const READ_LATER: [&str; 3] = ["safetensors", "toml", "csv"];
/// Files that are not hashed in spite of their extension. The learning curve contains computing times, which differ between
/// runs. The checkpoint is read only by the same cell.
const OWN: [&str; 2] = ["checkpoint.safetensors", CURVE];

/// Output of a cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Harvest {
    /// SHA-256 of the files that later cells read, by their names in the folder.
    pub files: BTreeMap<String, String>,
    /// Measured quantities by name, such as `easy.mean_deg`.
    pub metrics: BTreeMap<String, f64>,
    /// Learning curve: the values of each column, by column name. Empty without a learning curve.
    pub curve: BTreeMap<String, Vec<f64>>,
}

/// Extracts the output of a cell's command from the cell's folder `folder`.
///
/// # Errors
///
/// If a file cannot be read, or is not valid JSON or CSV.
pub fn harvest(folder: &Path) -> Result<Harvest, CampaignError> {
    let mut harvest = Harvest { files: files(folder)?, ..Harvest::default() };
    if let Some(scores) = document(&folder.join(SCORES))? {
        harvest.metrics.extend(evaluated(&scores));
    }
    if let Some(training) = document(&folder.join(TRAINING))? {
        harvest.metrics.extend(trained(&training));
    }
    let curve = folder.join(CURVE);
    if curve.exists() {
        harvest.curve = columns(&curve)?;
    }
    Ok(harvest)
}

/// Scores of an evaluation by name. A name has the form `GROUP.SCORE`, such as `easy.mean_deg`; a group is a set of target
/// attitudes. If several controllers were evaluated, the name starts with that of the controller.
fn evaluated(document: &Value) -> Vec<(String, f64)> {
    let controllers = list(document, "controllers");
    let mut all = Vec::new();
    for controller in controllers {
        let name = controller["controller"].as_str().unwrap_or_default();
        let before = if controllers.len() > 1 { format!("{name}.") } else { String::new() };
        for score in list(controller, "groups") {
            let group = score["targets"].as_str().unwrap_or_default();
            let quantity =
                |key: &str| Some((format!("{before}{group}.{key}"), score[key].as_f64()?));
            let keys = [
                "count",
                "mean_deg",
                "min_deg",
                "max_deg",
                "divergence_rate",
                "settling_s",
                "kept_rate",
                "little_overshoot_rate",
            ];
            all.extend(keys.into_iter().filter_map(quantity));
            all.extend(measured(&score["measures"], &format!("{before}{group}")));
        }
    }
    all
}

/// The group's quality measures by name. For example, `easy.surface_travel` is the median over the targets of the group, and
/// `easy.load_factor_max.worst` is the worst value over them. `before` is the first part of the names.
fn measured(measures: &Value, before: &str) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (id, spread) in measures.as_object().into_iter().flatten() {
        for (key, end) in [("median", ""), ("worst", ".worst")] {
            all.extend(spread[key].as_f64().map(|x| (format!("{before}.{id}{end}"), x)));
        }
    }
    all
}

/// Errors of open-loop simulations of the test flights after different numbers of steps, for the learned model and for its
/// prior (the model before learning): normalised RMS error, median error and fraction of diverged simulations. If the true
/// coefficients are known, the median relative error of the learned coefficients is added.
fn trained(document: &Value) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (who, before) in [("learned", ""), ("prior", "prior.")] {
        for horizon in list(document, who) {
            let Some(steps) = horizon["steps"].as_u64() else { continue };
            let named = [("rms", "nrmse"), ("median", "median"), ("lost", "divergence")];
            all.extend(named.into_iter().filter_map(|(key, name)| {
                Some((format!("{before}after_{steps}.{name}"), horizon[key].as_f64()?))
            }));
        }
    }
    let errors: Vec<f64> = list(document, "coefficients").iter().filter_map(relative).collect();
    if !errors.is_empty() {
        let median = greylag_num::statistics::quantile(&errors, 0.5);
        all.push(("coefficient_error".into(), median));
    }
    all
}

/// Relative error of a learned coefficient; `None` if its true value is unknown or zero.
fn relative(coefficient: &Value) -> Option<f64> {
    let (value, truth) = (coefficient["value"].as_f64()?, coefficient["truth"].as_f64()?);
    (truth != 0.0).then(|| (value / truth - 1.0).abs())
}

fn list<'a>(document: &'a Value, key: &str) -> &'a [Value] {
    document[key].as_array().map_or(&[], Vec::as_slice)
}

fn document(path: &Path) -> Result<Option<Value>, CampaignError> {
    if !path.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(path).map_err(CampaignError::io("cannot read", path))?;
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|e| CampaignError::content(path, format!("is not valid JSON: {e}")))
}

fn columns(path: &Path) -> Result<BTreeMap<String, Vec<f64>>, CampaignError> {
    let wrong = |e: csv::Error| CampaignError::content(path, format!("is not valid CSV: {e}"));
    let mut reader = csv::Reader::from_path(path).map_err(wrong)?;
    let mut columns: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for row in reader.deserialize() {
        let row: BTreeMap<String, f64> = row.map_err(wrong)?;
        // NaN marks a value that was not measured. JSON cannot represent NaN, so the whole row is omitted
        let finite = |x: &f64| x.is_finite();
        if !COLUMNS.iter().all(|column| row.get(*column).is_some_and(finite)) {
            continue;
        }
        for column in COLUMNS {
            columns.entry(column.into()).or_default().push(row[column]);
        }
    }
    Ok(columns)
}

/// SHA-256 of the files that later cells read, by file name. A subfolder has a single hash, computed from the names and
/// hashes of its files.
fn files(folder: &Path) -> Result<BTreeMap<String, String>, CampaignError> {
    let mut all = BTreeMap::new();
    for path in sorted(folder)? {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() {
            let inner = files(&path)?;
            if !inner.is_empty() {
                all.insert(name + "/", hash(format!("{inner:?}").as_bytes()));
            }
        } else if path.extension().is_some_and(|e| READ_LATER.iter().any(|end| e == *end))
            && !OWN.contains(&name.as_str())
        {
            let bytes = std::fs::read(&path).map_err(CampaignError::io("cannot read", &path))?;
            all.insert(name, hash(&bytes));
        }
    }
    Ok(all)
}

fn sorted(folder: &Path) -> Result<Vec<PathBuf>, CampaignError> {
    let cannot = || CampaignError::io("cannot read", folder);
    let entries = std::fs::read_dir(folder).map_err(cannot())?;
    let mut paths = entries
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<Vec<_>, _>>()
        .map_err(cannot())?;
    paths.sort();
    Ok(paths)
}

//! `greylag train residual`: fits a linear residual, a linear function of states and deflections that corrects the rates of a
//! model, to flight logs.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use comfy_table::{CellAlignment, Table};

use crate::commands::distinct::distinct;
use crate::commands::files::{self, shipped};
use crate::commands::given;
use crate::commands::held_out;
use crate::commands::intake::LogArguments;
use crate::commands::outputs;
use crate::commands::status::IN_DOUBT;
use crate::commands::terminal::noted;
use crate::learn::dynamics::export;
use crate::logs::quoted;
use crate::model::GreyBox;
use crate::sysid::amend::document::sha256;
use crate::sysid::amend::linear_residual::{self, Corrected, lower, overall};
use crate::sysid::amend::split;
use crate::sysid::compare::{HorizonScore, scores};
use crate::sysid::flight_path::ActuatorClock;
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::weak_form::prepared::Prepared;

/// Horizons of the free runs, s.
const HORIZONS_S: [f64; 4] = [1.0, 2.0, 5.0, 10.0];

/// Largest ratio of the error with the residual to the error without it, at one horizon, with which the residual is written.
const HIGHER: f64 = 1.01;

/// Options of `greylag train residual`.
#[derive(clap::Args)]
#[command(
    after_help = "Exit status: 0 written; 1 an error, nothing was written; 3 not written, for the residual does not lower the error, or written, but a log was left out."
)]
pub struct Arguments {
    /// Model file to correct; it stays as it is. Fit its coefficients first: greylag amend --tune-only.
    #[arg(long, env = "GREYLAG_MODEL", hide_env_values = true)]
    model: PathBuf,
    #[command(flatten)]
    logs: LogArguments,
    /// Logs for validation, which the fit does not see [default: the last log, or the last third of a single log].
    #[arg(long, num_args = 1..)]
    hold_out: Vec<PathBuf>,
    /// Folder for model.toml, the airframe and residual.safetensors; created if missing.
    #[arg(long)]
    out: PathBuf,
    /// Replace files that already exist.
    #[arg(long)]
    force: bool,
}

/// Reads the flights, fits the residual, prints the errors on the flights for validation and writes the model.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let path = shipped(&arguments.model);
    arguments.check_outputs()?;
    let model = given::model(&arguments.model)?;
    if model.residual.is_some() {
        bail!(
            "cannot fit a linear residual: model {} has a learned residual already; name the model from which it was learned",
            model.name
        );
    }
    distinct(&arguments.logs.paths, &arguments.hold_out)?;
    let (fit, held) = held_out::divided(&arguments.logs.paths, &arguments.hold_out);
    let clock = ActuatorClock::Estimated;
    let mut taken = arguments.logs.of(fit.clone()).take_in(&model, clock)?;
    let tests = held_out::validation(&arguments.logs, held.clone(), (&model, clock), &mut taken)?;
    taken.notes.iter().for_each(|note| eprintln!("{}", noted(note)));
    let slowest = model.airframe.envelope.flying_from_mps();
    let parts = parts(&taken.flights);
    let prepared: Vec<Prepared> =
        parts.iter().map(|part| Prepared::new(part, slowest)).collect::<Result<_, _>>()?;
    let Some(Corrected { model: corrected, ridge }) =
        linear_residual::fit(&model, &prepared, &HORIZONS_S)
    else {
        println!(
            "Not written: no linear residual lowers the error of {} by 1 % when each of {} parts of the logs is predicted from \
             the others.",
            model.name,
            parts.len()
        );
        return Ok(ExitCode::from(IN_DOUBT));
    };
    println!(
        "Linear residual of {}: {} numbers, ridge {ridge}.",
        model.name,
        linear_residual::FREE
    );
    let [before, after] = [&model, &corrected].map(|m| scores(m, &tests, &HORIZONS_S));
    let [before, after] = [before?, after?];
    println!("{}", table(&before, &after));
    if !helps(&before, &after) {
        println!(
            "Not written: on the flights for validation the residual does not lower the error by 1 %, or raises it at a horizon."
        );
        return Ok(ExitCode::from(IN_DOUBT));
    }
    arguments.write(&corrected, &path, &fit)?;
    let judged = arguments.logs.of(if held.is_empty() { fit } else { held });
    println!("next: {}", arguments.next(&judged.among(&taken.used)));
    Ok(if taken.in_doubt { ExitCode::from(IN_DOUBT) } else { ExitCode::SUCCESS })
}

impl Arguments {
    /// Checks the files in the folder for the model, see [`outputs::check`]. The folder need not exist.
    fn check_outputs(&self) -> Result<()> {
        let written = [export::MODEL, export::RESIDUAL].map(|name| self.out.join(name));
        let logs = self.logs.files().chain(&self.hold_out).cloned();
        outputs::separate(&written, given::files(&self.model).into_iter().chain(logs))?;
        match self.out.is_dir() {
            true => files::writable(&self.out.join(export::MODEL), self.force.into()),
            false => Ok(()),
        }
    }

    /// Writes the folder of the model `corrected`. `path` is the path of the model before it, and `fitted` are the logs of the fit.
    fn write(&self, corrected: &GreyBox, path: &Path, fitted: &[PathBuf]) -> Result<()> {
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        let mut hashes = String::new();
        for log in fitted {
            let content = std::fs::read(log)
                .with_context(|| format!("cannot read flight log {}", log.display()))?;
            hashes += &sha256(&content);
        }
        let origin = export::origin(corrected, &sha256(hashes.as_bytes()), 0);
        let about = format!("{} with a linear residual fitted to flight logs.", corrected.name);
        let text = export::Text { about: &about, trained: &[] };
        export::save(corrected, path, text, &origin, &self.out)?;
        println!("model in {}", self.out.join(export::MODEL).display());
        Ok(())
    }

    /// The command that compares the model and its correction with the logs `judged`.
    fn next(&self, judged: &LogArguments) -> String {
        let [given, out] = [&self.model, &self.out.join(export::MODEL)].map(|path| quoted(path));
        format!("greylag compare --model {given} {out}{}", judged.words())
    }
}

/// Whether the errors `after` are lower than `before`: by 1 % in the geometric mean over the horizons, and at no horizon higher by
/// more than 1 %.
fn helps(before: &[HorizonScore], after: &[HorizonScore]) -> bool {
    let reached = before.iter().zip(after).filter(|(b, _)| b.runs > 0);
    let none_higher = reached.clone().all(|(b, a)| a.rmse_scaled <= HIGHER * b.rmse_scaled);
    none_higher && overall(after).zip(overall(before)).is_some_and(|(a, b)| lower(a, b))
}

/// The flights, or the two parts of a single flight, for cross-validation.
fn parts(flights: &[Reconstruction]) -> Vec<Reconstruction> {
    match flights {
        [only] => split(only).to_vec(),
        several => several.to_vec(),
    }
}

/// Scaled errors on the flights for validation, with a row for each horizon.
fn table(before: &[HorizonScore], after: &[HorizonScore]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["horizon, s", "runs", "error as given", "with the residual", "ratio"]);
    table.column_iter_mut().for_each(|column| column.set_cell_alignment(CellAlignment::Right));
    for (b, a) in before.iter().zip(after).filter(|(b, _)| b.runs > 0) {
        table.add_row([
            b.horizon_s.to_string(),
            b.runs.to_string(),
            format!("{:.4}", b.rmse_scaled),
            format!("{:.4}", a.rmse_scaled),
            format!("{:.2}", a.rmse_scaled / b.rmse_scaled),
        ]);
    }
    table
}

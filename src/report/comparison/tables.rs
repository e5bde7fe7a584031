//! Tables of a comparison of models with recorded flights: free-run errors, baselines, sensor errors and wind, notes,
//! provenance. A free run simulates a model from a reconstructed state with the recorded actuator positions.

use crate::comparison::ComparisonReport;
use crate::kit::numbers::{NORMAL_95, interval, number, percent};
use crate::{Align, Choice, ChoiceOption, Figure, Section, Table};
use greylag_sysid::compare::{Comparison, HorizonScore, NuisanceResult, StateScore};

pub(crate) fn summary(c: &Comparison) -> Section {
    let mut table = Table::new(
        "Free-run error",
        &[
            ("Model", Align::Left),
            ("Horizon (s)", Align::Right),
            ("Runs", Align::Right),
            ("Diverged (%)", Align::Right),
            ("NRMSE", Align::Right),
            ("Worst state", Align::Left),
            ("its RMSE", Align::Right),
            ("R²", Align::Right),
            ("Theil's U", Align::Right),
            ("bias (%)", Align::Right),
            ("variance (%)", Align::Right),
            ("covariance (%)", Align::Right),
        ],
    );
    for model in &c.models {
        model.free_run.iter().for_each(|score| table.push(summary_row(&model.name, score)));
    }
    let mut figures = vec![Figure::Table(table)];
    let options: Vec<ChoiceOption> =
        c.settings.horizons_s.iter().filter_map(|h| by_state(c, *h)).collect();
    if !options.is_empty() {
        let (anchor, label) = ("states".into(), "Every state at horizon".into());
        figures.push(Figure::Choice(Choice { anchor, label, options }));
    }
    let note = "Free runs from reconstructed states. NRMSE: root mean square over the eight states of RMSE over the \
                reference scale x_c. R²: 1 is \
                perfect, below 0 the mean is better. Theil's U: 0 is perfect, 1 is no relation; \
                its shares say whether the error is an offset (bias), too much or too little \
                movement (variance) or movement at the wrong time (covariance).";
    Section::new("Free runs", note, figures)
}

/// Section with the errors of forecasts that use no aerodynamics, over the same times as the free runs. A useful model has
/// smaller errors.
pub(crate) fn baselines(c: &Comparison) -> Section {
    let columns = [
        ("Forecast", Align::Left),
        ("Horizon (s)", Align::Right),
        ("Diverged (%)", Align::Right),
        ("NRMSE", Align::Right),
    ];
    let mut table = Table::new("Forecasts without aerodynamics", &columns);
    for forecast in &c.forecasts {
        for s in &forecast.free_run {
            let cells =
                [s.horizon_s.to_string(), percent(s.divergence_rate), number(s.rmse_scaled)];
            table.push(std::iter::once(forecast.name.to_string()).chain(cells));
        }
    }
    match table.rows.is_empty() {
        true => Section::default(),
        false => Section::new(
            "Forecasts without aerodynamics",
            "They know no aerodynamics: a model has to beat those that were not fitted to these flights.",
            vec![Figure::Table(table)],
        ),
    }
}

fn summary_row(model: &str, score: &HorizonScore) -> Vec<String> {
    let mut row = vec![
        model.to_string(),
        score.horizon_s.to_string(),
        score.runs.to_string(),
        percent(score.divergence_rate),
        number(score.rmse_scaled),
    ];
    let finite = score.states.iter().filter(|s| s.rmse_scaled.is_finite());
    let worst = finite.max_by(|a, b| a.rmse_scaled.total_cmp(&b.rmse_scaled));
    match worst {
        None => row.extend(std::iter::repeat_n("–".to_string(), 7)),
        Some(state) => row.extend(state_cells(state)),
    }
    row
}

/// Cells for one state: name, RMSE with unit, R², Theil's U, and its three shares.
fn state_cells(s: &StateScore) -> Vec<String> {
    let (name, unit, factor) = people(s.state);
    let mut cells = vec![name.to_string(), format!("{} {unit}", number(factor * s.rmse))];
    cells.extend([s.r2, s.theil_u].map(number));
    cells.extend([s.bias_share, s.variance_share, s.covariance_share].map(percent));
    cells
}

/// Display name and display unit of a state, and the factor from its SI unit to the display unit.
fn people(state: &str) -> (&str, &'static str, f64) {
    let (name, unit) = state.rsplit_once('_').unwrap_or((state, ""));
    let name = match name {
        "p" => "roll rate p",
        "q" => "pitch rate q",
        "r" => "yaw rate r",
        "alpha" => "angle of attack α",
        "beta" => "sideslip β",
        other => other,
    };
    match unit {
        "rad" => (name, "°", 1f64.to_degrees()),
        "radps" => (name, "°/s", 1f64.to_degrees()),
        "mps" => (name, "m/s", 1.0),
        _ => (state, "", 1.0),
    }
}

fn by_state(c: &Comparison, horizon_s: f64) -> Option<ChoiceOption> {
    let mut table = Table::new(
        &format!("Every state at {horizon_s} s"),
        &[
            ("Model", Align::Left),
            ("State", Align::Left),
            ("RMSE", Align::Right),
            ("R²", Align::Right),
            ("Theil's U", Align::Right),
            ("bias (%)", Align::Right),
            ("variance (%)", Align::Right),
            ("covariance (%)", Align::Right),
            ("NRMSE", Align::Right),
        ],
    );
    for (name, scores) in c.models.iter().map(|m| (&m.name, &m.free_run)) {
        let at = scores.iter().find(|s| s.horizon_s == horizon_s);
        for state in at.iter().flat_map(|s| &s.states) {
            let mut row = vec![name.clone()];
            row.extend(state_cells(state));
            row.push(number(state.rmse_scaled));
            table.push(row);
        }
    }
    let name = format!("{horizon_s} s");
    (!table.rows.is_empty()).then(|| ChoiceOption { name, figures: vec![Figure::Table(table)] })
}

pub(crate) fn nuisances(c: &Comparison) -> Section {
    let mut table = Table::new(
        "Sensor errors and wind",
        &[
            ("Flight", Align::Left),
            ("What", Align::Left),
            ("Value", Align::Right),
            ("95 % interval", Align::Right),
            ("Unit", Align::Left),
            ("Moved from its prior, sd", Align::Right),
        ],
    );
    for flight in &c.flights {
        for n in &flight.nuisances {
            table.push(nuisance_row(&flight.name, n));
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    let note = "Found by the flight-path reconstruction, from kinematics alone, and taken out \
                before the models were compared.";
    Section::new("Sensor errors and wind", note, vec![Figure::Table(table)])
}

fn nuisance_row(flight: &str, n: &NuisanceResult) -> Vec<String> {
    let (factor, unit) = match n.unit {
        "rad" => (1f64.to_degrees(), "°"),
        "rad/s" => (1f64.to_degrees(), "°/s"),
        other => (1.0, other),
    };
    let (value, half) = (factor * n.value, factor * NORMAL_95 * n.sd);
    vec![
        flight.to_string(),
        n.name.to_string(),
        number(value),
        interval(value - half, value + half),
        unit.to_string(),
        n.moved_sd.map_or_else(String::new, |x| format!("{x:.1}")),
    ]
}

pub(crate) fn notes(c: &Comparison) -> Section {
    let mut table = Table::new("Notes", &[("About", Align::Left), ("Note", Align::Left)]);
    for note in &c.notes {
        table.push(["the comparison".to_string(), note.clone()]);
    }
    for flight in &c.flights {
        for note in &flight.notes {
            table.push([flight.name.clone(), note.clone()]);
        }
    }
    if table.rows.is_empty() {
        return Section::default();
    }
    Section::new("Notes", "What was assumed, skipped or lost.", vec![Figure::Table(table)])
}

pub(crate) fn provenance(report: &ComparisonReport) -> Section {
    let c = report.comparison;
    let mut table = Table::new("Provenance", &[("Item", Align::Left), ("Value", Align::Left)]);
    let mut push = |item: &str, value: String| table.push([item.to_string(), value]);
    push("Program", c.program.clone());
    for file in &report.model_files {
        push("Model", file.clone());
    }
    for file in &report.log_files {
        push("Log", file.clone());
    }
    push("Seed", c.seed.to_string());
    push("Command line", report.command_line.clone());
    let s = &c.settings;
    push("Free runs", format!("every {} s; diverged over {}", s.start_every_s, s.divergence_bound));
    push("Weak form", format!("Hann kernel of {} s", s.kernel_s));
    push("Bootstrap", format!("{} resamples of blocks of {} s", s.resamples, s.block_s));
    for (program, version) in &report.versions {
        push(program, version.clone());
    }
    push("Plots", "uPlot 1.6.32 (MIT)".into());
    Section::new("Provenance", "", vec![Figure::Table(table)])
}

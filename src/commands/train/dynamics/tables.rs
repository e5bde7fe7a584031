//! Progress line and tables of results that `greylag train dynamics` prints.

use comfy_table::Table;

use crate::learn::dynamics::residual_map::ResidualMap;
use crate::learn::dynamics::score::Horizon;
use crate::learn::{Learned, Progress, Trainer};

pub(super) fn line(p: &Progress, trainer: &Trainer, ms: f64) -> String {
    let ratio = p.loss.learned / p.loss.prior;
    let mut text = format!(
        "{:>7} n {:>3}  L/L_prior {:.5}  |Fa|/|Fp| {:.4}  lambda {:.1}  {ms:.1} ms",
        p.update, p.steps, p.normalised, ratio, p.lambda
    );
    if p.loss.lost > 0 {
        text += &format!("  {} rollouts lost", p.loss.lost);
    }
    for Learned { name, value, .. } in trainer.coefficients(None).iter().take(12) {
        text += &format!("  {} {value:.4}", name.rsplit('.').next().unwrap_or(name));
    }
    text
}

/// Table of the state rates, one row each: RMS of the rate from the prior (the physical model) and of the rate from the learned
/// residual, and the flight condition in which the residual is strongest.
pub(super) fn shares(residual_map: &ResidualMap) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["rate of", "prior, x_c/s", "residual, x_c/s", "strongest at"]);
    for share in &residual_map.channels {
        let place = share
            .strongest
            .as_ref()
            .map_or(String::new(), |(over, [low, high])| format!("{over} {low:.0} to {high:.0}"));
        table.add_row([
            share.channel.to_owned(),
            format!("{:.4}", share.prior),
            format!("{:.4}", share.learned),
            place,
        ]);
    }
    table
}

pub(super) fn coefficients(learned: &[Learned]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    // the true coefficients of a real aircraft are unknown
    let known = learned.iter().any(|l| l.truth.is_some());
    let columns = if known { 4 } else { 3 };
    table.set_header(["coefficient", "prior", "learned", "true"].iter().take(columns));
    for Learned { name, start, value, truth } in learned {
        let truth = truth.map_or("-".into(), |t| format!("{t:.5}"));
        let row = [name.clone(), format!("{start:.5}"), format!("{value:.5}"), truth];
        table.add_row(row.into_iter().take(columns));
    }
    table
}

pub(super) fn horizons([prior, learned]: &[Vec<Horizon>; 2]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header([
        "steps",
        "runs",
        "prior rms",
        "learned rms",
        "ratio",
        "prior median",
        "learned median",
        "ratio",
        "lost",
    ]);
    for (p, l) in prior.iter().zip(learned) {
        table.add_row([
            p.steps.to_string(),
            p.runs.to_string(),
            format!("{:.2e}", p.rms),
            format!("{:.2e}", l.rms),
            format!("{:.4}", l.rms / p.rms),
            format!("{:.2e}", p.median),
            format!("{:.2e}", l.median),
            format!("{:.4}", l.median / p.median),
            format!("{:.1} % {:.1} %", 100.0 * p.lost, 100.0 * l.lost),
        ]);
    }
    table
}

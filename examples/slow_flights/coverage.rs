//! How often the true coefficients lie inside their 95 % intervals.

use std::collections::BTreeMap;

use greylag::model::GreyBox;
use greylag::num::statistics::quantile;
use greylag::sysid::amend::Parameter;

/// A coefficient counts as determined by the flights if its posterior standard deviation is below this fraction of its prior
/// standard deviation.
const DETERMINED: f64 = 0.5;

/// Number of intervals, and of those that hold the true value.
#[derive(Clone, Copy, Debug, Default)]
struct Count {
    inside: usize,
    of: usize,
}

impl Count {
    fn add(&mut self, inside: bool) {
        self.inside += usize::from(inside);
        self.of += 1;
    }

    /// Share of the intervals that hold the true value; NaN without intervals.
    fn share(&self) -> f64 {
        self.inside as f64 / self.of as f64
    }

    /// 95 % confidence interval of the share for independent intervals (Wilson, J. Am. Stat. Assoc. 22, 1927).
    fn wilson(&self) -> [f64; 2] {
        const Z: f64 = 1.96;
        let (n, p) = (self.of as f64, self.share());
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        [middle - half, middle + half].map(|x| x / (1.0 + Z * Z / n))
    }

    /// The share in per cent with its numbers; `-` without intervals.
    fn in_words(&self) -> String {
        match self.of {
            0 => "-".into(),
            of => format!("{:.0} % ({}/{of})", 100.0 * self.share(), self.inside),
        }
    }
}

/// Results of one coefficient over all sets.
#[derive(Clone, Debug, Default)]
struct Cell {
    all: Count,
    determined: Count,
    /// Posterior divided by prior standard deviation, one entry a set.
    narrowed: Vec<f64>,
    /// Squared errors in posterior standard deviations.
    squares: Vec<f64>,
}

/// Coverage of one kind of fit over all sets.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    cells: BTreeMap<String, Cell>,
    /// For each set: counts over all coefficients, and over those that are determined.
    sets: Vec<[Count; 2]>,
    /// Squared errors of the estimated tilt about body x, y and z, degrees squared, one entry a set.
    tilt: Vec<[f64; 3]>,
    /// Sets without a fit.
    failed: usize,
}

impl Tally {
    /// Adds the `parameters` of a fit to flights of the aircraft `truth`.
    pub fn add(&mut self, parameters: &[Parameter], truth: &GreyBox) {
        let mut set = [Count::default(); 2];
        for p in parameters {
            let Some(c) = truth.coefficients().iter().find(|c| c.name == p.name) else { continue };
            let inside = (p.ci95[0]..=p.ci95[1]).contains(&c.value);
            let cell = self.cells.entry(p.name.clone()).or_default();
            cell.all.add(inside);
            set[0].add(inside);
            if p.sd < DETERMINED * p.prior_sd {
                cell.determined.add(inside);
                set[1].add(inside);
            }
            cell.narrowed.push(p.sd / p.prior_sd);
            cell.squares.push(((p.value - c.value) / p.sd).powi(2));
        }
        self.sets.push(set);
    }

    /// Adds the error of the estimated tilt of the measured axes about body x, y and z, rad.
    pub fn add_tilt(&mut self, error_rad: [f64; 3]) {
        self.tilt.push(error_rad.map(|x| x.to_degrees().powi(2)));
    }

    /// Counts a set without a fit.
    pub fn fail(&mut self) {
        self.failed += 1;
    }

    /// Prints a table of the coefficients, and the totals.
    pub fn print(&self, name: &str) {
        println!("\n{name}: {} sets, {} without a fit", self.sets.len(), self.failed);
        println!(
            "  {:<28}{:>16}{:>16}{:>14}{:>14}",
            "", "inside, all", "determined", "sd/prior sd", "rms error/sd"
        );
        for (name, cell) in &self.cells {
            let rms = (cell.squares.iter().sum::<f64>() / cell.squares.len() as f64).sqrt();
            println!(
                "  {name:<28}{:>16}{:>16}{:>14.2}{rms:>14.2}",
                cell.all.in_words(),
                cell.determined.in_words(),
                quantile(&cell.narrowed, 0.5)
            );
        }
        self.print_total("all coefficients", 0);
        self.print_total("determined (sd < half of prior sd)", 1);
        let [all, determined] = [0, 1].map(|k| self.sets.iter().map(|s| s[k].of).sum::<usize>());
        println!("  determined: {:.0} % of the intervals", 100.0 * determined as f64 / all as f64);
        if !self.tilt.is_empty() {
            let n = self.tilt.len() as f64;
            let rms = |axis: usize| (self.tilt.iter().map(|x| x[axis]).sum::<f64>() / n).sqrt();
            let [x, y, z] = [0, 1, 2].map(rms);
            println!("  rms error of the tilt about x, y, z: {x:.2}°, {y:.2}°, {z:.2}°");
        }
    }

    /// Prints the share over all sets of the counts with the index `which`. The standard error is over the sets, because the
    /// intervals of one fit are not independent.
    fn print_total(&self, name: &str, which: usize) {
        let mut sum = Count::default();
        for set in &self.sets {
            sum.inside += set[which].inside;
            sum.of += set[which].of;
        }
        let left = |c: &Count| (c.inside as f64 - sum.share() * c.of as f64).powi(2);
        let error = self.sets.iter().map(|s| left(&s[which])).sum::<f64>().sqrt() / sum.of as f64;
        let [low, high] = sum.wilson().map(|x| 100.0 * x);
        println!(
            "  {name}: {} inside, 95 % interval {low:.1} to {high:.1} % (Wilson), standard error over sets {:.1} %",
            sum.in_words(),
            100.0 * error
        );
    }
}

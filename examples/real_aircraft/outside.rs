//! Named model and residual together beside the residual alone, on flights outside of the envelope that was fitted.
//!
//! All rivals are made of the same flights inside the envelope. Orders and ridges are chosen there too, by leaving out parts. The
//! residual alone is the same linear function of states and deflections as the residual of the named model, with its own order
//! and ridge. It acts on a rigid body under gravity, without any aerodynamics or thrust. ARX has neither.

use std::array::from_fn;

use anyhow::Result;
use greylag::model::GreyBox;
use greylag::sysid::compare::arx::{Arx, Choice};
use greylag::sysid::compare::{forecast, scores};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::per_flight::{PerFlight, SensorErrors};
use greylag::sysid::weak_form::prepared::Prepared;

use crate::aircraft::seconds;
use crate::corrected::{self, Kind};
use crate::outside_flights::{Set, X8, ultra_stick};
use crate::{HORIZONS_S, Row, chosen_arx, parts, print_row, scaled, tuned};

/// Number of sets of simulated flights.
pub const SETS: u64 = 5;
/// Seed of the first set.
const FIRST_SEED: u64 = 1;
/// What is judged, in the order of the table.
const WAYS: [&str; 6] = [
    "named, as given",
    "named, tuned",
    "named + residual",
    "residual alone",
    "ARX, order chosen",
    "hold the state",
];
/// Place of the named model with its residual in [`WAYS`].
const TOGETHER: usize = 2;
/// Places in [`WAYS`] of what it is compared with, beside the name of the ratio.
const RIVALS: [(usize, &str); 3] = [(3, "/ residual alone"), (4, "/ ARX"), (1, "/ named, tuned")];

/// Scaled free-run errors (dimensionless) of every way.
type Errors = [Row; WAYS.len()];

/// Prints the errors on `sets` sets of simulated flights and on the Ultra Stick; what is being done goes to the standard error
/// stream.
///
/// # Errors
/// If flights cannot be flown or read, or a sampling interval is not usable.
pub fn print(sets: u64) -> Result<()> {
    println!(
        "Outside of the envelope that was fitted: scaled error of free runs, mean ± standard error over the flights predicted"
    );
    let x8 = X8::load()?;
    let mut names = Vec::new();
    let mut errors: Vec<Vec<Errors>> = Vec::new();
    println!("\nX8 in JSBSim, {sets} sets; fitted: bank to 20°, 17 to 19 m/s, 3 flights of 40 s");
    for seed in FIRST_SEED..FIRST_SEED + sets {
        eprintln!("X8, seed {seed}");
        let set = x8.set(seed)?;
        names = set.groups.iter().map(|group| group.name).collect();
        errors.resize(names.len(), Vec::new());
        for (all, new) in errors.iter_mut().zip(judged(&x8.model, &set)?) {
            all.extend(new);
        }
    }
    for (name, all) in names.iter().zip(&errors) {
        print_group(name, all);
    }
    eprintln!("Ultra Stick");
    let (model, set) = ultra_stick()?;
    println!(
        "\nUltra Stick 25e (thor); fitted: bank to 20°, airspeed within 10 % and angle of attack within 3° of the medians, {:.0} s",
        seconds(&set.fit)
    );
    for (group, all) in set.groups.iter().zip(judged(&model, &set)?) {
        print_group(group.name, &all);
    }
    Ok(())
}

/// Errors of all ways on each flight of each group of `set`, made of the flights to be fitted alone. Prints what was chosen.
fn judged(model: &GreyBox, set: &Set) -> Result<Vec<Vec<Errors>>> {
    let rivals = Rivals::made(model, &set.fit)?;
    println!("  {}", rivals.in_words());
    let one = |test: &Reconstruction| rivals.errors(model, test);
    set.groups
        .iter()
        .map(|group| group.tests.iter().map(one).collect::<Result<Vec<Errors>>>())
        .collect()
}

/// What is judged, made of flights inside the envelope.
struct Rivals<'a> {
    fit: &'a [Reconstruction],
    seen: Vec<Prepared>,
    /// The named model with fitted coefficients, and its residual.
    tuned: GreyBox,
    residual: Kind,
    /// A rigid body without aerodynamics and thrust, and its residual.
    bare: GreyBox,
    alone: Kind,
    /// ARX with its order in words; `None` if it cannot be fitted.
    arx: (Option<(Arx, Choice)>, String),
}

impl<'a> Rivals<'a> {
    /// Fits and chooses everything with the flights `fit`. If `model` cannot be fitted, it stays as given.
    fn made(model: &GreyBox, fit: &'a [Reconstruction]) -> Result<Rivals<'a>> {
        let ready = |all: &[Reconstruction]| {
            let slowest = model.airframe.envelope.flying_from_mps();
            all.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()
        };
        let parts = parts(fit);
        let (seen, seen_parts) = (ready(fit)?, ready(&parts[..])?);
        let coefficients = PerFlight { sensors: SensorErrors::Dropped, ..PerFlight::default() };
        let fitted = |flights: &[Reconstruction]| tuned(model, flights, Some(coefficients));
        let (bare, kinds) = (without_effects(model), Kind::linear());
        let residual = corrected::chosen(&kinds, &parts, fitted)?;
        let alone = corrected::chosen(&kinds, &parts, |_| Some(bare.clone()))?;
        let arx = chosen_arx(&seen, &seen_parts, model.scale());
        let tuned = fitted(fit).unwrap_or_else(|| model.clone());
        Ok(Rivals { fit, seen, tuned, residual, bare, alone, arx })
    }

    /// What was chosen.
    fn in_words(&self) -> String {
        let (residual, alone) = (self.residual.in_words(), self.alone.in_words());
        format!("named model: {residual}; residual alone: {alone}; {}", self.arx.1)
    }

    /// Errors of all ways on the flight `test`. `model` is the named model as given.
    fn errors(&self, model: &GreyBox, test: &Reconstruction) -> Result<Errors> {
        let (test, scale) = (std::slice::from_ref(test), model.scale());
        let slowest = model.airframe.envelope.flying_from_mps();
        let unseen = [Prepared::new(&test[0], slowest)?];
        let arx = match &self.arx.0 {
            Some((arx, _)) => scaled(&arx.scores(&unseen, scale, &HORIZONS_S)?),
            None => [f64::NAN; HORIZONS_S.len()],
        };
        let hold = &forecast::on_unseen(&self.seen, &unseen, scale, &HORIZONS_S)[0];
        Ok([
            scaled(&scores(model, test, &HORIZONS_S)?),
            scaled(&scores(&self.tuned, test, &HORIZONS_S)?),
            corrected::errors(&self.tuned, self.fit, test, self.residual)?,
            corrected::errors(&self.bare, self.fit, test, self.alone)?,
            arx,
            scaled(&hold.free_run),
        ])
    }
}

/// `model` without forces and moments: all coefficients in which it is linear are zero.
fn without_effects(model: &GreyBox) -> GreyBox {
    let linear = model.linear();
    let all = model.coefficients().iter().zip(linear);
    let values: Vec<f64> = all.map(|(c, linear)| if linear { 0.0 } else { c.value }).collect();
    let mut bare = model.clone();
    bare.set_coefficients(&values);
    bare
}

/// Prints the errors `all` on the flights of a group, and the ratios of the named model with its residual to its rivals.
fn print_group(name: &str, all: &[Errors]) {
    println!("\n  {name}");
    println!("  {:<18}{:>20}{:>20}{:>20}", "", "1 s", "2 s", "5 s");
    for (k, way) in WAYS.iter().enumerate() {
        print_row(way, &all.iter().map(|e| e[k]).collect::<Vec<_>>());
    }
    println!("  {} as a ratio", WAYS[TOGETHER]);
    for (rival, name) in RIVALS {
        let [a, b, c]: [String; HORIZONS_S.len()] = from_fn(|h| ratio(all, rival, h));
        println!("  {name:<18}{a:>20}{b:>20}{c:>20}");
    }
}

/// Ratio of the mean error of the named model with its residual to that of `rival` (place in [`WAYS`]) at horizon number
/// `horizon`, with its standard error and the number of flights; `-` if no flight is long enough.
fn ratio(all: &[Errors], rival: usize, horizon: usize) -> String {
    let pairs = all.iter().map(|e| [e[TOGETHER][horizon], e[rival][horizon]]);
    let pairs: Vec<[f64; 2]> = pairs.filter(|p| p.iter().all(|x| x.is_finite())).collect();
    let n = pairs.len() as f64;
    let [own, other] = [0, 1].map(|k| pairs.iter().map(|p| p[k]).sum::<f64>() / n);
    let value = own / other;
    // to first order, the error of a ratio of two means is that of the mean of these differences, relative to the denominator
    let spread = pairs.iter().map(|p| (p[0] - value * p[1]).powi(2)).sum::<f64>() / (n - 1.0);
    match pairs.len() {
        0 => "-".into(),
        1 => format!("{value:.2} (1)"),
        count => format!("{value:.2} ± {:.2} ({count})", (spread / n).sqrt() / other),
    }
}

//! Writes the regression of a test case as CSV. Other methods can then be tested on the same signals.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, Result};
use greylag::model::GreyBox;
use greylag::physics::catalogue::on_air;
use greylag::physics::inputs;
use greylag::sim::design::{Suspect, alternatives};
use greylag::sysid::weak_form::prepared::Prepared;
use greylag::sysid::weak_form::windows::{Series, channels, columns};

use crate::cases::Case;
use crate::search::Flown;

/// Channels of the regression: D, L, Y, l, m, n.
const CHANNELS: usize = 6;

/// A column of the regression over all windows of all flights. Within a flight the channels follow each other.
struct Column {
    name: String,
    values: Vec<f64>,
}

/// Writes `KEY.csv` with one row for each window and channel, divided by the standard deviation of the channel's noise. The
/// column `y` is the measured value minus the prediction of the starting model. The columns `prior:…` belong to the model's
/// coefficients and are multiplied by their prior standard deviations. The columns `bias:…` are constants. The columns
/// `candidate:ID:k` are the contributions of the catalogue's effects.
pub fn write(folder: &Path, case: &Case, flown: &Flown) -> Result<()> {
    let flights: Vec<Prepared> =
        flown.training.iter().map(|f| Prepared::new(f, 5.0)).collect::<Result<_, _>>()?;
    let model = &flown.model;
    let scales: Vec<[f64; CHANNELS]> = flights.iter().map(|f| noise(&channels(model, f))).collect();
    let gaps = |with: &GreyBox| -> Vec<f64> {
        flights.iter().zip(&scales).flat_map(|(f, s)| scaled(&channels(with, f), s)).collect()
    };
    let lacks = gaps(model);
    let mut all = prior(model, &flights, &scales);
    for id in candidates(model, &case.without) {
        let suspect = Suspect { id: id.into(), values: Vec::new() };
        // an effect without known plausible values is omitted
        let Ok(ways) = alternatives(model, &suspect) else { continue };
        for (k, with) in ways.iter().flatten().enumerate() {
            let values = lacks.iter().zip(gaps(with)).map(|(a, b)| a - b).collect();
            all.push(Column { name: format!("candidate:{id}:{k}"), values });
        }
    }
    let name = case.key().replace(['/', '+'], "_");
    let path = folder.join(format!("{name}.csv"));
    std::fs::write(&path, text(&case.truth(), &lacks, &all))
        .with_context(|| format!("writing {}", path.display()))
}

/// Ids of the catalogue's effects that the model lacks, except those in `without`.
fn candidates<'a>(
    model: &'a GreyBox,
    without: &'a [String],
) -> impl Iterator<Item = &'static str> + 'a {
    let forces = on_air();
    let inputs = inputs::Kind::ALL.iter().map(|kind| kind.describe());
    let all = forces.chain(inputs).filter(|about| about.entry.is_some()).map(|about| about.id);
    all.filter(|id| !model.has(id) && !without.iter().any(|w| w == id))
}

/// Standard deviation of each channel's noise.
fn noise(series: &[Series]) -> [f64; CHANNELS] {
    let mut scale = [f64::INFINITY; CHANNELS];
    for s in series.iter().filter(|s| (s.channel as usize) < CHANNELS) {
        scale[s.channel as usize] = s.noise_variance.sqrt();
    }
    scale
}

/// Measured minus predicted values, divided by the standard deviation of the noise.
fn scaled(series: &[Series], scale: &[f64; CHANNELS]) -> Vec<f64> {
    let own = series.iter().filter(|s| (s.channel as usize) < CHANNELS);
    own.flat_map(|s| {
        let scale = scale[s.channel as usize];
        let both = s.measured.iter().zip(&s.predicted);
        both.map(move |(m, p)| (m - p) / scale).collect::<Vec<_>>()
    })
    .collect()
}

/// The columns of the model's own coefficients, and a constant for each channel.
fn prior(model: &GreyBox, flights: &[Prepared], scales: &[[f64; CHANNELS]]) -> Vec<Column> {
    let linear = model.linear();
    let found: Vec<_> = flights.iter().map(|f| columns(model, f)).collect();
    let mut all = Vec::new();
    for (k, c) in model.coefficients().iter().enumerate().filter(|(k, _)| linear[*k]) {
        if c.width() > 0.0 {
            let of = found.iter().zip(scales).flat_map(|(columns, scale)| {
                let channel =
                    |n: usize| columns.values[k][n].iter().map(move |x| c.width() * x / scale[n]);
                (0..CHANNELS).flat_map(channel).collect::<Vec<_>>()
            });
            all.push(Column { name: format!("prior:{}", c.name), values: of.collect() });
        }
    }
    for wanted in 0..CHANNELS {
        let one = |n: usize| f64::from(u8::from(n == wanted));
        let of = flights.iter().flat_map(|f| {
            (0..CHANNELS).flat_map(move |n| std::iter::repeat_n(one(n), f.windows.len()))
        });
        all.push(Column { name: format!("bias:{wanted}"), values: of.collect() });
    }
    all
}

fn text(truth: &[String], lacks: &[f64], all: &[Column]) -> String {
    let mut out = format!("# truth: {}\ny", truth.join("+"));
    all.iter().for_each(|column| out += &format!(",{}", column.name));
    out.push('\n');
    for (row, y) in lacks.iter().enumerate() {
        let _ = write!(out, "{y:.5e}");
        all.iter().for_each(|column| {
            let _ = write!(out, ",{:.5e}", column.values[row]);
        });
        out.push('\n');
    }
    out
}

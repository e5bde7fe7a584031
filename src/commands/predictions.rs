//! A table of free runs (open-loop simulations from measured states): the predictions of models from regular starts in each
//! flight.

use std::fmt::Write;

use anyhow::{Result, bail};

use crate::model::GreyBox;
use crate::physics::State;
use crate::sysid::compare::free_run::{self, START_EVERY_S};
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::weak_form::prepared::Prepared;

/// Half width of a 95 % interval of the normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.96;

/// Predicted and measured state at one horizon after one start.
struct Row<'a> {
    model: &'a str,
    flight: String,
    start_s: f64,
    /// Index of the horizon.
    horizon: usize,
    predicted: [f64; 8],
    measured: [f64; 8],
}

/// The predictions of `models` for `flights` at `horizons_s` (s) after every start, as CSV with a row for each model, flight,
/// start and horizon. A run has no row at horizons after its divergence or after the end of its segment. The 95 % interval of a
/// state is computed from the errors of the same model at the same horizon in all other runs.
pub fn table(models: &[GreyBox], flights: &[Reconstruction], horizons_s: &[f64]) -> Result<String> {
    let longest = horizons_s.iter().copied().fold(0.0, f64::max);
    let mut text = header();
    for model in models.iter().flat_map(|model| with_and_without(model, flights)) {
        let model = &model;
        let mut rows = Vec::new();
        for flight in flights {
            let flight = Prepared::new(flight, model.airframe.envelope.flying_from_mps())?;
            for start_s in starts(&flight) {
                rows.extend(run(model, &flight, start_s, horizons_s, longest));
            }
        }
        rows.iter().for_each(|row| write_row(&mut text, row, &rows, horizons_s));
    }
    if text.lines().nth(1).is_none() {
        bail!(
            "no free run reaches the shortest horizon, so there is nothing to write; give a shorter --horizon"
        );
    }
    Ok(text)
}

/// `model`. If its file has constants of `flights` (trims, sensor errors), also a copy without these constants.
fn with_and_without(model: &GreyBox, flights: &[Reconstruction]) -> Vec<GreyBox> {
    let mut all = vec![model.clone()];
    if flights.iter().any(|f| model.known.of(&f.name).is_some()) {
        let mut bare = model.clone();
        bare.known = Default::default();
        bare.name += " without its flights' constants";
        all.push(bare);
    }
    all
}

fn header() -> String {
    let mut names: Vec<String> =
        ["model", "flight", "start_s", "horizon_s"].map(String::from).to_vec();
    for name in State::NAMES {
        let all = ["", "_measured", "_from", "_to"].map(|what| format!("{name}{what}"));
        names.extend(all);
    }
    names.join(",") + "\n"
}

/// Times (s) at which free runs start. `greylag compare` uses the same times.
fn starts(flight: &Prepared) -> Vec<f64> {
    let every = ((START_EVERY_S / flight.dt).round() as usize).max(1);
    let of = flight.segments.iter().flat_map(|s| s.iter().take(s.len() - 1).step_by(every));
    of.map(|i| i.time_s).collect()
}

fn run<'a>(
    model: &'a GreyBox,
    flight: &Prepared,
    start_s: f64,
    horizons_s: &[f64],
    longest: f64,
) -> Vec<Row<'a>> {
    let Some(path) = free_run::from_moment(model, flight, start_s, longest) else {
        return Vec::new();
    };
    let inside = flight.segments.iter().find(|s| s.iter().any(|i| i.time_s == start_s));
    let first = inside.and_then(|s| s.iter().position(|i| i.time_s == start_s));
    let Some((segment, first)) = inside.zip(first) else { return Vec::new() };
    let at = |(horizon, seconds): (usize, &f64)| {
        let steps = ((seconds / flight.dt).round() as usize).max(1);
        (steps < path.time_s.len()).then(|| Row {
            model: &model.name,
            flight: flight.name.clone(),
            start_s,
            horizon,
            predicted: std::array::from_fn(|k| path.states[k][steps]),
            measured: segment[first + steps].state.to_array(),
        })
    };
    horizons_s.iter().enumerate().filter_map(at).collect()
}

/// `name` as a field of the table: in quotes if it contains a comma, a quote or a line break (RFC 4180).
fn field(name: &str) -> String {
    match name.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")),
        false => name.to_owned(),
    }
}

fn write_row(text: &mut String, row: &Row, all: &[Row], horizons_s: &[f64]) {
    let same = |r: &&Row| r.horizon == row.horizon && !std::ptr::eq::<Row>(*r, row);
    let (mut squares, mut count) = ([0.0; 8], 0.0);
    for other in all.iter().filter(same) {
        let error = free_run::error(&other.measured, &other.predicted);
        squares.iter_mut().zip(error).for_each(|(s, e)| *s += e * e);
        count += 1.0;
    }
    let horizon = horizons_s[row.horizon];
    // writing to a String cannot fail
    let [model, flight] = [row.model, &row.flight].map(field);
    let _ = write!(text, "{model},{flight},{},{horizon}", row.start_s);
    let bound = |x: f64| if x.is_finite() { format!("{x}") } else { String::new() };
    for ((x, measured), square) in row.predicted.iter().zip(&row.measured).zip(squares) {
        let half = NORMAL_95 * (square / count).sqrt();
        let _ = write!(text, ",{x},{measured},{},{}", bound(x - half), bound(x + half));
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_a_comma_is_one_field() {
        let row = |model| Row {
            model,
            flight: "flight 2, \"windy\".csv".into(),
            start_s: 3.0,
            horizon: 0,
            predicted: [0.0; 8],
            measured: [0.0; 8],
        };
        let rows = [row("x8")];
        let mut text = header();
        write_row(&mut text, &rows[0], &rows, &[1.0]);
        let mut read = csv::Reader::from_reader(text.as_bytes());
        let record = read.records().next().unwrap().unwrap();
        assert_eq!(&record[1], "flight 2, \"windy\".csv");
        assert_eq!(&record[3], "1");
    }
}

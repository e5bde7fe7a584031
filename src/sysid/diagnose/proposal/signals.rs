//! Export of the residual in which `propose` searches for a formula, as a CSV table.

use std::fmt::Write;

use super::forward::ORDER;
use super::free::samples::{Samples, VARIABLES};
use crate::diagnose::answer::run::problem;
use crate::diagnose::search::round::Round;
use crate::diagnose::{DiagnoseError, Options};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::corrected;
use greylag_model::GreyBox;
use greylag_physics::formula::file::channel_name;

/// Returns the residual of `model` as a CSV table. Before that, the coefficients of `model` and the sensor errors are fitted to
/// `flights`.
///
/// The table has one row for each window of the weak form (0.37 s, half overlapping). Its columns are: the index of the flight
/// in `flights`, from 0; the mean of each variable over the window (SI units); dynamic pressure times wing area (`qbar_S`, N);
/// and the residual of each channel (N or N m; empty if it is not measured). The name of a residual's column is `left_` followed
/// by the channel.
///
/// # Errors
/// As [`diagnose`](crate::diagnose::diagnose).
pub fn signals(
    model: &GreyBox,
    flights: &[Reconstruction],
    options: &Options,
) -> Result<String, DiagnoseError> {
    let unusable = || DiagnoseError::Unusable { model: model.name.clone() };
    let right = corrected(&model.known, flights, options.per_flight);
    let options = Options { per_flight: right.per_flight, ..options.clone() };
    let (problem, used, _) = problem(model, &right.flights, &options)?;
    let numbers = numbers(&used, &right.flights);
    let tuned = Round::new(&problem, model.clone(), &[]).ok_or_else(unusable)?.tuned();
    let round = Round::new(&problem, tuned, &[]).ok_or_else(unusable)?;
    let left = round.tuned_residual();
    let samples = Samples::new(&round, ORDER[0]);
    let names: Vec<&str> = VARIABLES.iter().map(|v| v.name()).collect();
    let mut text = format!("flight,{},qbar_S", names.join(","));
    ORDER.iter().for_each(|c| text += &format!(",left_{}", channel_name(*c)));
    text += "\n";
    for (k, own) in left.iter().enumerate() {
        for (w, row) in samples.means(&round, k).iter().enumerate() {
            let _ = write!(text, "{}", numbers[k]);
            for x in row {
                let _ = write!(text, ",{x:.6e}");
            }
            for channel in own {
                let _ = match channel.get(w).filter(|x| x.is_finite()) {
                    Some(x) => write!(text, ",{x:.6e}"),
                    None => write!(text, ","),
                };
            }
            text += "\n";
        }
    }
    Ok(text)
}

/// Index in `all` of each flight of `used`. Flights that are too short are missing in `used`.
fn numbers(used: &[&Reconstruction], all: &[Reconstruction]) -> Vec<usize> {
    let number = |flight: &&Reconstruction| all.iter().position(|f| std::ptr::eq(f, *flight));
    used.iter().filter_map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flight_keeps_its_number_if_an_earlier_one_is_left_out() {
        let all = ["f"; 3].map(Reconstruction::empty);
        assert_eq!(numbers(&[&all[0], &all[2]], &all), [0, 2]);
    }
}

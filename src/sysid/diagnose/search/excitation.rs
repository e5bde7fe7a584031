//! Checks whether the flights contain enough excitation for a diagnosis.

use crate::diagnose::error::DiagnoseError;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;
use greylag_logs::rudder::MOVES_RAD;

/// Smallest total duration of the flights, s.
const LEAST_S: f64 = 10.0;

/// Requirement on the motion of a variable: its name, a function that reads it, the smallest standard deviation, the factor
/// from SI to the unit of this deviation, the unit, and a manoeuvre that excites the variable.
type Need = (&'static str, fn(&Instant) -> f64, f64, f64, &'static str, &'static str);

const NEEDS: [Need; 4] = [
    ("the aileron", |i| i.controls.aileron, 0.3, 57.3, "°", "aileron doublets"),
    ("the elevator", |i| i.controls.elevator, 0.3, 57.3, "°", "elevator doublets or a 3-2-1-1"),
    ("the throttle", |i| i.controls.throttle, 2.0, 100.0, " %", "throttle steps"),
    ("the angle of attack", |i| i.state.alpha, 0.4, 57.3, "°", "pull-ups and a slow flight"),
];

/// Returns a note for each variable that moves too little for a diagnosis.
///
/// # Errors
/// If the flights are shorter than 10 s in total, or if at least three of aileron, elevator, throttle and angle of attack move
/// too little.
pub fn check(flights: &[Prepared]) -> Result<Vec<String>, DiagnoseError> {
    let seconds = flights.iter().fold(0.0, |sum, f| sum + f.sample_count() as f64 * f.dt);
    if seconds < LEAST_S {
        return Err(DiagnoseError::TooLittle { seconds, least: LEAST_S });
    }
    let mut still = Vec::new();
    for (name, of, least, factor, unit, fly) in NEEDS {
        let moved = factor * deviation(flights, of);
        if moved < least {
            still.push((small(name, moved, unit), fly));
        }
    }
    if still.len() >= 3 {
        let what: Vec<&str> = still.iter().map(|(text, _)| text.as_str()).collect();
        return Err(DiagnoseError::NoExcitation { what: what.join(", ") });
    }
    Ok(still
        .into_iter()
        .map(|(text, fly)| format!("{text}: what depends on it is not seen; fly {fly}"))
        .collect())
}

/// Describes the small motion of a variable in words. A constant variable probably comes from the wrong channel of the log.
fn small(name: &str, moved: f64, unit: &str) -> String {
    match moved == 0.0 {
        true => format!(
            "{name} never moves in the log: look whether this is the channel that flies the aircraft"
        ),
        false => format!("{name} moves by {moved:.2}{unit} only"),
    }
}

/// Whether the rudder moves enough in `flights` for a search for rudder effects.
pub fn moves_rudder(flights: &[Prepared]) -> bool {
    deviation(flights, |i| i.controls.rudder) > MOVES_RAD
}

/// Pooled standard deviation of a variable about the mean of each flight, in the variable's unit.
fn deviation(flights: &[Prepared], of: fn(&Instant) -> f64) -> f64 {
    let (mut square, mut count) = (0.0, 0.0);
    for flight in flights {
        let values: Vec<f64> = flight.segments.iter().flatten().map(of).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        square += values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        count += values.len() as f64;
    }
    (square / count.max(1.0)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_moves_is_called_another_channel() {
        assert!(small("the aileron", 0.0, "°").contains("look whether this is the channel"));
        assert_eq!(small("the aileron", 0.12, "°"), "the aileron moves by 0.12° only");
    }

    #[test]
    fn no_flight_lasts_zero_seconds_and_not_minus_zero() {
        let said = check(&[]).unwrap_err().to_string();
        assert!(said.contains("from 0 s of flight"), "{said}");
    }
}

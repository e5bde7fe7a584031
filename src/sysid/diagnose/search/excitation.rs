//! Whether the flights move what a diagnosis needs moved.

use crate::diagnose::error::DiagnoseError;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;
use greylag_logs::rudder::MOVES_RAD;

/// Least flight time, s.
const LEAST_S: f64 = 10.0;

/// What must move, by how much at least (standard deviation), its unit, and what to fly for it.
type Need = (&'static str, fn(&Instant) -> f64, f64, f64, &'static str, &'static str);

const NEEDS: [Need; 4] = [
    ("the aileron", |i| i.controls.aileron, 0.3, 57.3, "°", "aileron doublets"),
    ("the elevator", |i| i.controls.elevator, 0.3, 57.3, "°", "elevator doublets or a 3-2-1-1"),
    ("the throttle", |i| i.controls.throttle, 2.0, 100.0, " %", "throttle steps"),
    ("the angle of attack", |i| i.state.alpha, 0.4, 57.3, "°", "pull-ups and a slow flight"),
];

/// Notes on what hardly moves.
///
/// # Errors
/// If there is too little flight, or aileron, elevator and angle of attack all hardly move.
pub fn check(flights: &[Prepared]) -> Result<Vec<String>, DiagnoseError> {
    let seconds: f64 = flights.iter().map(|f| f.sample_count() as f64 * f.dt).sum();
    if seconds < LEAST_S {
        return Err(DiagnoseError::TooLittle { seconds, least: LEAST_S });
    }
    let mut still = Vec::new();
    for (name, of, least, factor, unit, fly) in NEEDS {
        let moved = factor * deviation(flights, of);
        if moved < least {
            still.push((format!("{name} moves by {moved:.2}{unit} only"), fly));
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

/// Whether the rudder moves in `flights`, so that its effects can be searched for.
pub fn moves_rudder(flights: &[Prepared]) -> bool {
    deviation(flights, |i| i.controls.rudder) > MOVES_RAD
}

/// Standard deviation within flights.
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

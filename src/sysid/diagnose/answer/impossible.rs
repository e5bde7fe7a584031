//! Checks of the estimates of a diagnosis for physically impossible values: constants of sensors and wind in each flight, and
//! coefficients of the model. If one is impossible, the diagnosis makes no statement about forces and moments.

use crate::diagnose::answer::result::Tuned;
use crate::diagnose::answer::sentences::with_interval;
use crate::flight_path::reconstruction::{Nuisance, Reconstruction};
use greylag_num::statistics::mean;

/// Plausible range of the airspeed scale, the ratio of measured to true airspeed. A badly placed static port causes errors of 10
/// to 15 %.
const SCALES: [f64; 2] = [0.8, 1.25];
/// Largest plausible mean vertical wind over a flight, m/s. The mean over the up- and downdraughts of thermals is small.
const VERTICAL_MPS: f64 = 3.0;
/// Largest plausible distance of an estimated constant from its prior mean, in prior standard deviations.
const BELIEVED: f64 = 6.0;
/// Number of its standard deviations by which an estimate must exceed a limit to count as impossible.
const SURELY: f64 = 4.0;
/// A lift slope below this fraction of its prior mean counts as impossible.
const NO_WING: f64 = 0.2;

/// A sentence for each impossible estimate in `flights` and among the coefficients `tuned`, with advice on what to check.
pub fn impossible(flights: &[&Reconstruction], tuned: &[Tuned]) -> Vec<String> {
    let of_flight = |flight: &&Reconstruction| {
        let speeds: Vec<f64> = flight
            .segments
            .iter()
            .flat_map(|s| s.instants.iter().map(|i| i.state.airspeed))
            .collect();
        let airspeed = mean(&speeds);
        let wind = wind(flight, airspeed);
        let all = flight.nuisances.iter().filter_map(move |n| Some((n, why(n)?)));
        let all = all.map(|(n, why)| sentence(&flight.name, n, why)).chain(wind);
        all.collect::<Vec<_>>()
    };
    let of_coefficient = |t: &Tuned| coefficient(t, flights.len());
    flights.iter().flat_map(of_flight).chain(tuned.iter().filter_map(of_coefficient)).collect()
}

fn sentence(flight: &str, n: &Nuisance, why: &str) -> String {
    format!("{flight}: {} is found at {}: {why}.", n.name, with_interval(n.value, n.sd, n.unit))
}

/// The reason why the estimate of a constant is impossible, with advice on what to check; `None` if it is possible.
fn why(n: &Nuisance) -> Option<&'static str> {
    let name = n.name.as_str();
    let beyond =
        |low: f64, high: f64| n.value + SURELY * n.sd < low || n.value - SURELY * n.sd > high;
    match name {
        _ if !(n.value.is_finite() && n.sd.is_finite()) => {
            Some("no number; look at that sensor's column")
        }
        "airspeed_scale" if beyond(SCALES[0], SCALES[1]) => Some(
            "no pitot errs by so much; look for a frozen or blocked airspeed, a wrong unit, or a velocity over ground that \
             is late",
        ),
        "wind_down" if beyond(-VERTICAL_MPS, VERTICAL_MPS) => Some(
            "no air sinks or rises so fast for the length of a flight; look at airspeed, vanes and velocity over ground",
        ),
        _ if n.moved().abs() > BELIEVED => Some(
            "it lies more than six standard deviations from what was known of it; look at that sensor, or at what \
             [sensors] says of it",
        ),
        _ => None,
    }
}

/// A sentence on an estimated wind that is faster than the mean airspeed `airspeed` (m/s). `None` if it is slower or was not
/// estimated.
fn wind(flight: &Reconstruction, airspeed: f64) -> Option<String> {
    let of = |name: &str| {
        flight.nuisances.iter().find(|n| n.name == name).filter(|n| n.moved().abs() > 0.0)
    };
    let (north, east) = (of("wind_north")?, of("wind_east")?);
    let (speed, sd) = (north.value.hypot(east.value), north.sd.hypot(east.sd));
    (speed - SURELY * sd > airspeed).then(|| {
        format!(
            "{}: the wind is found at {}, faster than the aircraft flies ({airspeed:.1} m/s): look at airspeed, heading and \
             velocity over ground, or for hovering.",
            flight.name,
            with_interval(speed, sd, "m/s")
        )
    })
}

/// A sentence on a damping derivative with the wrong sign or on a lift slope near zero; `None` for any other estimate. `flights`
/// is the number of flights to which the coefficient was fitted.
fn coefficient(t: &Tuned, flights: usize) -> Option<String> {
    let own = t.name.rsplit('.').next()?;
    let damps = ["Cmq", "Clp", "Cnr"].contains(&own);
    let drives = damps && t.prior < 0.0 && t.value - SURELY * t.sd > 0.0;
    let no_wing = own == "CLalpha" && t.value + SURELY * t.sd < NO_WING * t.prior;
    let why = match (drives, no_wing) {
        (true, _) if flights == 1 => {
            "a damping that drives. On a single flight a missing effect can cause it: diagnose several flights together. If it \
             stays, look for a hover, a wrong axis or sign, or a clock that is off"
        }
        (true, _) => {
            "a damping that drives; look for a hover, a wrong axis or sign, or a clock that is off"
        }
        (_, true) => {
            "a wing that hardly lifts; look at airspeed and angle of attack, or for a hover"
        }
        _ => return None,
    };
    Some(format!("{} is tuned to {}: {why}.", t.name, with_interval(t.value, t.sd, "")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constant(name: &str, value: f64, sd: f64) -> Nuisance {
        Nuisance { name: name.into(), value, sd, unit: "", prior: None }
    }

    #[test]
    fn what_no_sensor_and_no_air_does_is_said() {
        assert!(why(&constant("airspeed_scale", 0.717, 0.02)).is_some());
        assert!(why(&constant("airspeed_scale", 0.717, 0.2)).is_none());
        assert!(why(&constant("airspeed_scale", 1.1, 0.01)).is_none());
        assert!(why(&constant("wind_down", -7.0, 0.5)).is_some());
        assert!(why(&constant("gyro_bias_p", f64::NAN, 0.5)).is_some());
    }

    #[test]
    fn a_damping_that_drives_and_a_wing_that_does_not_lift_are_said() {
        let of = |name: &str, prior, value| Tuned {
            name: name.into(),
            prior,
            prior_sd: 0.1,
            value,
            sd: 0.05,
        };
        let one = coefficient(&of("pitch_linear.Cmq", -1.0, 1.6), 1).unwrap();
        let two = coefficient(&of("pitch_linear.Cmq", -1.0, 1.6), 2).unwrap();
        assert!(one.contains("several flights") && !two.contains("several flights"));
        assert!(coefficient(&of("pitch_linear.Cmq", -1.0, 0.1), 1).is_none());
        assert!(coefficient(&of("lift_linear.CLalpha", 5.3, 0.24), 1).is_some());
        assert!(coefficient(&of("lift_linear.CLalpha", 5.3, 4.0), 1).is_none());
    }
}

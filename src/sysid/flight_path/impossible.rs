//! Checks of the constants of a reconstructed flight (sensor errors, wind) for physically impossible values. A log with such a value
//! tells nothing about forces and moments.

use crate::flight_path::reconstruction::{Nuisance, Reconstruction};
use crate::text::with_interval;
use greylag_num::statistics::mean;

/// Plausible range of the airspeed scale, the ratio of measured to true airspeed. A badly placed static port causes errors of 10
/// to 15 %.
const SCALES: [f64; 2] = [0.8, 1.25];
/// Largest plausible mean vertical wind over a flight, m/s. The mean over the up- and downdraughts of thermals is small.
const VERTICAL_MPS: f64 = 3.0;
/// Largest plausible distance of an estimated constant from its prior mean, in prior standard deviations.
const BELIEVED: f64 = 6.0;
/// Angle of attack or sideslip, rad, beyond which no aircraft flies on its wings for the share [`SHARE`] of a flight.
const BROADSIDE: f64 = std::f64::consts::FRAC_PI_3;
const SHARE: f64 = 0.1;
/// Number of its standard deviations by which an estimate must exceed a limit to count as impossible.
pub const SURELY: f64 = 4.0;

/// A sentence for each impossible constant of `flight` and for an impossible flow, with advice on what to check. Empty if all are
/// possible.
pub fn of_flight(flight: &Reconstruction) -> Vec<String> {
    let speeds: Vec<f64> =
        flight.segments.iter().flat_map(|s| s.instants.iter().map(|i| i.state.airspeed)).collect();
    let found = flight.nuisances.iter().filter_map(|n| Some((n, why(n)?)));
    let all = found.map(|(n, why)| sentence(&flight.name, n, why));
    all.chain(wind(flight, mean(&speeds))).chain(flow(flight)).collect()
}

/// A sentence on a flight that goes through the air broadside for too long: its velocity contradicts its attitude.
fn flow(flight: &Reconstruction) -> Option<String> {
    let states = flight.segments.iter().flat_map(|s| s.instants.iter().map(|i| &i.state));
    let (mut all, mut beyond) = (0_usize, 0_usize);
    for state in states.filter(|s| s.alpha.is_finite() && s.beta.is_finite()) {
        all += 1;
        beyond += usize::from(state.alpha.abs() > BROADSIDE || state.beta.abs() > BROADSIDE);
    }
    let share = beyond as f64 / all.max(1) as f64;
    (share > SHARE).then(|| {
        format!(
            "{}: α or β is beyond 60° for {:.0} % of the flight: velocity and attitude contradict each other; look at north, east \
             and down of the velocity over ground, at heading and airspeed, or for hovering.",
            flight.name,
            100.0 * share
        )
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::reconstruction::{Instant, Segment};
    use greylag_physics::{Controls, State};

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
    fn a_flight_that_goes_broadside_is_said_and_a_short_tumble_is_not() {
        let flown = |beyond: usize| {
            let instant = |k: usize| {
                let alpha = if k < beyond { -1.5 } else { 0.05 };
                Instant {
                    time_s: 0.01 * k as f64,
                    state: State { airspeed: 17.0, alpha, ..State::default() },
                    yaw: 0.0,
                    controls: Controls::default(),
                    command: None,
                    specific_force: [0.0; 3],
                    altitude: 0.0,
                    density: 1.2,
                }
            };
            let segments = vec![Segment { instants: (0..100).map(instant).collect() }];
            Reconstruction { segments, ..Reconstruction::empty("swapped.csv") }
        };
        assert!(of_flight(&flown(8)).is_empty());
        let said = of_flight(&flown(40));
        assert!(
            said.len() == 1 && said[0].starts_with("swapped.csv: α or β is beyond 60° for 40 %"),
            "{said:?}"
        );
    }

    #[test]
    fn an_impossible_constant_is_said_with_its_flight() {
        let mut flight = Reconstruction::empty("knots.csv");
        flight.nuisances = vec![constant("airspeed_scale", 1.1, 0.01)];
        assert!(of_flight(&flight).is_empty());
        flight.nuisances = vec![constant("airspeed_scale", 1.87, 0.01)];
        let said = of_flight(&flight);
        assert!(
            said.len() == 1 && said[0].starts_with("knots.csv: airspeed_scale is found at 1.87 ±")
        );
    }
}

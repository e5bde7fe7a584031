//! Fitted constants that are written to the model's file: misalignment angles of the sensors, sensor errors and trims. Trims are
//! constants that are added to the force and moment coefficients in one flight, and a relative change of the thrust. The
//! constants of the installation apply to all flights. An angle or sensor error in a flight's own entry replaces that of the
//! installation.

use super::flight::{OFFSETS, Own, SENSORS, SKEW};
use crate::amend::error::AmendError;
use crate::per_flight::{PerFlight, SensorErrors};
use greylag_model::{FlightConstants, Known};

/// The mean of an angle or sensor error over the flights becomes a constant of the installation if it exceeds this number of
/// standard errors.
const CLEAR: f64 = 2.0;
/// Source of the constants, as written to the model's file.
const BY: &str = "greylag amend";
/// Sensor errors that belong to an installation, as indices of `greylag_model::known::SENSORS`: airspeed, α, β. A gyro bias
/// changes each time that the sensor is switched on.
const INSTALLED: [usize; 3] = [0, 4, 5];

/// The estimated constants of a flight.
pub(super) struct Learned<'a> {
    /// Name of the flight, from its log file.
    pub name: &'a str,
    /// Estimates of the flight's constants.
    pub own: &'a Own,
    /// Standard deviations of the constants, in the order of [`Own::unknowns`].
    pub sd: &'a [f64],
}

impl Learned<'_> {
    fn angles_deg(&self) -> [[f64; 2]; 3] {
        let of = |k: usize| [self.own.askew[k], self.sd[SENSORS + k]].map(f64::to_degrees);
        std::array::from_fn(of)
    }

    fn sensors(&self) -> [[f64; 2]; OFFSETS.len()] {
        std::array::from_fn(|k| [self.own.sensors[SKEW + 1 + k], self.sd[SKEW + 1 + k]])
    }
}

/// Checks that the flights `names` have different names if `asked` requests misalignment angles or trims. The model's file
/// identifies the constants of a flight by its name.
///
/// # Errors
/// Two flights have the same name.
pub(super) fn distinct(names: &[&str], asked: &PerFlight) -> Result<(), AmendError> {
    if asked.angles() == 0 && !asked.has_trims() {
        return Ok(());
    }
    let again = |(k, name): (usize, &&str)| names[..k].contains(name).then(|| (*name).to_owned());
    match names.iter().enumerate().find_map(again) {
        Some(name) => Err(AmendError::OneName { name }),
        None => Ok(()),
    }
}

/// Constants for the model's file after a fit to `flights`. `asked` states which constants were estimated. `before` holds the
/// previous constants of the file.
///
/// If misalignment angles or trims were estimated, every flight gets an entry of its own. The installation gets the mean
/// angles and mean sensor errors that differ significantly from zero.
pub(super) fn known(before: &Known, flights: &[Learned], asked: &PerFlight) -> Known {
    let anew = asked.angles() > 0;
    let mut all = without_trims(before);
    all.installation = installation(all.installation.as_ref(), flights, asked);
    if !anew && !asked.has_trims() {
        return all;
    }
    let constants = |f: &Learned| {
        let known = before.of(f.name).unwrap_or_default();
        let had = if anew { Default::default() } else { known.sensors.unwrap_or_default() };
        let left = f.sensors();
        let axes = f.angles_deg().map(|[angle, _]| angle);
        FlightConstants {
            source: BY.into(),
            axes_deg: if anew { Some(axes) } else { known.axes_deg },
            trims: asked.has_trims().then_some(f.own.trims),
            sensors: Some(std::array::from_fn(|k| had[k] + left[k][0])),
        }
    };
    all.flights.extend(flights.iter().map(|f| (f.name.to_owned(), constants(f))));
    all
}

/// The constants `known` without trims, because trims are not valid after a change of the model's coefficients.
fn without_trims(known: &Known) -> Known {
    let mut kept = known.clone();
    kept.flights.values_mut().for_each(|own| own.trims = None);
    kept.flights.retain(|_, own| own.axes_deg.is_some() || own.sensors.is_some());
    kept
}

/// The constants of the installation after a fit to `flights`: mean misalignment angles if the fit has estimated any, and mean
/// sensor errors. Means that do not differ significantly from zero are omitted.
///
/// If the fit estimates misalignment angles, its results replace the constants `before`. Otherwise its flights were already
/// corrected with `before`. The mean sensor errors of the fit are then added to those of `before`, and the angles of `before` are
/// kept.
fn installation(
    before: Option<&FlightConstants>,
    flights: &[Learned],
    asked: &PerFlight,
) -> Option<FlightConstants> {
    let anew = asked.angles() > 0;
    let before = before.filter(|_| !anew);
    let clear = |x: &f64| *x != 0.0;
    let axes: Option<[f64; 3]> =
        anew.then(|| std::array::from_fn(|k| over(flights, |f| f.angles_deg()[k])));
    let axes = axes.filter(|all| all.iter().any(clear));
    let mut sensors = [0.0; OFFSETS.len()];
    if asked.sensors != SensorErrors::Dropped {
        INSTALLED.iter().for_each(|k| sensors[*k] = over(flights, |f| f.sensors()[*k]));
    }
    if axes.is_none() && !sensors.iter().any(clear) {
        return before.cloned();
    }
    let had = before.and_then(|b| b.sensors).unwrap_or_default();
    let sensors: [f64; OFFSETS.len()] = std::array::from_fn(|k| had[k] + sensors[k]);
    let number = flights.len();
    Some(FlightConstants {
        source: format!("{BY}: the mean of {number} flight(s), constants that are clear of zero"),
        axes_deg: axes.or(before.and_then(|b| b.axes_deg)),
        trims: None,
        sensors: sensors.iter().any(clear).then_some(sensors),
    })
}

/// The value of a constant that `flights` have in common, see [`common`]. `of` returns the value and standard deviation of the
/// constant of one flight.
fn over(flights: &[Learned], of: impl Fn(&Learned) -> [f64; 2]) -> f64 {
    common(&flights.iter().map(of).collect::<Vec<_>>())
}

/// The mean of `estimates` (value and standard deviation), or zero if the mean is at most twice its standard error. The
/// standard error follows from the standard deviations or from the scatter of the estimates, whichever is larger.
fn common(estimates: &[[f64; 2]]) -> f64 {
    let n = estimates.len() as f64;
    let mean = estimates.iter().map(|[x, _]| x).sum::<f64>() / n;
    let known = estimates.iter().map(|[_, sd]| sd * sd).sum::<f64>() / n;
    let spread =
        estimates.iter().map(|[x, _]| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let error = (known.max(spread) / n).sqrt();
    if mean.abs() > CLEAR * error { mean } else { 0.0 }
}

/// Text about the sensor errors that the installation `after` has in addition to those of `before`. `None` if there are none.
pub(super) fn sensors_in_words(
    before: Option<&FlightConstants>,
    after: &FlightConstants,
) -> Option<String> {
    let had = before.and_then(|b| b.sensors).unwrap_or_default();
    let has = after.sensors.unwrap_or_default();
    let of = |k: usize, name: &str, factor: f64, unit: &str| {
        let by = has[k] - had[k];
        (by != 0.0).then(|| format!("{name} {:+.1}{unit}", factor * by))
    };
    let degree = 1f64.to_degrees();
    let [airspeed, alpha, beta] = INSTALLED;
    let all = [
        of(airspeed, "airspeed", 100.0, " %"),
        of(alpha, "angle of attack", degree, "°"),
        of(beta, "sideslip", degree, "°"),
    ];
    let said: Vec<String> = all.into_iter().flatten().collect();
    (!said.is_empty()).then(|| said.join(", "))
}

/// Text about the misalignment angles of an installation that are not zero.
pub(super) fn in_words(installation: &FlightConstants) -> String {
    let named = ["roll", "pitch", "yaw"].into_iter().zip(installation.axes_deg.unwrap_or_default());
    let turned: Vec<String> =
        named.filter(|(_, x)| *x != 0.0).map(|(name, x)| format!("{name} {x:.1}°")).collect();
    turned.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_flights_of_one_name_have_no_constants_of_their_own() {
        let trims = PerFlight { trims: Some(1.0), ..PerFlight::default() };
        let askew = PerFlight { askew_deg: Some(3.0), ..PerFlight::default() };
        let twice = ["flight.csv", "other.csv", "flight.csv"];
        for asked in [trims, askew] {
            let why = distinct(&twice, &asked).unwrap_err().to_string();
            assert!(why.contains("two of them are called flight.csv"), "{why}");
            distinct(&twice[..2], &asked).unwrap();
        }
        distinct(&twice, &PerFlight::default()).unwrap();
    }

    #[test]
    fn a_mean_is_common_only_where_flights_agree_on_it() {
        assert_eq!(common(&[[-9.0, 1.0], [-11.0, 1.0]]), -10.0);
        // 2° in one flight and 0° in the other do not give an angle of the installation
        assert_eq!(common(&[[2.0, 0.1], [0.0, 0.1]]), 0.0);
        assert_eq!(common(&[[1.0, 1.0]]), 0.0);
    }
}

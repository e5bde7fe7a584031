//! Stability and control derivatives of randomly drawn aircraft: the values estimated in a flight of one minute, compared
//! with the true ones.

use comfy_table::Table;

use super::any::{Flight, kept, percent};
use crate::control::ControllerKind;
use crate::control::aircraft_estimate::{AircraftEstimator, DERIVATIVES};
use crate::model::GreyBox;
use crate::model::population::{Character, TRAITS};
use crate::num::statistics::quantile;
use crate::physics::atmosphere::STANDARD_GRAVITY;

/// For each derivative: name of the trait in `TRAITS` from which its magnitude is taken, and the power of V/g (cruise airspeed
/// over gravity) by which the trait is made dimensionless.
const MAGNITUDES: [(&str, i32); DERIVATIVES.len()] =
    [("roll power", 2), ("roll damping", 1), ("pitch power", 2), ("pitch stiffness", 2)];

/// The true derivatives of the aircraft `model`, in the order and the units of `AircraftEstimator::derivatives`. `None` if
/// the aircraft cannot be trimmed at its cruise airspeed.
fn own(model: &GreyBox) -> Option<[f64; DERIVATIVES.len()]> {
    let values = Character::of(model).ok()?.values;
    let time = model.airframe.envelope.airspeed_cruise_mps / STANDARD_GRAVITY;
    let mut own = [0.0; DERIVATIVES.len()];
    for (own, (name, power)) in own.iter_mut().zip(MAGNITUDES) {
        let place = TRAITS.iter().position(|t| t.name == name)?;
        *own = -values[place] / time.powi(power);
    }
    own[0] = -own[0];
    Some(own)
}

/// Ratios of the estimated derivatives to the true ones. A derivative that the flight does not determine is `None`. The
/// result is empty for an aircraft that cannot be trimmed.
pub(super) fn ratios(estimator: &AircraftEstimator, exact: &GreyBox) -> Vec<Option<f64>> {
    let Some(own) = own(exact) else { return Vec::new() };
    let all = estimator.derivatives().into_iter().zip(own);
    all.map(|(estimated, own)| Some(estimated / own).filter(|r| r.is_finite())).collect()
}

/// One row for each controller and derivative: percentage of the flights that determine the derivative, and median and 90th
/// percentile of the relative error over these flights. Flights in which the aircraft was lost are excluded.
pub(super) fn table(kinds: &[ControllerKind], flights: &[Flight]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(["controller", "derivative", "revealed %", "error %, median", "90 %"]);
    for kind in kinds {
        let own: Vec<&Flight> =
            flights.iter().filter(|f| f.controller == kind.name() && kept(f).is_some()).collect();
        for (k, name) in DERIVATIVES.iter().enumerate() {
            let known = own.iter().filter_map(|f| *f.derivative_ratios.get(k)?);
            let errors: Vec<f64> = known.map(|ratio| 100.0 * (ratio - 1.0).abs()).collect();
            let mut row = vec![kind.name().to_owned(), (*name).to_owned()];
            row.push(percent(errors.len(), own.len(), 0));
            row.extend([0.5, 0.9].map(|q| match errors.is_empty() {
                true => "-".to_owned(),
                false => format!("{:.0}", quantile(&errors, q)),
            }));
            table.add_row(row);
        }
    }
    table
}

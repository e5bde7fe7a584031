//! True airspeed from the equivalent airspeed of a log.

use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, standard_density};

use crate::Sample;

/// Converts the equivalent airspeed of `rows` into true airspeed. Returns a note on the densities used.
///
/// Airspeed and density may be in different rows, so the last logged density is used. Without a logged density, the
/// standard atmosphere gives the density at the last logged altitude, or at sea level.
pub(crate) fn make_true(rows: &mut [Sample]) -> String {
    let (mut density, mut altitude) = (f64::NAN, f64::NAN);
    let mut by = [0usize; 3];
    for row in rows {
        if row.air_density_kgpm3 > 0.0 {
            density = row.air_density_kgpm3;
        }
        if row.altitude_m.is_finite() {
            altitude = row.altitude_m;
        }
        if row.airspeed_mps.is_nan() {
            continue;
        }
        let (i, rho) = match (density.is_nan(), altitude.is_nan()) {
            (false, _) => (0, density),
            (true, false) => (1, standard_density(altitude)),
            (true, true) => (2, SEA_LEVEL_DENSITY),
        };
        by[i] += 1;
        row.airspeed_mps *= (SEA_LEVEL_DENSITY / rho).sqrt();
    }
    format!(
        "airspeed is equivalent airspeed, made true by logged density in {} rows, by the standard atmosphere at the \
         logged altitude in {}, at sea level in {}",
        by[0], by[1], by[2]
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equivalent_airspeed_becomes_true_by_the_last_altitude() {
        let mut rows = [
            Sample { airspeed_mps: 20.0, ..Sample::default() },
            Sample { altitude_m: 2000.0, ..Sample::default() },
            Sample { airspeed_mps: 20.0, ..Sample::default() },
            Sample { airspeed_mps: 20.0, air_density_kgpm3: 1.0, ..Sample::default() },
        ];
        let note = make_true(&mut rows);
        let by = |density: f64| 20.0 * (SEA_LEVEL_DENSITY / density).sqrt();
        let found = [0, 2, 3].map(|k| rows[k].airspeed_mps);
        assert_eq!(found, [20.0, by(standard_density(2000.0)), by(1.0)]);
        assert!(rows[1].airspeed_mps.is_nan() && note.contains("in 1 rows"), "{note}");
    }
}

//! The earth's magnetic field at the start of the flight.

use world_magnetic_model::GeomagneticField;
use world_magnetic_model::time::Date;
use world_magnetic_model::uom::si::angle::degree;
use world_magnetic_model::uom::si::f32::{Angle, Length};
use world_magnetic_model::uom::si::length::meter;
use world_magnetic_model::uom::si::magnetic_flux_density::gauss;

use super::super::error::ShimError;

/// Year and day of the field. A fixed date makes flights repeatable; WMM2025 is valid from 2025 to 2029.
const DATE: (i32, u16) = (2026, 1);

/// Magnetic field by the World Magnetic Model 2025, north-east-down, gauss.
///
/// Latitude and longitude are in degrees, the altitude is above mean sea level, m. The field is computed once, at the start: 100
/// km away, its error is about 1 %.
///
/// # Errors
/// [`ShimError::Magnetism`] for a place outside the range of the model.
pub fn field_ned_gauss(
    latitude_deg: f64,
    longitude_deg: f64,
    altitude_m: f64,
) -> Result<[f64; 3], ShimError> {
    let unknown = || ShimError::Magnetism { latitude_deg, longitude_deg, altitude_m };
    let date = Date::from_ordinal_date(DATE.0, DATE.1).map_err(|_| unknown())?;
    let field = GeomagneticField::new(
        Length::new::<meter>(altitude_m as f32),
        Angle::new::<degree>(latitude_deg as f32),
        Angle::new::<degree>(longitude_deg as f32),
        date,
    )
    .map_err(|_| unknown())?;
    Ok([field.x(), field.y(), field.z()].map(|component| f64::from(component.get::<gauss>())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test values published with WMM2025 (NOAA, WMM2025_TestValues): at 2025.0, 80° N, 0° E, sea level, X is 6521.6, Y 145.9 and
    /// Z 54791.5 nT. A year of secular variation changes a component by less than 100 nT, which is 0.001 gauss.
    #[test]
    fn the_field_is_that_of_the_published_test_values() {
        let field = field_ned_gauss(80.0, 0.0, 0.0).unwrap();
        for (ours, published) in field.into_iter().zip([0.065_216, 0.001_459, 0.547_915]) {
            assert!((ours - published).abs() < 1e-3, "{field:?}");
        }
    }
}

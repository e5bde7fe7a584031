//! Reference dimensions of the wing (area, span, mean chord), by which coefficients are made dimensionless.

use greylag_sitl::plant::Plant;

use super::ImportError;

/// A reference dimension of the wing of `plant`, in the unit of the JSBSim property `property`. If the value is not positive and
/// finite, the error names the dimension as `what`.
pub(super) fn measure(
    plant: &mut Plant,
    what: &'static str,
    property: &'static str,
) -> Result<f64, ImportError> {
    positive(what, property, plant.property(property)?)
}

fn positive(what: &'static str, property: &'static str, value: f64) -> Result<f64, ImportError> {
    match value.is_finite() && value > 0.0 {
        true => Ok(value),
        false => Err(ImportError::Wing { what, property, value }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wing_without_a_chord_is_refused() {
        assert_eq!(positive("wing span", "metrics/bw-ft", 7.0).unwrap(), 7.0);
        for value in [0.0, -1.0, f64::NAN] {
            let why = positive("mean chord", "metrics/cbarw-ft", value).unwrap_err().to_string();
            assert!(why.contains("the mean chord of the aircraft (metrics/cbarw-ft) is"), "{why}");
        }
    }
}

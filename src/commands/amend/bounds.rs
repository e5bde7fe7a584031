//! Priors of model coefficients that a user gives to `greylag amend`: bounds as `--bound NAME=LEAST..MOST`, and a factor of all
//! standard deviations as `--widths FACTOR`.

use anyhow::{Result, bail};

use crate::model::GreyBox;
use crate::sysid::amend;

/// A coefficient with its lower and upper bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Bound {
    name: String,
    bounds: [f64; 2],
}

/// Parses a bound of the form `NAME=LEAST..MOST`.
pub fn bound(text: &str) -> Result<Bound, String> {
    let parts =
        text.split_once('=').and_then(|(name, range)| Some((name, range.split_once("..")?)));
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let read = parts.and_then(|(name, (low, high))| Some((name, number(low)?, number(high)?)));
    match read {
        Some((name, low, high)) if low < high => {
            Ok(Bound { name: name.trim().into(), bounds: [low, high] })
        }
        _ => Err("give a coefficient with the least and the most that it can be, such as \
                  lift_linear.CL0=-2..2"
            .into()),
    }
}

/// Returns `model` with the bounds `all` on its coefficients.
///
/// # Errors
/// If the model lacks a coefficient of `all`, or the value of a coefficient lies outside its bounds.
pub fn given(mut model: GreyBox, all: &[Bound]) -> Result<GreyBox> {
    for Bound { name, bounds: [low, high] } in all {
        let Some(c) = model.coefficients().iter().find(|c| c.name == *name) else {
            let names: Vec<&str> = model.coefficients().iter().map(|c| c.name.as_str()).collect();
            bail!(
                "--bound {name}: model {} has no such coefficient; it has {}",
                model.name,
                names.join(", ")
            );
        };
        if !(*low..=*high).contains(&c.value) {
            bail!(
                "--bound {name}={low}..{high}: the model file has {}, which lies outside",
                c.value
            );
        }
        model.set_bounds(name, [*low, *high]);
    }
    Ok(model)
}

/// Returns `model` with the prior standard deviations of its coefficients multiplied by `factor`, if one is given.
///
/// # Errors
/// If the factor is not positive.
pub fn widened(model: GreyBox, factor: Option<f64>) -> Result<GreyBox> {
    let Some(factor) = factor else { return Ok(model) };
    if !(factor.is_finite() && factor > 0.0) {
        bail!("--widths {factor}: give a positive factor, such as 3");
    }
    Ok(amend::widened(&model, factor))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_are_multiplied_and_zero_stays_held() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let wide = widened(model.clone(), Some(3.0)).unwrap();
        for (a, b) in model.coefficients().iter().zip(wide.coefficients()) {
            assert!((b.width() - 3.0 * a.width()).abs() < 1e-12, "{}", a.name);
        }
        assert!(model.coefficients().iter().any(|c| c.width() > 0.0));
        for wrong in [0.0, -1.0, f64::NAN] {
            assert!(widened(model.clone(), Some(wrong)).is_err());
        }
    }

    #[test]
    fn a_bound_is_a_name_and_a_range() {
        let read = bound("lift_linear.CL0=-2..2.5").unwrap();
        assert_eq!(read, Bound { name: "lift_linear.CL0".into(), bounds: [-2.0, 2.5] });
        for wrong in ["CL0", "CL0=1", "CL0=2..1", "CL0=a..1", "CL0=1..inf"] {
            assert!(bound(wrong).unwrap_err().contains("lift_linear.CL0=-2..2"), "{wrong}");
        }
    }
}

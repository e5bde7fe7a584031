//! Monte Carlo draws of models from the uncertainty of their coefficients.

use rand_distr::{Distribution, StandardNormal};

use crate::{GreyBox, Named};
use greylag_num::stream;
use greylag_physics::effects::Kind;
use greylag_physics::inputs;

/// Number of the random stream for draws.
const DRAWS: u64 = 40;

impl GreyBox {
    /// Bounds of the coefficient `name` (`effect.coefficient`): the bounds that the model states, else the physical bounds of
    /// the catalogue for an aircraft of this size. `None` if there is no such coefficient.
    pub fn bounds_of(&self, name: &str) -> Option<(f64, f64)> {
        let stated = self.coefficients().iter().find(|c| c.name == name).and_then(|c| c.bounds);
        if let Some([least, most]) = stated {
            return Some((least, most));
        }
        let (effect, coefficient) = name.split_once('.')?;
        let input = || inputs::Kind::from_id(effect).map(|kind| kind.describe());
        let about = Kind::from_id(effect).map(|kind| kind.describe()).or_else(input)?;
        let found = about.coefficients.iter().find(|c| c.name == coefficient)?;
        Some(self.size().bounds(found))
    }

    /// Draw number `k` of `seed`. Every coefficient is drawn from a normal distribution about its value, with its
    /// [width](Named::width) as standard deviation, and is clamped to its [bounds](GreyBox::bounds_of). Mass, inertia, actuators
    /// and the residual are unchanged.
    pub fn drawn(&self, seed: u64, k: u64) -> GreyBox {
        let mut rng = stream::stream(seed, &[DRAWS, k]);
        let draw = |c: &Named| {
            let normal: f64 = StandardNormal.sample(&mut rng);
            let value = c.value + c.width() * normal;
            self.bounds_of(&c.name).map_or(value, |(least, most)| value.clamp(least, most))
        };
        let values: Vec<f64> = self.coefficients().iter().map(draw).collect();
        let mut drawn = self.clone();
        drawn.name = format!("{}, draw {k}", self.name);
        drawn.set_coefficients(&values);
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn draws_spread_by_the_widths_and_repeat() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let draws: Vec<GreyBox> = (0..400).map(|k| model.drawn(7, k)).collect();
        for (i, c) in model.coefficients().iter().enumerate() {
            let values = draws.iter().map(|d| d.coefficients()[i].value - c.value);
            let square = values.map(|x| x * x).sum::<f64>() / draws.len() as f64;
            assert!(square.sqrt() <= 1.15 * c.width(), "{}", c.name);
            // clamping to a bound may remove the deviations to one side
            assert!(square.sqrt() >= 0.5 * c.width(), "{}", c.name);
        }
        assert_eq!(model.drawn(7, 3).coefficients(), draws[3].coefficients());
        assert_ne!(model.drawn(8, 3).coefficients(), draws[3].coefficients());
    }

    #[test]
    fn draws_keep_to_stated_bounds_and_to_those_of_input_effects() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let mut model = GreyBox::load(&path).unwrap();
        let name = "drag_linear.CD0";
        let (_, most) = model.bounds_of(name).unwrap();
        assert!(model.set_bounds(name, [most + 1.0, most + 3.0]));
        assert!(model.set_coefficient(name, most + 2.0));
        model.join("time_delay", &[0.05]).unwrap();
        let model = model.with_widths(|c| (c.name == "time_delay.delay_s").then_some(1.0));
        for k in 0..50 {
            let drawn = model.drawn(7, k);
            let of =
                |name: &str| drawn.coefficients().iter().find(|c| c.name == name).unwrap().value;
            assert!((most + 1.0..=most + 3.0).contains(&of(name)), "{}", of(name));
            assert!(of("time_delay.delay_s") >= 0.0);
        }
    }
}

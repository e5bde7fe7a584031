//! Natural modes of steady straight flight, with names, frequencies and time constants.

use nalgebra::{Complex, Matrix4, SMatrix};
use serde::Serialize;

use super::jacobian::jacobian;
use super::linear::{inputs, matrices, split};
use super::{GreyBox, Trim, TrimError};

/// Indices of θ, V, q, α and of φ, p, r, β in the state vector s = (φ, θ, V, p, q, r, α, β).
const LONGITUDINAL: [usize; 4] = [1, 2, 4, 6];
const LATERAL: [usize; 4] = [0, 3, 5, 7];

/// Linear model about a trim, in continuous time: δṡ = a δs + b δz. The inputs z are aileron, elevator, throttle and rudder
/// (δa, δe, δt, δr).
#[derive(Clone, Debug, PartialEq)]
pub struct Rates {
    /// Jacobian ∂ṡ/∂s. The states are φ, θ, V, p, q, r, α, β in SI units and rad.
    pub a: SMatrix<f64, 8, 8>,
    /// Jacobian ∂ṡ/∂z, per rad of deflection or per unit of throttle.
    pub b: SMatrix<f64, 8, 4>,
}

/// A natural mode, oscillatory or aperiodic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mode {
    /// Usual name of the mode.
    pub name: &'static str,
    /// Eigenvalue, 1/s. A complex pair is represented by the eigenvalue with the positive imaginary part.
    #[serde(serialize_with = "parts")]
    pub eigenvalue: Complex<f64>,
}

/// Serialises the real and the imaginary part.
fn parts<S: serde::Serializer>(x: &Complex<f64>, to: S) -> Result<S::Ok, S::Error> {
    [x.re, x.im].serialize(to)
}

impl Mode {
    /// Whether the mode is oscillatory.
    pub fn oscillates(&self) -> bool {
        self.eigenvalue.im > 0.0
    }

    /// Natural frequency of the mode, rad/s: the magnitude of its eigenvalue.
    pub fn frequency(&self) -> f64 {
        self.eigenvalue.norm()
    }

    /// Damping ratio. Negative for a divergent oscillation.
    pub fn damping(&self) -> f64 {
        -self.eigenvalue.re / self.eigenvalue.norm()
    }

    /// Time constant of decay, s. Negative for divergence.
    pub fn time_constant(&self) -> f64 {
        -1.0 / self.eigenvalue.re
    }
}

/// Linearises the state rates of `model` about `trim` at `altitude` (m).
pub fn rates(model: &GreyBox, trim: &Trim, altitude: f64) -> Rates {
    let (_, rows) = jacobian(&inputs(&trim.state, &trim.controls), |x| {
        let (state, controls) = split(x);
        model.rate(&state, &controls, altitude).to_array()
    });
    let (a, b) = matrices(rows);
    Rates { a, b }
}

/// Modes of straight flight at `airspeed` (m/s) and `altitude` (m): first longitudinal, then lateral.
///
/// # Errors
/// If the model has no straight-flight trim at this airspeed, or its linear model is not finite.
pub fn modes(model: &GreyBox, airspeed: f64, altitude: f64) -> Result<Vec<Mode>, TrimError> {
    let trim = Trim::straight(model, airspeed, altitude)?;
    let a = rates(model, &trim, altitude).a;
    // the eigenvalue iteration would not end if the matrix had a NaN
    if !a.iter().all(|x| x.is_finite()) {
        return Err(TrimError {
            model: model.name.clone(),
            roll_deg: 0.0,
            pitch_deg: trim.state.pitch.to_degrees(),
            airspeed_mps: airspeed,
        });
    }
    let part =
        |places: [usize; 4]| eigenvalues(&Matrix4::from_fn(|i, j| a[(places[i], places[j])]));
    let mut all = longitudinal(&part(LONGITUDINAL));
    all.extend(lateral(&part(LATERAL)));
    Ok(all)
}

/// Eigenvalues from fast to slow. A complex pair is represented by the eigenvalue with the positive imaginary part.
fn eigenvalues(a: &Matrix4<f64>) -> Vec<Complex<f64>> {
    let mut all: Vec<Complex<f64>> = a.complex_eigenvalues().iter().copied().collect();
    // rounding may leave a small imaginary part in a real eigenvalue
    for x in &mut all {
        if x.im.abs() < 1e-9 * x.norm() {
            x.im = 0.0;
        }
    }
    all.retain(|x| x.im >= 0.0);
    all.sort_by(|x, y| y.norm().total_cmp(&x.norm()));
    all
}

fn longitudinal(all: &[Complex<f64>]) -> Vec<Mode> {
    let names: &[&'static str] = match all.len() {
        2 => &["short period", "phugoid"],
        3 if all[2].im > 0.0 => &["fast pitch", "slow pitch", "phugoid"],
        // with the centre of gravity aft of the neutral point, a pitch mode and the phugoid may merge into one oscillation
        3 if all[1].im > 0.0 => &["fast pitch", "third oscillation", "slow pitch"],
        3 => &["short period", "airspeed", "slow airspeed"],
        _ => &["fast pitch", "slow pitch", "airspeed", "slow airspeed"],
    };
    named(all, names)
}

fn lateral(all: &[Complex<f64>]) -> Vec<Mode> {
    let pairs = all.iter().filter(|x| x.im > 0.0).count();
    let real = |k: usize| all.iter().filter(|x| x.im == 0.0).nth(k).copied();
    match (pairs, real(0), real(1)) {
        (1, Some(fast), Some(slow)) => {
            let dutch = all.iter().find(|x| x.im > 0.0).copied().unwrap_or(fast);
            named(&[fast, dutch, slow], &["roll", "Dutch roll", "spiral"])
        }
        (2, ..) => named(all, &["Dutch roll", "roll and spiral together"]),
        _ => named(all, &["roll", "yaw", "sideslip", "spiral"]),
    }
}

fn named(all: &[Complex<f64>], names: &[&'static str]) -> Vec<Mode> {
    all.iter().zip(names).map(|(x, name)| Mode { name, eigenvalue: *x }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn an_oscillation_between_two_aperiodic_modes_is_neither_short_period_nor_airspeed() {
        let [fast, pair, slow] =
            [(-8.0, 0.0), (-0.1, 0.5), (0.2, 0.0)].map(|(re, im)| Complex::new(re, im));
        let modes = longitudinal(&[fast, pair, slow]);
        let names: Vec<_> = modes.iter().map(|m| (m.name, m.oscillates())).collect();
        let expected = [("fast pitch", false), ("third oscillation", true), ("slow pitch", false)];
        assert_eq!(names, expected);
    }

    #[test]
    fn an_aerosonde_has_the_modes_of_a_conventional_aircraft() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/aerosonde/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let modes = modes(&model, 25.0, 100.0).unwrap();
        let names: Vec<_> = modes.iter().map(|m| m.name).collect();
        assert_eq!(names, ["short period", "phugoid", "roll", "Dutch roll", "spiral"]);
        // Lanchester's approximation of the phugoid's frequency is sqrt(2) g / V. The roll time constant is
        // 4 Jx / (rho V S b^2 |Clp|), about 0.05 s, with the figures of Beard and McLain's textbook.
        let (phugoid, roll) = (&modes[1], &modes[2]);
        assert!((phugoid.frequency() / (2.0_f64.sqrt() * 9.806 / 25.0) - 1.0).abs() < 0.25);
        let lanchester = 4.0 * 0.8244 / (1.213 * 25.0 * 0.55 * 2.8956 * 2.8956 * 0.51);
        assert!((roll.time_constant() / lanchester - 1.0).abs() < 0.1, "{roll:?}");
        assert!(modes[0].oscillates() && modes[0].damping() > 0.3 && modes[3].oscillates());
    }
}

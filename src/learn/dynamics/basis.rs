//! Coordinates in which the coefficients of the prior are trained. The prior is the physical model before learning. Unit steps
//! of all coordinates change the prior's state rates by the same mean square.

use nalgebra::{DMatrix, DVector};

use crate::dynamics::windows::Track;
use greylag_model::GreyBox;
use greylag_num::{Dual, Real};
use greylag_physics::effects::Kind;
use greylag_physics::formula::Variable;
use greylag_physics::point::AirData;
use greylag_physics::rigid_body::{self, RigidBody};
use greylag_physics::{Channel, State, Wrench};

/// Name of the trainable product of inertia Jxz.
///
/// Mass and the other inertias are not trainable. Scaling moments and inertias together, or forces and mass together, does not
/// change the motion. Therefore no data can separate mass and inertias from the coefficients of forces and moments.
pub const JXZ: &str = "rigid_body.jxz_kgm2";

/// Approximate number of samples from which the coordinates are computed.
const SAMPLES: usize = 4096;

/// Largest eigenvalue of an unidentifiable direction, relative to the largest eigenvalue of all.
const UNSEEN: f64 = 1e-9;

/// Transformation θ_p = θ_p0 + T η of the coordinates η to the coefficients θ_p of the prior. η has one entry for
/// each identifiable direction.
///
/// Adam scales every parameter separately, along the given axes. But coefficients differ a thousandfold in size and
/// are correlated (for example aileron power with roll damping). Therefore the axes are chosen by their effect on the
/// prior's state rates F_p over the flights: ∂(F_p/x_c)/∂η has unit covariance, where x_c is the reference scale of
/// the state.
#[derive(Clone, Debug)]
pub struct Basis {
    /// Indices of the coefficients in the model's list of coefficients. An index equal to the length of the list stands for Jxz.
    pub places: Vec<usize>,
    /// The coefficients θ_p0 before training.
    start: DVector<f64>,
    /// Bounds that the model states, or else the physical bounds; `None` for Jxz.
    bounds: Vec<Option<(f64, f64)>>,
    /// Prior information 1/σ² on θ_p0. It is zero for a coefficient for which the model file states no σ.
    information: DVector<f64>,
    /// The transformation matrix T.
    turn: DMatrix<f64>,
    /// Names of the coefficients that the data does not identify, or does not separate from other coefficients.
    pub unseen: Vec<String>,
}

/// Reason why the coefficients cannot be trained.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrainableError {
    /// The model has no such coefficient.
    #[error("model {model} has no coefficient {name:?} that can be trained; it has {known}")]
    Unknown {
        /// Name of the model.
        model: String,
        /// Name that was requested.
        name: String,
        /// Names that the model has.
        known: String,
    },
    /// An effect depends on the altitude.
    #[error(
        "model {model} has the effect {effect}, which depends on the altitude; the rollouts for training do not include the altitude: leave the effect out of the prior"
    )]
    Effect {
        /// Name of the model.
        model: String,
        /// Name of the effect.
        effect: &'static str,
    },
}

/// Checks that the training can compute the derivatives of `model`.
///
/// # Errors
///
/// If one of its effects depends on the altitude.
pub fn check(model: &GreyBox) -> Result<(), TrainableError> {
    let written = |id: &str| {
        let effect = Kind::from_id(id).and_then(Kind::written);
        effect.is_some_and(|effect| effect.variables().contains(&Variable::Altitude))
    };
    let bars = |id: &str| id == "ground_effect" || written(id);
    match model.effects().find(|e| bars(e.id)) {
        None => Ok(()),
        Some(e) => Err(TrainableError::Effect { model: model.name.clone(), effect: e.id }),
    }
}

/// Names of all trainable coefficients of `model`: Jxz, and the coefficients in which forces and moments are linear.
pub fn trainable(model: &GreyBox) -> Vec<String> {
    let mut names = vec![JXZ.to_owned()];
    for about in model.effects() {
        let Some(kind) = Kind::from_id(about.id) else { continue };
        let count = about.coefficients.len();
        for (k, c) in about.coefficients[..count - about.shape].iter().enumerate() {
            // coefficients that change mass or inertia are excluded
            let one: Vec<f64> = (0..count).map(|i| if i == k { 0.1 } else { 0.0 }).collect();
            let (mut body, mut still) = (*model.bare_body(), *model.bare_body());
            kind.change(&one, &mut body);
            kind.change(&vec![0.0; count], &mut still);
            if body == still {
                names.push(format!("{}.{}", about.id, c.name));
            }
        }
    }
    names
}

/// Present values of all coefficients of `model`, followed by Jxz (kg m²).
pub fn values(model: &GreyBox) -> Vec<f64> {
    let coefficients = model.coefficients().iter().map(|c| c.value);
    coefficients.chain([model.bare_body().jxz]).collect()
}

/// The present value of the coefficient `name` (`effect.coefficient`) or of Jxz ([`JXZ`]). `None` if there is no such
/// coefficient.
pub fn value(model: &GreyBox, name: &str) -> Option<f64> {
    match name {
        JXZ => Some(model.bare_body().jxz),
        _ => model.coefficients().iter().find(|c| c.name == name).map(|c| c.value),
    }
}

impl Basis {
    /// Computes coordinates for the coefficients `names` of `model` from their effect on the state rates over `tracks`.
    ///
    /// # Errors
    /// If the model lacks one of the coefficients, or if one of them cannot be trained.
    pub fn new(
        model: &GreyBox,
        names: &[String],
        tracks: &[Track],
    ) -> Result<Basis, TrainableError> {
        let known = trainable(model);
        let count = model.coefficients().len();
        let mut places = Vec::new();
        for name in names {
            if !known.contains(name) {
                return Err(TrainableError::Unknown {
                    model: model.name.clone(),
                    name: name.clone(),
                    known: known.join(", "),
                });
            }
            let place = model.coefficients().iter().position(|c| c.name == *name).unwrap_or(count);
            places.push(place);
        }
        places.sort_unstable();
        places.dedup();
        let all = values(model);
        let start = DVector::from_iterator(places.len(), places.iter().map(|p| all[*p]));
        let gram = gram(model, &places, tracks);
        let (turn, unseen) = whiten(&gram);
        let name = |k: usize| {
            model.coefficients().get(places[k]).map_or(JXZ.to_owned(), |c| c.name.clone())
        };
        let bounds = (0..places.len()).map(|k| model.bounds_of(&name(k))).collect();
        let stated = |p: &usize| model.coefficients().get(*p).and_then(|c| c.sd);
        let inverse = |sd: f64| if sd > 0.0 { 1.0 / (sd * sd) } else { 0.0 };
        let information = places.iter().map(|p| stated(p).map_or(0.0, inverse));
        let information = DVector::from_iterator(places.len(), information);
        let unseen = unseen.into_iter().map(name).collect();
        Ok(Basis { start, bounds, information, turn, unseen, places })
    }

    /// Number of coordinates of the training.
    pub fn len(&self) -> usize {
        self.turn.ncols()
    }

    /// Whether there are no coordinates.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Derivatives of the coefficients with respect to coordinate `k`, in the order of `places`.
    pub fn column(&self, k: usize) -> impl Iterator<Item = f64> + '_ {
        (0..self.turn.nrows()).map(move |i| self.turn[(i, k)])
    }

    /// Converts a gradient to coordinates. `all` is the gradient with respect to all coefficients of the model and Jxz.
    pub fn slopes(&self, all: &[f64]) -> Vec<f64> {
        let of = |k: usize| {
            self.places.iter().enumerate().map(move |(i, p)| self.turn[(i, k)] * all[*p])
        };
        (0..self.len()).map(|k| of(k).sum()).collect()
    }

    /// Prior information on the coordinates: Tᵀ Σ⁻¹ T, with the stated standard deviations of the coefficients in Σ. A
    /// coefficient without a stated standard deviation contributes zero.
    pub fn prior_information(&self) -> DMatrix<f64> {
        let weighed = DMatrix::from_diagonal(&self.information) * &self.turn;
        self.turn.transpose() * weighed
    }

    /// Sets the coefficients of `model` to the values at `coordinates`, clamped to their bounds.
    pub fn apply(&self, model: &mut GreyBox, coordinates: &[f64]) {
        let theta = &self.start + &self.turn * DVector::from_column_slice(coordinates);
        let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
        let mut body = *model.bare_body();
        for ((place, theta), bounds) in self.places.iter().zip(theta.iter()).zip(&self.bounds) {
            match values.get_mut(*place) {
                Some(value) => *value = bounds.map_or(*theta, |(low, high)| theta.clamp(low, high)),
                None => {
                    // the inertia matrix is positive definite only if jx jz exceeds jxz²
                    let most = 0.99 * (body.jx * body.jz).sqrt();
                    body.jxz = theta.clamp(-most, most);
                }
            }
        }
        model.set_coefficients(&values);
        if body != *model.bare_body() {
            model.set_body(body);
        }
    }
}

/// Mean of JᵀJ over samples of the tracks, with the Jacobian J = ∂(F_p/x_c)/∂θ. Samples with a J that is not finite
/// are omitted, because the eigenvalue iteration would not end on a NaN.
fn gram(model: &GreyBox, places: &[usize], tracks: &[Track]) -> DMatrix<f64> {
    let total: usize = tracks.iter().map(|t| t.states.len()).sum();
    let every = (total / SAMPLES).max(1);
    let scale = model.scale();
    let mut gram = DMatrix::zeros(places.len(), places.len());
    let mut count = 0.0_f64;
    for track in tracks {
        for k in (0..track.states.len()).step_by(every) {
            let columns = columns(model, track, k);
            let jacobian =
                DMatrix::from_fn(8, places.len(), |i, j| columns[places[j]][i] / scale[i]);
            if !jacobian.iter().all(|x| x.is_finite()) {
                continue;
            }
            gram += jacobian.transpose() * jacobian;
            count += 1.0;
        }
    }
    gram / count.max(1.0)
}

/// Derivatives ∂F_p/∂θ of the prior's state rates at sample `k`: one entry for each coefficient of the model, then one for Jxz.
pub(crate) fn columns(model: &GreyBox, track: &Track, k: usize) -> Vec<[f64; 8]> {
    let (state, controls) = (&track.states[k], &track.controls[k]);
    let air = model.air(state, track.altitude[k]);
    let mut wrenches = vec![Wrench::zero(); model.coefficients().len()];
    model.contributions(state, controls, &air, |i, channel, x| wrenches[i].add(channel, x));
    let mut columns: Vec<[f64; 8]> =
        wrenches.iter().map(|wrench| rate_of(model, state, &air, wrench)).collect();
    let wrench = model.wrench(state, controls, &air);
    let moment = [4, 5, 6].map(|c| Dual::<1>::from_f64(wrench.get(Channel::ALL[c])));
    let body: RigidBody<Dual<1>> = model.body.map(Dual::from_f64);
    let body = RigidBody { jxz: Dual::variable(model.body.jxz, 0), ..body };
    let spin = rigid_body::angular_acceleration(&body, &state.map(Dual::from_f64), moment);
    let [p, q, r] = spin.map(|s| s.gradient[0]);
    columns.push([0.0, 0.0, 0.0, p, q, r, 0.0, 0.0]);
    columns
}

/// The part of the state rates that is due to the aerodynamic and propulsive forces and moments `wrench`.
pub(crate) fn rate_of(model: &GreyBox, state: &State, air: &AirData, wrench: &Wrench) -> [f64; 8] {
    let still = rigid_body::state_rate(state, air, [0.0; 3], [0.0; 3]).to_array();
    let none = State { p: 0.0, q: 0.0, r: 0.0, ..*state };
    let force = rigid_body::body_force(wrench, air, model.axes);
    let moment = [4, 5, 6].map(|c| wrench.get(Channel::ALL[c]));
    // without rotation there are no gyroscopic terms, and the angular acceleration is linear in the moment
    let spin = rigid_body::angular_acceleration(&model.body, &none, moment);
    let push = force.map(|f| f / model.body.mass);
    let rate = rigid_body::state_rate(state, air, push, spin).to_array();
    std::array::from_fn(|i| rate[i] - still[i])
}

/// Returns a matrix T with Tᵀ G T = 1, where G is `gram`. Its columns span the identifiable directions. Also returns the indices
/// of the coefficients that are mostly outside these directions.
fn whiten(gram: &DMatrix<f64>) -> (DMatrix<f64>, Vec<usize>) {
    let n = gram.nrows();
    if n == 0 {
        return (gram.clone(), Vec::new());
    }
    let size: Vec<f64> = (0..n).map(|i| gram[(i, i)].sqrt()).collect();
    let unit = |i: usize| if size[i] > 0.0 { 1.0 / size[i] } else { 0.0 };
    let correlation = DMatrix::from_fn(n, n, |i, j| gram[(i, j)] * unit(i) * unit(j));
    let eigen = correlation.symmetric_eigen();
    let most = eigen.eigenvalues.iter().copied().fold(0.0, f64::max);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let seen: Vec<usize> =
        order.iter().copied().filter(|k| eigen.eigenvalues[*k] > UNSEEN * most).collect();
    let turn = DMatrix::from_fn(n, seen.len(), |i, k| {
        unit(i) * eigen.eigenvectors[(i, seen[k])] / eigen.eigenvalues[seen[k]].sqrt()
    });
    // a coefficient counts as unidentifiable if more than half of its unit vector's squared length is outside the identifiable
    // directions
    let lost = |i: &usize| {
        let kept: f64 = seen.iter().map(|k| eigen.eigenvectors[(*i, *k)].powi(2)).sum();
        kept < 0.5
    };
    (turn, (0..n).filter(lost).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::Controls;
    use std::path::Path;

    #[test]
    fn a_sample_on_the_ground_or_without_a_state_does_not_count() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let model = GreyBox::load(&path).unwrap();
        let controls = Controls { aileron: 0.1, elevator: -0.05, ..Controls::default() };
        let flown = State { airspeed: 18.0, alpha: 0.05, p: 0.2, ..State::NEUTRAL };
        let track = |states: &[State]| {
            [Track::new(&model, states.iter().map(|state| (*state, controls, 100.0)))]
        };
        let lost = State { q: f64::NAN, ..flown };
        let still = State { airspeed: 0.0, ..flown };
        let places: Vec<usize> = (0..model.coefficients().len()).collect();
        let whole = gram(&model, &places, &track(&[flown]));
        assert!(whole.iter().all(|x| x.is_finite()) && whole.amax() > 0.0);
        assert_eq!(gram(&model, &places, &track(&[flown, lost, still])), whole);
    }
}

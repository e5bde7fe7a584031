//! Lack-of-fit test of an added effect (a physical contribution to forces and moments). It is a regression of the residual on
//! products of states and deflections (the terms). If the terms still explain part of the residual, the formula of the effect
//! differs from the true one.
//!
//! The flexible model of [`remainder`](super::remainder) must generalise to other flights and detects only large errors. This
//! test fits a few terms, similar to those of aerodynamic tables, to the same flights. It compares their reduction of the
//! residual sum of squares with their reduction of pure noise. The residual is whitened: noise has a mean square of 1 per row
//! of the regression.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::columns::{Ready, bends};
use crate::diagnose::regression::features::{spread, standard};
use crate::diagnose::regression::gather::{Column, gather};
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::regression::projected::{Projected, scaled_inverse};
use crate::diagnose::search::nulls;
use crate::diagnose::search::round::Round;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, Integrator};
use greylag_num::statistics::mean;

/// States and deflections whose products are the terms.
const NAMES: [&str; 9] = ["α", "β", "V", "p", "q", "r", "δa", "δe", "throttle"];
/// Number of squares and pairwise products.
const PRODUCTS: usize = NAMES.len() * (NAMES.len() + 1) / 2;
/// Names of the second derivatives of the deflections. A first-order lag and a pure delay have the same first-order
/// effect and differ in these derivatives.
const BENT: [&str; 2] = ["δa″", "δe″"];
/// Number of terms per channel.
const TERMS: usize = PRODUCTS + BENT.len();
/// Ridge parameter for nearly collinear terms, relative to a term's squared norm.
const RIDGE: f64 = 1e-4;
/// The reduction by the terms is significant if it exceeds their mean reduction of noise by this number of standard deviations.
const DOUBT: f64 = 4.0;
/// Reduction of the residual sum of squares per row that remaining errors of sensors and path may cause.
const UNSURE: f64 = 0.1;
/// Reduction of the residual sum of squares per row above which the terms alone indicate a missing effect. Without a
/// missing effect, it was at most 0.13.
const ALARM: f64 = 0.15;
/// Reduction of the residual sum of squares in a channel above which second derivatives count. With correct models,
/// they reached at most 25.
const BENDING: f64 = 30.0;

/// Reduction of the residual sum of squares by the terms, for each channel.
#[derive(Clone, Debug)]
pub struct Shape {
    channels: Vec<Taken>,
}

/// Reduction of the residual sum of squares in one channel.
#[derive(Clone, Debug)]
struct Taken {
    /// Reduction by all terms minus the mean reduction for pure noise.
    left: f64,
    /// Standard deviation of the reduction for pure noise.
    doubt: f64,
    rows: f64,
    /// Index of the single term that reduces the residual sum of squares most.
    most: usize,
    /// Reduction by the second derivatives of the deflections alone.
    bent: f64,
}

impl Shape {
    /// Name of the term that alone explains most of the residual of `channel`. `None` unless the terms' reduction indicates a
    /// missing effect.
    pub fn term(&self, channel: usize) -> Option<String> {
        self.left_in(&[channel], ALARM).map(|_| name(self.channels[channel].most))
    }

    /// Compares the terms with effects that reduce the residual sum of squares in `channels` by `fall`. Returns the terms'
    /// reduction as a fraction of the sum of both reductions, and the name of the strongest term. `None` if the terms'
    /// reduction is not significant.
    pub fn beside(&self, channels: &[usize], fall: f64) -> Option<(f64, String)> {
        let left = self.left_in(channels, UNSURE)?;
        let own = channels.iter().map(|c| &self.channels[*c]);
        let most = own.max_by(|a, b| a.left.total_cmp(&b.left))?.most;
        Some((left / (left + fall), name(most)))
    }

    /// Compares the second derivatives of the deflections with an effect that reduces the residual sum of squares by `fall`.
    /// Returns the derivatives' reduction over all channels as a fraction of the sum of both reductions. A channel counts only
    /// if its reduction exceeds that of correct models.
    pub fn bends_beside(&self, fall: f64) -> f64 {
        let bent = self.channels.iter().map(|c| c.bent).filter(|bent| *bent > BENDING).sum::<f64>();
        bent / (bent + fall).max(f64::MIN_POSITIVE)
    }

    fn left_in(&self, channels: &[usize], unsure: f64) -> Option<f64> {
        let sum = |of: &dyn Fn(&Taken) -> f64| -> f64 {
            channels.iter().map(|c| of(&self.channels[*c])).sum()
        };
        let left = sum(&|c| c.left);
        let rows = sum(&|c| c.rows);
        let chance = DOUBT * sum(&|c| c.doubt.powi(2)).sqrt();
        (rows > 0.0 && left > chance.max(unsure * rows)).then_some(left)
    }
}

/// Computes the reduction of the residual of `round` by the terms and compares it with that of `count` draws of noise. A round
/// is a linearisation of the model over the flights. It must have no candidates here. `None` if the terms cannot be fitted.
pub fn shape(round: &Round, count: usize) -> Option<Shape> {
    let na = round.known.len();
    let last = na + CHANNELS * TERMS;
    let spread = spread(&round.flights, variables);
    let place = |(known, flight): (&Placed, &Ready)| {
        let mut list: Placed = known.iter().take_while(|(p, _)| *p < na).cloned().collect();
        let own = terms(&round.model, flight, &spread).into_iter().enumerate();
        list.extend(own.map(|(k, column)| (na + k, column)));
        list.push((last, flight.residual.clone()));
        list
    };
    let placed: Vec<Placed> = round.placed.iter().zip(&round.flights).map(place).collect();
    // ordinary least squares: with the errors-in-variables correction, the products would not be those of any residual
    let p = Projected::new(&round.cells, &placed, last, &round.known, &round.noise, &[])?;
    let measured = p.total.column(p.width()).into_owned();
    let draws: Vec<DVector<f64>> =
        (0..count).map(|k| nulls::draw(&p, round.seed, k).total).collect();
    let rows = p.rows_by_channel();
    let of = |c: usize| {
        let first = c * TERMS;
        let own = |v: &DVector<f64>| v.rows(first, TERMS).into_owned();
        let gram = p.total.view((first, first), (TERMS, TERMS)).into_owned();
        taken(&gram, &own(&measured), &draws.iter().map(own).collect::<Vec<_>>(), rows[c])
    };
    Some(Shape { channels: (0..CHANNELS).map(of).collect::<Option<_>>()? })
}

/// Reduction by the terms of one channel. `gram` is their Gram matrix, `measured` are their products with the residual, `draws`
/// their products with draws of noise. `None` if the Gram matrix is singular.
fn taken(
    gram: &DMatrix<f64>,
    measured: &DVector<f64>,
    draws: &[DVector<f64>],
    rows: f64,
) -> Option<Taken> {
    let mut ridged = gram.clone();
    (0..TERMS).for_each(|k| ridged[(k, k)] *= 1.0 + RIDGE);
    let inverse = scaled_inverse(&ridged)?;
    let fall = |v: &DVector<f64>| v.dot(&(&inverse * v));
    let noise: Vec<f64> = draws.iter().map(fall).collect();
    let by_chance = mean(&noise);
    let variance = mean(&noise.iter().map(|x| (x - by_chance).powi(2)).collect::<Vec<_>>());
    let alone = |k: &usize| measured[*k].powi(2) / gram[(*k, *k)].max(f64::MIN_POSITIVE);
    let count = BENT.len();
    let bent = measured.rows(PRODUCTS, count);
    let own = gram.view((PRODUCTS, PRODUCTS), (count, count)).into_owned();
    Some(Taken {
        left: fall(measured) - by_chance,
        doubt: variance.sqrt(),
        rows,
        most: (0..TERMS).max_by(|a, b| alone(a).total_cmp(&alone(b)))?,
        bent: bent.dot(&(scaled_inverse(&own)? * bent)),
    })
}

/// Regressors of the terms for `flight`, channel after channel. Each term is multiplied by dynamic pressure times wing area, N.
fn terms(model: &GreyBox, flight: &Ready, spread: &[[f64; 2]; NAMES.len()]) -> Vec<Column> {
    let sides = gather(&flight.acting, Integrator::Jsbsim, TERMS, |place, add| {
        let z = standard(variables(&flight.acting, place.segment, place.index), spread);
        let pressure = model.air(&place.at.state, place.at.altitude).q_s;
        let bends = bends(&flight.acting, place.segment, place.index);
        // forces are averaged over samples, moments over steps: all forces share one column, all moments another
        for side in [0, CHANNELS / 2] {
            for (k, (i, j)) in pairs().enumerate() {
                add(k, side, pressure * z[i] * z[j]);
            }
            for (k, bend) in bends.iter().take(BENT.len()).enumerate() {
                add(PRODUCTS + k, side, pressure * bend);
            }
        }
    });
    let of = |channel: usize| {
        let side = if channel < CHANNELS / 2 { 0 } else { CHANNELS / 2 };
        sides.iter().map(move |term| {
            let mut column = Column::default();
            column[channel] = term[side].clone();
            column
        })
    };
    (0..CHANNELS).flat_map(of).collect()
}

/// Pairs of indices in `NAMES`, one for each product.
fn pairs() -> impl Iterator<Item = (usize, usize)> {
    (0..NAMES.len()).flat_map(|i| (i..NAMES.len()).map(move |j| (i, j)))
}

fn name(term: usize) -> String {
    match pairs().nth(term) {
        Some((i, j)) if i == j => format!("{}²", NAMES[i]),
        Some((i, j)) => format!("{}·{}", NAMES[i], NAMES[j]),
        None => BENT[term - PRODUCTS].into(),
    }
}

fn variables(flight: &Prepared, segment: usize, index: usize) -> [f64; NAMES.len()] {
    let at = &flight.segments[segment][index];
    let (s, z) = (&at.state, &at.controls);
    [s.alpha, s.beta, s.airspeed, s.p, s.q, s.r, z.aileron, z.elevator, z.throttle]
}

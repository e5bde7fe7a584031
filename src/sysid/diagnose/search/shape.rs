//! Residual shape: products of states and deflections that explain part of the residual. If they explain the residual after
//! an effect was added, the formula of the effect differs from the true one.
//!
//! The flexible model of [`remainder`](super::remainder) must generalise to other flights and detects only large errors.
//! Here, a few terms like those of aerodynamic tables are fitted to the same flights. Their reduction of the error is
//! compared with their reduction of noise.

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
/// Second derivatives of the deflections. A first-order lag and a pure delay agree to first order and differ in these.
const BENT: [&str; 2] = ["δa″", "δe″"];
/// Number of terms of a channel.
const TERMS: usize = PRODUCTS + BENT.len();
/// Ridge parameter for nearly collinear terms, relative to a term's squared norm.
const RIDGE: f64 = 1e-4;
/// Number of standard deviations beyond which the terms' reduction is significant.
const DOUBT: f64 = 4.0;
/// Squared whitened error per row that the terms may remove because of remaining errors of sensors and path.
const UNSURE: f64 = 0.1;
/// Squared whitened error per row above which the terms alone indicate a missing effect. Without a missing effect, they
/// remove at most 0.13.
const ALARM: f64 = 0.15;
/// Squared whitened error that second derivatives may remove. With correct models, they remove up to 25.
const BENDING: f64 = 30.0;

/// Reduction of the squared whitened error by the terms, by channel.
#[derive(Clone, Debug)]
pub struct Shape {
    channels: Vec<Taken>,
}

/// Reduction in one channel.
#[derive(Clone, Debug)]
struct Taken {
    /// Reduction of the residual's squared error less the mean reduction of noise.
    left: f64,
    /// Standard deviation of the terms' reduction of noise.
    doubt: f64,
    rows: f64,
    /// Index of the term that alone reduces the error most.
    most: usize,
    /// Reduction by the second derivatives alone.
    bent: f64,
}

impl Shape {
    /// The term that correlates most with the residual of `channel`, if the residual indicates a missing effect.
    pub fn term(&self, channel: usize) -> Option<String> {
        self.left_in(&[channel], ALARM).map(|_| name(self.channels[channel].most))
    }

    /// Share of the terms in the reduction by terms and effects in `channels`, and the name of the term that removes most. `fall`
    /// is the reduction by effects. `None` if the terms' reduction is not significant.
    pub fn beside(&self, channels: &[usize], fall: f64) -> Option<(f64, String)> {
        let left = self.left_in(channels, UNSURE)?;
        let own = channels.iter().map(|c| &self.channels[*c]);
        let most = own.max_by(|a, b| a.left.total_cmp(&b.left))?.most;
        Some((left / (left + fall), name(most)))
    }

    /// Share of the second derivatives of the deflections in the reduction by these and by an effect, over all channels. `fall`
    /// is the reduction by the effect. Zero if the derivatives do not remove more than with correct models.
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

/// Reduction of the residual of `round` by the terms, compared with `count` draws of noise. The round must have no
/// candidates. `None` if the terms cannot be fitted.
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
    // ordinary least squares: a residual corrected for shared noise is not in the span of the columns
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

/// Reduction by terms with the Gram matrix `gram` and the products `measured` with the residual, compared with their products
/// `draws` with noise.
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

/// Columns of the terms of `flight`, by channel, multiplied by dynamic pressure times wing area.
fn terms(model: &GreyBox, flight: &Ready, spread: &[[f64; 2]; NAMES.len()]) -> Vec<Column> {
    let sides = gather(&flight.acting, Integrator::Jsbsim, TERMS, |place, add| {
        let z = standard(variables(&flight.acting, place.segment, place.index), spread);
        let pressure = model.air(&place.at.state, place.at.altitude).q_s;
        let bends = bends(&flight.acting, place.segment, place.index);
        // forces are averaged over samples, moments over steps: one column for forces, one for moments
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

/// Index pairs of the products.
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

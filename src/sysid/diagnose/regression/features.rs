//! Regressors of a flexible model without physics: random Fourier features of state, deflections and earlier deflections. A
//! diagnosis uses the model to estimate how much of the residual any function of these variables could remove.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::diagnose::regression::columns::Ready;
use crate::diagnose::regression::gather::{Column, gather};
use crate::diagnose::regression::local::CHANNELS;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, Integrator};
use greylag_num::stream::{Stream, stream};

/// Number of the random stream for the features.
const FEATURES: u64 = 81;
/// Number of cosines among the features.
const COSINES: usize = 40;
/// Number of variables: α, β, V, p, q, r; present aileron, elevator and throttle; earlier minus present aileron and
/// elevator; rate of α.
const VARIABLES: usize = 12;
/// Number of features: the variables themselves and the cosines.
pub const COUNT: usize = VARIABLES + COSINES;
/// Standard deviation of the cosines' frequencies, rad per standard deviation of a variable. Over the range of the flights,
/// a cosine then varies by about half a period.
const BEND: f64 = 0.5;
/// Time span of the difference quotient for the rate of α, s. A shorter span would amplify noise.
const SPAN_S: f64 = 0.06;
/// Delay of the earlier deflections, s.
const AGO_S: f64 = 0.08;

/// Frequency of a cosine along each variable (rad per standard deviation of the variable), and its phase (rad).
struct Cosine {
    frequency: [f64; VARIABLES],
    phase: f64,
}

/// Regressor columns for every flight: the features multiplied by dynamic pressure times wing area (N). The three forces have
/// the same columns, and so have the three moments.
pub fn features(model: &GreyBox, flights: &[Ready], seed: u64) -> Vec<Vec<Column>> {
    let spread = spread(flights, variables);
    let mut random = stream(seed, &[FEATURES]);
    let cosines: Vec<Cosine> = (0..COSINES).map(|_| cosine(&mut random)).collect();
    let of = |flight: &Ready| {
        let one = gather(&flight.acting, Integrator::Jsbsim, COUNT, |place, add| {
            let z = standard(variables(&flight.acting, place.segment, place.index), &spread);
            let pressure = model.air(&place.at.state, place.at.altitude).q_s;
            // forces are averaged over samples and moments over steps, so channels 0 (force) and 3 (moment) are computed
            for channel in [0, 3] {
                for (k, z) in z.iter().enumerate() {
                    add(k, channel, pressure * z);
                }
                for (k, c) in cosines.iter().enumerate() {
                    let turn: f64 = c.frequency.iter().zip(&z).map(|(f, z)| f * z).sum();
                    add(VARIABLES + k, channel, pressure * (turn + c.phase).cos());
                }
            }
        });
        one.into_iter().map(everywhere).collect()
    };
    flights.iter().map(of).collect()
}

fn everywhere(column: Column) -> Column {
    std::array::from_fn(|c| column[if c < CHANNELS / 2 { 0 } else { CHANNELS / 2 }].clone())
}

fn cosine(random: &mut Stream) -> Cosine {
    let mut unit = || -> f64 { StandardNormal.sample(random) };
    let frequency = std::array::from_fn(|_| BEND * unit());
    Cosine { frequency, phase: TAU * random.random::<f64>() }
}

fn variables(flight: &Prepared, segment: usize, index: usize) -> [f64; VARIABLES] {
    let instants = &flight.segments[segment];
    let i = &instants[index];
    let ago = &instants[index.saturating_sub((AGO_S / flight.dt).round() as usize)].controls;
    let half = (0.5 * SPAN_S / flight.dt).round().max(1.0) as usize;
    let (a, b) = (index.saturating_sub(half), (index + half).min(instants.len() - 1));
    let rise = instants[b].state.alpha - instants[a].state.alpha;
    let (s, z) = (&i.state, &i.controls);
    [
        s.alpha,
        s.beta,
        s.airspeed,
        s.p,
        s.q,
        s.r,
        z.aileron,
        z.elevator,
        z.throttle,
        ago.aileron - z.aileron,
        ago.elevator - z.elevator,
        rise / (flight.dt * (b - a).max(1) as f64),
    ]
}

/// Mean and standard deviation of each variable over all flights. `of` returns the variables of a flight for the index of a
/// segment and the index of a sample in it.
pub fn spread<const N: usize>(
    flights: &[Ready],
    of: impl Fn(&Prepared, usize, usize) -> [f64; N],
) -> [[f64; 2]; N] {
    let (mut sum, mut square, mut count) = ([0.0; N], [0.0; N], 0.0);
    for flight in flights {
        for (segment, instants) in flight.acting.segments.iter().enumerate() {
            for index in 0..instants.len() {
                let x = of(&flight.acting, segment, index);
                for k in 0..N {
                    sum[k] += x[k];
                    square[k] += x[k] * x[k];
                }
                count += 1.0;
            }
        }
    }
    std::array::from_fn(|k| {
        let mean = sum[k] / count;
        [mean, (square[k] / count - mean * mean).max(0.0).sqrt().max(1e-6)]
    })
}

/// Standardised variables: `raw` minus the means, in standard deviations. `spread` holds means and standard deviations.
pub fn standard<const N: usize>(raw: [f64; N], spread: &[[f64; 2]; N]) -> [f64; N] {
    std::array::from_fn(|k| (raw[k] - spread[k][0]) / spread[k][1])
}

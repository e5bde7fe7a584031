//! Averages forces and moments over the windows of a flight. A window is a short interval of samples, weighted by a smooth
//! function (kernel). Windows overlap, and each sample in an overlap is evaluated once for all of them.

use rayon::prelude::*;

use crate::diagnose::regression::local::CHANNELS;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;
use greylag_logs::Sampling;
use greylag_model::Integrator;
use greylag_physics::Controls;

/// Values for each window in each of the channels D, L, Y, l, m, n; an empty list means zeros.
pub type Column = [Vec<f64>; CHANNELS];

/// Number of adjacent windows that one task processes.
const GROUP: usize = 16;
/// Largest number of windows to which one sample contributes.
const OVERLAP: usize = 4;

/// A sample at which forces and moments are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Place<'a> {
    /// Index of the sample's segment.
    pub segment: usize,
    /// Index of the sample in its segment.
    pub index: usize,
    /// The sample whose state is used.
    pub at: &'a Instant,
    /// Controls that are used in the evaluation.
    pub controls: &'a Controls,
}

/// Averages `columns` sets of forces and moments over each window. For each sample, `evaluate` reports the contributions to
/// the sets with `add(column, channel, amount)`.
///
/// Forces are averaged over the samples. Moments are averaged over integration steps, or over the samples if these are
/// values at instants.
pub fn gather(
    flight: &Prepared,
    integrator: Integrator,
    columns: usize,
    evaluate: impl Fn(&Place, &mut dyn FnMut(usize, usize, f64)) + Sync,
) -> Vec<Column> {
    let windows = flight.windows.len();
    let groups: Vec<(usize, usize)> = groups(flight);
    let parts: Vec<Vec<f64>> = groups
        .par_iter()
        .map(|&(first, last)| group(flight, integrator, columns, first, last, &evaluate))
        .collect();
    let mut out: Vec<Column> = vec![Column::default(); columns];
    for (column, place) in out.iter_mut().enumerate() {
        for (channel, list) in place.iter_mut().enumerate() {
            let part = |(&(first, last), part): (&(usize, usize), &Vec<f64>)| {
                let width = last - first;
                let start = (column * CHANNELS + channel) * width;
                part[start..start + width].to_vec()
            };
            let values: Vec<f64> = groups.iter().zip(&parts).flat_map(part).collect();
            if values.iter().any(|x| *x != 0.0) {
                debug_assert_eq!(values.len(), windows);
                *list = values;
            }
        }
    }
    out
}

/// Groups of at most [`GROUP`] successive windows of one segment, as ranges: first window, last window + 1.
fn groups(flight: &Prepared) -> Vec<(usize, usize)> {
    let mut groups: Vec<(usize, usize)> = Vec::new();
    for (w, window) in flight.windows.iter().enumerate() {
        match groups.last_mut() {
            Some((first, last))
                if flight.windows[*first].segment == window.segment && *last - *first < GROUP =>
            {
                *last = w + 1;
            }
            _ => groups.push((w, w + 1)),
        }
    }
    groups
}

fn group(
    flight: &Prepared,
    integrator: Integrator,
    columns: usize,
    first: usize,
    last: usize,
    evaluate: &(impl Fn(&Place, &mut dyn FnMut(usize, usize, f64)) + Sync),
) -> Vec<f64> {
    let (kernel, width) = (&flight.kernel, last - first);
    let mut sums = vec![0.0; columns * CHANNELS * width];
    let segment = flight.windows[first].segment;
    let instants = &flight.segments[segment];
    let (from, to) = (flight.windows[first].start, flight.windows[last - 1].start + kernel.steps());
    for index in from..=to {
        let mut holders = [(0, 0.0, 0.0); OVERLAP];
        let mut count = 0;
        for w in first..last {
            let start = flight.windows[w].start;
            if start <= index && index <= start + kernel.steps() && count < OVERLAP {
                let k = index - start;
                let step = match flight.sampling {
                    Sampling::Held => kernel.step.get(k).copied().unwrap_or(0.0),
                    // both ends of a step count half: the weight is the mean of the two steps adjacent to the sample
                    Sampling::Instants => kernel.sample[k],
                };
                holders[count] = (w - first, kernel.sample[k], step);
                count += 1;
            }
        }
        let mut visit = |at: &Instant, forces: f64, moments: f64| {
            let place = Place { segment, index, at, controls: &instants[index].controls };
            evaluate(&place, &mut |column, channel, amount| {
                let row = (column * CHANNELS + channel) * width;
                for &(w, sample, step) in &holders[..count] {
                    let weight = if channel < 3 { sample * forces } else { step * moments };
                    if weight != 0.0 {
                        sums[row + w] += weight * amount;
                    }
                }
            });
        };
        match (integrator, instants.get(index + 1)) {
            (Integrator::Rk4, Some(next)) if flight.sampling == Sampling::Held => {
                visit(&instants[index], 1.0, 0.5);
                visit(next, 0.0, 0.5);
            }
            _ => visit(&instants[index], 1.0, 1.0),
        }
    }
    sums
}

/// Rates of change (per second) of the quantities `of` in every window. The samples are weighted with the kernel's derivative,
/// which differentiates and smooths.
pub fn rates<const N: usize>(
    flight: &Prepared,
    of: impl Fn(&Instant) -> [f64; N],
) -> Vec<[f64; N]> {
    let rate = |window| {
        let mut sum = [0.0; N];
        for (weight, at) in flight.kernel.slope.iter().zip(flight.samples(window)) {
            let x = of(at);
            (0..N).for_each(|k| sum[k] += weight * x[k]);
        }
        sum
    };
    flight.windows.iter().map(rate).collect()
}

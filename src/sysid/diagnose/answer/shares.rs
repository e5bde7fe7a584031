//! Two parts of a diagnosis: how much of each channel (component of force or moment) the model leaves unexplained, and the
//! re-estimated coefficients.
//!
//! The residual of a channel is the difference between measurement and model. It is averaged over overlapping windows.

use crate::compare::answer::acting::{Compared, Method, acting};
use crate::compare::{ChannelId, RegimeVariable};
use crate::diagnose::answer::result::{Candidate, ChannelLeft, Tuned};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::stepwise::Found;
use greylag_model::GreyBox;
use greylag_num::statistics::mean;

/// Number of bins over a regime variable.
const BINS: usize = 5;
/// A bin is reported if its mean residual exceeds this number of standard errors.
const WORTH: f64 = 4.0;
const SYMBOLS: [&str; 6] = ["D", "L", "Y", "l", "m", "n"];

/// Unexplained variance of every channel that the flights measure. For each channel in which the flights cannot assess the
/// model, `abstained` holds the reason.
pub fn channels(found: &Found, abstained: &[Option<String>; 6]) -> Vec<ChannelLeft> {
    let (before, after) = (found.unexplained, found.left());
    let residual = found.round().tuned_residual();
    let of = |k: usize| ChannelLeft {
        channel: SYMBOLS[k].into(),
        tuned_unexplained_fraction: before[k],
        unexplained_fraction: after[k],
        worst_regime: worst(found.round(), &residual, k),
        left_with: found.shape.as_ref().and_then(|shape| shape.term(k)),
        abstained: abstained[k].is_some(),
        why_abstained: abstained[k].clone(),
    };
    (0..SYMBOLS.len()).filter(|k| before[*k].is_finite()).map(of).collect()
}

/// The unexplained shares of `channels`, without and with the asserted effects. The coefficients were fitted by equation error.
pub fn compared(channels: &[ChannelLeft]) -> Compared {
    let all = |share: fn(&ChannelLeft) -> f64| {
        ChannelId::ALL.map(|id| {
            let of = channels.iter().find(|c| c.channel == id.symbol());
            of.map_or(f64::NAN, share)
        })
    };
    Compared {
        given: None,
        tuned: Some(all(|c| c.tuned_unexplained_fraction)),
        after: all(|c| c.unexplained_fraction),
        method: Method::EquationError,
    }
}

/// `effects` with the channels in which each asserted effect acts, from the unexplained shares of `channels`.
pub fn placed(mut effects: Vec<Candidate>, channels: &[ChannelLeft]) -> Vec<Candidate> {
    let shares = compared(channels);
    for effect in effects.iter_mut().filter(|c| c.asserted) {
        effect.acts = acting(&[effect.id.as_str()], &shares);
    }
    effects
}

/// Text about the flight condition (regime) in which a channel's mean residual is most significant. `None` if no mean
/// residual is significant.
fn worst(round: &Round, residual: &[Column], channel: usize) -> Option<String> {
    let mut points = Vec::new();
    for (flight, left) in round.flights.iter().zip(residual) {
        for (window, r) in flight.acting.windows.iter().zip(&left[channel]) {
            if r.is_finite() {
                points.push((window.regime, *r));
            }
        }
    }
    worst_of(points, channel)
}

/// Regime variables of a window, and its residual.
type Point = ([f64; RegimeVariable::CONTINUOUS.len()], f64);

fn worst_of(mut points: Vec<Point>, channel: usize) -> Option<String> {
    let mut best: Option<(f64, String)> = None;
    for (k, variable) in RegimeVariable::CONTINUOUS.iter().enumerate() {
        if matches!(variable, RegimeVariable::Time) {
            continue;
        }
        points.sort_by(|a, b| a.0[k].total_cmp(&b.0[k]));
        // a single window has no standard error
        for bin in points.chunks(points.len().div_ceil(BINS).max(1)).filter(|bin| bin.len() > 1) {
            let values: Vec<f64> = bin.iter().map(|p| p.1).collect();
            let m = mean(&values);
            let sd = (values.iter().map(|x| (x - m).powi(2)).sum::<f64>()
                / (values.len().max(2) - 1) as f64)
                .sqrt();
            // neighbouring windows overlap by half, so only half of them are independent
            let z = m.abs() / (sd / (0.5 * values.len() as f64).sqrt());
            if z > WORTH && best.as_ref().is_none_or(|(other, _)| z > *other) {
                let id = ChannelId::ALL[channel];
                let words = format!(
                    "{} {:+.3} {} off the model at {} {:.1} to {:.1} {}",
                    id.name(),
                    m,
                    id.unit(),
                    variable.name(),
                    bin[0].0[k],
                    bin[bin.len() - 1].0[k],
                    variable.unit()
                );
                best = Some((z, words.trim().replace('-', "−")));
            }
        }
    }
    best.map(|(_, words)| words)
}

/// The coefficients of `model`, as given and as re-estimated in the last round of the search, a linearisation of the model over
/// the flights.
pub fn tuned(found: &Found, model: &GreyBox) -> Vec<Tuned> {
    let round = found.round();
    let p = &round.projected;
    let of = |(k, place): (usize, &usize)| {
        let given = model.coefficients().get(*place)?;
        Some(Tuned {
            name: given.name.clone(),
            prior: given.value,
            prior_sd: given.width(),
            value: round.model.coefficients()[*place].value + p.tuned[k],
            sd: p.covariance[(k, k)].max(0.0).sqrt(),
        })
    };
    round.coefficients.iter().enumerate().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_single_window_is_no_regime() {
        // 21 windows: the last of five bins contains a single window
        let point = |k: usize| {
            let mut regime = [0.0; RegimeVariable::CONTINUOUS.len()];
            regime[0] = k as f64;
            (regime, if k.is_multiple_of(2) { 0.1 } else { -0.1 })
        };
        assert_eq!(worst_of((0..21).map(point).collect(), 1), None);
        let off = (0..40).map(|k| (point(k).0, 3.0 + point(k).1)).collect();
        assert!(worst_of(off, 1).unwrap().contains("lift +3.000 N off the model"));
    }
}

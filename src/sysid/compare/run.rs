//! Compares models with recorded flights by free runs (open-loop simulations) and by the residuals of forces and moments.

use rayon::prelude::*;

use super::CompareError;
use super::answer::between::between;
use super::bins::{self, Residual, SUPPORT};
use super::bootstrap::{BLOCK_S, RESAMPLES};
use super::discovery;
use super::doubt::{self, Shift};
use super::finding;
use super::flight;
use super::forecast::forecasts;
use super::free_run::{self, DIVERGENCE_BOUND, START_EVERY_S};
use super::known;
use super::power::Power;
use super::result::{
    Abstention, ChannelResult, ChannelTrace, Comparison, HorizonScore, ModelResult, ModelTrace,
    RegimeBins, Settings,
};
use super::sentence::{NOTHING_LEFT, Subject, sentence};
use super::usable::{self, Said, Usable, usable};
use super::verdict;
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::KnownFlight;
use crate::progress::{Progress, report};
use crate::rudder;
use crate::weak_form::channels::ChannelId;
use crate::weak_form::kernel::KERNEL_S;
use crate::weak_form::prepared::{ClockError, Prepared};
use crate::weak_form::windows::{self, Series};
use greylag_model::GreyBox;

/// This text and the next two are reasons why a model is not assessed in a channel (a force, a moment or a rate).
const UNMOVED: &str = "these flights do not move it above the sensors' noise";
const NOISE_UNKNOWN: &str =
    "its noise cannot be computed, because the model predicts no number beside a measured state";
const DOUBTFUL: &str = "the uncertainty of the sensor errors may explain the whole residual";
/// Sentence that follows physically impossible estimates.
const CANNOT_BE: &str = "A figure of these flights cannot be, so nothing is said about forces and moments, and the errors of free \
                         runs are not to be trusted.";

/// Options of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Horizons of the free runs, s.
    pub horizons_s: Vec<f64>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options { horizons_s: vec![1.0, 2.0, 5.0, 10.0], seed: 1 }
    }
}

/// Compares each of `models` with the reconstructed `flights`. `progress` receives the stages and may cancel.
/// # Errors
/// No model, flight or usable log is given, a sampling interval or a horizon is not usable, or `progress` cancelled.
pub fn compare(
    models: &[GreyBox],
    flights: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Comparison, CompareError> {
    let usable = usable(flights, slowest(models, options)?)?;
    compared(models, flights, usable, options, progress)
}

/// As [`compare`], for flights that nothing needs afterwards. The samples of a flight are dropped once they are resampled, because
/// both would take much memory for a long flight.
/// # Errors
/// Those of [`compare`].
pub fn compare_and_drop(
    models: &[GreyBox],
    mut flights: Vec<Reconstruction>,
    options: &Options,
    progress: &Progress,
) -> Result<Comparison, CompareError> {
    let (places, prepared, notes) = usable::emptied(&mut flights, slowest(models, options)?)?;
    let used = places.into_iter().map(|place| &flights[place]).collect();
    compared(models, &flights, (used, prepared, notes), options, progress)
}

/// Airspeed above which the aircraft of the first of `models` counts as flying, m/s. An error if there is no model or a horizon is
/// not usable.
fn slowest(models: &[GreyBox], options: &Options) -> Result<f64, CompareError> {
    let first = models.first().ok_or(CompareError::NoModel)?;
    match options.horizons_s.iter().find(|h| !(0.01..=600.0).contains(*h)) {
        Some(horizon) => Err(CompareError::Horizon(*horizon)),
        None => Ok(first.airframe.envelope.flying_from_mps()),
    }
}

/// Compares each of `models` with the usable ones among `flights`.
fn compared(
    models: &[GreyBox],
    flights: &[Reconstruction],
    (used, prepared, Said { mut notes, mut doubtful }): Usable,
    options: &Options,
    progress: &Progress,
) -> Result<Comparison, CompareError> {
    let first = models.first().ok_or(CompareError::NoModel)?;
    if !doubtful.is_empty() {
        doubtful.push(CANNOT_BE.into());
    }
    notes.extend(short_of(&prepared, &options.horizons_s));
    let steps: Vec<(&str, f64)> = prepared.iter().map(|f| (f.name.as_str(), f.dt)).collect();
    notes.extend(free_run::uneven(&steps, &options.horizons_s));
    let forecasts = forecasts(&prepared, first.scale(), &options.horizons_s);
    let share = 1.0 / models.len() as f64;
    let models = models
        .iter()
        .enumerate()
        .map(|(k, model)| {
            let doing = format!("comparing {} with {} flight(s)", model.name, prepared.len());
            report(progress, &doing, k as f64 * share)?;
            let mut result = one_model(model, &prepared, &used, options);
            result.sentences.extend(verdict::beaten(&result.free_run, &forecasts));
            let rudder = rudder::unmodelled(flights, model).map(rudder::warning);
            result.sentences.splice(0..0, rudder);
            if !doubtful.is_empty() {
                result.withhold_channels();
                result.sentences.splice(0..0, doubtful.iter().cloned());
            }
            Ok(result)
        })
        .collect::<Result<Vec<_>, CompareError>>()?;
    Ok(Comparison {
        answer: between(&models, &prepared, &forecasts),
        schema: "greylag.comparison/1",
        program: concat!("greylag ", env!("CARGO_PKG_VERSION")).into(),
        seed: options.seed,
        sentences: models[0].sentences.clone(),
        doubtful,
        models,
        forecasts,
        flights: prepared.iter().zip(used).map(|(p, from)| flight::result(p, from)).collect(),
        settings: Settings {
            start_every_s: START_EVERY_S,
            horizons_s: options.horizons_s.clone(),
            divergence_bound: DIVERGENCE_BOUND,
            kernel_s: KERNEL_S,
            block_s: BLOCK_S,
            resamples: RESAMPLES,
            support: SUPPORT,
        },
        notes,
    })
}

/// Errors of the free runs of `model` along `flights`, one for each of `horizons_s` (lengths of the runs, s).
///
/// # Errors
/// The sampling interval of a flight is not usable: see `ClockError`.
pub fn scores(
    model: &GreyBox,
    flights: &[Reconstruction],
    horizons_s: &[f64],
) -> Result<Vec<HorizonScore>, ClockError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    let prepared =
        flights.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()?;
    let (runs, _) = free_run::fly(model, &prepared, horizons_s);
    Ok(horizons_s.iter().map(|h| runs.score(*h)).collect())
}

fn short_of(flights: &[Prepared], horizons: &[f64]) -> Vec<String> {
    let longest = flights
        .iter()
        .flat_map(|f| f.segments.iter().map(|s| (s.len() - 1) as f64 * f.dt))
        .fold(0.0, f64::max);
    let beyond = horizons.iter().filter(|h| **h > longest + 1e-9);
    beyond
        .map(|h| {
            format!("no stretch of flight is {h} s long (the longest is {longest:.1} s): no free run reaches that horizon")
        })
        .collect()
}

fn one_model(
    model: &GreyBox,
    flights: &[Prepared],
    from: &[&Reconstruction],
    options: &Options,
) -> ModelResult {
    let (runs, paths) = free_run::fly(model, flights, &options.horizons_s);
    let known = known::used(model, flights, &options.horizons_s);
    let (series, shifts) = seen(model, flights, from);
    let seen = Seen { flights, series: &series, shifts: &shifts };
    let channels = all_channels(model, &seen, options.seed);
    let traces = paths.into_iter().zip(flights).zip(&series);
    let free_run: Vec<_> = options.horizons_s.iter().map(|h| runs.score(*h)).collect();
    let mut sentences = verdict::sentences(&free_run, &channels);
    sentences.extend(verdict::unpredicted(&series));
    sentences.extend(known.as_ref().and_then(|k| k.sentence(&free_run)));
    ModelResult {
        name: model.name.clone(),
        sentences,
        free_run,
        known,
        growth: runs.growth(),
        channels,
        traces: traces
            .map(|((states, flight), series)| ModelTrace {
                states,
                channels: series.iter().map(|s| channel_trace(flight, s)).collect(),
            })
            .collect(),
    }
}

/// For each measured channel: whether `flights` suffice to assess `model` in it, and whether `model` certainly errs in it.
/// # Errors
/// There is no flight, no flight is usable, or the sampling interval of a flight is not usable.
pub fn abstentions(
    model: &GreyBox,
    flights: &[Reconstruction],
    seed: u64,
) -> Result<Vec<Abstention>, CompareError> {
    let (used, prepared, _) = usable(flights, model.airframe.envelope.flying_from_mps())?;
    let (series, shifts) = seen(model, &prepared, &used);
    let seen = Seen { flights: &prepared, series: &series, shifts: &shifts };
    let own = |c: ChannelResult| Abstention {
        channel: c.channel,
        why: c.abstained,
        sure_error: c.regime.is_some(),
    };
    Ok(all_channels(model, &seen, seed).into_iter().map(own).collect())
}

type Measured = (Vec<Vec<Series>>, Vec<Vec<[Shift; ChannelId::ALL.len()]>>);

fn seen(model: &GreyBox, flights: &[Prepared], from: &[&Reconstruction]) -> Measured {
    let series = series(model, flights);
    let pairs = flights.par_iter().zip(from);
    let shifts = pairs.map(|(flight, from)| doubt::shifts(model, flight, &from.nuisances));
    (series, shifts.collect())
}

/// The channels of each flight, measured and predicted by `model` with the constants of the flights that its file has.
pub(super) fn series(model: &GreyBox, flights: &[Prepared]) -> Vec<Vec<Series>> {
    let of = |f: &Prepared| match KnownFlight::of(model, f) {
        Some(known) => windows::channels(&known.model, &known.flight),
        None => windows::channels(model, f),
    };
    flights.par_iter().map(of).collect()
}

/// Flights, their channels (measured and predicted), and the changes of the residuals due to uncertain sensor errors.
struct Seen<'a> {
    flights: &'a [Prepared],
    series: &'a [Vec<Series>],
    shifts: &'a [Vec<[Shift; ChannelId::ALL.len()]>],
}

fn all_channels(model: &GreyBox, seen: &Seen, seed: u64) -> Vec<ChannelResult> {
    let Seen { flights, series, shifts } = *seen;
    let cut = |(k, id): (usize, &ChannelId)| {
        let residuals = bins::residuals(*id, flights, series, shifts);
        let some = !residuals.is_empty();
        some.then(|| (k, bins::all(&residuals, flights, seed, k as u64), residuals))
    };
    let cut: Vec<_> = ChannelId::ALL.par_iter().enumerate().filter_map(cut).collect();
    let (places, rest): (Vec<usize>, Vec<_>) = cut.into_iter().map(|(k, b, r)| (k, (b, r))).unzip();
    let (mut bins, residuals): (Vec<Vec<RegimeBins>>, Vec<Vec<Residual>>) =
        rest.into_iter().unzip();
    discovery::control(&mut bins);
    let all: Vec<_> = places.into_iter().zip(bins).zip(residuals).collect();
    all.into_par_iter()
        .map(|((k, bins), residuals)| channel(model, k, (bins, &residuals), seen, seed))
        .collect()
}

fn channel(
    model: &GreyBox,
    place: usize,
    (bins, residuals): (Vec<RegimeBins>, &[Residual]),
    &Seen { flights, series, .. }: &Seen,
    seed: u64,
) -> ChannelResult {
    let (id, number) = (ChannelId::ALL[place], place as u64);
    let power = Power::of(residuals, noise(id, series));
    let found = finding::worst(residuals, &bins, flights, seed, number);
    let within_doubt = (power.residual - power.noise).max(0.0).sqrt()
        < doubt::NORMAL_95 * doubt::level(residuals.iter().map(|r| r.shift));
    let unexplained = power.unexplained();
    let unknown = unknown(&power);
    let abstained = match found {
        _ if unexplained.is_nan() => Some(unknown),
        None if within_doubt && unexplained >= NOTHING_LEFT => Some(DOUBTFUL),
        _ => None,
    };
    let worst_regime = sentence(&Subject {
        channel: id,
        unexplained,
        unknown,
        finding: found.as_ref(),
        follows: finding::follows(&bins),
        within_doubt,
        mass: model.body.mass,
        flights: flights.len(),
    });
    ChannelResult {
        channel: id,
        name: id.name(),
        unit: id.unit(),
        windows: residuals.len(),
        measured_sd: power.measured.sqrt(),
        residual_rms: power.residual.sqrt(),
        noise_sd: power.noise.sqrt(),
        unexplained_fraction: unexplained,
        effect_per_s: (power.residual - power.noise).max(0.0).sqrt() * leverage(model, id),
        offset_share: power.offset,
        worst_regime,
        abstained,
        regime: found.map(|f| f.regime),
        bins,
        map: bins::map(residuals),
    }
}

fn unknown(power: &Power) -> &'static str {
    if power.noise.is_nan() { NOISE_UNKNOWN } else { UNMOVED }
}

/// Rate at which a residual of one unit in a channel changes the error of a state divided by its scale, 1/s per unit.
fn leverage(model: &GreyBox, id: ChannelId) -> f64 {
    let [_, _, v, p, q, r, alpha, beta] = model.scale();
    let body = &model.body;
    match id {
        ChannelId::Drag => 1.0 / (body.mass * v),
        // a force F normal to the flight path turns it at the rate F / (m V)
        ChannelId::Lift => 1.0 / (body.mass * v * alpha),
        ChannelId::Side => 1.0 / (body.mass * v * beta),
        ChannelId::Roll => 1.0 / (body.jx * p),
        ChannelId::Pitch => 1.0 / (body.jy * q),
        ChannelId::Yaw => 1.0 / (body.jz * r),
        ChannelId::Airspeed => 1.0 / v,
        ChannelId::Alpha => 1.0 / alpha,
        ChannelId::Beta => 1.0 / beta,
    }
}

/// Noise variance of the channel `id`, in its unit squared, averaged over the windows of all flights.
pub(super) fn noise(id: ChannelId, series: &[Vec<Series>]) -> f64 {
    let own = || series.iter().flatten().filter(|s| s.channel == id);
    let windows = |s: &Series| s.measured.iter().filter(|x| x.is_finite()).count() as f64;
    own().map(|s| s.noise_variance * windows(s)).sum::<f64>() / own().map(windows).sum::<f64>()
}

fn channel_trace(flight: &Prepared, series: &Series) -> ChannelTrace {
    let mut trace = ChannelTrace {
        channel: series.channel,
        time_s: Vec::new(),
        measured: Vec::new(),
        predicted: Vec::new(),
    };
    let mut segment = None;
    for (k, window) in flight.windows.iter().enumerate() {
        if segment.is_some_and(|s| s != window.segment) {
            // a NaN row interrupts the curve between segments
            trace.time_s.push(window.time_s - flight.dt);
            trace.measured.push(f64::NAN);
            trace.predicted.push(f64::NAN);
        }
        segment = Some(window.segment);
        trace.time_s.push(window.time_s);
        trace.measured.push(series.measured[k]);
        trace.predicted.push(series.predicted[k]);
    }
    trace
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_of_unknown_noise_is_not_called_unmoved() {
        let power = |noise| Power { measured: 4.0, residual: 1.0, noise, offset: 0.0 };
        for (noise, why) in [(f64::NAN, NOISE_UNKNOWN), (3.9, UNMOVED)] {
            assert!(power(noise).unexplained().is_nan());
            assert_eq!(unknown(&power(noise)), why);
        }
    }
}

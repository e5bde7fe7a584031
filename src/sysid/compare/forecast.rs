//! Forecasts that use no aerodynamic model, as baselines for the free runs (open-loop simulations) of a model. Either the state
//! is held, or the flight goes straight on, or a linear model (ARX) predicts the state.

use serde::Serialize;

use super::answer::ANSWER_S;
use super::arx::{self, Arx};
use super::free_run::{End, START_EVERY_S, error, scaled};
use super::result::HorizonScore;
use super::runs::{Ahead, Look, Runs};
use crate::flight_path::reconstruction::{Instant, Reconstruction};
use crate::weak_form::prepared::{ClockError, Prepared};
use greylag_model::GreyBox;

/// Name of the linear model (ARX). Its error is that of flights to which it was fitted.
const LINEAR: &str = "linear (ARX), fitted to these flights";

/// Errors of a baseline forecast. Its runs start at the same times as the free runs of the models.
#[derive(Clone, Debug, Serialize)]
pub struct ForecastResult {
    /// Name of the forecast.
    pub name: &'static str,
    /// Error at each horizon, the length of a run.
    pub free_run: Vec<HorizonScore>,
}

impl ForecastResult {
    /// Whether the forecast is a fair reference for a model: it was not fitted to the flights that it predicts.
    pub fn is_reference(&self) -> bool {
        self.name != LINEAR
    }
}

/// A rule that predicts the next state.
pub(super) enum Forecast {
    /// The initial state is held.
    Hold,
    /// Attitude, airspeed, angle of attack and sideslip are held at their initial values. The body rates are zero.
    Straight,
    /// A linear model with the controls as inputs (ARX), fitted by least squares. [`forecasts`] fits a model of first order to
    /// the flights on which it then computes the error, so that this error is optimistic.
    Linear(Arx),
}

impl Forecast {
    fn name(&self) -> &'static str {
        match self {
            Forecast::Hold => "hold the state",
            Forecast::Straight => "fly straight on",
            Forecast::Linear(_) => LINEAR,
        }
    }

    /// Number of samples, with the present one, from which the next state is computed.
    fn order(&self) -> usize {
        match self {
            Forecast::Hold | Forecast::Straight => 1,
            Forecast::Linear(arx) => arx.order(),
        }
    }

    /// The predicted state `dt` (s) after the present one. `past` has the present state and those before it, the newest first.
    /// `flown` has the recorded samples of the segment up to the present one.
    fn next(&self, past: &[[f64; 8]], flown: &[Instant], dt: f64) -> [f64; 8] {
        match self {
            Forecast::Hold => past[0],
            Forecast::Straight => {
                let [roll, pitch, airspeed, _, _, _, alpha, beta] = past[0];
                [roll, pitch, airspeed, 0.0, 0.0, 0.0, alpha, beta]
            }
            Forecast::Linear(arx) => arx.next(past, flown, dt),
        }
    }

    /// Makes one run from sample `start` of `segment`. Returns the measured and the predicted state after each number of steps in
    /// `looks` that the segment reaches; `None` once the run has diverged. It ends early as `end` says, with the distances divided
    /// by `scale`. Returns also the scaled errors of the run without a hold.
    pub(super) fn run(
        &self,
        segment: &[Instant],
        dt: f64,
        start: usize,
        looks: &[usize],
        (scale, end): (&[f64; 8], End),
    ) -> (Vec<Look>, Vec<f64>) {
        let mut past = arx::past(segment, start, self.order());
        let from = past[0];
        let (mut seen, mut unheld, mut held) = (Vec::new(), Vec::new(), None);
        let reached = looks.iter().filter(|l| start + **l < segment.len());
        let mut at = start;
        for look in reached {
            while at < start + look && (held.is_none() || end == End::Far) {
                let next = self.next(&past, &segment[..=at], dt);
                at += 1;
                let measured = segment[at].state.to_array();
                if held.is_none() && !end.goes_on(&from, &measured, &next, scale) {
                    held = Some(past[0]);
                }
                past.rotate_right(1);
                past[0] = next;
            }
            let measured = segment[start + look].state.to_array();
            let pair = [measured, held.unwrap_or(past[0])];
            seen.push((held.is_none() || end == End::Far).then_some(pair));
            unheld.push(scaled(&error(&measured, &past[0]), scale));
        }
        (seen, unheld)
    }
}

/// Errors of all forecasts on `flights` at the `horizons` (s). The errors of the states are divided by `scale`. The linear model
/// is fitted to the same flights.
pub fn forecasts(flights: &[Prepared], scale: [f64; 8], horizons: &[f64]) -> Vec<ForecastResult> {
    let linear = Arx::first_order(flights).map(Forecast::Linear);
    let all = [Forecast::Hold, Forecast::Straight].into_iter().chain(linear);
    results(all, flights, scale, horizons)
}

/// Errors of all forecasts on `flights` at the `horizons` (s). The errors of the states are divided by `scale`. The linear model
/// is of first order and is fitted to the other flights `seen`.
pub fn on_unseen(
    seen: &[Prepared],
    flights: &[Prepared],
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<ForecastResult> {
    let linear = Arx::first_order(seen).map(Forecast::Linear);
    let all = [Forecast::Hold, Forecast::Straight].into_iter().chain(linear);
    results(all, flights, scale, horizons)
}

/// Errors on `flights` of the forecasts that are not fitted: the state is held, or the flight goes straight on. The horizons are
/// `horizons_s` (s). The errors of the states are divided by their scales in `model`.
///
/// # Errors
/// The sampling interval of a flight is not usable: see `ClockError`.
pub fn unfitted(
    model: &GreyBox,
    flights: &[Reconstruction],
    horizons_s: &[f64],
) -> Result<Vec<ForecastResult>, ClockError> {
    let slowest = model.airframe.envelope.flying_from_mps();
    let prepared =
        flights.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()?;
    let all = [Forecast::Hold, Forecast::Straight].into_iter();
    Ok(results(all, &prepared, model.scale(), horizons_s))
}

/// The forecast with the smallest error at the horizon of an answer, of those that were not fitted to the flights: the longest
/// horizon up to [`ANSWER_S`] that any run reaches or, without one, the shortest horizon that is reached. `None` without forecasts.
pub fn best(forecasts: &[ForecastResult]) -> Option<&ForecastResult> {
    let error = |f: &ForecastResult| {
        let reached = || f.free_run.iter().filter(|s| s.runs > 0);
        let longest = reached()
            .filter(|s| s.horizon_s <= ANSWER_S + 1e-9)
            .max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s));
        let score =
            longest.or_else(|| reached().min_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s)));
        score.map_or(f64::INFINITY, |s| s.rmse_scaled)
    };
    let references = forecasts.iter().filter(|f| f.is_reference());
    references.min_by(|a, b| error(a).total_cmp(&error(b)))
}

fn results(
    all: impl Iterator<Item = Forecast>,
    flights: &[Prepared],
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<ForecastResult> {
    all.map(|forecast| {
        let free_run = scores(&forecast, flights, scale, horizons);
        ForecastResult { name: forecast.name(), free_run }
    })
    .collect()
}

/// Errors of `forecast` on `flights`, one for each of the `horizons` (s). The errors of the states are divided by `scale`.
pub(super) fn scores(
    forecast: &Forecast,
    flights: &[Prepared],
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<HorizonScore> {
    let runs = flights.iter().flat_map(|f| flown(forecast, f, scale, horizons)).collect();
    let runs = Runs::new(horizons.to_vec(), runs, scale);
    horizons.iter().map(|h| runs.score(*h)).collect()
}

/// The runs of `forecast` along one flight. They start at the same times as the free runs of the models.
fn flown(
    forecast: &Forecast,
    flight: &Prepared,
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<Vec<Look>> {
    let all = starts_and_runs(forecast, flight, horizons, START_EVERY_S, (&scale, End::Wrong));
    all.into_iter().map(|(_, (looks, _))| looks).collect()
}

/// The runs of `forecast` along one flight from starts every `every_s` (s) to each of `horizons_s` (s) that is recorded. They end
/// as [`End::Far`] says, with distances divided by `scale`.
pub(super) fn ahead(
    forecast: &Forecast,
    flight: &Prepared,
    scale: [f64; 8],
    horizons_s: &[f64],
    every_s: f64,
) -> Vec<Ahead> {
    let all = starts_and_runs(forecast, flight, horizons_s, every_s, (&scale, End::Far));
    let one = |(from, (looks, unheld)): FromAndLooks| Ahead {
        from,
        pairs: looks.into_iter().flatten().collect(),
        unheld,
    };
    all.into_iter().map(one).collect()
}

/// The first state of a run, its looks, and its scaled errors without a hold.
type FromAndLooks = ([f64; 8], (Vec<Look>, Vec<f64>));

/// The first state and the looks of each run of `forecast` along one flight, from starts every `every_s` (s). The last argument has
/// the scale of the states and says where a run ends early.
fn starts_and_runs(
    forecast: &Forecast,
    flight: &Prepared,
    horizons_s: &[f64],
    every_s: f64,
    ends: (&[f64; 8], End),
) -> Vec<FromAndLooks> {
    let steps = |time_s: f64| ((time_s / flight.dt).round() as usize).max(1);
    let looks: Vec<usize> = horizons_s.iter().map(|h| steps(*h)).collect();
    let of = |segment: &Vec<Instant>| {
        let starts = (0..segment.len() - 1).step_by(steps(every_s));
        let run = |start: usize| {
            let from = segment[start].state.to_array();
            (from, forecast.run(segment, flight.dt, start, &looks, ends))
        };
        starts.map(run).collect::<Vec<_>>()
    };
    flight.segments.iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::ActuatorClock;
    use crate::flight_path::reconstruction::Segment;
    use greylag_logs::Sampling;
    use greylag_physics::{Controls, State};

    /// 20 s at 100 Hz of linear pitch dynamics with a sinusoidal elevator; all other states are constant.
    fn flight() -> Prepared {
        let mut state = State::NEUTRAL.to_array();
        let instants = (0..2000).map(|k| {
            let elevator = 0.1 * (0.013 * f64::from(k)).sin();
            let controls = Controls { elevator, throttle: 0.1, ..Controls::default() };
            let now = Instant {
                time_s: 0.01 * f64::from(k),
                state: State::from_array(state),
                controls,
                altitude: 600.0,
                density: 1.15,
                yaw: f64::NAN,
                command: None,
                specific_force: [f64::NAN; 3],
            };
            state[4] += 0.01 * (-4.0 * state[4] - 8.0 * elevator);
            state[1] += 0.01 * now.state.q;
            now
        });
        let flight = Reconstruction {
            name: "f".into(),
            step_s: 0.01,
            sampling: Sampling::Held,
            clock: ActuatorClock::AsRecorded,
            segments: vec![Segment { instants: instants.collect() }],
            nuisances: Vec::new(),
            installation: Vec::new(),
            noise: [f64::NAN; 8],
            left: [f64::NAN; 8],
            force_noise: [f64::NAN; 3],
            gust_step: 0.0,
            rudder: None,
            notes: Vec::new(),
        };
        Prepared::new(&flight, 5.0).unwrap()
    }

    #[test]
    fn a_linear_flight_is_forecast_by_the_linear_model_alone() {
        let all = forecasts(&[flight()], [1.0; 8], &[1.0, 5.0]);
        let at_5: Vec<f64> = all.iter().map(|f| f.free_run[1].rmse_scaled).collect();
        let [hold, straight, linear] = at_5[..] else { panic!("{at_5:?}") };
        // pitch oscillates by 0.1 rad, which the first two forecasts do not predict
        assert!(hold > 0.01 && straight > 0.01 && linear < 1e-6, "{at_5:?}");
        // the linear model has seen the flight, so that no model is judged beside it
        assert_eq!(best(&all).unwrap().free_run[1].rmse_scaled, hold.min(straight));
        // 20 s contain 7 starts, one every 3 s
        assert_eq!(all[0].free_run[0].runs, 7);
    }

    #[test]
    fn what_is_held_errs_by_what_the_flight_does() {
        let flight = flight();
        let pitch = |k: usize| flight.segments[0][k].state.pitch;
        let hold = &forecasts(std::slice::from_ref(&flight), [1.0; 8], &[1.0])[0].free_run[0];
        let squares = (0..7).map(|k| (pitch(300 * k + 100) - pitch(300 * k)).powi(2));
        let expected = (squares.sum::<f64>() / 7.0).sqrt();
        assert!((hold.states[1].rmse - expected).abs() < 1e-12);
    }
}

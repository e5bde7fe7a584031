//! Baseline forecasts without aerodynamics: held state, straight flight, linear model (ARX).

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::free_run::{DIVERGENCE_BOUND, Look, Runs, START_EVERY_S, error, scaled};
use super::result::HorizonScore;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Prepared;

/// Number of regressors of the linear model: eight states, aileron, elevator, throttle, rudder and a constant.
const REGRESSORS: usize = 13;
/// Singular values of the normalised Gram matrix below this are treated as zero, for example that of a rudder that never
/// moves.
const RANK: f64 = 1e-9;

/// Free-run error of a baseline forecast, with the same starts as the free runs of the models.
#[derive(Clone, Debug, Serialize)]
pub struct ForecastResult {
    /// Name of the forecast.
    pub name: &'static str,
    /// Error at each horizon.
    pub free_run: Vec<HorizonScore>,
}

/// A rule for the next state.
enum Forecast {
    /// The initial state is held.
    Hold,
    /// Attitude, airspeed and flow angles are held at their initial values. The body rates are zero.
    Straight,
    /// A first-order linear model with the controls as inputs (ARX), fitted by least squares. The function `forecasts` fits
    /// this model to the flights on which it computes the error. This error is therefore optimistic.
    Linear(DMatrix<f64>),
}

impl Forecast {
    fn name(&self) -> &'static str {
        match self {
            Forecast::Hold => "hold the state",
            Forecast::Straight => "fly straight on",
            Forecast::Linear(_) => "linear (ARX), fitted to these flights",
        }
    }

    /// The state `dt` (s) after `state`, with the controls of `at`.
    fn next(&self, state: &[f64; 8], at: &Instant, dt: f64) -> [f64; 8] {
        match self {
            Forecast::Hold => *state,
            Forecast::Straight => {
                let [roll, pitch, airspeed, _, _, _, alpha, beta] = *state;
                [roll, pitch, airspeed, 0.0, 0.0, 0.0, alpha, beta]
            }
            Forecast::Linear(slopes) => {
                let rate = slopes * DVector::from_column_slice(&regressors(state, at));
                std::array::from_fn(|k| state[k] + dt * rate[k])
            }
        }
    }

    /// One run from sample `start` of `segment`. Returns the measured and predicted state after each number of steps in
    /// `looks`.
    fn run(
        &self,
        segment: &[Instant],
        dt: f64,
        start: usize,
        looks: &[usize],
        scale: &[f64; 8],
    ) -> Vec<Look> {
        let mut state = segment[start].state.to_array();
        let (mut seen, mut lost) = (Vec::new(), false);
        let reached = looks.iter().filter(|l| start + **l < segment.len());
        let mut at = start;
        for look in reached {
            while at < start + look && !lost {
                state = self.next(&state, &segment[at], dt);
                at += 1;
                let miss = scaled(&error(&segment[at].state.to_array(), &state), scale);
                lost = miss.is_nan() || miss > DIVERGENCE_BOUND;
            }
            seen.push((!lost).then(|| [segment[at].state.to_array(), state]));
        }
        seen
    }
}

fn regressors(state: &[f64; 8], at: &Instant) -> [f64; REGRESSORS] {
    let c = at.controls;
    let [roll, pitch, airspeed, p, q, r, alpha, beta] = *state;
    let rudder = if c.rudder.is_finite() { c.rudder } else { 0.0 };
    [roll, pitch, airspeed, p, q, r, alpha, beta, c.aileron, c.elevator, c.throttle, rudder, 1.0]
}

/// Coefficients of the rates of the eight states with respect to the regressors, by least squares over all `flights`. `None`
/// if a coefficient is not finite.
fn linear(flights: &[Prepared]) -> Option<DMatrix<f64>> {
    let mut gram = DMatrix::<f64>::zeros(REGRESSORS, REGRESSORS);
    let mut moments = DMatrix::<f64>::zeros(REGRESSORS, 8);
    for flight in flights {
        for pair in flight.segments.iter().flat_map(|s| s.windows(2)) {
            let state = pair[0].state.to_array();
            let row = DVector::from_column_slice(&regressors(&state, &pair[0]));
            let step = error(&state, &pair[1].state.to_array()).map(|x| x / flight.dt);
            gram.ger(1.0, &row, &row, 1.0);
            moments.ger(1.0, &row, &DVector::from_column_slice(&step), 1.0);
        }
    }
    let size = gram.diagonal().map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let size = DMatrix::from_diagonal(&size);
    let solved = (&size * gram * &size).svd(true, true).solve(&(&size * moments), RANK).ok()?;
    let slopes = (size * solved).transpose();
    slopes.iter().all(|x| x.is_finite()).then_some(slopes)
}

/// Free-run errors of all forecasts on `flights` at the `horizons` (s). The errors of the states are divided by `scale`. The
/// linear model is fitted to the same flights.
pub fn forecasts(flights: &[Prepared], scale: [f64; 8], horizons: &[f64]) -> Vec<ForecastResult> {
    let linear = linear(flights).map(Forecast::Linear);
    let all = [Forecast::Hold, Forecast::Straight].into_iter().chain(linear);
    results(all, flights, scale, horizons)
}

/// Free-run errors of all forecasts on `flights` at the `horizons` (s). The errors of the states are divided by `scale`. The
/// linear model is fitted to the flights `seen`.
pub fn on_unseen(
    seen: &[Prepared],
    flights: &[Prepared],
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<ForecastResult> {
    let linear = linear(seen).map(Forecast::Linear);
    let all = [Forecast::Hold, Forecast::Straight].into_iter().chain(linear);
    results(all, flights, scale, horizons)
}

fn results(
    all: impl Iterator<Item = Forecast>,
    flights: &[Prepared],
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<ForecastResult> {
    all.map(|forecast| {
        let runs = flights.iter().flat_map(|f| flown(&forecast, f, scale, horizons)).collect();
        let runs = Runs::new(horizons.to_vec(), runs, scale);
        let free_run = horizons.iter().map(|h| runs.score(*h)).collect();
        ForecastResult { name: forecast.name(), free_run }
    })
    .collect()
}

/// The runs of one flight, with the same starts as the free runs of the models.
fn flown(
    forecast: &Forecast,
    flight: &Prepared,
    scale: [f64; 8],
    horizons: &[f64],
) -> Vec<Vec<Look>> {
    let every = ((START_EVERY_S / flight.dt).round() as usize).max(1);
    let looks: Vec<usize> =
        horizons.iter().map(|t| ((t / flight.dt).round() as usize).max(1)).collect();
    let of = |segment: &Vec<Instant>| {
        let starts = (0..segment.len() - 1).step_by(every);
        starts.map(|s| forecast.run(segment, flight.dt, s, &looks, &scale)).collect::<Vec<_>>()
    };
    flight.segments.iter().flat_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight_path::reconstruction::{Reconstruction, Segment};
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
            segments: vec![Segment { instants: instants.collect() }],
            nuisances: Vec::new(),
            noise: [f64::NAN; 8],
            left: [f64::NAN; 8],
            force_noise: [f64::NAN; 3],
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
        // pitch oscillates by 0.1 rad; throttle and airspeed are constant
        assert!(hold > 0.01 && straight > 0.01 && linear < 1e-6, "{at_5:?}");
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

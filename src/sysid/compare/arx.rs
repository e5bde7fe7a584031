//! Forecast by a linear autoregressive model with the deflections as inputs (ARX), and the choice of its order. The forecast is a
//! baseline with which the free runs (open-loop simulations) of aircraft models are compared.
//!
//! With the states x and the deflections u of sample k and of the samples before it, the model is
//! ẋ(k) = Σ A(i) x(k − i) + B(i) u(k − i) + c over i = 0 to order − 1, and x(k + 1) = x(k) + ẋ(k) Δt.
//! Source: Ljung, System Identification, 1999, section 4.2. A, B and c minimise the sum of the squared one-step errors. Unlike in
//! the reference, the states are not measurements but come from flight-path reconstruction, which removes most of their noise.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::forecast::{self, Forecast};
use super::free_run::error;
use super::result::HorizonScore;
use crate::flight_path::reconstruction::Instant;
use crate::per_flight::known::KnownFlight;
use crate::weak_form::prepared::Prepared;
use greylag_model::{GreyBox, Memory};
use greylag_num::statistics::mean;

/// Number of regressors of one sample: eight states, aileron, elevator, throttle and rudder.
const OF_SAMPLE: usize = 12;
/// Singular values of the normalised normal equations up to this bound are treated as zero. Such values belong, for example, to a
/// rudder that never moves.
const RANK: f64 = 1e-9;
/// Orders that are tried, in samples.
pub const ORDERS: [usize; 6] = [1, 2, 3, 4, 6, 8];
/// Ridges that are tried with each order, dimensionless.
pub const RIDGES: [f64; 4] = [0.0, 1e-6, 1e-4, 1e-2];
/// A higher order replaces a lower one if it decreases the error by more than this fraction.
const CLEARLY: f64 = 0.01;
/// Smaller scaled errors are replaced by this value (dimensionless), because they may differ by rounding only.
const LEAST_ERROR: f64 = 1e-6;

/// Order and ridge (regularisation) of an ARX model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Number of samples from which a rate is computed: the present one and those before it; at least 1.
    pub order: usize,
    /// Number that is added to the diagonal of the normal equations after they were scaled to a unit diagonal, dimensionless. It
    /// shrinks all coefficients towards zero. With zero coefficients the state would not change.
    pub ridge: f64,
}

/// Reason why an ARX model cannot be fitted or compared, or its order cannot be chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArxError {
    /// The order is zero.
    #[error("cannot fit a linear forecast (ARX) of order 0; ask for an order of at least 1")]
    NoOrder,
    /// There are fewer equations than unknowns.
    #[error(
        "cannot fit a linear forecast (ARX) of order {order}: {rows} steps between samples for {needed} unknowns of each state; \
         ask for a lower order, or give longer flights"
    )]
    TooLittle {
        /// Order of the model, in samples.
        order: usize,
        /// Number of steps from one sample to the next for which all earlier samples exist that the order requires.
        rows: usize,
        /// Number of unknowns of each state. At least as many steps are needed.
        needed: usize,
    },
    /// The equations have no finite solution.
    #[error(
        "cannot fit a linear forecast (ARX) of order {order}: a coefficient is no number; check the log for values that are not \
         physical"
    )]
    NotFinite {
        /// Order of the model, in samples.
        order: usize,
    },
    /// The sample times of two flights differ. Earlier samples would then lie at different times in the past.
    #[error(
        "cannot use one linear forecast (ARX) for flights of {one} and {other} model steps a sample; resample the flights alike"
    )]
    Steps {
        /// Number of model steps between samples of one flight, or of the flights to which the model was fitted.
        one: usize,
        /// Number of model steps between samples of the other flight.
        other: usize,
    },
    /// A single flight cannot be predicted from the others.
    #[error(
        "cannot choose the order of a linear forecast (ARX) with {flights} flight(s): each is predicted from the others, so two \
         are the least; cut a flight into parts"
    )]
    TooFewFlights {
        /// Number of flights.
        flights: usize,
    },
    /// No flight is as long as the shortest horizon (duration of a forecast), or for each such flight the other flights are too
    /// short for a fit.
    #[error(
        "cannot choose the order of a linear forecast (ARX): none of {flights} flights is longer than {shortest_s} s, or those \
         beside it are too short for a fit; give longer flights"
    )]
    TooShort {
        /// Number of flights.
        flights: usize,
        /// Shortest horizon, s.
        shortest_s: f64,
    },
}

/// An ARX model of the eight states.
#[derive(Clone, Debug)]
pub struct Arx {
    order: usize,
    /// Number of model steps between the samples with which the model was fitted.
    substeps: usize,
    /// Derivatives of the rates of the eight states (rows) with respect to the regressors (columns).
    slopes: DMatrix<f64>,
}

impl Arx {
    /// Fits a model to all samples of `flights` that have enough samples before them in their segment (a part without gaps).
    ///
    /// # Errors
    /// If the order is 0, the flights have different sample times, there are fewer steps than unknowns, or a coefficient is not
    /// finite.
    pub fn fit(flights: &[Prepared], choice: Choice) -> Result<Arx, ArxError> {
        if choice.order == 0 {
            return Err(ArxError::NoOrder);
        }
        let substeps = flights.first().map_or(1, |f| f.substeps);
        same_steps(substeps, flights)?;
        Sums::of(flights.iter(), choice.order).arx(choice, substeps)
    }

    /// Fits a linear residual of `model`: the differences between the measured rates and those of `model`, as a linear function of
    /// states and deflections. The rates of roll and pitch angle have none, because their equations are exact. The constants
    /// of the flights in the file of `model` are applied.
    ///
    /// # Errors
    /// As [`Arx::fit`].
    pub fn of_residual(
        model: &GreyBox,
        flights: &[Prepared],
        choice: Choice,
    ) -> Result<Arx, ArxError> {
        if choice.order == 0 {
            return Err(ArxError::NoOrder);
        }
        let substeps = flights.first().map_or(1, |f| f.substeps);
        same_steps(substeps, flights)?;
        let mut sums = Sums::none(choice.order);
        for flight in flights {
            let known = KnownFlight::of(model, flight);
            let (model, flight) = known.as_ref().map_or((model, flight), |k| (&k.model, &k.flight));
            let flight = &*flight.acting(model);
            let model = flight.stepping(model);
            sums.add(flight, choice.order, |segment| steps(&model, flight, segment));
        }
        let mut arx = sums.arx(choice, substeps)?;
        arx.slopes.rows_mut(0, 2).fill(0.0);
        Ok(arx)
    }

    /// The model of order 1 without a ridge. The number of samples is not checked. `None` if a coefficient is not finite.
    pub(super) fn first_order(flights: &[Prepared]) -> Option<Arx> {
        let slopes = Sums::of(flights.iter(), 1).slopes(0.0)?;
        Some(Arx { order: 1, substeps: flights.first().map_or(1, |f| f.substeps), slopes })
    }

    /// The order: the number of samples from which a rate is computed.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Errors of the forecast on `flights`, one for each of `horizons_s` (s). The forecasts start at the same samples as the free
    /// runs of aircraft models. The errors of the states are divided by `scale`, which has the units of the state.
    ///
    /// A forecast from the first samples of a segment needs samples before the segment. Its first sample stands for them.
    ///
    /// # Errors
    /// If the sample time of a flight is not that of the fit.
    pub fn scores(
        &self,
        flights: &[Prepared],
        scale: [f64; 8],
        horizons_s: &[f64],
    ) -> Result<Vec<HorizonScore>, ArxError> {
        same_steps(self.substeps, flights)?;
        Ok(forecast::scores(&Forecast::Linear(self.clone()), flights, scale, horizons_s))
    }

    /// Checks that the sample time of `flight` is that of the fit.
    pub(super) fn sampled_as(&self, flight: &Prepared) -> Result<(), ArxError> {
        same_steps(self.substeps, std::slice::from_ref(flight))
    }

    /// The state at `dt` (s) after the present state. `past` holds the present state and those before it, the newest first.
    /// `flown` holds the samples of the segment up to the present one.
    pub(super) fn next(&self, past: &[[f64; 8]], flown: &[Instant], dt: f64) -> [f64; 8] {
        let rate = self.rates(past, flown);
        std::array::from_fn(|k| past[0][k] + dt * rate[k])
    }

    /// Rates of the eight states, or residual rates if the model is a linear residual, per second. Arguments as in `next`.
    pub(super) fn rates(&self, past: &[[f64; 8]], flown: &[Instant]) -> DVector<f64> {
        &self.slopes * regressors(past, flown)
    }
}

/// Checks that the samples of all `flights` are `substeps` model steps apart.
fn same_steps(substeps: usize, flights: &[Prepared]) -> Result<(), ArxError> {
    match flights.iter().find(|f| f.substeps != substeps) {
        Some(flight) => Err(ArxError::Steps { one: substeps, other: flight.substeps }),
        None => Ok(()),
    }
}

/// Chooses order and ridge by cross-validation: each of `flights` is predicted by a fit to the others.
///
/// For each of `horizons_s` (s) the forecast error is averaged over the flights that reach the horizon. The error of a choice is
/// the geometric mean of these averages. The errors of the states are divided by `scale`, which has the units of the state. For
/// each order in [`ORDERS`] the ridge in [`RIDGES`] with the smallest error is taken. A higher order replaces a lower one only if
/// it lowers the error by more than 1 %.
///
/// # Errors
/// If there are fewer than two flights, their sample times differ, or they are too short.
pub fn choose(
    flights: &[Prepared],
    scale: [f64; 8],
    horizons_s: &[f64],
) -> Result<Choice, ArxError> {
    if flights.len() < 2 {
        return Err(ArxError::TooFewFlights { flights: flights.len() });
    }
    same_steps(flights[0].substeps, flights)?;
    let mut best: Option<(Choice, f64)> = None;
    for order in ORDERS {
        let without = |left: usize| {
            let others = flights.iter().enumerate().filter(|(k, _)| *k != left);
            Sums::of(others.map(|(_, flight)| flight), order)
        };
        let others: Vec<Sums> = (0..flights.len()).into_par_iter().map(without).collect();
        let judged = RIDGES.iter().filter_map(|&ridge| {
            let choice = Choice { order, ridge };
            Some((choice, error_left_out(flights, &others, choice, scale, horizons_s)?))
        });
        let Some(own) = judged.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        if best.is_none_or(|(_, least)| own.1 < (1.0 - CLEARLY) * least) {
            best = Some(own);
        }
    }
    let shortest_s = horizons_s.iter().copied().fold(f64::INFINITY, f64::min);
    let too_short = ArxError::TooShort { flights: flights.len(), shortest_s };
    best.map(|(choice, _)| choice).ok_or(too_short)
}

/// The error of `choice` as defined in [`choose`]. `others` holds for each of `flights` the sums over the other flights. `None`
/// if a fit fails or no flight reaches any horizon.
fn error_left_out(
    flights: &[Prepared],
    others: &[Sums],
    choice: Choice,
    scale: [f64; 8],
    horizons_s: &[f64],
) -> Option<f64> {
    let one = |(flight, sums): (&Prepared, &Sums)| {
        let arx = sums.arx(choice, flight.substeps).ok()?;
        arx.scores(std::slice::from_ref(flight), scale, horizons_s).ok()
    };
    let scores: Option<Vec<Vec<HorizonScore>>> =
        flights.par_iter().zip(others.par_iter()).map(one).collect();
    let scores = scores?;
    let logarithm = |horizon: usize| {
        let reached = scores.iter().map(|s| &s[horizon]).filter(|s| s.runs > 0);
        let errors: Vec<f64> = reached.map(|s| s.rmse_scaled).collect();
        (!errors.is_empty()).then(|| mean(&errors).max(LEAST_ERROR).ln())
    };
    let logarithms: Vec<f64> = (0..horizons_s.len()).filter_map(logarithm).collect();
    (!logarithms.is_empty()).then(|| mean(&logarithms).exp())
}

/// States of `model` one sample after each measured state of `segment` but the last.
fn steps(model: &GreyBox, flight: &Prepared, segment: &[Instant]) -> Vec<[f64; 8]> {
    let mut memory = Memory::default();
    let one = |pair: &[Instant]| {
        flight.advance(model, pair[0].state, [&pair[0], &pair[1]], &mut memory).to_array()
    };
    segment.windows(2).map(one).collect()
}

/// Number of unknowns of each state: one coefficient for each regressor, and a constant.
fn unknowns(order: usize) -> usize {
    OF_SAMPLE * order + 1
}

/// The recorded states of `segment` at the sample `at` and before it, `order` in number, the newest first. The first state of the
/// segment stands for states before it. The roll angles are continuous across ±180°.
pub(super) fn past(segment: &[Instant], at: usize, order: usize) -> Vec<[f64; 8]> {
    let newest = segment[at].state.to_array();
    let one = |back: usize| {
        let mut state = segment[at.saturating_sub(back)].state.to_array();
        state[0] = newest[0] + error(&newest, &state)[0];
        state
    };
    (0..order).map(one).collect()
}

/// The regressors: the states `past` and the deflections of the present sample and of those before it, the newest first, and 1
/// for the constant. `flown` holds the samples of the segment up to the present one.
fn regressors(past: &[[f64; 8]], flown: &[Instant]) -> DVector<f64> {
    let present = flown.len() - 1;
    let mut row = Vec::with_capacity(unknowns(past.len()));
    for (back, state) in past.iter().enumerate() {
        let c = flown[present.saturating_sub(back)].controls;
        let rudder = if c.rudder.is_finite() { c.rudder } else { 0.0 };
        row.extend_from_slice(state);
        row.extend_from_slice(&[c.aileron, c.elevator, c.throttle, rudder]);
    }
    row.push(1.0);
    DVector::from_vec(row)
}

/// Sums over steps from which the least-squares fit follows.
struct Sums {
    /// Sums of the products of two regressors.
    gram: DMatrix<f64>,
    /// Sums of the products of a regressor (row) and the rate of a state (column).
    moments: DMatrix<f64>,
    /// Number of steps in the sums.
    rows: usize,
}

impl Sums {
    /// Sums over all samples of `flights` that have `order` − 1 samples before them and one after them; `order` is at least 1.
    fn of<'a>(flights: impl Iterator<Item = &'a Prepared>, order: usize) -> Sums {
        let mut sums = Sums::none(order);
        let held = |segment: &[Instant]| segment.iter().map(|at| at.state.to_array()).collect();
        flights.for_each(|flight| sums.add(flight, order, held));
        sums
    }

    fn none(order: usize) -> Sums {
        let size = unknowns(order);
        Sums { gram: DMatrix::zeros(size, size), moments: DMatrix::zeros(size, 8), rows: 0 }
    }

    /// Adds the samples of `flight`. `base` predicts the state after each sample of a segment; the rates in the sums are the
    /// remaining differences.
    fn add(&mut self, flight: &Prepared, order: usize, base: impl Fn(&[Instant]) -> Vec<[f64; 8]>) {
        for segment in &flight.segments {
            let predicted = base(segment);
            for at in order - 1..segment.len().saturating_sub(1) {
                let states = past(segment, at, order);
                let row = regressors(&states, &segment[..=at]);
                let step = error(&predicted[at], &segment[at + 1].state.to_array());
                let rate = DVector::from_column_slice(&step.map(|x| x / flight.dt));
                self.gram.ger(1.0, &row, &row, 1.0);
                self.moments.ger(1.0, &row, &rate, 1.0);
                self.rows += 1;
            }
        }
    }

    /// The model with the order and ridge of `choice`. The order must be that of the sums.
    fn arx(&self, choice: Choice, substeps: usize) -> Result<Arx, ArxError> {
        let Choice { order, ridge } = choice;
        let needed = unknowns(order);
        if self.rows < needed {
            return Err(ArxError::TooLittle { order, rows: self.rows, needed });
        }
        let slopes = self.slopes(ridge).ok_or(ArxError::NotFinite { order })?;
        Ok(Arx { order, substeps, slopes })
    }

    /// Derivatives of the rates with respect to the regressors, for this `ridge` (see [`Choice::ridge`]). `None` if one is not
    /// finite.
    fn slopes(&self, ridge: f64) -> Option<DMatrix<f64>> {
        Some(ridge_regression(&self.gram, &self.moments, ridge)?.transpose())
    }
}

/// Coefficients (rows: regressors, columns: outputs) of a least-squares fit. `gram` holds the sums of the products of two regressors,
/// `moments` those of a regressor and an output. The number `ridge` is added to the diagonal of the normal equations after they
/// were scaled to a unit diagonal. `None` if a coefficient is not finite.
pub(crate) fn ridge_regression(
    gram: &DMatrix<f64>,
    moments: &DMatrix<f64>,
    ridge: f64,
) -> Option<DMatrix<f64>> {
    let size = gram.diagonal().map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
    let size = DMatrix::from_diagonal(&size);
    let mut scaled = &size * gram * &size;
    for k in 0..scaled.nrows() {
        scaled[(k, k)] += ridge;
    }
    let solved = size.clone() * scaled.svd(true, true).solve(&(&size * moments), RANK).ok()?;
    solved.iter().all(|x| x.is_finite()).then_some(solved)
}

#[cfg(test)]
mod tests;

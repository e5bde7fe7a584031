//! Values of the variables of free forms (expressions of a grammar) at every sample, and their averages over the windows of
//! the weak form.

use crate::diagnose::proposal::free::evaluate::evaluate;
use crate::diagnose::search::round::Round;
use crate::flight_path::reconstruction::Instant;
use crate::weak_form::prepared::Window;
use greylag_logs::Sampling;
use greylag_model::{GreyBox, Integrator};
use greylag_physics::formula::Variable;
use greylag_physics::formula::expression::Expression;
use greylag_physics::{Channel, Controls};

/// Variables that free forms may contain.
pub const VARIABLES: [Variable; 13] = [
    Variable::Alpha,
    Variable::Beta,
    Variable::RollRateHat,
    Variable::PitchRateHat,
    Variable::YawRateHat,
    Variable::RollRate,
    Variable::PitchRate,
    Variable::YawRate,
    Variable::Aileron,
    Variable::Elevator,
    Variable::Rudder,
    Variable::Throttle,
    Variable::Airspeed,
];

/// Values of all variables at the samples of all flights, one flight after the other.
pub struct Samples {
    values: Vec<(Variable, Vec<f64>)>,
    /// Dynamic pressure times wing area, N.
    pressure: Vec<f64>,
    /// Number of samples. Moments of a simulated log may be averages over integration steps. For these, the values at
    /// the ends of the steps follow the samples.
    count: usize,
    /// Index of the first sample of each segment, by flight.
    first: Vec<Vec<usize>>,
    /// Wing span and mean chord, m.
    lengths: [f64; 2],
}

/// A window: index of its first sample, and weights of this sample and the next ones.
pub struct Average<'a> {
    first: usize,
    weights: &'a [f64],
}

fn value(variable: Variable, model: &GreyBox, at: &Instant, z: &Controls) -> f64 {
    let s = &at.state;
    let air = model.air(s, at.altitude);
    match variable {
        Variable::Alpha => s.alpha,
        Variable::Beta => s.beta,
        Variable::RollRate => s.p,
        Variable::PitchRate => s.q,
        Variable::YawRate => s.r,
        Variable::Airspeed => s.airspeed,
        Variable::RollRateHat => air.p_hat,
        Variable::PitchRateHat => air.q_hat,
        Variable::YawRateHat => air.r_hat,
        Variable::Aileron => z.aileron,
        Variable::Elevator => z.elevator,
        Variable::Rudder => z.rudder,
        Variable::Throttle => z.throttle,
        _ => f64::NAN,
    }
}

impl Samples {
    /// Collects the samples of the flights of `round` for forms in `channel`.
    pub fn new(round: &Round, channel: Channel) -> Samples {
        let model = &round.model;
        type Places<'a> = Vec<(&'a Instant, &'a Controls)>;
        let (mut places, mut ends): (Places, Places) = (Vec::new(), Vec::new());
        let mut first = Vec::new();
        for flight in &round.flights {
            let mut own = Vec::new();
            for segment in &flight.acting.segments {
                own.push(places.len());
                for (k, at) in segment.iter().enumerate() {
                    places.push((at, &at.controls));
                    // a step of RK4 starts at this sample and ends at the next sample, with the controls of this sample
                    ends.push((segment.get(k + 1).unwrap_or(at), &at.controls));
                }
            }
            first.push(own);
        }
        let count = places.len();
        let held = round.flights.iter().all(|f| f.acting.sampling == Sampling::Held);
        if moment(channel) && held && model.integrator == Integrator::Rk4 {
            places.append(&mut ends);
        }
        let column = |v: Variable| places.iter().map(|(at, z)| value(v, model, at, z)).collect();
        let geometry = &model.airframe.geometry;
        Samples {
            values: VARIABLES.iter().map(|v| (*v, column(*v))).collect(),
            pressure: places.iter().map(|(at, _)| model.air(&at.state, at.altitude).q_s).collect(),
            count,
            first,
            lengths: [geometry.span, geometry.chord],
        }
    }

    /// Values of a variable at every sample, in SI units; `None` if free forms cannot contain the variable.
    pub fn variable(&self, variable: Variable) -> Option<&[f64]> {
        self.values.iter().find(|(v, _)| *v == variable).map(|(_, x)| &x[..])
    }

    /// Values of an expression at every sample, with the values `constants` of its parameters.
    pub fn of(&self, expression: &Expression, constants: &[f64]) -> Vec<f64> {
        evaluate(expression, constants, self.pressure.len(), &|v| self.variable(v))
    }

    /// Factor of a form in `channel` at every sample: dynamic pressure times wing area (N), for moments also times span
    /// or chord (N m). It is 1 if the form does not scale with dynamic pressure.
    pub fn factor(&self, channel: Channel, of_air: bool) -> Vec<f64> {
        let length = match channel {
            Channel::Roll | Channel::Yaw => self.lengths[0],
            Channel::Pitch => self.lengths[1],
            _ => 1.0,
        };
        match of_air {
            true => self.pressure.iter().map(|q| q * length).collect(),
            false => vec![1.0; self.pressure.len()],
        }
    }

    /// Reduces `values` to one value for each sample. If the ends of integration steps follow the samples, the value is
    /// the mean of the start and the end of a step.
    pub fn merged(&self, mut values: Vec<f64>) -> Vec<f64> {
        if values.len() > self.count {
            let (start, end) = values.split_at_mut(self.count);
            start.iter_mut().zip(end).for_each(|(a, b)| *a = 0.5 * (*a + *b));
            values.truncate(self.count);
        }
        values
    }

    /// The windows of the cell (one channel of one flight) with the index `cell` in `round`, in order.
    pub fn windows<'a>(&self, round: &'a Round, cell: usize) -> Vec<Average<'a>> {
        let cell = &round.cells.list[cell];
        let flight = &round.flights[cell.flight].acting;
        let kernel = &flight.kernel;
        let weights = match (cell.channel >= 3, flight.sampling) {
            (true, Sampling::Held) => &kernel.step,
            _ => &kernel.sample,
        };
        let of = |w: &usize| {
            let window = &flight.windows[*w];
            Average { first: self.first[cell.flight][window.segment] + window.start, weights }
        };
        cell.windows.iter().map(of).collect()
    }

    /// Means of all variables, then of dynamic pressure times wing area, over each window of the flight with the index
    /// `flight`.
    pub fn means(&self, round: &Round, flight: usize) -> Vec<Vec<f64>> {
        let own = &round.flights[flight].acting;
        let of = |window: &Window| {
            let first = self.first[flight][window.segment] + window.start;
            let average = Average { first, weights: &own.kernel.sample };
            let variables = self.values.iter().map(|(_, x)| x);
            variables.chain([&self.pressure]).map(|x| average.of(x)).collect()
        };
        own.windows.iter().map(of).collect()
    }
}

fn moment(channel: Channel) -> bool {
    matches!(channel, Channel::Roll | Channel::Pitch | Channel::Yaw)
}

impl Average<'_> {
    /// The window's average of `values`, which has one entry for each sample.
    pub fn of(&self, values: &[f64]) -> f64 {
        let own = &values[self.first..];
        self.weights.iter().zip(own).map(|(w, x)| w * x).sum()
    }
}

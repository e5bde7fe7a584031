//! A flight in progress: measured values, and the predictions of models with the bands of their monitors.
//!
//! A monitor compares measured accelerations (the channels) with a model's predictions. A point is the mean over 0.1 s of
//! flight.

use std::collections::BTreeMap;

use serde::Serialize;

use greylag_flight::monitor::{Channel, Compared, Monitor};
use greylag_link::autopilot::RESIDUALS;
use greylag_link::vehicle::{Faults, Order, Telemetry, VANE_SD};
use greylag_logs::Sample;
use greylag_model::GreyBox;
use greylag_physics::{ActuatorState, State, Time};

/// Duration of a point, s.
const STEP_S: f64 = 0.1;
/// Largest number of points: ten minutes of flight.
const MOST: usize = 6000;

/// Values of one quantity at the points; `None` if there is no measurement.
type Column = Vec<Option<f32>>;

/// A flight or a part of it, as data for the plots of a page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Live {
    /// Time on the vehicle's clock, s.
    pub time_s: Vec<f64>,
    /// States and targets by name, in °, m/s and m; throttle 0..1.
    pub states: BTreeMap<&'static str, Column>,
    /// Measured channels: specific force (body x, y, z, m/s²), then angular acceleration (rad/s²).
    pub measured: [Column; 6],
    /// Predictions of the models for this part.
    pub models: Vec<Watched>,
    /// Warnings of the models' monitors.
    pub warnings: Vec<Warning>,
}

/// Predictions of one model, in the channels of [`Live::measured`].
#[derive(Clone, Debug, Default, Serialize)]
pub struct Watched {
    /// Name of the model.
    pub model: String,
    /// Predicted channels, in the units of [`Live::measured`].
    pub predicted: [Column; 6],
    /// Half width of the monitor's band (two standard deviations), in the units of [`Live::measured`].
    pub band: [Column; 6],
    /// The monitor's residual divided by the half width of its band, dimensionless. Values beyond ±1 are outside the band.
    pub share: [Column; 6],
}

/// A warning of a model's monitor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Warning {
    /// Time of the warning, s, on the vehicle's clock.
    pub time_s: f64,
    /// Index of the model in `Live::models`.
    pub model: usize,
    /// Index of the channel in [`Live::measured`].
    pub channel: usize,
    /// Text of the warning.
    pub text: String,
}

/// Names of the channels: in MAVLink, and for display.
pub fn channels() -> [[String; 2]; 6] {
    std::array::from_fn(|k| [RESIDUALS[k].to_owned(), Channel::ALL[k].to_string()])
}

/// Reads one value from a row.
type Get = fn(&Sample) -> f64;

/// States and targets of a row, in °, m/s and m; throttle 0..1.
const STATES: [(&str, Get); 9] = [
    ("V", |s| s.airspeed_mps),
    ("alpha", |s| s.alpha_rad.to_degrees()),
    ("beta", |s| s.beta_rad.to_degrees()),
    ("phi", |s| s.attitude_rad[0].to_degrees()),
    ("theta", |s| s.attitude_rad[1].to_degrees()),
    ("phi_target", |s| s.roll_target_rad.to_degrees()),
    ("theta_target", |s| s.pitch_target_rad.to_degrees()),
    ("h", |s| s.altitude_m),
    ("throttle", |s| s.throttle),
];

/// Compares a flight with the predictions of models, row by row.
pub struct Watcher {
    models: Vec<(String, Monitor)>,
    point: Option<Point>,
}

/// Mean of finite values.
#[derive(Clone, Copy, Debug, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn take(&mut self, x: f64) {
        if x.is_finite() {
            self.sum += x;
            self.count += 1.0;
        }
    }

    fn value(self) -> Option<f32> {
        (self.count > 0.0).then(|| (self.sum / self.count) as f32)
    }
}

/// A point that is not complete: further samples are added to it.
struct Point {
    place: i64,
    states: [Mean; STATES.len()],
    measured: [Mean; 6],
    /// Mean values by model and channel: prediction, half width of the band, and the residual divided by this half width.
    models: Vec<[[Mean; 3]; 6]>,
}

impl Watcher {
    /// A watcher with one monitor for each of `models`.
    pub fn new(models: &[GreyBox]) -> Watcher {
        let of = |model: &GreyBox| (model.name.clone(), Monitor::new(model.clone()));
        Watcher { models: models.iter().map(of).collect(), point: None }
    }

    /// Adds rows and returns the points that are now complete.
    pub fn take(&mut self, rows: &[Sample]) -> Live {
        let mut live = self.empty();
        for row in rows {
            let place = (row.time_s / STEP_S).floor() as i64;
            if self.point.as_ref().is_some_and(|point| point.place != place) {
                self.finish(&mut live);
            }
            let frame = frame(row);
            let mut point = self.point.take().unwrap_or_else(|| Point {
                place,
                states: Default::default(),
                measured: Default::default(),
                models: vec![Default::default(); self.models.len()],
            });
            point.states.iter_mut().zip(&STATES).for_each(|(mean, (_, get))| mean.take(get(row)));
            for (m, (_, monitor)) in self.models.iter_mut().enumerate() {
                if let Some(warning) = monitor.see(&frame) {
                    let channel = Channel::ALL.iter().position(|c| *c == warning.channel);
                    live.warnings.push(Warning {
                        time_s: row.time_s,
                        model: m,
                        channel: channel.unwrap_or_default(),
                        text: warning.to_string(),
                    });
                }
                point.take(m, monitor.channels(), monitor.shares());
            }
            self.point = Some(point);
        }
        live
    }

    /// Completes and returns the last point. It is called at the end of the flight.
    pub fn rest(&mut self) -> Live {
        let mut live = self.empty();
        self.finish(&mut live);
        live
    }

    fn empty(&self) -> Live {
        let watched =
            |(model, _): &(String, Monitor)| Watched { model: model.clone(), ..Watched::default() };
        Live { models: self.models.iter().map(watched).collect(), ..Live::default() }
    }

    fn finish(&mut self, live: &mut Live) {
        let Some(point) = self.point.take() else { return };
        live.time_s.push((point.place as f64 + 0.5) * STEP_S);
        for ((name, _), mean) in STATES.iter().zip(point.states) {
            live.states.entry(name).or_default().push(mean.value());
        }
        live.measured.iter_mut().zip(point.measured).for_each(|(c, mean)| c.push(mean.value()));
        for (watched, channels) in live.models.iter_mut().zip(point.models) {
            for (k, [predicted, band, share]) in channels.into_iter().enumerate() {
                watched.predicted[k].push(predicted.value());
                watched.band[k].push(band.value());
                watched.share[k].push(share.value());
            }
        }
    }
}

impl Point {
    fn take(&mut self, model: usize, channels: [Option<Compared>; 6], shares: [f64; 6]) {
        for (k, compared) in channels.into_iter().enumerate() {
            let Some(Compared { measured, predicted, band }) = compared else { continue };
            if model == 0 {
                self.measured[k].take(measured);
            }
            let values = [predicted, band, shares[k]];
            self.models[model][k].iter_mut().zip(values).for_each(|(mean, x)| mean.take(x));
        }
    }
}

impl Live {
    /// Appends a later part of the flight. Returns the number of oldest points that were removed to keep the largest number of
    /// points.
    pub fn append(&mut self, later: Live) -> usize {
        self.time_s.extend(later.time_s);
        for (name, column) in later.states {
            self.states.entry(name).or_default().extend(column);
        }
        self.measured.iter_mut().zip(later.measured).for_each(|(c, more)| c.extend(more));
        if self.models.is_empty() {
            self.models = later.models;
        } else {
            for (own, more) in self.models.iter_mut().zip(later.models) {
                own.columns().zip(more.into_columns()).for_each(|(c, more)| c.extend(more));
            }
        }
        self.warnings.extend(later.warnings);
        let old = self.time_s.len().saturating_sub(MOST);
        if old > 0 {
            self.time_s.drain(..old);
            let watched = self.models.iter_mut().flat_map(Watched::columns);
            let columns = self.states.values_mut().chain(&mut self.measured).chain(watched);
            columns.for_each(|column| drop(column.drain(..old)));
        }
        old
    }
}

impl Watched {
    fn columns(&mut self) -> impl Iterator<Item = &mut Column> {
        let Watched { predicted, band, share, .. } = self;
        predicted.iter_mut().chain(band).chain(share)
    }

    fn into_columns(self) -> impl Iterator<Item = Column> {
        let Watched { predicted, band, share, .. } = self;
        predicted.into_iter().chain(band).chain(share)
    }
}

/// Converts a row of the log for the monitor. A missing value becomes a fault of the frame. The monitor does not compare the
/// channels that a fault affects.
fn frame(row: &Sample) -> Telemetry {
    let [roll, pitch, yaw] = row.attitude_rad;
    let [p, q, r] = row.rates_radps;
    let state = State {
        roll,
        pitch,
        airspeed: row.airspeed_mps,
        p,
        q,
        r,
        alpha: row.alpha_rad,
        beta: row.beta_rad,
    };
    // the log of an aircraft without a rudder has no rudder deflection
    let rudder = if row.rudder_rad.is_nan() { 0.0 } else { row.rudder_rad };
    let actuators = ActuatorState {
        aileron: row.aileron_rad,
        elevator: row.elevator_rad,
        throttle: row.throttle,
        rudder,
        ..ActuatorState::default()
    };
    let known = [
        (Faults::ATTITUDE, roll + pitch),
        (Faults::RATES, p + q + r),
        (Faults::AIR, row.airspeed_mps + row.altitude_m),
        (Faults::INCIDENCE, row.alpha_rad + row.beta_rad),
        (Faults::SPECIFIC_FORCE, row.specific_force_mps2.iter().sum()),
        (Faults::ACTUATORS, row.aileron_rad + row.elevator_rad + row.throttle),
    ];
    let mut faults = Faults::NONE;
    for (fault, _) in known.into_iter().filter(|(_, sum): &(_, f64)| !sum.is_finite()) {
        faults.insert(fault);
    }
    Telemetry {
        time: Time::from_micros((row.time_s.max(0.0) * 1e6).round() as u64),
        order: Order::Next { lost: 0 },
        faults,
        state,
        incidence_sd: VANE_SD,
        yaw,
        rate_hold_s: row.rate_hold_s,
        specific_force: row.specific_force_mps2,
        actuators,
        altitude: row.altitude_m,
        position: [f64::NAN; 2],
        velocity: row.velocity_ned_mps,
        wind: [f64::NAN; 3],
    }
}

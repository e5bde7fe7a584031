//! A reconstructed flight: segments with uniform time steps, sensor errors removed.

use crate::flight_path::ActuatorClock;
use crate::flight_path::installation::Estimate;
use greylag_logs::rudder::RudderMotion;
use greylag_logs::{Flight, Sample, Sampling};
use greylag_physics::sensors::Known;
use greylag_physics::{Command, Controls, State};

/// One instant of a reconstructed flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time on the log's clock, s.
    pub time_s: f64,
    /// Flight state without the estimated sensor errors.
    pub state: State,
    /// Heading ψ, rad; NaN if the log has none.
    pub yaw: f64,
    /// The resampled deflections (rad) and throttle position (0..1), before the input effects of a model.
    pub controls: Controls,
    /// The command; `None` if the log has no commands.
    pub command: Option<Command>,
    /// Specific force at the centre of gravity without biases, body axes, m/s². NaN if neither accelerometers nor the velocity
    /// over ground are logged.
    pub specific_force: [f64; 3],
    /// Altitude above mean sea level, m; 0 if it is not logged.
    pub altitude: f64,
    /// Density of the air, kg/m³.
    pub density: f64,
}

/// A stretch of flight without gaps, equally spaced in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The samples, [`Reconstruction::step_s`] apart.
    pub instants: Vec<Instant>,
}

/// A sensor error or a component of the wind that the reconstruction has estimated.
///
/// The wind is the steady part, without gusts. Its standard deviation includes the difference from the mean wind of the
/// flight. The velocity relative to the air at an instant includes the gust.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisance {
    /// Name, for example `gyro_bias_p`, `alpha_bias`, `airspeed_scale`, `wind_north`.
    pub name: String,
    /// Estimate, in `unit`.
    pub value: f64,
    /// Standard deviation, in `unit`.
    pub sd: f64,
    /// Unit of the values, for example `rad/s`.
    pub unit: &'static str,
    /// Prior mean and standard deviation, in `unit`; `None` if the quantity was not estimated together with the path.
    pub prior: Option<Known>,
}

impl Nuisance {
    /// Difference between estimate and prior mean in prior standard deviations; 0 without a prior.
    pub fn moved(&self) -> f64 {
        self.prior.filter(|p| p.sd > 0.0).map_or(0.0, |p| (self.value - p.value) / p.sd)
    }
}

/// A reconstructed flight with its estimated constants (sensor errors, wind) and noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Name of the flight in reports, from its file.
    pub name: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// Whether body rates and deflections are held from one sample to the next, or are samples of continuous signals.
    pub sampling: Sampling,
    /// Time base of the deflections in `segments`.
    pub clock: ActuatorClock,
    /// Stretches of the flight without gaps.
    pub segments: Vec<Segment>,
    /// Estimated sensor errors, wind, actuator delay and, without vanes, uncertainties of α and β.
    pub nuisances: Vec<Nuisance>,
    /// Estimates of the constants of the installation from this flight alone. Constants that the flight hardly determines, that gusts
    /// bias or that are stated beforehand have no entry.
    pub installation: Vec<Estimate>,
    /// Standard deviations of the measurement noise as logged, before smoothing, in the order roll, pitch, airspeed,
    /// p, q, r, alpha, beta (units of [`State`]).
    pub noise: [f64; 8],
    /// Standard deviations of the remaining errors in the states of [`Self::segments`], in the order and units of
    /// `Self::noise`.
    ///
    /// Body rates are measured rates less biases and are not smoothed. The errors of the other states vary over tenths of
    /// seconds. Constant errors are not included; [`Self::nuisances`] contains their standard deviations.
    pub left: [f64; 8],
    /// Standard deviations of the specific force's noise in body axes x, y, z, m/s².
    pub force_noise: [f64; 3],
    /// Standard deviation of the change of a gust component from one sample to the next, m/s; 0 if the path has no gusts.
    pub gust_step: f64,
    /// Motion of the rudder, if it moves.
    pub rudder: Option<RudderMotion>,
    /// Notes on assumptions and on lost accuracy, for example without a vane.
    pub notes: Vec<String>,
}

#[cfg(test)]
impl Reconstruction {
    /// A reconstruction at 100 Hz without segments, for tests.
    pub(crate) fn empty(name: &str) -> Reconstruction {
        Reconstruction {
            name: name.into(),
            step_s: 0.01,
            sampling: Sampling::Held,
            clock: ActuatorClock::AsRecorded,
            segments: Vec::new(),
            nuisances: Vec::new(),
            installation: Vec::new(),
            noise: [0.0; 8],
            left: [0.0; 8],
            force_noise: [0.0; 3],
            gust_step: 0.0,
            rudder: None,
            notes: Vec::new(),
        }
    }
}

impl Reconstruction {
    /// Standard deviation of the constant `name`, in its unit; `None` if the constant was not estimated.
    ///
    /// Without a vane, the value for `alpha_bias` or `beta_bias` is the standard deviation of α or β, rad.
    pub fn deviation(&self, name: &str) -> Option<f64> {
        let angle = match name {
            "alpha_bias" => "alpha_path",
            "beta_bias" => "beta_path",
            _ => name,
        };
        let found = self.nuisances.iter().find(|n| n.name == name || n.name == angle)?;
        Some(found.sd).filter(|sd| sd.is_finite())
    }

    /// The flight as a log: reconstructed states and specific force, altitude, air density, deflections and commands. Rudder
    /// deflection and command are NaN if the rudder does not move.
    pub fn to_flight(&self) -> Flight {
        let rate_hold_s = if self.sampling == Sampling::Held { self.step_s } else { 0.0 };
        let of_rudder = |x: f64| if self.rudder.is_some() { x } else { f64::NAN };
        let sample = |i: &Instant| {
            let (s, z) = (&i.state, &i.controls);
            let command = i.command.unwrap_or(Command {
                aileron: f64::NAN,
                elevator: f64::NAN,
                throttle: f64::NAN,
                rudder: f64::NAN,
            });
            Sample {
                time_s: i.time_s,
                attitude_rad: [s.roll, s.pitch, i.yaw],
                rates_radps: [s.p, s.q, s.r],
                airspeed_mps: s.airspeed,
                alpha_rad: s.alpha,
                beta_rad: s.beta,
                specific_force_mps2: i.specific_force,
                altitude_m: i.altitude,
                air_density_kgpm3: i.density,
                aileron_rad: z.aileron,
                elevator_rad: z.elevator,
                throttle: z.throttle,
                rudder_rad: of_rudder(z.rudder),
                aileron_cmd: command.aileron,
                elevator_cmd: command.elevator,
                throttle_cmd: command.throttle,
                rudder_cmd: of_rudder(command.rudder),
                rate_hold_s,
                ..Sample::default()
            }
        };
        let samples = self.segments.iter().flat_map(|s| &s.instants).map(sample).collect();
        Flight { name: self.name.clone(), samples, ..Flight::default() }
    }
}

//! A reconstructed flight: one clock, sensor errors removed, no gaps within a segment.

use greylag_logs::rudder::RudderMotion;
use greylag_logs::{Flight, Sample, Sampling};
use greylag_physics::sensors::Known;
use greylag_physics::{Command, Controls, State};

/// One instant of a reconstructed flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// Time on the log's clock, s.
    pub time_s: f64,
    /// Flight state, sensor errors removed.
    pub state: State,
    /// Heading ψ, rad; NaN if the log has none.
    pub yaw: f64,
    /// The recorded deflections and throttle position, resampled, before the model's own effects on inputs.
    pub controls: Controls,
    /// The command, where the log has one.
    pub command: Option<Command>,
    /// Specific force at the centre of gravity, biases removed, body axes, m/s²; NaN if not logged.
    pub specific_force: [f64; 3],
    /// Altitude above mean sea level, m.
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

/// A sensor error or a component of the wind, as estimated together with the path.
///
/// The wind is the steady part, without gusts. Its standard deviation covers the difference to the mean wind of the flight.
/// The velocity through the air at an instant includes the gust.
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
    /// Prior mean and standard deviation; `None` if it was not estimated along with the path.
    pub prior: Option<Known>,
}

impl Nuisance {
    /// Change from the prior mean in prior standard deviations; zero without a prior.
    pub fn moved(&self) -> f64 {
        self.prior.filter(|p| p.sd > 0.0).map_or(0.0, |p| (self.value - p.value) / p.sd)
    }
}

/// A reconstructed flight with its estimated constants and noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Reconstruction {
    /// Name of the flight in reports, from its file.
    pub name: String,
    /// Time between samples, s.
    pub step_s: f64,
    /// Whether body rates and deflections are constant from one sample to the next, or samples of continuous signals.
    pub sampling: Sampling,
    /// Stretches of the flight without gaps.
    pub segments: Vec<Segment>,
    /// Sensor errors and wind estimated along with the path.
    pub nuisances: Vec<Nuisance>,
    /// Standard deviations of the measurement noise as logged, before smoothing, in the order roll, pitch, airspeed,
    /// p, q, r, alpha, beta (units of [`State`]).
    pub noise: [f64; 8],
    /// Standard deviations of the remaining errors in the states of [`Self::segments`], in the same order. Body rates are
    /// measured rates less their biases, not smoothed; the errors of the other states vary over tenths of seconds. Constant
    /// errors are not included: [`Self::nuisances`] has them.
    pub left: [f64; 8],
    /// Standard deviation of the accelerometers' noise, m/s².
    pub force_noise: [f64; 3],
    /// Motion of the rudder, if it moves.
    pub rudder: Option<RudderMotion>,
    /// Notes for the reader: assumptions made, and lost accuracy, for example without a vane.
    pub notes: Vec<String>,
}

impl Reconstruction {
    /// Standard deviation of the constant `name`, in its unit; without a vane that of `alpha_bias` is the uncertainty
    /// of α, and likewise for β. `None` if it was not estimated.
    pub fn deviation(&self, name: &str) -> Option<f64> {
        let angle = match name {
            "alpha_bias" => "alpha_path",
            "beta_bias" => "beta_path",
            _ => name,
        };
        let found = self.nuisances.iter().find(|n| n.name == name || n.name == angle)?;
        Some(found.sd).filter(|sd| sd.is_finite())
    }

    /// The flight as a log: reconstructed states and specific force, altitude, air density, deflections and commands; those of the
    /// rudder if it moves.
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

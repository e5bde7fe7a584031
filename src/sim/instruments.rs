//! Sensor model, which converts a simulated flight to a log with sensor errors.

use std::f64::consts::TAU;

use greylag_sitl::plant::{DT_S, Truth};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::flight_test::Flown;
use greylag_logs::{Flight, Sample};
use greylag_num::stream::{Stream, stream};

/// Ids of the random streams.
const DRAW: u64 = 70;
const NOISE: u64 = 71;

/// A group of sensors with a common delay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Attitude as Euler angles.
    Attitude,
    /// Rate gyros, whose sample times are the times of the log.
    Gyros,
    /// Accelerometer triad.
    Accelerometers,
    /// True airspeed sensor.
    Airspeed,
    /// Vanes of angle of attack and sideslip.
    Vanes,
    /// Velocity over ground, NED.
    Velocity,
    /// Positions of surfaces and throttle.
    Actuators,
}

impl Group {
    /// Number of sensor groups.
    pub const COUNT: usize = 7;
}

/// Sensor errors of one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruments {
    /// Biases of the gyros, rad/s.
    pub gyro_bias: [f64; 3],
    /// Biases of the accelerometers, m/s².
    pub force_bias: [f64; 3],
    /// Ratio of measured to true airspeed.
    pub airspeed_scale: f64,
    /// Bias of α, rad.
    pub alpha_bias: f64,
    /// Bias of β, rad.
    pub beta_bias: f64,
    /// Delay of each [`Group`], s, 0 to 0.01.
    pub late: [f64; Group::COUNT],
    /// Standard deviation of each group's white noise: rad, rad/s, m/s², m/s, rad, m/s; 0 for the actuators.
    pub noise: [f64; Group::COUNT],
    /// Standard deviation of the altitude noise, m.
    pub altitude_noise: f64,
}

impl Instruments {
    /// Ideal instruments without errors.
    pub const PERFECT: Instruments = Instruments {
        gyro_bias: [0.0; 3],
        force_bias: [0.0; 3],
        airspeed_scale: 1.0,
        alpha_bias: 0.0,
        beta_bias: 0.0,
        late: [0.0; Group::COUNT],
        noise: [0.0; Group::COUNT],
        altitude_noise: 0.0,
    };

    /// White noise of a small autopilot with its motor running: 0.2° attitude, 0.3°/s, 0.1 m/s²,
    /// 0.3 m/s airspeed, 0.3° vanes, 0.1 m/s velocity, 0.5 m altitude.
    pub const NOISY: Instruments = Instruments {
        noise: [0.0035, 0.005, 0.1, 0.3, 0.005, 0.1, 0.0],
        altitude_noise: 0.5,
        ..Instruments::PERFECT
    };

    /// A small autopilot's instruments drawn from `seed`, with the noise of [`Self::NOISY`]. The standard deviations of
    /// the biases are 0.005 rad/s, 0.1 m/s², 0.5° of α, 0.4° of β and 2 % of airspeed. Biases are limited to two
    /// standard deviations. Every group except the gyros is delayed by up to one sample (10 ms).
    pub fn drawn(seed: u64) -> Instruments {
        let mut random = stream(seed, &[DRAW]);
        let mut bias = |sd: f64| {
            let unit: f64 = StandardNormal.sample(&mut random);
            sd * unit.clamp(-2.0, 2.0)
        };
        let gyro_bias = [bias(0.005), bias(0.005), bias(0.005)];
        let force_bias = [bias(0.1), bias(0.1), bias(0.1)];
        let (scale, alpha, beta) = (bias(0.02), bias(0.5), bias(0.4));
        let mut late = [0.0; Group::COUNT].map(|_: f64| random.random_range(0.0..DT_S));
        late[Group::Gyros as usize] = 0.0;
        Instruments {
            gyro_bias,
            force_bias,
            airspeed_scale: 1.0 + scale,
            alpha_bias: alpha.to_radians(),
            beta_bias: beta.to_radians(),
            late,
            ..Instruments::NOISY
        }
    }

    /// The log of `flown` with these instruments, named `name`. The noise is drawn from `seed`.
    pub fn log(&self, flown: &Flown, name: &str, seed: u64) -> Flight {
        let mut random = stream(seed, &[NOISE]);
        let mut samples: Vec<Sample> =
            (0..flown.truth.len()).map(|k| self.row(flown, k, &mut random)).collect();
        // the log has a rudder column only if the rudder is deflected
        if flown.truth.iter().any(|t| t.rudder_rad != 0.0) {
            samples.iter_mut().enumerate().for_each(|(k, sample)| self.rudder(flown, k, sample));
        }
        Flight { name: name.into(), ..Flight::from(samples) }
    }

    fn rudder(&self, flown: &Flown, k: usize, sample: &mut Sample) {
        let (now, before) =
            (flown.truth[k].rudder_rad, flown.truth[k.saturating_sub(1)].rudder_rad);
        let late = self.late[Group::Actuators as usize] / DT_S;
        sample.rudder_rad = now + late * (before - now);
        sample.rudder_cmd = flown.commands[k].rudder;
    }

    fn row(&self, flown: &Flown, k: usize, random: &mut Stream) -> Sample {
        let (now, before) = (&flown.truth[k], &flown.truth[k.saturating_sub(1)]);
        let late = |group: Group, get: &dyn Fn(&Truth) -> f64| {
            get(now) + self.late[group as usize] / DT_S * (get(before) - get(now))
        };
        // the angle is unwrapped to within half a turn of the present angle, to avoid interpolation across ±π
        let turn = |get: &dyn Fn(&Truth) -> f64| {
            late(Group::Attitude, &|t| get(t) - TAU * ((get(t) - get(now)) / TAU).round())
        };
        let mut noise = |sd: f64| {
            let unit: f64 = StandardNormal.sample(random);
            sd * unit
        };
        let mut draw = |group: Group| noise(self.noise[group as usize]);
        use Group::{Accelerometers, Actuators, Airspeed, Attitude, Gyros, Vanes, Velocity};
        let wrap = |x: f64| x - TAU * (x / TAU).round();
        let rates: [fn(&Truth) -> f64; 3] = [|t| t.p_radps, |t| t.q_radps, |t| t.r_radps];
        let command = flown.commands[k];
        Sample {
            time_s: k as f64 * DT_S,
            rate_hold_s: DT_S,
            attitude_rad: [
                turn(&|t| t.roll_rad) + draw(Attitude),
                turn(&|t| t.pitch_rad) + draw(Attitude),
                wrap(turn(&|t| t.yaw_rad) + draw(Attitude)),
            ],
            rates_radps: [0, 1, 2]
                .map(|i| late(Gyros, &rates[i]) + self.gyro_bias[i] + draw(Gyros)),
            specific_force_mps2: [0, 1, 2].map(|i| {
                late(Accelerometers, &|t| t.specific_force_mps2[i])
                    + self.force_bias[i]
                    + draw(Accelerometers)
            }),
            airspeed_mps: late(Airspeed, &|t| t.airspeed_mps) * self.airspeed_scale
                + draw(Airspeed),
            alpha_rad: late(Vanes, &|t| t.alpha_rad) + self.alpha_bias + draw(Vanes),
            beta_rad: late(Vanes, &|t| t.beta_rad) + self.beta_bias + draw(Vanes),
            velocity_ned_mps: [0, 1, 2]
                .map(|i| late(Velocity, &|t| t.velocity_ned_mps[i]) + draw(Velocity)),
            aileron_rad: late(Actuators, &|t| t.aileron_rad),
            elevator_rad: late(Actuators, &|t| t.elevator_rad),
            throttle: late(Actuators, &|t| t.throttle),
            aileron_cmd: command.aileron,
            elevator_cmd: command.elevator,
            throttle_cmd: command.throttle,
            altitude_m: now.altitude_m + noise(self.altitude_noise),
            ..Sample::default()
        }
    }
}

//! Options of a run of the shim.

use std::path::PathBuf;

use super::ardupilot_sim::ArdupilotOptions;
use super::controller::Personality;
use super::error::ShimError;
use super::link::{Address, Transport};
use super::px4_sim::Px4Options;
use crate::plant::{PlantOptions, Start};

/// Clock that paces the run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// The wall clock: one frame every 10 ms, independent of the companion.
    RealTime,
    /// The companion: each step waits for its answer.
    Lockstep,
}

/// When the aircraft begins to fly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Launch {
    /// At the first armed answer; until then the aircraft stays at its start while time advances.
    WhenArmed,
    /// In the first frame, without waiting for an armed answer.
    Immediate,
}

/// Treatment of an existing truth file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Keep the file and refuse to start.
    Keep,
    /// Overwrite the file.
    Replace,
}

/// Output file for the plant's truth.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TruthFile {
    /// A CSV file in the columns of the flight-log format.
    pub path: PathBuf,
    /// Treatment of an existing file.
    pub existing: Existing,
}

/// Standard deviations of white sensor noise; each frame draws new values.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Noise {
    /// Rate gyros, each axis, rad/s.
    pub gyro_radps: f64,
    /// Accelerometers, each axis, m/s².
    pub accelerometer_mps2: f64,
    /// Attitude, each Euler angle, rad.
    pub attitude_rad: f64,
    /// True airspeed, m/s.
    pub airspeed_mps: f64,
    /// Angle-of-attack and sideslip vanes, rad.
    pub vane_rad: f64,
    /// Altitude (barometric and fused), m.
    pub altitude_m: f64,
}

impl Noise {
    /// Sensors without noise.
    pub const NONE: Noise = Noise {
        gyro_radps: 0.0,
        accelerometer_mps2: 0.0,
        attitude_rad: 0.0,
        airspeed_mps: 0.0,
        vane_rad: 0.0,
        altitude_m: 0.0,
    };

    /// Typical noise of a small autopilot in flight with its motor running: 0.3 °/s, 0.3 m/s², 0.2°, 0.3 m/s, 0.3°, 0.2 m. The
    /// values are assumptions, not measurements of a product.
    pub const REALISTIC: Noise = Noise {
        gyro_radps: 0.0052,
        accelerometer_mps2: 0.3,
        attitude_rad: 0.0035,
        airspeed_mps: 0.3,
        vane_rad: 0.0052,
        altitude_m: 0.2,
    };

    fn values(&self) -> [f64; 6] {
        [
            self.gyro_radps,
            self.accelerometer_mps2,
            self.attitude_rad,
            self.airspeed_mps,
            self.vane_rad,
            self.altitude_m,
        ]
    }
}

/// Constant (bias) and scale errors of the sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bias {
    /// Added to p, q, r, rad/s.
    pub gyro_radps: [f64; 3],
    /// Added to the specific force, body axes, m/s².
    pub accelerometer_mps2: [f64; 3],
    /// Added to roll, pitch and yaw, rad, as by misalignment or a compass error.
    pub attitude_rad: [f64; 3],
    /// Added to the angle of attack, rad.
    pub alpha_rad: f64,
    /// Added to the sideslip, rad.
    pub beta_rad: f64,
    /// Ratio of the measured to the true airspeed; 1 is no error.
    pub airspeed_scale: f64,
}

impl Default for Bias {
    fn default() -> Self {
        Bias {
            gyro_radps: [0.0; 3],
            accelerometer_mps2: [0.0; 3],
            attitude_rad: [0.0; 3],
            alpha_rad: 0.0,
            beta_rad: 0.0,
            airspeed_scale: 1.0,
        }
    }
}

/// Faults in the transmission of state frames.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct FrameFaults {
    /// Constant delay of every frame, ms. In lockstep, which has only simulated time, the delay is rounded up to whole steps, and
    /// the plant runs ahead of the frames.
    pub delay_ms: f64,
    /// Probability that a frame is lost, 0 to below 1.
    pub drop_probability: f64,
    /// Upper limit of an additional delay of each frame, which is uniformly distributed from 0, ms of wall time.
    pub jitter_ms: f64,
    /// Probability that a frame is delayed by a further `late_ms`, 0..1.
    pub late_probability: f64,
    /// Delay of a frame that is drawn with `late_probability`, ms of wall time.
    pub late_ms: f64,
}

/// Options of a run of the shim.
#[derive(Clone, Debug)]
pub struct ShimOptions {
    /// Address of the link to the companion, or to the flight stack for which the shim is the simulator.
    pub link: Address,
    /// Clock that paces the run.
    pub pace: Pace,
    /// When the aircraft begins to fly.
    pub launch: Launch,
    /// Simulated flight time after which the run ends, s; time at the start before launch does not count. `None` for no limit.
    pub duration_s: Option<f64>,
    /// The state at the start.
    pub start: Start,
    /// The aircraft, its air and its hidden effects.
    pub plant: PlantOptions,
    /// Seed of sensor noise and frame faults.
    pub seed: u64,
    /// Output file for the truth; `None` for no file.
    pub truth: Option<TruthFile>,
    /// Standard deviations of the white sensor noise.
    pub noise: Noise,
    /// Constant and scale errors of the sensors.
    pub bias: Bias,
    /// Faults of the transmission of state frames.
    pub faults: FrameFaults,
    /// Flight stack to simulate; `None` uses the profile `sitl`.
    pub personality: Option<Personality>,
    /// Parameters of the simulated stack that differ from its defaults.
    pub parameters: Vec<(String, f64)>,
    /// Parameters of the parameter file that the simulated stack does not have; they are printed and have no effect.
    pub unplayed: Vec<String>,
    /// Options for a run as the simulator of PX4 SITL; `None` for a run with a companion.
    pub px4: Option<Px4Options>,
    /// Options for a run as the simulator of ArduPilot SITL; `None` for a run with a companion.
    pub ardupilot: Option<ArdupilotOptions>,
    /// Initial value of the vehicle's clock, s. A value just below a counter's overflow tests the overflow in flight.
    pub clock_start_s: f64,
}

impl ShimOptions {
    /// The address at which the companion listens by default.
    pub fn default_link() -> Address {
        Address { transport: Transport::UdpOut, endpoint: "127.0.0.1:14600".to_owned() }
    }

    /// Options for a run in real time with perfect sensors over [`ShimOptions::default_link`]. The aircraft is held at
    /// its start until the companion is armed.
    pub fn new(plant: PlantOptions, start: Start) -> Self {
        ShimOptions {
            link: Self::default_link(),
            pace: Pace::RealTime,
            launch: Launch::WhenArmed,
            duration_s: None,
            start,
            plant,
            seed: 0,
            truth: None,
            noise: Noise::NONE,
            bias: Bias::default(),
            faults: FrameFaults::default(),
            personality: None,
            parameters: Vec::new(),
            unplayed: Vec::new(),
            px4: None,
            ardupilot: None,
            clock_start_s: 0.0,
        }
    }

    /// Checks the options before anything is opened.
    pub(super) fn check(&self) -> Result<(), ShimError> {
        let faults = &self.faults;
        let mut errors = self.noise.values().to_vec();
        errors.extend([faults.delay_ms, faults.jitter_ms, faults.late_ms]);
        demand(
            errors.iter().all(|x| x.is_finite() && *x >= 0.0),
            "noise and delays must be 0 or more",
        )?;
        demand(
            [faults.delay_ms, faults.jitter_ms, faults.late_ms].iter().all(|&x| x <= 60_000.0),
            "a delay may be 60000 ms at most",
        )?;
        demand(
            (0.0..1.0).contains(&faults.drop_probability),
            "the drop probability must be 0 or more and below 1",
        )?;
        demand(
            (0.0..=1.0).contains(&faults.late_probability),
            "the probability of a late frame must lie in 0..1",
        )?;
        self.check_simulators()?;
        demand(
            self.personality.is_none() || self.pace == Pace::RealTime,
            "a personality flies in real time, as the flight controller that it simulates does",
        )?;
        demand(
            self.personality.is_none() || self.frames_are_spared(),
            "a personality sends its messages on time: leave --delay-ms, --drop, --jitter-ms and --late out",
        )?;
        // The upper limit is about ten thousand years, whose microseconds fit into 64 bits.
        demand(
            (0.0..=3.2e11).contains(&self.clock_start_s),
            "the clock must start at 0 s or later, and at 3.2e11 s at the latest",
        )?;
        let bias = &self.bias;
        let mut biases = vec![bias.alpha_rad, bias.beta_rad, bias.airspeed_scale];
        biases.extend([bias.gyro_radps, bias.accelerometer_mps2, bias.attitude_rad].concat());
        demand(biases.iter().all(|x| x.is_finite()), "a bias must be a finite number")?;
        demand(bias.airspeed_scale > 0.0, "the airspeed scale must be positive")?;
        demand(
            self.duration_s.is_none_or(|s| s.is_finite() && s > 0.0),
            "the duration must be positive",
        )?;
        let start = &self.start;
        let state = [
            start.roll_rad,
            start.pitch_rad,
            start.yaw_rad,
            start.airspeed_mps,
            start.alpha_rad,
            start.beta_rad,
            start.p_radps,
            start.q_radps,
            start.r_radps,
            start.altitude_m,
        ];
        demand(state.iter().all(|x| x.is_finite()), "the start must be made of finite numbers")?;
        demand(start.airspeed_mps > 0.0, "the airspeed at the start must be positive")?;
        demand(start.altitude_m > 0.0, "the altitude at the start must be positive")
    }

    /// Checks that the simulator interfaces of PX4 and ArduPilot support the options.
    fn check_simulators(&self) -> Result<(), ShimError> {
        demand(
            self.clock_start_s == 0.0 || (self.px4.is_none() && self.ardupilot.is_none()),
            "PX4 and ArduPilot have clocks of their own: leave --clock-start-s out",
        )?;
        if let Some(px4) = &self.px4 {
            demand(
                self.link.transport == Transport::TcpIn,
                "PX4 connects to its simulator by TCP: listen with tcpin:HOST:PORT",
            )?;
            demand(
                self.personality.is_none(),
                "PX4 itself flies through its simulator API: leave --personality out",
            )?;
            demand(
                self.frames_are_spared() && self.noise == Noise::NONE,
                "the PX4 simulator API sends every message, with noise of its own (--px4-noise)",
            )?;
            demand(
                self.bias.attitude_rad == [0.0; 3]
                    && [self.bias.alpha_rad, self.bias.beta_rad] == [0.0; 2],
                "PX4 gets no attitude and no flow angles at its simulator API: leave their biases out",
            )?;
            demand(
                px4.outputs.highest() <= 16,
                "PX4 has outputs 1 to 16 at its simulator API (--px4-outputs)",
            )?;
        }
        if self.ardupilot.is_some() {
            demand(
                self.link.transport == Transport::UdpIn,
                "ArduPilot sends its servo packets by UDP: listen with udpin:HOST:PORT",
            )?;
            demand(
                self.personality.is_none() && self.px4.is_none(),
                "ArduPilot itself flies through its JSON interface: leave --personality and --px4-sim out",
            )?;
            demand(
                self.frames_are_spared()
                    && self.noise == Noise::NONE
                    && self.bias == Bias::default(),
                "ArduPilot makes the errors of its sensors itself: set its parameters SIM_* instead",
            )?;
        }
        Ok(())
    }

    /// Whether the options set no frame faults.
    fn frames_are_spared(&self) -> bool {
        let FrameFaults { delay_ms, drop_probability, jitter_ms, late_probability, .. } =
            self.faults;
        [delay_ms, drop_probability, jitter_ms, late_probability].iter().all(|&x| x == 0.0)
    }
}

fn demand(holds: bool, rule: &'static str) -> Result<(), ShimError> {
    if holds { Ok(()) } else { Err(ShimError::Option { rule }) }
}

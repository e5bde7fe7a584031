//! Command-line options for sensor errors and faults of state frames.

use clap::{Args, ValueEnum};

use crate::plant_arguments::Numbers;
use crate::shim::{Bias, FrameFaults, Noise};

/// A preset of sensor noise.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Preset {
    /// Sensors without noise.
    None,
    /// Typical noise of a small autopilot with the motor running.
    Realistic,
}

/// Options for sensor noise and constant sensor errors.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Sensors (standard deviations replace those of the preset)")]
pub struct SensorArgs {
    /// Preset of white noise.
    #[arg(long, value_name = "PRESET", default_value = "none")]
    noise: Preset,
    /// White noise of the rate gyros, each axis.
    #[arg(long, value_name = "RADPS")]
    noise_gyro_radps: Option<f64>,
    /// White noise of the accelerometers, each axis.
    #[arg(long, value_name = "MPS2")]
    noise_accelerometer_mps2: Option<f64>,
    /// White noise of roll, pitch and yaw.
    #[arg(long, value_name = "DEG")]
    noise_attitude_deg: Option<f64>,
    /// White noise of the true airspeed.
    #[arg(long, value_name = "MPS")]
    noise_airspeed_mps: Option<f64>,
    /// White noise of angle of attack and sideslip.
    #[arg(long, value_name = "DEG")]
    noise_vane_deg: Option<f64>,
    /// White noise of the altitude.
    #[arg(long, value_name = "M")]
    noise_altitude_m: Option<f64>,
    /// Constant error of the rate gyros.
    #[arg(long, value_name = "P,Q,R", default_value = "0,0,0", allow_hyphen_values = true)]
    bias_gyro_radps: Numbers<3>,
    /// Constant error of the accelerometers.
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    bias_accelerometer_mps2: Numbers<3>,
    /// Constant error of roll, pitch and yaw.
    #[arg(long, value_name = "R,P,Y", default_value = "0,0,0", allow_hyphen_values = true)]
    bias_attitude_deg: Numbers<3>,
    /// Constant error of the angle of attack.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    bias_alpha_deg: f64,
    /// Constant error of the sideslip.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    bias_beta_deg: f64,
    /// Ratio of measured to true airspeed.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    airspeed_scale: f64,
}

/// Options for faults of state frames.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Frames")]
pub struct FaultArgs {
    /// Constant delay of every state frame (in lockstep rounded up to whole 10 ms).
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    delay_ms: f64,
    /// A state frame is lost with this probability.
    #[arg(long, value_name = "0..1", default_value_t = 0.0)]
    drop: f64,
    /// Additional delay of each state frame, uniform in 0..MS of wall time.
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    jitter_ms: f64,
    /// A state frame comes late by --late-ms with this probability.
    #[arg(long, value_name = "0..1", default_value_t = 0.0)]
    late: f64,
    /// Delay of the frames that --late selects, in wall time.
    #[arg(long, value_name = "MS", default_value_t = 30.0)]
    late_ms: f64,
}

impl SensorArgs {
    /// White noise of the preset, with the standard deviations that the options replace.
    pub fn noise(&self) -> Noise {
        let preset = match self.noise {
            Preset::None => Noise::NONE,
            Preset::Realistic => Noise::REALISTIC,
        };
        let radians = |degrees: Option<f64>| degrees.map(f64::to_radians);
        Noise {
            gyro_radps: self.noise_gyro_radps.unwrap_or(preset.gyro_radps),
            accelerometer_mps2: self.noise_accelerometer_mps2.unwrap_or(preset.accelerometer_mps2),
            attitude_rad: radians(self.noise_attitude_deg).unwrap_or(preset.attitude_rad),
            airspeed_mps: self.noise_airspeed_mps.unwrap_or(preset.airspeed_mps),
            vane_rad: radians(self.noise_vane_deg).unwrap_or(preset.vane_rad),
            altitude_m: self.noise_altitude_m.unwrap_or(preset.altitude_m),
        }
    }

    /// The constant sensor errors, in SI units and radians.
    pub fn bias(&self) -> Bias {
        Bias {
            gyro_radps: self.bias_gyro_radps.0,
            accelerometer_mps2: self.bias_accelerometer_mps2.0,
            attitude_rad: self.bias_attitude_deg.0.map(f64::to_radians),
            alpha_rad: self.bias_alpha_deg.to_radians(),
            beta_rad: self.bias_beta_deg.to_radians(),
            airspeed_scale: self.airspeed_scale,
        }
    }
}

impl FaultArgs {
    /// The faults of state frames that the options describe.
    pub fn rule(&self) -> FrameFaults {
        FrameFaults {
            delay_ms: self.delay_ms,
            drop_probability: self.drop,
            jitter_ms: self.jitter_ms,
            late_probability: self.late,
            late_ms: self.late_ms,
        }
    }
}

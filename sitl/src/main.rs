//! The program `greylag-sitl`: a flight controller with an aircraft, played to a companion.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use clap::{Args, Parser, ValueEnum};
use greylag_sitl::air::{Air, Gust, Turbulence};
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{
    self, Address, Bias, Existing, FrameFaults, Launch, Noise, Pace, ShimOptions, TruthFile,
};

/// Flies an aircraft in JSBSim and plays its flight controller over MAVLink.
///
/// Without options: real time, held at the start until the companion arms, sending to
/// udpout:127.0.0.1:14600, where `cargo fly` listens.
#[derive(Debug, Parser)]
#[command(name = "greylag-sitl", version)]
struct Cli {
    /// Where the companion is met: udpin:, udpout:, tcpin: or tcpout:, then HOST:PORT.
    #[arg(long, value_name = "ADDRESS", default_value_t = ShimOptions::default_link())]
    link: Address,
    /// Step on the companion's answers alone, as fast as they come, instead of in real time.
    #[arg(long)]
    lockstep: bool,
    /// Fly at once instead of holding at the start until the first armed answer.
    #[arg(long)]
    no_hold: bool,
    /// End after so much simulated flight; the time held at the start does not count.
    #[arg(long, value_name = "S")]
    duration_s: Option<f64>,
    /// Seed of noise, frame faults and turbulence; equal seeds give equal flights in lockstep.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Write the truth to this CSV file, in the columns of the flight-log format.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Write over an existing truth file.
    #[arg(long, requires = "truth")]
    force: bool,
    #[command(flatten)]
    aircraft: AircraftArgs,
    #[command(flatten)]
    start: StartArgs,
    #[command(flatten)]
    air: AirArgs,
    #[command(flatten)]
    sensors: SensorArgs,
    #[command(flatten)]
    faults: FaultArgs,
}

/// Which aircraft.
#[derive(Debug, Args)]
#[command(next_help_heading = "Aircraft")]
struct AircraftArgs {
    /// Folder that holds NAME/NAME.xml; without it the X8 built into the program flies.
    #[arg(long, value_name = "DIR", requires = "aircraft")]
    aircraft_dir: Option<PathBuf>,
    /// Name of the aircraft.
    #[arg(long, value_name = "NAME")]
    aircraft: Option<String>,
    /// Hide an effect in the aircraft (may be repeated).
    #[arg(long, value_name = "ID=AMPLITUDE", allow_hyphen_values = true)]
    hide: Vec<String>,
}

/// The state at the start.
#[derive(Debug, Args)]
#[command(next_help_heading = "Start", allow_negative_numbers = true)]
struct StartArgs {
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_roll_deg: f64,
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_pitch_deg: f64,
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_yaw_deg: f64,
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_alpha_deg: f64,
    /// True airspeed.
    #[arg(long, value_name = "MPS", default_value_t = Start::NEUTRAL.airspeed_mps)]
    start_airspeed_mps: f64,
    /// Above mean sea level.
    #[arg(long, value_name = "M", default_value_t = Start::NEUTRAL.altitude_m)]
    start_altitude_m: f64,
}

/// Wind, turbulence, gusts.
#[derive(Debug, Args)]
#[command(next_help_heading = "Air")]
struct AirArgs {
    /// Steady wind, the velocity of the air over the ground.
    #[arg(long, value_name = "N,E,D", default_value = "0,0,0", allow_hyphen_values = true)]
    wind_ned_mps: Numbers<3>,
    /// MIL-spec turbulence: 3 light, 4 moderate, 6 severe.
    #[arg(long, value_name = "1..7")]
    turbulence_severity: Option<u8>,
    /// Wind 20 ft above ground, which rules the turbulence below 600 m.
    #[arg(long, value_name = "MPS", default_value_t = 15.0, requires = "turbulence_severity")]
    turbulence_wind_20ft_mps: f64,
    /// A one-minus-cosine gust (may be repeated): start s, velocity NED m/s, rise, hold, fall s.
    #[arg(long, value_name = "S,N,E,D,RISE,HOLD,FALL", allow_hyphen_values = true)]
    gust: Vec<Numbers<7>>,
}

/// A preset of sensor noise.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Preset {
    /// Perfect sensors.
    None,
    /// The order of a small autopilot with its motor running.
    Realistic,
}

/// Sensor errors.
#[derive(Debug, Args)]
#[command(next_help_heading = "Sensors (standard deviations replace those of the preset)")]
struct SensorArgs {
    /// Preset of white noise.
    #[arg(long, value_name = "PRESET", default_value = "none")]
    noise: Preset,
    #[arg(long, value_name = "RADPS")]
    noise_gyro_radps: Option<f64>,
    #[arg(long, value_name = "MPS2")]
    noise_accelerometer_mps2: Option<f64>,
    #[arg(long, value_name = "DEG")]
    noise_attitude_deg: Option<f64>,
    #[arg(long, value_name = "MPS")]
    noise_airspeed_mps: Option<f64>,
    /// Angle of attack and sideslip.
    #[arg(long, value_name = "DEG")]
    noise_vane_deg: Option<f64>,
    #[arg(long, value_name = "M")]
    noise_altitude_m: Option<f64>,
    #[arg(long, value_name = "P,Q,R", default_value = "0,0,0", allow_hyphen_values = true)]
    bias_gyro_radps: Numbers<3>,
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    bias_accelerometer_mps2: Numbers<3>,
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    bias_alpha_deg: f64,
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    bias_beta_deg: f64,
    /// The airspeed shown is this times the true one.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    airspeed_scale: f64,
}

/// What befalls state frames.
#[derive(Debug, Args)]
#[command(next_help_heading = "Frames")]
struct FaultArgs {
    /// Every state frame comes this much late (in lockstep rounded up to whole 10 ms).
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    delay_ms: f64,
    /// A state frame is lost with this probability.
    #[arg(long, value_name = "0..1", default_value_t = 0.0)]
    drop: f64,
    /// Each state frame comes late by a further uniform 0..MS of wall time.
    #[arg(long, value_name = "MS", default_value_t = 0.0)]
    jitter_ms: f64,
    /// A state frame comes late by --late-ms with this probability.
    #[arg(long, value_name = "0..1", default_value_t = 0.0)]
    late: f64,
    /// How late such a frame is, in wall time.
    #[arg(long, value_name = "MS", default_value_t = 30.0)]
    late_ms: f64,
}

/// Numbers written with commas.
#[derive(Clone, Copy, Debug)]
struct Numbers<const N: usize>([f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let parts = parts.map_err(|_| "it holds something that is not a number".to_owned())?;
        let count = parts.len();
        parts.try_into().map(Numbers).map_err(|_| format!("{N} numbers are needed, {count} given"))
    }
}

impl Cli {
    fn options(&self) -> anyhow::Result<ShimOptions> {
        Ok(ShimOptions {
            link: self.link.clone(),
            pace: if self.lockstep { Pace::Lockstep } else { Pace::RealTime },
            launch: if self.no_hold { Launch::Immediate } else { Launch::WhenArmed },
            duration_s: self.duration_s,
            start: self.start.state(),
            plant: self.plant()?,
            seed: u64::from(self.seed),
            truth: self.truth.clone().map(|path| TruthFile {
                path,
                existing: if self.force { Existing::Replace } else { Existing::Keep },
            }),
            noise: self.sensors.noise(),
            bias: self.sensors.bias(),
            faults: FrameFaults {
                delay_ms: self.faults.delay_ms,
                drop_probability: self.faults.drop,
                jitter_ms: self.faults.jitter_ms,
                late_probability: self.faults.late,
                late_ms: self.faults.late_ms,
            },
        })
    }

    fn plant(&self) -> anyhow::Result<PlantOptions> {
        let mut plant = PlantOptions { seed: self.seed, air: self.air.air(), ..Default::default() };
        plant.aircraft_dir = self.aircraft.aircraft_dir.clone();
        if let Some(name) = &self.aircraft.aircraft {
            plant.aircraft = name.clone();
        }
        plant.hidden = self.aircraft.hide.iter().map(|text| hidden(text)).collect::<Result<_, _>>()?;
        Ok(plant)
    }
}

impl StartArgs {
    fn state(&self) -> Start {
        Start {
            roll_rad: self.start_roll_deg.to_radians(),
            pitch_rad: self.start_pitch_deg.to_radians(),
            yaw_rad: self.start_yaw_deg.to_radians(),
            alpha_rad: self.start_alpha_deg.to_radians(),
            airspeed_mps: self.start_airspeed_mps,
            altitude_m: self.start_altitude_m,
            ..Start::NEUTRAL
        }
    }
}

impl AirArgs {
    fn air(&self) -> Air {
        let gust = |&Numbers([start_s, n, e, d, rise_s, hold_s, fall_s]): &Numbers<7>| Gust {
            start_s,
            velocity_ned_mps: [n, e, d],
            rise_s,
            hold_s,
            fall_s,
        };
        Air {
            wind_ned_mps: self.wind_ned_mps.0,
            turbulence: self.turbulence_severity.map(|severity| Turbulence {
                wind_20ft_mps: self.turbulence_wind_20ft_mps,
                severity,
            }),
            gusts: self.gust.iter().map(gust).collect(),
        }
    }
}

impl SensorArgs {
    fn noise(&self) -> Noise {
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

    fn bias(&self) -> Bias {
        Bias {
            gyro_radps: self.bias_gyro_radps.0,
            accelerometer_mps2: self.bias_accelerometer_mps2.0,
            alpha_rad: self.bias_alpha_deg.to_radians(),
            beta_rad: self.bias_beta_deg.to_radians(),
            airspeed_scale: self.airspeed_scale,
        }
    }
}

fn main() -> ExitCode {
    match fly(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("greylag-sitl: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn fly(cli: &Cli) -> anyhow::Result<()> {
    let options = cli.options()?;
    let stop = Arc::new(AtomicBool::new(false));
    let handler = Arc::clone(&stop);
    ctrlc::set_handler(move || handler.store(true, Ordering::Relaxed))
        .context("cannot listen for Ctrl-C")?;
    say(format_args!("greylag-sitl: {}", intent(&options)));
    let mut tell = |notice: shim::Notice| say(format_args!("{:9.2} s  {}", notice.time_s, notice.event));
    let summary = shim::run(&options, &stop, &mut tell)?;
    say(format_args!("\n{summary}"));
    Ok(())
}

/// Prints a line; a reader that has gone away does not end the flight.
fn say(line: std::fmt::Arguments<'_>) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Reads an effect to be hidden, written `id=amplitude`.
fn hidden(text: &str) -> anyhow::Result<Hidden> {
    let (id, amplitude) = text
        .split_once('=')
        .with_context(|| format!("cannot read --hide {text}: write it like id=amplitude"))?;
    let amplitude: f64 = amplitude
        .parse()
        .with_context(|| format!("cannot read the amplitude of --hide {text}: give a number"))?;
    Ok(Hidden { effect: id.to_owned().leak(), amplitude })
}

/// What is about to happen, in one line.
fn intent(options: &ShimOptions) -> String {
    let pace = match options.pace {
        Pace::RealTime => "in real time, 100 frames a second",
        Pace::Lockstep => "in lockstep, as fast as the companion answers",
    };
    let launch = match options.launch {
        Launch::WhenArmed => "held at the start until the companion arms",
        Launch::Immediate => "flying at once",
    };
    format!("{} {pace}, {launch}; Ctrl-C ends it", options.plant.aircraft)
}

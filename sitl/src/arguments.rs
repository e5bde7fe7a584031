//! The command line of `greylag-sitl`, in units a person writes.

mod errors;

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser};
use errors::{FaultArgs, SensorArgs};
use greylag_sitl::air::{Air, Gust, Turbulence};
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{Address, Existing, Launch, Pace, ShimOptions, TruthFile};

/// Flies an aircraft in JSBSim and plays its flight controller over MAVLink.
///
/// Without options: real time, held at the start until the companion arms, sending to
/// udpout:127.0.0.1:14600, where `cargo fly` listens.
#[derive(Debug, Parser)]
#[command(name = "greylag-sitl", version)]
pub struct Cli {
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
    /// Hide an effect in the aircraft (may be repeated); a wrong ID is answered with all that are known.
    #[arg(long, value_name = "ID=AMPLITUDE", allow_hyphen_values = true)]
    hide: Vec<Hidden>,
}

/// The state at the start.
#[derive(Debug, Args)]
#[command(next_help_heading = "Start", allow_negative_numbers = true)]
struct StartArgs {
    /// Right wing down is positive.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_roll_deg: f64,
    /// Nose up is positive.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_pitch_deg: f64,
    /// From true north towards east.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_yaw_deg: f64,
    /// Angle of attack.
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
    /// Wind 20 ft above ground, which rules the turbulence near the ground; above 600 m the severity does.
    #[arg(long, value_name = "MPS", default_value_t = 15.0, requires = "turbulence_severity")]
    turbulence_wind_20ft_mps: f64,
    /// A one-minus-cosine gust (may be repeated): start s, velocity NED m/s, rise, hold, fall s.
    #[arg(long, value_name = "S,N,E,D,RISE,HOLD,FALL", allow_hyphen_values = true)]
    gust: Vec<Numbers<7>>,
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
    /// What the command line asks for.
    pub fn options(&self) -> ShimOptions {
        ShimOptions {
            link: self.link.clone(),
            pace: if self.lockstep { Pace::Lockstep } else { Pace::RealTime },
            launch: if self.no_hold { Launch::Immediate } else { Launch::WhenArmed },
            duration_s: self.duration_s,
            start: self.start.state(),
            plant: self.plant(),
            seed: u64::from(self.seed),
            truth: self.truth.clone().map(|path| TruthFile {
                path,
                existing: if self.force { Existing::Replace } else { Existing::Keep },
            }),
            noise: self.sensors.noise(),
            bias: self.sensors.bias(),
            faults: self.faults.rule(),
        }
    }

    fn plant(&self) -> PlantOptions {
        let mut plant = PlantOptions { seed: self.seed, air: self.air.air(), ..Default::default() };
        plant.aircraft_dir = self.aircraft.aircraft_dir.clone();
        if let Some(name) = &self.aircraft.aircraft {
            plant.aircraft = name.clone();
        }
        plant.hidden = self.aircraft.hide.clone();
        plant
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

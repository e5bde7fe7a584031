//! Command line of `greylag-sitl`: parses the arguments and converts them to options in SI units and radians.

use std::path::{Path, PathBuf};

use crate::airframe_file::{self, AirframeError};
use crate::error_arguments::{FaultArgs, SensorArgs};
use crate::parameter_file::{self, ParameterFileError};
use crate::plant::Start;
use crate::plant_arguments::{PlantArgs, held};
use crate::shim::controller::FlightController;
use crate::shim::{
    Address, ArdupilotOptions, ChannelRange, Existing, Launch, OutputMap, Pace, Personality,
    Px4Noise, Px4Options, ShimOptions, TruthFile,
};
use clap::{Args, Parser, ValueEnum};

/// Flies an aircraft in JSBSim and simulates its flight controller over MAVLink.
///
/// Without options: real time, held at the start until the companion arms, sending to
/// udpout:127.0.0.1:14600, where `cargo fly` listens.
#[derive(Debug, Parser)]
#[command(name = "greylag-sitl", version)]
pub struct Cli {
    /// Address at which the companion connects: udpin:, udpout:, tcpin: or tcpout:, then HOST:PORT;
    /// or serial:DEVICE:BAUD; or pty:NAME, a pseudo-terminal that the companion opens under that name.
    #[arg(long, value_name = "ADDRESS", default_value_t = ShimOptions::default_link())]
    link: Address,
    /// Simulate this flight stack, with its modes, rates, parameters and failsafes, instead of the
    /// companion's own simulator link. It begins armed, in the air, flying by itself.
    #[arg(long, value_name = "STACK", value_enum, conflicts_with = "lockstep")]
    personality: Option<PersonalityName>,
    /// Set a parameter of that stack (may be repeated).
    #[arg(long, value_name = "NAME=VALUE", requires = "personality", value_parser = held)]
    parameter: Vec<(String, f64)>,
    /// Set the parameters of a file, such as params/x8/arduplane.parm: those that this stack simulates;
    /// --parameter takes precedence.
    #[arg(long, value_name = "FILE", requires = "personality")]
    parameters: Option<PathBuf>,
    #[command(flatten)]
    px4: Px4Args,
    #[command(flatten)]
    ardupilot: ArdupilotArgs,
    /// Step on the companion's answers alone, as fast as they come, instead of in real time.
    #[arg(long)]
    lockstep: bool,
    /// Fly at once instead of holding at the start until the first armed answer.
    #[arg(long)]
    no_hold: bool,
    /// End after so much simulated flight; the time held at the start does not count.
    #[arg(long, value_name = "S")]
    duration_s: Option<f64>,
    /// Initial value of the vehicle's clock: 4294960 is seven seconds before its milliseconds wrap.
    #[arg(long, value_name = "S", default_value_t = 0.0)]
    clock_start_s: f64,
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
    plant: PlantArgs,
    /// Airframe file of the companion: its [surfaces], [motors] and [conditions] name the JSBSim
    /// properties that are commanded and held.
    #[arg(long, value_name = "FILE", help_heading = "Aircraft")]
    airframe: Option<PathBuf>,
    #[command(flatten)]
    start: StartArgs,
    #[command(flatten)]
    sensors: SensorArgs,
    #[command(flatten)]
    faults: FaultArgs,
}

/// A flight stack that the shim can simulate.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PersonalityName {
    /// PX4 with a fixed-wing airframe.
    Px4,
    /// ArduPilot's fixed-wing firmware, ArduPlane.
    Ardupilot,
}

/// The PX4 simulator API.
#[derive(Debug, Args)]
#[command(next_help_heading = "PX4 simulator API (instead of a companion)")]
struct Px4Args {
    /// Be the simulator of stock PX4 SITL: HIL_SENSOR at 250 Hz, HIL_GPS at 10 Hz, lockstep. PX4
    /// connects here; without ADDRESS that is tcpin:127.0.0.1:4560. The aircraft stands until PX4
    /// is armed and opens the throttle, then a catapult brings it to its start.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = PX4_ADDRESS,
          conflicts_with_all = ["link", "personality"])]
    px4_sim: Option<Address>,
    /// Which of PX4's outputs (PWM_MAIN_FUNCn) moves what: aileron, left-aileron, right-aileron,
    /// elevator, left-elevon, right-elevon, rudder, throttle; a minus reverses.
    #[arg(long, value_name = "WHAT=N,..", requires = "px4_sim", default_value_t = OutputMap::px4())]
    px4_outputs: OutputMap,
    /// Preset of the white noise of PX4's sensors.
    #[arg(long, value_name = "PRESET", requires = "px4_sim", default_value = "standard")]
    px4_noise: Px4NoiseName,
}

/// Default address at which stock PX4 SITL connects to its simulator.
const PX4_ADDRESS: &str = "tcpin:127.0.0.1:4560";

/// A preset of sensor noise.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Px4NoiseName {
    /// Sensors without noise.
    None,
    /// Noise of PX4's own simulators.
    Standard,
}

impl Px4Args {
    fn options(&self) -> Option<Px4Options> {
        let noise = match self.px4_noise {
            Px4NoiseName::None => Px4Noise::NONE,
            Px4NoiseName::Standard => Px4Noise::STANDARD,
        };
        self.px4_sim.as_ref().map(|_| Px4Options { outputs: self.px4_outputs.clone(), noise })
    }
}

/// Options of ArduPilot's JSON interface.
#[derive(Debug, Args)]
#[command(next_help_heading = "ArduPilot JSON interface (instead of a companion)")]
struct ArdupilotArgs {
    /// Be the simulator of stock ArduPlane SITL, which sends its servo packets here and flies in
    /// lockstep at its own pace; without ADDRESS that is udpin:127.0.0.1:9002. The aircraft stands
    /// until ArduPlane opens the throttle, then a catapult brings it to its start.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = ARDUPILOT_ADDRESS,
          conflicts_with_all = ["link", "personality", "px4_sim", "lockstep"])]
    ardupilot_sim: Option<Address>,
    /// Which of ArduPilot's channels (SERVOn_FUNCTION) moves what: names as for --px4-outputs;
    /// elevons as ArduPilot mixes them are left-elevon=1,right-elevon=2.
    #[arg(long, value_name = "WHAT=N,..", requires = "ardupilot_sim", default_value_t = OutputMap::ardupilot())]
    ardupilot_outputs: OutputMap,
    /// Pulse widths in us at the stops and at neutral, of all channels or, with N=, of channel N
    /// (may be repeated): SERVOn_MIN, SERVOn_TRIM, SERVOn_MAX. 1000:1500:2000 where nothing is given.
    #[arg(long, value_name = "[N=]MIN:TRIM:MAX", requires = "ardupilot_sim")]
    ardupilot_pwm: Vec<ChannelRange>,
}

/// Default address to which stock ArduPlane SITL sends its servo packets.
const ARDUPILOT_ADDRESS: &str = "udpin:127.0.0.1:9002";

impl ArdupilotArgs {
    fn options(&self) -> Option<ArdupilotOptions> {
        self.ardupilot_sim.as_ref().map(|_| ArdupilotOptions {
            outputs: self.ardupilot_outputs.clone(),
            ranges: self.ardupilot_pwm.clone(),
        })
    }
}

/// The state at the start.
#[derive(Debug, Args)]
#[command(next_help_heading = "Start", allow_negative_numbers = true)]
struct StartArgs {
    /// Roll angle at the start; right wing down is positive.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_roll_deg: f64,
    /// Pitch angle at the start; nose up is positive.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_pitch_deg: f64,
    /// Yaw angle at the start, from true north towards east.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_yaw_deg: f64,
    /// Angle of attack at the start.
    #[arg(long, value_name = "DEG", default_value_t = 0.0, allow_negative_numbers = true)]
    start_alpha_deg: f64,
    /// True airspeed at the start.
    #[arg(long, value_name = "MPS", default_value_t = Start::NEUTRAL.airspeed_mps)]
    start_airspeed_mps: f64,
    /// Altitude above mean sea level at the start.
    #[arg(long, value_name = "M", default_value_t = Start::NEUTRAL.altitude_m)]
    start_altitude_m: f64,
}

impl Cli {
    /// Address at which PX4 or ArduPilot connects if the shim is their simulator, otherwise the address of the companion.
    fn address(&self) -> &Address {
        let simulated = self.px4.px4_sim.as_ref().or(self.ardupilot.ardupilot_sim.as_ref());
        simulated.unwrap_or(&self.link)
    }

    /// Converts the command line into the options of a run.
    ///
    /// # Errors
    /// `CliError` if the airframe file or the parameter file cannot be read, or its content is invalid.
    pub fn options(&self) -> Result<ShimOptions, CliError> {
        let personality = self.personality.map(Personality::from);
        let (mut parameters, unplayed) = match (&self.parameters, personality) {
            (Some(path), Some(personality)) => played(path, personality)?,
            _ => Default::default(),
        };
        parameters.extend(self.parameter.iter().cloned());
        let mut plant = self.plant.options(self.seed);
        if let Some(path) = &self.airframe {
            airframe_file::apply(path, &mut plant)?;
        }
        Ok(ShimOptions {
            link: self.address().clone(),
            px4: self.px4.options(),
            ardupilot: self.ardupilot.options(),
            pace: if self.lockstep { Pace::Lockstep } else { Pace::RealTime },
            launch: if self.no_hold { Launch::Immediate } else { Launch::WhenArmed },
            duration_s: self.duration_s,
            start: self.start.state(),
            plant,
            seed: u64::from(self.seed),
            truth: self.truth.clone().map(|path| TruthFile {
                path,
                existing: if self.force { Existing::Replace } else { Existing::Keep },
            }),
            noise: self.sensors.noise(),
            bias: self.sensors.bias(),
            faults: self.faults.rule(),
            personality,
            parameters,
            unplayed,
            clock_start_s: self.clock_start_s,
        })
    }
}

/// Name and value of each simulated parameter, and the names of the parameters that the flight stack does not simulate.
type Played = (Vec<(String, f64)>, Vec<String>);

/// Reads a parameter file and separates the parameters that `personality` simulates from the others.
fn played(path: &Path, personality: Personality) -> Result<Played, ParameterFileError> {
    let (played, others): (Vec<_>, Vec<_>) = parameter_file::read(path)?
        .into_iter()
        .partition(|(name, _)| FlightController::plays(personality, name));
    if played.is_empty() {
        let stack = personality.to_string();
        return Err(ParameterFileError::Foreign { path: path.to_owned(), stack });
    }
    Ok((played, others.into_iter().map(|(name, _)| name).collect()))
}

impl From<PersonalityName> for Personality {
    fn from(name: PersonalityName) -> Self {
        match name {
            PersonalityName::Px4 => Personality::Px4,
            PersonalityName::Ardupilot => Personality::Ardupilot,
        }
    }
}

/// Error in a file that the command line names.
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// The airframe file cannot be used.
    #[error(transparent)]
    Airframe(#[from] AirframeError),
    /// The parameter file cannot be used.
    #[error(transparent)]
    Parameters(#[from] ParameterFileError),
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Options from `--personality stack`, a parameter file that contains `text`, and the further arguments `more`.
    fn options(stack: &str, text: &str, more: &[&str]) -> Result<ShimOptions, CliError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.parm");
        std::fs::write(&path, text).unwrap();
        let file = path.to_str().unwrap();
        let words = ["greylag-sitl", "--personality", stack, "--parameters", file];
        Cli::try_parse_from(words.iter().chain(more)).unwrap().options()
    }

    #[test]
    fn a_parameter_file_sets_what_is_played_and_the_command_line_goes_on_top() {
        let text = "RC_OVERRIDE_TIME 0.4\nRLL_RATE_P 0.08\nFS_GCS_ENABL 1\n";
        let options = options("ardupilot", text, &["--parameter", "FS_GCS_ENABL=0"]).unwrap();
        let expected = [("RC_OVERRIDE_TIME", 0.4), ("FS_GCS_ENABL", 1.0), ("FS_GCS_ENABL", 0.0)];
        assert_eq!(options.parameters, expected.map(|(name, value)| (name.to_owned(), value)));
        assert_eq!(options.unplayed, ["RLL_RATE_P"]);
    }

    #[test]
    fn a_parameter_that_is_not_finite_is_refused() {
        for value in ["nan", "inf", "much"] {
            let words = ["greylag-sitl", "--personality", "px4", "--parameter"];
            let given = format!("COM_OF_LOSS_T={value}");
            let said = Cli::try_parse_from(words.into_iter().chain([given.as_str()]));
            assert!(said.unwrap_err().to_string().contains("not a finite number"), "{value}");
        }
    }

    #[test]
    fn a_file_of_the_other_stack_is_refused() {
        let said = options("ardupilot", "COM_RC_IN_MODE 1\n", &[]).unwrap_err().to_string();
        assert!(said.contains("the ArduPilot personality simulates"), "{said}");
    }
}

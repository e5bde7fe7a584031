//! The plant: one aircraft flown by JSBSim in this process, 100 steps a second of its own time.
// (interface fixed by the architect; bodies to be written)
use std::path::PathBuf;

/// Which aircraft to fly, in what air, with what hidden in it.
#[derive(Clone, Debug)]
pub struct PlantOptions {
    /// Folder that holds `NAME/NAME.xml`; `None` is the X8 built into the program.
    pub aircraft_dir: Option<PathBuf>,
    /// The aircraft's name.
    pub aircraft: String,
    // wind, turbulence, gusts, hidden effects, seed: to come
}

/// The state at which an episode starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    pub roll_rad: f64, pub pitch_rad: f64, pub yaw_rad: f64,
    pub airspeed_mps: f64, pub alpha_rad: f64, pub beta_rad: f64,
    pub p_radps: f64, pub q_radps: f64, pub r_radps: f64,
    pub altitude_m: f64,
}

/// Normalised commands for one step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inputs { pub aileron: f64, pub elevator: f64, pub throttle: f64 }

/// Everything the plant shows of itself after a step (truth, without sensor errors).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Truth {
    pub time_s: f64,
    pub roll_rad: f64, pub pitch_rad: f64, pub yaw_rad: f64,
    pub p_radps: f64, pub q_radps: f64, pub r_radps: f64,
    pub airspeed_mps: f64, pub alpha_rad: f64, pub beta_rad: f64,
    pub specific_force_mps2: [f64; 3],
    pub velocity_ned_mps: [f64; 3],
    pub wind_ned_mps: [f64; 3],
    pub latitude_deg: f64, pub longitude_deg: f64, pub altitude_m: f64,
    pub air_density_kgpm3: f64, pub static_pressure_pa: f64,
    pub aileron_rad: f64, pub aileron_rate_radps: f64,
    pub elevator_rad: f64, pub elevator_rate_radps: f64,
    pub throttle: f64,
    pub thrust_n: f64,
}
// pub struct Plant; impl Plant { new(&PlantOptions) -> Result<Self, PlantError>; reset(&mut self,&Start)->Result<Truth,_>;
//   step(&mut self, Inputs)->Result<Truth,_>; truth(&self)->Truth; snapshot(&self)->Result<Snapshot,_>; restore(&mut self,&Snapshot)->Result<(),_> }

//! Writes the plant's truth to a CSV file in the columns of the flight-log format.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::PathBuf;

use super::error::ShimError;
use super::options::{Existing, TruthFile};
use crate::plant::{Inputs, Travel, Truth};

const HEADER: &str = "time_s,roll_rad,pitch_rad,yaw_rad,p_radps,q_radps,r_radps,airspeed_mps,\
alpha_rad,beta_rad,ax_mps2,ay_mps2,az_mps2,vn_mps,ve_mps,vd_mps,altitude_m,air_density_kgpm3,\
aileron_rad,elevator_rad,throttle,aileron_cmd,elevator_cmd,throttle_cmd,rate_hold_s";

/// Additional columns of an aircraft with a rudder.
const RUDDER: &str = ",rudder_rad,rudder_cmd";

/// A truth file that is open for writing.
#[derive(Debug)]
pub struct TruthLog {
    path: PathBuf,
    file: BufWriter<File>,
    /// Time for which the plant holds its rates, s.
    step_s: f64,
    has_rudder: bool,
}

impl TruthLog {
    /// Creates the file with its header row, for a plant with the step `step_s`, s, and surfaces of this `travel`. Refuses an
    /// existing file unless `target` asks for its replacement.
    pub fn create(target: &TruthFile, step_s: f64, travel: &Travel) -> Result<Self, ShimError> {
        let path = target.path.clone();
        let mut how = OpenOptions::new();
        match target.existing {
            Existing::Keep => how.write(true).create_new(true),
            Existing::Replace => how.write(true).create(true).truncate(true),
        };
        let file = match how.open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                return Err(ShimError::TruthExists { path });
            }
            Err(source) => return Err(ShimError::Truth { path, source }),
        };
        let has_rudder = travel.rudder.is_some();
        let mut log = TruthLog { path, file: BufWriter::new(file), step_s, has_rudder };
        let written = writeln!(log.file, "{HEADER}{}", if has_rudder { RUDDER } else { "" });
        log.check(written)?;
        Ok(log)
    }

    /// Appends the state at `time_us`, µs, with the command that acts from this row to the next.
    pub fn row(&mut self, time_us: u64, truth: &Truth, inputs: Inputs) -> Result<(), ShimError> {
        let [ax, ay, az] = truth.specific_force_mps2;
        let [vn, ve, vd] = truth.velocity_ned_mps;
        let columns = [
            truth.roll_rad,
            truth.pitch_rad,
            truth.yaw_rad,
            truth.p_radps,
            truth.q_radps,
            truth.r_radps,
            truth.airspeed_mps,
            truth.alpha_rad,
            truth.beta_rad,
            ax,
            ay,
            az,
            vn,
            ve,
            vd,
            truth.altitude_m,
            truth.air_density_kgpm3,
            truth.aileron_rad,
            truth.elevator_rad,
            truth.throttle,
            inputs.aileron,
            inputs.elevator,
            inputs.throttle,
            self.step_s,
            truth.rudder_rad,
            inputs.rudder,
        ];
        let count = if self.has_rudder { columns.len() } else { columns.len() - 2 };
        let mut write = || -> io::Result<()> {
            write!(self.file, "{}", time_us as f64 * 1e-6)?;
            columns[..count].iter().try_for_each(|value| write!(self.file, ",{value}"))?;
            writeln!(self.file)
        };
        let written = write();
        self.check(written)
    }

    /// Writes the buffered rows to the file.
    pub fn finish(&mut self) -> Result<(), ShimError> {
        let written = self.file.flush();
        self.check(written)
    }

    fn check(&self, written: io::Result<()>) -> Result<(), ShimError> {
        written.map_err(|source| ShimError::Truth { path: self.path.clone(), source })
    }
}

//! Names that other programs give to the columns of a table of flight data.
//!
//! Sources:
//! - `FGOutputTextFile.cpp` of JSBSim: output sections and property names.
//! - ulog2csv: topics of PX4.
//! - `mavlogdump --format csv`: records of ArduPilot and messages of MAVLink, as `TYPE.field`.

use crate::mapping::{Mapping, table_rules};

/// Another name for a column: name of the column in the log format, its name in files of another program, and the factor from
/// the file's unit to the column's unit.
struct Alias(&'static str, &'static str, f64);

const DEGREE: f64 = std::f64::consts::PI / 180.0;
const FOOT: f64 = 0.3048;
/// One slug per cubic foot in kg/m³.
const SLUG_PER_FOOT3: f64 = 515.378_8;

/// JSBSim's names: first the headings of its output sections (degrees, feet), then the names of its properties.
const JSBSIM: [Alias; 46] = [
    Alias("roll_rad", "Phi (deg)", DEGREE),
    Alias("pitch_rad", "Theta (deg)", DEGREE),
    Alias("yaw_rad", "Psi (deg)", DEGREE),
    Alias("p_radps", "P (deg/s)", DEGREE),
    Alias("q_radps", "Q (deg/s)", DEGREE),
    Alias("r_radps", "R (deg/s)", DEGREE),
    Alias("airspeed_mps", "V_{Total} (ft/s)", FOOT),
    Alias("alpha_rad", "Alpha (deg)", DEGREE),
    Alias("beta_rad", "Beta (deg)", DEGREE),
    Alias("vn_mps", "V_{North} (ft/s)", FOOT),
    Alias("ve_mps", "V_{East} (ft/s)", FOOT),
    Alias("vd_mps", "V_{Down} (ft/s)", FOOT),
    Alias("altitude_m", "Altitude ASL (ft)", FOOT),
    Alias("air_density_kgpm3", "Rho (slugs/ft^3)", SLUG_PER_FOOT3),
    Alias("aileron_rad", "Left Aileron Position (deg)", DEGREE),
    Alias("elevator_rad", "Elevator Position (deg)", DEGREE),
    Alias("rudder_rad", "Rudder Position (deg)", DEGREE),
    Alias("aileron_cmd", "Aileron Command (norm)", 1.0),
    Alias("elevator_cmd", "Elevator Command (norm)", 1.0),
    Alias("rudder_cmd", "Rudder Command (norm)", 1.0),
    Alias("roll_rad", "attitude/phi-rad", 1.0),
    Alias("pitch_rad", "attitude/theta-rad", 1.0),
    Alias("yaw_rad", "attitude/psi-rad", 1.0),
    Alias("p_radps", "velocities/p-rad_sec", 1.0),
    Alias("q_radps", "velocities/q-rad_sec", 1.0),
    Alias("r_radps", "velocities/r-rad_sec", 1.0),
    Alias("airspeed_mps", "velocities/vt-fps", FOOT),
    Alias("alpha_rad", "aero/alpha-rad", 1.0),
    Alias("beta_rad", "aero/beta-rad", 1.0),
    Alias("ax_mps2", "accelerations/a-pilot-x-ft_sec2", FOOT),
    Alias("ay_mps2", "accelerations/a-pilot-y-ft_sec2", FOOT),
    Alias("az_mps2", "accelerations/a-pilot-z-ft_sec2", FOOT),
    Alias("vn_mps", "velocities/v-north-fps", FOOT),
    Alias("ve_mps", "velocities/v-east-fps", FOOT),
    Alias("vd_mps", "velocities/v-down-fps", FOOT),
    Alias("altitude_m", "position/h-sl-ft", FOOT),
    Alias("air_density_kgpm3", "atmosphere/rho-slugs_ft3", SLUG_PER_FOOT3),
    Alias("aileron_rad", "fcs/left-aileron-pos-rad", 1.0),
    Alias("elevator_rad", "fcs/elevator-pos-rad", 1.0),
    Alias("rudder_rad", "fcs/rudder-pos-rad", 1.0),
    Alias("throttle", "fcs/throttle-pos-norm", 1.0),
    Alias("aileron_cmd", "fcs/aileron-cmd-norm", 1.0),
    Alias("elevator_cmd", "fcs/elevator-cmd-norm", 1.0),
    Alias("rudder_cmd", "fcs/rudder-cmd-norm", 1.0),
    Alias("throttle_cmd", "fcs/throttle-cmd-norm", 1.0),
    Alias("throttle_cmd", "fcs/throttle-cmd-norm[0]", 1.0),
];

/// Names of PX4's fields as ulog2csv writes them. Only names with a single meaning are included.
const PX4: [Alias; 17] = [
    Alias("p_radps", "rollspeed", 1.0),
    Alias("q_radps", "pitchspeed", 1.0),
    Alias("r_radps", "yawspeed", 1.0),
    Alias("p_radps", "gyro_rad[0]", 1.0),
    Alias("q_radps", "gyro_rad[1]", 1.0),
    Alias("r_radps", "gyro_rad[2]", 1.0),
    Alias("ax_mps2", "accelerometer_m_s2[0]", 1.0),
    Alias("ay_mps2", "accelerometer_m_s2[1]", 1.0),
    Alias("az_mps2", "accelerometer_m_s2[2]", 1.0),
    Alias("airspeed_mps", "true_airspeed_m_s", 1.0),
    Alias("vn_mps", "vx", 1.0),
    Alias("ve_mps", "vy", 1.0),
    Alias("vd_mps", "vz", 1.0),
    Alias("aileron_cmd", "control[0]", 1.0),
    Alias("elevator_cmd", "control[1]", -1.0),
    Alias("rudder_cmd", "control[2]", -1.0),
    Alias("throttle_cmd", "control[3]", 1.0),
];

/// Names of the time column, with the unit in s. If the unit is given as 0, it is unknown and is determined from the time
/// between rows.
const TIMES: [(&str, f64); 12] = [
    ("Time", 1.0),
    ("timestamp", 0.0),
    ("timestamp_sample", 0.0),
    ("TimeUS", 1e-6),
    ("time_usec", 1e-6),
    ("time_us", 1e-6),
    ("time_boot_ms", 1e-3),
    ("time_ms", 1e-3),
    ("time", 0.0),
    ("t", 0.0),
    ("Timestamp", 0.0),
    ("datetime", 0.0),
];

/// Names of the components of a quaternion, w first.
const QUATERNIONS: [[&str; 4]; 6] = [
    ["q[0]", "q[1]", "q[2]", "q[3]"],
    ["q0", "q1", "q2", "q3"],
    ["q1", "q2", "q3", "q4"],
    ["qw", "qx", "qy", "qz"],
    ["q_w", "q_x", "q_y", "q_z"],
    ["q.w", "q.x", "q.y", "q.z"],
];

/// A column that the file has under another name.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// Name of the column in the log format.
    pub column: String,
    /// Its name in the file.
    pub field: String,
    /// Factor from the file's unit to the column's unit.
    pub scale: f64,
    /// Offset that is added after the multiplication by `scale`.
    pub offset: f64,
}

/// Meaning of those names in a header that are not column names of the log format.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Dialect {
    /// The columns that the file has under other names.
    pub found: Vec<Found>,
    /// The quaternion's columns, w first unless the samples show another order.
    pub quaternion: Option<[String; 4]>,
    /// Whether the unit of the time column is unknown and must be determined from the time between rows.
    pub time_by_steps: bool,
    /// Whether the column read as airspeed contains equivalent airspeed.
    pub equivalent: bool,
}

impl Dialect {
    /// Finds those columns of the log format that are neither in the header `names` nor in the mapping but have another name in
    /// the header.
    pub fn of(names: &[String], mapping: &Mapping) -> Dialect {
        let has = |name: &str| names.iter().any(|n| n == name);
        let mut dialect = Dialect::default();
        let lacks = |dialect: &Dialect, column: &str| {
            !has(column)
                && mapping.get(column).is_none()
                && !dialect.found.iter().any(|f| f.column == column)
        };
        let time = TIMES.iter().find(|(name, _)| has(name));
        if let Some((name, unit)) = time.filter(|_| lacks(&dialect, "time_s")) {
            dialect.time_by_steps = *unit == 0.0;
            let scale = if dialect.time_by_steps { 1.0 } else { *unit };
            dialect.take("time_s", name, scale);
        }
        // JSBSim writes a property with or without this prefix.
        let ending = |name: &str| {
            let same = |n: &&String| n.strip_prefix("/fdm/jsbsim/").unwrap_or(n) == name;
            names.iter().find(same).cloned()
        };
        for Alias(column, name, scale) in JSBSIM.iter().chain(&PX4) {
            if let Some(field) = ending(name).filter(|_| lacks(&dialect, column)) {
                dialect.take(column, &field, *scale);
            }
        }
        for rule in table_rules() {
            let Some((field, gain)) = rule.factor() else { continue };
            let name = format!("{}.{field}", rule.topic);
            let column = rule.columns()[0].to_owned();
            if has(&name) && lacks(&dialect, &column) {
                dialect.take(&column, &name, gain);
                dialect.equivalent |= rule.equivalent;
            }
        }
        let turns = lacks(&dialect, "roll_rad") && lacks(&dialect, "pitch_rad");
        let whole = QUATERNIONS.iter().find(|q| q.iter().all(|name| has(name)));
        dialect.quaternion = match mapping.quaternion() {
            Some(own) => own.fields.iter().all(|name| has(name)).then(|| own.fields.clone()),
            None => whole.filter(|_| turns).map(|q| q.map(str::to_owned)),
        };
        dialect
    }

    fn take(&mut self, column: &str, field: &str, scale: f64) {
        let found = Found { column: column.into(), field: field.into(), scale, offset: 0.0 };
        self.found.push(found);
    }

    /// Whether a column of the log format is read under another name or computed from the quaternion.
    pub fn fills(&self, column: &str) -> bool {
        let attitude = ["roll_rad", "pitch_rad", "yaw_rad"].contains(&column);
        self.quaternion.is_some() && attitude || self.found.iter().any(|f| f.column == column)
    }

    /// Whether the file's column `name` fills a column of the log format.
    pub fn reads(&self, name: &str) -> bool {
        self.found.iter().any(|f| f.field == name)
            || self.quaternion.as_ref().is_some_and(|q| q.iter().any(|n| n == name))
    }

    /// Note for the user on the columns that were found under other names; `None` if there are none.
    pub fn said(&self) -> Option<String> {
        let mut parts: Vec<String> =
            self.found.iter().map(|f| format!("{} from {}", f.column, f.field)).collect();
        parts.extend(self.quaternion.as_ref().map(|q| format!("attitude from {}", q.join(", "))));
        (!parts.is_empty()).then(|| format!("read under other names: {}", parts.join("; ")))
    }
}

/// Unit of the time column, s, from the median time between rows in this unit.
pub(super) fn unit_of(step: f64) -> f64 {
    match step {
        s if s >= 5e6 => 1e-9,
        s if s >= 500.0 => 1e-6,
        s if s >= 1.5 => 1e-3,
        _ => 1.0,
    }
}

/// Converts a date and time in ISO 8601 (2026-11-27T07:42:01.25Z, 2026-11-27T09:42:01.25+02:00) to seconds since 1970-01-01 UTC.
/// A time without an offset is taken as UTC. `None` if the text has another form.
pub(super) fn time(text: &str) -> Option<f64> {
    let (date, clock) = text.split_once(['T', ' '])?;
    let mut date = date.split('-').map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (date.next()??, date.next()??, date.next()??);
    let (clock, ahead_s) = match clock.find(['+', '-']) {
        Some(sign) => (clock[..sign].trim_end(), offset_s(&clock[sign..])?),
        None => (clock.trim_end_matches('Z'), 0.0),
    };
    let mut parts = clock.split(':').map(|part| part.replace(',', ".").parse::<f64>().ok());
    let (hour, minute) = (parts.next()??, parts.next()??);
    let second = parts.next().unwrap_or(Some(0.0))?;
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1900..3000).contains(&year) {
        return None;
    }
    // Days since 1970-01-01 (Howard Hinnant, "chrono-compatible low-level date algorithms").
    let y = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (y.div_euclid(400), y.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let days = era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468;
    Some(days as f64 * 86_400.0 + hour * 3600.0 + minute * 60.0 + second - ahead_s)
}

/// Converts the offset of a local clock (±hh:mm, ±hhmm or ±hh) to the time by which it is ahead of UTC, s.
fn offset_s(text: &str) -> Option<f64> {
    let (sign, digits) = match text.split_at_checked(1)? {
        ("+", digits) => (1.0, digits),
        ("-", digits) => (-1.0, digits),
        _ => return None,
    };
    let digits = match digits.split_once(':') {
        Some((hours, minutes)) => format!("{hours:0>2}{minutes}"),
        None => digits.to_owned(),
    };
    let is_offset = [2, 4].contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    let number = |text: &str| text.parse::<f64>().ok();
    let (hours, minutes) = digits.split_at_checked(2).filter(|_| is_offset)?;
    let minutes = if minutes.is_empty() { 0.0 } else { number(minutes)? };
    let whole = 3600.0 * number(hours)? + 60.0 * minutes;
    (minutes < 60.0 && whole < 86_400.0).then_some(sign * whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_are_named_by_record_or_message_are_found() {
        for (name, column, equivalent) in [
            ("ATTITUDE.roll", "roll_rad", false),
            ("RAW_IMU.zacc", "az_mps2", false),
            ("VFR_HUD.airspeed", "airspeed_mps", true),
            ("ATT.Roll", "roll_rad", false),
            ("ARSP.Airspeed", "airspeed_mps", true),
        ] {
            let dialect = Dialect::of(&[name.to_owned()], &Mapping::default());
            let found: Vec<&str> = dialect.found.iter().map(|f| f.column.as_str()).collect();
            assert_eq!((found, dialect.equivalent), (vec![column], equivalent), "{name}");
        }
    }

    #[test]
    fn a_date_is_seconds_since_1970() {
        assert_eq!(time("1970-01-01T00:00:00Z"), Some(0.0));
        assert_eq!(time("2024-02-29T12:00:00.25"), Some(1_709_208_000.25));
        assert_eq!(time("2026-11-27 07:42:01"), Some(1_795_765_321.0));
        assert_eq!(time("17.5"), None);
        assert_eq!(time("2024-13-01T00:00:00"), None);
    }

    #[test]
    fn a_local_time_with_its_offset_is_seconds_of_utc() {
        let utc = time("2026-11-27T07:42:01.25Z").unwrap();
        for local in [
            "2026-11-27T09:42:01.25+02:00",
            "2026-11-27T02:42:01.25-05:00",
            "2026-11-27T13:12:01.25+0530",
            "2026-11-26T23:42:01,25-08",
            "2026-11-27 09:42:01.25 +02:00",
            "2026-11-27T07:42:01.25-00:00",
        ] {
            assert_eq!(time(local), Some(utc), "{local}");
        }
        for wrong in ["+", "-5x:00", "+25:00", "+02:60", "+2:0:0", "+02:00:00"] {
            assert_eq!(time(&format!("2026-11-27T07:42:01{wrong}")), None, "{wrong}");
        }
    }

    #[test]
    fn the_step_says_the_unit() {
        assert_eq!([0.01, 10.0, 1e4, 1e7].map(unit_of), [1.0, 1e-3, 1e-6, 1e-9]);
    }
}

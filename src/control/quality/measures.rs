//! Measures of how well a controller flies to a target, with the names, units and definitions used in tables, pages and JSON.

use super::Quality;

/// Name, unit and definition of one measure.
#[derive(Clone, Copy)]
pub struct Measure {
    /// Key in JSON output.
    pub id: &'static str,
    /// Title in a table.
    pub title: &'static str,
    /// Unit. Empty if the measure is dimensionless.
    pub unit: &'static str,
    /// Definition and its source.
    pub definition: &'static str,
    /// Direction in which the measure gets worse.
    pub worse: Worse,
    /// Reads the value from a [`Quality`].
    pub get: fn(&Quality) -> f64,
}

/// Direction in which a measure gets worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worse {
    /// The larger value is worse.
    More,
    /// The smaller value is worse.
    Less,
}

impl Measure {
    /// The worst of `values`. NaN if there are no values.
    pub fn worst(&self, values: &[f64]) -> f64 {
        let pick = match self.worse {
            Worse::More => f64::max,
            Worse::Less => f64::min,
        };
        values.iter().copied().fold(f64::NAN, pick)
    }
}

/// The measure with this JSON key. `None` if there is no such measure.
pub fn measure(id: &str) -> Option<&'static Measure> {
    MEASURES.iter().find(|m| m.id == id)
}

macro_rules! measures {
    ($($id:ident, $title:literal, $unit:literal, $worse:ident, $get:expr, $definition:literal;)*) => {
        /// All measures, with the main ones first.
        pub const MEASURES: &[Measure] = &[$(Measure {
            id: stringify!($id), title: $title, unit: $unit, definition: $definition,
            worse: Worse::$worse, get: $get,
        }),*];
    };
}

measures! {
    error_integral_deg_s, "integral of error", "° s", More, |q| q.error_integral_deg_s,
        "Trapezoidal integral of |roll error| + |pitch error| from the moment the target is set (integral of absolute \
         error, Graham and Lathrop 1953). A lost aircraft is off by 180° in both for the remaining time.";
    to_one_deg_s, "to 1°", "s", More, |q| q.to_one_deg_s,
        "Time after which roll and pitch both stay within 1° of the target; the whole flight if they never do.";
    to_five_percent_s, "to 5 % of the step", "s", More, |q| q.to_five_percent_s,
        "Time after which √(roll error² + pitch error²) stays within 5 % of its value when the target was set (settling \
         time, Franklin, Powell and Emami-Naeini, section 3.4).";
    overshoot_roll_deg, "overshoot of roll", "°", More, |q| q.overshoot_deg[0],
        "How far roll goes beyond the target in the direction of the step (same book).";
    overshoot_pitch_deg, "overshoot of pitch", "°", More, |q| q.overshoot_deg[1],
        "How far pitch goes beyond the target in the direction of the step.";
    load_factor_max, "load factor, largest", "", More, |q| q.load_factor[1],
        "Largest −f_z / 9.80665 m/s², f_z the specific force along body z at the centre of gravity (CS-23.321). Limit: \
         load_factor_max of the airframe file.";
    load_factor_min, "load factor, least", "", Less, |q| q.load_factor[0],
        "Smallest load factor. Limit: load_factor_min, where the file states one.";
    alpha_max_deg, "angle of attack, largest", "°", More, |q| q.alpha_deg[1],
        "Largest angle of attack relative to the air. Limit: stall_rad of the airframe file, where it states one.";
    alpha_min_deg, "angle of attack, least", "°", Less, |q| q.alpha_deg[0],
        "Least angle of attack.";
    sideslip_max_deg, "sideslip, largest", "°", More, |q| q.sideslip_deg,
        "Largest |sideslip|. Limit: sideslip_max_deg, where the file states one.";
    airspeed_rms_mps, "airspeed held, rms", "m/s", More, |q| q.airspeed_rms_mps,
        "Root mean square of the true airspeed minus the target.";
    airspeed_min_mps, "airspeed, least", "m/s", Less, |q| q.airspeed_mps[0],
        "Least true airspeed. Limit: airspeed_min_mps.";
    surface_travel, "surface travel", "", More, |q| q.travel.surfaces(),
        "Sum of |changes| of the aileron, elevator and rudder commands, each −1..1 (total variation of the input, \
         Skogestad 2003).";
    aileron_travel, "aileron travel", "", More, |q| q.travel.aileron, "Total variation of the aileron command.";
    elevator_travel, "elevator travel", "", More, |q| q.travel.elevator, "Total variation of the elevator command.";
    rudder_travel, "rudder travel", "", More, |q| q.travel.rudder, "Total variation of the rudder command.";
    throttle_travel, "throttle travel", "", More, |q| q.travel.throttle, "Total variation of the throttle command, 0..1.";
    surface_mean_square_rate, "surfaces' mean square rate", "1/s²", More,
        |q| q.mean_square_rate.surfaces(),
        "Mean of (change / tick)² of the surface commands, added up.";
    surface_saturated, "a surface at its stop", "share", More, |q| q.surface_saturated,
        "Share of the ticks at which a surface command is at −1 or 1.";
    throttle_saturated, "throttle at a stop", "share", More, |q| q.saturated.throttle,
        "Share of the ticks at which the throttle command is 0 or 1.";
    outside_s, "outside any limit", "s", More, |q| q.outside_s.any,
        "Time outside any limit of the airframe file: bank, pitch, load factor, stall, sideslip, airspeed, surface rate.";
    outside_load_factor_s, "outside the load factor", "s", More,
        |q| q.outside_s.load_factor + q.outside_s.load_factor_low,
        "Time above load_factor_max or below load_factor_min.";
    outside_stall_s, "beyond the stall", "s", More, |q| q.outside_s.stall,
        "Time above stall_rad.";
    outside_attitude_s, "outside bank or pitch", "s", More, |q| q.outside_s.bank.max(q.outside_s.pitch),
        "Time beyond bank_max_deg or beyond pitch_min_deg to pitch_max_deg, the longer of both.";
    outside_airspeed_s, "outside the airspeeds", "s", More, |q| q.outside_s.slow + q.outside_s.fast,
        "Time below airspeed_min_mps or above airspeed_max_mps.";
    outside_sideslip_s, "outside the sideslip", "s", More, |q| q.outside_s.sideslip,
        "Time beyond sideslip_max_deg.";
    outside_slew_s, "surfaces too fast", "s", More, |q| q.outside_s.slew,
        "Time with a surface command that changes faster than surface_slew_per_s.";
}

//! Settings of the pilot: envelope, timeouts, slew limits, and the trim of straight flight.
//!
//! "Level trim" stands for [`Trim::straight`] with level wings. At airspeeds for which a throttle between idle and full
//! suffices, it is level flight. At other airspeeds it is a descent at idle or full throttle.

use super::lift::LiftCurve;
use super::polarity::Answers;
use super::side_force::SideForce;
use greylag_model::{GreyBox, Trim, TrimError};
use greylag_physics::airframe::Envelope;

/// Airspeed step between two rows of the trim table, m/s. The error of the interpolated pitch is below 0.1°.
const TRIM_SPACING: f64 = 1.0;

/// The pilot's settings. The field names contain the units, because parameters and files show these names.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Flight envelope from the airframe file.
    pub envelope: Envelope,
    /// Time without setpoints or stick inputs after which the pilot changes to HOLD, s.
    pub offboard_loss_s: f64,
    /// Time without fresh states after which the vehicle link counts as lost, s.
    pub vehicle_loss_s: f64,
    /// Longest gap in usable states during which the last command is held, s.
    pub state_hold_s: f64,
    /// Slew limit of the throttle command (0..1), 1/s.
    pub throttle_slew_per_s: f64,
    /// Source of the throttle in OFFBOARD.
    pub thrust_source: ThrustSource,
    /// Largest bank and pitch at which arming is allowed, degrees.
    pub arm_tilt_max_deg: f64,
    /// Airspeed above which disarming must be forced, m/s.
    pub disarm_airspeed_max_mps: f64,
    /// Trim of straight flight with level wings ([`Trim::straight`]), by rising airspeed. At airspeeds that level flight cannot
    /// hold, the row is a descent at idle or full throttle.
    pub trim: Vec<TrimPoint>,
    /// Modelled responses to the surfaces, for the check that the surfaces act in the expected direction. `None` omits the
    /// check.
    pub answers: Option<Answers>,
    /// Lift of the model, from which the angle of attack for control follows where no vane measures it. `None` without a model.
    pub lift: Option<LiftCurve>,
    /// Side force of the model, from which the sideslip for control follows where no vane measures it. `None` without a model.
    pub side_force: Option<SideForce>,
}

/// Source of the throttle in OFFBOARD (parameter GL_THRUST_SRC).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThrustSource {
    /// The controller's throttle, which holds the cruise airspeed.
    Cruise,
    /// The setpoint's thrust, 0..1; the controller's throttle if the setpoint has no thrust.
    Setpoint,
}

/// One row of the trim table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrimPoint {
    /// True airspeed V_a, m/s.
    pub airspeed_mps: f64,
    /// Pitch angle, degrees. It equals the angle of attack in level flight and is smaller in a descent.
    pub pitch_deg: f64,
    /// Elevator command as a fraction, −1..1.
    pub elevator: f64,
    /// Throttle command as a fraction, 0..1.
    pub throttle: f64,
}

impl Config {
    /// Settings for the aircraft of `model`, with its envelope and its trim of straight flight.
    ///
    /// # Errors
    ///
    /// If the model has no trim at the cruise airspeed, neither level nor in a descent, or if [`Config::check`] finds an
    /// invalid setting.
    pub fn for_model(model: &GreyBox) -> Result<Self, ConfigError> {
        let envelope = model.airframe.envelope;
        let row = |airspeed: f64| trim_row(model, airspeed);
        row(envelope.airspeed_cruise_mps)?;
        let count =
            ((envelope.airspeed_max_mps - envelope.airspeed_min_mps) / TRIM_SPACING) as usize;
        // airspeeds without a trim are interpolated from their neighbours
        let speeds = (0..=count).map(|i| envelope.airspeed_min_mps + i as f64 * TRIM_SPACING);
        let mut config = Config::new(envelope, speeds.filter_map(|v| row(v).ok()).collect());
        config.answers = Some(Answers::of(model, envelope.airspeed_cruise_mps)?);
        config.lift = LiftCurve::of(model, envelope.airspeed_cruise_mps)?;
        config.side_force = SideForce::of(model, envelope.airspeed_cruise_mps)?;
        config.check()?;
        Ok(config)
    }

    /// Default settings with an envelope and a trim table.
    pub fn new(envelope: Envelope, trim: Vec<TrimPoint>) -> Self {
        Config {
            envelope,
            offboard_loss_s: 1.0,
            vehicle_loss_s: 0.5,
            // Five frames: longer than the jitter of a link, and too short for a wrong aileron to roll the aircraft
            // far.
            state_hold_s: 0.05,
            // Full travel in 0.2 s, the time constant of the motor: a faster command would not change the thrust.
            throttle_slew_per_s: 5.0,
            thrust_source: ThrustSource::Cruise,
            arm_tilt_max_deg: 60.0,
            // Small fixed-wing aircraft fly faster than this.
            disarm_airspeed_max_mps: 8.0,
            trim,
            answers: None,
            lift: None,
            side_force: None,
        }
    }
}

fn trim_row(model: &GreyBox, airspeed: f64) -> Result<TrimPoint, TrimError> {
    // the table holds for the reference altitude: trim depends on equivalent airspeed, which changes by 5 % per 1000 m
    // at a given true airspeed
    let trim = Trim::straight(model, airspeed, model.airframe.reference.altitude)?;
    let command = model.airframe.actuators.command(&trim.controls);
    Ok(TrimPoint {
        airspeed_mps: airspeed,
        pitch_deg: trim.state.pitch.to_degrees(),
        elevator: command.elevator,
        throttle: command.throttle,
    })
}

/// A setting is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A value is outside its range.
    #[error("pilot setting `{name}` is {value}: give a number from {low} to {high}")]
    Range {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// Smallest value that is allowed.
        low: f64,
        /// Largest value that is allowed.
        high: f64,
    },
    /// Two settings contradict each other.
    #[error("pilot setting `{smaller}` must lie below `{larger}`: correct one of them")]
    Order {
        /// The setting that must be smaller.
        smaller: &'static str,
        /// The setting that must be larger.
        larger: &'static str,
    },
    /// The trim table cannot be interpolated.
    #[error(
        "pilot table `trim` needs at least one row, finite numbers, and rising airspeeds: correct the rows"
    )]
    Trim,
    /// The model has no trim at the cruise airspeed, neither level nor in a descent.
    #[error("the pilot needs level trim at the cruise airspeed: {0}")]
    NoTrim(#[from] TrimError),
}

impl Config {
    /// Checks that all settings are in range, that their bounds are in order, and that the trim table is valid.
    ///
    /// # Errors
    ///
    /// The first setting outside its range, the first contradictory pair, or an invalid trim table.
    pub fn check(&self) -> Result<(), ConfigError> {
        for (name, value, low, high) in self.ranges() {
            if !(value >= low && value <= high) {
                return Err(ConfigError::Range { name, value, low, high });
            }
        }
        let e = &self.envelope;
        let ordered = [
            ("pitch_min_deg", e.pitch_min_deg, "pitch_max_deg", e.pitch_max_deg),
            ("airspeed_min_mps", e.airspeed_min_mps, "airspeed_cruise_mps", e.airspeed_cruise_mps),
            ("airspeed_cruise_mps", e.airspeed_cruise_mps, "airspeed_max_mps", e.airspeed_max_mps),
        ];
        for (smaller, low, larger, high) in ordered {
            if low >= high {
                return Err(ConfigError::Order { smaller, larger });
            }
        }
        self.check_trim()
    }

    fn check_trim(&self) -> Result<(), ConfigError> {
        let finite = |t: &TrimPoint| {
            t.airspeed_mps > 0.0
                && t.pitch_deg.abs() <= 30.0
                && t.elevator.abs() <= 1.0
                && (0.0..=1.0).contains(&t.throttle)
        };
        let rising = self.trim.windows(2).all(|w| w[0].airspeed_mps < w[1].airspeed_mps);
        if self.trim.is_empty() || !rising || !self.trim.iter().all(finite) {
            Err(ConfigError::Trim)
        } else {
            Ok(())
        }
    }

    fn ranges(&self) -> [(&'static str, f64, f64, f64); 14] {
        let e = &self.envelope;
        [
            ("offboard_loss_s", self.offboard_loss_s, 0.1, 60.0),
            ("vehicle_loss_s", self.vehicle_loss_s, 0.05, 5.0),
            ("state_hold_s", self.state_hold_s, 0.0, 0.5),
            ("bank_max_deg", e.bank_max_deg, 5.0, 80.0),
            ("pitch_max_deg", e.pitch_max_deg, 5.0, 60.0),
            ("pitch_min_deg", e.pitch_min_deg, -60.0, -5.0),
            ("airspeed_cruise_mps", e.airspeed_cruise_mps, 1.0, 100.0),
            ("airspeed_min_mps", e.airspeed_min_mps, 1.0, 100.0),
            ("airspeed_max_mps", e.airspeed_max_mps, 1.0, 110.0),
            ("load_factor_max", e.load_factor_max, 1.1, 10.0),
            ("surface_slew_per_s", e.surface_slew_per_s, 1.0, 200.0),
            ("throttle_slew_per_s", self.throttle_slew_per_s, 0.5, 100.0),
            ("arm_tilt_max_deg", self.arm_tilt_max_deg, 5.0, 180.0),
            ("disarm_airspeed_max_mps", self.disarm_airspeed_max_mps, 0.0, 100.0),
        ]
    }

    /// Trim of straight flight at a true airspeed (m/s): linear between the rows of the table, constant outside.
    pub fn trim_at(&self, airspeed_mps: f64) -> TrimPoint {
        let (first, last) = (self.trim[0], self.trim[self.trim.len() - 1]);
        if airspeed_mps <= first.airspeed_mps {
            return first;
        }
        for pair in self.trim.windows(2) {
            if airspeed_mps <= pair[1].airspeed_mps {
                return between(&pair[0], &pair[1], airspeed_mps);
            }
        }
        last
    }
}

fn between(a: &TrimPoint, b: &TrimPoint, airspeed_mps: f64) -> TrimPoint {
    let share = (airspeed_mps - a.airspeed_mps) / (b.airspeed_mps - a.airspeed_mps);
    let mix = |x: f64, y: f64| x + share * (y - x);
    TrimPoint {
        airspeed_mps,
        pitch_deg: mix(a.pitch_deg, b.pitch_deg),
        elevator: mix(a.elevator, b.elevator),
        throttle: mix(a.throttle, b.throttle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn model() -> GreyBox {
        GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap()
    }

    fn x8() -> Config {
        Config::for_model(&model()).unwrap()
    }

    #[test]
    fn every_model_of_the_x8_gives_settings_that_can_be_flown() {
        for name in ["jsbsim", "prior", "prior-mild", "prior-severe"] {
            let model = GreyBox::load(Path::new(&format!(
                "{}/../../params/x8/{name}.toml",
                env!("CARGO_MANIFEST_DIR")
            )))
            .unwrap();
            assert_eq!(Config::for_model(&model).unwrap().check(), Ok(()), "{name}");
        }
    }

    #[test]
    fn trim_is_that_of_the_simulator() {
        let full = model().airframe.actuators.elevator.travel.most;
        // Three rows measured in JSBSim. The tolerance of 0.05° is half of the table's largest interpolation error.
        for (airspeed, pitch, deflection, throttle) in [
            (16.67, 2.283, 0.01855, 0.118),
            (20.0, 0.858, 0.0688, 0.185),
            (25.0, -0.30, 0.1096, 0.308),
        ] {
            let row = x8().trim_at(airspeed);
            assert!((row.pitch_deg - pitch).abs() < 0.05, "{row:?}");
            assert!((row.elevator - deflection / full).abs() < 0.005, "{row:?}");
            assert!((row.throttle - throttle).abs() < 0.002, "{row:?}");
        }
    }

    #[test]
    fn trim_is_linear_between_rows_and_constant_beyond() {
        let row = |airspeed_mps, pitch_deg| TrimPoint {
            airspeed_mps,
            pitch_deg,
            elevator: 0.0,
            throttle: 0.2,
        };
        let config = Config { trim: vec![row(20.0, 2.0), row(25.0, 1.0)], ..x8() };
        assert_eq!(config.trim_at(22.5), row(22.5, 1.5));
        assert_eq!(config.trim_at(5.0), config.trim[0]);
        assert_eq!(config.trim_at(80.0), config.trim[1]);
    }

    #[test]
    fn a_contradiction_names_both_sides() {
        let mut config = x8();
        config.envelope.airspeed_min_mps = 30.0;
        let words = config.check().unwrap_err().to_string();
        assert!(
            words.contains("airspeed_min_mps") && words.contains("airspeed_cruise_mps"),
            "{words}"
        );
        assert!(Config { throttle_slew_per_s: f64::NAN, ..x8() }.check().is_err());
        assert!(Config { trim: vec![], ..x8() }.check().is_err());
    }

    #[test]
    fn the_trim_table_spans_the_envelope_by_a_row_for_each_metre_a_second() {
        let speeds: Vec<f64> = x8().trim.iter().map(|row| row.airspeed_mps).collect();
        let wanted: Vec<f64> = (13..=45).map(f64::from).collect();
        assert_eq!(speeds, wanted);
    }

    #[test]
    fn rows_that_do_not_rise_or_are_no_trim_are_refused() {
        let good = TrimPoint { airspeed_mps: 20.0, pitch_deg: 2.0, elevator: 0.1, throttle: 0.2 };
        let check = |trim: Vec<TrimPoint>| Config { trim, ..x8() }.check();
        assert_eq!(check(vec![good]), Ok(()));
        assert_eq!(check(vec![good, good]), Err(ConfigError::Trim));
        // The bounds are accepted. Values beyond them are rejected.
        let edge = TrimPoint { pitch_deg: -30.0, elevator: 1.0, throttle: 1.0, ..good };
        assert_eq!(check(vec![edge]), Ok(()));
        for bad in [
            TrimPoint { airspeed_mps: 0.0, ..good },
            TrimPoint { pitch_deg: 30.1, ..good },
            TrimPoint { elevator: -1.1, ..good },
            TrimPoint { throttle: f64::NAN, ..good },
        ] {
            assert_eq!(check(vec![bad]), Err(ConfigError::Trim), "{bad:?}");
        }
    }
}

//! The MAVLink parameters that clients (ground stations and offboard programs) can read and set, and the settings of the pilot
//! that they change.

use super::config::{Config, ThrustSource};
use greylag_link::autopilot::{Parameter, ParameterValue, Verdict};

/// A parameter with a floating-point value: name, getter and setter.
type Real = (&'static str, fn(&Config) -> f64, fn(&mut Config, f64));

/// The floating-point parameters in the order of their indices. Names have at most 16 characters.
const REALS: [Real; 12] = [
    ("GL_OFFB_LOSS_S", |c| c.offboard_loss_s, |c, x| c.offboard_loss_s = x),
    ("GL_VEH_LOSS_S", |c| c.vehicle_loss_s, |c, x| c.vehicle_loss_s = x),
    ("GL_BANK_MAX_DEG", |c| c.envelope.bank_max_deg, |c, x| c.envelope.bank_max_deg = x),
    ("GL_PITCH_MAX_DEG", |c| c.envelope.pitch_max_deg, |c, x| c.envelope.pitch_max_deg = x),
    ("GL_PITCH_MIN_DEG", |c| c.envelope.pitch_min_deg, |c, x| c.envelope.pitch_min_deg = x),
    (
        "GL_CRUISE_MPS",
        |c| c.envelope.airspeed_cruise_mps,
        |c, x| c.envelope.airspeed_cruise_mps = x,
    ),
    ("GL_AIRSPD_MIN", |c| c.envelope.airspeed_min_mps, |c, x| c.envelope.airspeed_min_mps = x),
    ("GL_AIRSPD_MAX", |c| c.envelope.airspeed_max_mps, |c, x| c.envelope.airspeed_max_mps = x),
    ("GL_LOAD_MAX", |c| c.envelope.load_factor_max, |c, x| c.envelope.load_factor_max = x),
    ("GL_SLEW_SURF", |c| c.envelope.surface_slew_per_s, |c, x| c.envelope.surface_slew_per_s = x),
    ("GL_SLEW_THR", |c| c.throttle_slew_per_s, |c, x| c.throttle_slew_per_s = x),
    ("GL_DISARM_MPS", |c| c.disarm_airspeed_max_mps, |c, x| c.disarm_airspeed_max_mps = x),
];
/// Index of GL_THRUST_SRC: 0 selects the controller's throttle for the cruise airspeed, 1 the setpoint's thrust.
const THRUST_SOURCE: usize = REALS.len();
/// Index of SYSID_THISMAV, a constant that ground stations read.
const SYSTEM_ID: usize = REALS.len() + 1;
/// System id of the autopilot as clients see it.
const AUTOPILOT_SYSTEM: i32 = 1;

/// The parameter table of `config`.
pub(super) fn table(config: &Config) -> Vec<Parameter> {
    let reals = REALS
        .iter()
        .map(|(name, get, _)| Parameter { name, value: ParameterValue::Real(get(config) as f32) });
    let source = match config.thrust_source {
        ThrustSource::Cruise => 0,
        ThrustSource::Setpoint => 1,
    };
    let ints = [("GL_THRUST_SRC", source), ("SYSID_THISMAV", AUTOPILOT_SYSTEM)];
    reals
        .chain(ints.map(|(name, value)| Parameter { name, value: ParameterValue::Int(value) }))
        .collect()
}

/// `config` with parameter `index` set to `value`.
///
/// # Errors
///
/// The verdict for the client if the index or the type is unknown, or if the resulting settings are invalid.
pub(super) fn changed(
    config: &Config,
    index: usize,
    value: ParameterValue,
) -> Result<Config, Verdict> {
    let mut config = config.clone();
    match (index, value) {
        (THRUST_SOURCE, ParameterValue::Int(value)) => {
            config.thrust_source = match value {
                0 => ThrustSource::Cruise,
                1 => ThrustSource::Setpoint,
                _ => {
                    return denied(format!(
                        "GL_THRUST_SRC {value}: give 0 (cruise airspeed) or 1 (setpoint)"
                    ));
                }
            };
        }
        (SYSTEM_ID, ParameterValue::Int(AUTOPILOT_SYSTEM)) => {}
        (SYSTEM_ID, _) => return denied("SYSID_THISMAV is fixed at 1".into()),
        (index, ParameterValue::Real(value)) if index < REALS.len() => {
            REALS[index].2(&mut config, f64::from(value))
        }
        _ => return denied(format!("no parameter {index} of this type")),
    }
    match config.check() {
        Ok(()) => Ok(config),
        Err(error) => denied(error.to_string()),
    }
}

fn denied(words: String) -> Result<Config, Verdict> {
    Err(Verdict::Denied(words))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::TrimPoint;
    use greylag_physics::Airframe;
    use std::path::Path;

    fn x8() -> Config {
        let airframe = Airframe::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/airframe.toml"
        )))
        .unwrap();
        let row =
            TrimPoint { airspeed_mps: 20.0, pitch_deg: 0.858, elevator: 0.13, throttle: 0.185 };
        Config::new(airframe.envelope, vec![row])
    }

    #[test]
    fn names_fit_the_field_of_param_value_and_differ() {
        let table = table(&x8());
        for p in &table {
            assert!(p.name.is_ascii() && p.name.len() <= 16, "{}", p.name);
        }
        let mut names: Vec<_> = table.iter().map(|p| p.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), table.len());
    }

    #[test]
    fn every_entry_takes_back_its_own_value() {
        let config = x8();
        for (i, p) in table(&config).iter().enumerate() {
            let after = changed(&config, i, p.value).unwrap();
            assert_eq!(table(&after)[i], *p);
        }
    }

    #[test]
    fn a_refusal_says_what_would_be_accepted() {
        let config = x8();
        let Err(Verdict::Denied(words)) = changed(&config, 2, ParameterValue::Real(90.0)) else {
            panic!()
        };
        assert!(words.contains("bank_max_deg") && words.contains("80"), "{words}");
        for bad in [f32::NAN, f32::INFINITY, -1e30] {
            assert!(changed(&config, 0, ParameterValue::Real(bad)).is_err());
        }
        assert!(changed(&config, THRUST_SOURCE, ParameterValue::Int(2)).is_err());
        assert!(changed(&config, SYSTEM_ID, ParameterValue::Int(7)).is_err());
        assert!(changed(&config, THRUST_SOURCE, ParameterValue::Real(1.0)).is_err());
        assert!(changed(&config, 999, ParameterValue::Real(1.0)).is_err());
        // The cruise airspeed must exceed the minimum airspeed. Otherwise the airspeed protection would act in HOLD.
        assert!(changed(&config, 5, ParameterValue::Real(12.0)).is_err());
    }
}

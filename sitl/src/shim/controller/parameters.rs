//! Parameter server of the simulated stacks, with the parameters that concern a companion.

use super::Personality;
use crate::shim::codec::{Encoder, ParamRequestRead, ParamSet, ParamValue};
use crate::shim::error::ShimError;

/// MAV_PARAM_TYPE_INT32 and MAV_PARAM_TYPE_REAL32.
const INT: u8 = 6;
const REAL: u8 = 9;

/// Name, value and type of PX4's parameters. The values are PX4's defaults, except where a companion needs another value.
const PX4: [(&str, f64, u8); 14] = [
    ("PWM_MAIN_REV", 0.0, INT),
    ("MAV_SYS_ID", 1.0, INT),
    ("COM_RC_IN_MODE", 1.0, INT),
    ("COM_RC_LOSS_T", 0.5, REAL),
    ("NAV_RCL_ACT", 1.0, INT),
    ("COM_OF_LOSS_T", 0.5, REAL),
    ("COM_OBL_RC_ACT", 5.0, INT),
    ("FW_MAN_R_SC", 1.0, REAL),
    ("FW_MAN_P_SC", 1.0, REAL),
    ("FW_MAN_Y_SC", 1.0, REAL),
    ("TRIM_ROLL", 0.01, REAL),
    ("TRIM_PITCH", -0.02, REAL),
    ("FW_AIRSPD_TRIM", 20.0, REAL),
    ("IMU_GYRO_CUTOFF", 40.0, REAL),
];

/// Name, value and type of ArduPilot's parameters, with the calibration of an RC transmitter whose pitch channel is
/// reversed.
const ARDUPILOT: [(&str, f64, u8); 41] = [
    ("SERVO1_REVERSED", 0.0, INT),
    ("SERVO2_REVERSED", 0.0, INT),
    ("SYSID_THISMAV", 1.0, INT),
    ("MAV_GCS_SYSID", 1.0, INT),
    ("SCHED_LOOP_RATE", 200.0, INT),
    ("RC_OVERRIDE_TIME", 0.5, REAL),
    ("GUIDED_TIMEOUT", 1.0, REAL),
    ("THR_FAILSAFE", 1.0, INT),
    ("FS_SHORT_ACTN", 0.0, INT),
    ("FS_LONG_ACTN", 1.0, INT),
    ("RC_FS_TIMEOUT", 1.0, REAL),
    ("FS_GCS_ENABL", 1.0, INT),
    ("FS_LONG_TIMEOUT", 2.0, REAL),
    ("MAV_GCS_SYSID_HI", 0.0, INT),
    ("RC_OPTIONS", 32.0, INT),
    // Parameter of ArduPilot's simulator: 1 for no RC transmitter, 0 for an RC transmitter with released sticks.
    ("SIM_RC_FAIL", 1.0, INT),
    // Cutoff of the gyro low-pass, Hz (0 for no filter). SIM_SERVO_DELAY is the delay from command to surface, ms.
    ("INS_GYRO_FILTER", 20.0, INT),
    ("SIM_SERVO_DELAY", 0.0, INT),
    ("RCMAP_ROLL", 1.0, INT),
    ("RCMAP_PITCH", 2.0, INT),
    ("RCMAP_THROTTLE", 3.0, INT),
    ("RCMAP_YAW", 4.0, INT),
    ("RC1_OPTION", 0.0, INT),
    ("RC2_OPTION", 0.0, INT),
    ("RC3_OPTION", 0.0, INT),
    ("MAN_EXPO_ROLL", 0.0, INT),
    ("MAN_EXPO_PITCH", 0.0, INT),
    ("RC1_MIN", 1000.0, INT),
    ("RC1_TRIM", 1494.0, INT),
    ("RC1_MAX", 2000.0, INT),
    ("RC1_REVERSED", 0.0, INT),
    ("RC2_MIN", 1000.0, INT),
    ("RC2_TRIM", 1507.0, INT),
    ("RC2_MAX", 2000.0, INT),
    ("RC2_REVERSED", 1.0, INT),
    ("RC3_MIN", 1000.0, INT),
    ("RC3_TRIM", 1000.0, INT),
    ("RC3_MAX", 2000.0, INT),
    ("RC3_REVERSED", 0.0, INT),
    ("TRIM_THROTTLE", 45.0, INT),
    ("AIRSPEED_CRUISE", 20.0, REAL),
];

/// Parameters of a flight stack.
fn rows(personality: Personality) -> &'static [(&'static str, f64, u8)] {
    match personality {
        Personality::Px4 => &PX4,
        Personality::Ardupilot => &ARDUPILOT,
    }
}

/// The present parameter values of a stack.
#[derive(Clone, Debug)]
pub(super) struct Table {
    personality: Personality,
    rows: Vec<(&'static str, f64, u8)>,
}

impl Table {
    /// Whether a stack has a parameter of this name.
    pub(super) fn has(personality: Personality, name: &str) -> bool {
        rows(personality).iter().any(|(known, ..)| *known == name)
    }

    pub(super) fn new(
        personality: Personality,
        changed: &[(String, f64)],
    ) -> Result<Self, ShimError> {
        let rows = rows(personality);
        let mut table = Table { personality, rows: rows.to_vec() };
        for (name, value) in changed {
            let row = table.rows.iter_mut().find(|(known, ..)| known == name);
            let known = || rows.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(", ");
            let stack = if personality == Personality::Px4 { "px4" } else { "ardupilot" };
            row.ok_or_else(|| ShimError::Parameter {
                stack,
                name: name.clone(),
                known: known(),
            })?
            .1 = *value;
        }
        Ok(table)
    }

    /// The value of a parameter; NaN if the stack does not have it.
    pub(super) fn get(&self, name: &str) -> f64 {
        self.rows.iter().find(|(known, ..)| *known == name).map_or(f64::NAN, |(_, value, _)| *value)
    }

    /// Sets a parameter; a name that the stack does not have has no effect.
    pub(super) fn put(&mut self, name: &str, value: f64) {
        self.rows.iter_mut().filter(|(known, ..)| *known == name).for_each(|row| row.1 = value);
    }

    fn find(&self, id: &[u8; 16]) -> Option<usize> {
        let name = id.split(|b| *b == 0).next().unwrap_or_default();
        self.rows.iter().position(|(known, ..)| known.as_bytes() == name)
    }

    pub(super) fn read(&self, m: &ParamRequestRead, encoder: &mut Encoder, out: &mut Vec<u8>) {
        let asked = match usize::try_from(m.param_index) {
            Ok(index) => Some(index).filter(|index| *index < self.rows.len()),
            Err(_) => self.find(&m.param_id),
        };
        if let Some(index) = asked {
            encoder.encode(&self.value(index), out);
        }
    }

    pub(super) fn list(&self, encoder: &mut Encoder, out: &mut Vec<u8>) {
        (0..self.rows.len()).for_each(|index| encoder.encode(&self.value(index), out));
    }

    pub(super) fn set(&mut self, m: &ParamSet, encoder: &mut Encoder, out: &mut Vec<u8>) {
        let Some(index) = self.find(&m.param_id) else { return };
        let sent = match (self.personality, m.param_type) {
            (Personality::Px4, INT) => f64::from(m.param_value.to_bits() as i32),
            _ => f64::from(m.param_value),
        };
        if sent.is_finite() {
            self.rows[index].1 = sent;
        }
        encoder.encode(&self.value(index), out);
    }

    fn value(&self, index: usize) -> ParamValue {
        let (name, value, kind) = self.rows[index];
        let mut param_id = [0; 16];
        param_id[..name.len()].copy_from_slice(name.as_bytes());
        let param_value = match (self.personality, kind) {
            // PX4 sends the bytes of an integer in the float field; ArduPilot sends its value as a float.
            (Personality::Px4, INT) => f32::from_bits(value as i32 as u32),
            _ => value as f32,
        };
        let param_count = self.rows.len() as u16;
        ParamValue {
            param_value,
            param_count,
            param_index: index as u16,
            param_id,
            param_type: kind,
        }
    }
}

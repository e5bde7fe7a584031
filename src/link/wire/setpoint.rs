//! Decoding and validation of attitude setpoints and stick positions from clients (ground stations and offboard programs).

use mavlink::dialects::ardupilotmega::{MANUAL_CONTROL_DATA, SET_ATTITUDE_TARGET_DATA};

use crate::autopilot::{AttitudeSetpoint, Sticks};

/// Bit of the setpoint's type mask that marks the thrust as ignored.
const IGNORE_THRUST: u8 = 64;
/// Bit of the setpoint's type mask that marks the attitude as ignored.
const IGNORE_ATTITUDE: u8 = 128;
/// Norms of quaternions that are accepted and normalised. A quaternion outside this range is invalid.
const NORM: std::ops::RangeInclusive<f64> = 0.1..=10.0;
/// Largest valid magnitude of the thrust. Valid thrust is clamped to 0..1.
const MAX_THRUST: f64 = 1.5;
/// INT16_MAX marks an axis of MANUAL_CONTROL as invalid.
const NO_AXIS: i16 = i16::MAX;

/// Reason for which a setpoint is refused. A refused setpoint does not restart the timeout of OFFBOARD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetpointFault {
    /// A value is NaN, infinite or out of range.
    NotFinite,
    /// The quaternion has a zero norm.
    NoAttitude,
    /// The type mask ignores the attitude: only body rates or thrust are commanded.
    AttitudeMasked,
}

/// The commanded attitude. Body rates and yaw are ignored, because a fixed-wing aircraft turns by banking.
pub(super) fn attitude(data: &SET_ATTITUDE_TARGET_DATA) -> Result<AttitudeSetpoint, SetpointFault> {
    let mask = data.type_mask.bits();
    if mask & IGNORE_ATTITUDE != 0 {
        return Err(SetpointFault::AttitudeMasked);
    }
    let thrust = match mask & IGNORE_THRUST {
        0 => Some(thrust(data.thrust)?),
        _ => None,
    };
    let (roll, pitch, _) = euler(data.q.map(f64::from))?;
    Ok(AttitudeSetpoint { roll, pitch, thrust })
}

fn thrust(sent: f32) -> Result<f64, SetpointFault> {
    let thrust = f64::from(sent);
    match thrust.abs() <= MAX_THRUST {
        true => Ok(thrust.clamp(0.0, 1.0)),
        false => Err(SetpointFault::NotFinite),
    }
}

/// Roll, pitch and yaw, rad, of a quaternion NED→FRD (w first). Its sign does not matter, and its norm may be 0.1..10.
///
/// # Errors
/// If a component is not finite or the norm is outside this range.
pub fn euler(q: [f64; 4]) -> Result<(f64, f64, f64), SetpointFault> {
    if q.iter().any(|x| !x.is_finite()) {
        return Err(SetpointFault::NotFinite);
    }
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if norm == 0.0 {
        return Err(SetpointFault::NoAttitude);
    }
    if !NORM.contains(&norm) {
        return Err(SetpointFault::NotFinite);
    }
    let [w, x, y, z] = q.map(|c| c / norm);
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    Ok((roll, pitch, yaw))
}

/// The quaternion NED→FRD, w first, of Euler angles roll, pitch and yaw in rad.
pub fn quaternion([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) =
        ((roll / 2.0).sin_cos(), (pitch / 2.0).sin_cos(), (yaw / 2.0).sin_cos());
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

/// Stick positions. `None` if roll, pitch or throttle is marked as invalid.
pub(super) fn sticks(data: &MANUAL_CONTROL_DATA) -> Option<Sticks> {
    if [data.x, data.y, data.z].contains(&NO_AXIS) {
        return None;
    }
    let axis = |sent: i16, low: f64| (f64::from(sent) / 1000.0).clamp(low, 1.0);
    Some(Sticks {
        roll: axis(data.y, -1.0),
        pitch: axis(data.x, -1.0),
        throttle: axis(data.z, 0.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quaternion_and_its_negative_are_one_attitude() {
        // Any attitude away from ±90° pitch. The tolerance of 1e-12 covers the rounding of a dozen operations.
        let angles = [0.7, -0.3, 2.5];
        let q = quaternion(angles);
        for signed in [q, q.map(|c| -c), q.map(|c| 3.0 * c)] {
            let (roll, pitch, yaw) = euler(signed).unwrap();
            for (got, want) in [roll, pitch, yaw].into_iter().zip(angles) {
                assert!((got - want).abs() < 1e-12, "{got} for {want}");
            }
        }
    }

    #[test]
    fn garbage_is_no_attitude() {
        assert_eq!(euler([0.0; 4]), Err(SetpointFault::NoAttitude));
        assert_eq!(euler([1e30, 0.0, 0.0, 0.0]), Err(SetpointFault::NotFinite));
        assert_eq!(euler([f64::NAN, 0.0, 0.0, 1.0]), Err(SetpointFault::NotFinite));
        assert_eq!(thrust(1e30), Err(SetpointFault::NotFinite));
        assert_eq!(thrust(f32::NAN), Err(SetpointFault::NotFinite));
        assert_eq!(thrust(-0.5), Ok(0.0));
    }
}

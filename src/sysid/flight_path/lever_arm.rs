//! Lever arms: effect of rotation on sensors away from the centre of gravity.

use nalgebra::Vector3;

use crate::flight_path::intake::Track;

/// Half of the interval over which gyro rates are differenced to angular acceleration, s.
const HALF_S: f64 = 0.02;

/// Transfers the specific force of an accelerometer at `at` (m from the centre of gravity, body axes) to the centre
/// of gravity: f − ω̇ × r − ω × (ω × r), for a sampling interval of `step` (s).
pub fn to_the_centre(track: &mut Track, at: [f64; 3], step: f64) {
    let at = Vector3::from(at);
    let (half, last) = ((HALF_S / step).round().max(1.0) as usize, track.len().saturating_sub(1));
    for k in 0..track.len() {
        let (from, to) = (k.saturating_sub(half), (k + half).min(last));
        let gained = Vector3::from(track.rates[to]) - Vector3::from(track.rates[from]);
        let turning = gained / ((to - from).max(1) as f64 * step);
        let rate = Vector3::from(track.rates[k]);
        let shown = Vector3::from(track.force[k]);
        track.force[k] = (shown - turning.cross(&at) - rate.cross(&rate.cross(&at))).into();
    }
}

/// Velocity through the air (m/s, body axes) at the position `at` (m), from that at the centre of gravity, `air`, and
/// the body rates `rate` (rad/s).
pub fn air_at(air: &Vector3<f64>, rate: &Vector3<f64>, at: [f64; 3]) -> Vector3<f64> {
    air + rate.cross(&Vector3::from(at))
}

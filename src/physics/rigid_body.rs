//! Rigid-body dynamics: the rates of the state for given forces and moments, eqs. (7)–(12) and (35) of \[GSFM26\] (see
//! `src/lib.rs`).

use crate::wrench::Channel;
use crate::{AirData, State, Wrench};
use greylag_num::{Real, each};

/// Mass and moments of inertia, in FRD axes through the centre of gravity.
///
/// The product of inertia `jxz` enters the inertia matrix as −Jxz, as in \[BM12\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidBody<R = f64> {
    /// Mass of the aircraft, kg.
    pub mass: R,
    /// Moment of inertia about body x, kg m².
    pub jx: R,
    /// Moment of inertia about body y, kg m².
    pub jy: R,
    /// Moment of inertia about body z, kg m².
    pub jz: R,
    /// Product of inertia in the x–z plane, kg m².
    pub jxz: R,
}

impl RigidBody {
    /// Whether the values are physical: a positive mass and a positive definite inertia matrix.
    pub fn is_physical(&self) -> bool {
        let RigidBody { mass, jx, jy, jz, jxz } = *self;
        mass > 0.0 && jx > 0.0 && jy > 0.0 && jz > 0.0 && jx * jz > jxz * jxz
    }

    /// Whether an iteration may step from this body to `next`.
    ///
    /// The body `next` must be physical. It must keep at least a third of the mass and a third of 1 − Jxz²/(Jx Jz), which is
    /// zero for a singular inertia matrix. A longer step may end near a singular matrix, with nearly infinite accelerations.
    pub fn may_become(&self, next: &RigidBody) -> bool {
        let room = |b: &RigidBody| 1.0 - b.jxz * b.jxz / (b.jx * b.jz);
        next.is_physical() && 3.0 * next.mass >= self.mass && 3.0 * room(next) >= room(self)
    }
}

impl<R: Copy> RigidBody<R> {
    /// Converts every value with `f`.
    #[inline(always)]
    pub fn map<S>(&self, f: impl Fn(R) -> S) -> RigidBody<S> {
        RigidBody {
            mass: f(self.mass),
            jx: f(self.jx),
            jy: f(self.jy),
            jz: f(self.jz),
            jxz: f(self.jxz),
        }
    }
}

/// Axes in which a model's aerodynamic forces are expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceAxes {
    /// Lift and drag rotated by α only, side force along body y: eqs. (39), (43) of \[GSFM26\].
    Stability,
    /// All three forces rotated by α and β, like JSBSim's DRAG, SIDE and LIFT axes.
    Wind,
}

/// A vector in FRD body axes, unless stated otherwise.
pub type Vector<R> = [R; 3];

/// Forces without gravity in body axes, N (eq. 36 without eq. 37).
#[inline(always)]
pub fn body_force<R: Real>(wrench: &Wrench<R>, air: &AirData<R>, axes: ForceAxes) -> Vector<R> {
    let (drag, side, lift) =
        (wrench.get(Channel::Drag), wrench.get(Channel::Side), wrench.get(Channel::Lift));
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let (along, across) = match axes {
        ForceAxes::Stability => (-drag, side),
        ForceAxes::Wind => (-drag * cos_beta - side * sin_beta, side * cos_beta - drag * sin_beta),
    };
    [
        along * cos_alpha + lift * sin_alpha + wrench.get(Channel::BodyX),
        across,
        along * sin_alpha - lift * cos_alpha,
    ]
}

/// Drag, side force and lift (N) that give `force` (N, body axes): the inverse of [`body_force`] without thrust.
#[inline(always)]
pub fn aerodynamic_force<R: Real>(
    force: Vector<R>,
    air: &AirData<R>,
    axes: ForceAxes,
) -> Vector<R> {
    let [x, y, z] = force;
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let along = x * cos_alpha + z * sin_alpha;
    let lift = x * sin_alpha - z * cos_alpha;
    let (drag, side) = match axes {
        ForceAxes::Stability => (-along, y),
        ForceAxes::Wind => (-(along * cos_beta + y * sin_beta), y * cos_beta - along * sin_beta),
    };
    [drag, side, lift]
}

/// Gravity in body axes, m/s² (eq. 37).
#[inline(always)]
pub fn gravity_in_body<R: Real>(state: &State<R>, gravity: f64) -> Vector<R> {
    let (sin_roll, cos_roll) = state.roll.sin_cos();
    let (sin_pitch, cos_pitch) = state.pitch.sin_cos();
    [
        -sin_pitch.scale(gravity),
        (cos_pitch * sin_roll).scale(gravity),
        (cos_pitch * cos_roll).scale(gravity),
    ]
}

/// Angular acceleration in body axes, rad/s², under `moment` (N m): eq. (10) with the Γ terms of \[BM12\] section 3.3.
#[inline(always)]
pub fn angular_acceleration<R: Real>(
    body: &RigidBody<R>,
    state: &State<R>,
    moment: Vector<R>,
) -> Vector<R> {
    let RigidBody { jx, jy, jz, jxz, .. } = *body;
    let (p, q, r) = (state.p, state.q, state.r);
    let gamma = jx * jz - jxz * jxz;
    // the moments less the gyroscopic terms are multiplied by the inverse of the inertia matrix
    let roll = moment[0] + jxz * p * q - (jz - jy) * q * r;
    let pitch = moment[1] + (jz - jx) * p * r - jxz * (p * p - r * r);
    let yaw = moment[2] - jxz * q * r + (jx - jy) * p * q;
    [(jz * roll + jxz * yaw) / gamma, pitch / jy, (jxz * roll + jx * yaw) / gamma]
}

/// Rates of the Euler angles (φ̇, θ̇, ψ̇), rad/s (eqs. 7, 8).
#[inline(always)]
pub fn attitude_rate<R: Real>(state: &State<R>) -> Vector<R> {
    let (sin_roll, cos_roll) = state.roll.sin_cos();
    let (sin_pitch, cos_pitch) = state.pitch.sin_cos();
    let turn = (sin_roll * state.q + cos_roll * state.r) / cos_pitch;
    [state.p + sin_pitch * turn, cos_roll * state.q - sin_roll * state.r, turn]
}

/// Velocity relative to the air in body axes (u, v, w), m/s (eqs. 32–34).
#[inline(always)]
pub fn air_velocity<R: Real>(state: &State<R>, air: &AirData<R>) -> Vector<R> {
    let forward = state.airspeed * air.cos_beta;
    [forward * air.cos_alpha, state.airspeed * air.sin_beta, forward * air.sin_alpha]
}

/// The rate of the state for an `acceleration` (specific force plus gravity, body axes, m/s²) and an angular acceleration
/// `spin` (body axes, rad/s²): eqs. (7)–(12).
#[inline(always)]
pub fn state_rate<R: Real>(
    state: &State<R>,
    air: &AirData<R>,
    acceleration: Vector<R>,
    spin: Vector<R>,
) -> State<R> {
    let [gx, gy, gz] = acceleration;
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let (p, q, r, v) = (state.p, state.q, state.r, state.airspeed);
    let [roll, pitch, _] = attitude_rate(state);
    // eqs. (9), (11), (12) with u, v, w inserted and the Coriolis terms collected
    let forward = gx * cos_alpha + gz * sin_alpha;
    let downward = gz * cos_alpha - gx * sin_alpha;
    let airspeed = forward * cos_beta + gy * sin_beta;
    let per_vcb = R::from_f64(1.0) / (v * cos_beta);
    let alpha = q + (downward - sin_beta * v * (p * cos_alpha + r * sin_alpha)) * per_vcb;
    let beta = p * sin_alpha - r * cos_alpha + (gy * cos_beta - sin_beta * forward) / v;
    State { roll, pitch, airspeed, p: spin[0], q: spin[1], r: spin[2], alpha, beta }
}

/// Acceleration in body axes (m/s²) at which airspeed, α and β have the rates in `rate`: the inverse of [`state_rate`] with
/// respect to the acceleration.
#[inline(always)]
pub fn acceleration_of<R: Real>(state: &State<R>, air: &AirData<R>, rate: &State<R>) -> Vector<R> {
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let across = state.airspeed * rate.beta;
    let forward = rate.airspeed * cos_beta - across * sin_beta;
    let downward = state.airspeed * cos_beta * rate.alpha;
    [
        forward * cos_alpha - downward * sin_alpha,
        rate.airspeed * sin_beta + across * cos_beta,
        forward * sin_alpha + downward * cos_alpha,
    ]
}

/// Transpose of the linear map from acceleration and spin to rates in [`state_rate`]. It converts the gradient `slope` with
/// respect to the rates to the gradients with respect to acceleration and angular acceleration (body axes).
#[inline(always)]
pub fn state_rate_transposed<R: Real>(
    state: &State<R>,
    air: &AirData<R>,
    slope: &State<R>,
) -> (Vector<R>, Vector<R>) {
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let across = slope.beta / state.airspeed;
    let forward = cos_beta * slope.airspeed - sin_beta * across;
    let downward = slope.alpha / (state.airspeed * cos_beta);
    let acceleration = [
        cos_alpha * forward - sin_alpha * downward,
        sin_beta * slope.airspeed + cos_beta * across,
        sin_alpha * forward + cos_alpha * downward,
    ];
    (acceleration, [slope.p, slope.q, slope.r])
}

/// Transpose of the linear map from forces and moments to accelerations in [`body_force`] and [`angular_acceleration`]. It
/// converts gradients with respect to acceleration and angular acceleration (body axes) to the gradient with respect to
/// each channel.
#[inline(always)]
pub fn accelerations_transposed<R: Real>(
    body: &RigidBody<R>,
    air: &AirData<R>,
    axes: ForceAxes,
    acceleration: Vector<R>,
    spin: Vector<R>,
) -> Wrench<R> {
    let AirData { sin_alpha, cos_alpha, sin_beta, cos_beta, .. } = *air;
    let [x, y, z] = each(acceleration, |a| a / body.mass);
    let along = cos_alpha * x + sin_alpha * z;
    let (drag, side) = match axes {
        ForceAxes::Stability => (-along, y),
        ForceAxes::Wind => (-cos_beta * along - sin_beta * y, cos_beta * y - sin_beta * along),
    };
    let gamma = body.jx * body.jz - body.jxz * body.jxz;
    let mut wrench = Wrench::zero();
    wrench.add(Channel::Drag, drag);
    wrench.add(Channel::Side, side);
    wrench.add(Channel::Lift, sin_alpha * x - cos_alpha * z);
    wrench.add(Channel::BodyX, x);
    wrench.add(Channel::Roll, (body.jz * spin[0] + body.jxz * spin[2]) / gamma);
    wrench.add(Channel::Pitch, spin[1] / body.jy);
    wrench.add(Channel::Yaw, (body.jxz * spin[0] + body.jx * spin[2]) / gamma);
    wrench
}

/// Rotates a vector from body axes to the local horizon frame: the NED frame rotated about the vertical to the heading.
#[inline(always)]
pub fn body_to_horizon<R: Real>(state: &State<R>, v: Vector<R>) -> Vector<R> {
    let (sin_roll, cos_roll) = state.roll.sin_cos();
    let (sin_pitch, cos_pitch) = state.pitch.sin_cos();
    let [x, y, z] = v;
    let turned = y * sin_roll + z * cos_roll;
    [
        x * cos_pitch + turned * sin_pitch,
        y * cos_roll - z * sin_roll,
        turned * cos_pitch - x * sin_pitch,
    ]
}

/// Rotates a vector from the local horizon frame to body axes: the inverse of [`body_to_horizon`].
#[inline(always)]
pub fn horizon_to_body<R: Real>(state: &State<R>, v: Vector<R>) -> Vector<R> {
    let (sin_roll, cos_roll) = state.roll.sin_cos();
    let (sin_pitch, cos_pitch) = state.pitch.sin_cos();
    let [n, e, d] = v;
    let turned = n * sin_pitch + d * cos_pitch;
    [
        n * cos_pitch - d * sin_pitch,
        e * cos_roll + turned * sin_roll,
        turned * cos_roll - e * sin_roll,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::airframe::Geometry;

    const STATE: State = State {
        roll: 0.4,
        pitch: -0.3,
        airspeed: 19.0,
        p: 1.1,
        q: -0.7,
        r: 0.5,
        alpha: 0.12,
        beta: -0.08,
    };
    const GEOMETRY: Geometry = Geometry { area: 0.75, span: 2.1, chord: 0.3571 };

    /// The reference evaluates eqs. (9), (11), (12) as printed in \[GSFM26\], with the body velocities u, v, w.
    #[test]
    fn collected_rates_equal_the_printed_equations() {
        let air = AirData::new(&STATE, 1.156, 600.0, &GEOMETRY);
        let acceleration = [1.5, -2.0, -7.0];
        let [u, v, w] = air_velocity(&STATE, &air);
        let (p, q, r) = (STATE.p, STATE.q, STATE.r);
        let du = r * v - q * w + acceleration[0];
        let dv = p * w - r * u + acceleration[1];
        let dw = q * u - p * v + acceleration[2];
        let va = STATE.airspeed;
        let dva = (u * du + v * dv + w * dw) / va;
        let rate = state_rate(&STATE, &air, acceleration, [0.0; 3]);
        // the two forms differ only by rounding
        assert!((rate.airspeed - dva).abs() < 1e-12);
        assert!((rate.alpha - (u * dw - w * du) / (u * u + w * w)).abs() < 1e-12);
        assert!((rate.beta - (va * dv - v * dva) / (va * (va * va - v * v).sqrt())).abs() < 1e-12);
    }

    #[test]
    fn an_acceleration_of_rates_changes_the_state_at_these_rates() {
        let air = AirData::new(&STATE, 1.156, 600.0, &GEOMETRY);
        let wanted = State { airspeed: 1.5, alpha: -2.0, beta: 0.7, ..State::default() };
        let still = state_rate(&STATE, &air, [0.0; 3], [0.0; 3]);
        let moved = state_rate(&STATE, &air, acceleration_of(&STATE, &air, &wanted), [0.0; 3]);
        for (moved, wanted) in still.advance(&wanted, 1.0).to_array().iter().zip(moved.to_array()) {
            assert!((moved - wanted).abs() < 1e-13);
        }
    }

    /// Euler's equations are J ω̇ + ω × Jω = M, with the inertia matrix written out.
    #[test]
    fn angular_acceleration_satisfies_eulers_equations() {
        let body = RigidBody { mass: 3.364, jx: 1.2290, jy: 0.1702, jz: 0.8808, jxz: -0.9343 };
        let moment = [0.3, -0.2, 0.1];
        let [dp, dq, dr] = angular_acceleration(&body, &STATE, moment);
        let inertia = |w: [f64; 3]| {
            [body.jx * w[0] - body.jxz * w[2], body.jy * w[1], body.jz * w[2] - body.jxz * w[0]]
        };
        let (w, h) = ([STATE.p, STATE.q, STATE.r], inertia([STATE.p, STATE.q, STATE.r]));
        let cross =
            [w[1] * h[2] - w[2] * h[1], w[2] * h[0] - w[0] * h[2], w[0] * h[1] - w[1] * h[0]];
        let jw = inertia([dp, dq, dr]);
        for i in 0..3 {
            assert!((jw[i] + cross[i] - moment[i]).abs() < 1e-12, "axis {i}");
        }
    }

    #[test]
    fn rotations_undo_each_other() {
        let v = [3.0, -2.0, 1.0];
        let back = horizon_to_body(&STATE, body_to_horizon(&STATE, v));
        for i in 0..3 {
            assert!((back[i] - v[i]).abs() < 1e-14);
        }
        // in the horizon frame gravity points vertically down
        let down = body_to_horizon(&STATE, gravity_in_body(&STATE, 9.806));
        assert!(down[0].abs() < 1e-14 && down[1].abs() < 1e-14 && (down[2] - 9.806).abs() < 1e-14);
    }

    #[test]
    fn wind_axes_keep_drag_along_the_airflow() {
        let air = AirData::new(&STATE, 1.156, 600.0, &GEOMETRY);
        let mut wrench = Wrench::zero();
        wrench.add(Channel::Drag, 2.0);
        let force = body_force(&wrench, &air, ForceAxes::Wind);
        let [u, v, w] = air_velocity(&STATE, &air);
        for (f, x) in force.iter().zip([u, v, w]) {
            assert!((f + 2.0 * x / STATE.airspeed).abs() < 1e-14);
        }
    }
}

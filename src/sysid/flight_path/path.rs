//! Flight path of a stretch of flight without gaps: attitude, velocity and gust at every sample, and the mean wind. The
//! flight-path reconstruction estimates it.

use nalgebra::{Matrix3, Vector3};

use crate::flight_path::intake::Track;
use crate::flight_path::kinematics::MOTION_AND_GUST;
use crate::flight_path::rotation;

/// Number of measured channels: roll, pitch, yaw, airspeed, α, β, velocity north, east, down.
pub const CHANNELS: usize = 9;
/// Airspeed below which the flow angles are undefined, m/s.
pub const SLOW: f64 = 2.0;

/// Attitude, velocity and gust at every sample, and the mean wind.
#[derive(Clone, Debug)]
pub struct Path {
    /// Rotation from body to earth axes.
    pub attitude: Vec<Matrix3<f64>>,
    /// Velocity over ground, earth axes, m/s.
    pub velocity: Vec<Vector3<f64>>,
    /// Gust: velocity of the air over ground minus the mean wind, earth axes, m/s.
    pub gust: Vec<Vector3<f64>>,
    /// Mean wind: velocity of the air over ground, earth axes, m/s.
    pub wind: Vector3<f64>,
}

impl Path {
    /// Initial guess without wind and gusts, from the measured attitude, airspeed and flow angles. A missing measurement is
    /// replaced by the one before.
    pub fn guess(track: &Track) -> Path {
        let course = track.velocity.iter().find(|v| v[0].is_finite() && v[1].is_finite());
        let first = |mut values: Box<dyn Iterator<Item = f64> + '_>, default: f64| {
            values.find(|x| x.is_finite()).unwrap_or(default)
        };
        let mut angles: [f64; 3] = std::array::from_fn(|i| {
            let course = course.map_or(0.0, |v| v[1].atan2(v[0]));
            first(
                Box::new(track.attitude.iter().map(move |a| a[i])),
                if i == 2 { course } else { 0.0 },
            )
        });
        let mut airspeed = first(Box::new(track.airspeed.iter().copied()), 15.0);
        let [mut alpha, mut beta] =
            [0, 1].map(|i| first(Box::new(track.vanes.iter().map(move |v| v[i])), 0.0));
        let keep = |x: f64, old: &mut f64| {
            if x.is_finite() {
                *old = x;
            }
        };
        let (gust, wind) = (vec![Vector3::zeros(); track.len()], Vector3::zeros());
        let (attitude, velocity) =
            (Vec::with_capacity(track.len()), Vec::with_capacity(track.len()));
        let mut path = Path { attitude, velocity, gust, wind };
        for k in 0..track.len() {
            for (angle, measured) in angles.iter_mut().zip(track.attitude[k]) {
                keep(measured, angle);
            }
            keep(track.airspeed[k], &mut airspeed);
            keep(track.vanes[k][0], &mut alpha);
            keep(track.vanes[k][1], &mut beta);
            let attitude = rotation::from_euler(angles);
            let v = airspeed.max(SLOW);
            let body = Vector3::new(
                v * alpha.cos() * beta.cos(),
                v * beta.sin(),
                v * alpha.sin() * beta.cos(),
            );
            path.attitude.push(attitude);
            path.velocity.push(attitude * body);
        }
        path
    }

    /// Sum and number of the differences between the measured velocities over ground in `track` and those of the path, m/s. For a
    /// path without wind, the mean difference is an estimate of the wind.
    pub fn wind_left(&self, track: &Track) -> (Vector3<f64>, f64) {
        let mut sum = (Vector3::zeros(), 0.0);
        for (measured, own) in track.velocity.iter().zip(&self.velocity) {
            let left = Vector3::from(*measured) - own;
            if left.iter().all(|x| x.is_finite()) {
                sum = (sum.0 + left, sum.1 + 1.0);
            }
        }
        sum
    }

    /// Sets the mean wind of a path without wind to `wind` (m/s, earth axes). The velocity relative to the air does not change.
    pub fn carry(&mut self, wind: Vector3<f64>) {
        self.wind = wind;
        self.velocity.iter_mut().for_each(|v| *v += wind);
    }

    /// Changes sample `k` by `by`: a rotation vector (rad, body axes), a velocity and, if `by` has nine components, a gust (m/s,
    /// earth axes).
    pub fn shift<const N: usize>(&mut self, k: usize, by: &[f64; N]) {
        let three = |i: usize| Vector3::new(by[i], by[i + 1], by[i + 2]);
        self.attitude[k] = rotation::orthonormal(&(self.attitude[k] * rotation::exp(&three(0))));
        self.velocity[k] += three(3);
        if N == MOTION_AND_GUST {
            self.gust[k] += three(6);
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.attitude.len()
    }

    /// Velocity relative to the air in body axes at sample `k`, m/s.
    pub fn air_velocity(&self, k: usize) -> Vector3<f64> {
        self.attitude[k].transpose() * (self.velocity[k] - self.wind - self.gust[k])
    }
}

/// α and β (rad) that belong to the velocity `u` relative to the air, in body axes.
pub fn flow_angles(u: &Vector3<f64>) -> [f64; 2] {
    let v = u.norm().max(1e-9);
    [u.z.atan2(u.x), (u.y / v).clamp(-1.0, 1.0).asin()]
}

//! Attitude from a quaternion in a table. The scalar component may be the first or the last one.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::Sample;

/// Order of a quaternion's components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// w, x, y, z.
    Wxyz,
    /// x, y, z, w.
    Xyzw,
}

/// Accepted norms of a quaternion.
const NORM: std::ops::Range<f64> = 0.9..1.1;

fn turned(q: [f64; 4], order: Order) -> Option<UnitQuaternion<f64>> {
    let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    let q = match order {
        Order::Wxyz => Quaternion::new(q[0], q[1], q[2], q[3]),
        Order::Xyzw => Quaternion::new(q[3], q[0], q[1], q[2]),
    };
    NORM.contains(&norm).then(|| UnitQuaternion::new_normalize(q))
}

/// The order in which the quaternions agree best with the body rates and with gravity in the specific force.
///
/// The norm does not depend on the order. It only distinguishes a quaternion from other numbers.
pub(super) fn order(rows: &[Sample], quaternions: &[[f64; 4]]) -> Order {
    let misfit = |order: Order| {
        let (mut sum, mut weight) = (0.0, 0.0);
        let all: Vec<_> = quaternions.iter().map(|q| turned(*q, order)).collect();
        for (k, pair) in rows.windows(2).enumerate() {
            let (Some(a), Some(b)) = (all[k], all[k + 1]) else { continue };
            let dt = pair[1].time_s - pair[0].time_s;
            let rates = Vector3::from(pair[0].rates_radps) * dt;
            if dt > 0.0 && rates.norm() < 0.5 {
                sum += ((a.inverse() * b).scaled_axis() - rates).norm() / dt;
                weight += 1.0;
            }
            let force = Vector3::from(pair[0].specific_force_mps2);
            if force.norm() > 1.0 {
                sum += (a * force.normalize() + Vector3::z()).norm();
                weight += 1.0;
            }
        }
        if weight > 0.0 { sum / weight } else { f64::INFINITY }
    };
    if misfit(Order::Xyzw) < misfit(Order::Wxyz) { Order::Xyzw } else { Order::Wxyz }
}

/// Computes roll, pitch and yaw; they stay NaN where the four numbers are not a unit quaternion.
pub(super) fn fill(rows: &mut [Sample], quaternions: &[[f64; 4]], order: Order) {
    for (row, q) in rows.iter_mut().zip(quaternions) {
        if let Some(turn) = turned(*q, order) {
            let (roll, pitch, yaw) = turn.euler_angles();
            row.attitude_rad = [roll, pitch, yaw];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_found_by_the_rates_and_by_gravity() {
        let row = |k: usize| {
            let turn = UnitQuaternion::from_euler_angles(0.3 + 0.002 * k as f64, 0.1, 0.5);
            let force = turn.inverse() * Vector3::new(0.0, 0.0, -9.81);
            let sample = Sample {
                time_s: 0.01 * k as f64,
                rates_radps: [0.2, 0.0, 0.0],
                specific_force_mps2: force.into(),
                ..Sample::default()
            };
            (sample, [turn.w, turn.i, turn.j, turn.k])
        };
        let (rows, first): (Vec<_>, Vec<_>) = (0..200).map(row).unzip();
        let last: Vec<[f64; 4]> = first.iter().map(|[w, x, y, z]| [*x, *y, *z, *w]).collect();
        for (quaternions, is) in [(&first, Order::Wxyz), (&last, Order::Xyzw)] {
            let found = order(&rows, quaternions);
            assert_eq!(found, is);
            let mut filled = rows.clone();
            fill(&mut filled, quaternions, found);
            assert!((filled[100].attitude_rad[0] - 0.5).abs() < 1e-9);
        }
    }
}

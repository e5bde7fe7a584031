//! Rotations from body axes to earth axes, as matrices.

use nalgebra::{Matrix3, Vector3};

/// The matrix C of the cross product with `v`, such that C x = v × x.
pub fn cross(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Rotation matrix of the rotation vector `turn`, rad.
pub fn exp(turn: &Vector3<f64>) -> Matrix3<f64> {
    let angle2 = turn.norm_squared();
    let angle = angle2.sqrt();
    let k = cross(turn);
    let (a, b) = if angle < 1e-4 {
        (1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / angle2)
    };
    Matrix3::identity() + k * a + k * k * b
}

/// Rotation vector (rad) of the rotation matrix `r`. The rotation must be by less than π.
pub fn log(r: &Matrix3<f64>) -> Vector3<f64> {
    let half = Vector3::new(r.m32 - r.m23, r.m13 - r.m31, r.m21 - r.m12) * 0.5;
    let sine = half.norm();
    let cosine = (r.trace() - 1.0) * 0.5;
    if sine < 1e-8 { half } else { half * (sine.atan2(cosine) / sine) }
}

/// The vector `x`, given in the axes of a board that is rolled by `roll` (rad) about the forward axis, in the axes before the roll.
pub fn unrolled(x: &Vector3<f64>, roll: f64) -> Vector3<f64> {
    let (sin, cos) = roll.sin_cos();
    Vector3::new(x.x, cos * x.y - sin * x.z, sin * x.y + cos * x.z)
}

/// Rotation matrix from body to earth axes for the Euler angles roll, pitch and yaw (ZYX), rad.
pub fn from_euler([roll, pitch, yaw]: [f64; 3]) -> Matrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
    Matrix3::new(
        cp * cy,
        sr * sp * cy - cr * sy,
        cr * sp * cy + sr * sy,
        cp * sy,
        sr * sp * sy + cr * cy,
        cr * sp * sy - sr * cy,
        -sp,
        sr * cp,
        cr * cp,
    )
}

/// Roll, pitch and yaw (ZYX, rad) of the rotation matrix `r` from body to earth axes.
pub fn to_euler(r: &Matrix3<f64>) -> [f64; 3] {
    [r.m32.atan2(r.m33), (-r.m31).clamp(-1.0, 1.0).asin(), r.m21.atan2(r.m11)]
}

/// Derivatives of roll, pitch and yaw (rows) with respect to a small rotation about body x, y and z (columns). `None` near a
/// pitch angle θ of ±90°, where cos θ is at most 0.05.
pub fn euler_by_turn(r: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (sp, cp) = (-r.m31, r.m32.hypot(r.m33));
    (cp > 0.05).then(|| {
        let (sr, cr, tan) = (r.m32 / cp, r.m33 / cp, sp / cp);
        Matrix3::new(1.0, sr * tan, cr * tan, 0.0, cr, -sr, 0.0, sr / cp, cr / cp)
    })
}

/// Restores the orthonormality of a rotation matrix after many small rotations.
pub fn orthonormal(r: &Matrix3<f64>) -> Matrix3<f64> {
    let x = r.column(0).normalize();
    let y = (r.column(1) - x * x.dot(&r.column(1))).normalize();
    let z = x.cross(&y);
    Matrix3::from_columns(&[x, y, z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_rolled_board_measures_is_turned_back() {
        // the board's y axis points down by the roll angle: gravity has a component along it
        let roll = 0.3_f64;
        let measured = Vector3::new(0.0, roll.sin(), roll.cos());
        assert!((unrolled(&measured, roll) - Vector3::z()).norm() < 1e-15);
        // to first order x + x × ε, the same convention as the misalignment angles
        let (x, small) = (Vector3::new(0.3, -0.2, 0.9), 1e-6);
        let seen = x + x.cross(&Vector3::new(small, 0.0, 0.0));
        assert!((unrolled(&seen, small) - x).norm() < 1e-11);
    }

    #[test]
    fn euler_angles_and_turns_come_back() {
        let angles = [0.7, -0.4, 2.9];
        let r = from_euler(angles);
        for (a, b) in angles.iter().zip(to_euler(&r)) {
            assert!((a - b).abs() < 1e-14);
        }
        let turn = Vector3::new(0.3, -0.2, 0.1);
        assert!((log(&exp(&turn)) - turn).norm() < 1e-14);
        // finite differences with a step of 1e-6, accurate to 1e-6
        let jacobian = euler_by_turn(&r).unwrap();
        for axis in 0..3 {
            let mut turn = Vector3::zeros();
            turn[axis] = 1e-6;
            let moved = to_euler(&(r * exp(&turn)));
            for i in 0..3 {
                assert!(((moved[i] - angles[i]) / 1e-6 - jacobian[(i, axis)]).abs() < 2e-6);
            }
        }
    }
}

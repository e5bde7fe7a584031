//! The load factor that a model predicts, computed from one integration step or from the state rates, with its derivatives.

use greylag_model::STEP;
use greylag_physics::State;

/// Standard gravity g0, m/s²: the unit of load factors.
pub const G0: f64 = 9.806_65;

/// Velocity relative to the air along the body's z axis (positive downward), m/s.
fn down(s: &State) -> f64 {
    s.airspeed * s.alpha.sin() * s.beta.cos()
}

/// The load factor along the body's z axis, positive upward, in g, while `s` becomes `next` in one step. It is the reading
/// of an accelerometer at the centre of gravity. It follows from the rigid body's force equation
/// ẇ = g cosθ cosφ + Z/m + u q − v p in still air.
pub fn load_factor(s: &State, next: &State) -> f64 {
    let (u, v) = (s.airspeed * s.alpha.cos() * s.beta.cos(), s.airspeed * s.beta.sin());
    let gravity = G0 * s.pitch.cos() * s.roll.cos();
    (gravity + u * s.q - v * s.p - (down(next) - down(s)) / STEP) / G0
}

/// The load factor along the body's z axis, positive upward, in g, at the state `s` that changes with `rate` (per second).
pub fn load_factor_under(s: &State, rate: &State) -> f64 {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (s.alpha.sin_cos(), s.beta.sin_cos());
    let v = s.airspeed;
    let down = rate.airspeed * sin_a * cos_b + v * rate.alpha * cos_a * cos_b
        - v * rate.beta * sin_a * sin_b;
    let gravity = G0 * s.pitch.cos() * s.roll.cos();
    (gravity + v * cos_a * cos_b * s.q - v * sin_b * s.p - down) / G0
}

/// Derivatives of [`load_factor`], in g per unit of each state: first with respect to `s`, then with respect to `next`.
pub fn load_factor_slopes(s: &State, next: &State) -> [[f64; 8]; 2] {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (s.alpha.sin_cos(), s.beta.sin_cos());
    let ((sin_roll, cos_roll), (sin_pitch, cos_pitch)) = (s.roll.sin_cos(), s.pitch.sin_cos());
    let v = s.airspeed;
    let by = |x: &State| {
        let ((sin_a, cos_a), (sin_b, cos_b)) = (x.alpha.sin_cos(), x.beta.sin_cos());
        [sin_a * cos_b, x.airspeed * cos_a * cos_b, -x.airspeed * sin_a * sin_b]
    };
    let [down_v, down_a, down_b] = by(s).map(|x| x / STEP);
    let [next_v, next_a, next_b] = by(next).map(|x| -x / (STEP * G0));
    let own = [
        -G0 * cos_pitch * sin_roll,
        -G0 * sin_pitch * cos_roll,
        cos_a * cos_b * s.q - sin_b * s.p + down_v,
        -v * sin_b,
        v * cos_a * cos_b,
        0.0,
        -v * sin_a * cos_b * s.q + down_a,
        -v * cos_a * sin_b * s.q - v * cos_b * s.p + down_b,
    ];
    [own.map(|x| x / G0), [0.0, 0.0, next_v, 0.0, 0.0, 0.0, next_a, next_b]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_turn_carries_the_load_of_the_textbook() {
        // at 60° bank n = 1/cos φ = 2, with q = g tan φ sin φ / V at a constant angle of attack
        let roll = std::f64::consts::FRAC_PI_3;
        let q = G0 * roll.tan() * roll.sin() / 20.0;
        let s = State { roll, q, airspeed: 20.0, alpha: 0.0, ..State::NEUTRAL };
        assert!((load_factor(&s, &s) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let x = [0.4, -0.3, 18.0, 0.7, -0.4, 0.2, 0.08, -0.1];
        let y = [0.41, -0.31, 18.1, 0.8, -0.3, 0.1, 0.085, -0.09];
        let slopes = load_factor_slopes(&State::from_array(x), &State::from_array(y));
        for (which, slopes) in slopes.into_iter().enumerate() {
            for (i, slope) in slopes.into_iter().enumerate() {
                let at = |d: f64| {
                    let (mut a, mut b) = (x, y);
                    if which == 0 {
                        a[i] += d
                    } else {
                        b[i] += d
                    }
                    load_factor(&State::from_array(a), &State::from_array(b))
                };
                let found = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((found - slope).abs() < 1e-4 * (1.0 + slope.abs()), "{which} {i}");
            }
        }
    }
}

//! Lines and filters through what was measured of an aircraft.

use std::f64::consts::FRAC_PI_2;

use super::Polar;
use crate::physics::servos::{Surface, Travel};

/// Incidences over which the pitching moment is taken as a line, degrees.
pub(super) const LINE_DEG: [f64; 2] = [-4.0, 10.0];

/// Intercept and slope of the pitching moment over incidence, and the share of its variation beside.
pub(super) fn line(polar: &Polar) -> [f64; 3] {
    let [low, high] = LINE_DEG.map(|a| a.to_radians() + 1e-9);
    let inside: Vec<(f64, f64)> = polar
        .alpha
        .iter()
        .copied()
        .zip(polar.pitch.iter().copied())
        .filter(|(a, _)| *a >= low - 2e-9 && *a <= high)
        .collect();
    let count = inside.len() as f64;
    let (ma, mm) = inside.iter().fold((0.0, 0.0), |(x, y), (a, m)| (x + a / count, y + m / count));
    let moment =
        |f: &dyn Fn(f64, f64) -> f64| inside.iter().map(|(a, m)| f(a - ma, m - mm)).sum::<f64>();
    let slope = moment(&|a, m| a * m) / moment(&|a, _| a * a);
    let left = moment(&|a, m| (m - slope * a).powi(2)) / moment(&|_, m| m * m).max(1e-30);
    [mm - slope * ma, slope, left.sqrt()]
}

/// Frequency and damping of the filter whose step response is closest to `observed`.
pub(super) fn second_order(observed: &[f64], end: f64) -> [f64; 2] {
    let miss = |frequency: f64, damping: f64| {
        let Surface { filter: [b, a1, a2], .. } =
            Surface::tustin(frequency, damping, Travel::symmetric(FRAC_PI_2), 0.01);
        let (mut y, mut u) = ([0.0; 2], [0.0; 2]);
        let errors = observed.iter().map(|x| {
            let next = b * (end + 2.0 * u[0] + u[1]) - a1 * y[0] - a2 * y[1];
            (y, u) = ([next, y[0]], [end, u[0]]);
            (x - next).powi(2)
        });
        errors.sum::<f64>()
    };
    let frequencies = (0..60).map(|k| 5.0 * 1.09_f64.powi(k));
    let all = frequencies.flat_map(|w| [0.5, 0.6, 0.707, 0.8, 1.0, 1.4].map(|z| [w, z]));
    all.min_by(|a, b| miss(a[0], a[1]).total_cmp(&miss(b[0], b[1]))).unwrap_or([50.0, 0.7])
}

/// Time constant (s) by which `observed` follows a step, by the time to 63 % of its end.
pub(super) fn first_order(observed: &[f64]) -> f64 {
    let end = 0.5;
    match observed.iter().position(|x| *x >= 0.632 * end) {
        Some(k) => (0.01 * k as f64).max(0.01),
        // slower than was waited for: by what it has done
        None => {
            let last = observed.last().copied().unwrap_or(0.0) / end;
            0.01 * observed.len() as f64 / -(1.0 - last.clamp(1e-3, 0.99)).ln()
        }
    }
}

//! Compares the attitude with the body rates to find wrong units and signs. A finding is a message to the user of a log.

use std::f64::consts::{PI, TAU};

use super::force::turn_with_bank;
use super::relation::{
    Relation, change, integral, near, quantile, through_origin, values, windows,
};
use super::{cured, cured_by, undecided};
use crate::Sample;
use crate::finding::{Cure, Finding, QUARTER_TURN};

const DEGREE: f64 = PI / 180.0;
/// Window over which angles and rates are compared, s.
const WINDOW_S: f64 = 0.5;
/// Correlation between the change of an angle and the integral of a rate above which their relation is taken as certain.
const CERTAIN: f64 = 0.8;
/// Magnitude of the correlation of yaw rate and bank angle above which the sign of the yaw rate is taken as known. In lively
/// flights with a right sign it was 0.73 and more.
const BANKED: f64 = 0.7;

/// Largest pitch angle at which φ̇ is close enough to p for a comparison of their magnitudes, rad.
const GENTLE: f64 = 0.5;

/// Checks the units, then the signs. Signs are checked only if the units are right, because the equations for them contain
/// sines of the angles. If `flies` is true, the magnitude of the roll changes is also compared with p. On the ground both
/// are noise.
pub fn check(rows: &[Sample], flies: bool) -> Vec<Finding> {
    let windows = windows(rows, WINDOW_S);
    let units = units(rows, &windows);
    if !units.is_empty() {
        return units;
    }
    let mut out = signs(rows, &windows);
    out.extend(scale(&windows).filter(|_| flies));
    out
}

/// Compares the change of roll with the integral of p at small pitch angles, where they should be equal.
fn scale(windows: &[&[Sample]]) -> Option<Finding> {
    let gentle = |w: &&&[Sample]| {
        w.iter().all(|s| s.attitude_rad[1].is_nan() || s.attitude_rad[1].abs() < GENTLE)
    };
    let pairs = windows.iter().filter(gentle).map(|w| {
        let roll = change(w, |s| s.attitude_rad[0]);
        (integral(w, |s| s.rates_radps[0]), roll - TAU * (roll / TAU).round())
    });
    let r = through_origin(pairs).filter(|r| r.correlation > CERTAIN)?.slope;
    (!near(r, 1.0, 0.4)).then(|| {
        Finding::warning(format!(
            "roll changes {r:.2} times as much as p says: one of them is wrongly scaled or delayed"
        ))
    })
}

fn units(rows: &[Sample], windows: &[&[Sample]]) -> Vec<Finding> {
    let mut out = Vec::new();
    // roll against p alone, pitch against q alone: the full equations need sines of angles whose unit is not known yet
    let against = |axis: usize| {
        let pairs = windows
            .iter()
            .map(|w| (integral(w, |s| s.rates_radps[axis]), change(w, |s| s.attitude_rad[axis])));
        through_origin(pairs).filter(|r| r.correlation > CERTAIN).map(|r| r.slope)
    };
    let ratio = against(0).or_else(|| against(1));
    let largest =
        |axis: usize| quantile(&values(rows, |s| s.attitude_rad[axis].abs()), 0.99).unwrap_or(0.0);
    let rate = quantile(&values(rows, |s| s.rates_radps[0].abs()), 0.99).unwrap_or(0.0);
    let (roll, pitch) = (largest(0), largest(1));
    let large = roll > 3.3 || pitch > 1.7;
    let angles = large || ratio.is_some_and(|r| near(r, 1.0 / DEGREE, 0.4));
    let rates = ratio.is_some_and(|r| near(r, DEGREE, 0.4))
        || rate > 12.0
        || large && ratio.is_some_and(|r| near(r, 1.0, 0.4));
    if angles {
        out.push(
            cured(
                format!(
                    "roll and pitch look like degrees, not radians (99 % of |roll| below {roll:.1})"
                ),
                "roll_rad",
                0.0174533,
            )
            .with("; pitch_rad and yaw_rad likewise"),
        );
    }
    if rates {
        out.push(cured(format!("p, q, r look like degrees a second, not radians a second (99 % of |p| below {rate:.1})"), "p_radps", 0.0174533).with("; q_radps and r_radps likewise"));
    }
    out
}

/// Signs by the kinematic equations φ̇ = p + (q sin φ + r cos φ) tan θ, θ̇ = q cos φ − r sin φ, ψ̇ = (q sin φ + r cos φ) / cos θ.
fn signs(rows: &[Sample], windows: &[&[Sample]]) -> Vec<Finding> {
    let [roll, pitch, yaw] = relations(windows);
    let turned = |r: Option<Relation>| r.is_some_and(|r| r.correlation < -CERTAIN);
    let mut out = Vec::new();
    if turned(roll) {
        out.push(cured("roll falls while p is positive: one of them has the wrong sign (positive is right wing down). If it is roll".into(), "roll_rad", -1.0));
    }
    if turned(pitch) {
        out.push(cured("pitch falls while q is positive: one of them has the wrong sign (positive is nose up). If it is pitch".into(), "pitch_rad", -1.0));
    }
    if turned(yaw) {
        let bank = if turned(roll) { None } else { turn_with_bank(rows) };
        out.push(yaw_turned(bank));
    }
    out
}

/// The finding that yaw falls while r is positive. `bank` is the correlation of r with the bank angle, by which the wrong one of
/// the two is known.
fn yaw_turned(bank: Option<f64>) -> Finding {
    let yaw = Cure { offset: QUARTER_TURN, ..Cure::factor("yaw_rad", -1.0) };
    let from_east = "yaw looks counted from east to the left (ENU), while the log format counts from north to the right (NED)";
    let left =
        "r_radps looks positive to the left, while the log format's is positive to the right";
    match bank {
        Some(bank) if bank > BANKED => {
            cured_by(format!("yaw falls while the aircraft turns right: {from_east}"), yaw)
        }
        Some(bank) if bank < -BANKED => {
            cured(format!("r is negative in right turns, and yaw rises: {left}"), "r_radps", -1.0)
        }
        _ => undecided(
            &format!("yaw falls while r is positive: {from_east}, or {left}"),
            vec![("yaw", yaw), ("the yaw rate", Cure::factor("r_radps", -1.0))],
        ),
    }
}

fn relations(windows: &[&[Sample]]) -> [Option<Relation>; 3] {
    let turn = |s: &Sample| {
        let [roll, pitch, _] = s.attitude_rad;
        (s.rates_radps[1] * roll.sin() + s.rates_radps[2] * roll.cos()) / pitch.cos()
    };
    let roll = |s: &Sample| s.rates_radps[0] + turn(s) * s.attitude_rad[1].sin();
    let pitch = |s: &Sample| {
        let bank = s.attitude_rad[0];
        s.rates_radps[1] * bank.cos() - s.rates_radps[2] * bank.sin()
    };
    let against = |rate: &dyn Fn(&Sample) -> f64, axis: usize| {
        let pairs = windows.iter().map(|w| {
            let angle = change(w, |s| s.attitude_rad[axis]);
            (integral(w, rate), angle - TAU * (angle / TAU).round())
        });
        through_origin(pairs)
    };
    [against(&roll, 0), against(&pitch, 1), against(&turn, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bank_decides_between_yaw_and_its_rate() {
        let [yaw, rate] = [0.9, -0.9].map(|bank| yaw_turned(Some(bank)));
        assert_eq!(yaw.cure, Some(Cure { offset: QUARTER_TURN, ..Cure::factor("yaw_rad", -1.0) }));
        assert_eq!(rate.cure, Some(Cure::factor("r_radps", -1.0)));
        let open = yaw_turned(None);
        assert!(open.cure.is_none() && open.corrects("yaw_rad") && open.corrects("r_radps"));
        for line in ["scale = -1, offset = 1.5708 } for yaw", "scale = -1 } for the yaw rate"] {
            assert!(open.text.contains(line), "{}", open.text);
        }
    }
}

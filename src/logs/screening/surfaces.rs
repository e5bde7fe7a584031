//! Checks of surfaces and throttle: their units, and whether a surface accelerates the aircraft in the right direction. A
//! finding is a message to the user of a log.

use super::relation::{
    change, mean, partial_correlation, quantile, tame, values, windows, with_intercept,
};
use super::{cured, throttle as power};
use crate::Sample;
use crate::finding::Finding;
use crate::phases::Flying;

/// A deflection column counts as in degrees if more than 1 % of its magnitudes exceed this value, rad (69°).
const DEFLECTION_LARGE: f64 = 1.2;
/// A command or throttle column counts as not normalised if more than 1 % of its magnitudes exceed this value.
const COMMAND_LARGE: f64 = 1.5;
/// Time span over which angular accelerations are computed, s.
const WINDOW_S: f64 = 0.1;
/// Magnitude of the partial correlation with the wrong sign above which a surface is reported as reversed.
const TURNED: f64 = 0.6;
/// The same limit for a lively aileron: a recorded deflection whose 5 % and 95 % quantiles are more than `LIVELY` (rad) apart, over
/// at least `MANY` windows. Feedback of the roll acceleration in gusts gives a right aileron a correlation of −0.22 at worst.
const TURNED_LIVELY: f64 = 0.35;
const LIVELY: f64 = 0.2;
const MANY: usize = 200;

/// Correlation of a command with the deflection of its surface from which on the command has the sign of the deflection. Below
/// the negative value it has the opposite sign.
const FOLLOWS: f64 = 0.5;

type Get = fn(&Sample) -> f64;

/// The columns of a surface: its deflection and its command.
type Surface = [(&'static str, Get); 2];

const AILERON: Surface = [("aileron_rad", |s| s.aileron_rad), ("aileron_cmd", |s| s.aileron_cmd)];
const ELEVATOR: Surface =
    [("elevator_rad", |s| s.elevator_rad), ("elevator_cmd", |s| s.elevator_cmd)];

/// Checks the units and, if units and axes are right, the directions in which aileron, elevator and throttle act.
pub fn check(rows: &[Sample], axes_are_right: bool, flies: &Flying) -> Vec<Finding> {
    let mut out: Vec<Finding> = units(rows);
    if out.is_empty() && axes_are_right {
        for (found, surface) in [(aileron(rows, flies), AILERON), (elevator(rows, flies), ELEVATOR)]
        {
            let beside = found.as_ref().and_then(|f| command(f, rows, surface));
            out.extend(found.into_iter().chain(beside));
        }
        out.extend(power::check(rows));
    }
    out
}

/// Checks the command of a surface beside its deflection, which `found` calls reversed. A command that moves with the deflection
/// is reversed as well, and one that moves against it is right. `None` for a right command, without a command, and if `found` is
/// about the command.
fn command(found: &Finding, rows: &[Sample], surface: Surface) -> Option<Finding> {
    let [(deflection, position), (column, get)] = surface;
    if !found.corrects(deflection) || !moves(rows, get) {
        return None;
    }
    let relation = with_intercept(rows.iter().map(|s| (get(s), position(s))));
    match relation.map_or(0.0, |r| r.correlation) {
        r if r > FOLLOWS => Some(cured(
            format!("{column} has the sign of {deflection}, which acts the other way"),
            column,
            -1.0,
        )),
        r if r < -FOLLOWS => None,
        _ => Some(Finding::warning(format!(
            "{column} is left as it is: it does not follow {deflection}, which acts the other way, closely enough to show its own sign; compare the two at a step"
        ))),
    }
}

fn units(rows: &[Sample]) -> Vec<Finding> {
    let size = |get: Get| quantile(&values(rows, |s| get(s).abs()), 0.99).unwrap_or(0.0);
    let deflections: [(&str, Get); 3] = [
        ("aileron_rad", |s| s.aileron_rad),
        ("elevator_rad", |s| s.elevator_rad),
        ("rudder_rad", |s| s.rudder_rad),
    ];
    let commands: [(&str, Get); 3] = [
        ("aileron_cmd", |s| s.aileron_cmd),
        ("elevator_cmd", |s| s.elevator_cmd),
        ("rudder_cmd", |s| s.rudder_cmd),
    ];
    let throttles: [(&str, Get); 2] =
        [("throttle", |s| s.throttle), ("throttle_cmd", |s| s.throttle_cmd)];
    let large = |list: &[(&'static str, Get)], limit: f64| -> Vec<(&'static str, f64)> {
        list.iter().map(|(n, get)| (*n, size(*get))).filter(|(_, x)| *x > limit).collect()
    };
    let mut out = Vec::new();
    for (column, x) in large(&deflections, DEFLECTION_LARGE) {
        out.push(cured(
            format!("{column} looks like degrees, not radians (99 % of it below {x:.1})"),
            column,
            0.0174533,
        ));
    }
    for (column, x) in large(&commands, COMMAND_LARGE) {
        out.push(Finding::problem(format!(
            "{column} reaches {x:.1}, while the log format's commands lie in -1..1: read it with --mapping FILE and the scale that makes full travel 1"
        )));
    }
    for (column, x) in large(&throttles, COMMAND_LARGE) {
        out.push(throttle(column, x));
    }
    out
}

fn throttle(column: &str, size: f64) -> Finding {
    match size {
        0.0..=130.0 => cured(
            format!("{column} looks like per cent, not 0..1 (99 % of it below {size:.0})"),
            column,
            0.01,
        ),
        _ => Finding::problem(format!(
            "{column} looks like microseconds of a pulse, not 0..1 (99 % of it below {size:.0}): read it with --mapping FILE, in which [columns] has {column} = {{ from = \"csv.{column}\", scale = 0.001, offset = -1 }}"
        )),
    }
}

/// How a surface acts: its column, the partial correlation of the angular acceleration with it, positive for the right sign, and the
/// magnitude from which on the correlation shows the sign.
struct Acting {
    column: &'static str,
    correlation: f64,
    limit: f64,
}

/// The note that the flight does not show the signs of surfaces that move; `None` if it shows them.
pub fn hidden_signs(rows: &[Sample], flies: &Flying) -> Option<Finding> {
    let all = [(AILERON, acting_aileron(rows, flies)), (ELEVATOR, acting_elevator(rows, flies))];
    let hidden = |(surface, acting): &(Surface, Option<Acting>)| {
        let (column, _) = moving(rows, *surface)?;
        let shown = acting.as_ref().is_some_and(|a| a.correlation.abs() > a.limit);
        (!shown).then_some(column)
    };
    let columns: Vec<&str> = all.iter().filter_map(hidden).collect();
    (!columns.is_empty()).then(|| {
        Finding::note(format!(
            "sign of {} not checked: the angular acceleration does not show it clearly enough, as under feedback or with few movements; compare it with the attitude at a step",
            columns.join(" and of ")
        ))
    })
}

/// Checks the direction of the aileron. Positive aileron must accelerate the right wing downwards.
fn aileron(rows: &[Sample], flies: &Flying) -> Option<Finding> {
    let Acting { column, correlation, limit } = acting_aileron(rows, flies)?;
    (correlation < -limit).then(|| {
        cured(format!("{column} acts the other way: the aircraft rolls left where it is positive, while the log format's is positive for right wing down"), column, -1.0)
    })
}

/// How the aileron acts, by a regression of ṗ on p, r, β (if known) and the aileron.
fn acting_aileron(rows: &[Sample], flies: &Flying) -> Option<Acting> {
    let (column, get) = moving(rows, AILERON)?;
    let beta = has(rows, |s| s.beta_rad);
    let regressors = |w: &[Sample]| {
        let mut all = vec![mean(w, |s| s.rates_radps[0]), mean(w, |s| s.rates_radps[2])];
        all.extend(beta.then(|| mean(w, |s| s.beta_rad)));
        all.push(mean(w, get));
        all
    };
    let (correlation, windows) = polarity(rows, flies, 0, regressors)?;
    let all = values(rows, get);
    let range = quantile(&all, 0.95).zip(quantile(&all, 0.05)).map(|(high, low)| high - low);
    let lively = column == "aileron_rad" && windows >= MANY && range.is_some_and(|r| r > LIVELY);
    Some(Acting { column, correlation, limit: if lively { TURNED_LIVELY } else { TURNED } })
}

/// Checks the direction of the elevator. Positive elevator must accelerate the nose downwards.
fn elevator(rows: &[Sample], flies: &Flying) -> Option<Finding> {
    let Acting { column, correlation, limit } = acting_elevator(rows, flies)?;
    (correlation < -limit).then(|| {
        cured(format!("{column} acts the other way: the nose rises where it is positive, while the log format's is positive for nose down"), column, -1.0)
    })
}

/// How the elevator acts, by a regression of q̇ on q, α and the elevator. If α is unknown, the specific force along body z divided by
/// V² takes its place.
fn acting_elevator(rows: &[Sample], flies: &Flying) -> Option<Acting> {
    let (column, get) = moving(rows, ELEVATOR)?;
    let alpha: Get = match has(rows, |s| s.alpha_rad) {
        true => |s| s.alpha_rad,
        false => |s| s.specific_force_mps2[2] / s.airspeed_mps.powi(2),
    };
    let regressors =
        |w: &[Sample]| vec![mean(w, |s| s.rates_radps[1]), mean(w, alpha), mean(w, get)];
    let (found, _) = polarity(rows, flies, 1, regressors)?;
    Some(Acting { column, correlation: -found, limit: TURNED })
}

/// Whether more than half of the rows have a value in the column.
fn has(rows: &[Sample], get: Get) -> bool {
    2 * values(rows, get).len() > rows.len()
}

/// The first of the columns that moves.
fn moving(rows: &[Sample], columns: Surface) -> Option<(&'static str, Get)> {
    columns.into_iter().find(|(_, get)| moves(rows, *get))
}

/// Whether more than half of the rows have a value in the column, and these change.
fn moves(rows: &[Sample], get: Get) -> bool {
    let all = values(rows, get);
    2 * all.len() > rows.len() && all.iter().any(|x| *x != all[0])
}

/// The partial correlation of the angular acceleration about `axis` with the last regressor, and the number of windows over
/// which it is computed: those in flight with moderate attitudes and rates.
fn polarity(
    rows: &[Sample],
    flies: &Flying,
    axis: usize,
    regressors: impl Fn(&[Sample]) -> Vec<f64>,
) -> Option<(f64, usize)> {
    let equations: Vec<(Vec<f64>, f64)> = windows(rows, WINDOW_S)
        .into_iter()
        .filter(|w| w.iter().all(|s| s.airspeed_mps > flies.from_mps && tame(s)))
        .map(|w| {
            let time = w[w.len() - 1].time_s - w[0].time_s;
            (regressors(w), change(w, |s| s.rates_radps[axis]) / time)
        })
        .filter(|(x, y)| y.is_finite() && x.iter().all(|x| x.is_finite()))
        .collect();
    Some((partial_correlation(&equations)?, equations.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 40 s in which an aileron of ±0.15 rad and gusts roll the aircraft: ṗ = −8 p + 47 δ + 5 sin ωt. The aileron is recorded times
    /// `sign`, and moves by `share` of the full amplitude.
    fn rolling(sign: f64, share: f64) -> Vec<Sample> {
        const STEP: f64 = 0.01;
        let wave = |time: f64, period: f64| (std::f64::consts::TAU * time / period).sin();
        let mut p = 0.0;
        let one = |k: usize| {
            let time_s = STEP * k as f64;
            let aileron = 0.15 * share * wave(time_s, 1.7);
            let sample = Sample {
                time_s,
                rates_radps: [p, 0.0, 0.01 * wave(time_s, 2.3)],
                airspeed_mps: 17.0,
                aileron_rad: sign * aileron,
                ..Sample::default()
            };
            p += STEP * (-8.0 * p + 47.0 * aileron + 5.0 * share * wave(time_s, 0.37));
            sample
        };
        (0..4000).map(one).collect()
    }

    #[test]
    fn a_lively_aileron_is_found_to_be_reversed_in_gusts() {
        let found = |sign, share| aileron(&rolling(sign, share), &Flying::default());
        assert!(found(1.0, 1.0).is_none());
        assert_eq!(found(-1.0, 1.0).unwrap().cure.unwrap().column, "aileron_rad");
        // the correlation is the same at small deflections, where a controller's feedback might cause it
        assert!(found(-1.0, 0.1).is_none());
        let hidden = |share| hidden_signs(&rolling(1.0, share), &Flying::default());
        assert!(hidden(1.0).is_none());
        assert!(hidden(0.1).unwrap().text.starts_with("sign of aileron_rad not checked: "));
    }

    #[test]
    fn a_command_beside_a_reversed_aileron_is_corrected_if_it_moves_with_it() {
        fn found(command: Get) -> Vec<Finding> {
            let mut rows = rolling(-1.0, 1.0);
            rows.iter_mut().for_each(|s| s.aileron_cmd = command(s));
            check(&rows, true, &Flying::default())
        }
        let [first, beside] = &found(|s| 2.0 * s.aileron_rad)[..] else { panic!() };
        assert!(first.corrects("aileron_rad") && beside.corrects("aileron_cmd"), "{beside}");
        let [against] = &found(|s| -2.0 * s.aileron_rad)[..] else { panic!() };
        assert!(!against.corrects("aileron_cmd"), "{against}");
        // a stick of another period, as of a flight controller that answers the gusts itself
        let [_, unclear] = &found(|s| (6.0 * s.time_s).sin())[..] else { panic!() };
        assert!(
            unclear.cure.is_none() && unclear.text.contains("aileron_cmd is left"),
            "{unclear}"
        );
    }
}

//! Sentence on the flights of an evaluation that left the limits of load factor and angle of attack, and by how much.

use super::label;
use crate::kit::numbers::{attitude, number};
use greylag_control::quality::{Limits, Quality};
use greylag_sim::evaluation::Evaluation;

/// States whether the controllers flew with the envelope limiter, and which of them, in the order of `flown`, left the limits:
/// in how many of all flights, by how much at most, and at which target. The names come from `all` evaluations.
pub(super) fn sentence<'a>(
    flown: impl Iterator<Item = &'a Evaluation>,
    all: &[Evaluation],
    limited: bool,
) -> String {
    let with = if limited { "with" } else { "without" };
    let outside: Vec<String> = flown.filter_map(|e| outside(e, all)).collect();
    let outside = match outside.is_empty() {
        true => String::new(),
        false => format!(" Outside the limits: {}.", outside.join("; ")),
    };
    format!("Flown {with} the envelope limiter.{outside}")
}

/// The part of the sentence on one controller; `None` if it kept its limits or this was not measured.
fn outside(e: &Evaluation, all: &[Evaluation]) -> Option<String> {
    let limits = e.limits.as_ref()?;
    let left: Vec<_> = e.flights.iter().filter(|f| !f.quality.kept).collect();
    if left.is_empty() {
        return None;
    }
    let begin = format!("{} in {} of {}", label(e, all), left.len(), e.flights.len());
    let most = left
        .iter()
        .filter_map(|f| Some((excess(&f.quality, limits)?, f.to_deg)))
        .max_by(|((a, _), _), ((b, _), _)| a.total_cmp(b));
    Some(match most {
        Some(((_, said), target)) => format!("{begin}, {said}, worst at {}", attitude(target)),
        // an aircraft that is lost counts as outside, whatever was measured before
        None => format!("{begin}, lost"),
    })
}

/// The largest excess of a flight over a limit, relative to the limit, and its text. `None` if no limit is exceeded. A limit
/// that the airframe file does not state is infinite, and its relative excess NaN.
fn excess(quality: &Quality, limits: &Limits) -> Option<(f64, String)> {
    let ([low, high], alpha) = (quality.load_factor, quality.alpha_deg[1]);
    let ([least, most], stall) = (limits.load_factor, limits.stall_deg);
    let over = |by: f64, limit: f64| by / limit.abs().max(1.0);
    let all = [
        (over(high - most, most), ["load factor up to ", ""], high, most),
        (over(least - low, least), ["load factor down to ", ""], low, least),
        (over(alpha - stall, stall), ["angle of attack up to ", "°"], alpha, stall),
    ];
    let beyond = all.into_iter().filter(|(over, ..)| over.is_finite() && *over > 0.0);
    let (over, [what, unit], value, limit) = beyond.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((over, format!("{what}{}{unit} (limit {}{unit})", number(value), number(limit))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation_page::answer;
    use greylag_control::Target;
    use greylag_control::quality::Track;
    use greylag_physics::Airframe;
    use greylag_sim::evaluation::courses;
    use greylag_sim::targets::Row;
    use greylag_sim::{Group, Outcome};

    /// One flight of each of the three groups of targets. `high` is the largest load factor of each flight.
    fn flown(controller: &str, high: [f64; 3]) -> Evaluation {
        let groups = [Group::Easy, Group::HardCorners, Group::HardOutside];
        let row = |(number, group)| Row { number, group, roll_deg: -58.0, pitch_deg: -27.0 };
        let rows: Vec<Row> = (0..).zip(groups).map(row).collect();
        let file =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/airframe.toml");
        let limits = Limits::of(&Airframe::load(&file).unwrap());
        let target = Target { roll: 0.0, pitch: 0.0, airspeed: 16.67 };
        let track = Track { moments: Vec::new(), target, before: None, lost_s: 0.0 };
        let outcome = Outcome { settled_deg: 0.1, settling_s: 0.5, cost: Vec::new(), track };
        let outcomes = vec![outcome; 3];
        let names = [controller, "exact"];
        let mut all = Evaluation::measured(names, &courses(&rows, 16.67), &outcomes, &limits);
        for (flight, high) in all.flights.iter_mut().zip(high) {
            flight.quality.load_factor = [1.0, high];
            flight.quality.alpha_deg = [0.0, 5.0];
            flight.quality.kept = limits.kept([1.0, high], [0.0, 5.0]);
        }
        all
    }

    #[test]
    fn every_flight_outside_the_limits_counts_and_the_worst_is_named() {
        let all = [flown("lqi", [2.0, 3.0, 3.81]), flown("pid", [2.0, 2.94, 2.25])];
        assert_eq!(
            sentence(all.iter(), &all, false),
            "Flown without the envelope limiter. Outside the limits: lqi in 2 of 3, load factor up to 3.81 (limit 2.20), \
             worst at roll −58°, pitch −27°; pid in 1 of 3, load factor up to 2.94 (limit 2.20), worst at roll −58°, pitch −27°."
        );
        // the group that the ranking leaves out is named
        let said = answer::sentences(&all, false);
        assert!(said[0].contains("in all 2 flights (ranked without hard_outside)."), "{said:?}");
        let kept = [flown("lqi", [1.0; 3])];
        assert_eq!(sentence(kept.iter(), &kept, true), "Flown with the envelope limiter.");
    }
}

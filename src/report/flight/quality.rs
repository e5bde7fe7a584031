//! Measures of the transient responses to the target attitudes of a recorded flight, and of the time outside the envelope.

use crate::flight::verdict::signed;
use crate::flight::{EnvelopeFlown, FlightReport, Segment};
use crate::kit::numbers::number;
use crate::{Align, Figure, Row, Section, Table};
use greylag_control::Target;
use greylag_control::quality::{Limit, Limits, Moment, OutsideS, Quality, Track};
use greylag_logs::Sample;
use greylag_physics::Command;
use greylag_physics::atmosphere::STANDARD_GRAVITY;

/// Gap between samples above which a flight is split into parts, s.
const GAP_S: f64 = 0.1;

/// Envelope measures of a whole flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kept {
    /// Smallest and largest load factor; NaN if not measured.
    pub load_factor: [f64; 2],
    /// Largest angle of attack, degrees.
    pub alpha_deg: f64,
    /// Smallest and largest roll, pitch and sideslip, degrees.
    pub angles_deg: [[f64; 2]; 3],
    /// Smallest and largest airspeed, m/s.
    pub airspeed_mps: [f64; 2],
    /// Time outside each limit, s.
    pub outside_s: OutsideS,
    /// Whether any part of the flight was compared with the limits.
    pub judged: bool,
    /// Whether load factor and angle of attack stayed within their limits plus 5 % (`quality::TRANSIENT`).
    pub kept: bool,
}

fn moment(s: &Sample) -> Moment {
    let command = Command {
        aileron: s.aileron_cmd,
        elevator: s.elevator_cmd,
        throttle: s.throttle_cmd,
        rudder: s.rudder_cmd,
    };
    Moment {
        time_s: s.time_s,
        attitude: [s.attitude_rad[0], s.attitude_rad[1]],
        airspeed: s.airspeed_mps,
        alpha: s.alpha_rad,
        beta: s.beta_rad,
        load_factor: -s.specific_force_mps2[2] / STANDARD_GRAVITY,
        command,
    }
}

/// Measures of the transient response in `segment`, the part of the flight with one target.
pub(super) fn of_segment(samples: &[Sample], segment: &Segment, limits: &Limits) -> Quality {
    let first = samples.partition_point(|s| s.time_s < segment.start_s);
    let end = samples.partition_point(|s| s.time_s <= segment.end_s).max(first);
    let before = first.checked_sub(1).map(|k| moment(&samples[k]).command);
    let (roll, pitch) = (segment.roll_target_rad, segment.pitch_target_rad);
    // the log format has no column for the airspeed setpoint
    let target = Target { roll, pitch, airspeed: f64::NAN };
    let moments = samples[first..end].iter().map(moment).collect();
    Track { moments, target, before, lost_s: 0.0 }.quality(limits)
}

/// Envelope measures of the whole flight. Samples with a known airspeed below `flying_from_mps` are left out.
pub(crate) fn kept(samples: &[Sample], envelope: &EnvelopeFlown) -> Kept {
    let flying = |s: &Sample| s.airspeed_mps.is_nan() || s.airspeed_mps >= envelope.flying_from_mps;
    let together = |a: &Sample, b: &Sample| flying(a) && flying(b) && b.time_s - a.time_s <= GAP_S;
    let nobody = Target { roll: f64::NAN, pitch: f64::NAN, airspeed: f64::NAN };
    let parts = samples.chunk_by(together).filter(|part| part.len() > 1);
    let mut all = Kept {
        load_factor: [f64::NAN; 2],
        alpha_deg: f64::NAN,
        angles_deg: [[f64::NAN; 2]; 3],
        airspeed_mps: [f64::NAN; 2],
        outside_s: OutsideS::default(),
        judged: false,
        kept: true,
    };
    for part in parts {
        let moments: Vec<Moment> = part.iter().map(moment).collect();
        for m in &moments {
            let angles = [m.attitude[0], m.attitude[1], m.beta].map(f64::to_degrees);
            all.angles_deg.iter_mut().zip(angles).for_each(|(ends, x)| widen(ends, x));
            widen(&mut all.airspeed_mps, m.airspeed);
        }
        let track = Track { moments, target: nobody, before: None, lost_s: 0.0 };
        let Quality { load_factor: [least, most], alpha_deg, outside_s, kept, .. } =
            track.quality(&envelope.limits);
        all.load_factor = [all.load_factor[0].min(least), all.load_factor[1].max(most)];
        all.alpha_deg = all.alpha_deg.max(alpha_deg[1]);
        all.outside_s = all.outside_s.plus(outside_s);
        all.kept &= kept;
        all.judged = true;
    }
    all
}

/// Widens the range `ends` (smallest, largest) so that it contains `x`; NaN changes nothing.
fn widen(ends: &mut [f64; 2], x: f64) {
    *ends = [ends[0].min(x), ends[1].max(x)];
}

/// Part of a sentence that states the time outside the limits, the load factors and the largest angle of attack.
pub(super) fn clause(kept: &Kept, limits: &Limits) -> String {
    if !kept.judged {
        return "the limits of the airframe file were not judged: no sample counts as flight"
            .into();
    }
    format!("{}: {}", outside(kept, limits), loads(kept, limits))
}

/// Phrase with the load factors and the largest angle of attack, each with its limits.
pub(super) fn loads(kept: &Kept, limits: &Limits) -> String {
    let [least, most] = kept.load_factor.map(number);
    let load = format!("load factor {least} to {most}{}", load_limits(limits.load_factor));
    let stall = match limits.stall_deg {
        stall if stall.is_finite() => format!(" of {}°", number(stall)),
        _ => String::new(),
    };
    format!("{load}, angle of attack up to {}°{stall}", number(kept.alpha_deg))
}

/// The smallest and the largest permitted load factor in parentheses; empty if the airframe file states neither.
fn load_limits([least, most]: [f64; 2]) -> String {
    match (least.is_finite(), most.is_finite()) {
        (true, true) => format!(" (limits {} to {})", number(least), number(most)),
        (false, true) => format!(" (at most {}, no lower limit stated)", number(most)),
        (true, false) => format!(" (at least {}, no upper limit stated)", number(least)),
        (false, false) => String::new(),
    }
}

/// Whether the aircraft left the envelope. Short excesses of load factor and angle of attack that `Kept::kept` allows do not
/// count, nor does the rate of the commands.
pub(super) fn left(kept: &Kept) -> bool {
    let o = &kept.outside_s;
    let attitude_or_speed = [o.bank, o.pitch, o.sideslip, o.slow, o.fast];
    kept.judged && (!kept.kept || attitude_or_speed.iter().any(|seconds| *seconds > 0.0))
}

/// Phrase with the time outside the limits of the airframe file. For each passed limit it states the value that was reached, the
/// limit and the time.
pub(super) fn outside(kept: &Kept, limits: &Limits) -> String {
    let seconds = kept.outside_s.any;
    if seconds <= 0.0 {
        return "inside every limit of the airframe file".to_owned();
    }
    let passed = kept.outside_s.passed();
    let one = |(limit, s): &(Limit, f64)| {
        let what = reached(*limit, kept, limits).unwrap_or_else(|| limit.name().to_owned());
        match passed.len() {
            1 => what,
            _ => format!("{what}, for {} s", number(*s)),
        }
    };
    let all: Vec<String> = passed.iter().map(one).collect();
    format!("outside limits for {} s ({})", number(seconds), all.join("; "))
}

/// Phrase with the names of the passed limits and the time outside any of them; `None` if no limit is passed.
pub(super) fn outside_in_short(kept: &Kept) -> Option<String> {
    let names: Vec<&str> = kept.outside_s.passed().iter().map(|(limit, _)| limit.name()).collect();
    let (last, rest) = names.split_last()?;
    let (of, names) = match rest {
        [] => ("limit", (*last).to_owned()),
        rest => ("limits", format!("{} and {last}", rest.join(", "))),
    };
    Some(format!("outside the {of} of {names} for {} s", number(kept.outside_s.any)))
}

/// The value farthest beyond `limit` and the limit, in words; `None` for the rate of the surfaces, whose value is not kept.
fn reached(limit: Limit, kept: &Kept, limits: &Limits) -> Option<String> {
    let [roll, pitch, sideslip] = kept.angles_deg;
    let farther = |[least, most]: [f64; 2], [low, high]: [f64; 2]| {
        if low - least > most - high { (least, low) } else { (most, high) }
    };
    let most_sideslip = limits.sideslip_deg;
    let (what, (value, end), unit) = match limit {
        Limit::Bank => ("roll", farther(roll, [-limits.bank_deg, limits.bank_deg]), "°"),
        Limit::Pitch => ("pitch", farther(pitch, limits.pitch_deg), "°"),
        Limit::LoadFactor => ("load factor", (kept.load_factor[1], limits.load_factor[1]), ""),
        Limit::LeastLoadFactor => ("load factor", (kept.load_factor[0], limits.load_factor[0]), ""),
        Limit::Stall => ("angle of attack", (kept.alpha_deg, limits.stall_deg), "°"),
        Limit::Sideslip => ("sideslip", farther(sideslip, [-most_sideslip, most_sideslip]), "°"),
        Limit::LeastAirspeed => {
            ("airspeed", (kept.airspeed_mps[0], limits.airspeed_mps[0]), " m/s")
        }
        Limit::LargestAirspeed => {
            ("airspeed", (kept.airspeed_mps[1], limits.airspeed_mps[1]), " m/s")
        }
        Limit::SurfaceRate => return None,
    };
    let [value, end] = apart(value, end);
    Some(format!("{what} {value}{unit}, limit {end}{unit}"))
}

/// Two numbers with the same number of decimals, one or as many more as they need to differ.
fn apart(a: f64, b: f64) -> [String; 2] {
    let texts = |places: usize| [a, b].map(|x| format!("{x:.places$}").replace('-', "−"));
    let different = (1..4).map(texts).find(|[a, b]| a != b);
    different.unwrap_or_else(|| texts(4))
}

/// The largest value of the measure `of` over the segments; NaN if there is none.
pub(super) fn most(qualities: &[Quality], of: impl Fn(&Quality) -> f64) -> f64 {
    qualities.iter().map(of).fold(f64::NAN, f64::max)
}

/// The section on the transient responses to the targets; `None` if there are no targets or no limits.
pub(crate) fn section(report: &FlightReport) -> Option<Section> {
    let qualities = report.qualities().filter(|all| !all.is_empty())?;
    let limits = report.envelope?.limits;
    let columns = [
        ("Target: roll, pitch (°)", Align::Left),
        ("Integral of error (° s)", Align::Right),
        ("To 1° (s)", Align::Right),
        ("To 5 % (s)", Align::Right),
        ("Overshoot: roll, pitch (°)", Align::Right),
        ("Load factor", Align::Right),
        ("Angle of attack (°)", Align::Right),
        ("Sideslip (°)", Align::Right),
        ("Least airspeed (m/s)", Align::Right),
        ("Surface travel", Align::Right),
        ("At a stop (%)", Align::Right),
        ("Outside (s)", Align::Right),
    ];
    let mut table = Table::new("Transient response", &columns);
    let range = |[least, most]: [f64; 2]| format!("{} to {}", number(least), number(most));
    for (segment, q) in report.segments.iter().zip(&qualities) {
        let to = [segment.roll_target_rad, segment.pitch_target_rad].map(signed);
        table.rows.push(Row {
            cells: vec![
                to.join(", "),
                number(q.error_integral_deg_s),
                number(q.to_one_deg_s),
                number(q.to_five_percent_s),
                q.overshoot_deg.map(number).join(", "),
                range(q.load_factor),
                range(q.alpha_deg),
                number(q.sideslip_deg),
                number(q.airspeed_mps[0]),
                number(q.travel.surfaces()),
                number(100.0 * q.surface_saturated),
                number(q.outside_s.any),
            ],
            span_s: Some([segment.start_s, segment.end_s]),
            ..Row::default()
        });
    }
    let note = format!(
        "Limits of the aircraft: load factor {}, stall {}°, airspeed {} m/s, bank {}°, pitch {}°; – where none is stated. \
         Load factor: specific force along body z, upwards, over the standard gravity. Integral of |roll error| + |pitch \
         error|. Surface travel: sum of |changes| of the commands, −1..1. Select a target to see its time in every plot.",
        range(limits.load_factor),
        number(limits.stall_deg),
        range(limits.airspeed_mps),
        number(limits.bank_deg),
        range(limits.pitch_deg),
    );
    Some(Section::new("Transient response", &note, vec![Figure::Table(table)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_passed_limit_is_stated_with_the_value_reached() {
        assert_eq!(apart(-30.1, -30.0), ["−30.1", "−30.0"]);
        assert_eq!(apart(-30.04, -30.0), ["−30.04", "−30.00"]);
    }

    #[test]
    fn without_a_sample_in_flight_the_envelope_is_not_judged() {
        let limits = Limits {
            bank_deg: 60.0,
            pitch_deg: [-30.0, 30.0],
            load_factor: [-1.0, 2.2],
            stall_deg: 12.3,
            sideslip_deg: 20.0,
            airspeed_mps: [12.0, 30.0],
            slew_per_s: 5.0,
        };
        let said = |airspeed_mps: f64| {
            let at = |time_s: f64| Sample { time_s, airspeed_mps, ..Sample::default() };
            let samples = [at(0.0), at(0.01), at(0.02)];
            clause(&kept(&samples, &EnvelopeFlown { limits, flying_from_mps: 8.0 }), &limits)
        };
        assert!(said(11.96).starts_with(
            "outside limits for 0.0200 s (airspeed 11.96 m/s, limit 12.00 m/s): load factor"
        ));
        assert!(said(3.0).starts_with("the limits of the airframe file were not judged"));
        assert!(said(20.0).starts_with("inside every limit of the airframe file: "));
        assert!(said(20.0).contains(" (limits −1.00 to 2.20), "), "{}", said(20.0));
    }
}

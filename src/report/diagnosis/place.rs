//! A sentence for the answer box of a diagnosis. It names the force or moment (channel) in which the re-estimated ("tuned") model
//! fails.

use crate::kit::numbers::number;
use greylag_sysid::compare::ChannelId;
use greylag_sysid::diagnose::{Candidate, ChannelLeft, Diagnosis, Verdict};

/// The sentence. It names for each asserted effect (one that the model lacks according to the diagnosis) the channel, and the
/// variable with which the residual of the channel varies. If no effect is asserted, or none has such a curve, it names the
/// channel of which the tuned model leaves the largest share unexplained.
pub(crate) fn of_diagnosis(d: &Diagnosis) -> String {
    let asserted: Vec<&Candidate> = d.effects.iter().filter(|c| c.asserted).collect();
    let places: Vec<String> = asserted.iter().filter_map(|c| of_effect(d, c)).collect();
    if !places.is_empty() {
        return format!("Where it fails: {}.", places.join("; "));
    }
    let share = |ch: &&ChannelLeft| ch.tuned_unexplained_fraction.is_finite();
    let by_share = |a: &&ChannelLeft, b: &&ChannelLeft| {
        a.tuned_unexplained_fraction.total_cmp(&b.tuned_unexplained_fraction)
    };
    let Some(worst) = d.channels.iter().filter(share).max_by(by_share) else {
        return String::new();
    };
    let left = number(100.0 * worst.tuned_unexplained_fraction);
    let name = name(&worst.channel);
    match d.verdict {
        Verdict::Adequate => {
            format!(
                "Where it fails: nowhere clearly; {left} % of {name} is the most left after tuning."
            )
        }
        _ => format!("Where it fails: most in {name}, of which {left} % is left after tuning."),
    }
}

/// Text on the asserted effect `c`, such as "pitching moment, with elevator movement (tuned 28 % unexplained, with backlash
/// 0.3 %)". `None` if the effect has no curve.
fn of_effect(d: &Diagnosis, c: &Candidate) -> Option<String> {
    let curve = c.curve.as_ref()?;
    let mut text = format!("{}, with {}", name(&curve.channel), plain(&curve.variable));
    let left = d.channels.iter().find(|ch| ch.channel == curve.channel);
    let shares = left.map(|ch| [ch.tuned_unexplained_fraction, ch.unexplained_fraction]);
    if let Some([tuned, after]) = shares.filter(|all| all.iter().all(|x| x.is_finite())) {
        let [tuned, after] = [tuned, after].map(|share| number(100.0 * share));
        text += &format!(" (tuned {tuned} % unexplained, with {} {after} %)", c.id);
    }
    Some(text)
}

/// The name in words of the channel with this `symbol`; `symbol` itself if there is none.
fn name(symbol: &str) -> &str {
    let id = ChannelId::ALL.into_iter().find(|id| id.symbol() == symbol);
    id.map_or(symbol, |id| id.name())
}

/// The name of a variable without its unit. The last word is a unit if it contains `°` or `/` or is a single letter.
pub(crate) fn plain(variable: &str) -> &str {
    match variable.rsplit_once(' ') {
        Some((words, unit)) if unit.contains(['°', '/']) || unit.len() == 1 => words,
        _ => variable,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variable_is_named_without_its_unit() {
        let all = [
            "elevator movement °/s",
            "airspeed m/s",
            "altitude m",
            "angle of attack °",
            "throttle",
        ];
        let said = ["elevator movement", "airspeed", "altitude", "angle of attack", "throttle"];
        assert_eq!(all.map(plain), said);
        assert_eq!((name("m"), name("?")), ("pitching moment", "?"));
    }
}

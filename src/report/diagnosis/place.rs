//! A sentence for the answer box of a diagnosis. It names the force or moment (channel) in which the re-estimated ("tuned") model
//! fails.

use crate::kit::numbers::number;
use greylag_sysid::compare::ChannelId;
use greylag_sysid::diagnose::{Candidate, ChannelLeft, Diagnosis, Verdict};

/// Share of a channel below which little of it is unexplained: the model does not fail there.
const LITTLE: f64 = 0.01;

/// Sentence on the channel of each asserted effect, with the variable that shows the effect. Without an asserted effect, the
/// sentence is on the channel with the largest share that is unexplained after tuning.
pub(crate) fn of_diagnosis(d: &Diagnosis) -> String {
    let asserted: Vec<&Candidate> = d.effects.iter().filter(|c| c.asserted).collect();
    let places: Vec<Place> = asserted.iter().filter_map(|c| of_effect(d, c)).collect();
    if !places.is_empty() {
        return of_effects(&places);
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
                "Where it fails: nowhere clearly; {left} % of {name} is the most left after tuning by equation \
                 error."
            )
        }
        _ => format!(
            "Where it fails: most in {name}, of which {left} % is left after tuning by equation error."
        ),
    }
}

/// Sentence on the curves of the asserted effects, for an answer that names their channels. Empty without a
/// curve of an effect.
pub(crate) fn variables(d: &Diagnosis) -> String {
    let asserted = d.effects.iter().filter(|c| c.asserted);
    let curves = asserted.filter_map(|c| c.curve.as_ref());
    let all: Vec<String> =
        curves.map(|c| format!("{} over {}", name(&c.channel), plain(&c.variable))).collect();
    match all.is_empty() {
        true => String::new(),
        false => format!("Its curve: {}.", all.join("; ")),
    }
}

/// Place in which an effect acts.
struct Place {
    /// Text such as "pitching moment, with elevator movement (tuned 28 % unexplained, with backlash 0.3 %)".
    text: String,
    /// Whether the tuned model leaves little of the channel unexplained.
    little: bool,
}

/// Sentence on the places of the asserted effects, of which there is at least one.
fn of_effects(places: &[Place]) -> String {
    let begin = match (places.iter().all(|place| place.little), places.len()) {
        (true, 1) => "Where the effect acts",
        (true, _) => "Where the effects act",
        _ => "Where it fails",
    };
    let all: Vec<&str> = places.iter().map(|place| place.text.as_str()).collect();
    format!("{begin}: {}.", all.join("; "))
}

/// The place of the effect `c`; `None` without its curve.
fn of_effect(d: &Diagnosis, c: &Candidate) -> Option<Place> {
    let curve = c.curve.as_ref()?;
    let left = d.channels.iter().find(|ch| ch.channel == curve.channel);
    let shares = left.map(|ch| [ch.tuned_unexplained_fraction, ch.unexplained_fraction]);
    let shares = shares.filter(|all| all.iter().all(|x| x.is_finite()));
    let text = format!("{}, with {}", name(&curve.channel), plain(&curve.variable));
    Some(placed(text, shares, &c.id))
}

/// The place `text` with the shares of its channel that are unexplained, tuned and with the effect `id`, if they are known.
fn placed(text: String, shares: Option<[f64; 2]>, id: &str) -> Place {
    let Some([tuned, after]) = shares else { return Place { text, little: false } };
    let little = tuned < LITTLE;
    let [tuned, after] = [tuned, after].map(|share| number(100.0 * share));
    let beside = match little {
        true => format!("little of it: {tuned} % → {after} % unexplained"),
        false => format!("tuned {tuned} % unexplained, with {id} {after} %"),
    };
    Place { text: format!("{text} ({beside})"), little }
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
    fn a_channel_of_which_little_is_unexplained_is_no_failure() {
        let of = |shares| placed("lift, with angle of attack".into(), Some(shares), "lift_stall");
        let (little, much) = ([0.00073, 0.00058], [0.282, 0.003]);
        assert_eq!(
            of_effects(&[of(little)]),
            "Where the effect acts: lift, with angle of attack (little of it: 0.0730 % → 0.0580 % unexplained)."
        );
        assert_eq!(
            of_effects(&[of(much)]),
            "Where it fails: lift, with angle of attack (tuned 28.2 % unexplained, with lift_stall 0.300 %)."
        );
        assert!(of_effects(&[of(little), of(much)]).starts_with("Where it fails: "));
        assert!(of_effects(&[of(little), of(little)]).starts_with("Where the effects act: "));
    }

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

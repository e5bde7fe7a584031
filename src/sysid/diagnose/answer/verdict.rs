//! Sentence that states the verdict of a diagnosis: whether the model lacks effects (physical contributions to forces and
//! moments). The catalogue has the effects that the program knows.

use crate::diagnose::answer::result::{Candidate, Status, Verdict};
use crate::diagnose::answer::sentences::{Content, SHOWN, WhyUnknown, values};
use crate::diagnose::search::stepwise::{Found, HELD_OUT};

/// A refused effect is named as the closest one if it removes more than this share of the residual from held-out blocks
/// (stretches of flight that its fit did not use).
const CLOSEST: f64 = 0.5;

/// Sentence that states the verdict. `None` if effects are asserted, because each of them has its own sentence.
pub fn sentence(content: &Content) -> Option<String> {
    let Content { found, verdict, doubtful, effects, .. } = *content;
    match verdict {
        Verdict::Effect => None,
        Verdict::Adequate => Some(adequate(effects)),
        Verdict::Unexplained => Some(unexplained(found, effects)),
        Verdict::Unknown if doubtful.is_empty() => Some(undecided(content)),
        Verdict::Unknown => Some(
            "So nothing is said about forces and moments: put that right first, or leave this flight out.".into(),
        ),
    }
}

/// Sentence that states why no effect is asserted although the residual exceeds noise.
fn undecided(content: &Content) -> String {
    match content.why_unknown {
        Some(WhyUnknown::GivenModelFaultless) => "The model as given has no sure error in any channel of these flights, \
             so nothing is said to be missing. What the tuned model leaves beyond noise comes from the record: filtered, \
             slow or late sensors; log faster and unfiltered to see more."
            .into(),
        Some(WhyUnknown::NotOfTheStates) if content.found.round().flights.len() == 1 => {
            of_one_flight(content.effects)
        }
        Some(WhyUnknown::NotOfTheStates) => format!(
            "These flights cannot say whether the model lacks anything: the tuned model leaves more than noise{}, so most \
             of it is not a function of the states. Filtered, slow or late sensors may be the cause rather than a missing \
             force or moment; log faster and unfiltered.",
            removable(content.found)
        ),
        _ => "These flights cannot say whether the model lacks anything: in every channel the uncertainty of the \
             sensor errors may explain the whole residual; log what is noted below, or fly with better sensors."
            .into(),
    }
}

/// Sentence that states that an effect is missing. It names the closest effect of the catalogue if this effect removes
/// most of the residual.
fn unexplained(found: &Found, effects: &[Candidate]) -> String {
    let close = |c: &&Candidate| c.status == Status::Refused && c.heldout_error_reduction > CLOSEST;
    match effects.iter().find(close) {
        Some(c) => format!(
            "Something is missing. The closest effect of the catalogue is {} ({}): {}; it takes {:.0} % of the error on \
             segments that it was not fitted on, and it is not all of it{}.",
            c.description.trim_end_matches('.'),
            c.id,
            values(c),
            100.0 * c.heldout_error_reduction,
            removable(found)
        ),
        None => format!(
            "Something is missing, and no effect of the catalogue is it{}{}.",
            removable(found),
            best_of(effects)
        ),
    }
}

/// Sentence on a model that lacks nothing. It names the nearest effect with the reason why this effect is not asserted.
fn adequate(effects: &[Candidate]) -> String {
    let Some(c) = effects.iter().find(|c| !c.asserted) else {
        return "Nothing is missing that these flights could show.".into();
    };
    let (id, share) = (&c.id, 100.0 * c.heldout_error_reduction.max(0.0));
    match c.refused.first() {
        _ if c.evidence <= c.threshold => format!(
            "Nothing is missing that these flights could show; the nearest, {id}, is within chance (evidence {:.1}, \
             chance reaches {:.1}).",
            c.evidence, c.threshold
        ),
        _ if c.status == Status::Small => {
            format!(
                "Nothing is missing that matters: the nearest, {id}, is small in these flights."
            )
        }
        _ if c.heldout_error_reduction < HELD_OUT => format!(
            "Nothing is missing that matters: the nearest, {id}, takes {} of the error on held-out segments \
             ({:.0} % is asked).",
            if share < 0.5 { "nothing".into() } else { format!("only {share:.0} %") },
            100.0 * HELD_OUT
        ),
        Some(why) => {
            format!(
                "Nothing is missing that these flights prove; the nearest, {id}, is refused: {why}."
            )
        }
        None => format!("Nothing is missing that these flights prove; the nearest is {id}."),
    }
}

/// Sentence on a single flight that allows no verdict. It names the nearest effect.
fn of_one_flight(effects: &[Candidate]) -> String {
    let nearest = effects.iter().find(|c| !c.asserted).map_or(String::new(), |c| {
        let share = c.heldout_error_reduction;
        let taken = match share.is_finite() && share > 0.0 {
            true => format!(" (takes {:.0} % of the error on held-out segments)", 100.0 * share),
            false => String::new(),
        };
        match c.refused.first() {
            Some(why) => {
                format!(" The nearest is {}{taken}; it is not asserted, because {why}.", c.id)
            }
            None => format!(" The nearest is {}{taken}, which is not enough to assert it.", c.id),
        }
    });
    format!(
        "One flight cannot say whether the model lacks anything.{nearest} Fly more flights and diagnose them together."
    )
}

/// Phrase that states how much of the residual a flexible model could remove; empty if this does not exceed chance.
fn removable(found: &Found) -> String {
    let more = found.remainder.total > found.remainder.total_threshold;
    match more && found.learnable() >= SHOWN {
        true => format!(
            ": a flexible model could remove {:.0} % of the error beyond noise on flights that it was not \
             fitted on",
            100.0 * found.learnable()
        ),
        false => String::new(),
    }
}

/// Phrase on the candidate of the highest rank that is not asserted; empty if there is none.
fn best_of(effects: &[Candidate]) -> String {
    effects.iter().find(|c| !c.asserted).map_or(String::new(), |c| {
        format!(
            " (the closest is {}, evidence {:.1}, where chance reaches {:.1})",
            c.id, c.evidence, c.threshold
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(evidence: f64, heldout: f64, status: Status, refused: &[&str]) -> Candidate {
        Candidate {
            id: "rate_limit".into(),
            description: "The servos are slow.",
            asserted: false,
            status,
            evidence,
            threshold: 7.0,
            parameters: Vec::new(),
            channels: Vec::new(),
            acts: Vec::new(),
            indistinguishable_from: Vec::new(),
            heldout_error_reduction: heldout,
            selected_in_bootstraps: f64::NAN,
            by_flight: Vec::new(),
            minimum_detectable: None,
            refused: refused.iter().map(|why| (*why).to_owned()).collect(),
            curve: None,
        }
    }

    #[test]
    fn an_adequate_model_is_said_to_be_so_with_the_true_reason() {
        let slight = candidate(53.6, 0.02, Status::Refused, &["it takes 2 %, under 10 %"]);
        assert_eq!(
            adequate(&[slight]),
            "Nothing is missing that matters: the nearest, rate_limit, takes only 2 % of the error on held-out segments \
             (10 % is asked)."
        );
        let chance = candidate(2.0, f64::NAN, Status::NotShown, &[]);
        assert_eq!(
            adequate(&[chance]),
            "Nothing is missing that these flights could show; the nearest, rate_limit, is within chance (evidence 2.0, \
             chance reaches 7.0)."
        );
        let small = adequate(&[candidate(53.6, 0.5, Status::Small, &["trace"])]);
        assert!(small.ends_with("rate_limit, is small in these flights."), "{small}");
        let apart = adequate(&[candidate(53.6, 0.5, Status::Refused, &["the flights differ"])]);
        assert!(apart.ends_with("is refused: the flights differ."), "{apart}");
        let none = adequate(&[]);
        let all = [small, apart, none];
        assert!(all.iter().all(|said| said.starts_with("Nothing is missing")), "{all:?}");
    }

    #[test]
    fn one_flight_blames_no_sensor() {
        let said = of_one_flight(&[candidate(30.0, 0.41, Status::Refused, &["one of two"])]);
        assert_eq!(
            said,
            "One flight cannot say whether the model lacks anything. The nearest is rate_limit (takes 41 % of the error \
             on held-out segments); it is not asserted, because one of two. Fly more flights and diagnose them together."
        );
        let weak = of_one_flight(&[candidate(30.0, f64::NAN, Status::NotShown, &[])]);
        assert!(weak.contains("is rate_limit, which is not enough to assert it."), "{weak}");
        assert!(!of_one_flight(&[]).contains("nearest"));
    }
}

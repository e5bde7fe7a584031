//! Advice on the manoeuvres of the next flight, from the result of a diagnosis.
//!
//! A candidate is an effect (a physical contribution to forces and moments) that the model may lack. Its evidence is its test
//! statistic. A candidate whose evidence exceeds its threshold may be asserted as missing in the model.

use crate::diagnose::answer::result::{Advice, Candidate, ChannelLeft, Verdict};
use crate::diagnose::search::stepwise::Found;
use crate::per_flight::askew;
use crate::text::figures;
use greylag_physics::catalogue::describe;

/// Largest number of recommendations for candidates whose evidence is not far below the threshold.
const UNSEEN: usize = 2;
/// Manoeuvres for an effect whose file states none.
const ONE_BY_ONE: &str = "flights that move its variables one by one, at two airspeeds";

/// Advice on the next flight, in descending order of usefulness; empty if there is none.
pub fn advice(
    found: &Found,
    verdict: Verdict,
    effects: &[Candidate],
    channels: &[ChannelLeft],
) -> Vec<Advice> {
    let mut list = Vec::new();
    for c in effects.iter().filter(|c| c.asserted) {
        for other in &c.indistinguishable_from {
            list.push(Advice {
                manoeuvre: separating(&c.id),
                why: format!("it distinguishes {} from {other}", c.id),
                between: designable(&c.id, other),
            });
        }
    }
    if verdict == Verdict::Unexplained {
        let open: Vec<&Candidate> = effects.iter().filter(|c| !c.asserted).take(2).collect();
        if let [a, b] = open[..] {
            list.push(Advice {
                manoeuvre: separating(&a.id),
                why: format!("{} is the closest shape; this shows whether it is the cause", a.id),
                between: designable(&a.id, &b.id),
            });
        }
        list.extend(channels.iter().filter_map(|c| c.worst_regime.clone()).take(1).map(|regime| {
            Advice {
                manoeuvre: "more flight in the worst regime, slowly and fast".into(),
                why: regime,
                between: None,
            }
        }));
    }
    let hidden = effects
        .iter()
        .filter(|c| !c.asserted && c.evidence < c.threshold && c.evidence > 0.3 * c.threshold);
    list.extend(hidden.take(UNSEEN).map(|c| Advice {
        manoeuvre: separating(&c.id),
        why: match c.minimum_detectable {
            Some(least) => format!(
                "{} is near the threshold; less than {} of it could not be seen",
                c.id,
                figures(least)
            ),
            None => format!("{} is near the threshold", c.id),
        },
        between: None,
    }));
    if list.is_empty() && found.round().flights.len() < 2 {
        list.push(Advice {
            manoeuvre: "a second flight with other manoeuvres".into(),
            why: "one flight cannot be checked against another".into(),
            between: None,
        });
    }
    list
}

/// The pair of effects for `greylag design --between`. `None` if one of the two is the misalignment of the axes, which is no
/// effect of the catalogue.
fn designable(a: &str, b: &str) -> Option<[String; 2]> {
    [a, b].iter().all(|id| *id != askew::ID).then(|| [a.to_owned(), b.to_owned()])
}

/// Manoeuvres that distinguish the effect `id` from others. If none are stated for the effect, a general recommendation.
fn separating(id: &str) -> String {
    let stated = describe(id).and_then(|a| a.entry).map_or("", |e| e.separated_by);
    (if stated.is_empty() { ONE_BY_ONE } else { stated }).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_without_stated_manoeuvres_still_gets_some() {
        assert_eq!(separating("no such effect"), ONE_BY_ONE);
        assert_ne!(separating("drag_beta2"), ONE_BY_ONE);
    }

    #[test]
    fn no_flight_is_designed_between_an_effect_and_misaligned_axes() {
        assert_eq!(designable("inertia", askew::ID), None);
        assert_eq!(designable("inertia", "mass"), Some(["inertia".into(), "mass".into()]));
    }
}

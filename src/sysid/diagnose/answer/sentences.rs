//! The answer in plain sentences.

use crate::diagnose::answer::result::{Candidate, ChannelLeft, Measurement, Parameter, Verdict};
use crate::diagnose::answer::{per_flight, shares};
use crate::diagnose::options::Options;
use crate::diagnose::search::stepwise::Found;
use crate::per_flight::askew;
use greylag_model::GreyBox;
use greylag_physics::catalogue::describe;

/// Prior standard deviations beyond which a tuned coefficient is worth a note.
const FAR: f64 = 3.0;

/// The sentences, the most important first.
pub fn sentences(
    found: &Found,
    verdict: Verdict,
    effects: &[Candidate],
    channels: &[ChannelLeft],
    measurement: &[Measurement],
) -> Vec<String> {
    let mut said: Vec<String> = effects.iter().filter(|c| c.asserted).map(asserted).collect();
    match verdict {
        Verdict::Effect => {}
        Verdict::Adequate => said.push(format!(
            "Nothing is missing that these flights could show: the tuned model explains them as well as \
             chance allows{}.",
            best_of(effects)
        )),
        Verdict::Unexplained => said.push(format!(
            "Something is missing, and no effect of the catalogue is it{}{}.",
            removable(found),
            best_of(effects)
        )),
    }
    said.extend(channels.iter().filter_map(|c| {
        let term = c.left_with.as_ref()?;
        Some(format!("More than noise is left in {}: it goes with {term} above all.", c.channel))
    }));
    if verdict == Verdict::Effect && found.remainder.total > found.remainder.total_threshold {
        said.push(format!(
            "Beside that, a flexible model could remove {:.1} % of what the tuned model left beyond noise, \
             more than by chance.",
            100.0 * found.learnable()
        ));
    }
    said.extend(effects.iter().filter(|c| !c.refused.is_empty() && c.evidence > c.threshold).map(
        |c| {
            format!(
                "{} is not asserted although its evidence is {:.0}: {}.",
                c.id,
                c.evidence,
                c.refused.join("; ")
            )
        },
    ));
    if verdict == Verdict::Unexplained {
        let worst = channels
            .iter()
            .max_by(|a, b| a.unexplained_fraction.total_cmp(&b.unexplained_fraction));
        said.extend(worst.and_then(|c| {
            let regime = c.worst_regime.as_ref()?;
            Some(format!("Most is left in {}: {regime}.", c.channel))
        }));
    }
    let before = |m: &&Measurement| m.asserted && m.id != askew::ID;
    said.extend(measurement.iter().filter(before).map(|m| {
        format!(
            "{}: {} is {:.4} ± {:.4} {} ({}), taken out before any aerodynamics.",
            m.flight, m.name, m.value, m.sd, m.unit, m.id
        )
    }));
    said
}

fn asserted(c: &Candidate) -> String {
    let of = |p: &Parameter| {
        let sd = (p.ci95[1] - p.ci95[0]) / (2.0 * 1.96);
        let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
        if sd > 0.0 {
            format!("{} = {} ± {}{unit}", p.name, figures(p.value), figures(sd))
        } else {
            format!("{} = {}{unit}", p.name, figures(p.value))
        }
    };
    let parameters: Vec<String> = c.parameters.iter().map(of).collect();
    let formula = describe(&c.id).map_or("", |about| about.formula);
    let mut text = format!(
        "Missing: {} ({}; {formula}): {}; evidence {:.0} against {:.0} by chance.",
        c.description.trim_end_matches('.'),
        c.id,
        parameters.join(", "),
        c.evidence,
        c.threshold
    );
    if !c.indistinguishable_from.is_empty() {
        let separate = describe(&c.id).and_then(|a| a.entry).map_or("", |e| e.separated_by);
        text += &format!(
            " It could also be {}: these data cannot tell them apart; to be sure, fly {separate}.",
            c.indistinguishable_from.join(" or ")
        );
    }
    text
}

/// What a flexible model could remove, if it is more than chance.
fn removable(found: &Found) -> String {
    match found.remainder.total > found.remainder.total_threshold {
        true => format!(
            ": a flexible model could remove {:.0} % of the error beyond noise on flights that it was not \
             fitted on",
            100.0 * found.learnable()
        ),
        false => String::new(),
    }
}

fn best_of(effects: &[Candidate]) -> String {
    effects.iter().find(|c| !c.asserted).map_or(String::new(), |c| {
        format!(
            " (the closest is {}, evidence {:.1}, where chance reaches {:.1})",
            c.id, c.evidence, c.threshold
        )
    })
}

/// Three significant figures.
pub fn figures(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let places = (2 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    format!("{x:.places$}")
}

/// Notes on coefficients that the data pull far from their prior, and on what was not searched.
pub fn notes(found: &Found, model: &GreyBox, options: &Options) -> Vec<String> {
    let mut notes = Vec::new();
    for t in shares::tuned(found, model) {
        let off = (t.value - t.prior).abs() / t.prior_sd;
        if off > FAR {
            notes.push(format!(
                "{} is tuned to {}, {off:.1} prior standard deviations from its {}: its figure in the model \
                 file is wrong, or something that acts like it is missing.",
                t.name,
                figures(t.value),
                figures(t.prior)
            ));
        }
    }
    notes.push(format!(
        "A flexible model lowers the squared error of flights that it was not fitted on by {:.0} times the \
         noise's variance; {:.0} is reached by chance. By channel (D L Y l m n): {:.0?}.",
        found.remainder.total, found.remainder.total_threshold, found.remainder.removable
    ));
    let round = found.round();
    let own = round.per_flight.constants().len() * round.flights.len();
    for (k, known) in round.known.iter().enumerate().skip(round.coefficients.len() + own) {
        let off = round.projected.tuned[k] / known.width;
        if off.abs() > FAR + 1.0 {
            notes.push(format!(
                "{} would have to be {off:+.1} standard deviations beyond what its flight path says: something \
                 that acts like it may be missing.",
                known.name
            ));
        }
    }
    notes.extend(per_flight::notes(round));
    if !options.without.is_empty() {
        notes.push(format!("Left out of the catalogue: {}.", options.without.join(", ")));
    }
    notes
}

//! Words the result of a diagnosis in sentences. A diagnosis searches the catalogue for effects (groups of terms) that a model
//! lacks. The evidence of an effect must exceed a threshold, which chance hardly reaches. The residual is measured minus
//! modelled forces and moments.

use crate::diagnose::answer::probability::{self, Explanation};
use crate::diagnose::answer::result::{
    Candidate, ChannelLeft, FlightTrim, Measurement, Parameter, Status, Verdict,
};
use crate::diagnose::answer::{per_flight, shares, verdict};
use crate::diagnose::options::Options;
use crate::diagnose::regression::sensors::BLUR;
use crate::diagnose::search::stepwise::Found;
use crate::per_flight::askew;
use crate::text::{figures, with_interval};
use greylag_model::GreyBox;
use greylag_physics::catalogue::describe;
use greylag_physics::inputs::{Kind, MOST};

/// A re-estimated coefficient gets a note if it differs from its value in the model file by more than this number of prior
/// standard deviations.
const FAR: f64 = 3.0;
/// Smallest share that is reported. A smaller share would be printed as zero.
pub const SHOWN: f64 = 0.005;
/// Half width of a 95 % interval in standard deviations.
pub const INTERVAL: f64 = 1.96;
/// Advice for misaligned axes.
const AXES: &str = "amend with --axes-askew 3, or mount the board anew";

/// Results that the sentences describe.
pub struct Content<'a> {
    /// Result of the search.
    pub found: &'a Found,
    /// Overall verdict on the model.
    pub verdict: Verdict,
    /// Reason for [`Verdict::Unknown`]. `None` for other verdicts, and if a physically impossible estimate is the reason.
    pub why_unknown: Option<WhyUnknown>,
    /// Physically impossible estimates, in words.
    pub doubtful: &'a [String],
    /// All candidates (physical effects that the model may lack), the asserted effects first.
    pub effects: &'a [Candidate],
    /// Probabilities of the explanations.
    pub explanations: &'a [Explanation],
    /// Unexplained residual of each channel.
    pub channels: &'a [ChannelLeft],
    /// Sensor errors and wind of each flight.
    pub measurement: &'a [Measurement],
    /// Trims of each flight.
    pub trims: &'a [FlightTrim],
}

/// Reason why a diagnosis has no verdict although no estimate is physically impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WhyUnknown {
    /// Remaining sensor errors may account for the whole residual in every channel (force or moment).
    SensorsMayAccount,
    /// The model as given has no certain error in any channel.
    GivenModelFaultless,
    /// A flexible model, a regression on the states without physics, can remove only little of the residual.
    NotOfTheStates,
}

/// Describes the results in sentences. Their order is: impossible estimates, misaligned axes, missing effects and verdict,
/// probabilities, small effects, remaining residual, refused effects, channels without judgement, sensors, trims.
pub fn sentences(content: &Content) -> Vec<String> {
    let Content { verdict, doubtful, effects, channels, measurement, .. } = *content;
    let mut all: Vec<String> = doubtful.to_vec();
    let askew = per_flight::askew_sentences(measurement);
    if !askew.is_empty() {
        all.extend(askew.into_iter().map(|s| format!("{s} To keep it out of the model, {AXES}.")));
    }
    all.extend(effects.iter().filter(|c| c.asserted).map(asserted));
    all.extend(verdict::sentence(content));
    let several = effects.iter().filter(|c| c.asserted).count() > 1;
    all.extend(probability::sentence(content.explanations, several));
    all.extend(effects.iter().filter(|c| c.status == Status::Small).map(small));
    if verdict != Verdict::Unknown {
        all.extend(beyond(content));
    }
    let refused = |c: &&Candidate| c.status == Status::Refused && c.evidence > c.threshold;
    all.extend(effects.iter().filter(refused).filter(|c| !c.refused.is_empty()).map(|c| {
        format!(
            "{} is not asserted although its evidence is {:.0}: {}.",
            c.id,
            c.evidence,
            c.refused.join("; ")
        )
    }));
    if verdict == Verdict::Unexplained {
        let open = channels.iter().filter(|c| !c.abstained && c.unexplained_fraction.is_finite());
        let worst = open.max_by(|a, b| a.unexplained_fraction.total_cmp(&b.unexplained_fraction));
        all.extend(worst.and_then(|c| {
            let regime = c.worst_regime.as_ref()?;
            Some(format!("Most is left in {}: {regime}.", c.channel))
        }));
    }
    all.extend(abstained(channels));
    all.extend(sensors(measurement));
    all.extend(per_flight::trim_sentences(content.trims));
    all
}

/// Sentences on the residual that remains with the effects found.
fn beyond(content: &Content) -> Vec<String> {
    let Content { found, verdict, channels, .. } = *content;
    let left = channels.iter().filter(|c| !c.abstained).filter_map(|c| {
        let term = c.left_with.as_ref()?;
        Some(format!("More than noise is left in {}: it goes with {term} above all.", c.channel))
    });
    let mut all: Vec<String> = left.collect();
    let more = found.remainder.total > found.remainder.total_threshold;
    if verdict == Verdict::Effect && more && found.learnable() >= SHOWN {
        all.push(format!(
            "In addition, a flexible model could remove {:.1} % of what the tuned model left beyond noise, \
             more than by chance.",
            100.0 * found.learnable()
        ));
    }
    all
}

/// Sentences on the channels in which these flights cannot assess the model, one for each reason.
fn abstained(channels: &[ChannelLeft]) -> Vec<String> {
    let mut by_reason: Vec<(&str, Vec<&str>)> = Vec::new();
    for c in channels {
        let Some(why) = c.why_abstained.as_deref() else { continue };
        match by_reason.iter_mut().find(|(reason, _)| *reason == why) {
            Some((_, names)) => names.push(&c.channel),
            None => by_reason.push((why, vec![&c.channel])),
        }
    }
    let one =
        |(why, names): (&str, Vec<&str>)| format!("No judgement in {}: {why}.", names.join(", "));
    by_reason.into_iter().map(one).collect()
}

/// Sentences on significant sensor errors and wind, one for each flight.
fn sensors(measurement: &[Measurement]) -> Vec<String> {
    let before = measurement.iter().filter(|m| m.asserted && m.id != askew::ID);
    let mut flights: Vec<(&str, Vec<String>)> = Vec::new();
    for m in before {
        let words = format!("{} {} ({})", m.name, with_interval(m.value, m.sd, &m.unit), m.id);
        match flights.last_mut() {
            Some((flight, all)) if *flight == m.flight => all.push(words),
            _ => flights.push((&m.flight, vec![words])),
        }
    }
    let one = |(flight, all): (&str, Vec<String>)| {
        format!(
            "{flight}: errors of the sensors and the wind, taken out before any aerodynamics (95 %): {}.",
            all.join(", ")
        )
    };
    flights.into_iter().map(one).collect()
}

/// The parameters with their 95 % intervals, in words.
pub fn values(c: &Candidate) -> String {
    let of = |p: &Parameter| {
        let sd = (p.ci95[1] - p.ci95[0]) / (2.0 * INTERVAL);
        let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
        match sd > 0.0 {
            true => format!("{} = {}", p.name, with_interval(p.value, sd, &p.unit)),
            false => format!("{} = {}{unit}", p.name, figures(p.value)),
        }
    };
    c.parameters.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Sentence on an effect that is significant but small.
fn small(c: &Candidate) -> String {
    format!(
        "Seen, and small in these flights: {} ({}): {} (95 %); evidence {:.0} against {:.0} by chance. {}.",
        c.description.trim_end_matches('.'),
        c.id,
        values(c),
        c.evidence,
        c.threshold,
        capital(&c.refused.join("; "))
    )
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |c| c.to_uppercase().chain(letters).collect())
}

fn asserted(c: &Candidate) -> String {
    let formula = describe(&c.id).map_or("", |about| about.formula);
    let mut text = format!(
        "Missing: {} ({}; {formula}): {} (95 %); evidence {:.0} against {:.0} by chance.",
        c.description.trim_end_matches('.'),
        c.id,
        values(c),
        c.evidence,
        c.threshold
    );
    if !c.indistinguishable_from.is_empty() {
        let separate = describe(&c.id).and_then(|a| a.entry).map_or("", |e| e.separated_by);
        text += &alike(&c.indistinguishable_from, separate);
    }
    text
}

/// Sentence that names `others`, effects that may be the cause instead, and the manoeuvres `separate` that would decide. An
/// effect file may state no manoeuvres. No manoeuvre decides between an effect and misaligned axes.
fn alike(others: &[String], separate: &str) -> String {
    let decides = match separate {
        _ if others.iter().all(|id| id == askew::ID) => format!("; to see, {AXES}"),
        "" => String::new(),
        manoeuvres => format!("; to be sure, fly {manoeuvres}"),
    };
    format!(
        " It could also be {}: these data cannot tell them apart{decides}.",
        others.join(" or ")
    )
}

/// Notes on coefficients and sensor errors far from their prior values, on what a flexible model could remove, on constants
/// of single flights, and on effects that were left out of the search.
pub fn notes(found: &Found, model: &GreyBox, verdict: Verdict, options: &Options) -> Vec<String> {
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
    notes.extend(sensors_far_off(found, verdict));
    notes.extend(per_flight::notes(found.round()));
    if !options.without.is_empty() {
        notes.push(format!("Left out of the catalogue: {}.", options.without.join(", ")));
    }
    if model.effects().filter(|about| Kind::from_id(about.id).is_some()).count() == MOST {
        notes.push(format!(
            "The model has {MOST} effects on the inputs (servos, lags, delays), the most that it can have. No further one was \
             examined."
        ));
    }
    notes
}

/// Notes on the sensor errors that are far from their estimates in the reconstruction.
fn sensors_far_off(found: &Found, verdict: Verdict) -> Vec<String> {
    let round = found.round();
    let own = round.per_flight.constants().len() * round.flights.len();
    let of_sensors = round.known.iter().enumerate().skip(round.coefficients.len() + own);
    let off = of_sensors.map(|(k, known)| (known, round.projected.tuned[k] / known.width));
    let far = off.filter(|(_, off)| off.abs() > FAR + 1.0);
    far.map(|(known, off)| far_off(&known.name, off, verdict)).collect()
}

/// Note on the sensor error `name`, which is `off` standard deviations from its estimate in the reconstruction.
fn far_off(name: &str, off: f64, verdict: Verdict) -> String {
    let smoothing = name.starts_with(BLUR);
    let what = if smoothing { " (a smoothing of the recorded deflections)" } else { "" };
    let end = match (verdict, smoothing) {
        (Verdict::Adequate, true) => {
            "its effect is small, and no missing effect was found that acts like it"
        }
        (Verdict::Adequate, false) => "no missing effect was found that acts like it",
        _ => "something that acts like it may be missing",
    };
    format!(
        "{name}{what} would have to be {off:+.1} standard deviations beyond what its flight path says: {end}."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smoothing_of_the_record_does_not_contradict_an_adequate_model() {
        let name = "blur_actuators of flight a.csv";
        let adequate = far_off(name, -10.3, Verdict::Adequate);
        assert!(
            adequate.contains("(a smoothing of the recorded deflections) would have to be -10.3")
        );
        assert!(adequate.ends_with("no missing effect was found that acts like it."), "{adequate}");
        let unexplained = far_off(name, -10.3, Verdict::Unexplained);
        assert!(unexplained.ends_with("acts like it may be missing."), "{unexplained}");
    }

    #[test]
    fn only_stated_manoeuvres_are_to_be_flown() {
        let said = alike(&["mass".into(), "inertia".into()], "");
        assert_eq!(said, " It could also be mass or inertia: these data cannot tell them apart.");
        assert!(
            alike(&["mass".into()], "fast rolls").ends_with("apart; to be sure, fly fast rolls.")
        );
        let axes = alike(&[askew::ID.into()], "fast rolls");
        assert!(
            axes.ends_with("apart; to see, amend with --axes-askew 3, or mount the board anew.")
        );
    }
}

//! Sentence for the answer box on where the model fails, or where the effect acts that was added to it.

use crate::kit::numbers::number;
use greylag_physics::Channel;
use greylag_physics::catalogue::describe;
use greylag_sysid::compare::{ChannelId, Comparison, ModelResult};

/// Share above which the sentence gives the error as a multiple of the measured variation, because a percentage of four
/// or more digits is hard to read. The channel then hardly varies in the flights.
const MULTIPLE: f64 = 10.0;
/// Smallest share that an effect is taken to leave. Smaller shares are uncertain, and the ratio to them would be random.
const LEAST: f64 = 1e-4;
/// Share above which the sentence on an added effect names the channel in which most is left.
const STATED: f64 = 0.005;
/// A second channel is named beside the first if an effect reduces its unexplained share by at least this fraction of the first
/// reduction.
const NAMED_TOO: f64 = 0.3;
/// Number of channels that are forces and moments, the first of [`ChannelId::ALL`].
const LOADS: usize = 6;

fn share(model: &ModelResult, id: ChannelId) -> Option<f64> {
    let of = model.channels.iter().find(|ch| ch.channel == id);
    of.map(|ch| ch.unexplained_fraction).filter(|share| share.is_finite())
}

/// The channel that the sentence of [`of_comparison`] names first; `None` if it names none.
pub(crate) fn channel_of(c: &Comparison) -> Option<ChannelId> {
    let effects: Vec<&str> = c.answer.numbers.effects.iter().map(|e| e.id.as_str()).collect();
    let added = match &c.models[..] {
        [given, after] if !effects.is_empty() => {
            reduced(&effects, given, c.tuned.as_ref(), after).and_then(|ids| ids.first().copied())
        }
        _ => None,
    };
    let worst = |first: &ModelResult| {
        let channels = first.worst_first();
        channels.iter().map(|ch| ch.channel).find(|id| share(first, *id).is_some())
    };
    added.or_else(|| c.models.first().and_then(worst))
}

/// Sentence for the page of the comparison `c`. For a model and its amendment with added effects, it states where they act.
pub(crate) fn of_comparison(c: &Comparison) -> String {
    let effects: Vec<&str> = c.answer.numbers.effects.iter().map(|e| e.id.as_str()).collect();
    let added = match &c.models[..] {
        [given, after] => of_added(&effects, given, c.tuned.as_ref(), after),
        _ => None,
    };
    added.unwrap_or_else(|| of_models(&c.models))
}

/// Sentence on the one or two channels of [`reduced`]. `None` if there is no effect or no reduction.
pub(crate) fn of_added(
    effects: &[&str],
    given: &ModelResult,
    tuned: Option<&ModelResult>,
    after: &ModelResult,
) -> Option<String> {
    let ids = reduced(effects, given, tuned, after)?;
    let (verb, it) = match effects {
        [] => return None,
        [_] => ("acts", "it"),
        _ => ("act", "them"),
    };
    let shares: Vec<String> = ids
        .iter()
        .map(|id| format!("{}, {}", id.name(), shares(*id, given, tuned, after, it)))
        .collect();
    let next = most_left(after, &ids);
    Some(format!("Where {} {verb}: {}{next}.", effects.join(" and "), shares.join("; ")))
}

/// The one or two channels in which the `effects` that were added to `after` reduce the unexplained share most, among the channels
/// in which they act. For effects that act on deflections, all forces and moments are compared. The share is compared with that of
/// the tuned model, or with that of the given model if `tuned` is unknown. `None` if no share is reduced.
fn reduced(
    effects: &[&str],
    given: &ModelResult,
    tuned: Option<&ModelResult>,
    after: &ModelResult,
) -> Option<Vec<ChannelId>> {
    let fall = |id: &ChannelId| {
        let fall = share(tuned.unwrap_or(given), *id)? - share(after, *id)?;
        (fall > 0.0).then_some((*id, fall))
    };
    let falls = |ids: &[ChannelId]| {
        let mut falls: Vec<_> = ids.iter().filter_map(fall).collect();
        falls.sort_by(|a, b| b.1.total_cmp(&a.1));
        falls.dedup_by_key(|(id, _)| *id);
        let least = falls.first().map_or(0.0, |(_, most)| NAMED_TOO * most);
        falls.retain(|(_, fall)| *fall >= least);
        falls.truncate(2);
        (!falls.is_empty()).then(|| falls.into_iter().map(|(id, _)| id).collect::<Vec<_>>())
    };
    let (loads, rates) = ChannelId::ALL.split_at(LOADS);
    falls(&acted_on(effects)).or_else(|| falls(loads)).or_else(|| falls(rates))
}

/// The unexplained shares of the channel `id` by each model, %. `it` stands for the effects of `after`.
fn shares(
    id: ChannelId,
    given: &ModelResult,
    tuned: Option<&ModelResult>,
    after: &ModelResult,
    it: &str,
) -> String {
    let percent = |model: &ModelResult| {
        share(model, id).map_or("–".into(), |share| number(100.0 * share.max(0.0)))
    };
    let with = percent(after);
    match tuned {
        Some(tuned) => format!(
            "unexplained {} % as given, {} % tuned, {with} % with {it}",
            percent(given),
            percent(tuned)
        ),
        None => format!("unexplained {} % as given, {with} % tuned and with {it}", percent(given)),
    }
}

/// Clause on the force or moment with the largest unexplained share in `after`. It is empty if that is one of the channels `named`,
/// or if the share is below [`STATED`].
fn most_left(after: &ModelResult, named: &[ChannelId]) -> String {
    let loads = ChannelId::ALL.into_iter().take(LOADS);
    let left = loads.filter_map(|id| Some((id, share(after, id)?)));
    match left.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((id, left)) if !named.contains(&id) && left > STATED => {
            format!("; most left now: {}, {} %", id.name(), number(100.0 * left))
        }
        _ => String::new(),
    }
}

/// Channels in which the effects act according to the catalogue; empty for effects that act on the deflections.
fn acted_on(effects: &[&str]) -> Vec<ChannelId> {
    let entries = effects.iter().filter_map(|id| describe(id)?.entry);
    let of = |channel: &Channel| match channel {
        Channel::Drag | Channel::BodyX => ChannelId::Drag,
        Channel::Lift => ChannelId::Lift,
        Channel::Side => ChannelId::Side,
        Channel::Roll => ChannelId::Roll,
        Channel::Pitch => ChannelId::Pitch,
        Channel::Yaw => ChannelId::Yaw,
    };
    entries.flat_map(|entry| entry.channels.iter().map(of)).collect()
}

/// The amplitude ratio of error and variation that belongs to a share of the variance, with two significant figures.
fn ratio(share: f64) -> String {
    let ratio = share.max(LEAST).sqrt();
    let places = (1 - ratio.log10().floor() as i32).clamp(0, 2) as usize;
    format!("{ratio:.places$}")
}

/// Sentence on the channels `quiet`, the worst first, each with its unexplained share. The flights hardly move these channels.
fn quiet_axes(quiet: &[(&str, f64)]) -> String {
    let names: Vec<&str> = quiet.iter().map(|(name, _)| *name).collect();
    let times: Vec<String> = quiet.iter().map(|(_, share)| ratio(*share)).collect();
    let (verb, axis, errors) = match quiet.len() {
        1 => ("varies", "a quiet axis", "its error is"),
        _ => ("vary", "quiet axes", "the errors are"),
    };
    format!(
        "Where it fails: most in {}, which hardly {verb} in these flights ({axis}): {errors} {} times the variation.",
        names.join(", "),
        times.join(", ")
    )
}

/// Sentence on the channel in which the first model leaves the largest share unexplained. It includes the shares that the other
/// models leave in this channel. Empty without finite shares.
pub(crate) fn of_models(models: &[ModelResult]) -> String {
    let Some((first, rest)) = models.split_first() else { return String::new() };
    let channels = first.worst_first();
    let mut shares = channels.iter().filter_map(|c| Some((c.channel, share(first, c.channel)?)));
    let Some((channel, left)) = shares.next() else { return String::new() };
    let name = channel.name();
    let all: Vec<String> = models
        .iter()
        .filter_map(|m| Some(format!("{} % by {}", number(100.0 * share(m, channel)?), m.name)))
        .collect();
    match rest {
        [] if left > MULTIPLE => {
            let mut quiet = vec![(name, left)];
            let mut lively = String::new();
            for (id, share) in shares {
                if share <= MULTIPLE {
                    let unexplained = number(100.0 * share);
                    lively = format!(" Then {}, {unexplained} % unexplained.", id.name());
                    break;
                }
                quiet.push((id.name(), share));
            }
            quiet_axes(&quiet) + &lively
        }
        [] => {
            let worse = if left > 1.0 { ", worse than a constant" } else { "" };
            format!(
                "Where it fails: most in {name}, {} % unexplained{worse}.",
                number(100.0 * left)
            )
        }
        _ => format!("Where it failed: most in {name}, left unexplained: {}.", all.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ChannelId::{Alpha, Lift, Pitch, Roll, Yaw};
    use greylag_sysid::compare::{ChannelResult, Map};

    fn model(name: &str, shares: &[(ChannelId, f64)]) -> ModelResult {
        let channel = |&(channel, unexplained_fraction): &(ChannelId, f64)| ChannelResult {
            channel,
            name: channel.name(),
            unit: channel.unit(),
            windows: 1,
            measured_sd: 1.0,
            residual_rms: 1.0,
            noise_sd: 0.0,
            unexplained_fraction,
            effect_per_s: 0.0,
            offset_share: 0.0,
            worst_regime: String::new(),
            abstained: None,
            regime: None,
            bins: Vec::new(),
            map: Map { alpha_deg: Vec::new(), beta_deg: Vec::new(), cells: Vec::new() },
        };
        ModelResult {
            name: name.into(),
            sentences: Vec::new(),
            free_run: Vec::new(),
            known: None,
            growth: Vec::new(),
            channels: shares.iter().map(channel).collect(),
            traces: Vec::new(),
        }
    }

    #[test]
    fn an_added_effect_acts_where_it_takes_most_away() {
        let given = model("given", &[(Lift, 0.5), (Roll, 2.93), (Alpha, 9.0)]);
        let tuned = model("tuned", &[(Lift, 0.02), (Roll, 0.38), (Alpha, 8.0)]);
        let after = model("after", &[(Lift, 0.02), (Roll, 0.0009), (Alpha, 0.0)]);
        assert_eq!(
            of_added(&["propwash"], &given, Some(&tuned), &after).unwrap(),
            "Where propwash acts: rolling moment, unexplained 293 % as given, 38.0 % tuned, 0.0900 % with it; most left \
             now: lift, 2.00 %."
        );
        // without the tuned model the catalogue says where the effect acts
        let given = model("given", &[(Lift, 0.5), (Roll, 2.93)]);
        let after = model("after", &[(Lift, 0.1), (Roll, 0.0009)]);
        assert_eq!(
            of_added(&["lift_stall"], &given, None, &after).unwrap(),
            "Where lift_stall acts: lift, unexplained 50.0 % as given, 10.0 % tuned and with it."
        );
        assert_eq!(of_added(&[], &given, None, &after), None);
        assert_eq!(of_added(&["lift_stall"], &given, Some(&given), &given), None);
    }

    #[test]
    fn a_quiet_axis_is_named_with_the_worst_livelier_channel() {
        let quiet = model("m", &[(Lift, 0.1), (Pitch, 723.61), (Yaw, 2.02), (Alpha, 5.0)]);
        assert_eq!(
            of_models(&[quiet]),
            "Where it fails: most in pitching moment, which hardly varies in these flights (a quiet axis): its error is 27 times \
             the variation. Then yawing moment, 202 % unexplained."
        );
        // the rates are named only in the place of forces
        let rates = model("m", &[(Lift, 0.1), (Alpha, 5.0)]);
        assert!(of_models(&[rates]).contains("most in lift, 10.0 % unexplained"));
    }
}

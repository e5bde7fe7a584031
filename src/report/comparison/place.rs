//! Sentence for the answer box on where a model fails, or on what is left beside the channels in which an added effect acts.

use greylag_sysid::compare::answer::{Acting, multiple, share as share_text};
use greylag_sysid::compare::{ChannelId, Comparison, ModelResult};

/// Share above which the sentence on an added effect names the channel in which most is left.
const STATED: f64 = 0.005;
/// Number of channels that are forces and moments, the first of [`ChannelId::ALL`].
const LOADS: usize = 6;

fn share(model: &ModelResult, id: ChannelId) -> Option<f64> {
    let of = model.channels.iter().find(|ch| ch.channel == id);
    of.map(|ch| ch.unexplained_fraction).filter(|share| share.is_finite())
}

/// The channels of `acts`, in its order.
pub(crate) fn named(acts: &[Acting]) -> Vec<ChannelId> {
    acts.iter().map(|a| a.channel).collect()
}

/// The channel that the answer box of `c` names first; `None` if it names none.
pub(crate) fn channel_of(c: &Comparison) -> Option<ChannelId> {
    let worst = |first: &ModelResult| {
        let channels = first.worst_first();
        channels.iter().map(|ch| ch.channel).find(|id| share(first, *id).is_some())
    };
    let acts = named(&c.answer.numbers.acts);
    acts.first().copied().or_else(|| c.models.first().and_then(worst))
}

/// Sentence for the page of the comparison `c`, see [`of_models`]. Empty if an estimate is physically impossible.
pub(crate) fn of_comparison(c: &Comparison) -> String {
    if !c.doubtful.is_empty() {
        return String::new();
    }
    of_models(&c.models, &c.answer.numbers.acts)
}

/// Sentence on where `models` fail. If the answer names the channels `acts` in which added effects act, the sentence is on the channel
/// in which the last model leaves most; it is empty if that is one of them, or if little is left.
pub(crate) fn of_models(models: &[ModelResult], acts: &[Acting]) -> String {
    match models.last() {
        Some(after) if !acts.is_empty() => most_left(after, &named(acts)),
        _ => worst(models),
    }
}

/// Sentence on the force or moment with the largest unexplained share in `after`. It is empty if that is one of the channels `named`,
/// or if the share is below [`STATED`].
fn most_left(after: &ModelResult, named: &[ChannelId]) -> String {
    let loads = ChannelId::ALL.into_iter().take(LOADS);
    let left = loads.filter_map(|id| Some((id, share(after, id)?)));
    match left.max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((id, left)) if !named.contains(&id) && left > STATED => {
            format!("Most left now: {}, {} unexplained.", id.name(), share_text(left))
        }
        _ => String::new(),
    }
}

/// Sentence on the channels `quiet`, the worst first, each with its unexplained share. The flights hardly move these channels.
fn quiet_axes(quiet: &[(&str, f64)]) -> String {
    let one = |(k, (name, share)): (usize, &(&str, f64))| {
        let word = if k == 0 { " unexplained" } else { "" };
        format!("{name} ({}{word})", share_text(*share))
    };
    let names: Vec<String> = quiet.iter().enumerate().map(one).collect();
    let (verb, axis) = match quiet.len() {
        1 => ("varies", "a quiet axis"),
        _ => ("vary", "quiet axes"),
    };
    format!(
        "Where it fails: most in {}, which hardly {verb} in these flights ({axis}).",
        names.join(", ")
    )
}

/// Sentence on the channel in which the first model leaves the largest share unexplained. It includes the shares that the other
/// models leave in this channel. Empty without finite shares.
fn worst(models: &[ModelResult]) -> String {
    let Some((first, rest)) = models.split_first() else { return String::new() };
    let channels = first.worst_first();
    let mut shares = channels.iter().filter_map(|c| Some((c.channel, share(first, c.channel)?)));
    let Some((channel, left)) = shares.next() else { return String::new() };
    let name = channel.name();
    let all: Vec<String> = models
        .iter()
        .filter_map(|m| Some(format!("{} by {}", share_text(share(m, channel)?), m.name)))
        .collect();
    match rest {
        [] if multiple(left).is_some() => {
            let mut quiet = vec![(name, left)];
            let mut lively = String::new();
            for (id, share) in shares {
                if multiple(share).is_none() {
                    lively = format!(" Then {}, {} unexplained.", id.name(), share_text(share));
                    break;
                }
                quiet.push((id.name(), share));
            }
            quiet_axes(&quiet) + &lively
        }
        [] => {
            let worse = if left > 1.0 { ", worse than a constant" } else { "" };
            format!("Where it fails: most in {name}, {} unexplained{worse}.", share_text(left))
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
    fn beside_the_channels_of_an_effect_the_one_with_most_left_is_named() {
        let given = model("given", &[(Lift, 0.5), (Roll, 2.93), (Alpha, 9.0)]);
        let after = model("after", &[(Lift, 0.02), (Roll, 0.0009), (Alpha, 0.0)]);
        let acts = |channel: ChannelId| Acting {
            channel,
            name: channel.name(),
            given: None,
            tuned: Some(0.38),
            after: 0.0009,
        };
        let models = [given, after];
        let left = of_models(&models, &[acts(Roll)]);
        assert_eq!(left, "Most left now: lift, 2 % unexplained.");
        assert_eq!(of_models(&models, &[acts(Roll), acts(Lift)]), "");
        assert!(of_models(&models, &[]).starts_with("Where it failed: most in rolling moment"));
    }

    #[test]
    fn a_quiet_axis_is_named_with_the_worst_livelier_channel() {
        let quiet = model("m", &[(Lift, 0.1), (Pitch, 723.61), (Yaw, 2.02), (Alpha, 5.0)]);
        assert_eq!(
            worst(&[quiet]),
            "Where it fails: most in pitching moment (724 times its variance unexplained), which hardly varies in these flights (a \
             quiet axis). Then yawing moment, 202 % unexplained."
        );
        // the rates are named only in the place of forces
        let rates = model("m", &[(Lift, 0.1), (Alpha, 5.0)]);
        assert!(worst(&[rates]).contains("most in lift, 10 % unexplained"));
    }
}

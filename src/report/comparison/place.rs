//! Sentence on the channel (force, moment or rate) with the largest unexplained share. This share is the variance of the
//! residual without noise, as a fraction of the measured variance without noise.

use crate::kit::numbers::number;
use greylag_sysid::compare::{ChannelId, ModelResult};

/// Share above which the sentence states the rms error as a multiple of the measured variation. A percentage of four or
/// more digits would be hard to read.
const MULTIPLE: f64 = 10.0;

/// Channel in which the model leaves the largest share unexplained, and this share. `None` without finite shares.
pub(crate) fn worst(model: &ModelResult) -> Option<(ChannelId, f64)> {
    let shares = ChannelId::ALL.into_iter().filter_map(|id| Some((id, share(model, id)?)));
    shares.max_by(|a, b| a.1.total_cmp(&b.1))
}

fn share(model: &ModelResult, id: ChannelId) -> Option<f64> {
    let of = model.channels.iter().find(|ch| ch.channel == id);
    of.map(|ch| ch.unexplained_fraction).filter(|share| share.is_finite())
}

/// Sentence on the channel in which the first model leaves the largest share unexplained. It includes the shares that the other
/// models leave in this channel. Empty without finite shares.
pub(crate) fn of_models(models: &[ModelResult]) -> String {
    let Some((first, rest)) = models.split_first() else { return String::new() };
    let Some((channel, left)) = worst(first) else { return String::new() };
    let name = channel.name();
    let all: Vec<String> = models
        .iter()
        .filter_map(|m| Some(format!("{} % by {}", number(100.0 * share(m, channel)?), m.name)))
        .collect();
    match rest {
        [] if left > MULTIPLE => format!(
            "Where it fails: most in {name}, whose error is {} times the measured variation (rms).",
            number(left.sqrt())
        ),
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

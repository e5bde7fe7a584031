//! Sentence for the answer box on the channel with the largest unexplained share.

use crate::kit::numbers::number;
use greylag_sysid::compare::{ChannelId, ModelResult};

/// Sentence on the channel in which the first model leaves the largest share unexplained. It includes the share that the last
/// model leaves in this channel. Empty without finite shares.
pub(crate) fn of_models(models: &[ModelResult]) -> String {
    let share = |model: &ModelResult, id: ChannelId| {
        let of = model.channels.iter().find(|ch| ch.channel == id);
        of.map(|ch| ch.unexplained_fraction).filter(|share| share.is_finite())
    };
    let Some((first, rest)) = models.split_first() else { return String::new() };
    let shares = ChannelId::ALL.into_iter().filter_map(|id| Some((id, share(first, id)?)));
    let Some((worst, left)) = shares.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return String::new();
    };
    let after = rest.last().and_then(|last| Some((last, share(last, worst)?)));
    let name = worst.name();
    match after {
        None => {
            let worse = if left > 1.0 { ", worse than a constant" } else { "" };
            format!(
                "Where it fails: most in {name}, {} % unexplained{worse}.",
                number(100.0 * left)
            )
        }
        Some((last, after)) => format!(
            "Where it failed: most in {name}, {} % unexplained; with {} {} %.",
            number(100.0 * left),
            last.name,
            number(100.0 * after)
        ),
    }
}

//! Order of a model's channels and sentences for a reader: the largest unexplained share first.

use super::result::{ChannelResult, ModelResult};
use crate::weak_form::channels::ChannelId;

impl ModelResult {
    /// The channels in descending order of their unexplained share; an undefined share comes last. The rates of V, α and β come
    /// after the forces and moments if the logs contain the forces, because they contain the same information.
    pub fn worst_first(&self) -> Vec<&ChannelResult> {
        use ChannelId::{Airspeed, Alpha, Beta, Drag, Lift, Side};
        let forces = self.channels.iter().any(|c| matches!(c.channel, Drag | Lift | Side));
        let again = |c: &ChannelResult| forces && matches!(c.channel, Airspeed | Alpha | Beta);
        let share = |c: &ChannelResult| match c.unexplained_fraction {
            share if share.is_nan() => f64::NEG_INFINITY,
            share => share,
        };
        let mut all: Vec<&ChannelResult> = self.channels.iter().collect();
        all.sort_by(|a, b| again(a).cmp(&again(b)).then(share(b).total_cmp(&share(a))));
        all
    }

    /// The sentences, with those on channels in the order of [`worst_first`](Self::worst_first). The other sentences keep their
    /// places.
    pub fn sentences_worst_first(&self) -> Vec<&str> {
        let channels = self.worst_first();
        let rank = |said: &str| channels.iter().position(|c| states(c, said));
        let mut stated: Vec<(usize, &str)> =
            self.sentences.iter().filter_map(|s| Some((rank(s)?, s.as_str()))).collect();
        stated.sort_by_key(|(rank, _)| *rank);
        let mut sorted = stated.into_iter().map(|(_, said)| said);
        let next = |said: &String| rank(said).and_then(|_| sorted.next());
        let ordered: Vec<Option<&str>> = self.sentences.iter().map(next).collect();
        ordered.into_iter().zip(&self.sentences).map(|(o, s)| o.unwrap_or(s)).collect()
    }

    /// Removes the sentences on channels, for flights whose forces and moments cannot be trusted.
    pub(super) fn withhold_channels(&mut self) {
        let ModelResult { sentences, channels, .. } = self;
        sentences.retain(|said| !channels.iter().any(|c| states(c, said)));
    }
}

/// Whether the sentence `said` is on the channel `c`.
fn states(c: &ChannelResult, said: &str) -> bool {
    let plain = |text: &str| text.trim_end_matches('.').to_lowercase();
    plain(&c.worst_regime) == plain(said)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::result::Map;

    fn channel(channel: ChannelId, unexplained_fraction: f64) -> ChannelResult {
        ChannelResult {
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
            worst_regime: format!("{} is off", channel.name()),
            abstained: None,
            regime: None,
            bins: Vec::new(),
            map: Map { alpha_deg: Vec::new(), beta_deg: Vec::new(), cells: Vec::new() },
        }
    }

    #[test]
    fn channels_and_their_sentences_begin_with_the_worst() {
        let shares = [
            (ChannelId::Lift, 0.1),
            (ChannelId::Roll, f64::NAN),
            (ChannelId::Pitch, 0.7),
            (ChannelId::Alpha, 3.0),
        ];
        let said = ["The model diverges.", "Lift is off.", "Pitching moment is off.", "More."];
        let model = ModelResult {
            name: "m".into(),
            sentences: said.map(str::to_owned).into(),
            free_run: Vec::new(),
            known: None,
            growth: Vec::new(),
            channels: shares.map(|(id, share)| channel(id, share)).into(),
            traces: Vec::new(),
        };
        let order: Vec<ChannelId> = model.worst_first().iter().map(|c| c.channel).collect();
        use ChannelId::{Alpha, Lift, Pitch, Roll};
        // the rate of the angle of attack repeats the lift
        assert_eq!(order, [Pitch, Lift, Roll, Alpha]);
        let sorted = [said[0], said[2], said[1], said[3]];
        assert_eq!(model.sentences_worst_first(), sorted);
    }
}

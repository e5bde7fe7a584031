//! Refuses effects (physical contributions to forces and moments) that the search has selected, mainly because too much of the
//! residual remains in their channels. A refused effect is reported but not asserted. A channel is a force or a moment.

use super::found::{Found, Selected};
use crate::compare::ChannelId;
use greylag_physics::inputs::{Acts, Kind};

/// Largest fraction of the residual that an effect may leave in its channels.
const LEFT: f64 = 0.3;
/// Largest fraction that products of states may explain of what these products and the effects explain together. With correct
/// effects, the fraction is below 0.02. An exception is `unsteady_lift`, whose formula differs from that of the simulator.
const SHAPELESS: f64 = 0.1;
/// The same limit for second derivatives of the deflections. It applies to effects that change the deflections.
const BENT: f64 = 0.02;

impl Found {
    /// Refuses effects that leave too much of the residual in their own channels. Three parts of it are checked: the part that a
    /// flexible model (a regression without physics) could remove, the part beyond noise, and the part that products of states or
    /// second derivatives of the deflections explain.
    pub(super) fn judge_remainder(&mut self) {
        let (before, after) = (&self.first_remainder, &self.remainder);
        let real = |s: &&Selected| s.refused.is_empty() && !s.absorbs_prior_error;
        let taken: Vec<(&'static str, [f64; 6])> =
            self.selected.iter().filter(real).map(|s| (s.id, s.taken)).collect();
        let assertable =
            self.selected.iter_mut().filter(|s| s.refused.is_empty() && !s.absorbs_prior_error);
        for effect in assertable {
            let own = |of: &[f64; 6]| effect.channels.iter().map(|c| of[*c]).sum::<f64>();
            let significant =
                effect.channels.iter().any(|c| after.removable[*c] > after.threshold[*c]);
            let least = own(&after.removable);
            let share = least / own(&before.removable).max(least + effect.score.fall).max(1.0);
            if significant && share > LEFT {
                effect.refused.push(format!(
                    "with it, a flexible model could still remove {:.0} % of what it could without",
                    100.0 * share
                ));
            }
            let beyond = self.beyond.as_ref();
            let left = beyond.and_then(|b| b.share(&effect.channels, effect.score.fall));
            if let Some(share) = left.filter(|share| *share > LEFT) {
                effect.refused.push(format!(
                    "with it, {:.0} % of what its channels have beyond noise is still there",
                    100.0 * share
                ));
            }
            let Some(shape) = &self.shape else { continue };
            // several effects may explain the residual of the same channel, so their reductions are added
            let others = taken.iter().filter(|(id, _)| *id != effect.id);
            let others: f64 =
                others.map(|(_, of)| effect.channels.iter().map(|c| of[*c]).sum::<f64>()).sum();
            let beside = shape.beside(&effect.channels, effect.score.fall + others.max(0.0));
            if let Some((share, term)) = beside.filter(|(share, _)| *share > SHAPELESS) {
                effect.refused.push(format!(
                    "with it, products of the states, {term} above all, still explain {:.0} % of what is \
                     missing: its formula has another shape",
                    100.0 * share
                ));
            }
            let bends = shape.bends_beside(effect.score.fall);
            let on_surfaces =
                Kind::from_id(effect.id).is_some_and(|k| k.acts() != Acts::OnThrottle);
            if on_surfaces && bends > BENT {
                effect.refused.push(format!(
                    "lack of fit: with it, second derivatives of the surfaces still explain {:.1} % of what is \
                     missing, so what acts on them takes another course in time",
                    100.0 * bends
                ));
            }
        }
        self.refuse_companions();
    }

    /// Refuses every effect that acts in one of `channels`, with the reason `reason`. The effect with the id `except` is spared.
    pub fn refuse_in(&mut self, channels: &[ChannelId], except: &str, reason: &str) {
        let touched = |c: &usize| channels.contains(&ChannelId::ALL[*c]);
        let spared = |s: &&mut Selected| s.id != except && s.channels.iter().any(touched);
        for effect in self.selected.iter_mut().filter(spared) {
            effect.refused.push(reason.to_owned());
        }
        self.refuse_companions();
    }

    /// Refuses an effect if the model can be assessed in none of its channels. For each channel, `abstained` has the reason why
    /// the flights do not suffice to assess the model in it; `None` if they do.
    pub fn refuse_where_abstained(&mut self, abstained: &[Option<String>; 6]) {
        for effect in self.selected.iter_mut().filter(|s| s.refused.is_empty()) {
            let whys: Option<Vec<&String>> =
                effect.channels.iter().map(|c| abstained[*c].as_ref()).collect();
            if let Some(why) = whys.and_then(|whys| whys.first().map(|why| (*why).clone())) {
                effect.refused.push(format!("these flights cannot judge its channels: {why}"));
            }
        }
    }

    /// Refuses all selected effects with the reason `reason`.
    pub fn refuse_all(&mut self, reason: &str) {
        self.selected.iter_mut().for_each(|effect| effect.refused.push(reason.to_owned()));
    }

    /// Refuses the selected effects with an id in `ids`, with the reason `reason`.
    pub fn refuse(&mut self, ids: &[String], reason: &str) {
        for effect in self.selected.iter_mut().filter(|s| ids.iter().any(|id| id == s.id)) {
            effect.refused.push(reason.to_owned());
        }
    }

    /// Refuses the effects that were selected after the first refused effect, because that effect was in the model when they were
    /// found. Effects that are significant but too small to be asserted do not count as refused here.
    fn refuse_companions(&mut self) {
        let refused = |s: &Selected| !s.refused.is_empty() && s.trace.is_none();
        let Some(first) = self.selected.iter().position(refused) else { return };
        let (refused, later) = self.selected.split_at_mut(first + 1);
        for effect in later.iter_mut().filter(|s| s.refused.is_empty()) {
            effect.refused.push(format!(
                "it was found together with {}, which is refused",
                refused[first].id
            ));
        }
    }
}

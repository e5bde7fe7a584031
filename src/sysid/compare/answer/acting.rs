//! Channels (forces, moments or rates) in which added effects act: those in which the effects reduce the unexplained share most.

use serde::Serialize;

use crate::compare::unexplained::Shares;
use crate::weak_form::channels::ChannelId;
use greylag_physics::Channel;
use greylag_physics::catalogue::describe;

/// A second channel is named beside the first if the effects reduce its unexplained share by at least this fraction of the first
/// reduction.
const NAMED_TOO: f64 = 0.3;
/// Number of channels that are forces and moments, the first of [`ChannelId::ALL`].
const LOADS: usize = 6;

/// Method by which the coefficients of the models were fitted. The two methods leave different shares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Regression of forces and moments.
    EquationError,
    /// Fit of free runs (simulations from recorded states).
    OutputError,
}

impl Method {
    /// Name in sentences.
    pub const fn name(self) -> &'static str {
        match self {
            Method::EquationError => "equation error",
            Method::OutputError => "output error",
        }
    }
}

/// Unexplained shares of the models before and after effects were added, on the same flights.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// Shares of the model as given; `None` if they are unknown.
    pub given: Option<Shares>,
    /// Shares of the given model with its coefficients fitted and without the effects; `None` if they are unknown.
    pub tuned: Option<Shares>,
    /// Shares of the fitted model with the effects.
    pub after: Shares,
    /// Method of the fits.
    pub method: Method,
}

/// A channel in which added effects act. The fractions are of the channel's variance, without that of sensor noise; 0 if the model
/// explains all of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Acting {
    /// Identifier of the channel.
    pub channel: ChannelId,
    /// Name of the channel, [`ChannelId::name`].
    pub name: &'static str,
    /// Unexplained fraction of the model as given; `None` if it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<f64>,
    /// Unexplained fraction of the model with fitted coefficients and without the effects; `None` if it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tuned: Option<f64>,
    /// Unexplained fraction of the fitted model with the effects.
    pub after: f64,
}

/// The one or two channels in which `effects` reduce the unexplained share most, among the channels in which they act. For effects
/// that act on deflections, all forces and moments are compared. The reduction is that from the tuned model, or from the given
/// model if the tuned one is unknown. Empty without effects, or if they reduce no share.
pub fn acting(effects: &[&str], shares: &Compared) -> Vec<Acting> {
    if effects.is_empty() {
        return Vec::new();
    }
    let Some(before) = shares.tuned.or(shares.given) else { return Vec::new() };
    let place = |id: ChannelId| ChannelId::ALL.iter().position(|other| *other == id);
    let fall = |id: &ChannelId| {
        let k = place(*id)?;
        let fall = before[k] - shares.after[k];
        // a NaN is no reduction
        (fall > 0.0).then_some((k, fall))
    };
    let falls = |ids: &[ChannelId]| {
        let mut falls: Vec<(usize, f64)> = ids.iter().filter_map(fall).collect();
        falls.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        falls.dedup_by_key(|(k, _)| *k);
        let least = falls.first().map_or(0.0, |(_, most)| NAMED_TOO * most);
        falls.retain(|(_, fall)| *fall >= least);
        falls.truncate(2);
        (!falls.is_empty()).then_some(falls)
    };
    let (loads, rates) = ChannelId::ALL.split_at(LOADS);
    let found = falls(&acted_on(effects)).or_else(|| falls(loads)).or_else(|| falls(rates));
    let known = |all: Option<Shares>, k: usize| all.map(|all| all[k]).filter(|x| x.is_finite());
    let one = |(k, _): (usize, f64)| Acting {
        channel: ChannelId::ALL[k],
        name: ChannelId::ALL[k].name(),
        given: known(shares.given, k),
        tuned: known(shares.tuned, k),
        after: shares.after[k],
    };
    found.unwrap_or_default().into_iter().map(one).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use ChannelId::{Alpha, Lift, Pitch, Roll};

    fn shares(of: &[(ChannelId, f64)]) -> Shares {
        ChannelId::ALL.map(|id| of.iter().find(|(x, _)| *x == id).map_or(f64::NAN, |(_, s)| *s))
    }

    fn channels(effects: &[&str], compared: &Compared) -> Vec<ChannelId> {
        acting(effects, compared).iter().map(|a| a.channel).collect()
    }

    #[test]
    fn an_added_effect_acts_where_it_takes_most_away() {
        let compared = Compared {
            given: Some(shares(&[(Lift, 0.5), (Roll, 2.93), (Alpha, 9.0)])),
            tuned: Some(shares(&[(Lift, 0.02), (Roll, 0.38), (Alpha, 8.0)])),
            after: shares(&[(Lift, 0.02), (Roll, 0.0009), (Alpha, 0.0)]),
            method: Method::OutputError,
        };
        let found = acting(&["propwash"], &compared);
        let roll = Acting {
            channel: Roll,
            name: "rolling moment",
            given: Some(2.93),
            tuned: Some(0.38),
            after: 0.0009,
        };
        assert_eq!(found, [roll]);
        assert!(acting(&[], &compared).is_empty());
        // without the tuned model the catalogue says where the effect acts
        let untuned =
            Compared { tuned: None, after: shares(&[(Lift, 0.1), (Roll, 0.0)]), ..compared };
        assert_eq!(channels(&["lift_stall"], &untuned), [Lift]);
        let same = Compared { after: untuned.given.unwrap(), ..untuned };
        assert!(acting(&["lift_stall"], &same).is_empty());
    }

    #[test]
    fn a_second_channel_is_named_from_three_tenths_of_the_first_reduction_on() {
        let of = |pitch: f64| Compared {
            given: None,
            tuned: Some(shares(&[(Roll, 0.5), (Pitch, pitch)])),
            after: shares(&[(Roll, 0.0), (Pitch, 0.0)]),
            method: Method::EquationError,
        };
        // an effect on the deflections has no channels of its own in the catalogue
        assert_eq!(channels(&["actuator_lag"], &of(0.16)), [Roll, Pitch]);
        assert_eq!(channels(&["actuator_lag"], &of(0.14)), [Roll]);
    }
}

//! Orders the sentences about a model in the report, and warns if its predictions are poor.
//!
//! The predictions are free runs: simulations of the model with the recorded controls. A channel is a component of force or
//! moment, or the rate of a state. Its residual is the difference between measurement and model, averaged over windows.

use super::forecast::ForecastResult;
use super::result::{ChannelResult, HorizonScore};
use crate::weak_form::channels::ChannelId;
use crate::weak_form::windows::Series;

/// Sentences about a model. A warning about divergence comes first, then the worst force and the worst moment, then the other
/// channels.
///
/// Forces drive V, α, β; moments drive p, q, r. The rates of V, α and β contain the same information as the forces. The rates
/// are left out if the logs contain the forces.
pub fn sentences(free_run: &[HorizonScore], channels: &[ChannelResult]) -> Vec<String> {
    use ChannelId::{Drag, Lift, Pitch, Roll, Side, Yaw};
    let is_force = |c: &&ChannelResult| matches!(c.channel, Drag | Lift | Side);
    let is_moment = |c: &&ChannelResult| matches!(c.channel, Roll | Pitch | Yaw);
    let forces = channels.iter().any(|c| is_force(&c));
    let mut path: Vec<_> =
        channels.iter().filter(|c| !is_moment(c) && is_force(c) == forces).collect();
    let mut moments: Vec<_> = channels.iter().filter(is_moment).collect();
    let worst_first = |a: &&ChannelResult, b: &&ChannelResult| weight(b).total_cmp(&weight(a));
    path.sort_by(worst_first);
    moments.sort_by(worst_first);
    let (path_lead, path_rest) = path.split_at(path.len().min(1));
    let (moment_lead, moment_rest) = moments.split_at(moments.len().min(1));
    let (mut leading, mut rest) =
        ([path_lead, moment_lead].concat(), [path_rest, moment_rest].concat());
    leading.sort_by(worst_first);
    rest.sort_by(worst_first);
    let stated = leading.iter().chain(&rest).map(|c| capital(&c.worst_regime) + ".");
    diverges(free_run).into_iter().chain(stated).collect()
}

/// Rate of the state error that the systematic part of a channel's residual causes, 1/s. The systematic part consists of the
/// mean residual, and of the residual's dependence on one regime variable (flight condition). The variable is the one that
/// explains most of the residual's variance.
fn weight(channel: &ChannelResult) -> f64 {
    let share = channel.bins.iter().map(|b| b.explained).fold(0.0, f64::max);
    let weight = channel.offset_share + (1.0 - channel.offset_share) * share;
    channel.effect_per_s * weight.sqrt()
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |c| c.to_uppercase().chain(letters).collect())
}

/// A warning if more than half of the free runs have diverged at the shortest horizon.
fn diverges(scores: &[HorizonScore]) -> Option<String> {
    let first = scores.iter().min_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s))?;
    (first.divergence_rate > 0.5).then(|| {
        format!(
            "The model diverges at once: {} of {} free runs are lost within {} s, so its free-run errors are dominated by the divergence bound.",
            first.diverged, first.runs, first.horizon_s
        )
    })
}

/// A warning if a forecast without aerodynamics, not fitted to the flights, is better than the model at the longest horizon that a
/// run reaches.
pub fn beaten(free_run: &[HorizonScore], forecasts: &[ForecastResult]) -> Option<String> {
    let reached = free_run.iter().filter(|s| s.runs > 0 && s.rmse_scaled.is_finite());
    let score = reached.max_by(|a, b| a.horizon_s.total_cmp(&b.horizon_s))?;
    let horizon = score.horizon_s;
    let at = |f: &ForecastResult| {
        let there = f.free_run.iter().find(|s| s.horizon_s == horizon)?;
        (there.rmse_scaled < score.rmse_scaled).then_some((there.rmse_scaled, f.name))
    };
    let references = forecasts.iter().filter(|f| f.is_reference());
    let (error, name) = references.filter_map(at).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "A forecast without aerodynamics is better than the model {horizon} s ahead: \u{201c}{name}\u{201d} errs by {error:.3} \
         of the reference scale, the model by {:.3}.",
        score.rmse_scaled
    ))
}

/// A warning if the model predicts NaN in some windows of `series`, for example from the square root of a negative angle.
/// These windows have no residual and do not enter the channels' results.
pub fn unpredicted(series: &[Vec<Series>]) -> Option<String> {
    let of = |channel: &ChannelId| {
        let own = series.iter().flatten().filter(|s| s.channel == *channel);
        let pairs = own.flat_map(|s| s.measured.iter().zip(&s.predicted));
        let measured: Vec<_> = pairs.filter(|(measured, _)| measured.is_finite()).collect();
        let lost = measured.iter().filter(|(_, predicted)| !predicted.is_finite()).count();
        (lost > 0).then(|| format!("{} {lost} of {}", channel.name(), measured.len()))
    };
    let all: Vec<String> = ChannelId::ALL.iter().filter_map(of).collect();
    (!all.is_empty()).then(|| {
        format!(
            "The model predicts no number in some windows, which are left out of the channels: {}.",
            all.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_without_a_prediction_are_counted() {
        let series = |predicted: [f64; 3]| {
            let measured = vec![1.0, 2.0, f64::NAN];
            let channel = ChannelId::Lift;
            Series { channel, measured, predicted: predicted.to_vec(), noise_variance: 0.0 }
        };
        assert_eq!(unpredicted(&[vec![series([1.0, 2.0, f64::NAN])]]), None);
        let said = unpredicted(&[vec![series([1.0, f64::NAN, f64::NAN])]]).unwrap();
        assert!(said.ends_with("left out of the channels: lift 1 of 2."), "{said}");
    }

    #[test]
    fn the_longest_horizon_decides_in_any_order_of_horizons() {
        let at = HorizonScore::of_three;
        let forecast =
            ForecastResult { name: "hold the state", free_run: vec![at(10.0, 0.1), at(1.0, 0.02)] };
        let said = beaten(&[at(10.0, 0.2), at(1.0, 0.01)], &[forecast]).unwrap();
        assert!(said.contains("10 s ahead"), "{said}");
    }
}

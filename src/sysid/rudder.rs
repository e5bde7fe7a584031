//! Detection of a rudder that moves in the flights but is not part of the model.

use crate::compare::ChannelId;
use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::rudder::RudderMotion;
use greylag_model::{GreyBox, RUDDER};
use greylag_physics::airframe::Yaw;

/// Channels (forces and moments) on which a rudder acts. Its deflection and the resulting sideslip also cause drag.
pub const CHANNELS: [ChannelId; 4] =
    [ChannelId::Drag, ChannelId::Side, ChannelId::Roll, ChannelId::Yaw];

/// Returns the largest rudder motion in `flights`; `None` if no rudder moves or `model` has a rudder effect.
///
/// A rudder command does not count if the airframe states that the aircraft has no rudder, because firmware sends rudder
/// commands even then.
pub fn unmodelled(flights: &[Reconstruction], model: &GreyBox) -> Option<RudderMotion> {
    if model.has(RUDDER) {
        return None;
    }
    let moves = |motion: &RudderMotion| match motion {
        RudderMotion::Command(_) => {
            model.airframe.yaw == Yaw::Unstated || model.airframe.actuators.rudder.is_some()
        }
        RudderMotion::Deflection(_) => true,
    };
    let all = flights.iter().filter_map(|f| f.rudder).filter(moves);
    all.max_by(|a, b| a.size().total_cmp(&b.size()))
}

/// Text of a warning for the rudder motion `motion`: the residuals contain the rudder's forces and moments.
pub fn warning(motion: RudderMotion) -> String {
    format!(
        "{motion} and the model has no rudder effect: yaw, roll, side-force and drag residuals include \
         its moments and forces; give the model rudder_linear, or say in the airframe file that the aircraft \
         has no rudder (schema 2 without [controls.rudder])."
    )
}

/// Text that states why no effect is asserted in [`CHANNELS`]: a rudder moves by `motion`, and the model has no rudder
/// effect.
pub fn reason(motion: RudderMotion) -> String {
    let motion = motion.to_string();
    format!("t{}, and the model has no rudder effect for its channels", &motion[1..])
}

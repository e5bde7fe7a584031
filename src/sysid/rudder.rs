//! A rudder that moves in the flights and that the model does not have.

use crate::compare::ChannelId;
use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::rudder::RudderMotion;
use greylag_model::{GreyBox, RUDDER};
use greylag_physics::airframe::Yaw;

/// The channels into which a rudder's forces and moments go: it turns the aircraft to the side, and
/// its deflection with the sideslip that follows costs drag.
pub const CHANNELS: [ChannelId; 4] =
    [ChannelId::Drag, ChannelId::Side, ChannelId::Roll, ChannelId::Yaw];

/// The largest movement of a rudder in `flights` that `model` has no effect for.
///
/// A command that moves no rudder, as firmware sends one to aircraft without it, is none.
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

/// What is to be said first of residuals that hold a rudder's forces and moments.
pub fn warning(motion: RudderMotion) -> String {
    format!(
        "{motion} and the model has no rudder effect: yaw, roll, side-force and drag residuals include \
         its moments and forces; give the model rudder_linear, or say in the airframe file that the aircraft \
         has no rudder (schema 2 without [controls.rudder])."
    )
}

/// Why an effect is not asserted while such a rudder moves.
pub fn reason(motion: RudderMotion) -> String {
    let motion = motion.to_string();
    format!("t{}, and the model has no rudder effect for its channels", &motion[1..])
}

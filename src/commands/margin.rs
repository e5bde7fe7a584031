//! Delay margin of a controller, for flights through a flight controller's channels.

use std::time::Duration;

use anyhow::Result;

use crate::control::{ControllerKind, Pace, build};
use crate::flight::delay_margin;
use crate::model::GreyBox;

/// The delay margin of `kind` on `model`: the smallest delay at which its loop oscillates. For planners and policies it
/// is the delay margin of the LQI, which is their fallback. A planner takes too long to simulate, and a policy has no
/// loop design. `None` if the LQI cannot be designed, or the loop is stable up to the largest delay simulated.
///
/// # Errors
/// If the controller cannot be built.
pub fn of(kind: ControllerKind, model: &GreyBox) -> Result<Option<Duration>> {
    let designed = matches!(
        kind,
        ControllerKind::Lqi
            | ControllerKind::LqiDamped
            | ControllerKind::Pid
            | ControllerKind::PidRetuned
    );
    let kind = if designed && kind.pace() != Pace::Planned { kind } else { ControllerKind::Lqi };
    match build(kind, model) {
        Ok(controller) => Ok(delay_margin(controller.as_ref(), model)),
        // Without an LQI, the substitute was reported already, and its delay margin is unknown.
        Err(_) if !designed => Ok(None),
        Err(why) => Err(why.into()),
    }
}

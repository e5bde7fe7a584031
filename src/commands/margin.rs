//! Delay margin of a controller, for flights through a flight controller's channels.

use std::time::Duration;

use anyhow::Result;

use crate::control::{ControllerKind, Pace, build};
use crate::flight::delay_margin;
use crate::model::{GreyBox, TrimError};

/// The delay margin of `kind` on `model`: the smallest delay at which its loop oscillates. For planners and policies it
/// is the delay margin of the LQI, which is their fallback. A planner takes too long to simulate, and a policy has no
/// loop design. `None` if the LQI cannot be designed, if the loop is stable up to the largest delay simulated, or if the
/// model has no trim, which is reported on standard error.
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
        Ok(controller) => Ok(or_unknown(delay_margin(controller.as_ref(), model))),
        // If there is no LQI, its substitute was reported already, and the delay margin is unknown.
        Err(_) if !designed => Ok(None),
        Err(why) => Err(why.into()),
    }
}

/// The delay margin that a search found. If there was no trim to search from, the margin is unknown, with a line on
/// standard error.
fn or_unknown(found: Result<Option<Duration>, TrimError>) -> Option<Duration> {
    found.unwrap_or_else(|why| {
        eprintln!("greylag: the delay margin is unknown, so delays are not checked: {why}");
        None
    })
}

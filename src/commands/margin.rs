//! Delay margin of a controller, for flights in which a flight controller passes the commands to the surfaces.

use std::time::Duration;

use anyhow::Result;

use crate::control::{ControllerKind, Pace, build};
use crate::flight::delay_margin;
use crate::model::{GreyBox, TrimError};

/// The delay margin of `kind` on `model`: the smallest delay at which the pitch or roll loop oscillates. For a planner or a
/// policy it is the delay margin of the LQI, which is the fallback controller. A planner would take too long to simulate.
///
/// `None` if the LQI cannot be designed, if the loops are stable up to the largest simulated delay, or if the model cannot
/// be trimmed. The last case is reported on standard error.
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
        // Without an LQI the delay margin is unknown.
        Err(_) if !designed => Ok(None),
        Err(why) => Err(why.into()),
    }
}

/// Returns the delay margin that was found. If the model could not be trimmed, the margin is unknown: prints a line on
/// standard error and returns `None`.
fn or_unknown(found: Result<Option<Duration>, TrimError>) -> Option<Duration> {
    found.unwrap_or_else(|why| {
        eprintln!("greylag: the delay margin is unknown, so delays are not checked: {why}");
        None
    })
}

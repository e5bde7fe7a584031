//! Why a pilot gives the aircraft back to its controller.

use super::real::profile::Stack;

/// An axis of the aircraft that a surface turns it about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// By the aileron.
    Roll,
    /// By the elevator.
    Pitch,
}

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// There is no state to fly on.
    State,
    /// A failsafe is in force.
    Lost,
    /// The aircraft turns against its surface.
    Reversed(Axis),
    /// The aircraft does not turn with its surface.
    Unanswered(Axis),
    /// How it turns with its surfaces could not be determined.
    SignsUnknown,
    /// The loop swings about this axis by itself, its surface at its limits.
    Oscillation(Axis),
}

impl Fault {
    /// The line for the ground stations, with the remedy at a controller of `stack`.
    pub fn words(self, stack: Stack) -> String {
        match self {
            Fault::State => "the state of the vehicle cannot be flown on".into(),
            Fault::Lost => "the client's setpoints, or the vehicle's state, were lost".into(),
            Fault::Reversed(axis) => {
                let what = match axis {
                    Axis::Roll => "it rolls left when the aileron is commanded right",
                    Axis::Pitch => "it pitches up when the elevator is commanded down",
                };
                format!(
                    "wrong sign: {what}; on the ground, in MANUAL, correct {}",
                    setting(axis, stack)
                )
            }
            Fault::Unanswered(axis) => {
                let (surface, other) = match axis {
                    Axis::Roll => ("aileron", "pitch"),
                    Axis::Pitch => ("elevator", "roll"),
                };
                format!(
                    "it does not answer to the {surface}: check servo, wire, mixer (one elevon \
                     reversed makes {other} of it)"
                )
            }
            Fault::Oscillation(axis) => {
                let (axis, surface) = match axis {
                    Axis::Roll => ("roll", "aileron"),
                    Axis::Pitch => ("pitch", "elevator"),
                };
                format!(
                    "it oscillates in {axis}, the {surface} at its limits: the delay is more than \
                     its controller bears; fly --controller lqi-damped, or attitudes{}",
                    faster(stack)
                )
            }
            Fault::SignsUnknown => format!(
                "the surfaces' signs could not be determined: engage in level flight; in calm air the answer comes too late or too \
                 weak: see the delays of `greylag link check`{}",
                faster(stack)
            ),
        }
    }
}

/// What shortens the delay at a controller of `stack`.
fn faster(stack: Stack) -> &'static str {
    match stack {
        Stack::Ardupilot => "; raise SCHED_LOOP_RATE and INS_GYRO_FILTER",
        Stack::Px4 => "",
    }
}

/// What can reverse an axis between a stick and its surface.
fn setting(axis: Axis, stack: Stack) -> &'static str {
    match (stack, axis) {
        (Stack::Ardupilot, Axis::Roll) => "RC1_REVERSED or SERVOn_REVERSED",
        (Stack::Ardupilot, Axis::Pitch) => "RC2_REVERSED or SERVOn_REVERSED",
        (Stack::Px4, Axis::Roll) => "CA_SV_CSn_TRQ_R or PWM_MAIN_REV",
        (Stack::Px4, Axis::Pitch) => "CA_SV_CSn_TRQ_P or PWM_MAIN_REV",
    }
}

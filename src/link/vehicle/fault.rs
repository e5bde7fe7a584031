//! Faults after which the companion (Greylag's autopilot) returns control authority to the flight controller.

use super::real::profile::Stack;

/// A body axis with the surface that controls it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// Roll, controlled by the aileron.
    Roll,
    /// Pitch, controlled by the elevator.
    Pitch,
}

/// A fault after which control authority is returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The state of the aircraft is not usable for control.
    State,
    /// A failsafe is active: the setpoints of the client (a ground station or an offboard program) or the vehicle's state were
    /// lost.
    Lost,
    /// The aircraft's response to the surface has the opposite sign to that of the model.
    Reversed(Axis),
    /// The aircraft does not respond to the surface.
    Unanswered(Axis),
    /// It could not be determined in which direction the surfaces act.
    SignsUnknown,
    /// A limit cycle of the control loop about this axis.
    Oscillation(Axis),
}

impl Fault {
    /// The text for the ground stations, with the remedy for a flight controller of `stack`.
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
                    "no response to the {surface}: check servo, wire, mixer (one reversed elevon \
                     turns it into {other})"
                )
            }
            Fault::Oscillation(axis) => {
                let (axis, surface) = match axis {
                    Axis::Roll => ("roll", "aileron"),
                    Axis::Pitch => ("pitch", "elevator"),
                };
                format!(
                    "it oscillates in {axis}, the {surface} at its limits: the delay exceeds \
                     the margin of its controller; fly --controller lqi-damped, or attitudes{}",
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

/// Settings of `stack` that reduce the delay, as text.
fn faster(stack: Stack) -> &'static str {
    match stack {
        Stack::Ardupilot => "; raise SCHED_LOOP_RATE and INS_GYRO_FILTER",
        Stack::Px4 => "",
    }
}

/// Settings of `stack` that can reverse an axis.
fn setting(axis: Axis, stack: Stack) -> &'static str {
    match (stack, axis) {
        (Stack::Ardupilot, Axis::Roll) => "RC1_REVERSED or SERVOn_REVERSED",
        (Stack::Ardupilot, Axis::Pitch) => "RC2_REVERSED or SERVOn_REVERSED",
        (Stack::Px4, Axis::Roll) => "CA_SV_CSn_TRQ_R or PWM_MAIN_REV",
        (Stack::Px4, Axis::Pitch) => "CA_SV_CSn_TRQ_P or PWM_MAIN_REV",
    }
}

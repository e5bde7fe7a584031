//! Options of the failsafe form with their texts: counterparts, controllers, faults, requests.
//!
//! The form flies the companion (Greylag's autopilot) in simulation under faults. A counterpart is the vehicle at the other end
//! of its link: the simulator, PX4 or ArduPilot.

use greylag_control::{ControllerKind, Pace};
use greylag_sim::faults::{Asking, Counterpart, FaultKind};

/// Form value for no fault or no request.
pub(super) const NOTHING: &str = "none";
/// Form value for the request in which the client arms and requests OFFBOARD again.
pub(super) const AGAIN: &str = "again";
/// Requests of the client: form value and displayed text.
pub(super) const REQUESTS: [(&str, &str); 7] = [
    (NOTHING, "Nothing"),
    (AGAIN, "Client arms, then OFFBOARD, again"),
    ("offboard", "Client asks for OFFBOARD"),
    ("hold", "Client asks for HOLD"),
    ("arm", "Client asks to arm"),
    ("disarm", "Client asks to disarm"),
    ("take-over", "Ground station takes the aircraft"),
];
/// Turbulence: severity curve of MIL-F-8785C and displayed text.
pub(super) const TURBULENCE: [(&str, &str); 4] =
    [("0", "none"), ("3", "light"), ("4", "moderate"), ("6", "severe")];

/// Controllers that compute a command within one control step. A flight with a planner takes seconds of computation; `greylag
/// faults` offers it.
pub(super) fn controllers() -> impl Iterator<Item = ControllerKind> {
    ControllerKind::ALL.iter().copied().filter(|kind| kind.pace() == Pace::Immediate)
}

/// Displayed name of a counterpart.
pub(super) fn counterpart(counterpart: Counterpart) -> &'static str {
    match counterpart {
        Counterpart::Sitl => "Simulator",
        Counterpart::Px4 => "PX4 by surfaces",
        Counterpart::Px4Attitude => "PX4 by attitude",
        Counterpart::Ardupilot => "ArduPilot by channels",
        Counterpart::ArdupilotAttitude => "ArduPilot by attitude",
    }
}

/// Faults in the form, in their order of display: the most common ones first.
pub(super) const FAULTS: [FaultKind; 18] = [
    FaultKind::Unplug,
    FaultKind::Corruption,
    FaultKind::Loss,
    FaultKind::Delay,
    FaultKind::Reordering,
    FaultKind::Duplication,
    FaultKind::Truncation,
    FaultKind::Flood,
    FaultKind::Client,
    FaultKind::Killed,
    FaultKind::Starvation,
    FaultKind::Frozen,
    FaultKind::Airspeed,
    FaultKind::Alpha,
    FaultKind::NotANumber,
    FaultKind::Clock,
    FaultKind::Reboot,
    FaultKind::Disk,
];

/// Displayed name of a fault, and the text on its effect over the range of strengths from 0 to 100 %.
pub(super) fn fault(kind: FaultKind) -> (&'static str, &'static str) {
    match kind {
        FaultKind::Unplug => ("Link cut", "Nothing passes between companion and vehicle."),
        FaultKind::Corruption => {
            ("Corrupted frames", "Bits are flipped in 10 to 90 % of the datagrams, both ways.")
        }
        FaultKind::Loss => ("Lost frames", "5 to 65 % of the datagrams are lost, both ways."),
        FaultKind::Delay => ("Delay spikes", "2 to 12 % of the datagrams come 20 to 350 ms late."),
        FaultKind::Reordering => {
            ("Reordered frames", "10 to 50 % of the datagrams come 10 to 50 ms late.")
        }
        FaultKind::Duplication => ("Duplicated frames", "10 to 90 % of the datagrams come twice."),
        FaultKind::Truncation => ("Truncated frames", "10 to 70 % of the datagrams are cut off."),
        FaultKind::Flood => ("Flood", "Ten pieces of garbage come with each datagram."),
        FaultKind::Client => ("Client dies", "No setpoint comes."),
        FaultKind::Killed => {
            ("Companion killed", "It is killed, and starts anew when the time is over.")
        }
        FaultKind::Starvation => (
            "Companion gets no processor",
            "After 5 to 35 % of its ticks it stands still for 20 to 300 ms.",
        ),
        FaultKind::Frozen => ("Frozen sensors", "The vehicle sends what it sent before."),
        FaultKind::Airspeed => {
            ("Blocked airspeed", "The airspeed stays at 0.4 to 1.4 times the cruise airspeed.")
        }
        FaultKind::Alpha => ("Angle of attack jumps", "By −14 to 14 degrees; 50 % is none."),
        FaultKind::NotANumber => ("Pitch rate is no number", "The vehicle sends NaN."),
        FaultKind::Clock => {
            ("Clock jumps", "The vehicle's clock goes forward by up to 10 s, and stays there.")
        }
        FaultKind::Reboot => {
            ("Vehicle's link restarts", "It is silent, then its clock begins at zero.")
        }
        FaultKind::Disk => ("Disk full", "Recording ends; the flight must not."),
    }
}

/// Text of a request in the list of events.
pub(super) fn request(asking: Asking) -> &'static str {
    match asking {
        Asking::Offboard => "client asks for OFFBOARD",
        Asking::Hold => "client asks for HOLD",
        Asking::Disarm => "client asks to disarm",
        Asking::Arm => "client asks to arm",
        Asking::TakeOver => "ground station takes the aircraft",
    }
}

/// Name of a fault in a scenario file.
pub(super) fn file_name(kind: FaultKind) -> String {
    let value = serde_json::to_value(kind).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}

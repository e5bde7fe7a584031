//! Calls of the pilot, the part of the companion that selects each command, as lines of the file `flight.calls`. Together
//! with the recorded messages of the vehicle they are all inputs of the pilot. A flight can therefore be replayed.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use crate::pilot::mode_name;
use greylag_link::autopilot::{AttitudeSetpoint, Mode, ParameterValue, Sticks};
use greylag_physics::{Command, Time};

/// The first line of the file.
pub const HEADER: &str = "greylag-calls 1";

/// Recorded reply to a planning request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Planned {
    /// A command arrived in time.
    Ready(Command),
    /// No command arrived in time.
    Late,
    /// The planner was busy with an earlier request and did not receive this one.
    Busy,
    /// There was no request, or no planner.
    None,
}

/// One call of the pilot. Its numbers are written with enough digits to be read back without any change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Call {
    /// Vehicle time was advanced to this time.
    Advance(Time),
    /// The program had stalled for this time, which does not count for the pilot's timeouts.
    Excuse(Duration),
    /// The state of this vehicle time was received. The other fields are the planner's reply and the resulting command.
    Tick(Time, Planned, Command),
    /// Arming was requested at this vehicle time. The flag is set for forced arming.
    Arm(Time, bool),
    /// Disarming was requested at this vehicle time. The flag is set for forced disarming.
    Disarm(Time, bool),
    /// The flight controller gave control authority to the companion at this vehicle time.
    Engaged(Time),
    /// A mode was requested at this vehicle time.
    Mode(Time, Mode),
    /// An attitude setpoint was received at this vehicle time.
    Setpoint(Time, AttitudeSetpoint),
    /// Stick positions were received at this vehicle time.
    Sticks(Time, Sticks),
    /// The parameter with this index was set to this value.
    Parameter(usize, ParameterValue),
}

/// The modes that can be requested.
const MODES: [Mode; 5] = [Mode::Manual, Mode::Hold, Mode::Return, Mode::Offboard, Mode::Stabilized];

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = |time: &Time| time.as_micros();
        match self {
            Call::Advance(now) => write!(f, "advance {}", us(now)),
            Call::Excuse(missed) => write!(f, "excuse {}", missed.as_micros()),
            Call::Tick(time, planned, c) => {
                write!(f, "tick {} {}", us(time), Words(c))?;
                match planned {
                    Planned::Ready(p) if same(p, c) => write!(f, " ready"),
                    Planned::Ready(p) => write!(f, " ready {}", Words(p)),
                    Planned::Late => write!(f, " late"),
                    Planned::Busy => write!(f, " busy"),
                    Planned::None => write!(f, " none"),
                }
            }
            Call::Arm(now, force) => write!(f, "arm {} {}", us(now), u8::from(*force)),
            Call::Disarm(now, force) => write!(f, "disarm {} {}", us(now), u8::from(*force)),
            Call::Engaged(now) => write!(f, "engaged {}", us(now)),
            Call::Mode(now, mode) => write!(f, "mode {} {}", us(now), mode_name(*mode)),
            Call::Setpoint(now, s) => {
                let thrust = s.thrust.map_or("-".to_owned(), |x| x.to_string());
                write!(f, "setpoint {} {} {} {thrust}", us(now), s.roll, s.pitch)
            }
            Call::Sticks(now, s) => {
                write!(f, "sticks {} {} {} {}", us(now), s.roll, s.pitch, s.throttle)
            }
            Call::Parameter(index, ParameterValue::Real(x)) => {
                write!(f, "parameter {index} real {x}")
            }
            Call::Parameter(index, ParameterValue::Int(n)) => {
                write!(f, "parameter {index} int {n}")
            }
        }
    }
}

/// A command as text: aileron, elevator, throttle, and the rudder unless it is +0.
struct Words<'a>(&'a Command);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Command { aileron, elevator, throttle, rudder } = self.0;
        write!(f, "{aileron} {elevator} {throttle}")?;
        if rudder.to_bits() == 0.0_f64.to_bits() { Ok(()) } else { write!(f, " {rudder}") }
    }
}

/// Whether two commands are equal bit by bit. +0 and −0 differ.
pub fn same(a: &Command, b: &Command) -> bool {
    let bits = |c: &Command| [c.aileron, c.elevator, c.throttle, c.rudder].map(f64::to_bits);
    bits(a) == bits(b)
}

/// Error for a line that is not a valid call.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no call of the pilot; the file is damaged, or of a newer program")]
pub struct CallError(String);

impl FromStr for Call {
    type Err = CallError;

    fn from_str(line: &str) -> Result<Self, CallError> {
        read(line).ok_or_else(|| CallError(line.chars().take(80).collect()))
    }
}

/// The parameter value of a line that begins with `parameter`; `None` if it is invalid.
fn parameter(words: &[&str]) -> Option<ParameterValue> {
    match *words.get(2)? {
        "real" => Some(ParameterValue::Real(words.get(3)?.parse().ok()?)),
        "int" => Some(ParameterValue::Int(words.get(3)?.parse().ok()?)),
        _ => None,
    }
}

fn read(line: &str) -> Option<Call> {
    let words: Vec<&str> = line.split(' ').collect();
    let number = |at: usize| words.get(at)?.parse::<f64>().ok();
    let time = |at: usize| Some(Time::from_micros(words.get(at)?.parse().ok()?));
    let flag = |at: usize| match *words.get(at)? {
        "0" => Some(false),
        "1" => Some(true),
        _ => None,
    };
    let command = |at: usize| {
        let rudder = number(at + 3);
        let [aileron, elevator, throttle] = [number(at)?, number(at + 1)?, number(at + 2)?];
        let command = Command { aileron, elevator, throttle, rudder: rudder.unwrap_or(0.0) };
        Some((command, at + if rudder.is_some() { 4 } else { 3 }))
    };
    Some(match *words.first()? {
        "advance" => Call::Advance(time(1)?),
        "excuse" => Call::Excuse(Duration::from_micros(words.get(1)?.parse().ok()?)),
        "tick" => {
            let (given, next) = command(2)?;
            let planned = match *words.get(next)? {
                "ready" if words.len() > next + 1 => Planned::Ready(command(next + 1)?.0),
                "ready" => Planned::Ready(given),
                "late" => Planned::Late,
                "busy" => Planned::Busy,
                "none" => Planned::None,
                _ => return None,
            };
            Call::Tick(time(1)?, planned, given)
        }
        "arm" => Call::Arm(time(1)?, flag(2)?),
        "disarm" => Call::Disarm(time(1)?, flag(2)?),
        "engaged" => Call::Engaged(time(1)?),
        "mode" => {
            let name = *words.get(2)?;
            Call::Mode(time(1)?, MODES.into_iter().find(|mode| mode_name(*mode) == name)?)
        }
        "setpoint" => {
            let thrust = match *words.get(4)? {
                "-" => None,
                _ => Some(number(4)?),
            };
            Call::Setpoint(
                time(1)?,
                AttitudeSetpoint { roll: number(2)?, pitch: number(3)?, thrust },
            )
        }
        "sticks" => {
            let sticks = Sticks { roll: number(2)?, pitch: number(3)?, throttle: number(4)? };
            Call::Sticks(time(1)?, sticks)
        }
        "parameter" => Call::Parameter(words.get(1)?.parse().ok()?, parameter(&words)?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_call_reads_back_to_the_bit() {
        let now = Time::from_micros(123_456_789);
        let odd =
            Command { aileron: 0.1 + 0.2, elevator: -1.0 / 3.0, throttle: 5e-324, rudder: 0.0 };
        let yawing = Command { rudder: -0.1, ..odd };
        let setpoint = AttitudeSetpoint { roll: 0.3, pitch: -0.0, thrust: None };
        for call in [
            Call::Advance(now),
            Call::Excuse(Duration::from_micros(1_190_001)),
            Call::Tick(now, Planned::Ready(odd), odd),
            Call::Tick(now, Planned::Ready(Command::IDLE), odd),
            Call::Tick(now, Planned::Ready(yawing), yawing),
            Call::Tick(now, Planned::Ready(yawing), odd),
            Call::Tick(now, Planned::Ready(odd), yawing),
            Call::Tick(now, Planned::Late, odd),
            Call::Tick(now, Planned::Busy, odd),
            Call::Tick(now, Planned::None, Command::IDLE),
            Call::Arm(now, true),
            Call::Disarm(now, false),
            Call::Engaged(now),
            Call::Mode(now, Mode::Offboard),
            Call::Setpoint(now, setpoint),
            Call::Setpoint(now, AttitudeSetpoint { thrust: Some(0.7), ..setpoint }),
            Call::Sticks(now, Sticks { roll: 0.1, pitch: 0.2, throttle: 0.3 }),
            Call::Parameter(3, ParameterValue::Real(0.1)),
            Call::Parameter(12, ParameterValue::Int(-1)),
        ] {
            let line = call.to_string();
            assert_eq!(line.parse::<Call>().unwrap(), call, "{line}");
            assert_eq!(line.parse::<Call>().unwrap().to_string(), line);
        }
        for bad in ["", "tick 1", "arm 1 2", "mode 1 SIDEWAYS", "advance -1", "dance 1"] {
            assert!(bad.parse::<Call>().is_err(), "{bad}");
        }
    }
}

//! Which of PX4's outputs moves what.

use std::fmt;
use std::str::FromStr;

use crate::plant::Inputs;
use crate::shim::codec::HilActuatorControls;

/// MAV_MODE_FLAG_SAFETY_ARMED.
const ARMED: u8 = 128;

/// Something that an output moves. As PX4 has it, a positive output lifts a trailing edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effector {
    /// Both ailerons on one channel; positive rolls right.
    Aileron,
    LeftAileron,
    RightAileron,
    /// Positive pitches up.
    Elevator,
    LeftElevon,
    RightElevon,
    /// 0 to 1.
    Throttle,
}

impl Effector {
    const ALL: [(&'static str, Effector); 7] = [
        ("aileron", Effector::Aileron),
        ("left-aileron", Effector::LeftAileron),
        ("right-aileron", Effector::RightAileron),
        ("elevator", Effector::Elevator),
        ("left-elevon", Effector::LeftElevon),
        ("right-elevon", Effector::RightElevon),
        ("throttle", Effector::Throttle),
    ];

    fn name(self) -> &'static str {
        Effector::ALL.iter().find(|(_, known)| *known == self).map_or("", |(name, _)| name)
    }

    /// What a positive output does to roll (right) and to pitch (up).
    fn acts(self) -> (f64, f64) {
        match self {
            Effector::Aileron | Effector::RightAileron => (1.0, 0.0),
            Effector::LeftAileron => (-1.0, 0.0),
            Effector::Elevator => (0.0, 1.0),
            Effector::LeftElevon => (-1.0, 1.0),
            Effector::RightElevon => (1.0, 1.0),
            Effector::Throttle => (0.0, 0.0),
        }
    }
}

/// One output: what it moves, its place in `controls`, its sign.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Output {
    effector: Effector,
    place: usize,
    sign: f64,
}

/// Which outputs move aileron, elevator and throttle.
///
/// Written as `left-aileron=6,right-aileron=7,elevator=8,throttle=5`: the number is that of
/// PX4's PWM_MAIN_FUNCn, 1 to 16, a minus before it reverses. These are the default, for so the
/// stock fixed-wing airframes have it (1030, 1033, 1036).
#[derive(Clone, Debug, PartialEq)]
pub struct OutputMap(Vec<Output>);

/// A map of outputs that cannot be flown by.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot read the outputs '{given}': {fault}; write them like left-aileron=6,right-aileron=7,elevator=8,throttle=5, with the numbers of PWM_MAIN_FUNCn (aileron, left-aileron, right-aileron, elevator, left-elevon, right-elevon, throttle; a minus reverses)"
)]
pub struct OutputMapError {
    given: String,
    fault: &'static str,
}

impl Default for OutputMap {
    fn default() -> Self {
        let output = |effector, place| Output { effector, place, sign: 1.0 };
        OutputMap(vec![
            output(Effector::LeftAileron, 5),
            output(Effector::RightAileron, 6),
            output(Effector::Elevator, 7),
            output(Effector::Throttle, 4),
        ])
    }
}

impl fmt::Display for OutputMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, Output { effector, place, sign }) in self.0.iter().enumerate() {
            let (comma, minus) = (if i > 0 { "," } else { "" }, if *sign < 0.0 { "-" } else { "" });
            write!(f, "{comma}{}={minus}{}", effector.name(), place + 1)?;
        }
        Ok(())
    }
}

impl FromStr for OutputMap {
    type Err = OutputMapError;

    fn from_str(given: &str) -> Result<Self, OutputMapError> {
        let fail = |fault| OutputMapError { given: given.to_owned(), fault };
        let mut outputs: Vec<Output> = Vec::new();
        for item in given.split(',') {
            let (name, number) = item.split_once('=').ok_or(fail("an item has no ="))?;
            let (_, effector) = Effector::ALL
                .into_iter()
                .find(|(known, _)| *known == name.trim())
                .ok_or(fail("nothing of that name can be moved"))?;
            let number = number.trim();
            let (sign, number) = match number.strip_prefix('-') {
                Some(rest) => (-1.0, rest),
                None => (1.0, number),
            };
            let number: usize = number.parse().map_err(|_| fail("an output is not a number"))?;
            if !(1..=16).contains(&number) {
                return Err(fail("outputs are numbered 1 to 16"));
            }
            if outputs.iter().any(|output| output.effector == effector) {
                return Err(fail("something is moved by two outputs"));
            }
            outputs.push(Output { effector, place: number - 1, sign });
        }
        let moves = |wanted: fn(Effector) -> bool| outputs.iter().any(|o| wanted(o.effector));
        if !moves(|e| e.acts().0 != 0.0) || !moves(|e| e.acts().1 != 0.0) {
            return Err(fail("roll or pitch is moved by nothing"));
        }
        if !moves(|e| e == Effector::Throttle) {
            return Err(fail("the throttle is moved by nothing"));
        }
        Ok(OutputMap(outputs))
    }
}

/// What an actuator message asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    /// The controller's time, µs.
    pub time_us: u64,
    /// Whether the controller is in lockstep: bit 0 of the flags.
    pub lockstep: bool,
    /// Whether it is armed.
    pub armed: bool,
    /// Commands of the plant, zero when disarmed.
    pub inputs: Inputs,
    /// Whether a control lay outside its range and was limited.
    pub limited: bool,
}

impl OutputMap {
    /// Reads an actuator message; `None` when an output that is used is not a finite number.
    pub fn read(&self, message: &HilActuatorControls) -> Option<Actuation> {
        let (mut roll, mut pitch, mut throttle, mut limited) =
            (Mean::default(), Mean::default(), 0.0, false);
        for Output { effector, place, sign } in &self.0 {
            let control = f64::from(message.controls[*place]);
            if !control.is_finite() {
                return None;
            }
            let lowest = if *effector == Effector::Throttle { 0.0 } else { -1.0 };
            let within = (sign * control).clamp(lowest, 1.0);
            limited |= within != sign * control;
            let (rolls, pitches) = effector.acts();
            roll.take(rolls, within);
            pitch.take(pitches, within);
            if *effector == Effector::Throttle {
                throttle = within;
            }
        }
        let armed = message.mode & ARMED != 0;
        // The plant's elevator pitches down when positive.
        let actuation =
            Inputs { aileron: roll.value(), elevator: -pitch.value(), throttle, rudder: 0.0 };
        Some(Actuation {
            time_us: message.time_usec,
            lockstep: message.flags & 1 != 0,
            armed,
            inputs: if armed { actuation } else { Inputs::default() },
            limited,
        })
    }
}

/// The mean of what several outputs do: left and right elevon, say.
#[derive(Default)]
struct Mean {
    sum: f64,
    parts: f64,
}

impl Mean {
    fn take(&mut self, acts: f64, output: f64) {
        self.sum += acts * output;
        self.parts += acts.abs();
    }

    fn value(&self) -> f64 {
        self.sum / self.parts.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn actuation(map: &str, outputs: &[(usize, f32)], mode: u8) -> Option<Actuation> {
        let mut message = HilActuatorControls { mode, ..Default::default() };
        outputs.iter().for_each(|(number, value)| message.controls[number - 1] = *value);
        map.parse::<OutputMap>().unwrap().read(&message)
    }

    #[test]
    fn elevons_and_ailerons_mean_what_px4_allocates() {
        // Control allocation of a flying wing (torques ∓0.5 and 0.5): roll r and pitch p come as
        // left = p − r, right = p + r.
        let (roll, pitch) = (0.25, 0.5);
        let wing = actuation(
            "left-elevon=1,right-elevon=2,throttle=3",
            &[(1, pitch - roll), (2, pitch + roll), (3, 0.75)],
            129,
        );
        let inputs = Inputs { aileron: 0.25, elevator: -0.5, throttle: 0.75, rudder: 0.0 };
        assert_eq!(wing.unwrap().inputs, inputs);
        // Of a plane: left = −r, right = r, elevator = p; the default of the stock airframes.
        let plane = OutputMap::default().to_string();
        let plane = actuation(&plane, &[(6, -roll), (7, roll), (8, pitch), (5, 0.75)], 129);
        assert_eq!(plane.unwrap().inputs, inputs);
        // One channel, reversed.
        let single = actuation(
            "aileron=-1,elevator=2,throttle=3",
            &[(1, -roll), (2, pitch), (3, 0.75)],
            129,
        );
        assert_eq!(single.unwrap().inputs, inputs);
    }

    #[test]
    fn what_is_no_number_is_not_flown_and_what_is_too_large_is_limited() {
        let map = "aileron=1,elevator=2,throttle=3";
        assert_eq!(actuation(map, &[(2, f32::NAN)], 129), None);
        assert!(actuation(map, &[(4, f32::NAN)], 129).is_some(), "an output that moves nothing");
        let wild = actuation(map, &[(1, 1e30), (3, -4.0)], 129).unwrap();
        assert_eq!((wild.inputs.aileron, wild.inputs.throttle, wild.limited), (1.0, 0.0, true));
        assert_eq!(actuation(map, &[(1, 1.0), (3, 1.0)], 1).unwrap().inputs, Inputs::default());
    }

    #[test]
    fn reads_what_it_writes_and_refuses_what_cannot_fly() {
        let default = OutputMap::default();
        assert_eq!(default.to_string().parse(), Ok(default));
        for map in [
            "",
            "aileron",
            "aileron=1",
            "aileron=1,elevator=2",
            "aileron=1,elevator=17,throttle=3",
            "aileron=0,elevator=2,throttle=3",
            "aileron=1,aileron=4,elevator=2,throttle=3",
            "flap=1,elevator=2,throttle=3",
            "aileron=x,elevator=2,throttle=3",
        ] {
            let error = map.parse::<OutputMap>().expect_err(map).to_string();
            assert!(error.contains(&format!("'{map}'")) && !error.contains('\n'), "{error}");
        }
    }
}

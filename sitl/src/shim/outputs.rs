//! Assignment of a flight controller's outputs to the aircraft's controls.

use std::fmt;
use std::str::FromStr;

use crate::plant::Inputs;

/// A control surface or throttle that an output moves. As in PX4 and ArduPilot, a positive output moves a trailing edge up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Effector {
    /// Both ailerons on one channel; positive rolls right.
    Aileron,
    LeftAileron,
    RightAileron,
    /// Elevator; positive pitches up.
    Elevator,
    LeftElevon,
    RightElevon,
    /// Rudder; positive yaws right.
    Rudder,
    /// Throttle, 0 to 1.
    Throttle,
}

impl Effector {
    const ALL: [(&'static str, Effector); 8] = [
        ("aileron", Effector::Aileron),
        ("left-aileron", Effector::LeftAileron),
        ("right-aileron", Effector::RightAileron),
        ("elevator", Effector::Elevator),
        ("left-elevon", Effector::LeftElevon),
        ("right-elevon", Effector::RightElevon),
        ("rudder", Effector::Rudder),
        ("throttle", Effector::Throttle),
    ];

    fn name(self) -> &'static str {
        Effector::ALL.iter().find(|(_, known)| *known == self).map_or("", |(name, _)| name)
    }

    /// Effect of a positive output on roll (right wing down positive) and on pitch (nose up positive).
    fn acts(self) -> (f64, f64) {
        match self {
            Effector::Aileron | Effector::RightAileron => (1.0, 0.0),
            Effector::LeftAileron => (-1.0, 0.0),
            Effector::Elevator => (0.0, 1.0),
            Effector::LeftElevon => (-1.0, 1.0),
            Effector::RightElevon => (1.0, 1.0),
            Effector::Rudder | Effector::Throttle => (0.0, 0.0),
        }
    }
}

/// Largest output number: ArduPilot has 32 outputs, PX4's simulator interface 16.
const OUTPUTS: usize = 32;

/// One output: its effector, its index from 0, and its sign.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Output {
    effector: Effector,
    place: usize,
    sign: f64,
}

/// Assignment of outputs to aileron, elevator, rudder and throttle.
///
/// The written form is `left-aileron=6,right-aileron=7,elevator=8,throttle=5`. The number is that of PX4's PWM_MAIN_FUNCn or of
/// ArduPilot's SERVOn_FUNCTION, 1 to 32. A minus before the number reverses the output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputMap(Vec<Output>);

/// Error of parsing an assignment of outputs.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "cannot read the outputs '{given}': {fault}; write them like left-aileron=6,right-aileron=7,elevator=8,throttle=5, with the numbers of PX4's PWM_MAIN_FUNCn or of ArduPilot's SERVOn_FUNCTION (aileron, left-aileron, right-aileron, elevator, left-elevon, right-elevon, rudder, throttle; a minus reverses)"
)]
pub struct OutputMapError {
    given: String,
    fault: &'static str,
}

impl OutputMap {
    /// The outputs of PX4's stock fixed-wing airframes (1030, 1033, 1036).
    pub fn px4() -> Self {
        OutputMap(vec![
            Output::plain(Effector::LeftAileron, 6),
            Output::plain(Effector::RightAileron, 7),
            Output::plain(Effector::Elevator, 8),
            Output::plain(Effector::Throttle, 5),
        ])
    }

    /// The default outputs of ArduPlane (SERVO1_FUNCTION to SERVO4_FUNCTION: 4, 19, 70, 21).
    pub fn ardupilot() -> Self {
        OutputMap(vec![
            Output::plain(Effector::Aileron, 1),
            Output::plain(Effector::Elevator, 2),
            Output::plain(Effector::Throttle, 3),
            Output::plain(Effector::Rudder, 4),
        ])
    }
}

impl Output {
    fn plain(effector: Effector, number: usize) -> Self {
        Output { effector, place: number - 1, sign: 1.0 }
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
            if !(1..=OUTPUTS).contains(&number) {
                return Err(fail("outputs are numbered 1 to 32"));
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

/// Plant commands computed from all outputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mixed {
    /// Commands for the plant.
    pub inputs: Inputs,
    /// Whether an output was outside its range and was limited.
    pub limited: bool,
}

impl OutputMap {
    /// Mixes the outputs that `at` returns by index from 0: −1..1 for a surface, 0..1 with `Range::Throttle`. `None` if an
    /// assigned output is not finite.
    pub fn mix(&self, at: impl Fn(usize, Range) -> f64) -> Option<Mixed> {
        let (mut roll, mut pitch, mut mixed) = (Mean::default(), Mean::default(), Mixed::default());
        for Output { effector, place, sign } in &self.0 {
            let range = effector.range();
            let asked = sign * at(*place, range);
            if !asked.is_finite() {
                return None;
            }
            let within = asked.clamp(range.lowest(), 1.0);
            mixed.limited |= within != asked;
            let (rolls, pitches) = effector.acts();
            roll.take(rolls, within);
            pitch.take(pitches, within);
            match effector {
                Effector::Throttle => mixed.inputs.throttle = within,
                // a positive rudder of the plant yaws left
                Effector::Rudder => mixed.inputs.rudder = -within,
                _ => {}
            }
        }
        mixed.inputs.aileron = roll.value();
        // a positive elevator of the plant pitches down
        mixed.inputs.elevator = -pitch.value();
        Some(mixed)
    }

    /// The highest number of an assigned output.
    pub fn highest(&self) -> usize {
        self.0.iter().map(|output| output.place + 1).max().unwrap_or(0)
    }
}

/// The range of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// A surface's range, −1..1.
    Surface,
    /// The throttle's range, 0..1.
    Throttle,
}

impl Range {
    fn lowest(self) -> f64 {
        match self {
            Range::Surface => -1.0,
            Range::Throttle => 0.0,
        }
    }
}

impl Effector {
    fn range(self) -> Range {
        if self == Effector::Throttle { Range::Throttle } else { Range::Surface }
    }
}

/// Mean of the outputs that move one control, such as left and right elevon.
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

    fn mixed(map: &str, outputs: &[(usize, f64)]) -> Option<Mixed> {
        let value = |place: usize| outputs.iter().find(|(number, _)| number - 1 == place);
        map.parse::<OutputMap>().unwrap().mix(|place, _| value(place).map_or(0.0, |(_, v)| *v))
    }

    #[test]
    fn elevons_and_ailerons_mean_what_px4_allocates() {
        // Control allocation of a flying wing (torques ∓0.5 and 0.5): from roll r and pitch p, left = p − r and right = p + r.
        let (roll, pitch) = (0.25, 0.5);
        let wing = mixed(
            "left-elevon=1,right-elevon=2,throttle=3",
            &[(1, pitch - roll), (2, pitch + roll), (3, 0.75)],
        );
        let inputs = Inputs { aileron: 0.25, elevator: -0.5, throttle: 0.75, rudder: 0.0 };
        assert_eq!(wing.unwrap().inputs, inputs);
        // For a conventional aircraft: left = −r, right = r, elevator = p, as in the stock airframes.
        let plane = OutputMap::px4().to_string();
        let plane = mixed(&plane, &[(6, -roll), (7, roll), (8, pitch), (5, 0.75)]);
        assert_eq!(plane.unwrap().inputs, inputs);
        // Both ailerons on one reversed channel.
        let single =
            mixed("aileron=-1,elevator=2,throttle=3", &[(1, -roll), (2, pitch), (3, 0.75)]);
        assert_eq!(single.unwrap().inputs, inputs);
    }

    #[test]
    fn what_is_no_number_is_not_flown_and_what_is_too_large_is_limited() {
        let map = "aileron=1,elevator=2,throttle=3";
        assert_eq!(mixed(map, &[(2, f64::NAN)]), None);
        assert!(mixed(map, &[(4, f64::NAN)]).is_some(), "an output that moves nothing");
        let wild = mixed(map, &[(1, 1e30), (3, -4.0)]).unwrap();
        assert_eq!((wild.inputs.aileron, wild.inputs.throttle, wild.limited), (1.0, 0.0, true));
    }

    #[test]
    fn a_positive_rudder_yaws_right_which_is_the_plants_negative() {
        let rudder = mixed("aileron=1,elevator=2,throttle=3,rudder=4", &[(4, 0.5)]).unwrap();
        assert_eq!(rudder.inputs, Inputs { rudder: -0.5, ..Inputs::default() });
    }

    #[test]
    fn reads_what_it_writes_and_refuses_what_cannot_fly() {
        for map in [OutputMap::px4(), OutputMap::ardupilot()] {
            assert_eq!(map.to_string().parse(), Ok(map));
        }
        for map in [
            "",
            "aileron",
            "aileron=1",
            "aileron=1,elevator=2",
            "aileron=1,elevator=33,throttle=3",
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

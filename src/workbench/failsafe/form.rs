//! The form of the failsafe page, and the scenario that it describes. A scenario is a simulated flight with a fault and a client
//! that sends requests.

use serde::de::DeserializeOwned;
use serde_json::Value;

use super::choices::{AGAIN, NOTHING, REQUESTS, TURBULENCE, controllers};
use greylag_control::ControllerKind;
use greylag_sim::faults::{
    Asked, Asking, ControllerSetting, Counterpart, Fault, FaultKind, Leg, Scenario,
};

/// Duration of a flight, s.
pub(super) const FLIGHT_S: f64 = 60.0;
/// Start and end of the attitude that the form commands, s. Before and after it, level flight is commanded.
const ATTITUDE_S: [f64; 2] = [8.0, 45.0];
/// Pitch command in level flight, °.
const LEVEL_DEG: f64 = 3.0;
/// Time at which the client requests HOLD if the form selects that mode, s.
const HOLD_S: f64 = 8.0;
/// Time between arming and the request for OFFBOARD, s.
const AFTER_ARMING_S: f64 = 0.1;
/// Largest seed that the form accepts.
const SEED: u64 = 999_999;

/// Names of the fields with their default values. The default is a link interruption in a turn, after which the client requests
/// arming and OFFBOARD again.
pub(super) const FIELDS: [(&str, &str); 16] = [
    ("counterpart", "px4"),
    ("radio", "no"),
    ("controller", "lqi"),
    ("mode", "offboard"),
    ("fault", "unplug"),
    ("from_s", "15"),
    ("for_s", "3"),
    ("strength", "50"),
    ("request", AGAIN),
    ("at_s", "25"),
    ("roll_deg", "25"),
    ("pitch_deg", "5"),
    ("wind_mps", "0"),
    ("wind_from_deg", "270"),
    ("turbulence", "0"),
    ("seed", "1"),
];

/// A numeric field: its name, meaning, limits and unit.
pub(super) struct Number {
    pub field: &'static str,
    pub what: &'static str,
    pub limits: [f64; 2],
    pub unit: &'static str,
}

const fn number(
    field: &'static str,
    what: &'static str,
    limits: [f64; 2],
    unit: &'static str,
) -> Number {
    Number { field, what, limits, unit }
}

/// The numeric fields of the form.
pub(super) const NUMBERS: [Number; 9] = [
    number("from_s", "the fault's beginning", [1.0, 55.0], "s"),
    number("for_s", "the fault's length", [0.02, 40.0], "s"),
    number("strength", "the fault's strength", [0.0, 100.0], "%"),
    number("at_s", "the moment of the request", [1.0, 55.0], "s"),
    number("roll_deg", "the roll asked for", [-60.0, 60.0], "degrees"),
    number("pitch_deg", "the pitch asked for", [-20.0, 20.0], "degrees"),
    number("wind_mps", "the wind", [0.0, 12.0], "m/s"),
    number("wind_from_deg", "where the wind comes from", [0.0, 360.0], "degrees"),
    number("seed", "the seed", [0.0, SEED as f64], ""),
];

/// The values of the form's fields.
#[derive(Clone, Debug)]
pub(super) struct Form {
    values: Vec<(&'static str, String)>,
}

/// Error about an invalid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{why}")]
pub(super) struct Wrong {
    /// The invalid field; empty for an unknown field name.
    pub field: &'static str,
    /// Text of the error, with a remedy.
    pub why: String,
}

/// A scenario and the controller that flies it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chosen {
    pub scenario: Scenario,
    pub controller: ControllerKind,
}

impl Form {
    /// Makes a form from the values of a query, with defaults for the other fields. Also returns an error about the first
    /// unknown field name, if there is one.
    pub fn of(query: &[(String, String)]) -> (Form, Option<Wrong>) {
        let value = |(field, default): (&'static str, &str)| {
            let given = query.iter().rev().find(|(name, _)| name == field);
            (field, given.map_or(default.to_owned(), |(_, value)| value.trim().to_owned()))
        };
        let form = Form { values: FIELDS.map(value).to_vec() };
        let known = |name: &str| FIELDS.iter().any(|(field, _)| *field == name);
        let wrong = query.iter().find(|(name, _)| !known(name)).map(|(name, _)| {
            let names = FIELDS.map(|(field, _)| field).join(", ");
            Wrong { field: "", why: format!("there is no choice {name:?}; there are {names}") }
        });
        (form, wrong)
    }

    /// The value of a field as the user entered it.
    pub fn value(&self, field: &str) -> &str {
        self.values.iter().find(|(name, _)| *name == field).map_or("", |(_, value)| value)
    }

    /// Returns the scenario and the controller that the form describes.
    ///
    /// # Errors
    /// `Wrong` for the first invalid value.
    pub fn chosen(&self) -> Result<Chosen, Wrong> {
        let counterpart: Counterpart = self.named("counterpart", "flight controller")?;
        let controller = self.controller()?;
        let controller_parameters = self.radio(counterpart)?;
        let faults = self.fault()?.into_iter().collect();
        let asked = self.asked(counterpart)?;
        let legs = self.legs()?;
        let [speed, from] = [self.number("wind_mps")?, self.number("wind_from_deg")?];
        let seed = self.number("seed")?;
        if seed.fract() != 0.0 {
            return Err(self.wrong("seed", "is no whole number"));
        }
        let scenario = Scenario {
            wind_ned_mps: wind(speed, from),
            turbulence: self.turbulence()?,
            faults,
            legs,
            asked,
            controller_parameters,
            ..Scenario::of_seed(counterpart, seed as u64)
        };
        Ok(Chosen { scenario, controller })
    }

    fn controller(&self) -> Result<ControllerKind, Wrong> {
        let name = self.value("controller");
        let names = || controllers().map(ControllerKind::name).collect::<Vec<_>>().join(", ");
        controllers().find(|kind| kind.name() == name).ok_or_else(|| {
            self.wrong(
                "controller",
                &format!("is no controller of this page; choose one of {}", names()),
            )
        })
    }

    /// Parameter by which the simulated flight controller has a bound radio; empty without a radio.
    fn radio(&self, counterpart: Counterpart) -> Result<Vec<ControllerSetting>, Wrong> {
        match (self.value("radio"), counterpart.stack()) {
            ("no", _) => Ok(Vec::new()),
            ("yes", Some("ArduPilot")) => Ok(vec![bound_radio()]),
            ("yes", _) => {
                Err(self.wrong("radio", "is for ArduPilot: only that is simulated with a radio"))
            }
            _ => Err(self.wrong("radio", "is no choice; choose yes or no")),
        }
    }

    fn turbulence(&self) -> Result<u8, Wrong> {
        let chosen = self.value("turbulence");
        let known = TURBULENCE.iter().find(|(value, _)| *value == chosen);
        known
            .and_then(|(value, _)| value.parse().ok())
            .ok_or_else(|| self.wrong("turbulence", "is no turbulence; choose 0, 3, 4 or 6"))
    }

    fn fault(&self) -> Result<Option<Fault>, Wrong> {
        if self.value("fault") == NOTHING {
            return Ok(None);
        }
        let kind: FaultKind = self.named("fault", "fault")?;
        let from_s = self.number("from_s")?;
        let length = if kind.has_length() { self.number("for_s")? } else { FLIGHT_S - from_s };
        let strength = if kind.has_strength() { self.number("strength")? / 100.0 } else { 0.5 };
        // a clock jump has no duration
        let length = if kind == FaultKind::Clock { 0.01 } else { length };
        let to_s = (from_s + length).min(FLIGHT_S);
        Ok(Some(Fault { kind, from_s, to_s, strength }))
    }

    fn asked(&self, counterpart: Counterpart) -> Result<Vec<Asked>, Wrong> {
        let mut asked = match self.value("mode") {
            "offboard" => Vec::new(),
            "hold" => vec![Asked { at_s: HOLD_S, what: Asking::Hold }],
            _ => return Err(self.wrong("mode", "is no mode; choose offboard or hold")),
        };
        let request = self.value("request");
        if request == NOTHING {
            return Ok(asked);
        }
        if !REQUESTS.iter().any(|(value, _)| *value == request) {
            return Err(self.wrong("request", "is no request of this page"));
        }
        let at_s = self.number("at_s")?;
        if request == AGAIN {
            asked.push(Asked { at_s, what: Asking::Arm });
            asked.push(Asked { at_s: at_s + AFTER_ARMING_S, what: Asking::Offboard });
            return Ok(asked);
        }
        let what: Asking = self.named("request", "request")?;
        if what == Asking::TakeOver && counterpart.stack().is_none() {
            let why = "needs a flight controller to take; choose PX4 or ArduPilot";
            return Err(self.wrong("request", why));
        }
        asked.push(Asked { at_s, what });
        Ok(asked)
    }

    /// Legs of the flight: level flight, the attitude of the form, level flight.
    fn legs(&self) -> Result<Vec<Leg>, Wrong> {
        let [roll_deg, pitch_deg] = [self.number("roll_deg")?, self.number("pitch_deg")?];
        let leg = |from_s, roll_deg, pitch_deg| Leg { from_s, roll_deg, pitch_deg };
        let [from, to] = ATTITUDE_S;
        Ok(vec![leg(0.0, 0.0, LEVEL_DEG), leg(from, roll_deg, pitch_deg), leg(to, 0.0, LEVEL_DEG)])
    }

    /// Converts the value of a field to the type `T`, in which it must be a name.
    fn named<T: DeserializeOwned>(&self, field: &'static str, what: &str) -> Result<T, Wrong> {
        let value = Value::String(self.value(field).to_owned());
        serde_json::from_value(value).map_err(|e| {
            let names = e.to_string();
            let names = names.split_once("expected one of ").map_or("", |(_, names)| names);
            self.wrong(field, &format!("is no {what}; choose one of {names}"))
        })
    }

    fn number(&self, field: &'static str) -> Result<f64, Wrong> {
        let known = NUMBERS.iter().find(|n| n.field == field);
        let Some(Number { what, limits: [least, most], unit, .. }) = known else {
            return Err(self.wrong(field, "is no number of this page"));
        };
        let value = self.value(field).parse::<f64>().ok();
        value.filter(|x| (*least..=*most).contains(x)).ok_or_else(|| Wrong {
            field,
            why: format!(
                "{what} cannot be {:?}: give a number from {least} to {most} {unit}",
                self.value(field)
            )
            .trim_end()
            .to_owned(),
        })
    }

    fn wrong(&self, field: &'static str, why: &str) -> Wrong {
        Wrong { field, why: format!("{:?} {why}", self.value(field)) }
    }
}

/// ArduPilot parameter for a bound radio whose sticks are released.
fn bound_radio() -> ControllerSetting {
    ControllerSetting { name: "SIM_RC_FAIL".into(), value: 0.0 }
}

/// Wind vector (north-east-down, m/s) for a wind of `speed_mps` (m/s) from the direction `from_deg` (° from north).
fn wind(speed_mps: f64, from_deg: f64) -> [f64; 3] {
    let (sin, cos) = from_deg.to_radians().sin_cos();
    // rounded to 1 mm/s, without −0, which would appear in the file
    [-speed_mps * cos, -speed_mps * sin, 0.0].map(|v| (v * 1e3).round() / 1e3 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(pairs: &[(&str, &str)]) -> Result<Chosen, Wrong> {
        let query: Vec<_> = pairs.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        let (form, wrong) = Form::of(&query);
        wrong.map_or_else(|| form.chosen(), Err)
    }

    #[test]
    fn the_page_begins_with_a_link_that_is_cut_in_a_turn() {
        let Chosen { scenario, controller } = chosen(&[]).unwrap();
        assert_eq!(controller, ControllerKind::Lqi);
        let cut = Fault { kind: FaultKind::Unplug, from_s: 15.0, to_s: 18.0, strength: 0.5 };
        let leg = |from_s, roll_deg, pitch_deg| Leg { from_s, roll_deg, pitch_deg };
        let asked = |at_s, what| Asked { at_s, what };
        let expected = Scenario {
            counterpart: Counterpart::Px4,
            seed: 1,
            wind_ned_mps: [0.0; 3],
            turbulence: 0,
            faults: vec![cut],
            legs: vec![leg(0.0, 0.0, 3.0), leg(8.0, 25.0, 5.0), leg(45.0, 0.0, 3.0)],
            asked: vec![asked(25.0, Asking::Arm), asked(25.1, Asking::Offboard)],
            parameters: Vec::new(),
            controller_parameters: Vec::new(),
        };
        assert_eq!(scenario, expected);
        let file = serde_json::to_string(&scenario).unwrap();
        assert_eq!(serde_json::from_str::<Scenario>(&file).unwrap(), expected);
    }

    #[test]
    fn each_choice_is_in_the_scenario() {
        let all = [
            ("counterpart", "ardupilot"),
            ("radio", "yes"),
            ("controller", "pid-retuned"),
            ("mode", "hold"),
            ("fault", "corruption"),
            ("from_s", "20.5"),
            ("for_s", " 2 "),
            ("strength", "80"),
            ("request", "disarm"),
            ("at_s", "30"),
            ("roll_deg", "-10"),
            ("pitch_deg", "-2"),
            ("wind_mps", "5"),
            ("wind_from_deg", "270"),
            ("turbulence", "4"),
            ("seed", "77"),
        ];
        assert_eq!(all.map(|(name, _)| name), FIELDS.map(|(name, _)| name));
        let Chosen { scenario, controller } = chosen(&all).unwrap();
        assert_eq!(
            (controller.name(), scenario.counterpart),
            ("pid-retuned", Counterpart::Ardupilot)
        );
        assert_eq!((scenario.turbulence, scenario.seed), (4, 77));
        assert_eq!(scenario.controller_parameters, [bound_radio()]);
        // a wind from 270° blows towards the east
        assert_eq!(scenario.wind_ned_mps, [0.0, 5.0, 0.0]);
        assert_eq!((scenario.legs[1].roll_deg, scenario.legs[1].pitch_deg), (-10.0, -2.0));
        let Fault { kind, from_s, to_s, strength } = scenario.faults[0];
        assert_eq!((kind, from_s, to_s, strength), (FaultKind::Corruption, 20.5, 22.5, 0.8));
        let asked: Vec<_> = scenario.asked.iter().map(|a| (a.at_s, a.what)).collect();
        assert_eq!(asked, [(HOLD_S, Asking::Hold), (30.0, Asking::Disarm)]);
    }

    #[test]
    fn every_fault_and_request_of_the_page_is_a_scenario() {
        use crate::failsafe::choices::{FAULTS, file_name};
        for kind in FAULTS {
            let scenario = chosen(&[("fault", &file_name(kind))]).unwrap().scenario;
            assert_eq!(scenario.faults[0].kind, kind);
            assert!(scenario.faults[0].to_s > scenario.faults[0].from_s, "{kind:?}");
        }
        for kind in FaultKind::DRAWN {
            assert!(FAULTS.contains(&kind), "{kind:?}");
        }
        assert_eq!(chosen(&[("fault", "none")]).unwrap().scenario.faults, []);
        for (request, _) in REQUESTS {
            assert!(chosen(&[("request", request)]).is_ok(), "{request}");
        }
    }

    #[test]
    fn an_invalid_choice_is_refused_with_a_remedy() {
        for (field, value, why) in [
            (
                "from_s",
                "soon",
                "the fault's beginning cannot be \"soon\": give a number from 1 to 55 s",
            ),
            ("from_s", "NaN", "from 1 to 55 s"),
            ("for_s", "-1", "from 0.02 to 40 s"),
            ("seed", "1.5", "is no whole number"),
            ("seed", "1e9", "from 0 to 999999"),
            ("fault", "meteor", "choose one of `loss`"),
            ("counterpart", "inav", "choose one of `sitl`"),
            ("controller", "hybrid", "choose one of pid,"),
            ("mode", "return", "choose offboard or hold"),
            ("request", "land", "is no request"),
            ("radio", "yes", "only that is simulated with a radio"),
            ("turbulence", "9", "choose 0, 3, 4 or 6"),
        ] {
            let wrong = chosen(&[(field, value)]).unwrap_err();
            assert!(wrong.field == field && wrong.why.contains(why), "{field}: {wrong}");
        }
        // a link interruption has no strength, but frame loss has one
        let wrong = chosen(&[("fault", "loss"), ("strength", "101")]).unwrap_err();
        assert!(wrong.why.contains("from 0 to 100 %"), "{wrong}");
        let wrong = chosen(&[("colour", "red")]).unwrap_err();
        assert!(wrong.why.contains("no choice \"colour\"") && wrong.why.contains("counterpart"));
        // without a flight controller, a ground station cannot take over
        let station = [("counterpart", "sitl"), ("request", "take-over")];
        assert!(chosen(&station).unwrap_err().why.contains("choose PX4 or ArduPilot"));
        // unused fields are not checked
        assert!(chosen(&[("fault", "none"), ("from_s", "soon")]).is_ok());
    }
}

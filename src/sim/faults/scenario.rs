//! Conditions of a flight under faults: faults, requests, wind, turbulence and parameters.
//!
//! The companion is Greylag's autopilot. Its client commands attitudes. The shim is the simulator's own MAVLink interface.

use greylag_sitl::air::Turbulence;
use greylag_sitl::plant::PlantOptions;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::counterpart::Counterpart;
use super::mix::{FIRST_S, Fault, FaultKind, LAST_S, draw, one};
use greylag_link::autopilot::Mode;

/// Largest number of faults, and of requests, in a random scenario.
const MOST: usize = 4;
/// Largest horizontal wind component in a random scenario, m/s. `TURBULENCE` is its largest turbulence curve of MIL-F-8785C.
const WIND_MPS: f64 = 8.0;
const TURBULENCE: u8 = 4;

/// An attitude that the client commands from a given time on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// Start of the leg, s.
    pub from_s: f64,
    /// Commanded roll, degrees.
    pub roll_deg: f64,
    /// Commanded pitch, degrees.
    pub pitch_deg: f64,
}

/// A request of a client or a ground station.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// Time of the request, s.
    pub at_s: f64,
    /// The kind of request.
    pub what: Asking,
}

/// Kinds of requests from clients and ground stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Asking {
    /// The client requests OFFBOARD.
    Offboard,
    /// The client requests HOLD.
    Hold,
    /// The client requests disarming, which is refused in flight.
    Disarm,
    /// The client requests arming.
    Arm,
    /// A ground station sets the flight controller's loiter mode. The shim ignores the request, because it has no modes.
    TakeOver,
}

impl Asking {
    const ALL: [Asking; 5] =
        [Asking::Offboard, Asking::Hold, Asking::Disarm, Asking::Arm, Asking::TakeOver];
}

/// A parameter of the companion that differs from its default, set before the flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// Name of the parameter, for example `GL_LOAD_MAX`.
    pub name: String,
    /// Value of the parameter as a multiple of its default.
    pub times: f64,
}

/// The parameters that are varied, with the smallest and largest multiple of the default. The limits of the envelope are only
/// narrowed, because the companion guarantees nothing for a wider envelope.
const SETTINGS: [(&str, [f64; 2]); 9] = [
    ("GL_OFFB_LOSS_S", [0.3, 3.0]),
    ("GL_VEH_LOSS_S", [0.3, 3.0]),
    ("GL_BANK_MAX_DEG", [0.4, 1.0]),
    ("GL_PITCH_MAX_DEG", [0.4, 1.0]),
    ("GL_PITCH_MIN_DEG", [0.4, 1.0]),
    ("GL_CRUISE_MPS", [0.8, 1.4]),
    ("GL_LOAD_MAX", [0.7, 1.0]),
    ("GL_SLEW_SURF", [0.3, 2.0]),
    ("GL_SLEW_THR", [0.2, 4.0]),
];

/// A parameter of the flight controller that differs from the simulated default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControllerSetting {
    /// Name of the parameter in PX4 or ArduPilot.
    pub name: String,
    /// Value of the parameter in the stack's unit.
    pub value: f64,
}

/// Values of flight-controller parameters.
type Values = [(&'static str, &'static [f64])];

/// PX4 parameters that are varied, with their values. Some values are suitable, some are not, and some are PX4's defaults. The
/// companion must refuse values with which it cannot fly safely.
const PX4_SETTINGS: &Values = &[
    ("COM_RC_IN_MODE", &[0.0, 1.0, 2.0, 3.0, 4.0]),
    ("COM_RC_LOSS_T", &[0.1, 0.5, 1.0, 5.0]),
    ("NAV_RCL_ACT", &[0.0, 1.0, 2.0, 3.0]),
    ("COM_OF_LOSS_T", &[0.1, 0.5, 1.0, 5.0]),
    ("COM_OBL_RC_ACT", &[0.0, 3.0, 5.0]),
    ("FW_MAN_R_SC", &[0.5, 1.0]),
    ("FW_MAN_P_SC", &[0.5, 1.0]),
    ("TRIM_ROLL", &[-0.1, 0.0, 0.1]),
    ("TRIM_PITCH", &[-0.1, 0.0, 0.1]),
    ("PWM_MAIN_REV", &[0.0, 1.0, 2.0, 3.0]),
    ("IMU_GYRO_CUTOFF", &[5.0, 20.0, 40.0, 80.0]),
];

/// ArduPilot parameters that are varied, with their values.
const ARDUPILOT_SETTINGS: &Values = &[
    ("SERVO1_REVERSED", &[0.0, 1.0]),
    ("SERVO2_REVERSED", &[0.0, 1.0]),
    ("MAV_GCS_SYSID", &[1.0, 255.0]),
    ("SCHED_LOOP_RATE", &[50.0, 100.0, 200.0, 400.0]),
    ("RC_OVERRIDE_TIME", &[0.1, 0.5, 3.0]),
    ("GUIDED_TIMEOUT", &[0.2, 1.0, 3.0]),
    ("THR_FAILSAFE", &[0.0, 1.0]),
    ("FS_SHORT_ACTN", &[0.0, 1.0, 2.0, 3.0]),
    ("FS_LONG_ACTN", &[0.0, 1.0, 2.0]),
    ("RC_FS_TIMEOUT", &[0.5, 1.0, 5.0]),
    ("SIM_RC_FAIL", &[0.0, 1.0]),
    ("INS_GYRO_FILTER", &[0.0, 5.0, 20.0, 50.0]),
    ("SIM_SERVO_DELAY", &[0.0, 20.0, 60.0]),
    ("RC1_REVERSED", &[0.0, 1.0]),
    ("RC2_REVERSED", &[0.0, 1.0]),
    ("RC1_TRIM", &[1400.0, 1500.0, 1600.0]),
    ("RC2_TRIM", &[1400.0, 1500.0, 1600.0]),
];

/// Conditions of a flight of 60 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// The vehicle at the other end of the companion's link.
    pub counterpart: Counterpart,
    /// Seed of the random numbers that are not part of the scenario, for instance those of link faults and turbulence.
    pub seed: u64,
    /// Steady wind, the velocity of the air over the ground, north-east-down, m/s.
    pub wind_ned_mps: [f64; 3],
    /// Turbulence: a probability-of-exceedance curve of MIL-F-8785C, 1 to 7; 0 for none.
    pub turbulence: u8,
    /// The faults of the flight.
    pub faults: Vec<Fault>,
    /// Attitudes commanded by the client, in order of time.
    pub legs: Vec<Leg>,
    /// Other requests, in order of time.
    pub asked: Vec<Asked>,
    /// Parameters of the companion that differ from their defaults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<Setting>,
    /// Parameters of the flight controller that differ from the simulated defaults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub controller_parameters: Vec<ControllerSetting>,
}

/// Default legs of the client: start (s), roll and pitch (degrees). They are turns to both sides, a climb and a descent.
const LEGS: [(f64, f64, f64); 6] = [
    (0.0, 0.0, 3.0),
    (12.0, 35.0, 5.0),
    (20.0, -40.0, 3.0),
    (28.0, 10.0, 12.0),
    (36.0, 30.0, -3.0),
    (44.0, 0.0, 3.0),
];

impl Scenario {
    /// The flight of a seed in the fault campaign: random faults, still air, six legs, no other requests.
    pub fn of_seed(counterpart: Counterpart, seed: u64) -> Scenario {
        let leg = |(from_s, roll_deg, pitch_deg)| Leg { from_s, roll_deg, pitch_deg };
        Scenario {
            counterpart,
            seed,
            wind_ned_mps: [0.0; 3],
            turbulence: 0,
            faults: draw(seed),
            legs: LEGS.map(leg).to_vec(),
            asked: Vec::new(),
            parameters: Vec::new(),
            controller_parameters: Vec::new(),
        }
    }

    /// The flight of a random seed, changed four times by [`Scenario::varied`].
    pub fn drawn(counterpart: Counterpart, random: &mut impl Rng) -> Scenario {
        let mut scenario = Scenario::of_seed(counterpart, random.random_range(0..1_000_000));
        for _ in 0..4 {
            scenario = scenario.varied(random);
        }
        scenario
    }

    /// Checks a scenario from a file.
    ///
    /// # Errors
    /// If the legs are not in the order of time. The client flies the last leg of the list that has started. A leg that starts
    /// before the previous leg of the list would therefore never be flown.
    pub fn check(&self) -> Result<(), String> {
        match self.legs.windows(2).find(|pair| pair[1].from_s < pair[0].from_s) {
            Some([before, after]) => Err(format!(
                "the leg from {} s comes after the one from {} s; put the legs in the order of time",
                after.from_s, before.from_s
            )),
            _ => Ok(()),
        }
    }

    /// A copy with one random change. A change that does not apply, such as the removal of a request if there is none, leaves
    /// the copy equal.
    pub fn varied(&self, random: &mut impl Rng) -> Scenario {
        let mut changed = self.clone();
        match random.random_range(0..14) {
            12 => changed.controller_parameters.clear(),
            13 => changed.set_one_of_the_controllers(random),
            10 => changed.parameters.clear(),
            11 => {
                let (name, [least, most]) = SETTINGS[random.random_range(0..SETTINGS.len())];
                changed.parameters.retain(|setting| setting.name != name);
                let times = random.random_range(least..most);
                changed.parameters.push(Setting { name: name.into(), times });
            }
            0 => changed.seed = random.random_range(0..1_000_000),
            1 => {
                let [north, east] = [(); 2].map(|()| random.random_range(-WIND_MPS..WIND_MPS));
                changed.wind_ned_mps = [north, east, 0.0];
            }
            2 => changed.turbulence = random.random_range(0..=TURBULENCE),
            3 | 4 if changed.faults.len() < MOST => {
                let kind = FaultKind::DRAWN[random.random_range(0..FaultKind::DRAWN.len())];
                changed.faults.push(one(kind, random));
            }
            3 | 4 => _ = changed.faults.remove(random.random_range(0..MOST)),
            5 | 6 if !changed.faults.is_empty() => {
                let place = random.random_range(0..changed.faults.len());
                let fault = &mut changed.faults[place];
                let length = (fault.to_s - fault.from_s) * random.random_range(0.5..2.0);
                let moved = fault.from_s + random.random_range(-2.0..2.0);
                fault.from_s = moved.clamp(FIRST_S, LAST_S - 8.0);
                fault.to_s = fault.from_s + length.clamp(0.01, 8.0);
                fault.strength = (fault.strength + random.random_range(-0.3..0.3)).clamp(0.0, 1.0);
            }
            7 if changed.legs.len() > 1 => {
                // the last leg stays level, because the check at the end of the flight requires a level attitude
                let place = random.random_range(0..changed.legs.len() - 1);
                let leg = &mut changed.legs[place];
                leg.roll_deg = random.random_range(-60.0..60.0);
                leg.pitch_deg = random.random_range(-20.0..20.0);
            }
            8 if changed.asked.len() < MOST => {
                let what = Asking::ALL[random.random_range(0..Asking::ALL.len())];
                changed.asked.push(Asked { at_s: random.random_range(FIRST_S..LAST_S), what });
            }
            _ if !changed.asked.is_empty() => {
                let place = random.random_range(0..changed.asked.len());
                let moved = changed.asked[place].at_s + random.random_range(-2.0..2.0);
                changed.asked[place].at_s = moved.clamp(FIRST_S, LAST_S);
            }
            _ => {}
        }
        changed
    }

    fn set_one_of_the_controllers(&mut self, random: &mut impl Rng) {
        let settings = match self.counterpart {
            Counterpart::Sitl => return,
            Counterpart::Px4 | Counterpart::Px4Attitude => PX4_SETTINGS,
            Counterpart::Ardupilot | Counterpart::ArdupilotAttitude => ARDUPILOT_SETTINGS,
        };
        let (name, values) = settings[random.random_range(0..settings.len())];
        let value = values[random.random_range(0..values.len())];
        self.controller_parameters.retain(|setting| setting.name != name);
        self.controller_parameters.push(ControllerSetting { name: name.into(), value });
    }

    /// All scenarios that are simpler than this one by a single change. The change removes a fault, a request, a parameter,
    /// the wind or the turbulence, restores the default legs, or halves the duration of a fault.
    pub fn smaller(&self) -> Vec<Scenario> {
        let mut all = Vec::new();
        let mut with = |change: &dyn Fn(&mut Scenario)| {
            let mut changed = self.clone();
            change(&mut changed);
            if changed != *self {
                all.push(changed);
            }
        };
        for k in 0..self.faults.len() {
            with(&|s| _ = s.faults.remove(k));
        }
        for k in 0..self.asked.len() {
            with(&|s| _ = s.asked.remove(k));
        }
        for k in 0..self.parameters.len() {
            with(&|s| _ = s.parameters.remove(k));
        }
        for k in 0..self.controller_parameters.len() {
            with(&|s| _ = s.controller_parameters.remove(k));
        }
        with(&|s| s.wind_ned_mps = [0.0; 3]);
        with(&|s| s.turbulence = 0);
        let usual = Scenario::of_seed(self.counterpart, 0).legs;
        with(&|s| s.legs = usual.clone());
        for k in 0..self.faults.len() {
            with(&|s| {
                let fault = &mut s.faults[k];
                let half = 0.5 * (fault.to_s - fault.from_s);
                if half >= 0.05 {
                    fault.to_s = fault.from_s + half;
                }
            });
        }
        all
    }

    /// The simulated aircraft `plant` in the scenario's wind and turbulence.
    pub(super) fn air(&self, plant: &PlantOptions) -> PlantOptions {
        let mut plant = plant.clone();
        if self.wind_ned_mps != [0.0; 3] {
            plant.air.wind_ned_mps = self.wind_ned_mps;
        }
        if self.turbulence > 0 {
            // the wind at 20 ft has no effect at the altitude of these flights
            let turbulence = Turbulence { wind_20ft_mps: 7.6, severity: self.turbulence };
            plant.air.turbulence = Some(turbulence);
            plant.seed = self.seed as u32;
        }
        plant
    }
}

/// The mode that `asking` requests from the companion; `None` if it requests no mode.
pub(super) fn mode_of(asking: Asking) -> Option<Mode> {
    match asking {
        Asking::Offboard => Some(Mode::Offboard),
        Asking::Hold => Some(Mode::Hold),
        Asking::Disarm | Asking::Arm | Asking::TakeOver => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_out_of_order_are_refused() {
        let mut scenario = Scenario::of_seed(Counterpart::Sitl, 1);
        scenario.check().unwrap();
        scenario.legs.swap(1, 2);
        let why = scenario.check().unwrap_err();
        assert!(why.contains("the leg from 12 s comes after the one from 20 s"), "{why}");
    }
}

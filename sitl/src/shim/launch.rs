//! The aircraft on its stand, on the catapult, in flight.

use crate::plant::{Inputs, Plant, PlantError, PlantOptions, Start, Travel, Truth, to_body};
use crate::shim::options::Launch;

/// How long the catapult pulls, s: 1.7 g for 16.67 m/s, within 8.3 m.
const PULL_S: f64 = 1.0;
/// The catapult is released at this throttle; PX4 and ArduPlane idle below it before a take-off.
const LAUNCH_THROTTLE: f64 = 0.1;
/// Radius of the earth's equator, m, and its first eccentricity squared (WGS 84).
const EQUATOR_M: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;

/// Phase of the launch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Stand,
    /// Steps since the catapult was released.
    Catapult(u64),
    Flight,
}

/// A plant that begins on the ground, as an estimator needs it to align itself.
///
/// The catapult brings it along a straight line to the start that was asked for, with its
/// attitude, and lets JSBSim take over there: every quantity but acceleration is continuous.
pub struct Launcher {
    plant: Plant,
    start: Start,
    at_once: Launch,
    step_s: f64,
    phase: Phase,
    /// The start state in JSBSim.
    released: Truth,
    shown: Truth,
}

impl Launcher {
    /// The aircraft on its stand, or in flight if it is launched immediately.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded or cannot be flown from `start`.
    pub fn new(options: &PlantOptions, start: &Start, launch: Launch) -> Result<Self, PlantError> {
        let plant = Plant::new(options)?;
        let (released, step_s) = (Truth::default(), options.step_s);
        let phase = Phase::Stand;
        let mut launcher = Launcher {
            plant,
            start: *start,
            at_once: launch,
            step_s,
            phase,
            released,
            shown: released,
        };
        launcher.begin_anew()?;
        Ok(launcher)
    }

    /// Puts the aircraft back to its start.
    ///
    /// # Errors
    /// If it cannot be flown from its start.
    pub fn begin_anew(&mut self) -> Result<(), PlantError> {
        self.released = self.plant.reset(&self.start)?;
        self.phase = match self.at_once {
            Launch::Immediate => Phase::Flight,
            Launch::WhenArmed => Phase::Stand,
        };
        self.shown = self.state();
        Ok(())
    }

    /// Travel of the aircraft's surfaces.
    ///
    /// # Errors
    /// If a surface does not follow its command.
    pub fn travel(&mut self) -> Result<Travel, PlantError> {
        self.plant.travel()
    }

    /// Notes on the aircraft, one sentence each.
    pub fn notes(&self) -> Vec<String> {
        self.plant.notes()
    }

    /// Present state of the aircraft.
    pub fn truth(&self) -> Truth {
        self.shown
    }

    /// Whether JSBSim flies the aircraft.
    pub fn is_flying(&self) -> bool {
        self.phase == Phase::Flight
    }

    /// Releases the catapult if armed with open throttle; `true` in the call that releases it.
    pub fn let_go(&mut self, armed: bool, throttle: f64) -> bool {
        let wanted = self.phase == Phase::Stand && armed && throttle > LAUNCH_THROTTLE;
        if wanted {
            self.phase = Phase::Catapult(0);
        }
        wanted
    }

    /// Advances one step.
    ///
    /// # Errors
    /// If the plant cannot be stepped.
    pub fn advance(&mut self, inputs: Inputs) -> Result<Truth, PlantError> {
        self.phase = match self.phase {
            Phase::Stand => Phase::Stand,
            Phase::Catapult(steps) if (steps + 1) as f64 * self.step_s >= PULL_S => Phase::Flight,
            Phase::Catapult(steps) => Phase::Catapult(steps + 1),
            Phase::Flight => {
                self.shown = self.plant.step(inputs)?;
                return Ok(self.shown);
            }
        };
        self.shown = self.state();
        Ok(self.shown)
    }

    /// The state while JSBSim does not fly, or at the moment when it begins to.
    fn state(&self) -> Truth {
        match self.phase {
            Phase::Stand => self.pulled(0.0, 0.0),
            Phase::Catapult(steps) => self.pulled(steps as f64 * self.step_s / PULL_S, 1.0),
            Phase::Flight => self.released,
        }
    }

    /// The state at the fraction `share` of the final speed; `pull` is 1 on the catapult, 0 on the stand.
    fn pulled(&self, share: f64, pull: f64) -> Truth {
        let released = self.released;
        let velocity = released.velocity_ned_mps.map(|v| v * share);
        // Distance before the release: at constant acceleration half the speed times the time.
        let way = released.velocity_ned_mps.map(|v| 0.5 * v * PULL_S * (share * share - 1.0));
        let (north_m, east_m) = metres_per_degree(released.latitude_deg);
        let attitude = [released.roll_rad, released.pitch_rad, released.yaw_rad];
        let gravity = gravity_mps2(released.latitude_deg, released.altitude_m);
        let mut felt = released.velocity_ned_mps.map(|v| pull * v / PULL_S);
        felt[2] -= gravity;
        let air: [f64; 3] = std::array::from_fn(|i| velocity[i] - released.wind_ned_mps[i]);
        let [u, v, w] = to_body(attitude, air);
        let airspeed_mps = u.hypot(v).hypot(w);
        Truth {
            p_radps: 0.0,
            q_radps: 0.0,
            r_radps: 0.0,
            airspeed_mps,
            alpha_rad: w.atan2(u),
            beta_rad: if airspeed_mps > 0.0 { (v / airspeed_mps).asin() } else { 0.0 },
            specific_force_mps2: to_body(attitude, felt),
            velocity_ned_mps: velocity,
            latitude_deg: released.latitude_deg + way[0] / north_m,
            longitude_deg: released.longitude_deg + way[1] / east_m,
            altitude_m: released.altitude_m - way[2],
            thrust_n: 0.0,
            ..released
        }
    }
}

/// Metres per degree of latitude and of longitude on the WGS 84 ellipsoid.
pub(super) fn metres_per_degree(latitude_deg: f64) -> (f64, f64) {
    let (sin, cos) = latitude_deg.to_radians().sin_cos();
    let flat = 1.0 - ECCENTRICITY_2 * sin * sin;
    let meridian_m = EQUATOR_M * (1.0 - ECCENTRICITY_2) / flat.powf(1.5);
    let degree = 1.0_f64.to_radians();
    (meridian_m * degree, EQUATOR_M / flat.sqrt() * cos * degree)
}

/// Gravity with the earth's rotation: international gravity formula 1980 with free-air decrease.
fn gravity_mps2(latitude_deg: f64, altitude_m: f64) -> f64 {
    let sin = latitude_deg.to_radians().sin();
    let sin_twice = (2.0 * latitude_deg.to_radians()).sin();
    9.780_327 * (1.0 + 0.005_302_4 * sin * sin - 0.000_005_8 * sin_twice * sin_twice)
        - 3.086e-6 * altitude_m
}

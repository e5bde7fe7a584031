//! Launch of the aircraft: at rest on its stand, accelerated by a catapult, or in flight.

use crate::plant::{Inputs, Plant, PlantError, PlantOptions, Start, Travel, Truth, to_body};
use crate::shim::options::Launch;

/// Duration of the catapult's pull, s: about 1.7 g over 8.3 m for a final speed of 16.67 m/s.
const PULL_S: f64 = 1.0;
/// Throttle above which the catapult is released. PX4 and ArduPlane idle below it before a take-off.
const LAUNCH_THROTTLE: f64 = 0.1;
/// Radius of the earth's equator, m, and its first eccentricity squared (WGS 84).
const EQUATOR_M: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;

/// Phase of the launch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Stand,
    /// On the catapult; the value is the number of steps since the release.
    Catapult(u64),
    Flight,
}

/// A plant that starts at rest on the ground, as an estimator needs for its alignment.
///
/// The catapult accelerates the aircraft along a straight line to the start state, in the attitude of that state. JSBSim takes
/// over there. Every quantity except acceleration is continuous at that moment.
pub struct Launcher {
    plant: Plant,
    start: Start,
    at_once: Launch,
    step_s: f64,
    phase: Phase,
    /// The start state as JSBSim evaluates it.
    released: Truth,
    shown: Truth,
}

impl Launcher {
    /// Puts the aircraft on its stand, or in flight if `launch` is immediate.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded, or `start` is outside the accepted range.
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
    /// If the aircraft cannot be evaluated at its start.
    pub fn begin_anew(&mut self) -> Result<(), PlantError> {
        self.released = self.plant.reset(&self.start)?;
        self.phase = match self.at_once {
            Launch::Immediate => Phase::Flight,
            Launch::WhenArmed => Phase::Stand,
        };
        self.shown = self.state();
        Ok(())
    }

    /// Measures the travel of the aircraft's surfaces.
    ///
    /// # Errors
    /// If the aileron or elevator does not follow its command.
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

    /// Whether JSBSim simulates the motion of the aircraft.
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

    /// Advances the aircraft by one step and returns its state.
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

    /// The state before JSBSim takes over, or at the moment when it does.
    fn state(&self) -> Truth {
        match self.phase {
            Phase::Stand => self.pulled(0.0, 0.0),
            Phase::Catapult(steps) => self.pulled(steps as f64 * self.step_s / PULL_S, 1.0),
            Phase::Flight => self.released,
        }
    }

    /// The state at the fraction `share` of the final speed. `pull` is the factor on the catapult's acceleration: 1 on
    /// the catapult and 0 on the stand.
    fn pulled(&self, share: f64, pull: f64) -> Truth {
        let released = self.released;
        let velocity = released.velocity_ned_mps.map(|v| v * share);
        // Displacement from the release point, at constant acceleration; negative before the release.
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

/// Gravity including the earth's rotation, m/s²: international gravity formula 1980 with free-air decrease.
fn gravity_mps2(latitude_deg: f64, altitude_m: f64) -> f64 {
    let sin = latitude_deg.to_radians().sin();
    let sin_twice = (2.0 * latitude_deg.to_radians()).sin();
    9.780_327 * (1.0 + 0.005_302_4 * sin * sin - 0.000_005_8 * sin_twice * sin_twice)
        - 3.086e-6 * altitude_m
}

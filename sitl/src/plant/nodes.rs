//! JSBSim's property nodes: found once after loading, then read and written in SI units.

use jsbsim::{Error, Fdm, NodeId};

use super::lookup::{look, needed};
use super::settling::{self, settle};
use super::steering::Steering;
use super::{Inputs, PlantError, PlantOptions, Start, Truth};
use crate::air::Gust;

/// Metres per foot (exact).
const FT: f64 = 0.3048;
/// Newtons per pound of force.
const LBF: f64 = 4.448_221_615_260_5;
const SLUG: f64 = LBF / FT;
/// Pascals per pound per square foot.
const PSF: f64 = LBF / (FT * FT);

/// Nodes of all properties that a step reads or writes.
pub(super) struct Nodes {
    steering: Steering,
    /// Held properties and their values.
    held: Vec<(NodeId, f64)>,
    attitude: [NodeId; 3],
    rates: [NodeId; 3],
    airspeed: NodeId,
    alpha: NodeId,
    beta: NodeId,
    force: [NodeId; 3],
    mass: NodeId,
    velocity: [NodeId; 3],
    wind: [NodeId; 3],
    place: [NodeId; 3],
    density: NodeId,
    pressure: NodeId,
    /// Thrust of each engine, lbf.
    thrusts: Vec<NodeId>,
    /// Whether each engine runs; empty if no engine has a starter.
    running: Vec<NodeId>,
    hidden_thrust: Option<NodeId>,
}

impl Nodes {
    /// Looks up every property on a loaded aircraft.
    pub(super) fn find(fdm: &Fdm, options: &PlantOptions) -> Result<Self, PlantError> {
        let look = |name: &str| look(fdm, name);
        let node = |name: &str| needed(fdm, &options.aircraft, name);
        let three =
            |before: &str, names: [&str; 3], after: &str| -> Result<[NodeId; 3], PlantError> {
                let [a, b, c] = names.map(|name| node(&format!("{before}{name}{after}")));
                Ok([a?, b?, c?])
            };
        // Only engines with a starter can be off while their throttle is open.
        let is_started = look("propulsion/starter_cmd").is_some();
        Ok(Nodes {
            steering: Steering::find(fdm, options)?,
            held: options
                .held
                .iter()
                .map(|(name, value)| Ok((node(name)?, *value)))
                .collect::<Result<_, PlantError>>()?,
            attitude: three("attitude/", ["phi", "theta", "psi"], "-rad")?,
            rates: three("velocities/", ["p", "q", "r"], "-rad_sec")?,
            airspeed: node("velocities/vt-fps")?,
            alpha: node("aero/alpha-rad")?,
            beta: node("aero/beta-rad")?,
            force: three("forces/fb", ["x", "y", "z"], "-total-lbs")?,
            mass: node("inertia/mass-slugs")?,
            velocity: three("velocities/v-", ["north", "east", "down"], "-fps")?,
            wind: three("atmosphere/total-wind-", ["north", "east", "down"], "-fps")?,
            place: three("position/", ["lat-geod-deg", "long-gc-deg", "h-sl-ft"], "")?,
            density: node("atmosphere/rho-slugs_ft3")?,
            pressure: node("atmosphere/P-psf")?,
            thrusts: each_engine(fdm, "thrust-lbs"),
            running: if is_started { each_engine(fdm, "set-running") } else { Vec::new() },
            hidden_thrust: look(crate::hidden::THRUST_PROPERTY),
        })
    }

    /// Writes the commands to their JSBSim properties.
    pub(super) fn command(&self, fdm: &mut Fdm, inputs: &Inputs) -> Result<(), Error> {
        settling::hold(fdm, &self.held)?;
        self.steering.command(fdm, inputs)
    }

    /// Whether the aircraft has no throttle.
    pub(super) fn is_glider(&self) -> bool {
        self.steering.is_glider()
    }

    /// Starts every engine that can be off. Returns the index of the first engine that does not run after the start;
    /// `None` if all run. JSBSim starts engines at full power; they then follow the throttle.
    pub(super) fn start_engines(&self, fdm: &mut Fdm, step_s: f64) -> Result<Option<usize>, Error> {
        if self.running.is_empty() {
            return Ok(None);
        }
        // A constant-speed propeller whose lever is not commanded stays at its coarsest pitch and may stop its engine.
        for engine in 0..self.running.len() {
            let lever = format!("fcs/advance-cmd-norm[{engine}]");
            if look(fdm, &lever).is_some() {
                fdm.set_property(&lever, 1.0)?;
            }
        }
        const ALL: f64 = -1.0;
        fdm.set_property("propulsion/set-running", ALL)?;
        let stands = self.stands(fdm)?;
        if stands.is_none() {
            return Ok(None);
        }
        // A fuel system in the aircraft's XML feeds an engine only after a frame.
        settle(fdm, step_s)?;
        fdm.set_property("propulsion/set-running", ALL)?;
        self.stands(fdm)
    }

    /// Index of the first engine that does not run.
    fn stands(&self, fdm: &mut Fdm) -> Result<Option<usize>, Error> {
        for (engine, running) in self.running.iter().enumerate() {
            if fdm.read_node(*running)? == 0.0 {
                return Ok(Some(engine));
            }
        }
        Ok(None)
    }

    /// Starts `gust` with the next frame.
    pub(super) fn gust(&self, fdm: &mut Fdm, gust: &Gust) -> Result<(), Error> {
        /// The gust's direction is given north-east-down (JSBSim `gfLocal`).
        const LOCAL: f64 = 3.0;
        let [north, east, down] = gust.velocity_ned_mps;
        for (name, value) in [
            ("startup-duration-sec", gust.rise_s),
            ("steady-duration-sec", gust.hold_s),
            ("end-duration-sec", gust.fall_s),
            ("magnitude-ft_sec", north.hypot(east).hypot(down) / FT),
            ("frame", LOCAL),
            ("X-velocity-ft_sec", north),
            ("Y-velocity-ft_sec", east),
            ("Z-velocity-ft_sec", down),
            ("start", 1.0),
        ] {
            fdm.set_property(&format!("atmosphere/cosine-gust/{name}"), value)?;
        }
        Ok(())
    }

    /// Puts a freshly loaded aircraft at `start` in the air of `options`.
    pub(super) fn start(
        &self,
        fdm: &mut Fdm,
        start: &Start,
        options: &PlantOptions,
    ) -> Result<(), Error> {
        let wind = options.air.wind_ned_mps;
        let [u, v, w] = start.ground_velocity(wind);
        for (name, value) in [
            ("lat-geod-deg", options.latitude_deg),
            ("long-gc-deg", options.longitude_deg),
            ("h-sl-ft", start.altitude_m / FT),
            ("psi-true-rad", start.yaw_rad),
            ("theta-rad", start.pitch_rad),
            ("phi-rad", start.roll_rad),
            ("u-fps", u / FT),
            ("v-fps", v / FT),
            ("w-fps", w / FT),
            ("p-rad_sec", start.p_radps),
            ("q-rad_sec", start.q_radps),
            ("r-rad_sec", start.r_radps),
        ] {
            fdm.set_property(&format!("ic/{name}"), value)?;
        }
        fdm.run_ic()?;
        settling::settle_conditions(fdm, &self.held, options.step_s)?;
        self.blow(fdm, options)
    }

    /// Sets wind and turbulence after the aircraft is at its start.
    fn blow(&self, fdm: &mut Fdm, options: &PlantOptions) -> Result<(), Error> {
        let wind = options.air.wind_ned_mps;
        for (name, speed) in ["north", "east", "down"].into_iter().zip(wind) {
            fdm.set_property(&format!("atmosphere/wind-{name}-fps"), speed / FT)?;
        }
        let [north, east, _] = wind;
        if north == 0.0 {
            // For a wind without a north component, JSBSim keeps the previous direction
            // (findings/jsbsim-wind-direction.sh). Here that would be the direction of a rounding error of the initial
            // condition. The turbulence depends on the direction.
            fdm.set_property("atmosphere/psiw-rad", east.atan2(0.0))?;
        }
        if wind != [0.0; 3] {
            settle(fdm, options.step_s)?;
        }
        fdm.set_property("atmosphere/randomseed", scattered(options.seed))?;
        if let Some(turbulence) = options.air.turbulence {
            let path = "atmosphere/turbulence/milspec/";
            let w20 = turbulence.wind_20ft_mps / FT;
            fdm.set_property(&format!("{path}windspeed_at_20ft_AGL-fps"), w20)?;
            fdm.set_property(&format!("{path}severity"), f64::from(turbulence.severity))?;
        }
        Ok(())
    }

    /// Reads the state except time and actuator rates.
    pub(super) fn truth(&self, fdm: &mut Fdm) -> Result<Truth, Error> {
        let [roll_rad, pitch_rad, yaw_rad] = read3(fdm, &self.attitude, 1.0)?;
        let [p_radps, q_radps, r_radps] = read3(fdm, &self.rates, 1.0)?;
        let [aileron_rad, elevator_rad, rudder_rad, throttle] = self.steering.positions(fdm)?;
        let [latitude_deg, longitude_deg, altitude_ft] = read3(fdm, &self.place, 1.0)?;
        Ok(Truth {
            roll_rad,
            pitch_rad,
            yaw_rad,
            p_radps,
            q_radps,
            r_radps,
            airspeed_mps: fdm.read_node(self.airspeed)? * FT,
            alpha_rad: fdm.read_node(self.alpha)?,
            beta_rad: fdm.read_node(self.beta)?,
            specific_force_mps2: self.specific_force(fdm)?,
            velocity_ned_mps: read3(fdm, &self.velocity, FT)?,
            wind_ned_mps: read3(fdm, &self.wind, FT)?,
            latitude_deg,
            longitude_deg,
            altitude_m: altitude_ft * FT,
            air_density_kgpm3: fdm.read_node(self.density)? * SLUG / (FT * FT * FT),
            static_pressure_pa: fdm.read_node(self.pressure)? * PSF,
            aileron_rad,
            elevator_rad,
            throttle,
            rudder_rad,
            thrust_n: self.thrust(fdm)?,
            ..Truth::default()
        })
    }

    /// Specific force, m/s²: JSBSim's total force, which excludes the weight, divided by the mass.
    fn specific_force(&self, fdm: &mut Fdm) -> Result<[f64; 3], Error> {
        let mass = fdm.read_node(self.mass)?;
        read3(fdm, &self.force, FT / mass)
    }

    fn thrust(&self, fdm: &mut Fdm) -> Result<f64, Error> {
        let mut total = self.hidden_thrust.map_or(Ok(0.0), |node| fdm.read_node(node))?;
        for thrust in &self.thrusts {
            total += fdm.read_node(*thrust)?;
        }
        Ok(total * LBF)
    }
}

/// The nodes of the property `name` of all engines.
fn each_engine(fdm: &Fdm, name: &str) -> Vec<NodeId> {
    let names = (0..).map(|i| format!("propulsion/engine[{i}]/{name}"));
    names.map_while(|name| fdm.node(&name).ok().flatten()).collect()
}

impl Start {
    /// Velocity over the ground, body axes, m/s, in the wind `wind_ned`, north-east-down, m/s.
    fn ground_velocity(&self, wind_ned: [f64; 3]) -> [f64; 3] {
        let (sin_alpha, cos_alpha) = self.alpha_rad.sin_cos();
        let (sin_beta, cos_beta) = self.beta_rad.sin_cos();
        let air = [cos_alpha * cos_beta, sin_beta, sin_alpha * cos_beta];
        let wind = to_body([self.roll_rad, self.pitch_rad, self.yaw_rad], wind_ned);
        std::array::from_fn(|i| self.airspeed_mps * air[i] + wind[i])
    }
}

/// Transforms a vector from north-east-down to body axes (forward-right-down) at the attitude `[roll, pitch, yaw]`, rad.
pub(crate) fn to_body(attitude: [f64; 3], [north, east, down]: [f64; 3]) -> [f64; 3] {
    let [(sin_roll, cos_roll), (sin_pitch, cos_pitch), (sin_yaw, cos_yaw)] =
        attitude.map(f64::sin_cos);
    let (ahead, right) = (north * cos_yaw + east * sin_yaw, east * cos_yaw - north * sin_yaw);
    let (x, below) = (ahead * cos_pitch - down * sin_pitch, ahead * sin_pitch + down * cos_pitch);
    [x, right * cos_roll + below * sin_roll, below * cos_roll - right * sin_roll]
}

/// A seed for JSBSim, 0 to 2³¹ − 2, far from the results for neighbouring seeds.
///
/// JSBSim's generator is multiplicative: small seeds give multiples of each other's numbers and thus similar turbulence. The hash
/// is that of SplitMix64 (Steele, Lea, Flood 2014).
fn scattered(seed: u32) -> f64 {
    let mut z = (u64::from(seed) + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) % 0x7fff_ffff) as f64
}

fn read3(fdm: &mut Fdm, nodes: &[NodeId; 3], scale: f64) -> Result<[f64; 3], Error> {
    let mut values = [0.0; 3];
    for (value, node) in values.iter_mut().zip(nodes) {
        *value = fdm.read_node(*node)? * scale;
    }
    Ok(values)
}

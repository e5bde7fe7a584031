//! Simulated flights of an aircraft like the A430: true coefficients, the flights, and what motion capture sees of them.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result};
use greylag::logs;
use greylag::logs::mapping::Mapping;
use greylag::logs::phases::Flying;
use greylag::model::{GreyBox, STEP, Twin};
use greylag::num::stream::{Stream, stream};
use greylag::physics::rigid_body::{air_velocity, attitude_rate, body_to_horizon};
use greylag::physics::{Command, State};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// Number of flights of a set.
const FLIGHTS: usize = 9;
/// Duration of a flight, s.
const SECONDS: f64 = 2.0;
/// Standard deviation of the noise of the measured positions, m, along each axis.
const POSITION_SD_M: f64 = 0.001;
/// Standard deviation of the noise of the measured attitude, degrees, about each body axis.
const ATTITUDE_SD_DEG: f64 = 0.2;
/// Standard deviations of the common tilt of the measured axes about body x, y and z, degrees.
const TILT_SD_DEG: [f64; 3] = [2.0, 5.0, 2.0];
/// Time for which the excitation of a control is constant, s.
const LEVEL_S: f64 = 0.2;
/// Altitude at the start, m.
const ALTITUDE_M: f64 = 1.6;
/// Number of aircraft that are drawn before a set is given up.
const AIRCRAFT_TRIES: u64 = 2000;
/// Number of flights that are begun with one aircraft before it counts as one that does not fly.
const FLIGHT_TRIES: usize = 10;
/// Number of the random stream for tilt, flights and noise.
const FLOWN: u64 = 530;

/// Prior model and mapping of the A430.
pub struct A430 {
    /// The model before any fit. The true coefficients are drawn from its prior.
    pub prior: GreyBox,
    mapping: Mapping,
}

/// A set: an aircraft and its reconstructed flights.
pub struct Set {
    /// The aircraft: the prior model with the true coefficients.
    pub truth: GreyBox,
    /// Rotation from the body axes to the measured axes about body x, y and z, rad; the same in all flights.
    pub tilt_rad: [f64; 3],
    /// The reconstructed flights.
    pub flights: Vec<Reconstruction>,
    /// Number of aircraft that were drawn before this one and did not fly.
    pub rejected: u64,
}

/// What is true at one frame of the cameras.
struct Frame {
    /// Position, NED, m.
    position_m: Vector3<f64>,
    /// Rotation from body axes to NED.
    attitude: Rotation3<f64>,
    /// Command from this frame to the next.
    command: Command,
}

impl A430 {
    /// Reads the prior model and the mapping of the real flights.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn load() -> Result<A430> {
        Ok(A430 {
            prior: GreyBox::load(Path::new("params/a430/prior.toml"))?,
            mapping: Mapping::load(Path::new("tests/data/a430/mapping.toml"))?,
        })
    }

    /// Draws an aircraft from `seed`, flies it and reads the flights as those of the A430. The tilt of the measured axes is
    /// multiplied by `tilted` (dimensionless).
    ///
    /// An aircraft that leaves the bounds of [`flies`] in ten starts of one flight is replaced by another draw, as an aircraft
    /// that does not fly has no log. The true coefficients are therefore those of the prior, given that the aircraft flies.
    ///
    /// # Errors
    /// If no drawn aircraft flies, or a log cannot be written, read or reconstructed.
    pub fn set(&self, seed: u64, tilted: f64) -> Result<Set> {
        for draw in 0..AIRCRAFT_TRIES {
            let truth = self.prior.drawn(seed, draw);
            let mut random = stream(seed, &[FLOWN, draw]);
            let flown: Option<Vec<Vec<Frame>>> =
                (0..FLIGHTS).map(|_| flight(&truth, &mut random)).collect();
            let Some(flown) = flown else { continue };
            let tilt_rad = TILT_SD_DEG.map(|sd| tilted * sd.to_radians() * normal(&mut random));
            let flights = self.logged(&flown, tilt_rad, &mut random)?;
            return Ok(Set { truth, tilt_rad, flights, rejected: draw });
        }
        anyhow::bail!("seed {seed}: none of {AIRCRAFT_TRIES} drawn aircraft flies")
    }

    /// Writes the flights `flown` as tables with the columns of the A430 and reads them with its mapping.
    fn logged(
        &self,
        flown: &[Vec<Frame>],
        tilt_rad: [f64; 3],
        random: &mut Stream,
    ) -> Result<Vec<Reconstruction>> {
        let folder = tempfile::tempdir()?;
        let mut flights = Vec::with_capacity(flown.len());
        for (k, frames) in flown.iter().enumerate() {
            let path = folder.path().join(format!("flight-{}.csv", k + 1));
            std::fs::write(&path, table(frames, tilt_rad, random))?;
            flights.push(self.read(&path).with_context(|| format!("flight {}", k + 1))?);
        }
        Ok(flights)
    }

    /// Reads and reconstructs the flight in `path`, as `examples/real_aircraft` reads those of the real aircraft.
    fn read(&self, path: &Path) -> Result<Reconstruction> {
        let model = &self.prior;
        let envelope = &model.airframe.envelope;
        let flies = self.mapping.flies(Some(Flying::from(envelope.flying_from_mps())));
        let mapping = self.mapping.clone();
        let log = logs::load(path, &logs::Options { mapping, flies, ..logs::Options::default() })?;
        let options = flight_path::Options::of(&log.flight.name, model, ActuatorClock::AsRecorded);
        Ok(reconstruct(&log.flight, &options.down_to(log.flies.sustained_s))?)
    }
}

/// A draw from the standard normal distribution.
fn normal(random: &mut Stream) -> f64 {
    StandardNormal.sample(random)
}

/// Noise along three axes with the standard deviation `sd`, in its unit.
fn noise(random: &mut Stream, sd: f64) -> Vector3<f64> {
    Vector3::new(normal(random), normal(random), normal(random)) * sd
}

/// A flight of `truth`; `None` if none of [`FLIGHT_TRIES`] starts stays within the bounds of [`flies`].
fn flight(truth: &GreyBox, random: &mut Stream) -> Option<Vec<Frame>> {
    (0..FLIGHT_TRIES).find_map(|_| fly(truth, random))
}

/// Flies `truth` once; `None` if it leaves the bounds of [`flies`].
fn fly(truth: &GreyBox, random: &mut Stream) -> Option<Vec<Frame>> {
    let pilot = Pilot::drawn(random);
    let start = start(random);
    let first = pilot.command(0.0, &start);
    let controls = truth.airframe.actuators.controls(&first);
    let mut twin = Twin::at_rest(start, &controls, ALTITUDE_M);
    let mut yaw = 0.1 * normal(random);
    let mut position_m = Vector3::new(-11.0, 1.0, -ALTITUDE_M);
    let steps = (SECONDS / STEP).round() as usize;
    let mut frames = Vec::with_capacity(steps + 1);
    for k in 0..=steps {
        let state = twin.state;
        if !flies(&state) {
            return None;
        }
        let command = pilot.command(k as f64 * STEP, &state);
        let attitude = Rotation3::from_euler_angles(state.roll, state.pitch, yaw);
        frames.push(Frame { position_m, attitude, command });
        let (before, turn) = (velocity(truth, &twin, yaw), attitude_rate(&state)[2]);
        twin.step(truth, &command);
        // by the trapezoidal rule: the attitude's yaw and the position are not among the model's states
        yaw += 0.5 * STEP * (turn + attitude_rate(&twin.state)[2]);
        position_m += (before + velocity(truth, &twin, yaw)) * (0.5 * STEP);
    }
    Some(frames)
}

/// Velocity over ground in still air, NED, m/s, at the heading `yaw`, rad.
fn velocity(truth: &GreyBox, twin: &Twin, yaw: f64) -> Vector3<f64> {
    let air = truth.air(&twin.state, twin.altitude);
    let level = body_to_horizon(&twin.state, air_velocity(&twin.state, &air));
    Rotation3::from_euler_angles(0.0, 0.0, yaw) * Vector3::from(level)
}

/// Whether a state counts as flight: 3 to 14 m/s, α and β within 30°, roll within 70° and pitch within 60°.
fn flies(state: &State) -> bool {
    let within = |x: f64, degrees: f64| x.abs() <= degrees.to_radians();
    (3.0..=14.0).contains(&state.airspeed)
        && within(state.alpha, 30.0)
        && within(state.beta, 30.0)
        && within(state.roll, 70.0)
        && within(state.pitch, 60.0)
}

/// A state at the start of a flight, about that of the real flights: 5 m/s in a climb.
fn start(random: &mut Stream) -> State {
    let mut degrees = |mean: f64, sd: f64| (mean + sd * normal(random)).to_radians();
    let (roll, pitch) = (degrees(0.0, 4.0), degrees(18.0, 3.0));
    let (alpha, beta) = (degrees(7.0, 2.0), degrees(-3.0, 3.0));
    let [p, q, r] = [(); 3].map(|()| degrees(0.0, 15.0));
    let airspeed = 5.0 + 0.3 * normal(random);
    State { roll, pitch, airspeed, p, q, r, alpha, beta }
}

/// A weak attitude controller with a random excitation of all controls.
struct Pilot {
    /// Attitude that is held, rad.
    roll: f64,
    pitch: f64,
    /// Levels of aileron, elevator (−1..1) and throttle (0..1), each for [`LEVEL_S`].
    levels: Vec<[f64; 3]>,
}

impl Pilot {
    /// Draws attitude and excitation.
    fn drawn(random: &mut Stream) -> Pilot {
        let mut within = |low: f64, high: f64| -> f64 { random.random_range(low..high) };
        let (roll, pitch) = (within(-0.3, 0.3), within(0.0, 0.3));
        let count = (SECONDS / LEVEL_S).ceil() as usize + 1;
        let level = |_| [within(-0.25, 0.25), within(-0.2, 0.2), within(0.6, 1.0)];
        Pilot { roll, pitch, levels: (0..count).map(level).collect() }
    }

    /// The command at `time_s` after the start in the state `seen`.
    fn command(&self, time_s: f64, seen: &State) -> Command {
        let place = ((time_s / LEVEL_S) as usize).min(self.levels.len() - 1);
        let [aileron, elevator, throttle] = self.levels[place];
        Command {
            aileron: aileron + 0.5 * (self.roll - seen.roll) - 0.02 * seen.p,
            // positive elevator pitches down
            elevator: elevator + 0.6 * (seen.pitch - self.pitch) + 0.03 * seen.q,
            throttle,
            rudder: 0.0,
        }
        .clamped()
    }
}

/// A flight as a table with the columns of the A430 that its mapping uses: position in m, attitude in degrees, commands in
/// degrees of a travel of 25°, throttle 0..1. The attitude is that of axes turned by `tilt_rad` from the body axes.
fn table(frames: &[Frame], tilt_rad: [f64; 3], random: &mut Stream) -> String {
    let tilt = Rotation3::from_scaled_axis(Vector3::from(tilt_rad));
    let mut text = "FrameNumber,x,y,z,phi,theta,psi,de,da,dt\n".to_owned();
    for (k, frame) in frames.iter().enumerate() {
        let [x, y, z]: [f64; 3] = (frame.position_m + noise(random, POSITION_SD_M)).into();
        let shake = Rotation3::from_scaled_axis(noise(random, ATTITUDE_SD_DEG.to_radians()));
        let (roll, pitch, yaw) = (frame.attitude * tilt * shake).euler_angles();
        let [phi, theta, psi] = [roll, pitch, yaw].map(f64::to_degrees);
        // the authors' aileron is positive for rolling left
        let (de, da) = (frame.command.elevator / 0.04, -frame.command.aileron / 0.04);
        let dt = frame.command.throttle;
        let number = 1000 + k;
        let _ = writeln!(
            text,
            "{number},{x:.6},{y:.6},{z:.6},{phi:.6},{theta:.6},{psi:.6},{de:.6},{da:.6},{dt:.6}"
        );
    }
    text
}

//! Flights in JSBSim with excitation, and a sensor model of its own that spoils them.
#![allow(dead_code)]

use std::path::Path;

use greylag::control::{self, ControllerKind, Target};
use greylag::logs::{Flight, Sample};
use greylag::model::GreyBox;
use greylag::num::stream::{Stream, stream};
use greylag::physics::Command;
use greylag::sim::{Environment, Simulator};
use greylag::sysid::flight_path::Options;
use greylag_sitl::air::{Air, Turbulence};
use greylag_sitl::plant::{PlantOptions, Truth};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// Step of the simulator, s.
pub const STEP: f64 = 0.01;

/// The model that flies as JSBSim does.
pub fn model() -> GreyBox {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    GreyBox::load(&path).unwrap()
}

/// The options of a reconstruction of these flights.
pub fn options() -> Options {
    Options { gravity: 9.806, ..Options::new("flight", model().airframe.actuators) }
}

/// Wind and turbulence of a flight.
pub fn air(wind_ned_mps: [f64; 3], severity: Option<u8>) -> Air {
    let turbulence = severity.map(|severity| Turbulence { wind_20ft_mps: 7.6, severity });
    Air { wind_ned_mps, turbulence, gusts: Vec::new() }
}

/// Truth and command of every step.
pub struct Flown {
    pub truth: Vec<Truth>,
    pub commands: Vec<Command>,
}

/// Flies `seconds` through several headings with doublets and multisines on top of the LQI.
pub fn fly(seconds: f64, air: Air, seed: u64) -> Flown {
    let mut lqi = control::build(ControllerKind::Lqi, &model()).unwrap();
    let options = PlantOptions { air, seed: seed as u32 + 1, ..Default::default() };
    let mut simulator = Simulator::new(&options).unwrap();
    let mut random = stream(seed, &[1]);
    let phases: [f64; 8] = std::array::from_fn(|_| random.random::<f64>() * std::f64::consts::TAU);
    let mut seen = simulator.reset().unwrap();
    lqi.reset(seed);
    let mut target = Target { roll: 0.0, pitch: 0.05, airspeed: 18.0 };
    let (mut truth, mut commands) = (Vec::new(), Vec::new());
    for k in 0..(seconds / STEP) as usize {
        if k % 400 == 399 {
            let mut within = |a: f64, b: f64| a + (b - a) * random.random::<f64>();
            // banks to both sides, more to the right: the flight goes round all headings
            target = Target {
                roll: within(-0.5, 0.9),
                pitch: within(-0.12, 0.2),
                airspeed: within(16.0, 22.0),
            };
        }
        let mut command = lqi.command(&seen, &target);
        let [aileron, elevator, throttle] = excitation(k as f64 * STEP, &phases);
        command.aileron += aileron;
        command.elevator += elevator;
        command.throttle += throttle;
        truth.push(simulator.truth());
        commands.push(command.clamped());
        seen = simulator.step(command).unwrap();
    }
    Flown { truth, commands }
}

/// A multisine on every control, with a 3-2-1-1 on aileron and elevator in turn every 10 s.
fn excitation(t: f64, phases: &[f64; 8]) -> [f64; 3] {
    let sine = |i: usize, frequency: f64| (std::f64::consts::TAU * frequency * t + phases[i]).sin();
    let multisine = |i: usize, f: f64| sine(i, f) + sine(i + 1, 1.7 * f) + sine(i + 2, 3.1 * f);
    let into = t % 10.0 - 5.0;
    let level = match into / 0.25 {
        x if !(0.0..7.0).contains(&x) => 0.0,
        x if x < 3.0 || (5.0..6.0).contains(&x) => 0.15,
        _ => -0.15,
    };
    let (a, e) = if ((t / 10.0) as u64).is_multiple_of(2) { (level, 0.0) } else { (0.0, level) };
    [0.04 * multisine(0, 0.4) + a, 0.03 * multisine(3, 0.5) + e, 0.05 * multisine(5, 0.15)]
}

/// Errors of the sensors.
#[derive(Clone, Copy, Debug)]
pub struct Errors {
    pub gyro_bias: [f64; 3],
    pub force_bias: [f64; 3],
    pub airspeed_scale: f64,
    pub alpha_bias: f64,
    pub beta_bias: f64,
    /// Delays of attitude, gyros, accelerometers, airspeed, vanes, velocity, actuators, s; 0 to 10 ms.
    pub skew: [f64; 7],
    /// Standard deviations: attitude, gyros, accelerometers, airspeed, vanes, velocity, altitude.
    pub noise: [f64; 7],
}

impl Errors {
    /// Perfect sensors.
    pub const NONE: Errors = Errors {
        gyro_bias: [0.0; 3],
        force_bias: [0.0; 3],
        airspeed_scale: 1.0,
        alpha_bias: 0.0,
        beta_bias: 0.0,
        skew: [0.0; 7],
        noise: [0.0; 7],
    };

    /// The noise of a small autopilot: 0.2° attitude, 0.005 rad/s, 0.1 m/s², 0.3 m/s airspeed,
    /// 0.3° vanes, 0.1 m/s velocity, 0.5 m.
    pub const NOISE: [f64; 7] = [0.0035, 0.005, 0.1, 0.3, 0.005, 0.1, 0.5];
}

/// What sensors with `errors` log of a flight.
pub fn spoil(flown: &Flown, errors: &Errors, seed: u64) -> Flight {
    let mut random = stream(seed, &[2]);
    let samples: Vec<Sample> =
        (0..flown.truth.len()).map(|k| row(flown, errors, k, &mut random)).collect();
    Flight::from(samples)
}

fn row(flown: &Flown, e: &Errors, k: usize, random: &mut Stream) -> Sample {
    let late = |group: usize, get: &dyn Fn(&Truth) -> f64| {
        let part = e.skew[group] / STEP;
        let (now, before) = (get(&flown.truth[k]), get(&flown.truth[k.saturating_sub(1)]));
        now + part * (before - now)
    };
    let mut draw = |group: usize| {
        let unit: f64 = StandardNormal.sample(random);
        e.noise[group] * unit
    };
    let turn = |get: &dyn Fn(&Truth) -> f64, reference: f64| {
        // an angle close to the present one, so that interpolation does not cross ±π
        let tau = std::f64::consts::TAU;
        late(0, &|t| get(t) - tau * ((get(t) - reference) / tau).round())
    };
    let now = &flown.truth[k];
    let wrap = |x: f64| x - std::f64::consts::TAU * (x / std::f64::consts::TAU).round();
    let command = flown.commands[k];
    Sample {
        time_s: k as f64 * STEP,
        rate_hold_s: STEP,
        attitude_rad: [
            turn(&|t| t.roll_rad, now.roll_rad) + draw(0),
            turn(&|t| t.pitch_rad, now.pitch_rad) + draw(0),
            wrap(turn(&|t| t.yaw_rad, now.yaw_rad) + draw(0)),
        ],
        rates_radps: [
            late(1, &|t| t.p_radps) + e.gyro_bias[0] + draw(1),
            late(1, &|t| t.q_radps) + e.gyro_bias[1] + draw(1),
            late(1, &|t| t.r_radps) + e.gyro_bias[2] + draw(1),
        ],
        specific_force_mps2: std::array::from_fn(|i| {
            late(2, &|t| t.specific_force_mps2[i]) + e.force_bias[i] + draw(2)
        }),
        airspeed_mps: late(3, &|t| t.airspeed_mps) * e.airspeed_scale + draw(3),
        alpha_rad: late(4, &|t| t.alpha_rad) + e.alpha_bias + draw(4),
        beta_rad: late(4, &|t| t.beta_rad) + e.beta_bias + draw(4),
        velocity_ned_mps: std::array::from_fn(|i| late(5, &|t| t.velocity_ned_mps[i]) + draw(5)),
        altitude_m: now.altitude_m + draw(6),
        aileron_rad: late(6, &|t| t.aileron_rad),
        elevator_rad: late(6, &|t| t.elevator_rad),
        throttle: late(6, &|t| t.throttle),
        aileron_cmd: command.aileron,
        elevator_cmd: command.elevator,
        throttle_cmd: command.throttle,
        ..Sample::default()
    }
}

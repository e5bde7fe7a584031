//! Flights of JSBSim as logs: LQI legs with excitation on top, with or without sensor noise.
#![allow(dead_code)] // each test file uses its part

use std::path::Path;

use greylag::control::{self, ControllerKind, Target};
use greylag::logs::{Flight, Sample};
use greylag::model::GreyBox;
use greylag::num::stream::{Stream, stream};
use greylag::physics::{Command, Controls, State};
use greylag::sim::{Environment, Simulator};
use greylag::sysid::flight_path::reconstruction::{Instant, Reconstruction, Segment};
use greylag_sitl::plant::Truth;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// A shipped model.
pub fn model(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// Standard deviations of the sensors' noise.
#[derive(Clone, Copy)]
pub struct Noise {
    /// Roll, pitch, airspeed, p, q, r, α, β, in the units of `State`.
    pub state: [f64; 8],
    /// Accelerometers, m/s².
    pub force: f64,
    /// Velocity over ground, m/s.
    pub velocity: f64,
}

/// Perfect sensors.
pub const EXACT: Noise = Noise { state: [0.0; 8], force: 0.0, velocity: 0.0 };
/// A small autopilot: 0.3° attitude and vanes, 0.3 m/s airspeed, 0.3 °/s gyros, 0.1 m/s² accelerometers,
/// 0.1 m/s velocity.
pub const REALISTIC: Noise = Noise {
    state: [0.005, 0.005, 0.3, 0.005, 0.005, 0.005, 0.005, 0.005],
    force: 0.1,
    velocity: 0.1,
};

/// What is flown on top of the legs.
#[derive(Clone, Copy)]
struct Excitation {
    until: usize,
    command: Command,
}

/// Flies `seconds` of LQI legs (bank up to 40°, pitch −8 to 12°, 15 to 24 m/s, a new one every 5 s)
/// with held random steps on every control (0.2 to 0.6 s, surfaces up to 0.12, throttle up to 0.3).
pub fn fly(seed: u64, seconds: f64, noise: Noise) -> Flight {
    fly_with(seed, seconds, noise, 1.0)
}

/// The same with the excitation multiplied by `excitation`; 0 is a nominal flight.
pub fn fly_with(seed: u64, seconds: f64, noise: Noise, excitation: f64) -> Flight {
    let mut simulator = Simulator::new(&Default::default()).unwrap();
    let mut lqi = control::build(ControllerKind::Lqi, &model("jsbsim")).unwrap();
    let mut random = stream(seed, &[11]);
    let mut seen = simulator.reset().unwrap();
    lqi.reset(seed);
    let mut target = Target { roll: 0.0, pitch: 0.05, airspeed: 18.0 };
    let mut on_top = Excitation { until: 300, command: Command::IDLE };
    let mut flight = Flight::default();
    for step in 0..(seconds * 100.0) as usize {
        if step % 500 == 499 {
            target = leg(&mut random);
        }
        if step >= on_top.until {
            on_top = excite(step, &mut random);
        }
        let base = lqi.command(&seen, &target);
        let command = Command {
            aileron: base.aileron + excitation * on_top.command.aileron,
            elevator: base.elevator + excitation * on_top.command.elevator,
            throttle: base.throttle + excitation * on_top.command.throttle,
            rudder: 0.0,
        }
        .clamped();
        flight.samples.push(sample(&simulator.truth(), &command, noise, &mut random));
        seen = simulator.step(command).unwrap();
    }
    flight
}

fn leg(random: &mut Stream) -> Target {
    Target {
        roll: random.random_range(-0.7..0.7),
        pitch: random.random_range(-0.14..0.21),
        airspeed: random.random_range(15.0..24.0),
    }
}

fn excite(step: usize, random: &mut Stream) -> Excitation {
    Excitation {
        until: step + random.random_range(20..60),
        command: Command {
            aileron: random.random_range(-0.12..0.12),
            elevator: random.random_range(-0.12..0.12),
            throttle: random.random_range(-0.3..0.3),
            rudder: 0.0,
        },
    }
}

fn sample(truth: &Truth, command: &Command, noise: Noise, random: &mut Stream) -> Sample {
    let mut sensed = |x: f64, sd: f64| {
        let draw: f64 = StandardNormal.sample(random);
        x + sd * draw
    };
    let [roll, pitch, v, p, q, r, alpha, beta] = noise.state;
    Sample {
        time_s: truth.time_s,
        attitude_rad: [
            sensed(truth.roll_rad, roll),
            sensed(truth.pitch_rad, pitch),
            sensed(truth.yaw_rad, pitch),
        ],
        rates_radps: [sensed(truth.p_radps, p), sensed(truth.q_radps, q), sensed(truth.r_radps, r)],
        airspeed_mps: sensed(truth.airspeed_mps, v),
        alpha_rad: sensed(truth.alpha_rad, alpha),
        beta_rad: sensed(truth.beta_rad, beta),
        specific_force_mps2: truth.specific_force_mps2.map(|f| sensed(f, noise.force)),
        velocity_ned_mps: truth.velocity_ned_mps.map(|v| sensed(v, noise.velocity)),
        altitude_m: truth.altitude_m,
        aileron_rad: truth.aileron_rad,
        elevator_rad: truth.elevator_rad,
        throttle: truth.throttle,
        aileron_cmd: command.aileron,
        elevator_cmd: command.elevator,
        throttle_cmd: command.throttle,
        ..Sample::default()
    }
}

/// The samples taken for the truth: reconstruction without a smoother, for tests of what follows it.
pub fn as_measured(name: &str, flight: &Flight, noise: Noise) -> Reconstruction {
    let instant = |s: &Sample| Instant {
        time_s: s.time_s,
        state: State::from_array([
            s.attitude_rad[0],
            s.attitude_rad[1],
            s.airspeed_mps,
            s.rates_radps[0],
            s.rates_radps[1],
            s.rates_radps[2],
            s.alpha_rad,
            s.beta_rad,
        ]),
        yaw: s.attitude_rad[2],
        controls: Controls {
            aileron: s.aileron_rad,
            elevator: s.elevator_rad,
            throttle: s.throttle,
            rudder: 0.0,
            lagged: None,
        },
        command: None,
        specific_force: s.specific_force_mps2,
        altitude: s.altitude_m,
        density: f64::NAN,
    };
    Reconstruction {
        name: name.into(),
        step_s: 0.01,
        sampling: greylag::logs::Sampling::Held,
        clock: greylag::sysid::flight_path::ActuatorClock::AsRecorded,
        segments: vec![Segment { instants: flight.samples.iter().map(instant).collect() }],
        nuisances: Vec::new(),
        installation: Vec::new(),
        noise: noise.state,
        left: noise.state,
        force_noise: [noise.force; 3],
        gust_step: 0.0,
        rudder: None,
        notes: Vec::new(),
    }
}

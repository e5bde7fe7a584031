//! Flights in JSBSim with the rates its own equations of motion give, for the tests that validate models.
#![allow(dead_code)] // each test file uses its part

use std::path::Path;

use greylag::control::{self, ControllerKind, Target};
use greylag::model::GreyBox;
use greylag::num::stream;
use greylag::physics::{Channel, Command, Controls, State, rigid_body};
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start, Truth};
use rand_distr::{Distribution, StandardNormal};

pub fn model(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// The aircraft at the neutral start, with `hidden` in it.
pub fn plant(hidden: &[Hidden]) -> Plant {
    let options = PlantOptions { hidden: hidden.to_vec(), ..PlantOptions::default() };
    let mut plant = Plant::new(&options).unwrap();
    plant.reset(&Start::NEUTRAL).unwrap();
    plant
}

pub fn state(truth: &Truth) -> State {
    State {
        roll: truth.roll_rad,
        pitch: truth.pitch_rad,
        airspeed: truth.airspeed_mps,
        p: truth.p_radps,
        q: truth.q_radps,
        r: truth.r_radps,
        alpha: truth.alpha_rad,
        beta: truth.beta_rad,
    }
}

pub fn controls(truth: &Truth) -> Controls {
    Controls {
        aileron: truth.aileron_rad,
        elevator: truth.elevator_rad,
        throttle: truth.throttle,
        rudder: 0.0,
        lagged: None,
    }
}

pub fn inputs(c: &Command) -> Inputs {
    Inputs { aileron: c.aileron, elevator: c.elevator, throttle: c.throttle, rudder: 0.0 }
}

/// Commands that excite the aircraft in six ways, 1000 steps each.
pub fn histories() -> Vec<(String, Vec<Command>)> {
    let mut all = vec![
        ("white".to_owned(), noise(1, 0.0, 1)),
        ("held 0.25 s".to_owned(), noise(2, 0.0, 25)),
        ("Ornstein-Uhlenbeck".to_owned(), noise(3, 0.97, 1)),
    ];
    for (roll, pitch) in [(30.0, 5.0), (50.0, 20.0), (-40.0, -20.0)] {
        all.push((format!("PID to {roll}/{pitch}"), pid(roll, pitch)));
    }
    all
}

/// Gaussian commands with `memory` per step, each held for `hold` steps.
pub fn noise(seed: u64, memory: f64, hold: usize) -> Vec<Command> {
    let mut rng = stream::stream(seed, &[]);
    let mut x = [0.0_f64; 3];
    let drive = 0.5 * (1.0 - memory * memory).sqrt();
    (0..1000)
        .map(|k| {
            if k % hold == 0 {
                for v in &mut x {
                    let n: f64 = StandardNormal.sample(&mut rng);
                    *v = memory * *v + drive * n;
                }
            }
            Command { aileron: 0.5 * x[0], elevator: 0.7 * x[1], throttle: 0.5 + x[2], rudder: 0.0 }
                .clamped()
        })
        .collect()
}

pub fn pid(roll: f64, pitch: f64) -> Vec<Command> {
    let mut plant = plant(&[]);
    let mut pid = control::build(ControllerKind::Pid, &model("prior")).unwrap();
    let target = Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 20.0 };
    (0..1000)
        .map(|_| {
            let truth = plant.truth();
            let seen = control::Observation {
                time: greylag::physics::Time::default(),
                state: state(&truth),
                incidence_sd: [0.0; 2],
                actuators: Default::default(),
                altitude: truth.altitude_m,
                previous: [Command::IDLE; 2],
            };
            let command = pid.command(&seen, &target);
            plant.step(inputs(&command)).unwrap();
            command
        })
        .collect()
}

/// The state's rates as JSBSim's own equations of motion give them at this frame.
pub fn simulator_rate(plant: &mut Plant, truth: &Truth) -> [f64; 8] {
    const METRE: f64 = 0.3048;
    let mut get = |name: &str| plant.property(name).unwrap();
    let [u, v, w] = ["u", "v", "w"].map(|c| METRE * get(&format!("velocities/{c}-aero-fps")));
    let [du, dv, dw] =
        ["u", "v", "w"].map(|c| METRE * get(&format!("accelerations/{c}dot-ft_sec2")));
    let [dp, dq, dr] = ["p", "q", "r"].map(|c| get(&format!("accelerations/{c}dot-rad_sec2")));
    let speed = truth.airspeed_mps;
    let dspeed = (u * du + v * dv + w * dw) / speed;
    let dalpha = (u * dw - w * du) / (u * u + w * w);
    let dbeta = (speed * dv - v * dspeed) / (speed * (speed * speed - v * v).sqrt());
    let [droll, dpitch] = ["phi", "theta"].map(|c| get(&format!("velocities/{c}dot-rad_sec")));
    [droll, dpitch, dspeed, dp, dq, dr, dalpha, dbeta]
}

/// The rate of the model on an earth that turns: with the Coriolis acceleration, gyroscopic terms from
/// inertial rates, and a gravity that falls with altitude from the start's 600 m. The eight states hold neither heading nor latitude, so this lives
/// here, to show that nothing else is missing.
pub fn rate_on_turning_earth(model: &GreyBox, truth: &Truth, acting: &Controls) -> [f64; 8] {
    const EARTH_RATE: f64 = 7.292_115e-5;
    const EARTH_RADIUS: f64 = 6_371_000.0;
    let s = state(truth);
    let air = model.air(&s, truth.altitude_m);
    let (sin, cos) = truth.latitude_deg.to_radians().sin_cos();
    let (sin_yaw, cos_yaw) = truth.yaw_rad.sin_cos();
    let earth = [cos * cos_yaw, -cos * sin_yaw, -sin].map(|x| x * EARTH_RATE);
    let earth = rigid_body::horizon_to_body(&s, earth);
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let (mut acceleration, _) = model.accelerations(&s, acting, &air);
    let coriolis = cross(earth, rigid_body::air_velocity(&s, &air));
    for i in 0..3 {
        acceleration[i] -= 2.0 * coriolis[i];
    }
    let (start, now) = (EARTH_RADIUS + 600.0, EARTH_RADIUS + truth.altitude_m);
    let lost = model.atmosphere.gravity * ((start / now).powi(2) - 1.0);
    let less = rigid_body::gravity_in_body(&s, lost);
    (0..3).for_each(|i| acceleration[i] += less[i]);
    let inertial = State { p: s.p + earth[0], q: s.q + earth[1], r: s.r + earth[2], ..s };
    let wrench = model.wrench(&s, acting, &air);
    let moment = [Channel::Roll, Channel::Pitch, Channel::Yaw].map(|c| wrench.get(c));
    let mut spin = rigid_body::angular_acceleration(&model.body, &inertial, moment);
    let turning = cross([inertial.p, inertial.q, inertial.r], earth);
    for i in 0..3 {
        spin[i] -= turning[i];
    }
    rigid_body::state_rate(&s, &air, acceleration, spin).to_array()
}

/// Amplitudes several times what two minutes of flight show, so that an error of the formula cannot
/// hide in the tolerance.
pub const AMPLITUDES: [(&str, f64); 29] = [
    ("drag_alpha2", 1.5),
    ("drag_beta2", 0.7),
    ("drag_elevator_abs", 0.3),
    ("pitch_break", -3.0),
    ("cg_shift", 0.02),
    ("unsteady_lift", 3.0),
    ("thrust_decay", 0.6),
    ("thrust_scale", -5.0),
    ("thrust_lag", 0.4),
    ("thrust_line_offset", 0.03),
    ("motor_torque", 0.5),
    ("propeller_gyro", 0.05),
    ("propwash", 0.8),
    ("aeroelastic_loss", 0.2),
    ("actuator_lag", 0.04),
    ("time_delay", 0.05),
    ("dead_zone", 0.02),
    ("backlash", 0.02),
    ("rate_limit", 0.5),
    ("servo_aileron", -0.2),
    ("servo_elevator", 0.3),
    ("servo_aileron_curve", -0.6),
    ("servo_elevator_curve", 1.0),
    ("mass_error", 0.25),
    ("inertia_xz", 0.3),
    ("asymmetry", 0.004),
    ("dihedral_alpha", -0.8),
    ("roll_control_alpha", -0.6),
    ("effectiveness_saturation", -2.0),
];

/// The reference model with the effect at the amplitude that JSBSim hides.
pub fn amended(id: &str, amplitude: f64) -> GreyBox {
    let mut model = model("jsbsim");
    let add = |model: &mut GreyBox, name: &str| {
        let before = model.coefficients().iter().find(|c| c.name == name).unwrap().value;
        assert!(model.set_coefficient(name, before + amplitude));
    };
    match id {
        // the reference model has these two already
        "drag_beta2" => add(&mut model, "drag_beta2.CDbeta2"),
        "drag_elevator_abs" => add(&mut model, "drag_elevator_abs.CDde"),
        "unsteady_lift" => model.join(id, &[amplitude, -0.5 * amplitude]).unwrap(),
        "asymmetry" => model.join(id, &[amplitude; 3]).unwrap(),
        "roll_control_alpha" => model.join(id, &[amplitude, 0.0]).unwrap(),
        _ => model.join(id, &[amplitude]).unwrap(),
    }
    model
}

/// The effect as JSBSim hides it; none for an amplitude of zero.
pub fn hidden(id: &str, amplitude: f64) -> Vec<Hidden> {
    vec![Hidden::new(id, amplitude).unwrap()]
}

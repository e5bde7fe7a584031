//! Tests of signs: quantities of the plant appear with the correct sign and size in the decoded messages.
//!
//! The truth is read from the truth file, so each row checks the chain plant → sensors → telemetry → codec.

use std::path::Path;

use crate::shim_companion::*;
use greylag_sitl::plant::Start;
use greylag_sitl::shim::codec::{GlobalPositionInt, GpsRawInt, Message, WindCov};
use greylag_sitl::shim::{Existing, FULL_DEFLECTION_RAD, Launch, ShimOptions, TruthFile};

/// Rows of a truth file by column name.
struct Table {
    names: Vec<String>,
    rows: Vec<Vec<f64>>,
}

impl Table {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).expect("a truth file");
        let mut lines = text.lines().map(|line| line.split(','));
        let names = lines.next().expect("a header").map(str::to_owned).collect();
        let number = |field: &str| field.parse().expect("a number");
        Table { names, rows: lines.map(|line| line.map(number).collect()).collect() }
    }

    fn at(&self, row: usize, name: &str) -> f64 {
        let column = self.names.iter().position(|n| n == name).expect(name);
        self.rows[row][column]
    }
}

/// Flies 100 frames with `command`; returns the received states, the truth and the companion.
fn fly(change: impl FnOnce(&mut ShimOptions), command: [f32; 3]) -> (Vec<State>, Table, Companion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("truth.csv");
    let (mut companion, link) = listening();
    let mut options = lockstep(&link);
    options.truth = Some(TruthFile { path: path.clone(), existing: Existing::Keep });
    options.duration_s = Some(1.0);
    change(&mut options);
    let shim = Shim::start(options);
    let states = companion.fly(100, |_| command);
    shim.end();
    (states, Table::read(&path), companion)
}

/// Asserts equality within the single precision of the messages, seven digits.
fn close(shown: f32, truth: f64) {
    assert!((f64::from(shown) - truth).abs() <= 2e-6 * truth.abs().max(1.0), "{shown} for {truth}");
}

#[test]
fn every_frame_shows_the_truth() {
    // A start with all states nonzero and signs mixed, in wind.
    let start = Start {
        roll_rad: -0.4,
        pitch_rad: 0.2,
        yaw_rad: 2.5,
        airspeed_mps: 20.0,
        alpha_rad: 0.05,
        beta_rad: -0.08,
        p_radps: 0.3,
        q_radps: -0.2,
        r_radps: 0.1,
        altitude_m: 500.0,
    };
    let change = |options: &mut ShimOptions| {
        options.start = start;
        options.plant.air.wind_ned_mps = [3.0, -2.0, 0.5];
    };
    let (states, truth, companion) = fly(change, [0.2, 0.1, 0.6]);
    for (row, state) in states.iter().enumerate() {
        let is = |name: &str| truth.at(row, name);
        assert!((is("time_s") * 1e6 - state.time_us() as f64).abs() < 0.5);
        for (shown, name) in state.euler().into_iter().zip(["roll_rad", "pitch_rad", "yaw_rad"]) {
            assert!((shown - is(name)).abs() < 2e-6, "{name}: {shown} for {}", is(name));
        }
        let (imu, hud) = (&state.imu, &state.hud);
        for (shown, name) in [
            (imu.xgyro, "p_radps"),
            (imu.ygyro, "q_radps"),
            (imu.zgyro, "r_radps"),
            (state.attitude.rollspeed, "p_radps"),
            (state.attitude.pitchspeed, "q_radps"),
            (state.attitude.yawspeed, "r_radps"),
            (imu.xacc, "ax_mps2"),
            (imu.yacc, "ay_mps2"),
            (imu.zacc, "az_mps2"),
            (hud.airspeed, "airspeed_mps"),
            (hud.alt, "altitude_m"),
            (state.actuators.actuator[2], "throttle"),
        ] {
            close(shown, is(name));
        }
        close(state.vanes.aoa, is("alpha_rad").to_degrees());
        close(state.vanes.ssa, is("beta_rad").to_degrees());
        close(state.actuators.actuator[0], is("aileron_rad") / FULL_DEFLECTION_RAD);
        close(state.actuators.actuator[1], is("elevator_rad") / FULL_DEFLECTION_RAD);
        close(hud.climb, -is("vd_mps"));
        close(hud.groundspeed, is("vn_mps").hypot(is("ve_mps")));
        assert_eq!(state.attitude.time_boot_ms as u64 * 1000, state.time_us());
    }
    slow_messages_show_the_truth(&companion, &truth);
}

fn slow_messages_show_the_truth(companion: &Companion, truth: &Table) {
    let slow = |id: u32| companion.slow.iter().filter(move |frame| frame.id == id);
    for position in slow(GlobalPositionInt::ID).filter_map(|f| f.decode::<GlobalPositionInt>()) {
        let row = position.time_boot_ms as usize / 10 - 1;
        let shown = [position.vx, position.vy, position.vz].map(f64::from);
        for (cm, name) in shown.into_iter().zip(["vn_mps", "ve_mps", "vd_mps"]) {
            assert!((cm * 0.01 - truth.at(row, name)).abs() <= 0.0051, "{name}");
        }
        assert!((f64::from(position.alt) * 1e-3 - truth.at(row, "altitude_m")).abs() < 1e-3);
        assert!(
            (f64::from(position.hdg) * 0.01 - truth.at(row, "yaw_rad").to_degrees()).abs() < 0.01
        );
    }
    for gps in slow(GpsRawInt::ID).filter_map(|f| f.decode::<GpsRawInt>()) {
        let row = gps.time_usec as usize / 10_000 - 1;
        let (north, east) = (truth.at(row, "vn_mps"), truth.at(row, "ve_mps"));
        let course = east.atan2(north).to_degrees().rem_euclid(360.0);
        assert!((f64::from(gps.cog) * 0.01 - course).abs() < 0.01);
        assert!((f64::from(gps.vel) * 0.01 - north.hypot(east)).abs() <= 0.0051);
    }
    let wind: Vec<WindCov> = slow(WindCov::ID).filter_map(|frame| frame.decode()).collect();
    assert_eq!(wind.len(), 1, "once in the hundred frames");
    // JSBSim stores the wind in ft/s in the local frame; the conversion loses about 1e-6.
    for (shown, given) in [(wind[0].wind_x, 3.0), (wind[0].wind_y, -2.0), (wind[0].wind_z, 0.5)] {
        close(shown, given);
    }
}

/// One row: cause, change of the options, command, frame, measured quantity, and expected value or sign.
type Row = (&'static str, fn(&mut ShimOptions), [f32; 3], usize, fn(&State) -> f32, f32);

/// The flight at the start of each row is not trimmed, but the effect of each cause is larger than the untrimmed
/// motion.
const TABLE: [Row; 19] = [
    ("right bank", |o| o.start.roll_rad = 0.3, [0.0; 3], 0, |s| s.euler()[0] as f32, 0.3),
    ("left bank", |o| o.start.roll_rad = -0.3, [0.0; 3], 0, |s| s.euler()[0] as f32, -0.3),
    ("nose up", |o| o.start.pitch_rad = 0.2, [0.0; 3], 0, |s| s.euler()[1] as f32, 0.2),
    ("nose east", |o| o.start.yaw_rad = 1.2, [0.0; 3], 0, |s| s.euler()[2] as f32, 1.2),
    ("rolling right", |o| o.start.p_radps = 0.5, [0.0; 3], 0, |s| s.imu.xgyro, 0.5),
    ("pitching up", |o| o.start.q_radps = 0.5, [0.0; 3], 0, |s| s.imu.ygyro, 0.5),
    ("yawing right", |o| o.start.r_radps = 0.5, [0.0; 3], 0, |s| s.imu.zgyro, 0.5),
    ("air from below", |o| o.start.alpha_rad = 0.1, [0.0; 3], 0, |s| s.vanes.aoa, 5.729578),
    ("air from the right", |o| o.start.beta_rad = 0.1, [0.0; 3], 0, |s| s.vanes.ssa, 5.729578),
    // The side force of a positive sideslip points left: CYβ < 0.
    ("sideslip pushes left", |o| o.start.beta_rad = 0.1, [0.0; 3], 0, |s| s.imu.yacc, f32::MIN),
    // Lift gives a negative specific force on z.
    ("lift", |o| o.start.alpha_rad = 0.1, [0.0; 3], 0, |s| s.imu.zacc, f32::MIN),
    ("thrust pushes forward", |_| (), [0.0, 0.0, 1.0], 50, |s| s.imu.xacc, f32::MAX),
    ("aileron command", |_| (), [0.5, 0.0, 0.0], 30, |s| s.actuators.actuator[0], 0.5),
    ("aileron rolls right", |_| (), [0.5, 0.0, 0.0], 10, |s| s.imu.xgyro, f32::MAX),
    ("aileron moves right", |_| (), [0.5, 0.0, 0.0], 2, |s| s.actuators.actuator[3], f32::MAX),
    ("elevator command", |_| (), [0.0, 0.5, 0.0], 30, |s| s.actuators.actuator[1], 0.5),
    ("elevator pitches down", |_| (), [0.0, 0.5, 0.0], 10, |s| s.imu.ygyro, f32::MIN),
    ("elevator moves down", |_| (), [0.0, 0.5, 0.0], 2, |s| s.actuators.actuator[4], f32::MAX),
    ("throttle rises", |_| (), [0.0, 0.0, 1.0], 50, |s| s.actuators.actuator[2], f32::MAX),
];

#[test]
fn causes_show_with_their_sign() {
    for (cause, change, command, frame, shown, expected) in TABLE {
        let (mut companion, link) = listening();
        let mut options = lockstep(&link);
        options.launch = Launch::Immediate;
        options.plant.hidden.clear();
        change(&mut options);
        let shim = Shim::start(options);
        let states = companion.fly(frame + 1, |_| command);
        shim.stop();
        let value = shown(&states[frame]);
        println!("{cause:22} {value:10.4}");
        match expected {
            f32::MAX => assert!(value > 0.05, "{cause}: {value}"),
            f32::MIN => assert!(value < -0.05, "{cause}: {value}"),
            // Settled surfaces agree to 1e-3, and states at the start to single precision.
            value_expected => assert!((value - value_expected).abs() < 1e-3, "{cause}: {value}"),
        }
    }
}

#[test]
fn a_headwind_lowers_the_ground_speed_and_leaves_the_airspeed() {
    // At the start, the nose points north, the airspeed is 16.67 m/s, and the wind is 5 m/s towards the south.
    let (states, _, _) = fly(|o| o.plant.air.wind_ned_mps = [-5.0, 0.0, 0.0], [0.0; 3]);
    assert!((states[0].hud.airspeed - 16.67).abs() < 1e-3, "{:?}", states[0].hud);
    assert!((states[0].hud.groundspeed - 11.67).abs() < 1e-3, "{:?}", states[0].hud);
}

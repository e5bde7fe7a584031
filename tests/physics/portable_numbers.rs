//! The same numbers on every processor: what an x86-64 computed (`tests/data/portable/numbers.json`), computed again.
//! `tests/aarch64.sh` runs this on an emulated aarch64.
//!
//! Written anew, on x86-64 with AVX2, by `GREYLAG_WRITE_GOLDEN=1 cargo verify --test physics portable_numbers::`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use greylag::commands::controllers::{POLICY, controller};
use greylag::control::{ControllerKind, Observation, Pace, Target};
use greylag::model::{GreyBox, Memory, Trim, Twin};
use greylag::num::stream;
use greylag::physics::{Command, Controls, State, Time};
use rand::{Rng, RngExt};

const ALTITUDE: f64 = 600.0;
/// A second of flight.
const TICKS: u32 = 100;
const TARGET: Target = Target { roll: 0.4, pitch: 0.1, airspeed: 17.0 };

/// Numbers by what they are of.
type Numbers = BTreeMap<String, Vec<f64>>;

fn from_root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn state(rng: &mut impl Rng) -> State {
    let mut within = |low: f64, high: f64| rng.random_range(low..high);
    State {
        roll: within(-1.0, 1.0),
        pitch: within(-0.5, 0.5),
        airspeed: within(12.0, 28.0),
        alpha: within(-0.1, 0.25),
        beta: within(-0.2, 0.2),
        p: within(-2.0, 2.0),
        q: within(-1.0, 1.0),
        r: within(-1.0, 1.0),
    }
}

/// State derivatives and steps, double precision.
fn equations(model: &GreyBox, out: &mut Numbers) {
    let mut rng = stream::stream(27, &[]);
    for k in 0..24 {
        let s = state(&mut rng);
        let mut within = |low: f64, high: f64| rng.random_range(low..high);
        let controls = Controls {
            aileron: within(-0.3, 0.3),
            elevator: within(-0.3, 0.3),
            throttle: within(0.0, 1.0),
            rudder: within(-0.2, 0.2),
            ..Controls::default()
        };
        let rate = model.rate(&s, &controls, ALTITUDE);
        let next = model.step(&s, &controls, ALTITUDE, &mut Memory::default());
        let of = |what: &str| format!("{} {what} {k}", model.name);
        out.insert(of("rate"), rate.to_array().to_vec());
        out.insert(of("step"), next.to_array().to_vec());
    }
}

/// A second of closed loop: commands of every tenth tick, and the last state.
fn flown(kind: ControllerKind, model: &GreyBox) -> Vec<f64> {
    let mut controller = controller(kind, model, Path::new(POLICY), &[]).unwrap();
    controller.reset(7);
    let trim = Trim::level(model, TARGET.airspeed, ALTITUDE).unwrap();
    let mut twin = Twin::at_rest(trim.state, &trim.controls, ALTITUDE);
    let held = Command { throttle: trim.controls.throttle, ..Command::IDLE };
    let (mut previous, mut numbers) = ([held; 2], Vec::new());
    for tick in 0..TICKS {
        let seen = Observation {
            time: Time::from_micros(10_000 * u64::from(tick)),
            state: twin.state,
            incidence_sd: [0.0; 2],
            actuators: twin.actuators.observed(&model.airframe.actuators),
            altitude: twin.altitude,
            previous,
        };
        let command = controller.command(&seen, &TARGET);
        twin.step(model, &command);
        previous = [command, previous[0]];
        if tick % 10 == 9 {
            numbers.extend([command.aileron, command.elevator, command.throttle]);
        }
    }
    numbers.extend(twin.state.to_array());
    numbers
}

fn computed() -> Numbers {
    let load = |path: &str| GreyBox::load(&from_root(path)).unwrap();
    let x8 = load("params/x8/jsbsim.toml");
    let mut numbers = Numbers::new();
    equations(&x8, &mut numbers);
    equations(&load("params/aerosonde/jsbsim.toml"), &mut numbers);
    for &kind in ControllerKind::ALL {
        numbers.insert(format!("fly {kind}"), flown(kind, &x8));
    }
    numbers
}

/// How far numbers may be off, in units of the larger of one and the number. Equations differ by the last digits of
/// sines; loops in double precision carry those for a second. A search rounds single numbers and chooses between plans
/// that are nearly as good: a thousandth of the travel.
fn allowed(of: &str) -> f64 {
    let Some(kind) = of.strip_prefix("fly ") else { return 1e-12 };
    let kind = ControllerKind::ALL.iter().find(|k| k.name() == kind).unwrap();
    if kind.pace() == Pace::Planned { 1e-3 } else { 1e-6 }
}

#[test]
fn numbers_are_those_of_another_processor() {
    let path = from_root("tests/data/portable/numbers.json");
    let computed = computed();
    if std::env::var_os("GREYLAG_WRITE_GOLDEN").is_some() {
        std::fs::write(&path, serde_json::to_string(&computed).unwrap() + "\n").unwrap();
    }
    let golden: Numbers = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    assert!(golden.keys().eq(computed.keys()), "the file is of other controllers: write it anew");
    let mut worst = BTreeMap::<&str, f64>::new();
    for (of, (there, here)) in golden.iter().map(|(of, there)| (of, (there, &computed[of]))) {
        assert_eq!(there.len(), here.len(), "{of}");
        let off = |(a, b): (&f64, &f64)| (a - b).abs() / a.abs().max(1.0);
        let off = there.iter().zip(here).map(off).fold(0.0, f64::max);
        let group = if of.starts_with("fly ") { of } else { "derivatives and steps" };
        let entry = worst.entry(group).or_default();
        *entry = entry.max(off);
        assert!(off <= allowed(of), "{of} is off by {off:.1e} (allowed {:.0e})", allowed(of));
    }
    println!("on {}, against an x86-64:", std::env::consts::ARCH);
    worst.iter().for_each(|(of, off)| println!("{of:24} {off:.1e}"));
}

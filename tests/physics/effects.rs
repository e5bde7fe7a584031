//! The catalogue of effects: complete, true to its formulas, finite everywhere.

use std::path::Path;

use greylag::model::GreyBox;
use greylag::num::{Lanes, Real};
use greylag::physics::airframe::Geometry;
use greylag::physics::effects::{Description, Kind, Own, Terms};
use greylag::physics::inputs::{self, PAST, Past};
use greylag::physics::point::Base;
use greylag::physics::rigid_body::{self, ForceAxes};
use greylag::physics::{AirData, Channel, Controls, Point, State, Wrench};
use greylag::sysid::flight_path::measurement_effects::MEASUREMENT_EFFECTS;

/// What an effect reports.
struct Reported<R>(Vec<(usize, Channel, R)>);

impl<R> Terms<R> for Reported<R> {
    fn add(&mut self, index: usize, channel: Channel, amount: R) {
        self.0.push((index, channel, amount));
    }
}

const GEOMETRY: Geometry = Geometry { area: 0.75, span: 2.1, chord: 0.3571 };

/// A point at which nothing is zero.
const STATE: State = State {
    roll: 0.4,
    pitch: -0.3,
    airspeed: 19.0,
    p: 1.1,
    q: -0.7,
    r: 0.5,
    alpha: 0.12,
    beta: -0.08,
};
const CONTROLS: Controls =
    Controls { aileron: 0.2, elevator: -0.1, throttle: 0.6, rudder: 0.1, lagged: None };

fn catalogue() -> Vec<Description> {
    let effects = Kind::ALL.iter().map(|k| k.describe()).filter(|about| about.entry.is_some());
    let inputs = inputs::Kind::ALL.iter().map(|k| k.describe());
    effects.chain(inputs).chain(MEASUREMENT_EFFECTS).collect()
}

/// What an effect makes at [`STATE`], one unit of each coefficient, `base` known beforehand.
fn made(kind: Kind, shape: &[f64], base: &Base) -> Vec<(usize, Channel, f64)> {
    let air = AirData::new(&STATE, 1.156, 600.0, &GEOMETRY);
    let axes = ForceAxes::Wind;
    let at =
        Point { state: &STATE, controls: &CONTROLS, air: &air, geometry: &GEOMETRY, axes, base };
    let own = Own { shape, ..Own::default() };
    let mut reported = Reported(Vec::new());
    kind.independent_basis(&at, own, &mut reported);
    kind.dependent_basis(&at, own, &mut reported);
    reported.0
}

/// A base in which nothing is zero.
fn base() -> Base {
    let mut wrench = Wrench::zero();
    Channel::ALL.iter().enumerate().for_each(|(i, c)| wrench.add(*c, 1.0 + i as f64));
    let rate = State { alpha: 0.3, ..STATE };
    Base { wrench, force: [1.0, 2.0, -30.0], deflected: wrench, still: wrench, rate }
}

#[test]
fn every_id_of_the_catalogue_is_there() {
    let ids: Vec<_> = catalogue().iter().map(|about| about.id).collect();
    for id in "drag_alpha2 drag_beta2 drag_elevator_abs lift_stall pitch_break cg_shift unsteady_lift \
               thrust_decay thrust_scale thrust_line_offset motor_torque propeller_gyro propwash \
               aeroelastic_loss actuator_lag time_delay dead_zone backlash rate_limit air_density \
               mass_error inertia_xz asymmetry dihedral_alpha roll_control_alpha \
               effectiveness_saturation ground_effect steady_wind alpha_bias beta_bias airspeed_scale \
               imu_bias clock_skew external_load servo_aileron servo_elevator servo_aileron_curve \
               servo_elevator_curve"
        .split_whitespace()
    {
        assert!(ids.contains(&id), "{id}");
    }
    let mut once = ids.clone();
    once.sort_unstable();
    once.dedup();
    assert_eq!(once.len(), ids.len());
}

#[test]
fn every_entry_is_whole() {
    let known: Vec<String> = catalogue()
        .iter()
        .map(|about| about.id.to_owned())
        .chain(Kind::ALL.iter().flat_map(|k| {
            let about = k.describe();
            about.coefficients.iter().map(move |c| format!("{}.{}", about.id, c.name))
        }))
        .chain(["gyro bias".into(), "accelerometer bias".into()])
        .collect();
    for about in catalogue() {
        let entry = about.entry.unwrap();
        let texts = [about.description, about.formula, about.source, entry.separated_by];
        assert!(texts.iter().all(|t| !t.is_empty()), "{}", about.id);
        assert!(!entry.look_alikes.is_empty(), "{}", about.id);
        for other in entry.look_alikes {
            assert!(known.iter().any(|k| k == other), "{} is like {other}?", about.id);
        }
        for c in about.coefficients {
            assert!(c.bounds.0 < c.bounds.1 && !c.meaning.is_empty(), "{} {}", about.id, c.name);
        }
        for start in entry.starts {
            assert_eq!(start.len(), about.coefficients.len(), "{}", about.id);
            for (c, v) in about.coefficients.iter().zip(*start) {
                assert!((c.bounds.0..=c.bounds.1).contains(v), "{} {}", about.id, c.name);
            }
        }
    }
}

/// An effect acts in the channels of its entry, and each linear coefficient acts somewhere.
#[test]
fn effects_act_in_the_channels_they_name() {
    for kind in Kind::ALL.iter().copied() {
        let about = kind.describe();
        let Some(entry) = about.entry else { continue };
        // these change the body, not the forces
        if ["mass_error", "inertia_xz"].contains(&about.id) {
            continue;
        }
        let shape: &[f64] = match about.id {
            "lift_stall" => &[0.2, 50.0],
            "ground_effect" => &[599.0],
            _ => &[],
        };
        assert_eq!(shape.len(), about.shape, "{}", about.id);
        let made = made(kind, shape, &base());
        for (_, channel, amount) in &made {
            let silent = *amount == 0.0;
            assert!(silent || entry.channels.contains(channel), "{} in {channel:?}", about.id);
        }
        for channel in entry.channels {
            let acts = made.iter().any(|(_, c, amount)| c == channel && *amount != 0.0);
            assert!(acts, "{} not in {channel:?}", about.id);
        }
        for index in 0..about.coefficients.len() - about.shape {
            assert!(made.iter().any(|(i, _, a)| *i == index && *a != 0.0), "{} {index}", about.id);
        }
    }
}

/// The load pulls along gravity, whatever the axes in which a model's forces act.
#[test]
fn external_load_pulls_down() {
    let air = AirData::new(&STATE, 1.156, 600.0, &GEOMETRY);
    for axes in [ForceAxes::Wind, ForceAxes::Stability] {
        let base = Base::zero();
        let at = Point {
            state: &STATE,
            controls: &CONTROLS,
            air: &air,
            geometry: &GEOMETRY,
            axes,
            base: &base,
        };
        let (mut reported, mut wrench) = (Reported(Vec::new()), Wrench::zero());
        Kind::ExternalLoad.dependent_basis(&at, Own::default(), &mut reported);
        reported.0.iter().for_each(|(_, channel, amount)| wrench.add(*channel, *amount));
        let force = rigid_body::body_force(&wrench, &air, axes);
        let down = rigid_body::body_to_horizon(&STATE, force);
        assert!(down[0].abs() < 1e-15 && down[1].abs() < 1e-15 && (down[2] - 1.0).abs() < 1e-15);
    }
}

/// Lift of `lift_stall` per unit k at `alpha`, the linear lift being `linear` N.
fn stalled<R: Real>(alpha: f64, shape: &[f64], linear: f64) -> (R, AirData<R>) {
    let state = State { alpha, ..STATE }.map(R::from_f64);
    let controls = Controls {
        aileron: R::zero(),
        elevator: R::zero(),
        throttle: R::zero(),
        rudder: R::zero(),
        lagged: None,
    };
    let air = AirData::new(&state, R::from_f64(1.156), 600.0, &GEOMETRY);
    let mut base = Base::zero();
    base.still.add(Channel::Lift, R::from_f64(linear));
    let at = Point {
        state: &state,
        controls: &controls,
        air: &air,
        geometry: &GEOMETRY,
        axes: ForceAxes::Wind,
        base: &base,
    };
    let mut reported = Reported(Vec::new());
    Kind::LiftStall.dependent_basis(&at, Own { shape, ..Own::default() }, &mut reported);
    let [(0, Channel::Lift, lift)] = reported.0[..] else { panic!("one term of lift") };
    (lift, air)
}

/// The limits of BM12 eqs. (4.9), (4.10): nothing lost well below α0, half at α0, and a flat plate's
/// lift far beyond, at both signs.
#[test]
fn stall_has_its_textbook_limits() {
    let shape = [0.25, 50.0];
    let (before, _) = stalled::<f64>(0.05, &shape, 40.0);
    // e^(−M (α0 − α)) = e^−10 of the lift is lost, some of it made up by the plate
    assert!(before.abs() < 40.0 * 5e-5, "{before}");
    for sign in [1.0, -1.0] {
        let plate = |alpha: f64, air: &AirData| {
            2.0 * air.q_s * alpha.signum() * alpha.sin().powi(2) * alpha.cos()
        };
        let alpha = sign * 0.25;
        let (half, air) = stalled::<f64>(alpha, &shape, sign * 60.0);
        assert!((half - 0.5 * (plate(alpha, &air) - sign * 60.0)).abs() < 1e-6, "{half}");
        let alpha = sign * 0.7;
        let (beyond, air) = stalled::<f64>(alpha, &shape, sign * 60.0);
        assert!((beyond - (plate(alpha, &air) - sign * 60.0)).abs() < 1e-6, "{beyond}");
    }
}

/// Angles of a tumbling aircraft, sharpnesses at both bounds: no lane loses its number, and lanes say
/// what doubles say, to the precision of f32.
#[test]
fn stall_is_finite_at_every_angle_in_lanes() {
    for sharpness in [5.0, 50.0, 500.0] {
        for alpha0 in [0.05, 0.6] {
            let shape = [alpha0, sharpness];
            for step in -100..=100 {
                let alpha = f64::from(step) * 0.01 * std::f64::consts::PI;
                let (lanes, _) = stalled::<Lanes<16>>(alpha, &shape, 40.0);
                let (exact, _) = stalled::<f64>(alpha, &shape, 40.0);
                let apart = (f64::from(lanes.0[7]) - exact).abs();
                // an exponent of up to 1600 in f32 has an error of 1e-4, and so has its exponential
                assert!(apart < 0.05, "{alpha} {shape:?}: {} for {exact}", lanes.0[7]);
            }
        }
    }
}

/// What `kind` makes of `input`, from rest at its first value.
fn response(kind: inputs::Kind, constant: f64, input: &[f64]) -> Vec<f64> {
    let mut past = Past::at_rest(input[0]);
    input.iter().map(|u| kind.act(constant, &mut past, *u)).collect()
}

/// A step from 0 to 0.3 rad after 5 of 100 samples.
fn step() -> Vec<f64> {
    (0..100).map(|k| if k < 5 { 0.0 } else { 0.3 }).collect()
}

#[test]
fn lag_rises_as_the_exponential() {
    let out = response(inputs::Kind::ActuatorLag, 0.08, &step());
    let (gain, keep) = (0.01_f64 / 0.17, 0.15_f64 / 0.17);
    for (k, y) in out.iter().enumerate().skip(5) {
        let closed = 0.3 * (1.0 - (1.0 - gain) * keep.powi(k as i32 - 5));
        assert!((y - closed).abs() < 1e-12, "{k}: {y} for {closed}");
        // the bilinear rule takes the step as a ramp from sample 4 to 5, so half a sample early; its
        // pole is right to (Δt/τ)³/12 a sample
        let exact = 0.3 * (1.0 - (-(k as f64 - 4.5) * 0.01 / 0.08).exp());
        assert!((y - exact).abs() < 0.3 * 0.125_f64.powi(2) / 8.0, "{k}: {y} for {exact}");
    }
    let still = response(inputs::Kind::ActuatorLag, 0.08, &[0.1; 5]);
    assert!(still.iter().all(|y| (y - 0.1).abs() < 1e-15), "a surface at rest stays: {still:?}");
}

#[test]
fn delay_is_exact_for_whole_samples_and_linear_between() {
    let wave: Vec<f64> = (0..200).map(|k| 0.3 * (f64::from(k) * 0.05).sin()).collect();
    for delay in [0.0, 0.01, 0.07, (PAST - 2) as f64 * 0.01] {
        let samples = (delay * 100.0_f64).round() as usize;
        let out = response(inputs::Kind::TimeDelay, delay, &wave);
        for k in 60..200 {
            assert!((out[k] - wave[k - samples]).abs() < 1e-12, "{delay} s, sample {k}");
        }
    }
    let out = response(inputs::Kind::TimeDelay, 0.034, &wave);
    for (k, y) in out.iter().enumerate().skip(60) {
        let exact = 0.3 * ((k as f64 - 3.4) * 0.05).sin();
        // linear interpolation misses a curve by at most ω² Δt²/8 of its height
        assert!((y - exact).abs() < 0.3 * 0.05_f64.powi(2) / 8.0 + 1e-12, "sample {k}");
    }
    // beyond the memory, or less than nothing: the nearest delay there is
    assert_eq!(response(inputs::Kind::TimeDelay, -1.0, &wave), wave);
    assert!(response(inputs::Kind::TimeDelay, 9.0, &wave)[100] == wave[100 - (PAST - 2)]);
}

#[test]
fn dead_zone_takes_its_half_width_off_both_sides() {
    let input = [-0.3, -0.05, -0.02, 0.0, 0.02, 0.05, 0.3];
    let out = response(inputs::Kind::DeadZone, 0.05, &input);
    for (y, exact) in out.iter().zip([-0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25]) {
        assert!((y - exact).abs() < 1e-15);
    }
}

#[test]
fn backlash_follows_half_its_width_behind_and_crosses_it_on_turning() {
    let out =
        response(inputs::Kind::Backlash, 0.04, &[0.0, 0.01, 0.02, 0.1, 0.09, 0.07, 0.06, 0.0]);
    for (y, exact) in out.iter().zip([0.0, 0.0, 0.0, 0.08, 0.08, 0.08, 0.08, 0.02]) {
        assert!((y - exact).abs() < 1e-15, "{y} for {exact}");
    }
}

#[test]
fn rate_limit_is_a_ramp() {
    let out = response(inputs::Kind::RateLimit, 2.0, &step());
    for (k, y) in out.iter().enumerate().skip(4) {
        let exact = (0.02 * (k as f64 - 4.0)).min(0.3);
        assert!((y - exact).abs() < 1e-14, "{k}: {y} for {exact}");
    }
}

/// The gain is 1 + k on the positive and 1 − k on the negative side; a servo remembers nothing.
#[test]
fn servos_gain_depends_on_the_side_alone() {
    for kind in [inputs::Kind::ServoElevator, inputs::Kind::ServoAileron] {
        let input = [-0.3, 0.2, 0.0, -0.1, 0.3];
        let out = response(kind, 0.2, &input);
        for (y, exact) in out.iter().zip([-0.24, 0.24, 0.0, -0.08, 0.36]) {
            assert!((y - exact).abs() < 1e-15, "{y} for {exact}");
        }
        assert_eq!(response(kind, 0.0, &input), input, "k = 0 changes nothing");
        let backwards: Vec<f64> = input.iter().rev().copied().collect();
        let mut turned = response(kind, 0.2, &backwards);
        turned.reverse();
        assert_eq!(turned, out, "the order of the inputs does not matter");
        // linear in k, with the slope |δ|
        let more = response(kind, 0.3, &input);
        for ((a, b), u) in out.iter().zip(&more).zip(input) {
            assert!(((b - a) / 0.1 - u.abs()).abs() < 1e-12);
        }
        let about = kind.describe();
        assert_eq!((about.shape, about.entry.unwrap().starts.len()), (0, 0), "{}", about.id);
    }
}

/// Each servo changes its own surface, all SIMD lanes by their own sign.
#[test]
fn a_servo_changes_its_own_surface() {
    let acting = |id: &str| {
        let mut model = model("prior");
        model.join(id, &[0.25]).unwrap();
        model.act(&CONTROLS, &mut inputs::InputMemory::at_rest(&CONTROLS, [0.0; 2]))
    };
    let aileron = acting("servo_aileron");
    assert_eq!(aileron, Controls { aileron: 1.25 * CONTROLS.aileron, ..CONTROLS });
    let elevator = acting("servo_elevator");
    assert_eq!(elevator, Controls { elevator: 0.75 * CONTROLS.elevator, ..CONTROLS });
    let lanes = Lanes::<16>(std::array::from_fn(|k| if k % 2 == 0 { 0.1 } else { -0.1 }));
    let mut past = Past::at_rest(lanes);
    let out = inputs::Kind::ServoElevator.act(0.5, &mut past, lanes);
    for (k, y) in out.0.into_iter().enumerate() {
        let exact: f32 = if k % 2 == 0 { 0.15 } else { -0.05 };
        assert!((y - exact).abs() < 1e-6, "lane {k}: {y}");
    }
}

/// The gain is 1 + c |δ|, alike on both sides of neutral; a servo remembers nothing.
#[test]
fn servos_curve_changes_the_gain_with_deflection() {
    for kind in [inputs::Kind::ServoElevatorCurve, inputs::Kind::ServoAileronCurve] {
        let input = [-0.3, 0.2, 0.0, -0.1, 0.3];
        let out = response(kind, 0.5, &input);
        for (y, exact) in out.iter().zip([-0.345, 0.22, 0.0, -0.105, 0.345]) {
            assert!((y - exact).abs() < 1e-15, "{y} for {exact}");
        }
        assert_eq!(response(kind, 0.0, &input), input, "c = 0 changes nothing");
        let backwards: Vec<f64> = input.iter().rev().copied().collect();
        let mut turned = response(kind, 0.5, &backwards);
        turned.reverse();
        assert_eq!(turned, out, "the order of the inputs does not matter");
        // linear in c, with the slope δ |δ|
        let less = response(kind, -0.5, &input);
        for ((a, b), u) in less.iter().zip(&out).zip(input) {
            assert!((b - a - u * u.abs()).abs() < 1e-15);
        }
        let about = kind.describe();
        assert_eq!((about.shape, about.entry.unwrap().starts.len()), (0, 0), "{}", about.id);
    }
}

/// Each curve changes its own surface, all SIMD lanes by their own deflection.
#[test]
fn a_servos_curve_changes_its_own_surface() {
    let acting = |id: &str| {
        let mut model = model("prior");
        model.join(id, &[0.5]).unwrap();
        model.act(&CONTROLS, &mut inputs::InputMemory::at_rest(&CONTROLS, [0.0; 2]))
    };
    // aileron 0.2, elevator −0.1
    let (aileron, elevator) = (acting("servo_aileron_curve"), acting("servo_elevator_curve"));
    assert!((aileron.aileron - 0.22).abs() < 1e-15, "{}", aileron.aileron);
    assert_eq!(Controls { aileron: CONTROLS.aileron, ..aileron }, CONTROLS);
    assert!((elevator.elevator + 0.105).abs() < 1e-15, "{}", elevator.elevator);
    assert_eq!(Controls { elevator: CONTROLS.elevator, ..elevator }, CONTROLS);
    let lanes = Lanes::<16>(std::array::from_fn(|k| if k % 2 == 0 { 0.1 } else { -0.2 }));
    let mut past = Past::at_rest(lanes);
    let out = inputs::Kind::ServoElevatorCurve.act(0.5, &mut past, lanes);
    for (k, y) in out.0.into_iter().enumerate() {
        let exact: f32 = if k % 2 == 0 { 0.105 } else { -0.22 };
        assert!((y - exact).abs() < 1e-6, "lane {k}: {y}");
    }
}

fn model(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// Effects join in any order: those that need what others make are evaluated after them.
#[test]
fn the_order_of_joining_changes_nothing() {
    let joined = |order: &[usize]| {
        let effects: [(&str, &[f64]); 7] = [
            ("unsteady_lift", &[3.0, -1.5]),
            ("propwash", &[0.8]),
            ("cg_shift", &[0.02]),
            ("roll_control_alpha", &[-0.6, 0.1]),
            ("lift_stall", &[1.0, 0.2, 50.0]),
            ("dead_zone", &[0.02]),
            ("actuator_lag", &[0.04]),
        ];
        let mut model = model("prior");
        order.iter().for_each(|i| model.join(effects[*i].0, effects[*i].1).unwrap());
        let mut memory = inputs::InputMemory::at_rest(&Controls::default(), [0.0; 2]);
        let acting = model.act(&CONTROLS, &mut memory);
        model.rate(&STATE, &acting, 600.0)
    };
    let straight = joined(&[0, 1, 2, 3, 4, 5, 6]);
    for order in [[6, 5, 4, 3, 2, 1, 0], [3, 6, 0, 4, 1, 5, 2]] {
        assert_eq!(joined(&order), straight, "to the bit: the order of evaluation is one");
    }
}

/// What one unit of each linear coefficient makes adds up to the whole, for every effect there is.
#[test]
fn contributions_add_up_to_the_wrench() {
    let mut model = model("jsbsim");
    for kind in Kind::ALL {
        let about = kind.describe();
        if about.table.or(about.grid).is_none() && !model.has(about.id) {
            let middle = |c: &greylag::physics::effects::Coefficient| 0.02 * c.bounds.1;
            let mut values: Vec<f64> = about.coefficients.iter().map(middle).collect();
            if about.id == "lift_stall" {
                values = vec![1.0, 0.2, 50.0];
            }
            model.join(about.id, &values).unwrap();
        }
    }
    let air = model.air(&STATE, 600.0);
    let whole = model.wrench(&STATE, &CONTROLS, &air);
    let mut sum = Wrench::zero();
    model.contributions(&STATE, &CONTROLS, &air, |index, channel, amount: f64| {
        sum.add(channel, amount * model.coefficients()[index].value);
    });
    for channel in Channel::ALL {
        let (a, b) = (sum.get(channel), whole.get(channel));
        assert!((a - b).abs() <= 1e-9 * b.abs().max(1.0), "{channel:?}: {a} {b}");
    }
}

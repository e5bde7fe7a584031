//! Laws that any model of this program keeps, whatever its coefficients.

use std::path::Path;

use greylag::model::{GreyBox, Memory, STEP, Trim, linearise};
use greylag::num::{Lanes, Real, stream};
use greylag::physics::rigid_body;
use greylag::physics::{Controls, State};
use rand::RngExt;

fn models() -> Vec<GreyBox> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    ["prior", "prior-severe", "jsbsim"]
        .map(|name| GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap())
        .into()
}

/// Conditions all over the envelope, stall included.
fn conditions(count: usize) -> Vec<(State, Controls)> {
    let mut rng = stream::stream(11, &[]);
    let mut within = |half: f64| rng.random_range(-half..half);
    (0..count)
        .map(|_| {
            let state = State {
                roll: within(1.2),
                pitch: within(0.8),
                airspeed: 22.0 + within(9.0),
                p: within(3.0),
                q: within(2.0),
                r: within(2.0),
                alpha: within(0.35),
                beta: within(0.25),
            };
            let controls = Controls {
                aileron: within(0.5),
                elevator: within(0.5),
                throttle: 0.5 + within(0.5),
                rudder: 0.0,
                lagged: None,
            };
            (state, controls)
        })
        .collect()
}

/// An aircraft without asymmetry flies the mirrored flight under mirrored controls.
#[test]
fn left_is_the_mirror_of_right() {
    let mirror = |s: &State| State { roll: -s.roll, p: -s.p, r: -s.r, beta: -s.beta, ..*s };
    for model in models() {
        for (state, controls) in conditions(200) {
            let right = model.rate(&state, &controls, 600.0);
            let mirrored = Controls { aileron: -controls.aileron, ..controls };
            let left = model.rate(&mirror(&state), &mirrored, 600.0);
            for (a, b) in mirror(&right).to_array().into_iter().zip(left.to_array()) {
                // rounding of sums up to 1e3
                assert!((a - b).abs() <= 1e-10, "{}: {a} {b}", model.name);
            }
        }
    }
}

/// Without air and thrust the body conserves angular momentum's size and its rotational energy.
#[test]
fn a_body_without_moments_keeps_energy_and_momentum() {
    let model = &models()[0];
    let body = model.body;
    let inertia =
        |[p, q, r]: [f64; 3]| [body.jx * p - body.jxz * r, body.jy * q, body.jz * r - body.jxz * p];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (state, _) in conditions(200) {
        let spin = rigid_body::angular_acceleration(&body, &state, [0.0; 3]);
        let (w, h) = ([state.p, state.q, state.r], inertia([state.p, state.q, state.r]));
        // d/dt (½ ω·Jω) = ω·Jω̇, d/dt (½ |Jω|²) = Jω·Jω̇
        assert!(dot(w, inertia(spin)).abs() < 1e-12);
        assert!(dot(h, inertia(spin)).abs() < 1e-12);
    }
}

/// The single-precision lanes of the planner and the double-precision model are one equation.
#[test]
fn lanes_follow_double_precision() {
    for model in models() {
        let scale = model.scale();
        for (state, controls) in conditions(100) {
            let exact = model.rate(&state, &controls, 600.0).to_array();
            let lane = Lanes::<8>::from_f64;
            let lanes = Controls {
                aileron: lane(controls.aileron),
                elevator: lane(controls.elevator),
                throttle: lane(controls.throttle),
                rudder: lane(controls.rudder),
                lagged: None,
            };
            let fast = model.rate(&state.map(lane), &lanes, 600.0).to_array();
            for i in 0..8 {
                let error = (f64::from(fast[i].0[3]) - exact[i]).abs() / scale[i];
                // terms of up to 1e2 (scaled) lose seven digits
                assert!(error < 2e-5, "{}: component {i} off by {error:e}", model.name);
            }
        }
    }
}

/// The exact derivatives behind LQI and trim against central differences.
#[test]
fn linearisation_agrees_with_differences() {
    for model in models() {
        let trim = Trim::attitude(&model, 0.5, 0.1, 22.0, 600.0).unwrap();
        let linear = linearise(&model, &trim, 600.0);
        let step = |x: [f64; 11]| {
            let [s @ .., aileron, elevator, throttle] = x;
            let controls = Controls { aileron, elevator, throttle, rudder: 0.0, lagged: None };
            model.step(&State::from_array(s), &controls, 600.0, &mut Memory::default()).to_array()
        };
        let mut at = [0.0; 11];
        at[..8].copy_from_slice(&trim.state.to_array());
        (at[8], at[9], at[10]) =
            (trim.controls.aileron, trim.controls.elevator, trim.controls.throttle);
        for j in 0..11 {
            let h = 1e-5;
            let (mut up, mut down) = (at, at);
            up[j] += h;
            down[j] -= h;
            let (up, down) = (step(up), step(down));
            for i in 0..8 {
                let difference = (up[i] - down[i]) / (2.0 * h);
                let exact = if j < 8 { linear.a[(i, j)] } else { linear.b[(i, j - 8)] };
                // central differences at 1e-5: rounding 1e-15 · 20 / 1e-5
                assert!(
                    (exact - difference).abs() < 1e-7,
                    "{}: ∂{i}/∂{j} {exact} {difference}",
                    model.name
                );
            }
        }
    }
}

/// RK4 is of fourth order: halving the effective step divides the error by sixteen.
#[test]
fn runge_kutta_is_of_fourth_order() {
    let model = &models()[0];
    let (state, controls) = conditions(1)[0];
    // the rule written out, over `n` parts of the step
    let chain = |n: usize| {
        let h = STEP / n as f64;
        let mut s = state;
        for _ in 0..n {
            let k1 = model.rate(&s, &controls, 600.0);
            let k2 = model.rate(&s.advance(&k1, h / 2.0), &controls, 600.0);
            let k3 = model.rate(&s.advance(&k2, h / 2.0), &controls, 600.0);
            let k4 = model.rate(&s.advance(&k3, h), &controls, 600.0);
            s = s
                .advance(&k1, h / 6.0)
                .advance(&k2, h / 3.0)
                .advance(&k3, h / 3.0)
                .advance(&k4, h / 6.0);
        }
        s.to_array()
    };
    let fine = chain(64);
    let error =
        |a: [f64; 8]| -> f64 { (0..8).map(|i| (a[i] - fine[i]).powi(2)).sum::<f64>().sqrt() };
    let ours = model.step(&state, &controls, 600.0, &mut Memory::default()).to_array();
    assert_eq!(ours, chain(1));
    // at 0.01 s the roll mode (−33 1/s) is too fast for the leading term to rule; at 0.0025 s it does
    let (whole, half) = (error(chain(4)), error(chain(8)));
    println!(
        "RK4: error of 0.01 s in one step {:.2e}, four {whole:.2e}, eight {half:.2e}",
        error(ours)
    );
    assert!((14.0..18.0).contains(&(whole / half)), "ratio {}", whole / half);
}

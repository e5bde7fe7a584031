//! The hand-written gradient of the rollout loss, against differences and between scalars.

use crate::learn_support::{flight, model, network};
use greylag::learn::dynamics::windows::{Track, Window};
use greylag::learn::{
    Arithmetic, Engine, Gradient, Objective, Passes, Penalty, PriorSlopes, Subject,
};
use greylag::model::residual::Scales;
use greylag::model::{GreyBox, Integrator};
use greylag::num::Dense;
use greylag::physics::rigid_body::RigidBody;

/// Steps of a rollout: more than one chunk of points at four a step.
const STEPS: usize = 7;

/// Ids of effects with the values of their coefficients.
type Effects<'a> = &'a [(&'a str, &'a [f64])];

/// Effects that act on what others make, in every way there is: on their forces, on what deflections and rates make
/// of them, on the state's rate; and one that changes the mass.
const ON_OTHERS: Effects = &[
    ("propwash", &[0.5]),
    ("cg_shift", &[0.01]),
    ("unsteady_lift", &[2.0, -1.0]),
    ("thrust_line_offset", &[0.02]),
    ("thrust_decay", &[0.3]),
    ("mass_error", &[0.1]),
];

fn subject(prior: &GreyBox, network: Dense) -> Subject {
    Subject {
        scales: Scales::new(&prior.airframe, prior.scale()),
        prior: prior.clone(),
        network: Passes::new(network),
        prior_slopes: PriorSlopes::All,
    }
}

fn objective(prior: &GreyBox, penalty: Penalty) -> Objective {
    Objective { scale: prior.scale(), penalty, unit: 0.02, lambda: 3.0 }
}

fn scene(integrator: Integrator, effects: Effects) -> (GreyBox, Vec<Track>, Vec<Window>) {
    let mut prior = model("prior-severe");
    prior.integrator = integrator;
    effects.iter().for_each(|(id, values)| prior.join(id, values).unwrap());
    let tracks =
        vec![flight(&model("jsbsim"), &prior, 4, 200), flight(&model("jsbsim"), &prior, 5, 90)];
    // a third block that is not full
    let window =
        |k: u32| Window { track: k % 2, start: 1 + 2 * k, weight: 1.0 + 0.5 * f64::from(k % 3) };
    (prior, tracks, (0..37).map(window).collect())
}

fn gradient(
    prior: &GreyBox,
    network: Dense,
    objective: &Objective,
    tracks: &[Track],
    windows: &[Window],
    arithmetic: Arithmetic,
) -> (f64, Gradient) {
    let subject = subject(prior, network);
    let mut engine = Engine::new(&subject, windows.len(), STEPS, arithmetic);
    let (loss, gradient) = engine.step(&subject, objective, tracks, windows, STEPS);
    assert_eq!(loss.lost, 0);
    (loss.objective, gradient.clone())
}

/// The objective alone, in double precision.
fn value(
    prior: &GreyBox,
    network: &Dense,
    objective: &Objective,
    tracks: &[Track],
    windows: &[Window],
) -> f64 {
    let subject = subject(prior, network.clone());
    let mut engine = Engine::new(&subject, windows.len(), STEPS, Arithmetic::Double);
    engine.loss(&subject, objective, tracks, windows, STEPS).objective
}

/// Central differences in f64 agree with the gradient in every group of parameters.
fn against_differences(integrator: Integrator, penalty: Penalty, effects: Effects) {
    let (prior, tracks, windows) = scene(integrator, effects);
    let windows = &windows[..5];
    let objective = objective(&prior, penalty);
    let network = network(10, 0.3);
    let double = Arithmetic::Double;
    let (_, gradient) = gradient(&prior, network.clone(), &objective, &tracks, windows, double);
    let mut worst = 0.0_f64;
    let mut check = |name: &str, ours: f64, theirs: f64, size: f64| {
        // what differences of h = 1e-5 to 6e-5 leave out: h² of the third derivative, rounding over h
        let error = (ours - theirs).abs() / (ours.abs() + 1e-3 * size);
        worst = worst.max(error);
        assert!(error < 2e-5, "{name}: {ours} by hand, {theirs} by differences");
    };
    let size = gradient.network.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    for k in (0..network.parameters().len()).step_by(3) {
        // the weights are single: what they were really moved by counts
        let moved = |h: f32| {
            let mut network = network.clone();
            network.parameters_mut()[k] += h;
            let there = f64::from(network.parameters()[k]);
            (there, value(&prior, &network, &objective, &tracks, windows))
        };
        let h = 2.0_f32.powi(-14);
        let (up, down) = (moved(h), moved(-h));
        let theirs = (up.1 - down.1) / (up.0 - down.0);
        check(&format!("weight {k}"), gradient.network[k], theirs, size);
    }
    let count = prior.coefficients().len();
    for k in 0..=count {
        let (name, scale) = match prior.coefficients().get(k) {
            Some(c) => (c.name.clone(), c.value.abs().max(0.01)),
            None => ("Jxz".into(), 1.0),
        };
        let h = 1e-5 * scale;
        let moved = |h: f64| {
            let mut prior = prior.clone();
            if k < count {
                prior.set_coefficient(&name, prior.coefficients()[k].value + h);
            } else {
                let body = *prior.bare_body();
                prior.set_body(RigidBody { jxz: body.jxz + h, ..body });
            }
            value(&prior, &network, &objective, &tracks, windows)
        };
        // a mass is no force: it is not trained
        if name.starts_with("mass_error") {
            continue;
        }
        let size = gradient.prior[k].abs();
        assert!(size > 0.0, "{name} has no slope");
        check(&name, gradient.prior[k], (moved(h) - moved(-h)) / (2.0 * h), size);
    }
    println!("{integrator:?}, {penalty:?}: worst relative difference {worst:.1e}");
}

#[test]
fn gradient_of_rk4_rollouts_is_that_of_central_differences() {
    against_differences(Integrator::Rk4, Penalty::Ratio, &[]);
    against_differences(Integrator::Rk4, Penalty::Absolute, &[]);
}

#[test]
fn gradient_of_rollouts_in_the_simulators_scheme_is_that_of_central_differences() {
    against_differences(Integrator::Jsbsim, Penalty::Ratio, &[]);
    against_differences(Integrator::Jsbsim, Penalty::Absolute, &[]);
}

#[test]
fn gradient_through_effects_that_act_on_what_others_make_is_that_of_central_differences() {
    against_differences(Integrator::Rk4, Penalty::Ratio, ON_OTHERS);
    against_differences(Integrator::Jsbsim, Penalty::Ratio, ON_OTHERS);
}

/// The gradient in lanes is that in f64, to single precision.
#[test]
fn lanes_agree_with_double_precision() {
    let all = [(Integrator::Rk4, ON_OTHERS), (Integrator::Rk4, &[]), (Integrator::Jsbsim, &[])];
    for (integrator, effects) in all {
        let (prior, tracks, windows) = scene(integrator, effects);
        let objective = objective(&prior, Penalty::Ratio);
        let run = |arithmetic| {
            gradient(&prior, network(16, 0.3), &objective, &tracks, &windows, arithmetic)
        };
        let (exact, expected) = run(Arithmetic::Double);
        let (loss, found) = run(Arithmetic::Lanes);
        assert!((loss / exact - 1.0).abs() < 1e-4, "{loss} {exact}");
        // single precision through 7 steps, against the largest slope of the group
        let apart = |a: &[f64], b: &[f64]| {
            let size = b.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
            a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs())) / size
        };
        let errors =
            [apart(&found.network, &expected.network), apart(&found.prior, &expected.prior)];
        println!("{integrator:?}: network {:.1e}, prior {:.1e}", errors[0], errors[1]);
        assert!(errors.iter().all(|e| *e < 1e-4));
    }
}

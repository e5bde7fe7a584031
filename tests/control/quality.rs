//! The measures of a flight, in JSBSim and in a model.

use std::path::Path;

use greylag::control::quality::{Limits, MEASURES};
use greylag::control::{ControllerKind, Source, Target, build};
use greylag::model::{GreyBox, Twin};
use greylag::num::stream::stream;
use greylag::physics::{Controls, State, rigid_body};
use greylag::sim::evaluation::{Evaluation, evaluate_courses};
use greylag::sim::steps::steps;
use greylag::sim::{Environment, Episode, Imagined, Simulator};
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;

fn model(name: &str) -> GreyBox {
    GreyBox::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8").join(name)).unwrap()
}

/// In steady flight the air carries the weight: 1 level, 1/cos 45° in a level turn of 45° of bank, in both worlds.
#[test]
fn the_load_factor_of_a_steady_turn_is_that_of_its_bank() {
    let model = model("jsbsim.toml");
    let mut worlds: [Box<dyn Environment>; 2] = [
        Box::new(Simulator::new(&PlantOptions::default()).unwrap()),
        Box::new(Imagined::new(model.clone())),
    ];
    for environment in worlds.iter_mut().map(AsMut::as_mut) {
        // 2° is about the pitch of level flight there: beside it the path bends little
        for (bank, expected) in [(0.0_f64, 1.0), (45.0, 2f64.sqrt())] {
            let source = Source { model: &model, agent: None, changes: &[] };
            let mut controller = build(ControllerKind::Lqi, source).unwrap();
            let target =
                Target { roll: bank.to_radians(), pitch: 2f64.to_radians(), airspeed: 20.0 };
            let episode = Episode { environment, controller: controller.as_mut(), seed: 1 };
            let outcome = episode.fly(&target, |_, _| ()).unwrap();
            let last = outcome.track.moments.last().unwrap();
            // a path that still bends downwards or upwards makes a few per cent
            assert!((last.load_factor / expected - 1.0).abs() < 0.06, "{bank}: {last:?}");
            let quality = outcome.track.quality(&Limits::of(&model.airframe));
            assert!(quality.to_one_deg_s < 5.0, "{quality:?}");
        }
    }
}

/// The specific force is what the motion says: the change of the velocity in body axes, less gravity; residual included.
#[test]
fn the_specific_force_of_a_model_is_that_of_its_motion() {
    let model = model("learned/model.toml");
    let altitude = model.airframe.reference.altitude;
    for number in 0..50 {
        let mut random = stream(3, &[number]);
        let mut draw = |middle: f64, by: f64| middle + random.random_range(-by..by);
        let state = State {
            roll: draw(0.0, 1.0),
            pitch: draw(0.0, 0.5),
            airspeed: draw(20.0, 6.0),
            p: draw(0.0, 2.0),
            q: draw(0.0, 1.0),
            r: draw(0.0, 1.0),
            alpha: draw(0.05, 0.15),
            beta: draw(0.0, 0.15),
        };
        let controls = Controls {
            aileron: draw(0.0, 0.4),
            elevator: draw(0.0, 0.4),
            throttle: draw(0.5, 0.5),
            ..Controls::default()
        };
        let rate = model.rate(&state, &controls, altitude);
        let velocity = |by: f64| {
            let there = state.advance(&rate, by);
            rigid_body::air_velocity(&there, &model.air(&there, altitude))
        };
        let (now, ahead, behind) = (velocity(0.0), velocity(1e-5), velocity(-1e-5));
        let gravity = rigid_body::gravity_in_body(&state, model.atmosphere.gravity);
        let [p, q, r] = [state.p, state.q, state.r];
        let turned = [q * now[2] - r * now[1], r * now[0] - p * now[2], p * now[1] - q * now[0]];
        let force = Twin::at_rest(state, &controls, altitude).specific_force(&model);
        for k in 0..3 {
            let moved = (ahead[k] - behind[k]) / 2e-5 + turned[k] - gravity[k];
            // central differences over 2e-5 s: rounding of velocities of 20 m/s by that is 1e-10 / 2e-5
            assert!((force[k] - moved).abs() < 1e-4, "{number}, axis {k}: {force:?} {moved}");
        }
    }
}

/// Steps are flown from attitude to attitude: the first leg does not count, and what is flown is told apart.
#[test]
fn steps_are_scored_from_one_attitude_to_the_other() {
    let model = model("jsbsim.toml");
    let source = Source { model: &model, agent: None, changes: &[] };
    let controller = build(ControllerKind::Lqi, source).unwrap();
    let courses = steps(5, 6, &model.airframe);
    let outcomes = evaluate_courses(
        &PlantOptions::default(),
        &|| controller.boxed_clone(),
        &courses,
        5,
        &|| (),
    )
    .unwrap();
    let limits = Limits::of(&model.airframe);
    let evaluation = Evaluation::measured(["lqi", "jsbsim"], &courses, &outcomes, &limits);
    let score = evaluation.score("steps").unwrap();
    assert_eq!((evaluation.groups.len(), score.count, evaluation.flights.len()), (1, 6, 6));
    for (course, flight) in courses.iter().zip(&evaluation.flights) {
        let (first, last) = (course.first.unwrap().target, course.leg.target);
        let wanted = [last.roll - first.roll, last.pitch - first.pitch].map(f64::to_degrees);
        for (step, wanted) in flight.quality.step_deg.iter().zip(wanted) {
            // the LQI has settled within a degree when the step comes
            assert!((step - wanted).abs() < 1.0, "{step} {wanted}");
        }
        assert!(flight.quality.airspeed_mps[0] > 13.0 && flight.settled_deg < 0.5, "{flight:?}");
    }
    // an aircraft that is flown to has every measure, and its median lies in its interval
    for m in MEASURES {
        let spread = score.measures[m.id];
        let [low, high] = spread.median_ci95;
        assert!(low <= spread.median && spread.median <= high, "{}: {spread:?}", m.id);
    }
}

//! The yardsticks of all later controllers, over the whole target file.

use std::path::Path;

use greylag::control::{self, ControllerKind};
use greylag::model::GreyBox;
use greylag::sim::evaluation::{Evaluation, evaluate};
use greylag::sim::targets::Row;
use greylag::sim::{Environment, Episode, Imagined, Simulator, TargetFile};

fn params(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("params").join(name)
}

fn score(kind: ControllerKind, model: &str, rows: &[Row]) -> Evaluation {
    let model = GreyBox::load(&params("x8").join(format!("{model}.toml"))).unwrap();
    let controller = control::build(kind, &model).unwrap();
    let outcomes =
        evaluate(&Default::default(), &|| controller.boxed_clone(), rows, 1, &|| ()).unwrap();
    let evaluation = Evaluation::new(kind.name(), &model.name, rows, &outcomes);
    for s in &evaluation.groups {
        println!(
            "{} on {}: {} mean {:.4} deg, diverged {:.1} %",
            evaluation.controller,
            evaluation.model,
            s.targets,
            s.mean_deg,
            100.0 * s.divergence_rate
        );
    }
    evaluation
}

fn mean(evaluation: &Evaluation, targets: &str) -> f64 {
    evaluation.score(targets).unwrap().mean_deg
}

#[test]
fn lqi_on_the_exact_model_tracks_every_target() {
    let rows = TargetFile::load(&params("targets.csv")).unwrap().rows;
    let lqi = score(ControllerKind::Lqi, "jsbsim", &rows);
    // the figures that the first issue asks for; reached: 0.001, 0.002, 0.003
    assert!(mean(&lqi, "easy") <= 0.03);
    assert!(mean(&lqi, "hard_corners") <= 0.06);
    assert!(mean(&lqi, "hard_outside") <= 0.08);
    assert!(lqi.groups.iter().all(|s| s.divergence_rate == 0.0));
    // regress: three times what it reaches; the figures vary by a tenth between seeds of the file
    assert!(mean(&lqi, "easy") <= 0.002);
    assert!(mean(&lqi, "hard_corners") <= 0.005);
    assert!(mean(&lqi, "hard_outside") <= 0.009);
}

#[test]
fn public_pid_is_as_published() {
    let rows = TargetFile::load(&params("targets.csv")).unwrap().rows;
    let pid = score(ControllerKind::Pid, "prior", &rows);
    // measured on the public simulator: 0.34 easy, and a quarter of the hard climbs lost
    assert!((mean(&pid, "easy") - 0.34).abs() <= 0.03);
    assert!(pid.score("hard_corners").unwrap().divergence_rate > 0.1);
}

#[test]
fn lqi_on_the_severe_prior_diverges_and_says_so() {
    let rows = TargetFile::load(&params("targets.csv")).unwrap().rows;
    let some: Vec<Row> = rows.into_iter().step_by(20).collect();
    let lqi = score(ControllerKind::Lqi, "prior-severe", &some);
    assert!(lqi.score("all").unwrap().divergence_rate > 0.9);
}

#[test]
fn the_planner_reaches_an_easy_target_and_repeats_itself() {
    let model = GreyBox::load(&params("x8/prior.toml")).unwrap();
    let mut cem = control::build(ControllerKind::Cem, &model).unwrap();
    let mut simulator = Simulator::new(&Default::default()).unwrap();
    let target = control::Target {
        roll: 0.2,
        pitch: 0.05,
        airspeed: greylag::physics::State::NEUTRAL.airspeed,
    };
    let mut fly = || {
        let mut commands = Vec::new();
        let episode = Episode { environment: &mut simulator, controller: cem.as_mut(), seed: 3 };
        let outcome = episode.fly(&target, |_, c| commands.push(*c)).unwrap();
        (outcome.settled_deg, commands)
    };
    let (error, commands) = fly();
    println!("cem at roll 11 deg, pitch 3 deg: {error:.3} deg");
    // the paper's planner is "very good near trim" (section VI-C); its median easy error is near 0.03
    assert!(error < 0.2);
    assert_eq!(fly().1, commands, "the same seed must give the same flight to the bit");
}

#[test]
fn the_imagined_aircraft_flies_like_the_simulator() {
    let model = GreyBox::load(&params("x8/jsbsim.toml")).unwrap();
    let mut lqi = control::build(ControllerKind::Lqi, &model).unwrap();
    let target = control::Target { roll: 0.6, pitch: 0.2, airspeed: 16.67 };
    let (mut real, mut imagined) =
        (Simulator::new(&Default::default()).unwrap(), Imagined::new(model));
    let mut fly = |environment: &mut dyn Environment| {
        let mut rolls = Vec::new();
        let episode = Episode { environment, controller: lqi.as_mut(), seed: 0 };
        episode.fly(&target, |seen, _| rolls.push(seen.state.roll)).unwrap();
        rolls
    };
    let (a, b) = (fly(&mut real), fly(&mut imagined));
    let worst = a.iter().zip(&b).map(|(x, y)| (x - y).abs().to_degrees()).fold(0.0, f64::max);
    println!("closed loop in JSBSim and in its model: roll within {worst:.4} deg over 10 s");
    // the replay of commands alone stays within 0.02°; feedback only makes it smaller
    assert!(worst < 0.02);
}

/// A number that is lost must show, not hide behind a limit.
#[test]
fn lost_numbers_are_not_flown_on() {
    let model = GreyBox::load(&params("x8/prior.toml")).unwrap();
    let target = control::Target { roll: 0.2, pitch: 0.0, airspeed: 16.67 };
    let mut imagined = Imagined::new(model.clone());
    let mut seen = imagined.reset().unwrap();
    let nan =
        greylag::physics::Command { aileron: f64::NAN, elevator: 0.0, throttle: 0.0, rudder: 0.0 };
    assert!(imagined.step(nan).is_err());
    seen.state.airspeed = f64::NAN;
    // policies come from files and are held to the same in their own room
    for kind in ControllerKind::ALL.iter().filter(|kind| !kind.needs().policy()) {
        let mut controller = control::build(*kind, &model).unwrap();
        assert!(
            !controller.command(&seen, &target).is_finite(),
            "{kind} flies without an airspeed"
        );
        let whole = imagined.reset().unwrap();
        assert!(controller.command(&whole, &target).is_finite(), "{kind} does not recover");
    }
}

//! What no effect of the catalogue holds: a formula is proposed, tested on other flights, and mends the model.

use std::path::Path;

use greylag::control::{ControllerKind, build};
use greylag::logs::Flight;
use greylag::model::GreyBox;
use greylag::physics::formula::{Status, file, register};
use greylag::sim::missing::Missing;
use greylag::sim::starting_model::starting_model;
use greylag::sim::trial::Trial;
use greylag::sysid::diagnose::{Options, Verdict, propose};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};

/// Seed of the flights; none of those that thresholds were set with.
const SEED: u64 = 3101;

fn reconstructed(model: &GreyBox, flights: &[Flight]) -> Vec<Reconstruction> {
    let one = |f: &Flight| {
        let options = flight_path::Options {
            gravity: model.atmosphere.gravity,
            actuators_clock: ActuatorClock::AsRecorded,
            ..flight_path::Options::new(&f.name, model.airframe.actuators)
        };
        reconstruct(f, &options).unwrap()
    };
    flights.iter().map(one).collect()
}

/// A thrust line 40 mm to the left: n = 1.16 N m δt, which no effect of the catalogue is.
#[test]
fn a_thrust_line_to_the_left_is_named_and_tested() {
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let effect = register::load(&params.join("effects/yaw_by_throttle.toml")).unwrap()[0];
    let missing = vec![Missing::written(effect, &[1.16]).unwrap()];
    let reference = std::fs::read_to_string(params.join("x8/jsbsim.toml")).unwrap();
    let text = starting_model(&reference, "lacks", SEED, &missing).unwrap();
    let model = GreyBox::parse(&text, &params.join("x8/lacks.toml")).unwrap();
    let exact = GreyBox::load(&params.join("x8/jsbsim.toml")).unwrap();
    let trial = Trial { seed: SEED, missing, turbulence: None, ..Trial::default() };
    let logs = trial.fly(build(ControllerKind::Lqi, &exact).unwrap().as_ref()).unwrap();
    let search = reconstructed(&model, &logs.training);
    let test = reconstructed(&model, &logs.testing);
    let found =
        propose(&model, &search, &test, &Options::default(), &greylag::sysid::progress::unheard)
            .unwrap();
    assert_eq!(found.verdict, Verdict::Unexplained);
    let chosen = found.front.iter().find(|r| r.chosen).unwrap();
    assert_eq!(chosen.formula, "yaw = k*throttle", "{:?}", found.sentences);
    let grades = found.grades.unwrap();
    assert!(grades.channel && grades.variables && grades.trend, "{:?}", found.sentences);
    assert!(found.sentences[0].contains("grows linearly with throttle, not with airspeed"));
    // the true effect takes all beyond noise; four fifths is what the issue asks for
    let held_out = found.held_out.unwrap();
    assert!(held_out.removed > 0.8 && held_out.fall > held_out.threshold, "{held_out:?}");
    let own = file::parse(&found.effect.unwrap()).unwrap();
    assert_eq!(own.status, Status::Proposed);
    // the interval of the amendment with the true effect is ±0.002; a search tunes less
    assert!((own.values[0] - 1.16).abs() < 0.05, "{:?}", own.values);
}

//! Flights of an aircraft whose model lacks something, reconstructed.

use std::path::Path;

use greylag::control::{ControllerKind, build};
use greylag::logs::Flight;
use greylag::model::GreyBox;
use greylag::sim::missing::Missing;
use greylag::sim::starting_model::starting_model;
use greylag::sim::trial::Trial;
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};

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

/// A model of the X8 that lacks `missing`, flights to fit to and flights to test on, all drawn from `seed`.
pub fn flown(missing: Missing, seed: u64) -> (GreyBox, Vec<Reconstruction>, Vec<Reconstruction>) {
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let missing = vec![missing];
    let reference = std::fs::read_to_string(params.join("x8/jsbsim.toml")).unwrap();
    let text = starting_model(&reference, "lacks", seed, &missing).unwrap();
    let model = GreyBox::parse(&text, &params.join("x8/lacks.toml")).unwrap();
    let exact = GreyBox::load(&params.join("x8/jsbsim.toml")).unwrap();
    let trial = Trial { seed, missing, turbulence: None, ..Trial::default() };
    let logs = trial.fly(build(ControllerKind::Lqi, &exact).unwrap().as_ref()).unwrap();
    let fit = reconstructed(&model, &logs.training);
    let test = reconstructed(&model, &logs.testing);
    (model, fit, test)
}

//! The LQI designed on a model with an effect, flown in JSBSim with the same effect hidden.
#![cfg(feature = "sitl")]

mod validate_support;

use greylag::control::{self, Kind, Target};
use greylag::model::GreyBox;
use greylag::sim::{Episode, Simulator};
use greylag_sitl::plant::PlantOptions;
use validate_support::{AMPLITUDES, amended, hidden, model};

/// Degrees of roll and pitch: easy, climbing, and hard.
const TARGETS: [[f64; 2]; 3] = [[30.0, 5.0], [-40.0, -15.0], [55.0, 20.0]];

/// The mean settled error over the targets, degrees, of the LQI designed on `design`.
fn settled(design: &GreyBox, id: &str, amplitude: f64) -> f64 {
    let mut lqi = control::build(Kind::Lqi, design).unwrap();
    let options = PlantOptions { hidden: hidden(id, amplitude), ..PlantOptions::default() };
    let mut simulator = Simulator::new(&options).unwrap();
    let mut sum = 0.0;
    for [roll, pitch] in TARGETS {
        let target = Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 16.67 };
        let episode = Episode { environment: &mut simulator, controller: lqi.as_mut(), seed: 0 };
        sum += episode.fly(&target, |_, _| ()).unwrap().settled_deg;
    }
    sum / TARGETS.len() as f64
}

#[test]
fn lqi_keeps_its_settled_error_with_every_effect_it_knows_of() {
    let plain = model("jsbsim");
    println!("plain: {:.4}", settled(&plain, "drag_alpha2", 0.0));
    for (id, amplitude) in AMPLITUDES {
        let knows = settled(&amended(id, amplitude), id, amplitude);
        let does_not = settled(&plain, id, amplitude);
        println!("{id:25} {amplitude:6}: {knows:.4} deg, {does_not:.4} if it does not know");
    }
}

//! The envelope is kept behind a controller that does not know it, and behind one that plans inside it: by JSBSim's own load
//! factor and angle of attack, not the model's.
#![cfg(feature = "sitl")]

use std::path::Path;

use greylag::control::envelope::Guarded;
use greylag::control::policy::Agent;
use greylag::control::{Controller, ControllerKind, Source, Target, build};
use greylag::model::GreyBox;
use greylag::sim::{Environment, Simulator};
use greylag_sitl::plant::{PlantOptions, Start};

const G: f64 = 9.806_65;

fn model(file: &str) -> GreyBox {
    GreyBox::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8").join(file)).unwrap()
}

fn target([roll, pitch]: [f64; 2]) -> Target {
    Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 20.0 }
}

/// Least and largest load factor, largest angle of attack (degrees), and the last attitude error (degrees) over the steep attitudes of
/// `cargo demo`, five seconds each.
fn extremes(controller: &mut dyn Controller) -> ([f64; 2], f64, f64) {
    let start = Start { airspeed_mps: 20.0, ..Start::NEUTRAL };
    let mut world = Simulator::new(&PlantOptions { start, ..PlantOptions::default() }).unwrap();
    let mut seen = world.reset().unwrap();
    controller.reset(1);
    let (mut load, mut alpha, mut error) = ([1.0_f64; 2], 0.0_f64, 0.0);
    for attitude in [[40.0, -10.0], [-55.0, -27.0], [57.0, 28.0], [-58.0, 8.0]] {
        let target = target(attitude);
        for _ in 0..500 {
            seen = world.step(controller.command(&seen, &target)).unwrap();
            let truth = world.truth();
            let n = -truth.specific_force_mps2[2] / G;
            load = [load[0].min(n), load[1].max(n)];
            alpha = alpha.max(truth.alpha_rad.to_degrees());
        }
        let s = seen.state;
        error = (s.roll - target.roll).abs().max((s.pitch - target.pitch).abs()).to_degrees();
    }
    (load, alpha, error)
}

#[test]
fn the_load_factor_is_kept() {
    let model = model("learned/model.toml");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/learned/policy");
    let agent = Agent::load(&folder, &model.airframe).unwrap();
    let [least, most] =
        [model.airframe.envelope.load_factor_least(), model.airframe.envelope.load_factor_max];
    let source = Source { model: &model, agent: Some(&agent), changes: &[] };
    for kind in [ControllerKind::Lqi, ControllerKind::HybridIlqr] {
        let mut bare = build(kind, source).unwrap();
        let mut guarded = Guarded::new(bare.boxed_clone(), &model);
        let (load, alpha, error) = extremes(&mut guarded);
        // 5 % for transients; the wing stalls at 12.3°
        assert!(load[0] >= 1.05 * least && load[1] <= 1.05 * most, "{kind}: {load:?}");
        assert!(alpha < 12.3, "{kind}: {alpha}");
        if kind == ControllerKind::Lqi {
            assert!(error < 0.5, "{error}");
            let (load, ..) = extremes(bare.as_mut());
            assert!(load[1] > 1.5 * most, "the limiter has nothing to do: {load:?}");
        }
    }
}

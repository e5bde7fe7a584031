//! Plans of `hybrid-ilqr` keep to the load factor: JSBSim's own, not the model's.
#![cfg(feature = "sitl")]

use std::path::Path;

use greylag::control::policy::Agent;
use greylag::control::{ControllerKind, Source, Target, build};
use greylag::model::GreyBox;
use greylag::sim::{Environment, Simulator};
use greylag_sitl::plant::PlantOptions;

const G: f64 = 9.806_65;

#[test]
fn a_steep_climbing_turn_is_flown_within_the_load_factor() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/learned");
    let model = GreyBox::load(&folder.join("model.toml")).unwrap();
    let agent = Agent::load(&folder.join("policy"), &model.airframe).unwrap();
    let source = Source { model: &model, agent: Some(&agent), changes: &[] };
    let mut world = Simulator::new(&PlantOptions::default()).unwrap();
    // least and largest load factor, and the last attitude error, degrees
    let mut fly = |kind: ControllerKind, [roll, pitch]: [f64; 2]| {
        let mut controller = build(kind, source).unwrap();
        controller.reset(1);
        let (roll, pitch) = (roll.to_radians(), pitch.to_radians());
        let target = Target { roll, pitch, airspeed: 16.67 };
        let mut seen = world.reset().unwrap();
        let mut load = [1.0_f64; 2];
        for _ in 0..1000 {
            seen = world.step(controller.command(&seen, &target)).unwrap();
            let n = -world.truth().specific_force_mps2[2] / G;
            load = [load[0].min(n), load[1].max(n)];
        }
        let error = (seen.state.roll - roll).abs().max((seen.state.pitch - pitch).abs());
        (load, error.to_degrees())
    };
    let envelope = model.airframe.envelope;
    let [least, most] = [envelope.load_factor_least(), envelope.load_factor_max];
    for target in [[57.0, 28.0], [-50.0, -27.0]] {
        let (load, error) = fly(ControllerKind::HybridIlqr, target);
        // 5 % for transients
        assert!(load[0] >= 1.05 * least && load[1] <= 1.05 * most, "{target:?}: {load:?}");
        assert!(error < 0.1, "{target:?}: {error}");
        let (bare, _) = fly(ControllerKind::Ilqr, target);
        assert!(bare[1] > 1.2 * most, "there is nothing to keep: {bare:?}");
    }
}

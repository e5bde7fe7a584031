//! Every instruction set flies the same rollout.

use super::*;
use crate::control::disturbance;
use crate::physics::Time;
use std::path::Path;

/// The same candidates are worth the same in every instruction set.
#[test]
fn instruction_sets_agree() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let model = GreyBox::load(&path).unwrap();
    let seen = Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        actuators: ActuatorState::default(),
        altitude: 600.0,
        previous: [Command::IDLE; 2],
    };
    let target = Target { roll: 0.7, pitch: 0.2, airspeed: 16.67 };
    let scene = Scene {
        model: &model,
        task: &Task::PAPER,
        seen: &seen,
        target: &target,
        agent: None,
        alpha: None,
        surrogate: None,
        memory: Memory::default(),
        disturbance: disturbance::NONE,
        ahead: None,
        steps: HORIZON,
        sideslip: None,
    };
    let wave = |k: usize| std::array::from_fn(|i| ((k * 16 + i) as f32 * 0.37).sin());
    // an odd number: the last has no other beside it
    let mut blocks: [Block; 3] = std::array::from_fn(|b| {
        std::array::from_fn(|h| std::array::from_fn(|c| wave(40 * b + 3 * h + c)))
    });
    let mut run = |mut machine: Machine| {
        let mut out = [Worth::NONE; 3];
        machine.fly(&scene, Actions::Given, &mut blocks, &mut out);
        out.map(|worth| worth.returns).concat()
    };
    let baseline = run(Machine::baseline());
    let widest = run(Machine::detect());
    for (a, b) in widest.iter().zip(&baseline) {
        // single precision through five steps, rewards summing up to 5
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the features
        assert_eq!(run(Machine::Avx2(unsafe { room_avx2() })), widest);
    }
}

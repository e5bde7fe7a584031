//! Tests of the rollouts: agreement of the instruction sets, and the slew limit.

use super::*;
use crate::disturbance;
use greylag_physics::Time;
use std::path::Path;

/// The same candidates have the same returns with every instruction set.
#[test]
fn instruction_sets_agree() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
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
    // with an odd number of blocks, the last one is evaluated alone instead of in a pair
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
        // single precision over five steps, rewards with a sum of up to 5
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the features
        assert_eq!(run(Machine::Avx2(unsafe { room_avx2() })), widest);
    }
}

/// A surface moves by 0.2 per step of 10 ms if the airframe allows 20 per second. The throttle is not limited.
#[test]
fn surfaces_of_a_plan_move_no_faster_than_the_airframe_allows() {
    for (aircraft, rudder) in [("x8/jsbsim.toml", 1.0), ("aerosonde/jsbsim.toml", 0.3)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params").join(aircraft);
        let mut model = GreyBox::load(&path).unwrap();
        model.airframe.envelope.surface_slew_per_s = 20.0;
        let last = Command { aileron: 0.1, elevator: 0.1, throttle: 0.0, rudder: 0.1 };
        let far = Command { aileron: 1.0, elevator: -1.0, throttle: 1.0, rudder: 1.0 };
        let got = slewed(far, &last, &model.airframe);
        // an airframe without a rudder does not limit the rudder command
        let wanted = Command { aileron: 0.3, elevator: -0.1, throttle: 1.0, rudder };
        for (got, wanted) in [
            (got.aileron, wanted.aileron),
            (got.elevator, wanted.elevator),
            (got.throttle, wanted.throttle),
            (got.rudder, wanted.rudder),
        ] {
            assert!((got - wanted).abs() < 1e-12, "{aircraft}: {got} for {wanted}");
        }
        let near = Command { aileron: 0.2, elevator: 0.0, throttle: 0.5, rudder: 0.2 };
        assert_eq!(slewed(near, &last, &model.airframe), near);
    }
}

//! Tests of the slew limit of commands in rollouts, the simulations with which the planner predicts the aircraft's motion.

use super::*;
use std::path::Path;

/// A surface command (−1..1) changes by at most 0.2 per step of 10 ms if the airframe allows 20 per second. The throttle is not
/// limited.
#[test]
fn surfaces_of_a_plan_move_no_faster_than_the_airframe_allows() {
    for (aircraft, rudder) in [("x8/jsbsim.toml", 1.0), ("aerosonde/jsbsim.toml", 0.3)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params").join(aircraft);
        let mut model = GreyBox::load(&path).unwrap();
        model.airframe.envelope.surface_slew_per_s = 20.0;
        let last = Command { aileron: 0.1, elevator: 0.1, throttle: 0.0, rudder: 0.1 };
        let far = Command { aileron: 1.0, elevator: -1.0, throttle: 1.0, rudder: 1.0 };
        let got = slewed(far, &last, &model.airframe);
        // the rudder command of an airframe without a rudder is not limited
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

//! Courses on which controllers are evaluated: steps from one random attitude to another.

use rand::RngExt;

use crate::episode::Leg;
use crate::evaluation::Course;
use greylag_control::Target;
use greylag_num::stream;
use greylag_physics::Airframe;

/// Id of the random stream.
const STREAM: u64 = 242;
/// Number of 10 ms steps for which the first attitude is held: 5 s. In this time every controller of this program settles or
/// loses the aircraft.
const HELD: usize = 500;
/// Number of 10 ms steps for which the second attitude is held and scored: 8 s, as in `greylag demo`.
const SCORED: usize = 800;

/// `count` steps from one attitude to another, drawn from `seed`. Both attitudes are uniformly distributed over the
/// envelope's bank and pitch. The commanded airspeed is the cruise airspeed.
pub fn steps(seed: u64, count: u32, airframe: &Airframe) -> Vec<Course> {
    let envelope = &airframe.envelope;
    let step = |number: u32| {
        let mut rng = stream::stream(seed, &[STREAM, number.into()]);
        let mut target = || {
            let roll: f64 = rng.random_range(-envelope.bank_max_deg..envelope.bank_max_deg);
            let pitch: f64 = rng.random_range(envelope.pitch_min_deg..envelope.pitch_max_deg);
            let [roll, pitch] = [roll, pitch].map(f64::to_radians);
            Target { roll, pitch, airspeed: envelope.airspeed_cruise_mps }
        };
        let first = Some(Leg { target: target(), steps: HELD });
        Course { number, group: None, first, leg: Leg { target: target(), steps: SCORED } }
    };
    (0..count).map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_fill_the_envelope_and_are_the_same_whatever_their_number() {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/airframe.toml");
        let airframe = Airframe::load(&path).unwrap();
        let all = steps(7, 400, &airframe);
        assert_eq!(steps(7, 10, &airframe), all[..10]);
        assert_ne!(steps(8, 10, &airframe), all[..10]);
        let firsts = all.iter().filter_map(|c| c.first).map(|leg| leg.target);
        let rolls: Vec<f64> =
            firsts.chain(all.iter().map(|c| c.leg.target)).map(|t| t.roll.to_degrees()).collect();
        let beyond = |deg: f64| rolls.iter().filter(|r| r.abs() > deg).count();
        // half of a uniform draw from ±60° lies beyond 30°: 400 of 800, with a standard deviation of 14
        assert!(beyond(60.0) == 0 && (340..460).contains(&beyond(30.0)), "{}", beyond(30.0));
        assert!(all.iter().all(|c| c.leg.target.airspeed == airframe.envelope.airspeed_cruise_mps));
    }
}

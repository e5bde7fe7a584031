//! A simulated flight of one minute towards random attitudes, 5 s each. Its result states whether the aircraft was lost, the
//! settled error and the error integral. The settled error is the attitude error in the last second of each attitude: the mean
//! of the RMS errors of roll and pitch.

use rand::RngExt;
use serde::Serialize;

use crate::changes::{CHANGE_S, Changed};
use crate::environment::{Environment, Imagined};
use crate::episode::{attitude_error_deg, settled_error_deg};
use greylag_control::{Controller, Observation, Target};
use greylag_model::{GreyBox, STEP};
use greylag_num::statistics::mean;
use greylag_num::stream;
use greylag_physics::Airframe;

/// Number of attitudes in a flight.
pub const LEGS: usize = 12;
/// Number of steps for which each attitude is commanded: 5 s.
const LEG: usize = 500;
/// Number of steps at the end of each attitude over which the settled error is computed: 1 s.
const SETTLED: usize = 100;
/// Largest commanded |roll| and |pitch|, degrees. A narrower envelope of the airframe reduces them.
const LARGEST_DEG: [f64; 2] = [40.0, 15.0];
/// Id of the random stream of the attitudes.
const ATTITUDES: u64 = 60;

/// Largest |roll|, |pitch|, |angle of attack| and |sideslip|, rad. An aircraft beyond them counts as lost: it is inverted or
/// near vertical, or its model is not valid there.
const LOST: [f64; 4] = [1.75, 1.2, 0.5, 0.7];
/// Range of the ratio of airspeed to cruise airspeed. An aircraft outside this range counts as lost.
const LOST_SPEED: [f64; 2] = [0.45, 2.5];

/// Result of the flight of one minute.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Minute {
    /// Time of the loss, s; `None` if the aircraft was not lost.
    pub lost_s: Option<f64>,
    /// Settled error, mean over the attitudes, degrees; 180 if the aircraft was lost.
    pub settled_deg: f64,
    /// Integral of |roll error| + |pitch error| over the flight, or up to the loss of the aircraft, ° s.
    pub integral_deg_s: f64,
}

/// The commanded attitudes of flight `number` of `seed`, at the cruise airspeed. They are uniformly distributed within ±40°
/// of roll and ±15° of pitch, or within the envelope where it is narrower.
pub fn attitudes(airframe: &Airframe, seed: u64, number: u64) -> [Target; LEGS] {
    let mut rng = stream::stream(seed, &[ATTITUDES, number]);
    let envelope = &airframe.envelope;
    let bank = LARGEST_DEG[0].min(envelope.bank_max_deg);
    let up = LARGEST_DEG[1].min(envelope.pitch_max_deg);
    let down = LARGEST_DEG[1].min(-envelope.pitch_min_deg);
    std::array::from_fn(|_| Target {
        roll: rng.random_range(-bank..bank).to_radians(),
        pitch: rng.random_range(-down..up).to_radians(),
        airspeed: envelope.airspeed_cruise_mps,
    })
}

/// Flies `controller` for a minute in a simulation of `model`, towards the [`attitudes`] of `flight` (seed and number). If
/// `changed` is given, it replaces the aircraft after [`CHANGE_S`].
pub fn fly(
    model: &GreyBox,
    controller: &mut dyn Controller,
    flight: [u64; 2],
    changed: Option<&Changed>,
) -> Minute {
    fly_watched(model, controller, flight, changed, |_| {})
}

/// Does the same as [`fly`] and calls `watch` with each observation, before the controller computes its command.
pub fn fly_watched(
    model: &GreyBox,
    controller: &mut dyn Controller,
    [seed, number]: [u64; 2],
    changed: Option<&Changed>,
    mut watch: impl FnMut(&Observation),
) -> Minute {
    let mut world = Imagined::cruising(model.clone());
    let cruise = model.airframe.envelope.airspeed_cruise_mps;
    let lost =
        |s: f64, integral| Minute { lost_s: Some(s), settled_deg: 180.0, integral_deg_s: integral };
    let (mut integral, mut settled) = (0.0, Vec::with_capacity(LEGS));
    let Ok(mut seen) = world.reset() else { return lost(0.0, integral) };
    controller.reset(seed);
    let changes_at = (CHANGE_S / STEP).round() as usize;
    let mut at_change = None;
    for (leg, target) in attitudes(&model.airframe, seed, number).iter().enumerate() {
        let mut errors = Vec::with_capacity(SETTLED);
        for step in 0..LEG {
            let tick = leg * LEG + step;
            let now = tick as f64 * STEP;
            watch(&seen);
            let mut command = controller.command(&seen, target);
            if let Some(changed) = changed.filter(|_| tick >= changes_at) {
                if at_change.is_none() {
                    world.change(changed.model().clone());
                }
                let before = *at_change.get_or_insert(seen.previous[0]);
                command = changed.command(command, before);
            }
            match world.step(command) {
                Ok(next) if is_flown(&next, cruise) => seen = next,
                _ => return lost(now, integral),
            }
            let error = attitude_error_deg([seen.state.roll, seen.state.pitch], target);
            integral += (error[0].abs() + error[1].abs()) * STEP;
            if step >= LEG - SETTLED {
                errors.push(error);
            }
        }
        settled.push(settled_error_deg(&errors));
    }
    Minute { lost_s: None, settled_deg: mean(&settled), integral_deg_s: integral }
}

fn is_flown(seen: &Observation, cruise: f64) -> bool {
    let s = &seen.state;
    let angles = [s.roll, s.pitch, s.alpha, s.beta];
    let [slowest, fastest] = LOST_SPEED;
    angles.iter().zip(LOST).all(|(angle, most)| angle.abs() < most)
        && (slowest * cruise..fastest * cruise).contains(&s.airspeed)
}

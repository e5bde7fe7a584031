//! LQI: linear-quadratic attitude control with integral action. The gains are scheduled over airspeed, roll and pitch.

mod gain_schedule;
mod margins;

mod ahead;
mod design;
mod riccati;

use std::sync::Arc;

use crate::{Controller, Observation, Overruled, SetupError, Target, winds_up};
pub(crate) use ahead::Ahead;
use ahead::{HOLD, Inner, Law, Surfaces};
pub use design::Weights;
use gain_schedule::Schedule;
use greylag_model::{GreyBox, STEP};
use greylag_physics::Command;
pub use margins::{LoopMargins, MarginsError, margins};

/// Largest rate of the roll reference, rad/s. The limit turns a step of the target into a ramp that the aircraft can follow.
/// This keeps the integrals of the errors small.
const ROLL_RATE: f64 = 0.8;
/// Largest rate of the pitch reference, rad/s.
const PITCH_RATE: f64 = 0.5;
/// Time constant of the reference's approach to the target, s. It rounds the end of a ramp.
const ROUNDING: f64 = 0.35;
/// Proportional gain from the airspeed error to the throttle, s/m.
const AIRSPEED_KP: f64 = 0.3;
/// Integral gain from the airspeed error to the throttle, 1/m.
const AIRSPEED_KI: f64 = 0.05;

/// The steady state to which the control law regulates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Goal {
    /// Target roll and pitch, rad. The roll is reduced if the airspeed is too low for it.
    pub attitude: [f64; 2],
    /// p q r α β of the steady flight at this attitude, rad/s and rad.
    pub steady: [f64; 5],
}

/// The gain-scheduled LQI, designed from any model.
#[derive(Clone, Debug)]
pub struct Lqi {
    name: &'static str,
    schedule: Arc<Schedule>,
    surfaces: Surfaces,
    reference: Option<[f64; 2]>,
    integral: [f64; 2],
    airspeed_integral: f64,
    last: Option<Given>,
}

/// Data of the last command. They correct the reference and the integrals if a different command was flown.
#[derive(Clone, Copy, Debug)]
struct Given {
    /// Roll and pitch of the aircraft, rad.
    attitude: [f64; 2],
    /// Last change of the integrals of the roll and pitch errors, rad s.
    added: [f64; 2],
    /// Gains from the reference roll to the aileron and from the reference pitch to the elevator, rad/rad.
    by_reference: [f64; 2],
}

impl Lqi {
    /// Designs the controller for `model` over its envelope and a margin around it. An aircraft with a rudder holds zero
    /// sideslip. An aircraft without one flies a turn with the sideslip at which the turn is in equilibrium.
    ///
    /// # Errors
    ///
    /// If there is an attitude of the envelope at which the model cannot be trimmed or stabilised at any airspeed.
    pub fn new(model: &GreyBox) -> Result<Lqi, SetupError> {
        Lqi::weighted("lqi", model, &Weights::DEFAULT)
    }

    /// Designs the controller with the LQ `weights`. `name` is the name of the controller in reports.
    ///
    /// # Errors
    ///
    /// The same as [`Lqi::new`].
    pub fn weighted(
        name: &'static str,
        model: &GreyBox,
        weights: &Weights,
    ) -> Result<Lqi, SetupError> {
        Ok(Lqi {
            name,
            schedule: Arc::new(Schedule::new(model, weights)?),
            surfaces: Surfaces::of(&model.airframe),
            reference: None,
            integral: [0.0; 2],
            airspeed_integral: 0.0,
            last: None,
        })
    }

    /// Advances the reference towards the target and returns it (roll and pitch, rad).
    fn follow(&mut self, seen: &Observation, target: &Target) -> [f64; 2] {
        let mut reference = self.reference.unwrap_or([seen.state.roll, seen.state.pitch]);
        let wanted = self.wanted(seen, target);
        for ((x, wanted), rate) in reference.iter_mut().zip(wanted).zip([ROLL_RATE, PITCH_RATE]) {
            let step = ((wanted - *x) / ROUNDING).clamp(-rate, rate) * STEP;
            if step.is_finite() {
                *x += step;
            }
        }
        // a reference that started at an unknown attitude (NaN) is dropped and starts again at the next step
        self.reference = Some(reference).filter(|x| x.iter().all(|x| x.is_finite()));
        reference
    }

    /// Roll and pitch (rad) to which the reference moves. If the airspeed is too low for the target roll, the roll is reduced.
    fn wanted(&self, seen: &Observation, target: &Target) -> [f64; 2] {
        let part = self.schedule.tolerable_part(seen.state.airspeed, target.roll, target.pitch);
        [part * target.roll, target.pitch]
    }

    /// The airspeed to be held (m/s): the target airspeed, or the minimum airspeed of the target attitude if that is higher.
    fn airspeed(&self, target: &Target) -> f64 {
        self.schedule.comfortable_airspeed(target.roll, target.pitch).max(target.airspeed)
    }

    /// The steady state for `target` at the airspeed of `seen`.
    pub(crate) fn goal(&self, seen: &Observation, target: &Target) -> Goal {
        let attitude @ [roll, pitch] = self.wanted(seen, target);
        let [_, _, steady @ ..] = self.schedule.at(seen.state.airspeed, roll, pitch).steady;
        Goal { attitude, steady }
    }

    /// Writes the control laws of the coming steps (trims and gains) into `ahead`, with the present reference, targets and
    /// integrals. The LQI's commands in a prediction follow from them. The gains are those of the future reference attitudes at
    /// the present airspeed.
    pub(crate) fn look_ahead(&self, seen: &Observation, target: &Target, ahead: &mut Ahead) {
        let mut follower = self.clone();
        let now = [seen.state.roll, seen.state.pitch];
        ahead.inner = Inner { reference: self.reference.unwrap_or(now), integral: self.integral };
        ahead.wanted = self.wanted(seen, target);
        ahead.airspeed = self.airspeed(target);
        ahead.airspeed_integral = self.airspeed_integral;
        ahead.surfaces = self.surfaces;
        for law in &mut ahead.laws {
            let [roll, pitch] = follower.follow(seen, target);
            *law = self.schedule.at(seen.state.airspeed, roll, pitch).into();
            for _ in 1..HOLD {
                follower.follow(seen, target);
            }
        }
    }

    /// Updates the LQI after another controller's command was chosen for this step. The reference restarts at the present
    /// attitude. The integrals of the attitude errors return to their values in `before`.
    pub(crate) fn hand_over(&mut self, before: &Lqi, seen: &Observation) {
        self.integral = before.integral;
        self.reference = Some([seen.state.roll, seen.state.pitch]);
    }

    fn throttle(&mut self, seen: &Observation, target: &Target, feed_forward: f64) -> f64 {
        let error = self.airspeed(target) - seen.state.airspeed;
        let raw = feed_forward + AIRSPEED_KP * error + self.airspeed_integral;
        let outward = (raw > 1.0 && error > 0.0) || (raw < 0.0 && error < 0.0);
        if !outward && error.is_finite() {
            self.airspeed_integral += AIRSPEED_KI * error * STEP;
        }
        raw.clamp(0.0, 1.0)
    }
}

impl Controller for Lqi {
    fn name(&self) -> &'static str {
        self.name
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _seed: u64) {
        self.reference = None;
        self.integral = [0.0; 2];
        self.airspeed_integral = 0.0;
        self.last = None;
    }

    /// Anti-windup by conditioning (Hanus, Kinnaert and Henrotte, Automatica 23, 1987). If another aileron or elevator command
    /// was flown, the reference of that axis moves to the value that would have given the flown command, but not past the
    /// aircraft's attitude. The last increment of the axis's integral is subtracted again if it moved the command further beyond
    /// the limit.
    fn overruled(&mut self, by: &Overruled) {
        let (Some(last), Some(reference)) = (self.last.take(), &mut self.reference) else { return };
        let Overruled { wanted, flown } = by;
        let [ailerons, elevators] =
            [self.surfaces.figures.aileron.travel, self.surfaces.figures.elevator.travel];
        let moved = [
            ailerons.deflection(flown.aileron) - ailerons.deflection(wanted.aileron),
            elevators.deflection(flown.elevator) - elevators.deflection(wanted.elevator),
        ];
        for axis in 0..2 {
            let back = moved[axis] / last.by_reference[axis];
            if moved[axis] == 0.0 || !back.is_finite() {
                continue;
            }
            let (here, there) = (last.attitude[axis], reference[axis]);
            reference[axis] = (there + back).clamp(here.min(there), here.max(there));
            if winds_up(moved[axis], -last.by_reference[axis] * last.added[axis]) {
                self.integral[axis] -= last.added[axis];
            }
        }
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let [roll, pitch] = self.follow(seen, target);
        let law = Law::from(self.schedule.at(seen.state.airspeed, roll, pitch));
        let inner = Inner { reference: [roll, pitch], integral: self.integral };
        let raw =
            law.surfaces(&inner, &seen.state, &seen.actuators, &seen.previous, &self.surfaces);
        let error = [seen.state.roll - roll, seen.state.pitch - pitch];
        // conditional integration: the integral of an axis is constant while its command is saturated
        let added: [f64; 2] = std::array::from_fn(|axis| {
            let free = raw[axis].abs() < 1.0 && error[axis].is_finite();
            if free { error[axis] * STEP } else { 0.0 }
        });
        self.integral = [self.integral[0] + added[0], self.integral[1] + added[1]];
        let attitude = [seen.state.roll, seen.state.pitch];
        self.last = Some(Given { attitude, added, by_reference: law.by_reference() });
        let throttle = self.throttle(seen, target, law.throttle());
        Command { aileron: raw[0], elevator: raw[1], throttle, rudder: raw[2] }.clamped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::{ActuatorState, State, Time};
    use std::path::Path;

    #[test]
    fn an_attitude_that_is_unknown_at_first_does_not_stay_in_the_reference() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let mut controller = Lqi::new(&model).unwrap();
        let seen = |roll: f64| Observation {
            time: Time::default(),
            state: State { roll, ..State::NEUTRAL },
            incidence_sd: [0.0; 2],
            actuators: ActuatorState::default(),
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
        assert!(!controller.command(&seen(f64::NAN), &target).is_finite());
        assert!(controller.command(&seen(0.1), &target).is_finite());
    }
}

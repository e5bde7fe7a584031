//! The reinforcement-learning task: the reward for attitude tracking, eq. (30) of \[GSFM26\] (see `src/lib.rs`).

use crate::Target;
use greylag_num::Real;
use greylag_physics::State;

/// The constants of the reward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Scale c_φ of the roll error, rad.
    pub roll_scale: f64,
    /// Cap κ_φ of the roll term.
    pub roll_cap: f64,
    /// Scale c_θ of the pitch error, rad.
    pub pitch_scale: f64,
    /// Cap κ_θ of the pitch term.
    pub pitch_cap: f64,
    /// Scale c_v of the airspeed error, m/s.
    pub airspeed_scale: f64,
    /// Cap κ_v of the airspeed term.
    pub airspeed_cap: f64,
    /// Discount factor γ per step (Table VII).
    pub discount: f64,
}

impl Task {
    /// The constants of section V-A and Table VII of \[GSFM26\].
    pub const PAPER: Task = Task {
        roll_scale: 3.3,
        roll_cap: 0.5,
        pitch_scale: 2.25,
        pitch_cap: 0.5,
        airspeed_scale: 48.0,
        airspeed_cap: 0.1,
        discount: 0.99,
    };

    /// The smallest possible reward of a step, which has every term at its cap.
    pub fn worst(&self) -> f64 {
        -(self.roll_cap + self.pitch_cap + self.airspeed_cap)
    }

    /// The reward of the step in which the aircraft is lost: the discounted sum of the smallest reward over infinitely many
    /// steps. With a smaller penalty, the loss of the aircraft could cost less than flying on.
    pub fn of_loss(&self) -> f64 {
        self.worst() / (1.0 - self.discount)
    }

    /// The reward for the state `state` when `target` is commanded. It is 0 on target and negative elsewhere.
    #[inline(always)]
    pub fn reward<R: Real>(&self, state: &State<R>, target: &Target<R>) -> R {
        #[inline(always)]
        fn term<R: Real>(x: R, wanted: R, scale: f64, cap: f64) -> R {
            (x - wanted).abs().scale(1.0 / scale).min(R::from_f64(cap))
        }
        -(term(state.roll, target.roll, self.roll_scale, self.roll_cap)
            + term(state.pitch, target.pitch, self.pitch_scale, self.pitch_cap)
            + term(state.airspeed, target.airspeed, self.airspeed_scale, self.airspeed_cap))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reward_is_zero_on_target_and_capped_far_away() {
        let target = Target { roll: 0.5, pitch: -0.2, airspeed: 16.67 };
        let on = State { roll: 0.5, pitch: -0.2, ..State::NEUTRAL };
        assert_eq!(Task::PAPER.reward(&on, &target), 0.0);
        let off = State { roll: 0.5 - 0.33, pitch: -0.2 + 0.225, airspeed: 16.67 + 2.4, ..on };
        // 0.33/3.3 + 0.225/2.25 + 2.4/48
        assert!((Task::PAPER.reward(&off, &target) + 0.25).abs() < 1e-12);
        let far = State { roll: -3.0, pitch: 1.5, airspeed: 99.0, ..on };
        assert!((Task::PAPER.reward(&far, &target) - Task::PAPER.worst()).abs() < 1e-12);
        // the sum of (0.5 + 0.5 + 0.1) over infinitely many steps at γ = 0.99
        assert!((Task::PAPER.of_loss() + 110.0).abs() < 1e-9);
    }
}

//! Rollouts by the classical Runge–Kutta method: the forward pass, and the reverse pass that computes the gradient of the
//! loss.

use crate::dynamics::kernel::InstructionSet;
use crate::dynamics::packet::Packet;
use crate::dynamics::prior::Slopes;
use crate::dynamics::rollout::{Gradient, Pass, Place, SumSlopes, Trace, nothing, sum};
use greylag_model::STEP;
use greylag_physics::State;

/// Weights of the state rates of the four stages, s.
const WEIGHTS: [f64; 4] = [STEP / 6.0, STEP / 3.0, STEP / 3.0, STEP / 6.0];
/// Time from the start of the step to each stage, s. The state of a stage is extrapolated with the rates of the
/// previous stage.
const AHEAD: [f64; 4] = [0.0, STEP / 2.0, STEP / 2.0, STEP];

impl<R: Packet, S: InstructionSet<Number = R>> Pass<'_, S> {
    #[inline(always)]
    pub(super) fn forward_rk4(&self, trace: &mut Trace<R>) -> [R; 3] {
        let mut totals = [R::zero(); 3];
        let mut state = State::from_array(self.recorded.states[1]);
        for step in 1..=self.steps() {
            let start = state;
            let mut rate = nothing();
            for stage in 0..4 {
                let at = self.at(step, start.advance(&rate, AHEAD[stage]));
                let learned = self.learned(&at, 4 * step + stage, trace);
                let prior = self.ask(&at).rate;
                if stage == 0 {
                    trace.rates[step] = [prior, learned];
                }
                rate = sum(&prior, &learned);
                state = state.advance(&rate, WEIGHTS[stage]);
            }
            trace.ends[step] = state;
            self.tally(step, trace, &mut totals);
        }
        totals
    }

    #[inline(always)]
    pub(super) fn reverse_rk4(
        &self,
        trace: &mut Trace<R>,
        of: &SumSlopes,
        gradient: &mut Gradient,
    ) {
        // the gradient of the loss with respect to the state after the step
        let mut slope = nothing();
        for step in (1..=self.steps()).rev() {
            let [error, norm_prior, norm_learned] = self.direct(step, trace, of);
            slope = sum(&slope, &error);
            let mut before = slope;
            // the gradient of the loss with respect to the state at which the following stage was evaluated
            let mut later = nothing();
            for stage in (0..4).rev() {
                let ahead = AHEAD.get(stage + 1).copied().unwrap_or(0.0);
                let rate = nothing().advance(&slope, WEIGHTS[stage]).advance(&later, ahead);
                let mut slopes = [rate; 2];
                if stage == 0 {
                    slopes = [sum(&rate, &norm_prior), sum(&rate, &norm_learned)];
                }
                let none = [R::zero(); 3];
                let prior = Slopes { acceleration: none, spin: none, rate: slopes[0] };
                let point = Place { step, point: 4 * step + stage, first: 4 };
                later = self.point(trace, point, &prior, &slopes[1], gradient);
                before = sum(&before, &later);
            }
            slope = before;
        }
    }
}

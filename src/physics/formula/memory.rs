//! Checks and evaluates the terms `lag(…)` (first-order lag) and `delay(…)` (dead time) of a formula in an effect file.

use super::expression::{Expression, Function, Node};
use super::parser::Fault;
use super::tape::Tape;
use super::variable::Variable;
use crate::airframe::Geometry;
use crate::inputs::{ActuatorLag, InputEffect, PAST, Past, STEP, TimeDelay};
use crate::point::Base;
use crate::rigid_body::ForceAxes;
use crate::{AirData, Controls, Point, State};
use greylag_num::Real;

/// Longest delay, s. It is limited by the number of stored samples.
pub const LONGEST_DELAY_S: f64 = (PAST - 2) as f64 * STEP;

/// A lag or delay term of a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Memory {
    pub(super) function: Function,
    /// Argument of the lag or delay, as a tape (a list of operations).
    pub(super) argument: Tape,
    /// Index of the time constant or delay among the effect's shape constants, the parameters in which the effect is nonlinear.
    pub(super) time: u16,
}

impl Memory {
    /// Value of the argument under `controls`. The lag or delay settles to this value.
    ///
    /// It is not inlined, because a copy of the tape's interpreter in each planner would add minutes to the compilation.
    #[inline(never)]
    pub fn settled<R: Real>(&self, controls: &Controls<R>, shape: &[f64]) -> R {
        let zero = R::zero();
        let state = State::from_array([zero; 8]);
        let air = AirData {
            q_s: zero,
            density: zero,
            sin_alpha: zero,
            cos_alpha: zero,
            sin_beta: zero,
            cos_beta: zero,
            p_hat: zero,
            q_hat: zero,
            r_hat: zero,
            altitude: 0.0,
        };
        let at = Point {
            state: &state,
            controls,
            air: &air,
            geometry: &Geometry { area: 0.0, span: 0.0, chord: 0.0 },
            axes: ForceAxes::Wind,
            base: &Base::zero(),
        };
        let mut value = zero;
        self.argument.run(&at, shape, 0, |_, _, x| value = x);
        value
    }

    /// The lagged or delayed value under `controls`. It must be called once every [`STEP`], because it advances `past`.
    #[inline(always)]
    pub fn act<R: Real>(&self, controls: &Controls<R>, shape: &[f64], past: &mut Past<R>) -> R {
        let now = self.settled(controls, shape);
        let time = shape.get(self.time as usize).copied().unwrap_or(0.0).max(0.0);
        match self.function {
            Function::Delay => TimeDelay::act(time, past, now),
            _ => ActuatorLag::act(time, past, now),
        }
    }
}

/// Checks that every lag and delay in `of` can be evaluated. `bounds` are the bounds of the effect's parameters.
///
/// # Errors
/// If a lag or delay has an invalid argument or time. The error has the position in the text, and the remedy.
pub fn check(of: &Expression, bounds: &[[f64; 2]]) -> Result<(), Fault> {
    let mut fault = None;
    of.visit(&mut |e| {
        if let Node::Call(function, all) = &e.node
            && function.has_memory()
            && fault.is_none()
        {
            fault = refusal(*function, all, bounds).map(|why| Fault { at: e.at, why });
        }
    });
    fault.map_or(Ok(()), Err)
}

fn refusal(function: Function, all: &[Expression], bounds: &[[f64; 2]]) -> Option<String> {
    let name = function.name();
    let [argument, time] = all else { return None };
    if argument.any(&|node| matches!(node, Node::Call(inner, _) if inner.has_memory())) {
        return Some(format!("{name} contains another lag or delay; write only one"));
    }
    use Variable::{Aileron, Elevator, Rudder, Throttle};
    let other = argument
        .variables()
        .into_iter()
        .find(|v| !matches!(v, Aileron | Elevator | Rudder | Throttle));
    if let Some(other) = other {
        return Some(format!(
            "{name} takes only aileron, elevator, rudder and throttle, not {}; for a lag of the airflow use alpha_dot and beta_dot",
            other.name()
        ));
    }
    // A literal number has no bounds. A second reason: a search adds all effects without shape constants to one model,
    // which would then have too many lags.
    let Node::Parameter(k) = time.node else {
        return Some(format!("the time of {name} must be a parameter in s, so that it has bounds"));
    };
    let [low, high] = bounds.get(k).copied().unwrap_or([0.0; 2]);
    let most = if function == Function::Delay { LONGEST_DELAY_S } else { f64::INFINITY };
    (low < 0.0 || high > most).then(|| match function {
        Function::Delay => {
            format!("a delay lies between 0 and {LONGEST_DELAY_S} s; set its bounds so")
        }
        _ => "the time constant of a lag is not below 0 s; set its bounds so".to_owned(),
    })
}

//! Actuators: discrete-time filters that convert commands to deflections and throttle position.
//!
//! The time step is 0.01 s. As in JSBSim, the filters are discretised with the bilinear (Tustin) rule. They reproduce JSBSim's
//! filters at this step up to rounding.

use crate::servos::{ActuatorFigures, Surface};
use greylag_num::{Real, each};

/// A command to the actuators. It is the action of eq. (29) of the paper \[GSFM26\] (see `src/lib.rs`), except that the throttle
/// has the range 0..1 and not −1..1.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Command<R = f64> {
    /// Aileron, −1..1; positive rolls right.
    pub aileron: R,
    /// Elevator, −1..1; positive pitches down.
    pub elevator: R,
    /// Throttle command, 0..1.
    pub throttle: R,
    /// Rudder, −1..1; positive yaws left. Zero on an aircraft without a rudder.
    pub rudder: R,
}

impl Command {
    /// The command with neutral surfaces and the motor off.
    pub const IDLE: Command = Command { aileron: 0.0, elevator: 0.0, throttle: 0.0, rudder: 0.0 };

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        [self.aileron, self.elevator, self.throttle, self.rudder].iter().all(|x| x.is_finite())
    }

    /// The command with each component limited to its range.
    pub fn clamped(self) -> Self {
        Command {
            aileron: self.aileron.clamp(-1.0, 1.0),
            elevator: self.elevator.clamp(-1.0, 1.0),
            throttle: self.throttle.clamp(0.0, 1.0),
            rudder: self.rudder.clamp(-1.0, 1.0),
        }
    }
}

/// Largest number of `lag(…)` and `delay(…)` terms, counted together, in the formulas of all effect files of one model.
pub const LAGS: usize = 2;

/// Deflections and throttle position that act on the airframe at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Controls<R = f64> {
    /// Aileron deflection δa, rad; positive rolls right.
    pub aileron: R,
    /// Elevator deflection δe, rad; positive trailing edge down.
    pub elevator: R,
    /// Throttle position δt, 0..1.
    pub throttle: R,
    /// Rudder deflection δr, rad; positive trailing edge left. Zero on an aircraft without a rudder.
    pub rudder: R,
    /// Values of the model's `lag(…)` and `delay(…)` terms at this instant. `None` if the past controls are unknown. Each term
    /// then has its steady-state value, the present value of its argument.
    pub lagged: Option<[R; LAGS]>,
}

impl<R: Copy> Controls<R> {
    /// Applies `f` to every number of the controls, for example to convert it to another number type.
    #[inline(always)]
    #[expect(
        clippy::manual_map,
        reason = "a closure may leave the vector instructions of the caller"
    )]
    pub fn map<S: Copy>(&self, mut f: impl FnMut(R) -> S) -> Controls<S> {
        Controls {
            aileron: f(self.aileron),
            elevator: f(self.elevator),
            throttle: f(self.throttle),
            rudder: f(self.rudder),
            lagged: match self.lagged {
                Some(lagged) => Some(each(lagged, f)),
                None => None,
            },
        }
    }
}

impl Controls {
    /// Interpolates linearly between `self` (`part` = 0) and `next` (`part` = 1).
    pub fn towards(&self, next: &Controls, part: f64) -> Controls {
        let mix = |a: f64, b: f64| a + part * (b - a);
        Controls {
            aileron: mix(self.aileron, next.aileron),
            elevator: mix(self.elevator, next.elevator),
            throttle: mix(self.throttle, next.throttle),
            rudder: mix(self.rudder, next.rudder),
            lagged: self
                .lagged
                .zip(next.lagged)
                .map(|(a, b)| std::array::from_fn(|k| mix(a[k], b[k]))),
        }
    }
}

/// The observed actuator state z, eq. (27) of the paper, with a rudder in addition.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ActuatorState<R = f64> {
    /// Aileron position, rad; positive rolls right.
    pub aileron: R,
    /// Rate of the aileron, rad/s.
    pub aileron_rate: R,
    /// Elevator position, rad; positive trailing edge down.
    pub elevator: R,
    /// Rate of the elevator, rad/s.
    pub elevator_rate: R,
    /// Position of the throttle, 0..1.
    pub throttle: R,
    /// Rudder position, rad; positive trailing edge left. Zero on an aircraft without a rudder.
    pub rudder: R,
    /// Rate of the rudder, rad/s.
    pub rudder_rate: R,
}

impl<R: Copy> ActuatorState<R> {
    /// The positions as [`Controls`], with `lagged` = `None`.
    #[inline(always)]
    pub fn controls(&self) -> Controls<R> {
        Controls {
            aileron: self.aileron,
            elevator: self.elevator,
            throttle: self.throttle,
            rudder: self.rudder,
            lagged: None,
        }
    }
}

/// The memory of a surface's second-order filter. The travel and rate limits apply to the filter's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceFilter<R = f64> {
    /// The last two commanded deflections, rad, newest first.
    input: [R; 2],
    /// The last two filtered deflections before the limits, rad, newest first.
    output: [R; 2],
    /// The last two deflections after the limits, rad, newest first.
    clipped: [R; 2],
}

/// The filters of all actuators. An aircraft without a rudder has no rudder filter.
///
/// The filters hold the complete state of the actuators: with the future commands it determines the future deflections. The
/// observation [`ActuatorState`] alone does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuators<R = f64> {
    aileron: SurfaceFilter<R>,
    elevator: SurfaceFilter<R>,
    rudder: Option<SurfaceFilter<R>>,
    throttle_input: R,
    throttle: R,
}

impl<R: Real> SurfaceFilter<R> {
    fn at(position: R) -> Self {
        SurfaceFilter { input: [position; 2], output: [position; 2], clipped: [position; 2] }
    }

    /// The filter memory that agrees with an observed `position` (rad) and `rate` (rad/s) and with the last two commands, first
    /// `old`, then `new`. `step` is the time step, s.
    #[inline(always)]
    fn observed(
        [position, rate]: [R; 2],
        [new, old]: [R; 2],
        figures: &Surface,
        step: f64,
    ) -> Self {
        let trace = [position, position - rate.scale(step)];
        let input = [figures.travel.deflection(new), figures.travel.deflection(old)];
        SurfaceFilter { input, output: trace, clipped: trace }
    }

    #[inline(always)]
    fn step(&mut self, command: R, figures: &Surface, step: f64) {
        let [b, a1, a2] = figures.filter;
        let input = figures.travel.deflection(command);
        let y = (input + self.input[0].scale(2.0) + self.input[1]).scale(b)
            - self.output[0].scale(a1)
            - self.output[1].scale(a2);
        self.input = [input, self.input[0]];
        self.output = [y, self.output[0]];
        let travel = figures.travel;
        let mut next = y.clamp(travel.least, travel.most);
        if let Some(rate) = figures.rate_max {
            let reach = R::from_f64(rate * step);
            next = next.max(self.clipped[0] - reach).min(self.clipped[0] + reach);
        }
        self.clipped = [next, self.clipped[0]];
    }

    #[inline(always)]
    fn replaced(&self, chosen: R, then: &Self) -> Self {
        let pair = |old: [R; 2], new: [R; 2]| {
            [
                R::where_less(R::zero(), chosen, new[0], old[0]),
                R::where_less(R::zero(), chosen, new[1], old[1]),
            ]
        };
        SurfaceFilter {
            input: pair(self.input, then.input),
            output: pair(self.output, then.output),
            clipped: pair(self.clipped, then.clipped),
        }
    }

    #[inline(always)]
    fn rate(&self, step: f64) -> R {
        (self.clipped[0] - self.clipped[1]).scale(1.0 / step)
    }
}

impl<R: Real> Actuators<R> {
    /// Actuators at rest at `controls`, as under constant commands that hold them there. The result has a rudder filter. If the
    /// figures describe no rudder, [`step`](Self::step) leaves the rudder where it is.
    pub fn at_rest(controls: &Controls<R>) -> Self {
        Actuators {
            aileron: SurfaceFilter::at(controls.aileron),
            elevator: SurfaceFilter::at(controls.elevator),
            rudder: Some(SurfaceFilter::at(controls.rudder)),
            throttle_input: controls.throttle,
            throttle: controls.throttle,
        }
    }

    /// These actuators without the rudder's filter if `figures` describe no rudder.
    pub fn fitted(self, figures: &ActuatorFigures) -> Self {
        Actuators { rudder: figures.rudder.and(self.rudder), ..self }
    }

    /// The filter memories that agree with an observed `state` and the last two commands `previous` (newest first).
    ///
    /// The memories are exact unless a surface is at a travel limit or moves at its rate limit. At a limit the unlimited output
    /// of the filter is not observed. The deflection one step after the limit may then be wrong by up to 8 % of the travel.
    #[inline(always)]
    pub fn from_observed(
        state: &ActuatorState<R>,
        previous: &[Command<R>; 2],
        figures: &ActuatorFigures,
    ) -> Self {
        let ActuatorState { aileron, aileron_rate, elevator, elevator_rate, .. } = *state;
        let ([new, old], step) = (previous, figures.step);
        let aileron = SurfaceFilter::observed(
            [aileron, aileron_rate],
            [new.aileron, old.aileron],
            &figures.aileron,
            step,
        );
        let elevator = SurfaceFilter::observed(
            [elevator, elevator_rate],
            [new.elevator, old.elevator],
            &figures.elevator,
            step,
        );
        let mut rudder = None;
        if let Some(figures) = &figures.rudder {
            let motion = [state.rudder, state.rudder_rate];
            rudder = Some(SurfaceFilter::observed(motion, [new.rudder, old.rudder], figures, step));
        }
        Actuators {
            aileron,
            elevator,
            rudder,
            throttle_input: new.throttle,
            throttle: state.throttle,
        }
    }

    /// The filters of `then` in the SIMD lanes in which `chosen` is above zero, and those of `self` in the other lanes.
    #[inline(always)]
    pub fn replaced(&self, chosen: R, then: &Self) -> Self {
        let one = |old: R, new: R| R::where_less(R::zero(), chosen, new, old);
        Actuators {
            aileron: self.aileron.replaced(chosen, &then.aileron),
            elevator: self.elevator.replaced(chosen, &then.elevator),
            rudder: match (&self.rudder, &then.rudder) {
                (Some(old), Some(new)) => Some(old.replaced(chosen, new)),
                (old, _) => *old,
            },
            throttle_input: one(self.throttle_input, then.throttle_input),
            throttle: one(self.throttle, then.throttle),
        }
    }

    /// Advances by one step of 0.01 s under `command`.
    #[inline(always)]
    pub fn step(&mut self, command: &Command<R>, figures: &ActuatorFigures) {
        self.aileron.step(command.aileron, &figures.aileron, figures.step);
        self.elevator.step(command.elevator, &figures.elevator, figures.step);
        if let (Some(rudder), Some(of)) = (&mut self.rudder, &figures.rudder) {
            rudder.step(command.rudder, of, figures.step);
        }
        let [b, a] = figures.throttle;
        self.throttle = (command.throttle + self.throttle_input).scale(b) + self.throttle.scale(a);
        self.throttle_input = command.throttle;
    }

    /// The present deflections and throttle position, with `lagged` = `None`.
    #[inline(always)]
    pub fn controls(&self) -> Controls<R> {
        Controls {
            aileron: self.aileron.clipped[0],
            elevator: self.elevator.clipped[0],
            throttle: self.throttle,
            rudder: match &self.rudder {
                Some(rudder) => rudder.clipped[0],
                None => R::zero(),
            },
            lagged: None,
        }
    }

    /// The present actuator state. Its rates are the changes of the deflections over the last step, divided by the step.
    #[inline(always)]
    pub fn observed(&self, figures: &ActuatorFigures) -> ActuatorState<R> {
        let (rudder, rudder_rate) = match &self.rudder {
            Some(rudder) => (rudder.clipped[0], rudder.rate(figures.step)),
            None => (R::zero(), R::zero()),
        };
        ActuatorState {
            aileron: self.aileron.clipped[0],
            aileron_rate: self.aileron.rate(figures.step),
            elevator: self.elevator.clipped[0],
            elevator_rate: self.elevator.rate(figures.step),
            throttle: self.throttle,
            rudder,
            rudder_rate,
        }
    }
}

#[cfg(test)]
#[expect(clippy::approx_constant, reason = "the simulator's stop is at 0.5235 rad, not at 30°")]
mod tests {
    use super::*;

    fn figures() -> ActuatorFigures {
        ActuatorFigures::tustin(100.0, std::f64::consts::FRAC_1_SQRT_2, 0.5235, 0.2, 0.01)
    }

    #[test]
    fn recurrences_are_those_measured_in_the_simulator() {
        let f = figures();
        // the coefficients that JSBSim prints for surfaces have five decimals
        for (ours, printed) in [
            (f.aileron.filter[0], 0.12774),
            (-f.aileron.filter[1], 0.76644),
            (-f.aileron.filter[2], -0.27740),
        ] {
            assert!((ours - printed).abs() < 6e-6, "{ours} {printed}");
        }
        assert!((f.throttle[0] - 0.024390).abs() < 5e-7 && (f.throttle[1] - 0.951220).abs() < 5e-7);
    }

    #[test]
    fn observation_and_two_commands_give_the_filters_back() {
        let f = figures();
        let mut actuators = Actuators::at_rest(&Controls::default());
        let mut previous = [Command::IDLE; 2];
        for k in 0..50 {
            let x = (k as f64 * 0.7).sin() * 0.6;
            let command = Command {
                aileron: x,
                elevator: -0.5 * x,
                throttle: 0.5 + 0.4 * x,
                rudder: 0.3 * x,
            };
            actuators.step(&command, &f);
            previous = [command, previous[0]];
        }
        let mut rebuilt = Actuators::from_observed(&actuators.observed(&f), &previous, &f);
        for _ in 0..5 {
            actuators.step(&Command::IDLE, &f);
            rebuilt.step(&Command::IDLE, &f);
            let (a, b) = (actuators.controls(), rebuilt.controls());
            // equal up to the rounding of the rate, which is a difference quotient
            assert!(
                (a.aileron - b.aileron).abs() < 1e-14 && (a.elevator - b.elevator).abs() < 1e-14
            );
            assert_eq!(a.throttle, b.throttle);
        }
    }

    #[test]
    fn surfaces_stop_at_their_limits() {
        let f = figures();
        let mut actuators = Actuators::at_rest(&Controls::default());
        let mut largest = 0.0_f64;
        for _ in 0..100 {
            actuators.step(&Command { aileron: 1.0, ..Command::IDLE }, &f);
            largest = largest.max(actuators.controls().aileron);
        }
        assert_eq!(largest, 0.5235);
    }
}

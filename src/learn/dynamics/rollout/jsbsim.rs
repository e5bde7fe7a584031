//! Rollouts (simulations) with JSBSim's integration scheme and their backpropagation. The scheme evaluates the model once per
//! step and keeps a memory of the previous step. The model is a physical prior plus a learned residual.

use crate::dynamics::kernel::InstructionSet;
use crate::dynamics::packet::Packet;
use crate::dynamics::prior::{ALOFT, At, PriorOutputs, Sloped, Slopes, add, fixed, transposed};
use crate::dynamics::rollout::{Gradient, Pass, Place, SumSlopes, Trace, nothing, sum};
use greylag_model::{STEP, advance_jsbsim};
use greylag_num::{Dual, Real};
use greylag_physics::airframe::Geometry;
use greylag_physics::rigid_body::{self, Vector};
use greylag_physics::{AirData, State};

impl<R: Packet, S: InstructionSet<Number = R>> Pass<'_, S> {
    #[inline(always)]
    pub(super) fn forward_jsbsim(&self, trace: &mut Trace<R>) -> [R; 3] {
        let mut totals = [R::zero(); 3];
        let mut state = State::from_array(self.recorded.states[0]);
        let mut last = None;
        for step in 0..=self.steps() {
            let at = self.at(step, state);
            // This scheme integrates accelerations only. The residual does not contribute to the rates of roll and pitch.
            let zero = R::zero();
            let learned = State { roll: zero, pitch: zero, ..self.learned(&at, step, trace) };
            let outputs = self.ask(&at);
            let air = at.air(&self.subject.prior);
            let (acceleration, spin) = pushed(&outputs, &learned, &at.state, &air);
            trace.rates[step] = [outputs.rate, learned];
            trace.memory[step] = [acceleration, last.unwrap_or([zero; 3])];
            let (next, remembered) = advance_jsbsim(&state, &air, acceleration, spin, last);
            last = Some(remembered);
            trace.ends[step] = next;
            if step == 0 {
                state = State::from_array(self.recorded.states[1]);
            } else {
                self.tally(step, trace, &mut totals);
                state = next;
            }
        }
        totals
    }

    #[inline(always)]
    pub(super) fn reverse_jsbsim(
        &self,
        trace: &mut Trace<R>,
        of: &SumSlopes,
        gradient: &mut Gradient,
    ) {
        let mut slope = nothing();
        let mut slope_memory = [R::zero(); 3];
        for step in (0..=self.steps()).rev() {
            let mut norms = [nothing(); 2];
            if step == 0 {
                // The start state is a recorded one, so its gradient is not needed. Step 0 determines only the memory.
                slope = nothing();
            } else {
                let [error, prior, learned] = self.direct(step, trace, of);
                slope = sum(&slope, &error);
                norms = [prior, learned];
            }
            let at = self.at(step, trace.states[step]);
            let learned = &trace.rates[step][1];
            let back = self.advance_back(&at, learned, &trace.memory[step], &slope, &slope_memory);
            let prior = Slopes { acceleration: back.acceleration, spin: back.spin, rate: norms[0] };
            let learned = sum(&back.learned, &norms[1]);
            let point = Place { step, point: step, first: 0 };
            let through = self.point(trace, point, &prior, &learned, gradient);
            slope = sum(&back.state, &through);
            slope_memory = back.memory;
        }
    }

    /// Backpropagates through one step of JSBSim's scheme. `after` and `remembered` are the gradients with respect to
    /// the next state and to the next memory. Returns the gradients with respect to the step's inputs.
    #[inline(always)]
    fn advance_back(
        &self,
        at: &At<R>,
        learned: &State<R>,
        [acceleration, memory]: &[Vector<R>; 2],
        after: &State<R>,
        remembered: &Vector<R>,
    ) -> Back<R> {
        const N: usize = 14;
        let geometry = &self.subject.prior.airframe.geometry;
        let mut inputs = [R::zero(); N];
        inputs[..8].copy_from_slice(&at.state.to_array());
        inputs[8..11].copy_from_slice(acceleration);
        inputs[11..].copy_from_slice(memory);
        let scheme = Scheme { geometry, density: at.density, after: after.to_array(), remembered };
        let sums = transposed(&inputs, &scheme);
        let [s0, s1, s2, s3, s4, s5, s6, s7, x, y, z, m0, m1, m2] = sums;
        let push = [x, y, z];
        let spin = [after.p.scale(STEP), after.q.scale(STEP), after.r.scale(STEP)];
        let plain = at.air(&self.subject.prior);
        let (through, learned) = push_back(&at.state, &plain, learned, &push, &spin);
        let state = State::from_array([s0, s1, s2, s3, s4, s5, s6, s7]);
        Back {
            state: sum(&state, &through),
            learned,
            acceleration: push,
            spin,
            memory: [m0, m1, m2],
        }
    }
}

/// Gradients of the loss with respect to the inputs of a step.
struct Back<R> {
    state: State<R>,
    learned: State<R>,
    acceleration: Vector<R>,
    spin: Vector<R>,
    memory: Vector<R>,
}

/// Linear and angular acceleration due to prior and residual together.
#[inline(always)]
fn pushed<R: Real>(
    outputs: &PriorOutputs<R>,
    learned: &State<R>,
    state: &State<R>,
    air: &AirData<R>,
) -> (Vector<R>, Vector<R>) {
    let push = rigid_body::acceleration_of(state, air, learned);
    let turn = [learned.p, learned.q, learned.r];
    let (mut acceleration, mut spin) = (outputs.acceleration, outputs.spin);
    for i in 0..3 {
        acceleration[i] += push[i];
        spin[i] += turn[i];
    }
    (acceleration, spin)
}

/// A scalar function of state, acceleration and memory: the sum of the outputs of [`advance_jsbsim`], each multiplied by the
/// loss gradient with respect to it.
struct Scheme<'a, R> {
    geometry: &'a Geometry,
    density: R,
    after: [R; 8],
    remembered: &'a Vector<R>,
}

impl<R: Real> Sloped<R, 14> for Scheme<'_, R> {
    #[inline(always)]
    fn part(&self, x: [Dual<2, R>; 14]) -> [R; 2] {
        let [s0, s1, s2, s3, s4, s5, s6, s7, x, y, z, m0, m1, m2] = x;
        let state = State::from_array([s0, s1, s2, s3, s4, s5, s6, s7]);
        let air = AirData::new(&state, fixed(self.density), ALOFT, self.geometry);
        let still = [fixed(R::zero()); 3];
        let (next, last) = advance_jsbsim(&state, &air, [x, y, z], still, Some([m0, m1, m2]));
        let mut sum = [R::zero(); 2];
        for (out, slope) in next.to_array().iter().zip(&self.after) {
            add(&mut sum, out, *slope);
        }
        for (out, slope) in last.iter().zip(self.remembered) {
            add(&mut sum, out, *slope);
        }
        sum
    }
}

/// Backpropagates through [`pushed`]. Returns the gradients with respect to the state and to the residual's state rates.
#[inline(always)]
fn push_back<R: Real>(
    state: &State<R>,
    air: &AirData<R>,
    learned: &State<R>,
    push: &Vector<R>,
    spin: &Vector<R>,
) -> (State<R>, State<R>) {
    let AirData { sin_alpha: sa, cos_alpha: ca, sin_beta: sb, cos_beta: cb, .. } = *air;
    let [x, y, z] = *push;
    let (forward, downward) = (ca * x + sa * z, ca * z - sa * x);
    let speed = state.airspeed;
    let across = cb * y - sb * forward;
    let zero = R::zero();
    let to_learned = State {
        roll: zero,
        pitch: zero,
        airspeed: cb * forward + sb * y,
        p: spin[0],
        q: spin[1],
        r: spin[2],
        alpha: speed * cb * downward,
        beta: speed * across,
    };
    // a = V̇ e_V + V β̇ e_β + V cosβ α̇ e_α. The unit vectors depend on α and β
    let turned = learned.airspeed * cb - speed * learned.beta * sb;
    let to_state = State {
        roll: zero,
        pitch: zero,
        airspeed: learned.beta * across + learned.alpha * cb * downward,
        p: zero,
        q: zero,
        r: zero,
        alpha: turned * downward - speed * cb * learned.alpha * forward,
        beta: learned.airspeed * across
            - speed * learned.beta * (cb * forward + sb * y)
            - speed * sb * learned.alpha * downward,
    };
    (to_state, to_learned)
}

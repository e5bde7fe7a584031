//! The prior, the physical part of a model, at one point: state rates, and their derivatives with respect to the state and the
//! coefficients. An effect is a physical contribution to forces and moments. Most effects depend on the point alone. Dependent
//! effects also use the forces of other effects.

use crate::dynamics::packet::Packet;
use greylag_model::{GreyBox, Starting, Weights, parted};
use greylag_num::{Dual, Real, each};
use greylag_physics::effects::{Needs, Terms};
use greylag_physics::rigid_body::{self, Vector};
use greylag_physics::{AirData, Channel, Controls, State, Wrench};

/// Altitude for the airflow, m. It is infinite, so that there is no ground effect. The air density is a separate
/// input.
pub const ALOFT: f64 = f64::INFINITY;

/// Outputs of the prior at a point.
#[derive(Clone, Copy, Debug)]
pub struct PriorOutputs<R> {
    /// Specific force plus gravity, body axes, m/s².
    pub acceleration: Vector<R>,
    /// Angular acceleration in rad/s².
    pub spin: Vector<R>,
    /// State rates F_p of the prior.
    pub rate: State<R>,
}

/// Gradient of the loss with respect to the outputs [`PriorOutputs`].
#[derive(Clone, Copy, Debug)]
pub struct Slopes<R> {
    /// Gradient with respect to the specific force plus gravity.
    pub acceleration: Vector<R>,
    /// Gradient with respect to the angular acceleration.
    pub spin: Vector<R>,
    /// Gradient with respect to the state rates.
    pub rate: State<R>,
}

/// A point of evaluation: state, controls and air density (kg/m³).
#[derive(Clone, Copy, Debug)]
pub struct At<R> {
    /// State at the point.
    pub state: State<R>,
    /// Controls at the point.
    pub controls: Controls<R>,
    /// Air density in kg/m³.
    pub density: R,
}

impl<R: Real> At<R> {
    /// The airflow at the point.
    #[inline(always)]
    pub fn air(&self, model: &GreyBox) -> AirData<R> {
        AirData::new(&self.state, self.density, ALOFT, &model.airframe.geometry)
    }

    /// Outputs of the prior of `model`. With `WHOLE`, all effects are evaluated. Without it, the dependent effects are
    /// left out, and their code is not compiled in.
    #[inline(always)]
    pub fn ask<const WHOLE: bool>(&self, model: &GreyBox) -> PriorOutputs<R> {
        let air = self.air(model);
        let (acceleration, spin) = if WHOLE {
            model.accelerations_inlined(&self.state, &self.controls, &air)
        } else {
            model.independent_accelerations(&self.state, &self.controls, &air)
        };
        let rate = rigid_body::state_rate(&self.state, &air, acceleration, spin);
        PriorOutputs { acceleration, spin, rate }
    }

    /// Gradient of the loss with respect to the state, from the gradient `slopes` with respect to the outputs.
    #[inline(always)]
    pub fn slope<const WHOLE: bool>(&self, model: &GreyBox, slopes: &Slopes<R>) -> [R; 8] {
        transposed(&self.state.to_array(), &Asked::<R, WHOLE> { model, at: self, slopes })
    }
}

/// The prior as a function of the state, with the gradient of the loss with respect to its outputs.
struct Asked<'a, R, const WHOLE: bool> {
    model: &'a GreyBox,
    at: &'a At<R>,
    slopes: &'a Slopes<R>,
}

impl<R: Real, const WHOLE: bool> Sloped<R, 8> for Asked<'_, R, WHOLE> {
    #[inline(always)]
    fn part(&self, x: [Dual<2, R>; 8]) -> [R; 2] {
        let controls = self.at.controls.map(fixed);
        let at = At { state: State::from_array(x), controls, density: fixed(self.at.density) };
        let outputs = at.ask::<WHOLE>(self.model);
        let slopes = self.slopes;
        let mut sum = [R::zero(); 2];
        for i in 0..3 {
            add(&mut sum, &outputs.acceleration[i], slopes.acceleration[i]);
            add(&mut sum, &outputs.spin[i], slopes.spin[i]);
        }
        for (out, slope) in outputs.rate.to_array().iter().zip(slopes.rate.to_array()) {
            add(&mut sum, out, slope);
        }
        sum
    }
}

/// A function of `N` inputs, with the gradient of the loss with respect to its outputs.
///
/// This is a trait instead of a closure because its method can be forced to inline. A function call would leave the
/// code that is compiled for vector instructions.
pub trait Sloped<R: Real, const N: usize> {
    /// Derivatives of the loss in two directions. The gradients of `inputs` define the directions.
    fn part(&self, inputs: [Dual<2, R>; N]) -> [R; 2];
}

/// A constant as a dual number.
#[inline(always)]
pub fn fixed<R: Real>(x: R) -> Dual<2, R> {
    Dual { value: x, gradient: [R::zero(); 2] }
}

/// Gradient of the loss with respect to `inputs`.
///
/// The function is evaluated once for every two inputs. More inputs at a time would make the compiled code larger, because
/// the prior is inlined for each. The time matters little: the network takes far more.
#[inline(always)]
pub fn transposed<R: Real, const N: usize>(
    inputs: &[R; N],
    function: &impl Sloped<R, N>,
) -> [R; N] {
    let mut sums = [R::zero(); N];
    let one = R::from_f64(1.0);
    let mut first = 0;
    while first < N {
        let mut marked = [fixed(one); N];
        for (marked, x) in marked.iter_mut().zip(inputs) {
            marked.value = *x;
        }
        marked[first].gradient[0] = one;
        if first + 1 < N {
            marked[first + 1].gradient[1] = one;
        }
        let pair = function.part(marked);
        sums[first] = pair[0];
        if first + 1 < N {
            sums[first + 1] = pair[1];
        }
        first += 2;
    }
    sums
}

/// Adds the gradient of the output `out` to `sum`, multiplied by the derivative `slope` of the loss with respect to `out`.
#[inline(always)]
pub fn add<R: Real>(sum: &mut [R; 2], out: &Dual<2, R>, slope: R) {
    for (sum, g) in sum.iter_mut().zip(out.gradient) {
        *sum = g.mul_add(slope, *sum);
    }
}

impl<R: Packet> At<R> {
    /// Adds the gradient of the loss with respect to the coefficients to `sums`, and the derivative with respect to
    /// Jxz to the last entry.
    ///
    /// The gradient is exact for effects that are linear in their coefficients. Without `WHOLE`, the model must not have
    /// dependent effects.
    #[inline(always)]
    pub fn coefficients<const WHOLE: bool>(
        &self,
        model: &GreyBox,
        slopes: &Slopes<R>,
        sums: &mut [R],
    ) {
        let air = self.air(model);
        let body = model.body.map(R::from_f64);
        let (push, turn) = rigid_body::state_rate_transposed(&self.state, &air, &slopes.rate);
        let (mut push, mut turn) = (push, turn);
        for i in 0..3 {
            push[i] += slopes.acceleration[i];
            turn[i] += slopes.spin[i];
        }
        let wrench = rigid_body::accelerations_transposed(&body, &air, model.axes, push, turn);
        let moment = if WHOLE {
            self.whole(model, &air, &wrench, sums)
        } else {
            let moment = [R::zero(); 3];
            let mut tally = Tally { model, first: 0, wrench: &wrench, sums: &mut *sums, moment };
            model.report_independent(&self.state, &self.controls, &air, &mut tally);
            tally.moment
        };
        let mut dual = body.map(fixed);
        dual.jxz = Dual::variable(body.jxz, 0);
        let (state, moment) = (self.state.map(fixed), each(moment, fixed));
        let spin = rigid_body::angular_acceleration(&dual, &state, moment);
        if let Some(last) = sums.last_mut() {
            for (spin, turn) in spin.iter().zip(turn) {
                *last = spin.gradient[0].mul_add(turn, *last);
            }
        }
    }
}

impl<R: Packet> At<R> {
    /// Adds the gradient of the loss with respect to the coefficients of all effects to `sums`. `wrench` is its gradient
    /// with respect to forces and moments. Returns the moments of all effects.
    ///
    /// Dependent effects use three sums over the independent effects: at the point, with neutral surfaces, and with
    /// neutral surfaces and zero body rates. The gradient with respect to these sums is propagated to the
    /// coefficients of the independent effects.
    #[inline(always)]
    fn whole(
        &self,
        model: &GreyBox,
        air: &AirData<R>,
        wrench: &Wrench<R>,
        sums: &mut [R],
    ) -> Vector<R> {
        let made = model.independent_sums(&self.state, &self.controls, air);
        let mut back = [Wrench::zero(); 3];
        // directions: the channels of the sums, then the coefficients of the dependent effects, two at a time
        let mut own = model.dependent_coefficients();
        let (mut first, mut more) = (0, true);
        while more {
            let mut moves = Moves { channels: [None; 2], places: [None; 2] };
            for k in 0..2 {
                match first + k {
                    n if n < CHANNELS_OF_SUMS => moves.channels[k] = Some(n),
                    _ => moves.places[k] = own.next(),
                }
            }
            let slopes = self.moved(model, &made, wrench, &moves);
            for (k, slope) in slopes.into_iter().enumerate() {
                if let Some(n) = moves.channels[k] {
                    back[n / 7].add(Channel::ALL[n % 7], slope);
                }
                if let Some(sum) = moves.places[k].and_then(|place| sums.get_mut(place)) {
                    *sum += slope;
                }
            }
            first += 2;
            more = first < CHANNELS_OF_SUMS || moves.places[1].is_some();
        }
        let parts = parted(&self.state, &self.controls, air);
        let places = [(self.state, self.controls, *air), parts[0], parts[1]];
        let count = if model.needs() >= Needs::Parts { 3 } else { 1 };
        for ((state, controls, air), slope) in places.iter().zip(&back).take(count) {
            let moment = [R::zero(); 3];
            let mut tally = Tally { model, first: 0, wrench: slope, sums: &mut *sums, moment };
            model.report_independent(state, controls, air, &mut tally);
        }
        let made = model.whole_wrench(&self.state, &self.controls, air, made, model.coefficients());
        [Channel::Roll, Channel::Pitch, Channel::Yaw].map(|c| made.get(c))
    }

    /// Derivatives of the loss in two directions `moves`, from its gradient `wrench` with respect to the forces and
    /// moments of all effects.
    #[inline(always)]
    fn moved(
        &self,
        model: &GreyBox,
        made: &[Wrench<R>; 3],
        wrench: &Wrench<R>,
        moves: &Moves,
    ) -> [R; 2] {
        let one = R::from_f64(1.0);
        let mut sums = [Wrench::zero(); 3];
        for (n, sum) in sums.iter_mut().enumerate() {
            for (c, channel) in Channel::ALL.into_iter().enumerate() {
                let mut x = fixed(made[n].get(channel));
                for (gradient, moved) in x.gradient.iter_mut().zip(moves.channels) {
                    if moved == Some(7 * n + c) {
                        *gradient = one;
                    }
                }
                sum.add(channel, x);
            }
        }
        let controls = self.controls.map(fixed);
        let place = At { state: self.state.map(fixed), controls, density: fixed(self.density) };
        let (air, weights) = (place.air(model), Marked { model, places: moves.places });
        let made = model.whole_wrench(&place.state, &place.controls, &air, sums, weights);
        let mut sum = [R::zero(); 2];
        Channel::ALL.iter().for_each(|c| add(&mut sum, &made.get(*c), wrench.get(*c)));
        sum
    }
}

/// Number of channels of the three sums of [`GreyBox::independent_sums`].
const CHANNELS_OF_SUMS: usize = 21;

/// Two directions of differentiation. A direction is a channel of the three sums, numbered consecutively, or the
/// coefficient at an index.
struct Moves {
    channels: [Option<usize>; 2],
    places: [Option<usize>; 2],
}

/// Coefficients of the model, of which up to two are directions of differentiation.
#[derive(Clone, Copy)]
struct Marked<'a> {
    model: &'a GreyBox,
    places: [Option<usize>; 2],
}

impl<R: Real> Weights<Dual<2, R>> for Marked<'_> {
    #[inline(always)]
    fn weigh(self, place: usize, amount: Dual<2, R>) -> Dual<2, R> {
        let mut product = amount.scale(self.model.coefficients()[place].value);
        for (gradient, moved) in product.gradient.iter_mut().zip(self.places) {
            if moved == Some(place) {
                *gradient += amount.value;
            }
        }
        product
    }
}

/// Collects the terms of the independent effects: the gradient of the loss with respect to their coefficients, and their
/// moments.
struct Tally<'a, R> {
    model: &'a GreyBox,
    first: usize,
    wrench: &'a Wrench<R>,
    sums: &'a mut [R],
    moment: Vector<R>,
}

impl<R: Real> Terms<R> for Tally<'_, R> {
    #[inline(always)]
    fn add(&mut self, index: usize, channel: Channel, amount: R) {
        let place = self.first + index;
        self.sums[place] = amount.mul_add(self.wrench.get(channel), self.sums[place]);
        let axis = match channel {
            Channel::Roll => 0,
            Channel::Pitch => 1,
            Channel::Yaw => 2,
            _ => return,
        };
        let value = R::from_f64(self.model.coefficients()[place].value);
        self.moment[axis] = amount.mul_add(value, self.moment[axis]);
    }
}

impl<R: Real> Starting<R> for Tally<'_, R> {
    #[inline(always)]
    fn start_at(&mut self, first: usize) {
        self.first = first;
    }
}

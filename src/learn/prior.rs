//! The prior at a point: its rates, and the slopes through it to state and coefficients.

use crate::learn::packet::Packet;
use crate::model::{GreyBox, Starting};
use crate::num::{Dual, Real};
use crate::physics::rigid_body::{self, Vector};
use crate::physics::effects::Terms;
use crate::physics::{AirData, Channel, Controls, State, Wrench};

/// Altitude given to the airflow, m: far from the ground. What air there is comes with the density.
pub const ALOFT: f64 = f64::INFINITY;

/// What the prior says at a point.
#[derive(Clone, Copy, Debug)]
pub struct Said<R> {
    /// Specific force plus gravity, body axes, m/s².
    pub acceleration: Vector<R>,
    /// Angular acceleration, rad/s².
    pub spin: Vector<R>,
    /// F_p, the rates of the state.
    pub rate: State<R>,
}

/// Slopes of the loss with respect to the three of [`Said`].
#[derive(Clone, Copy, Debug)]
pub struct Slopes<R> {
    /// With respect to the acceleration.
    pub acceleration: Vector<R>,
    /// With respect to the angular acceleration.
    pub spin: Vector<R>,
    /// With respect to the rates.
    pub rate: State<R>,
}

/// Where the prior is asked: state, controls and air density (kg/m³).
#[derive(Clone, Copy, Debug)]
pub struct At<R> {
    /// The state.
    pub state: State<R>,
    /// The controls.
    pub controls: Controls<R>,
    /// Air density, kg/m³.
    pub density: R,
}

impl<R: Real> At<R> {
    /// The airflow there.
    #[inline(always)]
    pub fn air(&self, model: &GreyBox) -> AirData<R> {
        AirData::new(&self.state, self.density, ALOFT, &model.airframe.geometry)
    }

    /// What the prior of `model` says.
    #[inline(always)]
    pub fn ask(&self, model: &GreyBox) -> Said<R> {
        let air = self.air(model);
        let (acceleration, spin) =
            model.independent_accelerations(&self.state, &self.controls, &air);
        let rate = rigid_body::state_rate(&self.state, &air, acceleration, spin);
        Said { acceleration, spin, rate }
    }

    /// The slope with respect to the state.
    #[inline(always)]
    pub fn slope(&self, model: &GreyBox, slopes: &Slopes<R>) -> [R; 8] {
        transposed(&self.state.to_array(), |x| {
            let fixed = |x: R| Dual { value: x, gradient: [R::zero(); 2] };
            let Controls { aileron, elevator, throttle } = self.controls;
            let [aileron, elevator, throttle] = [aileron, elevator, throttle].map(fixed);
            let controls = Controls { aileron, elevator, throttle };
            let at = At { state: State::from_array(x), controls, density: fixed(self.density) };
            let said = at.ask(model);
            let mut sum = [R::zero(); 2];
            for i in 0..3 {
                add(&mut sum, &said.acceleration[i], slopes.acceleration[i]);
                add(&mut sum, &said.spin[i], slopes.spin[i]);
            }
            let rates = said.rate.to_array().into_iter().zip(slopes.rate.to_array());
            rates.for_each(|(out, slope)| add(&mut sum, &out, slope));
            sum
        })
    }
}

/// Σ of slopes times derivatives with respect to each of `inputs`, two at a time: `part` makes the sum
/// from the inputs with two directions marked.
///
/// Two at a time and not all at once, because the compiler has to see the prior whole in each
/// direction, and because what the network costs is far more.
#[inline(always)]
pub fn transposed<R: Real, const N: usize>(
    inputs: &[R; N],
    part: impl Fn([Dual<2, R>; N]) -> [R; 2],
) -> [R; N] {
    let mut sums = [R::zero(); N];
    let (zero, one) = (R::zero(), R::from_f64(1.0));
    for first in (0..N).step_by(2) {
        let mark = |i: usize| [if i == first { one } else { zero }, if i == first + 1 { one } else { zero }];
        let marked = std::array::from_fn(|i| Dual { value: inputs[i], gradient: mark(i) });
        let pair = part(marked);
        sums[first] = pair[0];
        if let Some(sum) = sums.get_mut(first + 1) {
            *sum = pair[1];
        }
    }
    sums
}

/// Adds the derivatives of an output times its slope.
#[inline(always)]
pub fn add<R: Real>(sum: &mut [R; 2], out: &Dual<2, R>, slope: R) {
    for (sum, g) in sum.iter_mut().zip(out.gradient) {
        *sum = g.mul_add(slope, *sum);
    }
}

impl<R: Packet> At<R> {
    /// Adds the slopes with respect to the coefficients, then to Jxz, the last of `sums`.
    ///
    /// Exact for effects that need only the point and are linear in the coefficients asked for.
    #[inline(always)]
    pub fn coefficients(&self, model: &GreyBox, slopes: &Slopes<R>, sums: &mut [R]) {
        let air = self.air(model);
        let body = model.body.map(R::from_f64);
        let (push, turn) = rigid_body::state_rate_transposed(&self.state, &air, &slopes.rate);
        let push = std::array::from_fn(|i| push[i] + slopes.acceleration[i]);
        let turn: Vector<R> = std::array::from_fn(|i| turn[i] + slopes.spin[i]);
        let wrench = rigid_body::accelerations_transposed(&body, &air, model.axes, push, turn);
        let mut tally =
            Tally { model, first: 0, wrench: &wrench, sums: &mut *sums, moment: [R::zero(); 3] };
        model.report_independent(&self.state, &self.controls, &air, &mut tally);
        let moment = tally.moment;
        let fixed = |x: R| Dual { value: x, gradient: [R::zero(); 1] };
        let mut dual = body.map(fixed);
        dual.jxz = Dual::variable(body.jxz, 0);
        let spin = rigid_body::angular_acceleration(&dual, &self.state.map(fixed), moment.map(fixed));
        if let Some(last) = sums.last_mut() {
            for (spin, turn) in spin.iter().zip(turn) {
                *last = spin.gradient[0].mul_add(turn, *last);
            }
        }
    }
}

/// Takes the terms of a prior's effects: slopes with respect to coefficients, and the moments.
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

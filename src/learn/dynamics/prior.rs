//! The prior at a point: its rates, and the slopes through it to state and coefficients.

use crate::learn::dynamics::packet::Packet;
use crate::model::{GreyBox, Starting};
use crate::num::{Dual, Real, each};
use crate::physics::effects::Terms;
use crate::physics::rigid_body::{self, Vector};
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
        transposed(&self.state.to_array(), &Asked { model, at: self, slopes })
    }
}

/// The prior as a function of the state, with the slopes with respect to what it says.
struct Asked<'a, R> {
    model: &'a GreyBox,
    at: &'a At<R>,
    slopes: &'a Slopes<R>,
}

impl<R: Real> Sloped<R, 8> for Asked<'_, R> {
    #[inline(always)]
    fn part(&self, x: [Dual<2, R>; 8]) -> [R; 2] {
        let Controls { aileron, elevator, throttle, rudder } = self.at.controls;
        let controls = Controls {
            aileron: fixed(aileron),
            elevator: fixed(elevator),
            throttle: fixed(throttle),
            rudder: fixed(rudder),
        };
        let at = At { state: State::from_array(x), controls, density: fixed(self.at.density) };
        let said = at.ask(self.model);
        let slopes = self.slopes;
        let mut sum = [R::zero(); 2];
        for i in 0..3 {
            add(&mut sum, &said.acceleration[i], slopes.acceleration[i]);
            add(&mut sum, &said.spin[i], slopes.spin[i]);
        }
        for (out, slope) in said.rate.to_array().iter().zip(slopes.rate.to_array()) {
            add(&mut sum, out, slope);
        }
        sum
    }
}

/// A function of `N` inputs, with slopes with respect to its outputs.
///
/// A trait and not a closure, because its method can be made to be inlined: vector instructions end
/// where a call begins.
pub trait Sloped<R: Real, const N: usize> {
    /// Σ over outputs of slope times derivative, in the two directions that the inputs mark.
    fn part(&self, inputs: [Dual<2, R>; N]) -> [R; 2];
}

/// A number that does not move.
#[inline(always)]
pub fn fixed<R: Real>(x: R) -> Dual<2, R> {
    Dual { value: x, gradient: [R::zero(); 2] }
}

/// Σ of slopes times derivatives with respect to each of `inputs`, two at a time.
///
/// Two at a time and not all at once, because the compiler has to see the prior whole in each
/// direction, and because what the network costs is far more.
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
        let (mut push, mut turn) = (push, turn);
        for i in 0..3 {
            push[i] += slopes.acceleration[i];
            turn[i] += slopes.spin[i];
        }
        let wrench = rigid_body::accelerations_transposed(&body, &air, model.axes, push, turn);
        let mut tally =
            Tally { model, first: 0, wrench: &wrench, sums: &mut *sums, moment: [R::zero(); 3] };
        model.report_independent(&self.state, &self.controls, &air, &mut tally);
        let moment = tally.moment;
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

//! Forces and moments, accelerations and state rates of a model: a sum of physical effects and a learned residual.
//!
//! Effects that need only the point of evaluation (state, controls and airflow) are summed first, in separate code, where a
//! planner spends most of its time. The input of the other effects, [`Base`], is computed only if a model has such effects.
//!
//! Functions with names `…_inlined` become part of their caller. A kernel compiled for several instruction sets must call
//! only these. Other callers use the functions without this suffix, which are compiled once.

use super::GreyBox;
use super::calls::{Called, Forces};
use super::grey_box::{Named, Term};
use greylag_num::Real;
use greylag_physics::effects::{Needs, Terms};
use greylag_physics::point::Base;
use greylag_physics::rigid_body::{self, Vector};
use greylag_physics::{AirData, Channel, Controls, Point, State, Wrench};

/// Number of fixed-point iterations for the effects that depend on the time derivative of the state. Each iteration reduces
/// the error by a factor of two or more for any allowed `unsteady_lift`, and by a factor of ten for usual coefficients.
const RATE_PASSES: usize = 4;

/// The point of evaluation: state, controls and airflow.
#[derive(Clone, Copy)]
pub(super) struct Place<'a, R> {
    pub(super) state: &'a State<R>,
    pub(super) controls: &'a Controls<R>,
    pub(super) air: &'a AirData<R>,
}

/// Coefficients by which the terms are multiplied.
pub trait Weights<R>: Copy {
    /// Product of `amount` and the coefficient at index `place` in the model's list.
    fn weigh(self, place: usize, amount: R) -> R;
}

impl<R: Real> Weights<R> for &[Named] {
    #[inline(always)]
    fn weigh(self, place: usize, amount: R) -> R {
        amount.scale(self[place].value)
    }
}

/// Sum of terms multiplied by their coefficients.
pub(super) struct Sum<W, R> {
    pub(super) weights: W,
    /// Index of the first coefficient of the effect that is being evaluated.
    pub(super) first: usize,
    pub(super) wrench: Wrench<R>,
}

/// Receiver that calls `term` with each term and the index of its coefficient in the model's list.
struct Each<'a, F> {
    first: usize,
    term: &'a mut F,
}

/// Receiver of the terms of several effects. Before the terms of an effect, it gets the index of the effect's first
/// coefficient.
pub trait Starting<R>: Terms<R> {
    /// Announces the terms of the effect whose first coefficient has the index `first` in the model's list.
    fn start_at(&mut self, first: usize);
}

impl<R: Real, W: Weights<R>> Terms<R> for Sum<W, R> {
    #[inline(always)]
    fn add(&mut self, index: usize, channel: Channel, amount: R) {
        self.wrench.add(channel, self.weights.weigh(self.first + index, amount));
    }
}

impl<R: Real, F: FnMut(usize, Channel, R)> Terms<R> for Each<'_, F> {
    #[inline(always)]
    fn add(&mut self, index: usize, channel: Channel, amount: R) {
        (self.term)(self.first + index, channel, amount);
    }
}

impl<R: Real, W: Weights<R>> Starting<R> for Sum<W, R> {
    #[inline(always)]
    fn start_at(&mut self, first: usize) {
        self.first = first;
    }
}

impl<R: Real, F: FnMut(usize, Channel, R)> Starting<R> for Each<'_, F> {
    #[inline(always)]
    fn start_at(&mut self, first: usize) {
        self.first = first;
    }
}

/// The point of evaluation with neutral surfaces, and the point with neutral surfaces and zero body rates.
#[inline(always)]
pub fn parted<R: Real>(
    state: &State<R>,
    controls: &Controls<R>,
    air: &AirData<R>,
) -> [(State<R>, Controls<R>, AirData<R>); 2] {
    let zero = R::zero();
    let controls = Controls { aileron: zero, elevator: zero, rudder: zero, ..*controls };
    let still = State { p: zero, q: zero, r: zero, ..*state };
    let without = AirData { p_hat: zero, q_hat: zero, r_hat: zero, ..*air };
    [(*state, controls, *air), (still, controls, without)]
}

impl GreyBox {
    /// Total forces (N) and moments (N m) of all effects, without gravity and the residual.
    pub fn wrench<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> Wrench<R> {
        self.wrench_inlined(state, controls, air)
    }

    #[inline(always)]
    fn wrench_inlined<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> Wrench<R> {
        let place = Place { state, controls, air };
        let wrench = self.independent_sum(&place);
        if self.independent == self.terms.len() {
            return wrench;
        }
        self.with_dependent(&place, wrench).1
    }

    /// Calls `term` with the contribution of one unit of each coefficient: the coefficient's index in
    /// [`coefficients`](GreyBox::coefficients), a channel and the amount (N or N m).
    pub fn contributions<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        mut term: impl FnMut(usize, Channel, R),
    ) {
        let place = Place { state, controls, air };
        let mut each = Each { first: 0, term: &mut term };
        self.independent_terms(&place, &mut each);
        if self.independent < self.terms.len() {
            let base = self.base(&place);
            self.dependent_terms(&place, &base, &mut each);
        }
    }

    /// Input of the effects that need more than the point: the forces of the other effects, and the rate of the state.
    fn base<R: Real>(&self, place: &Place<R>) -> Base<R> {
        self.with_dependent(place, self.independent_sum(place)).0
    }

    /// Passes the terms of the effects that need only the point to `terms`.
    #[inline(always)]
    pub(super) fn independent_terms<R: Real>(
        &self,
        place: &Place<R>,
        terms: &mut impl Starting<R>,
    ) {
        let base = Base::zero();
        let at = self.point(place, &base);
        for Term { kind, first, points, shape, .. } in &self.terms[..self.independent] {
            let own = points.own(shape, 0);
            terms.start_at(*first);
            kind.independent_basis(&at, own, terms);
        }
    }

    /// Passes the terms of the effects that need more than the point to `terms`. Their input is `base`.
    #[inline(always)]
    fn dependent_terms<R: Real>(
        &self,
        place: &Place<R>,
        base: &Base<R>,
        terms: &mut impl Starting<R>,
    ) {
        let at = self.point(place, base);
        for Term { kind, first, points, shape, first_lag } in &self.terms[self.independent..] {
            let own = points.own(shape, *first_lag);
            terms.start_at(*first);
            kind.dependent_basis(&at, own, terms);
        }
    }

    #[inline(always)]
    fn point<'a, R: Real>(&'a self, place: &Place<'a, R>, base: &'a Base<R>) -> Point<'a, R> {
        let Place { state, controls, air } = *place;
        Point { state, controls, air, geometry: &self.airframe.geometry, axes: self.axes, base }
    }

    /// Sum of the effects that need only the point.
    #[inline(always)]
    fn independent_sum<R: Real>(&self, place: &Place<R>) -> Wrench<R> {
        let weights = self.coefficients.as_slice();
        let mut sum = Sum { weights, first: 0, wrench: Wrench::zero() };
        self.independent_terms(place, &mut sum);
        sum.wrench
    }

    /// Input of the effects that need more than the point, and the sum of all effects. `independent` is the sum of the
    /// effects that need only the point.
    #[inline(always)]
    fn with_dependent<R: Real>(
        &self,
        place: &Place<R>,
        independent: Wrench<R>,
    ) -> (Base<R>, Wrench<R>) {
        let parts = (self.needs() >= Needs::Parts).then(|| self.parts(place));
        self.completed(place, independent, parts, self.coefficients.as_slice())
    }

    /// [`with_dependent`](GreyBox::with_dependent) with given [`parts`](GreyBox::parts), which are `None` if no effect needs
    /// them. `weights` are the coefficients of the effects that need more than the point.
    #[inline(always)]
    pub(super) fn completed<R: Real>(
        &self,
        place: &Place<R>,
        independent: Wrench<R>,
        parts: Option<[Wrench<R>; 2]>,
        weights: impl Weights<R>,
    ) -> (Base<R>, Wrench<R>) {
        let mut base = Base::zero();
        base.wrench = independent;
        base.force = rigid_body::body_force(&base.wrench, place.air, self.axes);
        if let Some([centred, still]) = parts {
            base.deflected = base.wrench.minus(&centred);
            base.still = still;
        }
        let mut passes = if self.needs() >= Needs::Rate { RATE_PASSES } else { 0 };
        loop {
            let mut sum = Sum { weights, first: 0, wrench: base.wrench };
            self.dependent_terms(place, &base, &mut sum);
            if passes == 0 {
                return (base, sum.wrench);
            }
            passes -= 1;
            let (acceleration, spin) =
                self.accelerations_under(&sum.wrench, place.state, place.air);
            base.rate = rigid_body::state_rate(place.state, place.air, acceleration, spin);
        }
    }

    /// Sums of the effects that need only the point: with neutral surfaces, and with neutral surfaces and zero body rates.
    #[inline(always)]
    fn parts<R: Real>(&self, place: &Place<R>) -> [Wrench<R>; 2] {
        let mut sums = [Wrench::zero(); 2];
        for (sum, (state, controls, air)) in
            sums.iter_mut().zip(parted(place.state, place.controls, place.air))
        {
            *sum = self.independent_sum(&Place { state: &state, controls: &controls, air: &air });
        }
        sums
    }

    /// Passes the terms of the effects that need only the point to `terms`. The code is inlined into the caller.
    #[cfg(feature = "learn")]
    #[inline(always)]
    pub fn report_independent<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        terms: &mut impl Starting<R>,
    ) {
        self.independent_terms(&Place { state, controls, air }, terms);
    }

    /// [`accelerations`](GreyBox::accelerations) due to the effects that need only the point, inlined into the caller. These
    /// are all effects if [`needs`](GreyBox::needs) is [`Needs::Point`].
    #[cfg(feature = "learn")]
    #[inline(always)]
    pub fn independent_accelerations<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        let wrench = self.independent_sum(&Place { state, controls, air });
        self.accelerations_under(&wrench, state, air)
    }

    /// Sums of the effects that need only the point: at the point, with neutral surfaces, and with neutral surfaces and zero
    /// body rates. The last two sums are zero if no effect needs them.
    #[cfg(feature = "learn")]
    #[inline(always)]
    pub fn independent_sums<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> [Wrench<R>; 3] {
        let place = Place { state, controls, air };
        let mut sums = [self.independent_sum(&place), Wrench::zero(), Wrench::zero()];
        if self.needs() >= Needs::Parts {
            [sums[1], sums[2]] = self.parts(&place);
        }
        sums
    }

    /// Total forces and moments from [`independent_sums`](GreyBox::independent_sums). `weights` are the coefficients of the
    /// effects that need more than the point.
    #[cfg(feature = "learn")]
    #[inline(always)]
    pub fn whole_wrench<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        [independent, centred, still]: [Wrench<R>; 3],
        weights: impl Weights<R>,
    ) -> Wrench<R> {
        let place = Place { state, controls, air };
        let parts = (self.needs() >= Needs::Parts).then_some([centred, still]);
        self.completed(&place, independent, parts, weights).1
    }

    /// Indices of the coefficients of the effects that need more than the point. Shape constants, in which an effect is
    /// nonlinear, are omitted.
    #[cfg(feature = "learn")]
    pub fn dependent_coefficients(&self) -> impl Iterator<Item = usize> + '_ {
        self.terms[self.independent..].iter().flat_map(|term| {
            let about = term.kind.describe();
            term.first..term.first + about.coefficients.len() - about.shape
        })
    }

    /// Linear acceleration (specific force plus gravity, m/s²) and angular acceleration (rad/s²) in body axes, without the
    /// residual.
    #[inline(never)]
    pub fn accelerations<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        self.accelerations_inlined(state, controls, air)
    }

    /// [`accelerations`](GreyBox::accelerations), inlined into the caller.
    #[inline(always)]
    pub fn accelerations_inlined<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        let wrench = self.wrench_inlined(state, controls, air);
        self.accelerations_under(&wrench, state, air)
    }

    #[inline(always)]
    pub(super) fn accelerations_under<R: Real>(
        &self,
        wrench: &Wrench<R>,
        state: &State<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        let body = self.body.map(R::from_f64);
        let force = rigid_body::body_force(wrench, air, self.axes);
        let gravity = rigid_body::gravity_in_body(state, self.atmosphere.gravity);
        let acceleration = [
            force[0] / body.mass + gravity[0],
            force[1] / body.mass + gravity[1],
            force[2] / body.mass + gravity[2],
        ];
        let moment =
            [wrench.get(Channel::Roll), wrench.get(Channel::Pitch), wrench.get(Channel::Yaw)];
        (acceleration, rigid_body::angular_acceleration(&body, state, moment))
    }

    /// Time derivative ṡ of the state at `altitude` (m), in units of [`State`] per second, including the residual.
    pub fn rate<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
    ) -> State<R> {
        self.rate_from(state, controls, altitude, Called)
    }

    /// The same as `rate`, with `forces` that are called or inlined.
    #[inline(always)]
    pub(super) fn rate_from<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        forces: impl Forces<R>,
    ) -> State<R> {
        let air = self.air(state, altitude);
        let (acceleration, spin) = forces.accelerations(self, state, controls, &air);
        let rate = rigid_body::state_rate(state, &air, acceleration, spin);
        match &self.residual {
            Some(residual) => rate.advance(&forces.learned(residual, state, controls), 1.0),
            None => rate,
        }
    }
}

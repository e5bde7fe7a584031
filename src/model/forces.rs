//! Forces and moments, accelerations and state rates of a model.
//!
//! Effects that need only the point are summed first, in separate code; a planner spends most of its time there. A
//! model computes the input of the other effects, [`Base`], only if it has such effects.
//!
//! Functions named `…_inlined` become part of their caller, so that a kernel compiled for several instruction sets
//! stays within its own; other callers use the plain ones, which are compiled once.

use super::GreyBox;
use super::calls::{Called, Forces};
use super::grey_box::{Named, Term};
use greylag_num::Real;
use greylag_physics::effects::{Needs, Terms};
use greylag_physics::point::Base;
use greylag_physics::rigid_body::{self, Vector};
use greylag_physics::{AirData, Channel, Controls, Point, State, Wrench};

/// Fixed-point passes over the effects that depend on the state's rate. Each pass reduces the error by at least a
/// factor of two within the bounds of `unsteady_lift`, by a factor of ten at usual values.
const RATE_PASSES: usize = 4;

/// Point of evaluation: state, controls, airflow.
#[derive(Clone, Copy)]
struct Place<'a, R> {
    state: &'a State<R>,
    controls: &'a Controls<R>,
    air: &'a AirData<R>,
}

/// Coefficients that weight the terms.
pub trait Weights<R>: Copy {
    /// Product of `amount` and the coefficient at index `place` of the model's list.
    fn weigh(self, place: usize, amount: R) -> R;
}

impl<R: Real> Weights<R> for &[Named] {
    #[inline(always)]
    fn weigh(self, place: usize, amount: R) -> R {
        amount.scale(self[place].value)
    }
}

/// Sum of terms weighted by their coefficients.
struct Sum<W, R> {
    weights: W,
    /// Index of the reporting effect's first coefficient.
    first: usize,
    wrench: Wrench<R>,
}

/// Terms passed on with the index of their coefficient in the whole model.
struct Each<'a, F> {
    first: usize,
    term: &'a mut F,
}

/// Receiver of the terms of effects that start at a given index of the model's coefficients.
pub trait Starting<R>: Terms<R> {
    /// Announces the terms of an effect whose first coefficient has this index.
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

/// Evaluation points with the surfaces centred, and also without body rates.
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
    /// Total force and moment of all effects.
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

    /// Contribution of one unit of each coefficient: calls `term` with its index in
    /// [`coefficients`](GreyBox::coefficients), a channel and the amount in N or N m.
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

    /// Input of the effects that need more than the point.
    fn base<R: Real>(&self, place: &Place<R>) -> Base<R> {
        self.with_dependent(place, self.independent_sum(place)).0
    }

    /// Reports the terms of effects that need only the point.
    #[inline(always)]
    fn independent_terms<R: Real>(&self, place: &Place<R>, terms: &mut impl Starting<R>) {
        let base = Base::zero();
        let at = self.point(place, &base);
        for Term { kind, first, points, shape, .. } in &self.terms[..self.independent] {
            let own = points.own(shape, 0);
            terms.start_at(*first);
            kind.independent_basis(&at, own, terms);
        }
    }

    /// Reports the terms of the other effects, given their input `base`.
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
        let mut sum = self.sum_from(Wrench::zero());
        self.independent_terms(place, &mut sum);
        sum.wrench
    }

    #[inline(always)]
    fn sum_from<R>(&self, wrench: Wrench<R>) -> Sum<&[Named], R> {
        Sum { weights: &self.coefficients, first: 0, wrench }
    }

    /// Input of the other effects, where `independent` is the sum of those that need only the point, and the sum of
    /// all.
    #[inline(always)]
    fn with_dependent<R: Real>(
        &self,
        place: &Place<R>,
        independent: Wrench<R>,
    ) -> (Base<R>, Wrench<R>) {
        let parts = (self.needs() >= Needs::Parts).then(|| self.parts(place));
        self.completed(place, independent, parts, self.coefficients.as_slice())
    }

    /// [`with_dependent`](GreyBox::with_dependent) from `independent` and, where an effect needs them, its
    /// [`parts`](GreyBox::parts), with the coefficients of the other effects from `weights`.
    #[inline(always)]
    fn completed<R: Real>(
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

    /// Sums of the effects that need only the point with the surfaces centred, and also without body rates.
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

    /// Reports the terms of effects that need only the point to `terms`; inlined into the caller.
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

    /// [`accelerations`](GreyBox::accelerations) due to the effects that need only the point, inlined into the
    /// caller; these are all effects if [`needs`](GreyBox::needs) is [`Needs::Point`].
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

    /// Sums of the effects that need only the point: unmodified, with the surfaces centred, and also without body
    /// rates; the last two are zero if no effect needs them.
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

    /// Total force and moment from [`independent_sums`](GreyBox::independent_sums), with `weights` as the
    /// coefficients of the other effects.
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

    /// Indices of the coefficients of the effects that need more than the point, without shape constants.
    #[cfg(feature = "learn")]
    pub fn dependent_coefficients(&self) -> impl Iterator<Item = usize> + '_ {
        self.terms[self.independent..].iter().flat_map(|term| {
            let about = term.kind.describe();
            term.first..term.first + about.coefficients.len() - about.shape
        })
    }

    /// Linear acceleration (specific force plus gravity, body axes, m/s²) and angular acceleration
    /// (rad/s²).
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
    fn accelerations_under<R: Real>(
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

    /// State derivative ṡ, units of [`State`] per second, at `altitude` (m).
    pub fn rate<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
    ) -> State<R> {
        self.rate_from(state, controls, altitude, Called)
    }

    /// As `rate`, with `forces` called or inlined.
    #[inline(always)]
    pub(super) fn rate_from<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        forces: impl Forces,
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

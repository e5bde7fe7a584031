//! The dynamics model: which effects act, with which coefficients, on which rigid body.

use crate::model::{Integrator, Residual};
use crate::num::{Real, Table};
use crate::physics::atmosphere::Atmosphere;
use crate::physics::effects::{Description, Kind, Needs, Own};
use crate::physics::inputs::{self, InputMemory};
use crate::physics::point::Base;
use crate::physics::rigid_body::{self, ForceAxes, RigidBody, Vector};
use crate::physics::{AirData, Airframe, Channel, Controls, Point, State, Wrench};

/// Passes over the effects that depend on the state's rate, each of which brings the rate at least
/// a factor of two closer.
const RATE_PASSES: usize = 4;

/// A coefficient of a model with its full name.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// `effect.coefficient`, as in the model file.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation as a prior, where the file states one.
    pub sd: Option<f64>,
}

/// Prior width of a coefficient whose file states none, as a share of its value.
const WIDTH: f64 = 0.15;

impl Named {
    /// Its standard deviation as a prior: the stated one, else 15 % of its value
    /// (`missing_effects.md`, step 4). A coefficient of zero without a stated width is held.
    pub fn width(&self) -> f64 {
        self.sd.unwrap_or(WIDTH * self.value.abs())
    }
}

/// An effect as a model uses it.
#[derive(Clone, Debug)]
pub(super) struct Term {
    pub(super) kind: Kind,
    /// Place of its first coefficient in the model's list.
    pub(super) first: usize,
    pub(super) table: Option<Table>,
    /// The values of its shape constants, kept beside it for speed.
    pub(super) shape: Vec<f64>,
}

impl Term {
    /// An effect whose coefficients start at `first`.
    pub(super) fn new(kind: Kind, first: usize, table: Option<Table>) -> Term {
        Term { kind, first, table, shape: vec![0.0; kind.describe().shape] }
    }
}

/// Why an effect cannot join a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JoinError {
    /// There is no such effect.
    #[error(
        "effect {id:?} is unknown to this program; `greylag effects list` names those it knows"
    )]
    Unknown {
        /// The id asked for.
        id: String,
    },
    /// The model has it already.
    #[error("model {model} has the effect {id} already; refit its coefficients instead")]
    Present {
        /// The model.
        model: String,
        /// The effect.
        id: &'static str,
    },
    /// It needs a table, which only a model file can give.
    #[error("effect {id} needs a table {table} over alpha_rad; write it into the model file")]
    Table {
        /// The effect.
        id: &'static str,
        /// The table.
        table: &'static str,
    },
    /// A value is not possible, or there are too few or too many.
    #[error("effect {id} takes {expected}; the values {values:?} do not fit")]
    Values {
        /// The effect.
        id: &'static str,
        /// What it takes.
        expected: String,
        /// What was given.
        values: Vec<f64>,
    },
    /// More input effects than a model can have.
    #[error(
        "model {model} has {most} effects between actuators and surfaces already, which is the most"
    )]
    Inputs {
        /// The model.
        model: String,
        /// The most.
        most: usize,
    },
}

/// ṡ = F_p(s, z; θ_p) + F_a(s, z; θ_a), eq. (19) of \[GSFM26\]: a sum of effects on a rigid body, with
/// what was learned beside it.
#[derive(Clone, Debug)]
pub struct GreyBox {
    /// The model's name, from its file.
    pub name: String,
    /// The aircraft it describes.
    pub airframe: Airframe,
    /// Mass and inertia as the model believes them, its effects on them included.
    pub body: RigidBody,
    /// Mass and inertia without those effects.
    pub(super) bare_body: RigidBody,
    /// Air and gravity as the model believes them.
    pub atmosphere: Atmosphere,
    /// Axes in which its aerodynamic forces act.
    pub axes: ForceAxes,
    /// How it steps through time.
    pub integrator: Integrator,
    /// What was learned beside the effects, F_a.
    pub residual: Option<Residual>,
    /// Effects that need only the point come first.
    pub(super) terms: Vec<Term>,
    /// Input effects with the place of their constant.
    pub(super) inputs: Vec<(inputs::Kind, usize)>,
    pub(super) coefficients: Vec<Named>,
}

impl GreyBox {
    /// The coefficients θ_p, in a fixed order.
    pub fn coefficients(&self) -> &[Named] {
        &self.coefficients
    }

    /// Changes one coefficient by its full name; `false` if the model has none of that name.
    pub fn set_coefficient(&mut self, name: &str, value: f64) -> bool {
        let Some(found) = self.coefficients.iter_mut().find(|c| c.name == name) else {
            return false;
        };
        found.value = value;
        self.renew();
        true
    }

    /// Changes all coefficients, in the order of [`coefficients`](GreyBox::coefficients).
    ///
    /// # Panics
    /// If there are more or fewer `values` than coefficients.
    pub fn set_coefficients(&mut self, values: &[f64]) {
        assert_eq!(values.len(), self.coefficients.len(), "a value for each coefficient");
        self.coefficients.iter_mut().zip(values).for_each(|(c, v)| c.value = *v);
        self.renew();
    }

    /// Changes mass and inertia; effects on them act on the new ones.
    pub fn set_body(&mut self, body: RigidBody) {
        self.bare_body = body;
        self.renew();
    }

    /// Mass and inertia without the effects on them.
    pub fn bare_body(&self) -> &RigidBody {
        &self.bare_body
    }

    /// Adds the effect `id` with `values` of its coefficients, in its own order.
    ///
    /// # Errors
    /// The effect is unknown, there already or needs a table, or the values are not possible.
    pub fn join(&mut self, id: &str, values: &[f64]) -> Result<(), JoinError> {
        let (about, kind) = match (Kind::from_id(id), inputs::Kind::from_id(id)) {
            (Some(kind), _) => (kind.describe(), Ok(kind)),
            (_, Some(kind)) => (kind.describe(), Err(kind)),
            _ => return Err(JoinError::Unknown { id: id.into() }),
        };
        self.may_join(&about, values)?;
        let first = self.coefficients.len();
        match kind {
            Ok(kind) => self.terms.push(Term::new(kind, first, None)),
            Err(_) if self.inputs.len() == inputs::MOST => {
                return Err(JoinError::Inputs { model: self.name.clone(), most: inputs::MOST });
            }
            Err(kind) => self.inputs.push((kind, first)),
        }
        self.coefficients.extend(about.coefficients.iter().zip(values).map(|(c, value)| Named {
            name: format!("{id}.{}", c.name),
            value: *value,
            sd: None,
        }));
        self.settle();
        Ok(())
    }

    fn may_join(&self, about: &Description, values: &[f64]) -> Result<(), JoinError> {
        let id = about.id;
        if self.has(id) {
            return Err(JoinError::Present { model: self.name.clone(), id });
        }
        if let Some(table) = about.table {
            return Err(JoinError::Table { id, table });
        }
        let possible = |(c, v): (&crate::physics::effects::Coefficient, &f64)| {
            (c.bounds.0..=c.bounds.1).contains(v)
        };
        let fits = values.len() == about.coefficients.len()
            && about.coefficients.iter().zip(values).all(possible);
        if fits {
            return Ok(());
        }
        let expected: Vec<_> = about
            .coefficients
            .iter()
            .map(|c| format!("{} in {}..{}", c.name, c.bounds.0, c.bounds.1))
            .collect();
        Err(JoinError::Values { id, expected: expected.join(", "), values: values.into() })
    }

    /// Whether the model has the effect `id`.
    pub fn has(&self, id: &str) -> bool {
        self.effects().any(|about| about.id == id)
    }

    /// The effects that the model names.
    pub fn effects(&self) -> impl Iterator<Item = Description> {
        let inputs = self.inputs.iter().map(|(kind, _)| kind.describe());
        self.terms.iter().map(|term| term.kind.describe()).chain(inputs)
    }

    /// Whether the model is linear in each of its coefficients, in their order.
    pub fn linear(&self) -> Vec<bool> {
        let mut linear = vec![false; self.coefficients.len()];
        for Term { kind, first, .. } in &self.terms {
            let about = kind.describe();
            linear[*first..first + about.coefficients.len() - about.shape].fill(true);
        }
        linear
    }

    /// Puts the effects in the order of evaluation, renews what the coefficients decide.
    pub(super) fn settle(&mut self) {
        self.terms.sort_by_key(|term| term.kind.needs());
        self.renew();
    }

    fn renew(&mut self) {
        self.body = self.bare_body;
        for Term { kind, first, shape, .. } in &mut self.terms {
            let about = kind.describe();
            let named = &self.coefficients[*first..*first + about.coefficients.len()];
            let values: Vec<f64> = named.iter().map(|c| c.value).collect();
            kind.change(&values, &mut self.body);
            shape.copy_from_slice(&values[values.len() - about.shape..]);
        }
    }

    /// What acts on the air when the actuators are measured at `controls`; called once every
    /// [`STEP`](crate::model::STEP).
    #[inline(always)]
    pub fn act<R: Real>(&self, controls: &Controls<R>, memory: &mut InputMemory<R>) -> Controls<R> {
        let mut acting = *controls;
        for (place, (kind, index)) in self.inputs.iter().enumerate() {
            acting = memory.act(place, *kind, self.coefficients[*index].value, &acting);
        }
        acting
    }

    /// Whether the surfaces act as they are measured.
    pub fn acts_at_once(&self) -> bool {
        self.inputs.is_empty()
    }

    /// The reference scale x_c, eq. (21): \[1, 1, V0, 2V0/b, 2V0/c, 2V0/b, 1, 1\], V0 in m/s.
    pub fn scale(&self) -> [f64; 8] {
        let v0 = State::NEUTRAL.airspeed;
        let (span, chord) = (self.airframe.geometry.span, self.airframe.geometry.chord);
        [1.0, 1.0, v0, 2.0 * v0 / span, 2.0 * v0 / chord, 2.0 * v0 / span, 1.0, 1.0]
    }

    /// The airflow at `state`, `altitude` in m.
    #[inline(always)]
    pub fn air<R: Real>(&self, state: &State<R>, altitude: f64) -> AirData<R> {
        let density = R::from_f64(self.atmosphere.density_at(altitude));
        AirData::new(state, density, &self.airframe.geometry)
    }

    /// Forces and moments of all effects.
    #[inline(always)]
    pub fn wrench<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> Wrench<R> {
        let mut wrench = Wrench::zero();
        self.contributions(state, controls, air, |index, channel, amount| {
            wrench.add(channel, amount.scale(self.coefficients[index].value));
        });
        wrench
    }

    /// What one unit of each coefficient contributes: calls `term` with its place in
    /// [`coefficients`](GreyBox::coefficients), a channel and the amount in N or N m.
    #[inline(always)]
    pub fn contributions<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        mut term: impl FnMut(usize, Channel, R),
    ) {
        let base = self.base(state, controls, air);
        self.terms_at(&self.terms, state, controls, air, &base, &mut term);
    }

    /// [`contributions`](GreyBox::contributions) of a model whose effects all need only the point, with
    /// nothing compiled in for others: see [`needs`](GreyBox::needs).
    #[inline(always)]
    pub(crate) fn point_contributions<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        mut term: impl FnMut(usize, Channel, R),
    ) {
        self.terms_at(&self.terms, state, controls, air, &Base::zero(), &mut term);
    }

    /// [`wrench`](GreyBox::wrench), likewise.
    #[inline(always)]
    pub(crate) fn point_wrench<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> Wrench<R> {
        self.sum(&self.terms, state, controls, air, &Base::zero())
    }

    /// The most that one of the effects must be told.
    pub fn needs(&self) -> Needs {
        self.terms.last().map_or(Needs::Point, |term| term.kind.needs())
    }

    #[inline(always)]
    fn terms_at<R: Real>(
        &self,
        terms: &[Term],
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        base: &Base<R>,
        term: &mut impl FnMut(usize, Channel, R),
    ) {
        let at = Point { state, controls, air, geometry: &self.airframe.geometry, base };
        for Term { kind, first, table, shape } in terms {
            let own = Own { table: table.as_ref(), shape };
            kind.basis(&at, own, |index, channel, amount| term(first + index, channel, amount));
        }
    }

    /// The sum of `terms` times their coefficients.
    #[inline(always)]
    fn sum<R: Real>(
        &self,
        terms: &[Term],
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
        base: &Base<R>,
    ) -> Wrench<R> {
        let mut wrench = Wrench::zero();
        self.terms_at(terms, state, controls, air, base, &mut |index, channel, amount| {
            wrench.add(channel, amount.scale(self.coefficients[index].value));
        });
        wrench
    }

    /// What the effects need that need more than the point.
    #[inline(always)]
    fn base<R: Real>(&self, state: &State<R>, controls: &Controls<R>, air: &AirData<R>) -> Base<R> {
        let mut base = Base::zero();
        let needs = self.terms.last().map_or(Needs::Point, |term| term.kind.needs());
        if needs == Needs::Point {
            return base;
        }
        let simple = self.terms.iter().take_while(|t| t.kind.needs() == Needs::Point).count();
        let simple = &self.terms[..simple];
        base.wrench = self.sum(simple, state, controls, air, &Base::zero());
        base.force = rigid_body::body_force(&base.wrench, air, self.axes);
        if needs >= Needs::Parts {
            let zero = R::zero();
            let centred = Controls { aileron: zero, elevator: zero, ..*controls };
            let without = self.sum(simple, state, &centred, air, &Base::zero());
            base.deflected = base.wrench.minus(&without);
            let still = State { p: zero, q: zero, r: zero, ..*state };
            let still_air = AirData { p_hat: zero, q_hat: zero, r_hat: zero, ..*air };
            base.still = self.sum(simple, &still, &centred, &still_air, &Base::zero());
        }
        if needs >= Needs::Rate {
            for _ in 0..RATE_PASSES {
                let wrench = self.sum(&self.terms, state, controls, air, &base);
                let (acceleration, spin) = self.accelerations_under(&wrench, state, air);
                base.rate = rigid_body::state_rate(state, air, acceleration, spin);
            }
        }
        base
    }

    /// Linear acceleration (specific force plus gravity, body axes, m/s²) and angular acceleration
    /// (rad/s²).
    #[inline(always)]
    pub fn accelerations<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        let wrench = self.wrench(state, controls, air);
        self.accelerations_under(&wrench, state, air)
    }

    #[inline(always)]
    pub(crate) fn accelerations_under<R: Real>(
        &self,
        wrench: &Wrench<R>,
        state: &State<R>,
        air: &AirData<R>,
    ) -> (Vector<R>, Vector<R>) {
        use crate::physics::Channel::{Pitch, Roll, Yaw};
        let body = self.body.map(R::from_f64);
        let force = rigid_body::body_force(wrench, air, self.axes);
        let gravity = rigid_body::gravity_in_body(state, self.atmosphere.gravity);
        let acceleration = std::array::from_fn(|i| force[i] / body.mass + gravity[i]);
        let moment = [wrench.get(Roll), wrench.get(Pitch), wrench.get(Yaw)];
        (acceleration, rigid_body::angular_acceleration(&body, state, moment))
    }

    /// The state's rate of change ṡ, per second, at `altitude` (m).
    #[inline(always)]
    pub fn rate<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
    ) -> State<R> {
        let air = self.air(state, altitude);
        let (acceleration, spin) = self.accelerations(state, controls, &air);
        let rate = rigid_body::state_rate(state, &air, acceleration, spin);
        match &self.residual {
            Some(residual) => rate.advance(&residual.rate(state, controls), 1.0),
            None => rate,
        }
    }
}

//! The dynamics model: which effects act, with which coefficients, on which rigid body.

use std::sync::Arc;

use crate::{Integrator, Known, Residual};
use greylag_num::{Grid, Real, Table};
use greylag_physics::actuators::LAGS;
use greylag_physics::atmosphere::Atmosphere;
use greylag_physics::effects::{Coefficient, Description, Kind, Needs, Own};
use greylag_physics::formula::{Memory, Status, Written};
use greylag_physics::inputs::{self, InputMemory};
use greylag_physics::rigid_body::{ForceAxes, RigidBody};
use greylag_physics::size::Size;
use greylag_physics::{AirData, Airframe, Controls, State};

/// A coefficient of a model: full name, value, standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// `effect.coefficient`, as in the model file.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation as a prior, where the file states one.
    pub sd: Option<f64>,
    /// The least and the most that it can be, where the file or a user says so; else what the catalogue has for an
    /// aircraft of this size.
    pub bounds: Option<[f64; 2]>,
}

/// The effect that holds a rudder's forces and moments.
pub const RUDDER: &str = "rudder_linear";

/// Prior width of a coefficient whose file states none, as a share of its value.
const WIDTH: f64 = 0.15;

impl Named {
    /// Its standard deviation as a prior: the stated one, else 15 % of its value
    /// (`docs/explanation/diagnosis.md`, the algebra). A coefficient of zero without a stated width is held.
    pub fn width(&self) -> f64 {
        self.sd.unwrap_or(WIDTH * self.value.abs())
    }
}

/// What an effect has beside its coefficients.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    pub(super) table: Option<Table>,
    pub(super) grid: Option<Grid>,
}

impl Points {
    /// With the rest of what belongs to the effect.
    #[inline(always)]
    pub(super) fn own<'a>(&'a self, shape: &'a [f64], first_lag: usize) -> Own<'a> {
        Own { table: self.table.as_ref(), grid: self.grid.as_ref(), shape, first_lag }
    }
}

/// An effect as a model uses it.
#[derive(Clone, Debug)]
pub(super) struct Term {
    pub(super) kind: Kind,
    /// Place of its first coefficient in the model's list.
    pub(super) first: usize,
    pub(super) points: Points,
    /// The values of its shape constants, kept beside it for speed.
    pub(super) shape: Vec<f64>,
    /// Place of its first lag among those of the model.
    pub(super) first_lag: usize,
}

impl Term {
    /// An effect whose coefficients start at `first`.
    pub(super) fn new(kind: Kind, first: usize, points: Points) -> Term {
        Term { kind, first, points, shape: vec![0.0; kind.describe().shape], first_lag: 0 }
    }
}

/// ṡ = F_p(s, z; θ_p) + F_a(s, z; θ_a), eq. (19) of \[GSFM26\]: a sum of effects on a rigid body, with
/// what was learned beside it.
#[derive(Clone, Debug)]
pub struct GreyBox {
    /// The model's name, from its file.
    pub name: String,
    /// What its file says that it is.
    pub description: String,
    /// SHA-256 of the files that it was read from, hexadecimal: model, residual, effect files.
    pub sha256: String,
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
    /// Effects that need only the point come first, then by what they need.
    pub(super) terms: Vec<Term>,
    /// How many of the terms need only the point.
    pub(super) independent: usize,
    /// Input effects with the place of their constant, in the order of [`inputs::Kind::ALL`].
    pub(super) inputs: Vec<(inputs::Kind, usize)>,
    pub(super) coefficients: Vec<Named>,
    /// How many lags and delays its formulas have, at most [`LAGS`].
    pub(super) lags: usize,
    /// Whether the link that it is flown through carries no command for a rudder.
    pub(super) rudder_is_left: bool,
    /// What its file knows of the installation and of single flights.
    pub known: Arc<Known>,
}

impl GreyBox {
    /// The coefficients θ_p, in a fixed order.
    pub fn coefficients(&self) -> &[Named] {
        &self.coefficients
    }

    /// Changes one coefficient by its full name; `false` if the model has none of that name. The value
    /// is not checked: a fit may pass through what is not physical.
    pub fn set_coefficient(&mut self, name: &str, value: f64) -> bool {
        let Some(found) = self.coefficients.iter_mut().find(|c| c.name == name) else {
            return false;
        };
        found.value = value;
        self.renew();
        true
    }

    /// Changes all coefficients, in the order of [`coefficients`](GreyBox::coefficients), unchecked.
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

    /// The most that one of the effects needs.
    pub fn needs(&self) -> Needs {
        self.terms.last().map_or(Needs::Point, |term| term.kind.needs())
    }

    /// Whether the model has the effect `id`.
    pub fn has(&self, id: &str) -> bool {
        self.effects().any(|about| about.id == id)
    }

    /// Whether the aircraft has a rudder that yaws it, as far as the model knows, and that is commanded.
    pub fn has_rudder(&self) -> bool {
        let yaws = |c: &Named| c.name == "rudder_linear.Cndr" && c.value != 0.0;
        self.airframe.actuators.rudder.is_some()
            && !self.rudder_is_left
            && self.coefficients.iter().any(yaws)
    }

    /// The same model with other prior standard deviations: `sd` gives that of a coefficient, or `None` to leave it.
    pub fn with_widths(mut self, sd: impl Fn(&Named) -> Option<f64>) -> GreyBox {
        for c in &mut self.coefficients {
            c.sd = sd(c).or(c.sd);
        }
        self
    }

    /// The model with bounds of its own for the coefficient `name` (`effect.coefficient`); whether it has that.
    pub fn set_bounds(&mut self, name: &str, bounds: [f64; 2]) -> bool {
        let found = self.coefficients.iter_mut().find(|c| c.name == name);
        found.map(|c| c.bounds = Some(bounds)).is_some()
    }

    /// The least and the most that the coefficient number `place` can be, of which the catalogue knows `about`.
    pub fn bounds(&self, place: usize, about: &Coefficient) -> (f64, f64) {
        let own = self.coefficients[place].bounds;
        own.map_or_else(|| self.size().bounds(about), |[low, high]| (low, high))
    }

    /// The same aircraft flown through a link that carries no command for a rudder: it stays where it is.
    pub fn leaving_rudder(mut self) -> GreyBox {
        self.rudder_is_left = true;
        self
    }

    /// The effects that the model names.
    pub fn effects(&self) -> impl Iterator<Item = Description> {
        let inputs = self.inputs.iter().map(|(kind, _)| kind.describe());
        self.terms.iter().map(|term| term.kind.describe()).chain(inputs)
    }

    /// Its effects that come from files.
    pub fn written(&self) -> impl Iterator<Item = &'static Written> {
        self.terms.iter().filter_map(|term| term.kind.written())
    }

    /// An effect that a search proposed and nobody has accepted, if it has one.
    pub fn proposed(&self) -> Option<&'static str> {
        self.written().find(|e| e.status == Status::Proposed).map(|e| e.about.id)
    }

    /// Its grid of thrust over throttle and airspeed, if it has one.
    pub fn thrust_grid(&self) -> Option<&Grid> {
        self.terms.iter().find_map(|t| t.points.grid.as_ref())
    }

    /// The tables of its effects, with the effects' ids.
    pub fn tables(&self) -> impl Iterator<Item = (&'static str, &Table)> {
        self.terms.iter().filter_map(|t| Some((t.kind.describe().id, t.points.table.as_ref()?)))
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

    /// Puts the effects in the order of evaluation, whatever the order in which they came, then renews
    /// what the coefficients decide.
    pub(super) fn settle(&mut self) {
        self.terms.sort_by_key(|term| (term.kind.needs(), term.kind.describe().id));
        self.independent = self.terms.partition_point(|term| term.kind.needs() == Needs::Point);
        self.inputs.sort_by_key(|(kind, _)| *kind as usize);
        self.lags = 0;
        for term in &mut self.terms {
            term.first_lag = self.lags;
            self.lags += term.kind.written().map_or(0, |effect| effect.memories().len());
        }
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
    /// [`STEP`](crate::STEP).
    #[inline(always)]
    pub fn act<R: Real>(&self, controls: &Controls<R>, memory: &mut InputMemory<R>) -> Controls<R> {
        let mut acting = *controls;
        for (place, (kind, index)) in self.inputs.iter().enumerate() {
            acting = memory.act(place, *kind, self.coefficients[*index].value, &acting);
        }
        if self.lags > 0 {
            let mut lagged = [R::zero(); LAGS];
            self.each_lag(|place, lag, shape| {
                lagged[place] = lag.act(&acting, shape, &mut memory.formulas[place]);
            });
            acting.lagged = Some(lagged);
        }
        acting
    }

    /// What the model remembers of controls that have been at `controls` for long.
    #[inline(always)]
    pub fn at_rest<R: Real>(&self, controls: &Controls<R>) -> InputMemory<R> {
        let mut lagged = [R::zero(); LAGS];
        self.each_lag(|place, lag, shape| lagged[place] = lag.settled(controls, shape));
        InputMemory::at_rest(controls, lagged)
    }

    /// Calls `of` for each lag and delay of its formulas: its place, itself, the shape constants of its effect.
    #[inline(always)]
    fn each_lag(&self, mut of: impl FnMut(usize, &Memory, &[f64])) {
        for Term { kind, shape, first_lag, .. } in &self.terms {
            let Some(effect) = kind.written() else { continue };
            for (k, lag) in effect.memories().iter().enumerate() {
                of(first_lag + k, lag, shape);
            }
        }
    }

    /// Whether the controls act as they are measured, and their past does not matter.
    pub fn acts_at_once(&self) -> bool {
        self.inputs.is_empty() && self.lags == 0
    }

    /// Lags and delays of its formulas.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// What the physical bounds of its coefficients go by.
    pub fn size(&self) -> Size {
        Size::new(&self.bare_body, &self.airframe.geometry).lifted_at(
            self.airframe.envelope.airspeed_min_mps,
            &self.bare_body,
            &self.airframe.geometry,
        )
    }

    /// The reference scale x_c, eq. (21): \[1, 1, V0, 2V0/b, 2V0/c, 2V0/b, 1, 1\], V0 in m/s.
    pub fn scale(&self) -> [f64; 8] {
        let v0 = self.airframe.reference.airspeed;
        let (span, chord) = (self.airframe.geometry.span, self.airframe.geometry.chord);
        [1.0, 1.0, v0, 2.0 * v0 / span, 2.0 * v0 / chord, 2.0 * v0 / span, 1.0, 1.0]
    }

    /// The airflow at `state`, `altitude` in m.
    #[inline(always)]
    pub fn air<R: Real>(&self, state: &State<R>, altitude: f64) -> AirData<R> {
        let density = R::from_f64(self.atmosphere.density_at(altitude));
        AirData::new(state, density, altitude, &self.airframe.geometry)
    }
}

//! The grey-box dynamics model: physical effects with coefficients on a rigid body, and a learned residual.

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

/// A coefficient of a model with its prior uncertainty and bounds.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Value, in the unit of the catalogue.
    pub value: f64,
    /// Prior standard deviation, in the unit of the value. `None` if the file states none, see [`Named::width`].
    pub sd: Option<f64>,
    /// Bounds stated by the file or the user. If `None`, the catalogue's bounds for an aircraft of this size apply.
    pub bounds: Option<[f64; 2]>,
}

/// Id of the effect with the forces and moments of a rudder.
pub const RUDDER: &str = "rudder_linear";

/// Prior standard deviation of a coefficient for which the file states none, as a fraction of its value.
const WIDTH: f64 = 0.15;

impl Named {
    /// Prior standard deviation: the stated one, or 15 % of the value if none is stated (`docs/explanation/diagnosis.md`,
    /// "The algebra"). A coefficient of zero without a stated standard deviation is fixed.
    pub fn width(&self) -> f64 {
        self.sd.unwrap_or(WIDTH * self.value.abs())
    }
}

/// Table and grid of an effect. `None` if the effect has no table or no grid.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    pub(super) table: Option<Table>,
    pub(super) grid: Option<Grid>,
}

impl Points {
    /// Combines table and grid with the effect's shape constants and the index of its first lag.
    #[inline(always)]
    pub(super) fn own<'a>(&'a self, shape: &'a [f64], first_lag: usize) -> Own<'a> {
        Own { table: self.table.as_ref(), grid: self.grid.as_ref(), shape, first_lag }
    }
}

/// An effect of a model, with its data.
#[derive(Clone, Debug)]
pub(super) struct Term {
    pub(super) kind: Kind,
    /// Index of the effect's first coefficient in the model's list.
    pub(super) first: usize,
    pub(super) points: Points,
    /// Values of the effect's shape constants (coefficients in which it is nonlinear), copied from the coefficients for speed.
    pub(super) shape: Vec<f64>,
    /// Index of the effect's first lag among the lags of the model.
    pub(super) first_lag: usize,
}

impl Term {
    /// A term whose coefficients start at index `first` in the model's list.
    pub(super) fn new(kind: Kind, first: usize, points: Points) -> Term {
        Term { kind, first, points, shape: vec![0.0; kind.describe().shape], first_lag: 0 }
    }
}

/// Grey-box model ṡ = F_p(s, z; θ_p) + F_a(s, z; θ_a), eq. (19) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`):
/// physical effects F_p on a rigid body, and a learned residual F_a.
///
/// The model has parameters and equations but no flight state. All evaluations take `&self`, so one model can serve
/// several threads. Units are SI and radians, body axes are FRD. The methods are of four kinds:
///
/// - Construction: [`load`](GreyBox::load) reads a model file with its airframe, [`parse`](GreyBox::parse) a text.
///   [`join`](GreyBox::join) adds an effect.
/// - Change of parameters: [`set_coefficient`](GreyBox::set_coefficient),
///   [`set_coefficients`](GreyBox::set_coefficients), [`set_body`](GreyBox::set_body),
///   [`set_bounds`](GreyBox::set_bounds), [`with_widths`](GreyBox::with_widths). Values are not checked against their
///   bounds. Mass and inertia are set with `set_body`. At each change, the public `body` is computed from them and from
///   the effects that modify them, such as `mass_error`.
/// - Evaluation at an instant: [`wrench`](GreyBox::wrench), [`contributions`](GreyBox::contributions),
///   [`accelerations`](GreyBox::accelerations), [`rate`](GreyBox::rate), from the state and the acting deflections.
/// - Advance by one [`STEP`](crate::STEP), 0.01 s: first [`act`](GreyBox::act) converts the actuators' positions to
///   the acting deflections, then [`step`](GreyBox::step) integrates with these deflections held.
///
/// Only the caller's memories depend on time. In every [`STEP`](crate::STEP) of a run, `act` and `step` must each be
/// called exactly once, with the [`InputMemory`] and the [`Memory`](crate::Memory) of this run. A run starts with
/// [`at_rest`](GreyBox::at_rest) and the default integrator memory. A model without input effects and lags
/// ([`acts_at_once`](GreyBox::acts_at_once)) needs no `act`. [`Twin`](crate::Twin) makes these calls in order for a
/// simulated aircraft.
#[derive(Clone, Debug)]
pub struct GreyBox {
    /// Name of the model, from its file.
    pub name: String,
    /// Description of the model, from its file.
    pub description: String,
    /// SHA-256 of the model file, its residual and its effect files, hexadecimal.
    pub sha256: String,
    /// Geometry, actuators and limits of the aircraft.
    pub airframe: Airframe,
    /// Mass and inertia, including the effects that modify them. They are recomputed at each change of coefficients, see
    /// [`set_body`](GreyBox::set_body).
    pub body: RigidBody,
    /// Mass and inertia without the effects that modify them.
    pub(super) bare_body: RigidBody,
    /// Density law and gravity of the model.
    pub atmosphere: Atmosphere,
    /// Axes in which the model's aerodynamic forces are expressed.
    pub axes: ForceAxes,
    /// Time integration scheme.
    pub integrator: Integrator,
    /// Learned residual F_a. `None` if the model has no residual.
    pub residual: Option<Residual>,
    /// Effects in their order of evaluation: first those that need only the point of evaluation (state, controls and airflow).
    pub(super) terms: Vec<Term>,
    /// Number of the effects that need only the point of evaluation.
    pub(super) independent: usize,
    /// Input effects (effects between measured actuator positions and acting deflections), each with the index of its
    /// coefficient, in the order of [`inputs::Kind::ALL`].
    pub(super) inputs: Vec<(inputs::Kind, usize)>,
    pub(super) coefficients: Vec<Named>,
    /// Number of lags and delays in the formulas of effect files, at most [`LAGS`].
    pub(super) lags: usize,
    /// Whether the aircraft's rudder does not move, because the link has no rudder command.
    pub(super) rudder_is_left: bool,
    /// Constants of the sensor installation and of single flights, from the model file.
    pub known: Arc<Known>,
}

impl GreyBox {
    /// The coefficients θ_p, in a fixed order.
    pub fn coefficients(&self) -> &[Named] {
        &self.coefficients
    }

    /// Sets one coefficient by its full name (`effect.coefficient`). Returns `false` if the model has no such coefficient.
    /// The value is not checked against bounds, because a fit may pass through unphysical values.
    pub fn set_coefficient(&mut self, name: &str, value: f64) -> bool {
        let Some(found) = self.coefficients.iter_mut().find(|c| c.name == name) else {
            return false;
        };
        found.value = value;
        self.renew();
        true
    }

    /// Sets all coefficients, in the order of [`coefficients`](GreyBox::coefficients), without a check of bounds.
    ///
    /// # Panics
    /// If the number of `values` differs from the number of coefficients.
    pub fn set_coefficients(&mut self, values: &[f64]) {
        assert_eq!(values.len(), self.coefficients.len(), "a value for each coefficient");
        self.coefficients.iter_mut().zip(values).for_each(|(c, v)| c.value = *v);
        self.renew();
    }

    /// Sets mass and inertia. Effects that modify them apply to the new values.
    pub fn set_body(&mut self, body: RigidBody) {
        self.bare_body = body;
        self.renew();
    }

    /// Mass and inertia without the effects that modify them.
    pub fn bare_body(&self) -> &RigidBody {
        &self.bare_body
    }

    /// The most that any effect needs in addition to the point of evaluation. Input effects are not considered.
    pub fn needs(&self) -> Needs {
        self.terms.last().map_or(Needs::Point, |term| term.kind.needs())
    }

    /// Whether the model has the effect `id`.
    pub fn has(&self, id: &str) -> bool {
        self.effects().any(|about| about.id == id)
    }

    /// Whether the model has a rudder that yaws the aircraft and that the link can command.
    pub fn has_rudder(&self) -> bool {
        let yaws = |c: &Named| c.name == "rudder_linear.Cndr" && c.value != 0.0;
        self.airframe.actuators.rudder.is_some()
            && !self.rudder_is_left
            && self.coefficients.iter().any(yaws)
    }

    /// The same model with other prior standard deviations. `sd` returns the new standard deviation of a coefficient, or `None`
    /// to keep the old one.
    pub fn with_widths(mut self, sd: impl Fn(&Named) -> Option<f64>) -> GreyBox {
        for c in &mut self.coefficients {
            c.sd = sd(c).or(c.sd);
        }
        self
    }

    /// Sets the bounds of the coefficient `name` (`effect.coefficient`). Returns `false` if the model has no such coefficient.
    pub fn set_bounds(&mut self, name: &str, bounds: [f64; 2]) -> bool {
        let found = self.coefficients.iter_mut().find(|c| c.name == name);
        found.map(|c| c.bounds = Some(bounds)).is_some()
    }

    /// Bounds of the coefficient with the index `place`: its own, or else the catalogue's for an aircraft of this size. `about`
    /// is its description in the catalogue.
    pub fn bounds(&self, place: usize, about: &Coefficient) -> (f64, f64) {
        let own = self.coefficients[place].bounds;
        own.map_or_else(|| self.size().bounds(about), |[low, high]| (low, high))
    }

    /// The same aircraft on a link without a rudder command. Its rudder does not move.
    pub fn leaving_rudder(mut self) -> GreyBox {
        self.rudder_is_left = true;
        self
    }

    /// Descriptions of the model's effects, including its input effects.
    pub fn effects(&self) -> impl Iterator<Item = Description> {
        let inputs = self.inputs.iter().map(|(kind, _)| kind.describe());
        self.terms.iter().map(|term| term.kind.describe()).chain(inputs)
    }

    /// The model's effects that come from effect files.
    pub fn written(&self) -> impl Iterator<Item = &'static Written> {
        self.terms.iter().filter_map(|term| term.kind.written())
    }

    /// Id of the first effect that a search proposed and no person has accepted. `None` if there is no such effect.
    pub fn proposed(&self) -> Option<&'static str> {
        self.written().find(|e| e.status == Status::Proposed).map(|e| e.about.id)
    }

    /// Grid of thrust over throttle and airspeed. `None` if the model has no such grid.
    pub fn thrust_grid(&self) -> Option<&Grid> {
        self.terms.iter().find_map(|t| t.points.grid.as_ref())
    }

    /// Tables of the effects, each with the effect's id.
    pub fn tables(&self) -> impl Iterator<Item = (&'static str, &Table)> {
        self.terms.iter().filter_map(|t| Some((t.kind.describe().id, t.points.table.as_ref()?)))
    }

    /// For each coefficient, in the order of `coefficients`, whether the forces and moments of its effect are linear in it.
    /// Shape constants and coefficients of input effects are not.
    pub fn linear(&self) -> Vec<bool> {
        let mut linear = vec![false; self.coefficients.len()];
        for Term { kind, first, .. } in &self.terms {
            let about = kind.describe();
            linear[*first..first + about.coefficients.len() - about.shape].fill(true);
        }
        linear
    }

    /// Sorts the effects into their order of evaluation, then recomputes all values that depend on the coefficients.
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

    /// Converts the measured positions `controls` to the acting deflections. A run calls it once every [`STEP`](crate::STEP).
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

    /// Initial memory of a run whose controls are in steady state at `controls`.
    #[inline(always)]
    pub fn at_rest<R: Real>(&self, controls: &Controls<R>) -> InputMemory<R> {
        let mut lagged = [R::zero(); LAGS];
        self.each_lag(|place, lag, shape| lagged[place] = lag.settled(controls, shape));
        InputMemory::at_rest(controls, lagged)
    }

    /// Calls `of` for each lag and delay of the formulas, with its index, the lag or delay, and the shape constants of its
    /// effect.
    #[inline(always)]
    fn each_lag(&self, mut of: impl FnMut(usize, &Memory, &[f64])) {
        for Term { kind, shape, first_lag, .. } in &self.terms {
            let Some(effect) = kind.written() else { continue };
            for (k, lag) in effect.memories().iter().enumerate() {
                of(first_lag + k, lag, shape);
            }
        }
    }

    /// Whether the acting deflections equal the measured positions, because the model has neither input effects nor lags.
    pub fn acts_at_once(&self) -> bool {
        self.inputs.is_empty() && self.lags == 0
    }

    /// Number of lags and delays in formulas.
    pub fn lags(&self) -> usize {
        self.lags
    }

    /// Size of the aircraft, which determines the physical bounds of coefficients.
    pub fn size(&self) -> Size {
        Size::new(&self.bare_body, &self.airframe.geometry).lifted_at(
            self.airframe.envelope.airspeed_min_mps,
            &self.bare_body,
            &self.airframe.geometry,
        )
    }

    /// Reference scale x_c of the state, eq. (21): \[1, 1, V0, 2V0/b, 2V0/c, 2V0/b, 1, 1\], V0 in m/s.
    pub fn scale(&self) -> [f64; 8] {
        let v0 = self.airframe.reference.airspeed;
        let (span, chord) = (self.airframe.geometry.span, self.airframe.geometry.chord);
        [1.0, 1.0, v0, 2.0 * v0 / span, 2.0 * v0 / chord, 2.0 * v0 / span, 1.0, 1.0]
    }

    /// Air data at `state` and `altitude` (m).
    #[inline(always)]
    pub fn air<R: Real>(&self, state: &State<R>, altitude: f64) -> AirData<R> {
        let density = R::from_f64(self.atmosphere.density_at(altitude));
        AirData::new(state, density, altitude, &self.airframe.geometry)
    }
}

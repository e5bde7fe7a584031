//! The dynamics model: which effects act, with which coefficients, on which rigid body.

use crate::model::Integrator;
use crate::num::{Real, Table};
use crate::physics::atmosphere::Atmosphere;
use crate::physics::effects::Kind;
use crate::physics::rigid_body::{self, ForceAxes, RigidBody, Vector};
use crate::physics::{AirData, Airframe, Channel, Controls, Point, State, Wrench};

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

/// An effect as a model uses it.
#[derive(Clone, Debug)]
pub(super) struct Term {
    pub(super) kind: Kind,
    /// Place of its first coefficient in the model's list.
    pub(super) first: usize,
    pub(super) table: Option<Table>,
}

/// ṡ = F_p(s, z; θ_p), eq. (5) of \[GSFM26\]: a sum of effects on a rigid body.
///
/// (The residual F_a of eq. (19) joins here.)
#[derive(Clone, Debug)]
pub struct GreyBox {
    /// The model's name, from its file.
    pub name: String,
    /// The aircraft it describes.
    pub airframe: Airframe,
    /// Mass and inertia as the model believes them.
    pub body: RigidBody,
    /// Air and gravity as the model believes them.
    pub atmosphere: Atmosphere,
    /// Axes in which its aerodynamic forces act.
    pub axes: ForceAxes,
    /// How it steps through time.
    pub integrator: Integrator,
    pub(super) terms: Vec<Term>,
    pub(super) coefficients: Vec<Named>,
}

impl GreyBox {
    /// The coefficients θ_p, in a fixed order.
    pub fn coefficients(&self) -> &[Named] {
        &self.coefficients
    }

    /// Changes one coefficient by its full name; `false` if the model has none of that name.
    pub fn set_coefficient(&mut self, name: &str, value: f64) -> bool {
        match self.coefficients.iter_mut().find(|c| c.name == name) {
            Some(found) => {
                found.value = value;
                true
            }
            None => false,
        }
    }

    /// The effects that the model names, in the order of their ids.
    pub fn effects(&self) -> impl Iterator<Item = Kind> {
        self.terms.iter().map(|term| term.kind)
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
        let at = Point { state, controls, air, geometry: &self.airframe.geometry };
        for Term { kind, first, table } in &self.terms {
            kind.basis(&at, table.as_ref(), |index, channel, amount| {
                term(first + index, channel, amount);
            });
        }
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
        use crate::physics::Channel::{Pitch, Roll, Yaw};
        let wrench = self.wrench(state, controls, air);
        let body = self.body.map(R::from_f64);
        let force = rigid_body::body_force(&wrench, air, self.axes);
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
        rigid_body::state_rate(state, &air, acceleration, spin)
    }
}

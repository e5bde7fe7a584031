//! Dimensionless flight characteristics (traits), by which aircraft of different sizes can be compared.

use nalgebra::Matrix2;

use crate::modes::{Rates, rates};
use crate::{GreyBox, Trim, TrimError};
use greylag_physics::atmosphere::STANDARD_GRAVITY;

/// A dimensionless characteristic of an aircraft. Times are in units of V/g at the cruise airspeed V (Froude scaling).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trait {
    /// Name of the trait in tables.
    pub name: &'static str,
    /// Definition of the trait in words.
    pub meaning: &'static str,
}

const fn named(name: &'static str, meaning: &'static str) -> Trait {
    Trait { name, meaning }
}

/// The traits, in the order of [`Character::values`].
pub const TRAITS: [Trait; 14] = [
    named("wing loading", "over 47 N/m2 (W / 1 N)^(1/3)"),
    named("aspect ratio", "span squared over area"),
    named("static margin", "-Cm_alpha / CL_alpha"),
    named("roll power", "roll acceleration at full aileron, (V/g)^2"),
    named("roll damping", "-L_p V/g"),
    named("pitch power", "pitch acceleration at full elevator, (V/g)^2"),
    named("pitch damping", "-M_q V/g"),
    named("pitch stiffness", "-M_alpha (V/g)^2"),
    named("lift slope", "-Z_alpha V/g"),
    named("dihedral effect", "-L_beta (V/g)^2"),
    named("weathercock", "N_beta (V/g)^2"),
    named("yaw damping", "-N_r V/g"),
    named("excess thrust", "acceleration at full throttle over g"),
    named("servo", "natural frequency of the aileron's, V/g"),
];

/// The traits of one aircraft at its cruise airspeed.
#[derive(Clone, Debug, PartialEq)]
pub struct Character {
    /// Values of the traits, in the order of [`TRAITS`].
    pub values: [f64; TRAITS.len()],
}

/// Trimmed straight flight at the cruise airspeed, with its linear model.
pub(super) struct Cruise {
    pub trim: Trim,
    pub rates: Rates,
    /// Rate of change of the airspeed at full throttle in the trimmed state, m/s².
    pub excess: f64,
    /// The ratio V/g, s.
    pub time: f64,
}

impl Cruise {
    pub(super) fn of(model: &GreyBox) -> Result<Cruise, TrimError> {
        let (speed, altitude) =
            (model.airframe.envelope.airspeed_cruise_mps, model.airframe.reference.altitude);
        let trim = Trim::straight(model, speed, altitude)?;
        let mut full = trim.controls;
        full.throttle = 1.0;
        let excess = model.rate(&trim.state, &full, altitude).airspeed;
        let time = speed / STANDARD_GRAVITY;
        Ok(Cruise { trim, rates: rates(model, &trim, altitude), excess, time })
    }

    /// The short-period mode, approximated by the eigenvalues of the system of q and α alone. Returns the largest growth rate
    /// (1/s, negative for decay) and the largest natural frequency (rad/s).
    pub(super) fn short_period(&self) -> [f64; 2] {
        let a = &self.rates.a;
        let short = Matrix2::new(a[(4, 4)], a[(4, 6)], a[(6, 4)], a[(6, 6)]);
        let modes = short.complex_eigenvalues();
        let most = |of: &dyn Fn(usize) -> f64| of(0).max(of(1));
        [most(&|k| modes[k].re), most(&|k| modes[k].norm())]
    }

    /// Roll damping −L_p: decay rate of the roll rate, 1/s.
    pub(super) fn roll_damping(&self) -> f64 {
        -self.rates.a[(3, 3)]
    }
}

impl Character {
    /// The traits of the aircraft that `model` describes.
    ///
    /// # Errors
    /// If the model has no straight-flight trim at its cruise airspeed.
    pub fn of(model: &GreyBox) -> Result<Character, TrimError> {
        let Cruise { rates: Rates { a, b }, excess, time, .. } = Cruise::of(model)?;
        let (body, geometry) = (&model.body, &model.airframe.geometry);
        let speed = model.airframe.envelope.airspeed_cruise_mps;
        let figures = &model.airframe.actuators;
        let weight = body.mass * STANDARD_GRAVITY;
        // slope of the pitching moment divided by lift slope and chord. This lift slope includes thrust and drag
        let margin = a[(4, 6)] * body.jy / (a[(6, 6)] * body.mass * speed * geometry.chord);
        let [b0, a1, a2] = figures.aileron.filter;
        // the inverse of the bilinear transform gives (w step / 2)^2 = 4 b0 / (1 - a1 + a2), with the natural frequency w
        let servo = 2.0 * (4.0 * b0 / (1.0 - a1 + a2)).sqrt() / figures.step;
        let square = time * time;
        Ok(Character {
            values: [
                weight / geometry.area / (47.0 * weight.cbrt()),
                geometry.span * geometry.span / geometry.area,
                margin,
                b[(3, 0)] * figures.aileron.travel.smallest() * square,
                -a[(3, 3)] * time,
                -b[(4, 1)] * figures.elevator.travel.smallest() * square,
                -a[(4, 4)] * time,
                -a[(4, 6)] * square,
                -a[(6, 6)] * time,
                -a[(3, 7)] * square,
                a[(5, 7)] * square,
                -a[(5, 5)] * time,
                excess / STANDARD_GRAVITY,
                servo * time,
            ],
        })
    }
}

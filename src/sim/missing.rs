//! An effect that the aircraft in JSBSim has and a model lacks. A diagnosis is tested by whether it finds this effect.

use greylag_sitl::hidden::{Hidden, HiddenError};
use rand::RngExt;

use crate::hidden_formula;
use greylag_model::GreyBox;
use greylag_num::stream::{Stream, stream};
use greylag_physics::formula::Written;

mod kinds;

use kinds::OF_THE_MODEL;
pub use kinds::{KINDS, MissingKind, SERVOS};

/// Id of the random stream of missing effects.
const DRAW: u64 = 80;

/// Factors that scale the amplitudes in [`KINDS`], which are given for the Skywalker X8, to another aircraft.
#[derive(Clone, Debug, PartialEq)]
pub struct Craft {
    /// Factors on amplitudes in N, m, N m, N m s and kg m², in this order.
    force: f64,
    length: f64,
    moment: f64,
    momentum: f64,
    inertia: f64,
    /// Factor on the decay of thrust with airspeed. Its square applies to the aeroelastic loss of surface effectiveness.
    airspeed: f64,
    /// Factor on the stiffness in pitch.
    stiffness: f64,
    /// CDbeta, CDbeta2 and CDde that the aircraft has in its own file.
    own: [f64; 3],
    /// Ids of effects that can be removed from the model.
    has: Vec<String>,
}

impl Craft {
    /// The factors for the aircraft of `reference`, the model that describes the simulated aircraft.
    pub fn of(reference: &GreyBox) -> Craft {
        let value = |name: &str| {
            reference.coefficients().iter().find(|c| c.name == name).map_or(0.0, |c| c.value)
        };
        let (body, geometry) = (&reference.body, &reference.airframe.geometry);
        let ratio = |x: f64, written: f64| x / written;
        let force = ratio(body.mass, WRITTEN.mass);
        let speed = ratio(reference.airframe.reference.airspeed, WRITTEN.airspeed);
        let stiffness = value("pitch_linear.Cmalpha");
        let has = reference.coefficients().iter();
        let has = has.filter_map(|c| c.name.split('.').next()).map(str::to_owned).collect();
        Craft {
            force,
            length: ratio(geometry.chord, WRITTEN.chord),
            moment: force * ratio(geometry.span, WRITTEN.span),
            momentum: ratio(body.jy, WRITTEN.jy),
            inertia: ratio(body.jx, WRITTEN.jx),
            airspeed: 1.0 / speed,
            stiffness: if stiffness < 0.0 { ratio(stiffness, WRITTEN.stiffness) } else { 1.0 },
            own: [
                value("drag_beta2.CDbeta"),
                value("drag_beta2.CDbeta2"),
                value("drag_elevator_abs.CDde"),
            ],
            has,
        }
    }

    /// The factors for the aircraft of `model`. `Craft::kinds` then has every effect of [`KINDS`], even if `model` lacks it.
    pub fn lacking(model: &GreyBox) -> Craft {
        let own = ["lift_table", "drag_beta2", "drag_elevator_abs"].map(str::to_owned);
        let craft = Craft::of(model);
        Craft { has: craft.has.iter().cloned().chain(own).collect(), ..craft }
    }

    /// Whether the model given to [`Craft::of`] has the effect `id`.
    fn has(&self, id: &str) -> bool {
        self.has.iter().any(|has| has == id)
    }

    /// All effects that can be missing, with amplitudes for this aircraft. Some of them take the place of an effect that the
    /// model has. They are included only if the model has that effect.
    pub fn kinds(&self) -> Vec<MissingKind> {
        let own = |kind: &&MissingKind| match kind.id {
            "lift_stall" => self.has("lift_table"),
            "drag_beta2" | "drag_elevator_abs" => self.has(kind.id),
            _ => true,
        };
        let thrust = |id| id == "propeller" && self.has("thrust_table");
        let taken = OF_THE_MODEL.iter().filter(|kind| self.has(kind.id) || thrust(kind.id));
        let all = KINDS.iter().filter(own).chain(taken).chain(&SERVOS);
        all.map(|kind| self.sized(kind)).collect()
    }

    /// The effect `id` with this aircraft's amplitudes; `None` if it cannot be missing.
    pub fn kind(&self, id: &str) -> Option<MissingKind> {
        self.kinds().into_iter().find(|kind| kind.id == id)
    }

    fn sized(&self, kind: &MissingKind) -> MissingKind {
        let factor = match kind.id {
            "thrust_scale" => self.force,
            "cg_shift" | "thrust_line_offset" => self.length,
            "motor_torque" => self.moment,
            "propeller_gyro" => self.momentum,
            "inertia_xz" => self.inertia,
            "thrust_decay" => self.airspeed,
            "aeroelastic_loss" => self.airspeed * self.airspeed,
            "pitch_break" => self.stiffness,
            _ => 1.0,
        };
        MissingKind { clear: kind.clear.map(|x| x * factor), ..*kind }
    }
}

/// Properties of an aircraft by which amplitudes are scaled.
struct Sizes {
    mass: f64,
    chord: f64,
    span: f64,
    jx: f64,
    jy: f64,
    airspeed: f64,
    stiffness: f64,
}

/// The Skywalker X8, for which the amplitudes of [`KINDS`] are given. The units are kg, m, kg m² and m/s; the stiffness is Cmα.
const WRITTEN: Sizes = Sizes {
    mass: 3.364,
    chord: 0.3571,
    span: 2.1,
    jx: 1.229,
    jy: 0.1702,
    airspeed: 16.67,
    stiffness: -0.4629,
};

/// Rounds to four significant figures.
pub(super) fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// An effect that is missing from a model, with its amplitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Missing {
    /// Id of the effect in the catalogue.
    pub id: &'static str,
    /// Amplitude in the unit of [`MissingKind::unit`].
    pub amplitude: f64,
    /// The effect that is added to the aircraft in JSBSim; `None` if the aircraft's own file has the effect.
    pub hidden: Option<Hidden>,
    /// Id of the effect that is removed from the model; `None` if no effect is removed.
    pub taken_out: Option<&'static str>,
    /// True values of the coefficients of the effect in the catalogue; empty if that effect only approximates the true one.
    pub values: Vec<f64>,
}

/// An effect cannot be hidden from a model.
#[derive(Debug, thiserror::Error)]
pub enum MissingError {
    /// The effect does not exist.
    #[error("effect {id:?} cannot be hidden; those that can are {known}")]
    Unknown {
        /// Id that was requested.
        id: String,
        /// Ids of the effects that can be hidden.
        known: String,
    },
    /// JSBSim cannot express the formula of an effect file.
    #[error("effect {id} cannot be hidden in JSBSim: {why}")]
    Formula {
        /// Name of the effect.
        id: &'static str,
        /// The part of the formula that JSBSim cannot express.
        why: String,
    },
    /// The simulator refuses the effect.
    #[error(transparent)]
    Hidden(#[from] HiddenError),
}

impl Missing {
    /// The effect `id` with the total `amplitude`: what the aircraft `craft` already has of this effect, plus what is added.
    ///
    /// # Errors
    ///
    /// If there is no such effect, or the simulator refuses its amplitude.
    pub fn new(craft: &Craft, id: &str, amplitude: f64) -> Result<Missing, MissingError> {
        let kind = craft.kind(id).ok_or_else(|| MissingError::Unknown {
            id: id.into(),
            known: craft.kinds().iter().map(|kind| kind.id).collect::<Vec<_>>().join(", "),
        })?;
        let [own_beta, own_beta2, own_elevator] = craft.own;
        let a = kind.allowed(amplitude);
        // if the aircraft has the effect itself, it is removed from the model and counts in the amplitude
        let (own, taken_out) = match kind.id {
            "drag_beta2" => (own_beta2, Some("drag_beta2")),
            "drag_elevator_abs" => (own_elevator, Some("drag_elevator_abs")),
            "lift_stall" => (0.0, Some("lift_table")),
            "rudder_linear" => (0.0, Some("rudder_linear")),
            "propeller" if craft.has("thrust_table") => (0.0, Some("thrust_table")),
            "propeller" => (0.0, Some("propeller")),
            _ => (0.0, None),
        };
        let hidden = match kind.id {
            "lift_stall" | "rudder_linear" | "propeller" => None,
            id => Some(Hidden::new(id, a - own)?),
        };
        let values = match kind.id {
            "drag_beta2" => vec![own_beta, a],
            "lift_stall" | "rudder_linear" | "propeller" => Vec::new(),
            "unsteady_lift" => vec![a, -0.5 * a],
            "asymmetry" => vec![a; 3],
            "roll_control_alpha" => vec![a, 0.0],
            _ => vec![a],
        };
        Ok(Missing { id: kind.id, amplitude: a, hidden, taken_out, values })
    }

    /// The effect of an effect file, with the coefficients `values`.
    ///
    /// # Errors
    ///
    /// If JSBSim cannot express the formula.
    pub fn written(effect: &'static Written, values: &[f64]) -> Result<Missing, MissingError> {
        let hidden = hidden_formula::hidden(effect, values)
            .map_err(|why| MissingError::Formula { id: effect.about.id, why })?;
        Ok(Missing {
            id: effect.about.id,
            amplitude: values.first().copied().unwrap_or(0.0),
            hidden: Some(hidden),
            taken_out: None,
            values: values.to_vec(),
        })
    }

    /// An effect with a clear amplitude, both drawn from `seed`. `id` and `amplitude` replace the drawn ones if they are given. A
    /// wrong servo is an error of calibration and not drawn: `id` must name it.
    ///
    /// # Errors
    ///
    /// The same as [`Missing::new`].
    pub fn drawn(
        craft: &Craft,
        seed: u64,
        id: Option<&str>,
        amplitude: Option<f64>,
    ) -> Result<Missing, MissingError> {
        let mut random: Stream = stream(seed, &[DRAW]);
        let mut kinds = craft.kinds();
        kinds.retain(|kind| SERVOS.iter().all(|servo| servo.id != kind.id));
        let any = kinds[random.random_range(0..kinds.len() as u32) as usize];
        let id = id.unwrap_or(any.id);
        let clear = craft.kind(id).map_or(0.0, |kind| kind.amplitude(seed));
        Missing::new(craft, id, amplitude.unwrap_or(clear))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_sitl::hidden::EFFECTS;

    fn craft(path: &str) -> Craft {
        Craft::of(
            &GreyBox::load(
                &std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path),
            )
            .unwrap(),
        )
    }

    #[test]
    fn whatever_the_simulator_can_hide_can_be_missing() {
        let x8 = craft("params/x8/jsbsim.toml");
        assert_eq!(x8.kinds().len(), KINDS.len() + SERVOS.len());
        for effect in &EFFECTS {
            let kind =
                MissingKind::from_id(effect.id).unwrap_or_else(|| panic!("no {}", effect.id));
            for seed in 0..20 {
                let missing = Missing::drawn(&x8, seed, Some(kind.id), None).unwrap();
                assert!(missing.hidden.is_some() && missing.amplitude != 0.0, "{missing:?}");
            }
        }
        // the aircraft itself has 0.1478, so 0.3522 are added for a total of 0.5
        let side = Missing::new(&x8, "drag_beta2", 0.5).unwrap();
        assert!((side.hidden.unwrap().amplitude() - 0.3522).abs() < 1e-12);
        assert_eq!(Missing::new(&x8, "time_delay", 0.0234).unwrap().amplitude, 0.02);
        assert!(Missing::new(&x8, "flutter", 1.0).unwrap_err().to_string().contains("dead_zone"));
    }

    /// For the X8 the amplitudes equal those of `KINDS`, to the bit.
    #[test]
    fn amplitudes_go_by_the_size_of_the_aircraft() {
        let x8 = craft("params/x8/jsbsim.toml").kinds();
        assert!(x8.iter().zip(&KINDS).all(|(a, b)| a.id == b.id && a.clear == b.clear));
        let aerosonde = craft("params/aerosonde/jsbsim.toml");
        // 11 kg instead of 3.364
        let thrust = aerosonde.kind("thrust_scale").unwrap().clear[0];
        assert!((thrust / -10.0 - 11.0 / 3.364).abs() < 1e-9, "{thrust}");
        let robbed = Missing::new(&aerosonde, "rudder_linear", 1.0).unwrap();
        assert!(robbed.hidden.is_none() && robbed.taken_out == Some("rudder_linear"));
        // its model has no side drag that could be removed
        assert!(Missing::new(&aerosonde, "drag_beta2", 0.5).is_err());
    }

    #[test]
    fn clear_amplitudes_can_be_flown() {
        for kind in KINDS.iter().chain(&SERVOS).filter(|kind| kind.id != "rate_limit") {
            assert!(kind.clear.iter().all(|x| x.abs() <= kind.most()), "{}", kind.id);
        }
        let limit = MissingKind::from_id("rate_limit").unwrap();
        assert!(limit.clear.iter().all(|x| *x >= limit.most()));
    }
}

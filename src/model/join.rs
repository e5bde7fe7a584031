//! Addition of a physical effect (terms of forces and moments, with coefficients) to a model.

use super::grey_box::{Points, Term};
use super::{GreyBox, Named};
use greylag_physics::actuators::LAGS;
use greylag_physics::effects::{Coefficient, Description, Kind};
use greylag_physics::inputs;

/// Reason why an effect cannot be added to a model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum JoinError {
    /// The effect does not exist.
    #[error(
        "effect {id:?} is unknown to this program; `greylag effects list` names those it knows"
    )]
    Unknown {
        /// The requested id.
        id: String,
    },
    /// The model already has the effect.
    #[error("model {model} has the effect {id} already; refit its coefficients instead")]
    Present {
        /// Name of the model.
        model: String,
        /// Id of the effect.
        id: &'static str,
    },
    /// The effect needs a table, which only a model file can provide.
    #[error("effect {id} needs a table {table}; write it into the model file")]
    Table {
        /// Id of the effect.
        id: &'static str,
        /// Name of the missing table.
        table: &'static str,
    },
    /// A value is out of bounds, or the number of values is wrong.
    #[error("effect {id} takes {expected}; the values {values:?} do not fit")]
    Values {
        /// Id of the effect.
        id: &'static str,
        /// The expected values, in words.
        expected: String,
        /// Values that were given.
        values: Vec<f64>,
    },
    /// The model would have too many input effects, which act between the actuators and the surfaces.
    #[error(
        "model {model} has {most} effects between actuators and surfaces already, which is the most"
    )]
    Inputs {
        /// Name of the model.
        model: String,
        /// Largest number of input effects.
        most: usize,
    },
    /// The model would have too many lags and delays in formulas.
    #[error(
        "model {model} would have more than {most} lags and delays in its formulas, which is the most"
    )]
    Lags {
        /// Name of the model.
        model: String,
        /// Largest number of lags and delays.
        most: usize,
    },
    /// The resulting mass or inertia would be unphysical.
    #[error(
        "effect {id} with {values:?} would leave model {model} without a positive mass, or with jx·jz not above jxz²; join it with less"
    )]
    Body {
        /// Name of the model.
        model: String,
        /// Id of the effect.
        id: &'static str,
        /// Values that were given.
        values: Vec<f64>,
    },
}

impl GreyBox {
    /// Adds the effect `id` with the `values` of its coefficients, in the effect's order. Coefficients whose terms the effect
    /// replaces become zero, and stay zero in a fit.
    ///
    /// # Errors
    /// If the effect is unknown, already present or needs a table, if a value is out of bounds, or if the model would have too
    /// many input effects or lags, or an unphysical mass or inertia.
    pub fn join(&mut self, id: &str, values: &[f64]) -> Result<(), JoinError> {
        let (about, kind) = match (Kind::from_id(id), inputs::Kind::from_id(id)) {
            (Some(kind), _) => (kind.describe(), Ok(kind)),
            (_, Some(kind)) => (kind.describe(), Err(kind)),
            _ => return Err(JoinError::Unknown { id: id.into() }),
        };
        self.may_join(&about, values)?;
        let first = self.coefficients.len();
        match kind {
            Ok(kind) => {
                let lags = kind.written().map_or(0, |effect| effect.memories().len());
                if self.lags + lags > LAGS {
                    return Err(JoinError::Lags { model: self.name.clone(), most: LAGS });
                }
                self.stays_physical(kind, values)?;
                self.terms.push(Term::new(kind, first, Points::default()));
            }
            Err(_) if self.inputs.len() == inputs::MOST => {
                return Err(JoinError::Inputs { model: self.name.clone(), most: inputs::MOST });
            }
            Err(kind) => self.inputs.push((kind, first)),
        }
        self.coefficients.extend(about.coefficients.iter().zip(values).map(|(c, value)| Named {
            bounds: None,
            name: format!("{id}.{}", c.name),
            value: *value,
            sd: None,
        }));
        for c in self.coefficients.iter_mut().filter(|c| about.replaces.contains(&c.name.as_str()))
        {
            (c.value, c.sd) = (0.0, None);
        }
        self.settle();
        Ok(())
    }

    /// Id of the effect that replaces the term of the coefficient `name`. `None` if no effect replaces it.
    pub fn replaced(&self, name: &str) -> Option<&'static str> {
        let gone = self.coefficients.iter().any(|c| c.name == name && c.value == 0.0);
        self.effects().find(|about| gone && about.replaces.contains(&name)).map(|about| about.id)
    }

    /// Adds an effect like [`join`](GreyBox::join). All `values` are scaled by the largest whole number of percent for which the
    /// change of mass and inertia [is acceptable](greylag_physics::rigid_body::RigidBody::may_become). This is 100 % unless an
    /// estimate of mass or inertia overshoots.
    ///
    /// # Errors
    /// The same as for [`join`](GreyBox::join).
    pub fn join_most(&mut self, id: &str, values: &[f64]) -> Result<(), JoinError> {
        let share = |percent: u32| {
            let mut with = self.clone();
            let scaled: Vec<f64> = values.iter().map(|v| 0.01 * f64::from(percent) * v).collect();
            with.join(id, if percent == 100 { values } else { &scaled })?;
            Ok(with)
        };
        let all = share(100);
        let fits = |with: &GreyBox| self.body.may_become(&with.body);
        *self = match all {
            Ok(with) if fits(&with) => with,
            Ok(_) | Err(JoinError::Body { .. }) => {
                let less = (1..100).rev().filter_map(|percent| share(percent).ok()).find(fits);
                less.map_or(all, Ok)?
            }
            Err(why) => return Err(why),
        };
        Ok(())
    }

    fn may_join(&self, about: &Description, values: &[f64]) -> Result<(), JoinError> {
        let id = about.id;
        if self.has(id) {
            return Err(JoinError::Present { model: self.name.clone(), id });
        }
        if let Some(table) = about.table.or(about.grid) {
            return Err(JoinError::Table { id, table });
        }
        let size = self.size();
        let possible = |(c, v): (&Coefficient, &f64)| {
            let (least, most) = size.bounds(c);
            (least..=most).contains(v)
        };
        let fits = values.len() == about.coefficients.len()
            && about.coefficients.iter().zip(values).all(possible);
        if fits {
            return Ok(());
        }
        let expected: Vec<_> = about
            .coefficients
            .iter()
            .map(|c| {
                let (least, most) = size.bounds(c);
                format!("{} in {least}..{most} {}", c.name, c.unit)
            })
            .map(|words| words.trim_end().to_owned())
            .collect();
        Err(JoinError::Values { id, expected: expected.join(", "), values: values.into() })
    }

    /// Checks that mass and inertia stay physical with the effect.
    fn stays_physical(&self, kind: Kind, values: &[f64]) -> Result<(), JoinError> {
        let mut body = self.body;
        kind.change(values, &mut body);
        if body.is_physical() {
            return Ok(());
        }
        let id = kind.describe().id;
        Err(JoinError::Body { model: self.name.clone(), id, values: values.into() })
    }
}

//! Rules that fill columns of the table of a flight from the fields of a topic. A topic is one type of message in a log. An
//! instance is one of several sources of the same topic, for example the second airspeed sensor.

use std::f64::consts::FRAC_1_SQRT_2;

use crate::topics::Topic;

/// Conversion of a field's value before it enters a sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// The value remains unchanged.
    Linear,
    /// Converts a servo pulse to −1..1, with a separate range on each side of the trim.
    Surface {
        /// Pulse at −1, µs.
        min: f64,
        /// Pulse at 0, µs.
        trim: f64,
        /// Pulse at 1, µs.
        max: f64,
    },
    /// The value is a motor command of PX4. NaN, which stops the motor, becomes 0.
    Motor,
    /// Converts a pulse to 0..1.
    Range {
        /// Pulse at 0, µs.
        min: f64,
        /// Pulse at 1, µs.
        max: f64,
    },
}

impl Shape {
    fn of(self, x: f64) -> f64 {
        match self {
            Shape::Linear => x,
            Shape::Motor => {
                if x.is_nan() {
                    0.0
                } else {
                    x
                }
            }
            // zero means that no pulse is sent: the safety switch is on, or the output is not set
            Shape::Surface { .. } if x <= 0.0 => f64::NAN,
            Shape::Surface { min, trim, max } => {
                let side = if x > trim { max - trim } else { trim - min };
                if side > 0.0 { (x - trim) / side } else { 0.0 }
            }
            Shape::Range { min, max } if max > min => (x - min) / (max - min),
            Shape::Range { .. } => f64::NAN,
        }
    }
}

/// One term of the sum that fills a column: the converted field times a gain.
///
/// A pulse of zero means that no pulse is sent, as in a disarmed vehicle. A motor then stands still, and the deflection of
/// a servo is unknown (NaN).
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// Name of the field.
    pub field: String,
    /// Factor on the converted value.
    pub gain: f64,
    /// Conversion of the field's value.
    pub shape: Shape,
}

impl Term {
    /// The value of the term for the field's value `x`.
    fn of(&self, x: f64) -> f64 {
        match self.shape {
            // a negative gain means reversed pulses or a difference of motors; without a pulse the value is then unknown
            Shape::Range { .. } if x <= 0.0 => {
                if self.gain > 0.0 {
                    0.0
                } else {
                    f64::NAN
                }
            }
            shape => self.gain * shape.of(x),
        }
    }
}

/// Axes between which a quaternion rotates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// From body axes forward-right-down to earth axes north-east-down.
    NedFrd,
    /// From body axes forward-left-up to earth axes east-north-up, as in ROS.
    EnuFlu,
}

impl Axes {
    /// The quaternion (w first) from body axes forward-right-down to earth axes north-east-down.
    fn ned_frd(self, [w, x, y, z]: [f64; 4]) -> [f64; 4] {
        match self {
            Axes::NedFrd => [w, x, y, z],
            // Multiplication by (0, 1, 1, 0)/√2 from the left turns ENU into NED. Multiplication by (0, 1, 0, 0) from
            // the right turns FRD into FLU. The product is negated, which does not change the rotation.
            Axes::EnuFlu => [w + z, x + y, x - y, w - z].map(|c| c * FRAC_1_SQRT_2),
        }
    }
}

/// The angle that is computed from a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tilt {
    /// The roll angle.
    Roll,
    /// The pitch angle.
    Pitch,
}

impl Tilt {
    /// The angle, rad; NaN if the norm of the quaternion is far from one.
    fn of(self, [w, x, y, z]: [f64; 4]) -> f64 {
        let norm = (w * w + x * x + y * y + z * z).sqrt();
        if !(0.5..2.0).contains(&norm) {
            return f64::NAN;
        }
        let [w, x, y, z] = [w, x, y, z].map(|c| c / norm);
        match self {
            Tilt::Roll => (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y)),
            Tilt::Pitch => (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
        }
    }
}

/// The columns that a rule fills, and the computation of their values.
#[derive(Clone, Debug, PartialEq)]
pub enum Fill {
    /// One column: the sum of terms plus an offset.
    Sum {
        /// Name of the column.
        column: String,
        /// Terms whose sum fills the column.
        terms: Vec<Term>,
        /// Constant that is added, in the column's unit.
        offset: f64,
    },
    /// Roll, pitch and yaw from a quaternion, w first.
    Quaternion {
        /// Fields of the quaternion, w first.
        fields: [String; 4],
        /// Axes between which the quaternion rotates.
        axes: Axes,
    },
    /// One column: the roll or the pitch of a quaternion, w first.
    Tilt {
        /// Name of the column.
        column: &'static str,
        /// The angle that fills the column.
        angle: Tilt,
        /// Fields of the quaternion, w first.
        fields: [&'static str; 4],
        /// Axes between which the quaternion rotates.
        axes: Axes,
    },
    /// Air density from static pressure and temperature.
    Density {
        /// Field of the pressure, and the factor that converts it to Pa.
        pressure: (&'static str, f64),
        /// Field of the temperature, and the factor that converts it to °C.
        temperature: (&'static str, f64),
    },
}

/// A rule that fills columns of the table from the fields of a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// Name of the topic.
    pub topic: String,
    /// Instance of the topic; `None` accepts any instance.
    pub instance: Option<u16>,
    /// The instance that is preferred for this type of vehicle. It is used if the values of its fields change during the log.
    /// `None` for no preference.
    pub preferred: Option<u16>,
    /// The columns that the rule fills, and the computation of their values.
    pub fill: Fill,
    /// Note that the user gets if this rule is used; `None` without a note.
    pub note: Option<String>,
    /// Whether the airspeed is equivalent airspeed, to be converted to true airspeed with the density.
    pub equivalent: bool,
    /// Whether the rule comes from the user's mapping.
    pub own: bool,
}

/// Gas constant of dry air, J/(kg K).
const R_AIR: f64 = 287.053;

impl Rule {
    fn new(topic: &str, fill: Fill) -> Rule {
        Rule {
            topic: topic.into(),
            instance: None,
            preferred: None,
            fill,
            note: None,
            equivalent: false,
            own: false,
        }
    }

    /// A rule for one field times a factor.
    pub fn linear(column: &str, topic: &str, field: &str, gain: f64) -> Rule {
        let term = Term { field: field.into(), gain, shape: Shape::Linear };
        Rule::sum(column, topic, vec![term])
    }

    /// A rule for a sum of terms.
    pub fn sum(column: &str, topic: &str, terms: Vec<Term>) -> Rule {
        Rule::new(topic, Fill::Sum { column: column.into(), terms, offset: 0.0 })
    }

    /// A rule for roll, pitch and yaw from the four fields of a quaternion (w first) in the axes [`Axes::NedFrd`].
    pub fn quaternion(topic: &str, fields: [&str; 4]) -> Rule {
        let fields = fields.map(str::to_owned);
        Rule::new(topic, Fill::Quaternion { fields, axes: Axes::NedFrd })
    }

    /// A rule for the roll or pitch angle from the four fields of a quaternion (w first) in the axes
    /// [`Axes::NedFrd`].
    pub fn tilt(column: &'static str, topic: &str, angle: Tilt, fields: [&'static str; 4]) -> Rule {
        Rule::new(topic, Fill::Tilt { column, angle, fields, axes: Axes::NedFrd })
    }

    /// The same rule for a quaternion between other axes.
    pub fn in_axes(mut self, other: Axes) -> Rule {
        if let Fill::Quaternion { axes, .. } | Fill::Tilt { axes, .. } = &mut self.fill {
            *axes = other;
        }
        self
    }

    /// A rule for the air density by the gas law. Each of `pressure` and `temperature` is a field and the factor that converts
    /// it to Pa or °C.
    pub fn density(
        topic: &str,
        pressure: (&'static str, f64),
        temperature: (&'static str, f64),
    ) -> Rule {
        Rule::new(topic, Fill::Density { pressure, temperature })
    }

    /// Adds an offset to a sum.
    pub fn plus(mut self, x: f64) -> Rule {
        if let Fill::Sum { offset, .. } = &mut self.fill {
            *offset += x;
        }
        self
    }

    /// The same rule for one instance of the topic only, or for any instance if `instance` is `None`.
    pub fn of(self, instance: Option<u16>) -> Rule {
        Rule { instance, ..self }
    }

    /// The same rule with the preferred instance `preferred`.
    pub fn preferring(self, preferred: Option<u16>) -> Rule {
        Rule { preferred, ..self }
    }

    /// The same rule with a note to the user.
    pub fn noting(self, note: impl Into<String>) -> Rule {
        Rule { note: Some(note.into()), ..self }
    }

    /// The same rule for an equivalent airspeed.
    pub fn equivalent(self) -> Rule {
        Rule { equivalent: true, ..self }
    }

    /// The same rule, marked as one of the user's mapping.
    pub fn own(self) -> Rule {
        Rule { own: true, ..self }
    }

    /// The columns that the rule fills.
    pub fn columns(&self) -> Vec<&str> {
        match &self.fill {
            Fill::Sum { column, .. } => vec![column],
            Fill::Tilt { column, .. } => vec![column],
            Fill::Quaternion { .. } => vec!["roll_rad", "pitch_rad", "yaw_rad"],
            Fill::Density { .. } => vec!["air_density_kgpm3"],
        }
    }

    /// Returns the rule, or `None` if another rule already fills one of its columns. `taken` states this for a column.
    pub fn without(self, taken: impl Fn(&str) -> bool) -> Option<Rule> {
        let free = !self.columns().iter().any(|c| taken(c));
        free.then_some(self)
    }

    /// The fields that the rule reads.
    pub fn fields(&self) -> Vec<&str> {
        match &self.fill {
            Fill::Sum { terms, .. } => terms.iter().map(|t| t.field.as_str()).collect(),
            Fill::Quaternion { fields, .. } => fields.iter().map(String::as_str).collect(),
            Fill::Tilt { fields, .. } => fields.to_vec(),
            Fill::Density { pressure, temperature } => vec![pressure.0, temperature.0],
        }
    }

    /// Topic and fields of the rule as shown to the user.
    pub fn origin(&self) -> String {
        format!("{}.{}", self.topic, self.fields().join("+"))
    }

    /// Field and factor of a rule that only scales one field; `None` for other rules.
    pub fn factor(&self) -> Option<(&str, f64)> {
        match &self.fill {
            Fill::Sum { terms, offset: 0.0, .. } => match &terms[..] {
                [Term { field, gain, shape: Shape::Linear }] => Some((field, *gain)),
                _ => None,
            },
            _ => None,
        }
    }

    /// The values before resampling, at the topic's own times: one series, or the four components of a quaternion.
    /// `None` if the topic lacks a field.
    pub fn series(&self, topic: &Topic) -> Option<Vec<Vec<f64>>> {
        match &self.fill {
            Fill::Sum { terms, offset, .. } => {
                let mut out = vec![*offset; topic.time_s.len()];
                for term in terms {
                    let field = topic.field(&term.field)?;
                    for (y, x) in out.iter_mut().zip(field) {
                        *y += term.of(*x);
                    }
                }
                Some(vec![out])
            }
            Fill::Quaternion { fields, axes } => {
                let [w, x, y, z] = fields.each_ref().map(|f| topic.field(f));
                let (w, x, y, z) = (w?, x?, y?, z?);
                let mut out = vec![vec![0.0; w.len()]; 4];
                for i in 0..w.len() {
                    let q = axes.ned_frd([w[i], x[i], y[i], z[i]]);
                    out.iter_mut().zip(q).for_each(|(column, c)| column[i] = c);
                }
                Some(out)
            }
            Fill::Tilt { angle, fields, axes, .. } => {
                let [w, x, y, z] = fields.map(|f| topic.field(f));
                let (w, x, y, z) = (w?, x?, y?, z?);
                let at = |i: usize| angle.of(axes.ned_frd([w[i], x[i], y[i], z[i]]));
                Some(vec![(0..topic.time_s.len()).map(at).collect()])
            }
            Fill::Density { pressure, temperature } => {
                let p = topic.field(pressure.0)?;
                let t = topic.field(temperature.0)?;
                let density = |(p, t): (&f64, &f64)| {
                    let (p, t) = (p * pressure.1, t * temperature.1 + 273.15);
                    if p > 1e4 && t > 150.0 { p / (R_AIR * t) } else { f64::NAN }
                };
                Some(vec![p.iter().zip(t).map(density).collect()])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_pulse_is_no_deflection_and_no_thrust() {
        let of = |gain: f64, shape: Shape, pulse: f64| {
            Term { field: "C1".into(), gain, shape }.of(pulse)
        };
        let surface = Shape::Surface { min: 1100.0, trim: 1500.0, max: 1900.0 };
        let range = Shape::Range { min: 1000.0, max: 2000.0 };
        assert!(of(1.0, surface, 0.0).is_nan());
        assert_eq!([1100.0, 1500.0, 1900.0].map(|us| of(-1.0, surface, us)), [1.0, 0.0, -1.0]);
        assert_eq!([0.0, 1000.0, 1500.0].map(|us| of(1.0, range, us)), [0.0, 0.0, 0.5]);
        assert!(of(-1.0, range, 0.0).is_nan());
        assert_eq!(of(-1.0, range, 1500.0), -0.5);
    }
}

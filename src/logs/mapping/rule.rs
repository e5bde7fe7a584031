//! One way to fill columns from a topic.

use crate::topics::Topic;

/// How a field's value is shaped before it is summed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// As it is.
    Linear,
    /// A servo's pulse to −1..1, each side of its trim by its own range.
    Surface {
        /// Pulse at −1, µs.
        min: f64,
        /// Pulse at 0, µs.
        trim: f64,
        /// Pulse at 1, µs.
        max: f64,
    },
    /// A motor of PX4: NaN stops it.
    Motor,
    /// A pulse to 0..1.
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
            Shape::Surface { min, trim, max } => {
                let side = if x > trim { max - trim } else { trim - min };
                if side > 0.0 { (x - trim) / side } else { 0.0 }
            }
            Shape::Range { min, max } if max > min => (x - min) / (max - min),
            Shape::Range { .. } => f64::NAN,
        }
    }
}

/// A field's share in a column.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// The field.
    pub field: String,
    /// Its factor, after the shape.
    pub gain: f64,
    /// What is done to it first.
    pub shape: Shape,
}

/// An angle of a quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tilt {
    /// Its roll.
    Roll,
    /// Its pitch.
    Pitch,
}

impl Tilt {
    /// The angle, rad; NaN of what is no attitude.
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

/// What fills which columns.
#[derive(Clone, Debug, PartialEq)]
pub enum Fill {
    /// One column: the sum of terms plus an offset.
    Sum {
        /// The column.
        column: String,
        /// The terms.
        terms: Vec<Term>,
        /// The offset.
        offset: f64,
    },
    /// Roll, pitch and yaw from a quaternion NED→FRD, w first.
    Quaternion([&'static str; 4]),
    /// One column: the roll or the pitch of a quaternion NED→FRD, w first.
    Tilt {
        /// The column.
        column: &'static str,
        /// Which angle.
        angle: Tilt,
        /// The quaternion's fields.
        fields: [&'static str; 4],
    },
    /// Air density from static pressure (times the factor in Pa) and temperature (factor, in °C).
    Density {
        /// The pressure's field with its factor.
        pressure: (&'static str, f64),
        /// The temperature's field with its factor.
        temperature: (&'static str, f64),
    },
}

/// One way to fill columns from a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Rule {
    /// The topic.
    pub topic: String,
    /// Its instance; the first if none is named.
    pub instance: Option<u16>,
    /// What it fills.
    pub fill: Fill,
    /// What the user should know if this rule is used.
    pub note: Option<String>,
    /// Whether the airspeed is equivalent, to be made true by the density.
    pub equivalent: bool,
}

/// Gas constant of dry air, J/(kg K).
const R_AIR: f64 = 287.053;

impl Rule {
    fn new(topic: &str, fill: Fill) -> Rule {
        Rule { topic: topic.into(), instance: None, fill, note: None, equivalent: false }
    }

    /// One field times a factor.
    pub fn linear(column: &str, topic: &str, field: &str, gain: f64) -> Rule {
        let term = Term { field: field.into(), gain, shape: Shape::Linear };
        Rule::sum(column, topic, vec![term])
    }

    /// A sum of terms.
    pub fn sum(column: &str, topic: &str, terms: Vec<Term>) -> Rule {
        Rule::new(topic, Fill::Sum { column: column.into(), terms, offset: 0.0 })
    }

    /// A quaternion's fields.
    pub fn quaternion(topic: &str, fields: [&'static str; 4]) -> Rule {
        Rule::new(topic, Fill::Quaternion(fields))
    }

    /// The roll or the pitch of a quaternion's fields.
    pub fn tilt(column: &'static str, topic: &str, angle: Tilt, fields: [&'static str; 4]) -> Rule {
        Rule::new(topic, Fill::Tilt { column, angle, fields })
    }

    /// Pressure with temperature.
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

    /// Of an instance.
    pub fn of(self, instance: Option<u16>) -> Rule {
        Rule { instance, ..self }
    }

    /// With something to know.
    pub fn noting(self, note: impl Into<String>) -> Rule {
        Rule { note: Some(note.into()), ..self }
    }

    /// As equivalent airspeed.
    pub fn equivalent(self) -> Rule {
        Rule { equivalent: true, ..self }
    }

    /// The columns that it fills.
    pub fn columns(&self) -> Vec<&str> {
        match &self.fill {
            Fill::Sum { column, .. } => vec![column],
            Fill::Tilt { column, .. } => vec![column],
            Fill::Quaternion(_) => vec!["roll_rad", "pitch_rad", "yaw_rad"],
            Fill::Density { .. } => vec!["air_density_kgpm3"],
        }
    }

    /// The rule, unless its columns are `taken` by others.
    pub fn without(self, taken: impl Fn(&str) -> bool) -> Option<Rule> {
        let free = !self.columns().iter().any(|c| taken(c));
        free.then_some(self)
    }

    /// Where the value comes from, for people.
    pub fn origin(&self) -> String {
        let fields = match &self.fill {
            Fill::Sum { terms, .. } => terms.iter().map(|t| t.field.as_str()).collect(),
            Fill::Quaternion(fields) | Fill::Tilt { fields, .. } => fields.to_vec(),
            Fill::Density { pressure, temperature } => vec![pressure.0, temperature.0],
        };
        format!("{}.{}", self.topic, fields.join("+"))
    }

    /// The series that are interpolated, at the topic's own times: one, or a quaternion's four.
    pub fn series(&self, topic: &Topic) -> Option<Vec<Vec<f64>>> {
        match &self.fill {
            Fill::Sum { terms, offset, .. } => {
                let mut out = vec![*offset; topic.time_s.len()];
                for term in terms {
                    let field = topic.field(&term.field)?;
                    for (y, x) in out.iter_mut().zip(field) {
                        *y += term.gain * term.shape.of(*x);
                    }
                }
                Some(vec![out])
            }
            Fill::Quaternion(fields) => {
                fields.iter().map(|f| topic.field(f).map(<[f64]>::to_vec)).collect()
            }
            Fill::Tilt { angle, fields, .. } => {
                let [w, x, y, z] = fields.map(|f| topic.field(f));
                let (w, x, y, z) = (w?, x?, y?, z?);
                let at = |i: usize| angle.of([w[i], x[i], y[i], z[i]]);
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

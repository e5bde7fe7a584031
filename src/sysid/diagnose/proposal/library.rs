//! Library of shapes: functions of one or two variables. A form is a shape times a known factor that depends on the
//! channel, which is a force or a moment.

use super::free::Free;
use greylag_physics::Channel;
use greylag_physics::formula::dimension::Dimension;
use greylag_physics::formula::file::channel_name;
use greylag_physics::formula::{Variable, Written, register};

/// Variables of shapes that scale with dynamic pressure; angles in rad, all dimensionless.
pub(super) const OF_AIR: [Variable; 9] = [
    Variable::Alpha,
    Variable::Beta,
    Variable::RollRateHat,
    Variable::PitchRateHat,
    Variable::YawRateHat,
    Variable::Aileron,
    Variable::Elevator,
    Variable::Rudder,
    Variable::Throttle,
];
/// Variables of shapes that do not scale with dynamic pressure. Such shapes describe thrust, gyroscopic and inertial
/// moments.
pub(super) const BESIDE_AIR: [Variable; 7] = [
    Variable::Throttle,
    Variable::Airspeed,
    Variable::RollRate,
    Variable::PitchRate,
    Variable::YawRate,
    Variable::Alpha,
    Variable::Beta,
];
/// Variables that may have a dead band or a threshold.
const BANDED: [Variable; 5] =
    [Variable::Alpha, Variable::Beta, Variable::Aileron, Variable::Elevator, Variable::Throttle];
/// Controls that may act through a lag.
pub(super) const CONTROLS: [Variable; 4] =
    [Variable::Aileron, Variable::Elevator, Variable::Rudder, Variable::Throttle];
/// Starting time constant of a lag, s. The search also starts at 0.25 and 1.75 times this value.
const LAG_S: f64 = 0.2;
/// Longest time constant of a lag, s.
const LONGEST_LAG_S: f64 = 3.0;
/// Starting coefficient of a lagged control. It is so small that the first step changes only the coefficient, not the
/// lag.
const AMOUNT: f64 = 1e-6;
/// Thresholds and dead bands, as quantiles of the variable's magnitude in the flights.
pub(super) const QUANTILES: [f64; 2] = [0.5, 0.75];

/// Dependence of a force or moment on its variables, without the coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// The variable v itself.
    Linear(Variable),
    /// Magnitude of the variable, |v|.
    Magnitude(Variable),
    /// Square of the variable, v².
    Square(Variable),
    /// Signed square of the variable, v |v|.
    SignedSquare(Variable),
    /// Product of two variables, v w.
    Product(Variable, Variable),
    /// Product of one variable and another's magnitude, v |w|.
    ByMagnitude(Variable, Variable),
    /// Excess of v over a threshold; zero below the threshold.
    Above(Variable, f64),
    /// Excess of v over a dead band, with its sign.
    Beyond(Variable, f64),
    /// The control v through a first-order lag with a time constant, s. The time constant of a candidate is free.
    Lagged(Variable, f64),
    /// An expression of the grammar for free forms.
    Free(&'static Free),
}

/// A shape with its channel and its factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Form {
    /// Channel in which the form acts.
    pub channel: Channel,
    /// Whether the form scales with dynamic pressure.
    pub of_air: bool,
    /// The shape, which gives the dependence on the variables.
    pub shape: Shape,
}

impl Shape {
    /// Variables on which the shape depends.
    pub fn variables(&self) -> Vec<Variable> {
        match *self {
            Shape::Product(v, w) | Shape::ByMagnitude(v, w) => vec![v, w],
            Shape::Linear(v)
            | Shape::Magnitude(v)
            | Shape::Square(v)
            | Shape::SignedSquare(v)
            | Shape::Above(v, _)
            | Shape::Beyond(v, _)
            | Shape::Lagged(v, _) => vec![v],
            Shape::Free(free) => free.expression.variables(),
        }
    }

    /// The formula as text. `names` replace the values of the constants if they are given.
    pub fn text(&self, names: Option<&[String]>) -> String {
        let name = Variable::name;
        let number = |c: f64| match names {
            Some([name, ..]) => name.clone(),
            _ => format!("{c}"),
        };
        match *self {
            Shape::Linear(v) => name(v).into(),
            Shape::Magnitude(v) => format!("abs({})", name(v)),
            Shape::Square(v) => format!("{}^2", name(v)),
            Shape::SignedSquare(v) => format!("{0}*abs({0})", name(v)),
            Shape::Product(v, w) => format!("{}*{}", name(v), name(w)),
            Shape::ByMagnitude(v, w) => format!("{}*abs({})", name(v), name(w)),
            Shape::Above(v, c) => format!("max({} - {}, 0)", name(v), number(c)),
            Shape::Beyond(v, c) => format!("deadband({}, {})", name(v), number(c)),
            Shape::Lagged(v, tau) => format!("lag({}, {})", name(v), number(tau)),
            Shape::Free(free) => free.text(names),
        }
    }

    /// Constants of the shape in addition to the coefficient.
    pub fn constants(&self) -> Vec<f64> {
        match self {
            Shape::Above(_, c) | Shape::Beyond(_, c) | Shape::Lagged(_, c) => vec![*c],
            Shape::Free(free) => free.constants.clone(),
            _ => Vec::new(),
        }
    }

    /// Size of the formula: number of its variables, numbers and operations.
    pub fn complexity(&self) -> usize {
        match self {
            Shape::Linear(_) => 1,
            Shape::Magnitude(_) | Shape::Square(_) => 2,
            Shape::Product(..) | Shape::Lagged(..) => 3,
            Shape::SignedSquare(_) | Shape::ByMagnitude(..) | Shape::Beyond(..) => 4,
            Shape::Above(..) => 5,
            Shape::Free(free) => free.expression.size(),
        }
    }
}

impl Form {
    /// Known factor by which the shape is multiplied, as text.
    pub fn factor(&self) -> &'static str {
        let moment = matches!(self.channel, Channel::Roll | Channel::Yaw);
        match (self.of_air, moment, self.channel) {
            (false, ..) => "1",
            (true, true, _) => "qbar*S*b",
            (true, _, Channel::Pitch) => "qbar*S*c",
            (true, ..) => "qbar*S",
        }
    }

    /// Unit of the coefficient; empty if the coefficient is dimensionless.
    pub fn unit(&self) -> String {
        let force = match self.channel {
            Channel::Roll | Channel::Pitch | Channel::Yaw => "N m",
            _ => "N",
        };
        if self.of_air {
            return String::new();
        }
        if let Shape::Free(free) = self.shape {
            let whole = if force == "N" { Dimension::FORCE } else { Dimension::MOMENT };
            let unit = whole.per(free.dimension().unwrap_or_default());
            return if unit == Dimension::NONE { String::new() } else { unit.to_string() };
        }
        let per = |v: &Variable| match v {
            Variable::Airspeed => " m^-1 s",
            Variable::RollRate | Variable::PitchRate | Variable::YawRate => " s",
            _ => "",
        };
        let variables = self.shape.variables();
        let squared = matches!(self.shape, Shape::Square(_) | Shape::SignedSquare(_));
        let units: Vec<&str> = variables.iter().map(per).collect();
        format!("{force}{}{}", units.concat(), if squared { units.concat() } else { String::new() })
    }

    /// Identifier of the form as a candidate, a physical effect that the model may lack.
    pub fn id(&self) -> String {
        let text = match self.shape {
            // the text is too long for an identifier
            Shape::Free(free) => format!("free_{:x}", number_of(&free.text(None))),
            // the time constant is free, so it is not part of the identifier
            Shape::Lagged(v, _) => format!("lag {}", v.name()),
            shape => shape.text(None),
        };
        let plain: String =
            text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        format!(
            "try_{}_{}_{plain}",
            channel_name(self.channel),
            if self.of_air { "q" } else { "o" }
        )
    }

    /// The form with the constants that a search has estimated. `values` holds the coefficient, then the constants.
    pub fn fitted(self, values: &[f64]) -> Form {
        match (self.shape, values) {
            (Shape::Lagged(v, _), [_, tau, ..]) => {
                // three digits, for a readable text
                let tau = format!("{tau:.2e}").parse().unwrap_or(*tau);
                Form { shape: Shape::Lagged(v, tau), ..self }
            }
            _ => self,
        }
    }

    /// The effect that consists of this form, with a fixed threshold. The time constant of a lag is free.
    ///
    /// # Errors
    /// The text of the effect file is not valid. This does not happen for forms of the library.
    pub fn effect(&self) -> Result<&'static Written, String> {
        match self.shape {
            Shape::Lagged(v, _) => self.through_lag(v, LAG_S, &self.id()),
            _ => self.fixed(),
        }
    }

    /// The effect of a control through a lag. The search starts at the time constants `tau` (s), 0.25 `tau` and 1.75
    /// `tau`.
    fn through_lag(&self, v: Variable, tau: f64, id: &str) -> Result<&'static Written, String> {
        register::read(&format!(
            "schema = 1\nid = \"{id}\"\ndescription = \"A control through a lag.\"\nsource = \"greylag propose\"\n\
             status = \"proposed\"\n[parameters.k]\nvalue = {AMOUNT}\nbounds = [-1e6, 1e6]\nunit = \"{}\"\n\
             meaning = \"amount\"\n[parameters.tau]\nvalue = {tau}\nwidth = {}\nbounds = [0.0, {LONGEST_LAG_S}]\n\
             unit = \"s\"\nmeaning = \"time constant\"\n[[channels]]\nchannel = \"{}\"\nfactor = \"{}\"\n\
             shape = \"k*lag({}, tau)\"\n",
            self.unit(),
            0.75 * tau,
            channel_name(self.channel),
            self.factor(),
            v.name()
        ))
    }

    /// The effect that consists of this form, with fixed constants. The time constant of a lag remains a parameter.
    ///
    /// # Errors
    /// As [`Form::effect`].
    pub fn fixed(&self) -> Result<&'static Written, String> {
        if let Shape::Lagged(v, tau) = self.shape {
            let own = format!("{}_{tau}", self.id()).replace('.', "_");
            return self.through_lag(v, tau, &own);
        }
        let text = format!(
            "schema = 1\nid = \"{}\"\ndescription = \"A shape that was tried.\"\nsource = \"greylag propose\"\n\
             status = \"proposed\"\n[parameters.k]\nvalue = 0.0\nbounds = [-1e6, 1e6]\nunit = \"{}\"\n\
             meaning = \"amount\"\n[[channels]]\nchannel = \"{}\"\nfactor = \"{}\"\nshape = \"k*{}\"\n",
            self.id(),
            self.unit(),
            channel_name(self.channel),
            self.factor(),
            self.shape.text(None)
        );
        register::read(&text)
    }
}

/// Forms in `channel` for each control in `of`, through a lag.
pub fn lags(channel: Channel, of: &[Variable]) -> Vec<Form> {
    let form = |of_air, v| Form { channel, of_air, shape: Shape::Lagged(v, LAG_S) };
    let with_air = of.iter().filter(|v| CONTROLS.contains(v)).map(|v| form(true, *v));
    let thrust = of.contains(&Variable::Throttle).then(|| form(false, Variable::Throttle));
    with_air.chain(thrust).collect()
}

/// Hash of `text` (FNV-1a).
fn number_of(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// All forms of the library in `channel`. `threshold` returns the given quantile of the magnitude of a variable.
pub fn forms(channel: Channel, threshold: &dyn Fn(Variable, f64) -> f64) -> Vec<Form> {
    let mut shapes: Vec<(bool, Shape)> = Vec::new();
    for (of_air, variables) in [(true, &OF_AIR[..]), (false, &BESIDE_AIR[..])] {
        for (i, &v) in variables.iter().enumerate() {
            let positive = matches!(v, Variable::Throttle | Variable::Airspeed);
            shapes.push((of_air, Shape::Linear(v)));
            shapes.push((of_air, Shape::Square(v)));
            if !positive {
                shapes.push((of_air, Shape::Magnitude(v)));
                shapes.push((of_air, Shape::SignedSquare(v)));
            }
            for &w in &variables[i + 1..] {
                shapes.push((of_air, Shape::Product(v, w)));
            }
            if of_air {
                let odd = variables.iter().filter(|w| **w != v && **w != Variable::Throttle);
                shapes.extend(odd.map(|w| (true, Shape::ByMagnitude(v, *w))));
            }
        }
    }
    for v in BANDED {
        for quantile in QUANTILES {
            let c = threshold(v, quantile);
            if c > 0.0 {
                shapes.push((true, Shape::Above(v, c)));
                if v != Variable::Throttle {
                    shapes.push((true, Shape::Beyond(v, c)));
                } else {
                    shapes.push((false, Shape::Above(v, c)));
                }
            }
        }
    }
    shapes.into_iter().map(|(of_air, shape)| Form { channel, of_air, shape }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_is_a_candidate_with_a_free_time_constant() {
        let all = lags(Channel::Yaw, &CONTROLS);
        assert_eq!(all.len(), 5);
        for form in all {
            let effect = form.effect().unwrap_or_else(|why| panic!("{form:?}: {why}"));
            assert_eq!(effect.about.shape, 1);
            let fitted = form.fitted(&[0.5, 0.31234]);
            assert_eq!(fitted.shape.constants(), [0.312]);
            assert_eq!(fitted.id(), form.id());
            let fixed = fitted.fixed().unwrap_or_else(|why| panic!("{form:?}: {why}"));
            assert_ne!(fixed.about.id, effect.about.id);
            assert_eq!(fixed.values, [AMOUNT, 0.312]);
        }
    }

    #[test]
    fn every_form_is_an_effect_with_an_id_of_its_own() {
        let mut ids = Vec::new();
        for channel in Channel::ALL {
            for form in forms(channel, &|_, quantile| (100.0 * quantile).round() / 1000.0) {
                let effect = form.effect().unwrap_or_else(|why| panic!("{form:?}: {why}"));
                assert_eq!(effect.about.shape, 0, "{form:?}");
                ids.push(form.id());
            }
        }
        let count = ids.len();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), count);
    }
}

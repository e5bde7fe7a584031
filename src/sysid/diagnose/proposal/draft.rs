//! Writes a proposed formula as a line of text and as an effect file, which defines an effect (a physical contribution to forces
//! and moments) by a formula.

use super::grades;
use super::library::{Form, Shape};
use greylag_physics::formula::file::channel_name;

/// A term of a proposed formula with its estimated coefficient.
#[derive(Clone, Copy, Debug)]
pub struct Term {
    /// Form of the term: a function of the states and controls, without the coefficient.
    pub form: Form,
    /// Estimated coefficient, in the form's unit.
    pub value: f64,
    /// Standard deviation of the coefficient, in the form's unit.
    pub sd: f64,
}

/// Keeps the new terms at the end of `terms` if `added` is `Some(true)`. Otherwise cuts the list to its former length `count`.
/// `added` is `None` if the model with the new term cannot be evaluated. Returns whether the new terms were kept.
pub fn kept(terms: &mut Vec<Term>, count: usize, added: Option<bool>) -> bool {
    let added = added == Some(true);
    if !added {
        terms.truncate(count);
    }
    added
}

/// The bounds of a coefficient in the effect file are ± this factor times (its magnitude plus three standard deviations).
const ROOM: f64 = 10.0;

/// Rounds `x` to four significant figures.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}

/// Identifier of the proposed effect, at most 40 characters. It has the channel (force or moment) of the first term, and the
/// variables of all terms.
pub fn id(terms: &[Term]) -> String {
    let channel = terms.first().map_or("", |t| channel_name(t.form.channel));
    let mut names: Vec<&str> = Vec::new();
    for variable in terms.iter().flat_map(|t| t.form.shape.variables()) {
        if !names.contains(&variable.name()) {
            names.push(variable.name());
        }
    }
    let full = format!("proposed_{channel}_by_{}", names.join("_"));
    full.chars().take(40).collect()
}

/// The formula of `terms` as a line of text.
pub fn formula(terms: &[Term]) -> String {
    let one = |t: &Term| {
        let factor = if t.form.of_air { format!("{}*", t.form.factor()) } else { String::new() };
        format!("{} = k*{factor}{}", channel_name(t.form.channel), t.form.shape.text(None))
    };
    terms.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// Names in the effect file of the constants in the form of `term`, which has the index `k`.
fn names(k: usize, term: &Term) -> Vec<String> {
    let count = term.form.shape.constants().len();
    let letter = |i: usize| if count > 1 { ["a", "b", "c", "d"][i.min(3)] } else { "" };
    (0..count).map(|i| format!("w{}{}", k + 1, letter(i))).collect()
}

/// Text of the effect file for `terms`. Coefficients, thresholds and other constants are parameters in it. `alike` lists the
/// formulas that the flights cannot distinguish from this one. `from` names the flights of the search.
pub fn file(terms: &[Term], description: &str, alike: &[String], from: &str) -> String {
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let mut text = format!(
        "# Proposed by `greylag propose`. `greylag amend --effect` takes it; nothing flies with it until somebody has\n\
         # looked at it and written status = \"accepted\".\n\
         schema = 1\nid = {}\ndescription = {}\nsource = {}\nstatus = \"proposed\"\nlook_alikes = [{}]\n\
         separated_by = \"flights that move its variables one by one, at two airspeeds\"\n",
        quoted(&id(terms)),
        quoted(description),
        quoted(&format!("greylag propose, of {from}")),
        alike.iter().map(|a| quoted(a)).collect::<Vec<_>>().join(", ")
    );
    for (k, term) in terms.iter().enumerate() {
        let bound = rounded(ROOM * (term.value.abs() + 3.0 * term.sd));
        text += &format!(
            "\n[parameters.k{}]\nvalue = {}\nwidth = {}\nbounds = [-{bound}, {bound}]\nunit = {}\nmeaning = {}\n",
            k + 1,
            rounded(term.value),
            rounded(term.sd.max(0.1 * term.value.abs())),
            quoted(&term.form.unit()),
            quoted(&format!("how much {}", grades::words(&term.form, 1.0)))
        );
        for (name, c) in names(k, term).iter().zip(term.form.shape.constants()) {
            // a threshold may be zero, a divisor may not
            let (ends, unit, meaning) = match term.form.shape {
                Shape::Free(_) => ([0.2 * c, 5.0 * c], "", "constant of its shape"),
                Shape::Lagged(..) => ([0.0, 5.0 * c], "s", "time constant"),
                _ => ([0.0, 3.0 * c], "", "where it begins"),
            };
            text += &format!(
                "\n[parameters.{name}]\nvalue = {c}\nwidth = {}\nbounds = [{}, {}]\nunit = \"{unit}\"\nmeaning = {}\n",
                rounded(0.3 * c.abs()),
                rounded(ends[0].min(ends[1])),
                rounded(ends[0].max(ends[1])),
                quoted(meaning)
            );
        }
    }
    for (k, term) in terms.iter().enumerate() {
        text += &format!(
            "\n[[channels]]\nchannel = {}\nfactor = {}\nshape = {}\n",
            quoted(channel_name(term.form.channel)),
            quoted(term.form.factor()),
            quoted(&format!("k{}*{}", k + 1, term.form.shape.text(Some(&names(k, term)))))
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::free::Free;
    use super::*;
    use greylag_physics::Channel;
    use greylag_physics::formula::{Status, Variable, file as reader, parser};

    #[test]
    fn a_draft_is_an_effect_file_that_nothing_flies() {
        let term = |of_air, shape, value| Term {
            form: Form { channel: Channel::Yaw, of_air, shape },
            value,
            sd: 0.02,
        };
        let terms = [
            term(false, Shape::Linear(Variable::Throttle), 0.53),
            term(true, Shape::Beyond(Variable::Beta, 0.07), -0.01),
            term(true, Shape::Lagged(Variable::Aileron, 0.12), 0.02),
        ];
        // a file name in the Unicode form of macOS; Rust and TOML escape it differently
        let text =
            file(&terms, "It \"yaws\".", &["yaw = k*throttle^2".into()], "e\u{301}te\u{301}.csv");
        let effect = reader::parse(&text).unwrap_or_else(|why| panic!("{why}\n{text}"));
        assert_eq!(effect.status, Status::Proposed);
        assert_eq!(effect.about.id, "proposed_yaw_by_throttle_beta_aileron");
        assert_eq!((effect.values, effect.about.shape), (vec![0.53, -0.01, 0.02, 0.07, 0.12], 2));
    }

    #[test]
    fn a_term_whose_model_cannot_be_evaluated_is_dropped() {
        let shape = Shape::Linear(Variable::Throttle);
        let form = Form { channel: Channel::Yaw, of_air: false, shape };
        let all = || vec![Term { form, value: 0.53, sd: 0.02 }];
        for (added, count) in [(Some(true), 1), (Some(false), 0), (None, 0)] {
            let mut terms = all();
            assert_eq!(kept(&mut terms, 0, added), count == 1);
            assert_eq!(terms.len(), count, "{added:?}");
        }
    }

    #[test]
    fn the_constants_of_a_free_form_are_parameters() {
        let text = "exp(alpha/w0)*beta/(1 + abs(throttle)/w1)";
        let expression = parser::parse(text, &["w0", "w1"]).unwrap();
        let free = Box::leak(Box::new(Free { expression, constants: vec![-0.08, 0.5] }));
        let form = Form { channel: Channel::Pitch, of_air: true, shape: Shape::Free(free) };
        let terms = [Term { form, value: 0.3, sd: 0.02 }];
        let effect = reader::parse(&file(&terms, "It bends.", &[], "a flight")).unwrap();
        assert_eq!((effect.values, effect.about.shape), (vec![0.3, -0.08, 0.5], 2));
        assert_eq!(
            formula(&terms),
            "pitch = k*qbar*S*c*exp(alpha/-0.08)*beta/(1 + abs(throttle)/0.5)"
        );
    }
}

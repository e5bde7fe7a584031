//! Sentences and phrases of the answer to a comparison or refit, composed from its numbers. The error is that of free runs
//! (open-loop simulations) at a horizon.

use super::acting::{Acting, Method};
use super::fitted::{gain, small_gain};
use super::numbers::{Baseline, Decisive, InUse, Left, NOTICED, Numbers, Step, Way};

/// Unexplained share above which it is stated as a multiple of the variance, because a percentage of four or more digits is hard to
/// read. The channel then hardly varies in the flights.
const MULTIPLE: f64 = 9.995;

/// Sentences on the error of the models and its change from one model to the next. If a forecast without aerodynamics errs less
/// than the model as given, this is stated first.
pub fn error(n: &Numbers) -> String {
    let Some((first, rest)) = n.steps.split_first() else {
        return "No free run is long enough for an error to be given.".into();
    };
    match n.better_baseline() {
        Some(baseline) if n.all_behind() => behind(n, baseline, first, rest),
        Some(baseline) => {
            let changes = changes(n, first, rest);
            format!("As given, the model is {}. {changes}{}", worse_than(baseline), gain(n))
        }
        None if n.in_vain() => kept(n, first.error, rest[0].error),
        None => changes(n, first, rest) + &gain(n),
    }
}

/// Sentences on a model that errs more than `baseline`, whether it is tuned or not: its errors, and what the user can do.
fn behind(n: &Numbers, baseline: &Baseline, first: &Step, rest: &[Step]) -> String {
    let (begin, to) = match n.fitted() {
        true => ("its error".to_owned(), " to these flights"),
        false => (format!("{} its error", lower(&on(n))), ""),
    };
    let at = |step: &Step| match step.way {
        Way::Tuned => format!(", tuned{to} {}", number(step.error)),
        _ => format!(",{} {}", by(n, step), number(step.error)),
    };
    format!(
        "The model is {}: {begin} at {} s is {}{}. Check axes, signs and units of the logs, {}.",
        worse_than(baseline),
        number(n.horizon_s),
        number(first.error),
        rest.iter().map(at).collect::<String>(),
        match n.from_scratch {
            true => "or fly more and richer manoeuvres",
            false => "fly more and richer manoeuvres, or fit it from scratch",
        }
    )
}

fn worse_than(baseline: &Baseline) -> String {
    let Baseline { name, error } = baseline;
    format!("worse than a forecast without aerodynamics ({name}, {})", number(*error))
}

/// Sentence on the error of the model `first` and its change with each model of `rest`.
fn changes(n: &Numbers, first: &Step, rest: &[Step]) -> String {
    let mut text = format!("{} the error at {} s", on(n), number(n.horizon_s));
    if rest.is_empty() {
        text += &beside_baseline(n, first.error);
        return text + ".";
    }
    let mut last = None;
    for (k, step) in rest.iter().enumerate() {
        let verb = verb(step);
        let again = last == Some(verb);
        let joint = match (k, again) {
            (0, _) if verb == Verb::Stays => {
                format!(" {} {}{}", verb.word(), number(step.error), by(n, step))
            }
            (0, _) => {
                let name = if step.way == Way::Other {
                    format!(" ({})", first.model)
                } else {
                    String::new()
                };
                format!(
                    " {} from {}{name} to {}{}",
                    verb.word(),
                    number(first.error),
                    number(step.error),
                    by(n, step)
                )
            }
            (_, true) if verb != Verb::Stays => {
                format!(" and to {}{}", number(step.error), by(n, step))
            }
            _ => format!(" and {} {}{}", verb.toward(), number(step.error), by(n, step)),
        };
        let change = match step.change_percent {
            Some(p) if again && step.way != Way::Other => {
                let all = if k + 1 == rest.len() { in_all(n) } else { String::new() };
                format!(" (a further {}{all})", percent(p))
            }
            Some(p) => format!(" ({})", percent(p)),
            None => String::new(),
        };
        text += &(joint + &change);
        last = Some(verb);
    }
    text + "."
}

/// The change from the first to the last model, as the end of a bracket.
fn in_all(n: &Numbers) -> String {
    format!("; {} in all", percent(n.change_percent))
}

/// Sentence on a model whose error rises from `given` to `tuned` by tuning.
fn kept(n: &Numbers, given: f64, tuned: f64) -> String {
    let (at, given, tuned) = (number(n.horizon_s), number(given), number(tuned));
    match n.fitted() {
        true => format!(
            "Keep the model as it is: its error at {at} s is {given}; tuning it to these flights makes it {tuned}."
        ),
        false => format!(
            "Keep the model as it is: {} its error at {at} s is {given}; tuned it is {tuned}.",
            lower(&on(n))
        ),
    }
}

/// The error of a single model, compared with the error of the best forecast without aerodynamics.
fn beside_baseline(n: &Numbers, error: f64) -> String {
    let text = format!(" is {}", number(error));
    let Some(b) = &n.baseline else { return text };
    let beside = if number(b.error) == number(error) {
        "equal to"
    } else if b.error < error {
        "worse than"
    } else {
        "better than"
    };
    let best = number(b.error);
    format!("{text}, {beside} the best forecast without aerodynamics ({}), {best}", b.name)
}

/// Sentences on each added effect (a physical contribution to forces and moments) with its most significant coefficient, and on
/// the state whose prediction improves most.
pub fn effect(n: &Numbers) -> String {
    let mut said: Vec<String> = n.effects.iter().map(one).collect();
    let subject = match (n.steps.len(), n.effects.len()) {
        (0 | 1, _) => return said.join(" "),
        (_, 0) => match n.steps.last() {
            Some(Step { way: Way::Other, model, .. }) => format!("With {model}"),
            _ => "Tuned".into(),
        },
        (_, 1) => "With it".into(),
        _ => "With them".into(),
    };
    let used = n.in_use.as_ref().filter(|_| !n.in_vain());
    said.extend(used.map(|used| in_use(n, used, &subject)));
    said.join(" ")
}

/// Sentence on the channels in which the effects `ids` act; empty without channels.
pub fn acts(ids: &[&str], acts: &[Acting], method: Method) -> String {
    if acts.is_empty() {
        return String::new();
    }
    let verb = if ids.len() == 1 { "acts" } else { "act" };
    format!("{} {verb} {}.", ids.join(" and "), acts_in(acts, ids.len(), method))
}

/// Phrase with the channels `acts`, each with its unexplained shares, in which a number of `effects` act. The models were fitted by
/// `method`.
pub fn acts_in(acts: &[Acting], effects: usize, method: Method) -> String {
    let it = if effects == 1 { "it" } else { "them" };
    let by = method.name();
    let one = |a: &Acting| {
        let given = a.given.map(|x| format!("{} as given", share(x)));
        let tuned = a.tuned.map(|x| format!("{} tuned by {by}", share(x)));
        let with = match a.tuned {
            Some(_) => format!("{} with {it}", share(a.after)),
            None => format!("{} tuned by {by} and with {it}", share(a.after)),
        };
        let all: Vec<String> = given.into_iter().chain(tuned).chain([with]).collect();
        format!("in {} (unexplained: {})", a.name, all.join(", "))
    };
    acts.iter().map(one).collect::<Vec<_>>().join(" and ")
}

/// The unexplained `fraction` of a channel's variance as text: in percent, or as a multiple of the variance if it is large.
pub fn share(fraction: f64) -> String {
    multiple(fraction).unwrap_or_else(|| format!("{} %", number(100.0 * fraction)))
}

/// The unexplained `fraction` of a channel's variance as a multiple of the variance; `None` below ten times the variance. All
/// outputs state such a fraction in this form.
pub fn multiple(fraction: f64) -> Option<String> {
    (fraction > MULTIPLE && fraction.is_finite())
        .then(|| format!("{} times its variance", number(fraction)))
}

fn one(e: &Decisive) -> String {
    let unit = if e.unit.is_empty() { String::new() } else { format!(" {}", e.unit) };
    let [value, low, high] = alike(e.value, e.ci95);
    let what = lower(e.description.trim_end_matches('.'));
    let mut text =
        format!("{} ({what}): {} = {value} (95 %: {low} to {high}){unit}.", e.id, e.coefficient);
    if !e.alike.is_empty() {
        text += &format!(" These flights cannot tell it from {}.", e.alike.join(" or "));
    }
    text
}

/// Texts of a value and the ends of its interval with the same number of decimal places, enough for two digits of the interval's
/// width.
fn alike(value: f64, ci95: [f64; 2]) -> [String; 3] {
    let width = ci95[1] - ci95[0];
    let places = (1.0 - width.log10().floor()).max(0.0);
    let all = [value, ci95[0], ci95[1]];
    match width > 0.0 && places <= 6.0 && all.iter().all(|x| x.abs() < 1e6) {
        true => all.map(|x| format!("{x:.0$}", places as usize).replace('-', "−")),
        false => all.map(number),
    }
}

fn in_use(n: &Numbers, used: &InUse, subject: &str) -> String {
    let (name, unit, factor) = people(used.state);
    let of = |x: f64| format!("{}{unit}", number(factor * x));
    // if effects were added to the last model, it is compared with the model before it
    let before = match &n.steps[..] {
        [.., tuned, last] if last.way == Way::Effects && tuned.way == Way::Tuned => {
            " by tuning alone"
        }
        _ => "",
    };
    format!(
        "{subject} the {name} predicted {} s ahead is off by {} instead of {}{before}.",
        number(n.horizon_s),
        of(used.after),
        of(used.before)
    )
}

/// Sentence on the state with the largest remaining error relative to its scale. It is empty if there is no error.
pub fn left(n: &Numbers) -> String {
    let Some(Left { state, rmse }) = &n.left else { return String::new() };
    let (name, unit, factor) = people(state);
    let error = format!("{}{unit} after {} s", number(factor * rmse), number(n.horizon_s));
    match n.steps.len() {
        0 | 1 => format!("Of the predicted states, {name} is worst: {error}."),
        _ if n.in_vain() => format!("Largest error of the model as given: {name}, {error}."),
        _ => format!("Largest error left: {name}, {error}."),
    }
}

/// The change of the error as a short phrase. If tuning is in vain, the phrase states the error of the model as it is.
pub fn summary(n: &Numbers) -> String {
    let at = format!("error at {} s", number(n.horizon_s));
    match &n.steps[..] {
        [given, ..] if n.in_vain() => format!("{at} {} (model as it is)", number(given.error)),
        [] => "no free run is long enough for an error".into(),
        [only] => format!("{at} {}", number(only.error)),
        [first, .., last] => {
            format!(
                "{at} {} → {} ({}{})",
                number(first.error),
                number(last.error),
                percent(n.change_percent),
                small_gain(n)
                    .map_or(String::new(), |(p, b)| format!("; {p} relative to \"{}\"", b.name))
            )
        }
    }
}

/// Phrase for the flights on which the error was computed, for example "On 2 flights not fitted".
fn on(n: &Numbers) -> String {
    let all = n.flights.len();
    let flights = if all == 1 { "1 flight".into() } else { format!("{all} flights") };
    match n.fitted_flights {
        _ if n.last_third => format!("On the last third of {}, not fitted,", n.flights.join(", ")),
        None => format!("On {flights}"),
        Some(0) => format!("On {flights} not fitted"),
        Some(fitted) if fitted >= all && all == 1 => "On the flight that it was fitted to,".into(),
        Some(fitted) if fitted >= all => format!("On the {flights} that it was fitted to,"),
        Some(fitted) => format!("On {flights}, {fitted} of them fitted,"),
    }
}

/// Direction of a change of the error.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verb {
    Falls,
    Rises,
    Stays,
}

impl Verb {
    fn word(self) -> &'static str {
        match self {
            Verb::Falls => "falls",
            Verb::Rises => "rises",
            Verb::Stays => "stays at",
        }
    }

    fn toward(self) -> &'static str {
        match self {
            Verb::Falls => "falls to",
            Verb::Rises => "rises to",
            Verb::Stays => "stays at",
        }
    }
}

fn verb(step: &Step) -> Verb {
    match step.change_percent {
        Some(p) if p <= -NOTICED => Verb::Falls,
        Some(p) if p >= NOTICED => Verb::Rises,
        _ => Verb::Stays,
    }
}

fn by(n: &Numbers, step: &Step) -> String {
    match step.way {
        Way::Given => String::new(),
        Way::Tuned => " by tuning".into(),
        Way::Effects => {
            let ids: Vec<&str> = n.effects.iter().map(|e| e.id.as_str()).collect();
            format!(
                " with {}",
                if ids.is_empty() { "the effects".into() } else { ids.join(" and ") }
            )
        }
        Way::Other => format!(" with {}", step.model),
    }
}

/// A change `p` (%) as text with its sign. Magnitudes below 10 % and from 98 to 100 % have one decimal place.
pub(super) fn percent(p: f64) -> String {
    let sign = if p > 0.0 { "+" } else { "−" };
    match p.abs() {
        size if !size.is_finite() => "–".into(),
        size if size < 0.05 => "±0 %".into(),
        size if size < 9.95 || (98.0..100.0).contains(&size) => format!("{sign}{size:.1} %"),
        size => format!("{sign}{size:.0} %"),
    }
}

/// `x` with three significant digits, without zeros at the end, and with the minus sign U+2212.
pub(super) fn number(x: f64) -> String {
    let text = match x.abs() {
        0.0 => return "0".into(),
        size if !size.is_finite() => return "–".into(),
        size if !(1e-6..1e6).contains(&size) => format!("{x:.2e}"),
        size => {
            let places = (2 - size.log10().floor() as i32).clamp(0, 9) as usize;
            let text = format!("{x:.places$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
    };
    text.replace('-', "−")
}

/// The text with its first letter in lower case, unless it begins with an acronym or a symbol.
fn lower(text: &str) -> String {
    let mut letters = text.chars();
    match (letters.next(), text.chars().nth(1)) {
        (Some(first), Some(second)) if second.is_lowercase() || second == ' ' => {
            first.to_lowercase().chain(letters).collect()
        }
        _ => text.to_owned(),
    }
}

/// Name and unit of a state in the sentences, and the factor from the state's SI unit.
fn people(state: &str) -> (&str, &'static str, f64) {
    let degrees = 1f64.to_degrees();
    match state {
        "roll_rad" => ("roll", "°", degrees),
        "pitch_rad" => ("pitch", "°", degrees),
        "airspeed_mps" => ("airspeed", " m/s", 1.0),
        "p_radps" => ("roll rate", " °/s", degrees),
        "q_radps" => ("pitch rate", " °/s", degrees),
        "r_radps" => ("yaw rate", " °/s", degrees),
        "alpha_rad" => ("angle of attack", "°", degrees),
        "beta_rad" => ("sideslip", "°", degrees),
        other => (other, "", 1.0),
    }
}

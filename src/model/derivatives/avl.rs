//! Reader of AVL's stability derivatives, commands `ST` and `SB`.
//!
//! The text has rows of `NAME = number`, with the total coefficients at a reference angle of attack. `ST` gives derivatives
//! with respect to α and β (1/rad), pb/2V, qc/2V, rb/2V, and the controls, whose names are above their columns. It gives
//! moments about stability axes, which are converted to body axes. `SB` gives derivatives with respect to u/V, v/V and w/V in
//! place of α and β, in body axes.

use super::numbers::Numbers;
use super::{Column, Control, Derivatives, DerivativesError, Tool, about_body, to_body};

/// Origin of the text, for error messages.
const FROM: &str = "AVL's command ST (or SB), given in the menu OPER after a run, writes it";
/// AVL's names of side force, lift, rolling, pitching and yawing moment.
const NAMES: [&str; 5] = ["CY", "CL", "Cl", "Cm", "Cn"];

/// Reads AVL's `text`. Control derivatives are converted to 1/rad. `radians` is the text's unit of deflection, in rad.
pub(super) fn read(text: &str, radians: f64) -> Result<Derivatives, DerivativesError> {
    let numbers = Numbers::read(text)?;
    let alpha = numbers.need("Alpha", FROM)?.to_radians();
    let is_body = numbers.get("CLa").is_none() && numbers.get("CZw").is_some();
    let of = |suffix: &str| column(&numbers, suffix, alpha, is_body);
    let (by_alpha, by_beta) = if is_body { (of("w")?, of("v")?) } else { (of("a")?, of("b")?) };
    let rates = [of("p")?, of("q")?, of("r")?];
    let controls = control_names(text)
        .into_iter()
        .map(|(name, suffix)| Ok(Control { name, column: of(&suffix)?.map(|x| x / radians) }))
        .collect::<Result<_, DerivativesError>>()?;
    Ok(Derivatives {
        tool: Tool::Avl,
        reference: numbers.reference(FROM)?,
        point: numbers.get("Xref").map(|x| [x, numbers.get("Zref").unwrap_or(0.0)]),
        alpha,
        totals: [numbers.need("CLtot", FROM)?, numbers.need("Cmtot", FROM)?],
        by_alpha,
        by_beta,
        by_rates: if is_body { rates } else { about_body(rates, alpha) },
        controls,
        notes: Vec::new(),
    })
}

/// The derivatives with the name suffix `suffix`, with moments in body axes. `alpha` is in rad.
fn column(
    numbers: &Numbers,
    suffix: &str,
    alpha: f64,
    is_body: bool,
) -> Result<Column, DerivativesError> {
    let get = |name: &str| numbers.need(&format!("{name}{suffix}"), FROM);
    if is_body {
        let (sin, cos) = alpha.sin_cos();
        let lift = get("CX")? * sin - get("CZ")? * cos;
        return Ok([get("CY")?, lift, get("Cl")?, get("Cm")?, get("Cn")?]);
    }
    let mut all = [0.0; 5];
    for (value, name) in all.iter_mut().zip(NAMES) {
        *value = get(name)?;
    }
    Ok(to_body(all, alpha))
}

/// Names of the controls, each with the suffix of its derivatives, from lines such as `aileron d01 elevator d02`.
fn control_names(text: &str) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for line in text.lines().filter(|line| !line.contains('=')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        for pair in words.windows(2) {
            let number = pair[1].strip_prefix('d').filter(|n| n.parse::<u32>().is_ok());
            let is_new = all.iter().all(|(_, suffix)| suffix != pair[1]);
            if number.is_some() && is_new {
                all.push((pair[0].to_owned(), pair[1].to_owned()));
            }
        }
    }
    all
}

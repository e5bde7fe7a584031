//! Reader of AVL's stability derivatives (`ST`, `SB`): rows of `NAME = number`, totals at a reference incidence,
//! derivatives by α and β (1/rad), by pb/2V, qc/2V, rb/2V, and by controls whose names stand above their columns.
//! `ST` is in stability axes, converted here to body axes; `SB` is by u, v, w over V in body axes.

use super::numbers::Numbers;
use super::{Column, Control, Derivatives, DerivativesError, Tool, about_body, to_body};

/// Description of the text's origin for messages.
const FROM: &str = "AVL's command ST (or SB), given in the menu OPER after a run, writes it";
/// Side force, lift, rolling, pitching and yawing moment.
const NAMES: [&str; 5] = ["CY", "CL", "Cl", "Cm", "Cn"];

/// Reads AVL's `text`; control derivatives are converted to 1/rad, given the `radians` in their unit.
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

/// The derivatives with that suffix, moments in body axes.
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

/// Names of the controls with the suffixes of their derivatives; a line holds `aileron d01 elevator d02`.
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

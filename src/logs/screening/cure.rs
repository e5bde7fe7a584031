//! Checks the corrections of a log before they are reported: a column is corrected and checked again.
//!
//! A finding is a defect of the log, such as a wrong unit. Its correction is a factor for a column, and a constant for some.

use crate::Sample;
use crate::columns::{COLUMNS, index};
use crate::finding::{Cure, Finding};

/// Text between the defect and its correction in a finding.
const BETWEEN: &str = ": ";

/// Removes ineffective corrections from `findings`. A correction is ineffective if `check` finds the corrected column wrong
/// again.
pub fn tried(
    findings: Vec<Finding>,
    rows: &[Sample],
    check: impl Fn(&[Sample]) -> Vec<Finding>,
) -> Vec<Finding> {
    let cures = |cure: &Cure| {
        let mended = mended(rows, cure);
        let same = |f: &Finding| f.cure.iter().chain(&f.choices).any(|c| c.column == cure.column);
        !check(&mended).iter().any(same)
    };
    let one = |finding: Finding| match &finding.cure {
        Some(cure) if !cures(cure) => {
            let said = format!("{BETWEEN}{cure}");
            let why = ". No such correction puts it right: look at the flight at these times, or name another source in a mapping";
            let text = finding.text.replace(&said, why);
            Finding { text, cure: None, ..finding }
        }
        _ => finding,
    };
    findings.into_iter().map(one).collect()
}

/// A copy of `rows` to which the correction `cure` is applied.
fn mended(rows: &[Sample], cure: &Cure) -> Vec<Sample> {
    let places = |(column, from): (&str, &str)| index(column).zip(index(from));
    let columns: Vec<(usize, usize)> = cure.sources().into_iter().filter_map(places).collect();
    let mut rows = rows.to_vec();
    for row in &mut rows {
        let before = *row;
        for (i, from) in &columns {
            *COLUMNS[*i].2(row) = COLUMNS[*from].1(&before) * cure.scale + cure.offset;
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cure_after_which_the_column_is_wrong_again_is_not_printed() {
        let cure = Cure::factor("alpha_rad", 0.0174533);
        let found = Finding {
            cure: Some(cure.clone()),
            ..Finding::problem(format!("alpha_rad looks like degrees: {cure}"))
        };
        let rows = [Sample { alpha_rad: 90.0, ..Sample::default() }];
        let large = |limit: f64| {
            let found = found.clone();
            move |rows: &[Sample]| {
                if rows[0].alpha_rad > limit { vec![found.clone()] } else { Vec::new() }
            }
        };
        let helped = tried(vec![found.clone()], &rows, large(2.0));
        assert_eq!(helped, std::slice::from_ref(&found));
        let [useless] = &tried(vec![found.clone()], &rows, large(1.0))[..] else { panic!() };
        assert!(
            useless.cure.is_none() && !useless.text.contains("--mapping FILE, in"),
            "{useless}"
        );
    }
}

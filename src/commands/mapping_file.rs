//! Text of a mapping file: it multiplies columns of logs by factors that correct wrong units and signs.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::logs::info::Info;

/// Columns that share a unit. A finding of a wrong unit names only the first column of a group.
const ALIKE: [(&str, [&str; 2]); 2] =
    [("roll_rad", ["pitch_rad", "yaw_rad"]), ("p_radps", ["q_radps", "r_radps"])];

/// The mapping that corrects the findings about `logs`; `None` if no finding can be corrected by a factor.
pub fn mapping(logs: &[Info]) -> Option<String> {
    let mut columns = BTreeMap::new();
    for log in logs {
        let cures = || log.findings.iter().filter_map(|f| f.cure.as_ref());
        // a finding about a sign is reliable only if the units are right, so that wrong units are corrected first
        let units = cures().any(|cure| cure.scale > 0.0);
        for cure in cures().filter(|cure| !units || cure.scale > 0.0) {
            let column = cure.column.as_str();
            let alike = ALIKE.iter().find(|(first, _)| *first == column && cure.scale > 0.0);
            let there =
                |c: &&&str| log.channels.iter().any(|own| own.columns.iter().any(|o| o == **c));
            let others = alike.into_iter().flat_map(|(_, others)| others.iter().filter(there));
            for column in std::iter::once(&column).chain(others) {
                let entry = log.entries.get(*column).map(|e| e.times(cure.scale, log.format));
                columns.extend(entry.map(|entry| ((*column).to_owned(), entry)));
            }
        }
    }
    let mut text = "schema = 1\n\n[columns]\n".to_owned();
    for (column, entry) in &columns {
        let _ = writeln!(text, "{column} = {entry}");
    }
    (!columns.is_empty()).then_some(text)
}

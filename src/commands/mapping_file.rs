//! Text of a mapping file: it multiplies columns of logs by factors that correct wrong units and signs.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::logs::info::Info;

/// The mapping that corrects the findings about `logs`; `None` if no finding can be corrected by a factor.
pub fn mapping(logs: &[Info]) -> Option<String> {
    let mut columns = BTreeMap::new();
    for log in logs {
        let cures = || log.findings.iter().filter_map(|f| f.cure.as_ref());
        // a finding about a sign is reliable only if the units are right, so that wrong units are corrected first
        let units = cures().any(|cure| cure.scale > 0.0);
        for cure in cures().filter(|cure| !units || cure.scale > 0.0) {
            for column in cure.columns() {
                let entry = log.entries.get(column).map(|e| e.times(cure.scale, log.format));
                columns.extend(entry.map(|entry| (column.to_owned(), entry)));
            }
        }
    }
    let mut text = "schema = 1\n\n[columns]\n".to_owned();
    for (column, entry) in &columns {
        let _ = writeln!(text, "{column} = {entry}");
    }
    (!columns.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::logs::finding::{Cure, Finding};
    use crate::logs::{Options, parse};

    #[test]
    fn a_wrong_unit_is_corrected_in_all_columns_that_have_it() {
        let mut table = String::from(
            "time_s,roll_rad,pitch_rad,p_radps,q_radps,r_radps,airspeed_mps,aileron_rad,elevator_rad,throttle,ax_mps2,ay_mps2,az_mps2\n",
        );
        for k in 0..60 {
            let _ = writeln!(
                table,
                "{:.2},0.1,0.05,0.01,0,0,15,0,0,0.5,0.05,0,-1",
                0.01 * f64::from(k)
            );
        }
        let log = parse(table.as_bytes(), Path::new("g.csv"), &Options::default()).unwrap();
        let cure = Cure { column: "ax_mps2".into(), scale: 9.80665 };
        let found = Finding { cure: Some(cure), ..Finding::problem("in g") };
        let info = Info { findings: vec![found], ..Info::of(&log) };
        let text = mapping(&[info]).unwrap();
        for column in ["ax_mps2", "ay_mps2", "az_mps2"] {
            let line = format!("{column} = {{ from = \"csv.{column}\", scale = 9.80665 }}");
            assert!(text.contains(&line), "{text}");
        }
    }
}

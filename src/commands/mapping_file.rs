//! A mapping file that puts right what was found wrong with units and signs of logs.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::logs::info::Info;
use crate::logs::mapping::TEXT;
use crate::logs::{Channel, Format};

/// The text of the mapping; `None` if no factor puts anything right.
pub fn mapping(logs: &[Info]) -> Option<String> {
    let mut columns = BTreeMap::new();
    for log in logs {
        let cures = || log.findings.iter().filter_map(|f| f.cure.as_ref());
        // with a wrong unit beside it a sign cannot be judged
        let units = cures().any(|cure| cure.scale > 0.0);
        for cure in cures().filter(|cure| !units || cure.scale > 0.0) {
            columns.insert(cure.column.clone(), (origin(log, &cure.column), cure.scale));
        }
    }
    let mut text = "schema = 1\n\n[columns]\n".to_owned();
    for (column, (from, scale)) in &columns {
        let _ = writeln!(text, "{column} = {{ from = {from:?}, scale = {scale:?} }}");
    }
    (!columns.is_empty()).then_some(text)
}

/// Where a column of a log comes from, as a mapping says it.
fn origin(log: &Info, column: &str) -> String {
    let named = |c: &&Channel| c.columns.iter().any(|own| own == column);
    match (log.format, log.channels.iter().find(named)) {
        (Format::Csv, _) | (_, None) => format!("{TEXT}.{column}"),
        (_, Some(channel)) => channel.origin.clone(),
    }
}

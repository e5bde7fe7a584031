//! Fields that a mapping names and a log does not have.

use crate::finding::Finding;
use crate::mapping::TEXT;
use crate::mapping::rule::Rule;

/// A warning that lists the rules of the user's mapping for which the log has no data; `None` if there is no such rule.
/// `without` holds all rules without data. Rules for CSV columns are skipped.
pub(super) fn finding(without: &[&Rule]) -> Option<Finding> {
    let own = without.iter().filter(|rule| rule.own && rule.topic != TEXT);
    let named: Vec<String> =
        own.map(|rule| format!("{} for {}", rule.origin(), rule.columns().join(", "))).collect();
    (!named.is_empty()).then(|| {
        Finding::warning(format!(
            "the mapping names what the log does not have, or has without a number: {}",
            named.join("; ")
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::Topics;

    #[test]
    fn a_field_of_the_mapping_that_the_log_lacks_is_named() {
        let linear = |topic: &str| Rule::linear("alpha_rad", topic, "AOA", 1.0);
        let (built_in, own, table) = (linear("AOA"), linear("WIND").own(), linear(TEXT).own());
        let said = finding(&[&built_in, &own, &table]).unwrap().text;
        assert!(said.ends_with("without a number: WIND.AOA for alpha_rad"), "{said}");
        assert_eq!(finding(&[&built_in, &table]), None);
        // the same finding results when a log is read
        let found = super::super::build(&Topics::default(), &[own], &[]).findings;
        assert!(found.iter().any(|f| f.text == said), "{found:?}");
    }
}

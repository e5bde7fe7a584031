//! Builds expressions of JSBSim's functions as XML text.

/// Placeholder that stands in the settings of a flight-control component for the property of its input.
pub(super) const INPUT: &str = "{input}";

/// A reference to the JSBSim property `name`: `<property>name</property>`.
pub(super) fn property(name: &str) -> String {
    format!("<property>{name}</property>")
}

/// The expression of a constant.
pub(super) fn value(x: f64) -> String {
    format!("<value>{x}</value>")
}

/// The product of expressions.
pub(super) fn product(terms: &[String]) -> String {
    format!("<product>{}</product>", terms.concat())
}

/// The sum of expressions.
pub(super) fn sum(terms: &[String]) -> String {
    format!("<sum>{}</sum>", terms.concat())
}

/// The magnitude of an expression.
pub(super) fn abs(term: String) -> String {
    format!("<abs>{term}</abs>")
}

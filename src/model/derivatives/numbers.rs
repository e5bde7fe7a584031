//! Parser of texts that contain `NAME = number`, as written by Fortran and Qt programs.

use std::collections::BTreeMap;

use super::DerivativesError;

/// The numbers of a text by their names. If a name occurs several times, the first number counts.
pub(super) struct Numbers(BTreeMap<String, f64>);

impl Numbers {
    pub fn read(text: &str) -> Result<Numbers, DerivativesError> {
        let mut all = BTreeMap::new();
        for (k, line) in text.lines().enumerate() {
            let parts: Vec<&str> = line.split('=').collect();
            for pair in parts.windows(2) {
                let name = pair[0].split_whitespace().next_back().unwrap_or_default();
                // XFLR5 writes a text, dots and the name without a space: "…the weight...VInf = 8.6"
                let name = name.rsplit("...").next().unwrap_or_default();
                let value = pair[1].split_whitespace().next().unwrap_or_default();
                // a title in words may contain an equals sign
                if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || value.is_empty() {
                    continue;
                }
                match value.trim_end_matches('°').parse::<f64>() {
                    Ok(number) if number.is_finite() => {
                        all.entry(name.to_owned()).or_insert(number);
                    }
                    // Fortran writes asterisks for a number that does not fit its field
                    Ok(_) | Err(_)
                        if value.starts_with('*') || value.eq_ignore_ascii_case("nan") =>
                    {
                        let (name, text) = (name.to_owned(), value.to_owned());
                        return Err(DerivativesError::Number { name, text, line: k + 1 });
                    }
                    _ => {}
                }
            }
        }
        Ok(Numbers(all))
    }

    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// The number `name`. If it is missing, the error names `tool`, the output that should contain it.
    pub fn need(&self, name: &str, tool: &'static str) -> Result<f64, DerivativesError> {
        let missing = || DerivativesError::Missing { name: name.into(), tool };
        self.get(name).ok_or_else(missing)
    }

    /// Reference area, chord and span, in the text's unit of length.
    pub fn reference(&self, tool: &'static str) -> Result<[f64; 3], DerivativesError> {
        let all = [self.need("Sref", tool)?, self.need("Cref", tool)?, self.need("Bref", tool)?];
        super::positive(all)
    }
}

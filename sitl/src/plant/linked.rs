//! A control that is linked to one or several properties, written `NAME` or `[-]NAME[*SCALE],…`.
//!
//! An example is an aircraft whose left and right aileron have separate commands, in rad up to 0.52. Its aileron is
//! `fcs/left_rad*0.52,-fcs/right_rad*0.52`. A write gives each property the value times its factor. A read gives the mean of the
//! properties times their factors.

use jsbsim::{Error, Fdm, NodeId};

use super::PlantError;
use super::lookup::needed;

/// A property name with its factor.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Part {
    pub name: String,
    pub factor: f64,
}

/// Parses a text of the form that the module comment describes.
pub(super) fn parts(text: &str) -> Vec<Part> {
    let part = |part: &str| {
        let part = part.trim();
        let (sign, rest) = part.strip_prefix('-').map_or((1.0, part), |rest| (-1.0, rest));
        let scaled = rest.split_once('*').and_then(|(name, scale)| {
            Some((
                name.trim(),
                scale.trim().parse::<f64>().ok().filter(|s| s.is_finite() && *s != 0.0)?,
            ))
        });
        let (name, scale) = scaled.unwrap_or((rest, 1.0));
        Part { name: name.to_owned(), factor: sign * scale }
    };
    text.split(',').map(part).collect()
}

/// Nodes with their factors.
#[derive(Clone, Debug)]
pub(super) struct Linked(Vec<(NodeId, f64)>);

impl Linked {
    /// Looks up every part on a loaded aircraft; the error names the first missing property.
    pub fn find(fdm: &Fdm, aircraft: &str, text: &str) -> Result<Linked, PlantError> {
        let node = |part: Part| Ok((needed(fdm, aircraft, &part.name)?, part.factor));
        Ok(Linked(parts(text).into_iter().map(node).collect::<Result<_, PlantError>>()?))
    }

    /// The linked properties of `text`; `None` if one of them does not exist.
    pub fn look(fdm: &Fdm, text: &str) -> Option<Linked> {
        Linked::find(fdm, "", text).ok()
    }

    /// Adds `value` times the factor of each part to the values that are to be written.
    pub fn add(&self, value: f64, written: &mut Vec<(NodeId, f64)>) {
        for (node, factor) in &self.0 {
            match written.iter_mut().find(|(known, _)| known == node) {
                Some((_, sum)) => *sum += factor * value,
                None => written.push((*node, factor * value)),
            }
        }
    }

    /// Mean of the properties, each times its factor.
    pub fn read(&self, fdm: &mut Fdm) -> Result<f64, Error> {
        let mut sum = 0.0;
        for (node, factor) in &self.0 {
            sum += factor * fdm.read_node(*node)?;
        }
        Ok(if self.0.len() == 1 { sum } else { sum / self.0.len() as f64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_stands_for_itself_and_a_list_for_its_parts() {
        let part = |name: &str, factor: f64| Part { name: name.into(), factor };
        assert_eq!(parts("fcs/a-cmd-norm"), [part("fcs/a-cmd-norm", 1.0)]);
        assert_eq!(
            parts("fcs/l_rad*0.5, -fcs/r[1]*0.5"),
            [part("fcs/l_rad", 0.5), part("fcs/r[1]", -0.5)]
        );
        assert_eq!(parts("-fcs/r-pos-rad"), [part("fcs/r-pos-rad", -1.0)]);
    }
}

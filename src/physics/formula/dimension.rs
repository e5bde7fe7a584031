//! Physical dimensions, with which the units in effect files are checked.

use std::fmt;

/// The exponents of kilogram, metre and second. They are stored doubled, so that half-integer exponents (from square roots) are
/// whole numbers. A radian is dimensionless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dimension([i16; 3]);

/// Units by name, with their exponents of kilogram, metre and second (not doubled).
const UNITS: &[(&str, [i16; 3])] = &[
    ("rad", [0, 0, 0]),
    ("kg", [1, 0, 0]),
    ("m", [0, 1, 0]),
    ("s", [0, 0, 1]),
    ("N", [1, 1, -2]),
    ("Pa", [1, -1, -2]),
    ("J", [1, 2, -2]),
    ("W", [1, 2, -3]),
    ("Hz", [0, 0, -1]),
];

impl Dimension {
    /// Dimension of a dimensionless number.
    pub const NONE: Dimension = Dimension([0; 3]);
    /// Dimension of a force.
    pub const FORCE: Dimension = Dimension([2, 2, -4]);
    /// Dimension of a moment.
    pub const MOMENT: Dimension = Dimension([2, 4, -4]);

    /// Dimension of kg, m and s raised to the powers `mass`, `length` and `time`.
    pub const fn new(mass: i16, length: i16, time: i16) -> Dimension {
        Dimension([2 * mass, 2 * length, 2 * time])
    }

    /// Dimension of a product.
    pub fn times(self, other: Dimension) -> Dimension {
        Dimension(std::array::from_fn(|i| self.0[i].saturating_add(other.0[i])))
    }

    /// Dimension of a quotient.
    pub fn per(self, other: Dimension) -> Dimension {
        self.times(other.to_power(-1))
    }

    /// Dimension of an integer power.
    pub fn to_power(self, exponent: i16) -> Dimension {
        Dimension(self.0.map(|x| x.saturating_mul(exponent)))
    }

    /// Dimension of the square root. `None` if an exponent of this dimension is not a whole number.
    pub fn root(self) -> Option<Dimension> {
        self.0.iter().all(|x| x % 2 == 0).then(|| Dimension(self.0.map(|x| x / 2)))
    }

    /// Parses a unit such as `N m`, `1/rad²`, `kg m^2` or `m/s`. An empty text is dimensionless.
    ///
    /// # Errors
    /// If a part of the text is not one of the SI units known here, or its exponent is not a whole number from −8 to 8.
    pub fn parse(text: &str) -> Result<Dimension, String> {
        let mut dimension = Dimension::NONE;
        let (mut sign, mut rest) = (1, text.trim());
        while let Some(next) = rest.chars().next() {
            if matches!(next, ' ' | '·' | '*' | '/') {
                sign = if next == '/' { -1 } else { sign };
                rest = &rest[next.len_utf8()..];
                continue;
            }
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
            let (name, behind) = rest.split_at(end);
            let (power, behind) = exponent(behind).ok_or_else(|| unknown(text, rest))?;
            let unit = UNITS.iter().find(|(known, _)| *known == name);
            let one = match (name, unit) {
                ("1", _) => Dimension::NONE,
                (_, Some((_, [mass, length, time]))) => Dimension::new(*mass, *length, *time),
                _ => return Err(unknown(text, name)),
            };
            dimension = dimension.times(one.to_power(sign * power));
            // a division applies to one unit only: 1/s m is m/s
            (sign, rest) = (1, behind);
        }
        Ok(dimension)
    }
}

/// The exponent at the start of `text` (1 if there is none) and the text after it. `None` if the exponent is invalid.
fn exponent(text: &str) -> Option<(i16, &str)> {
    const RAISED: [(char, i16); 8] =
        [('¹', 1), ('²', 2), ('³', 3), ('⁴', 4), ('⁵', 5), ('⁶', 6), ('⁷', 7), ('⁸', 8)];
    if let Some(digits) = text.strip_prefix('^') {
        let end = digits.find(|c: char| !c.is_ascii_digit() && c != '-').unwrap_or(digits.len());
        let power: i16 = digits[..end].parse().ok().filter(|p| (-8..=8).contains(p))?;
        return Some((power, &digits[end..]));
    }
    let (sign, raised) = text.strip_prefix('⁻').map_or((1, text), |behind| (-1, behind));
    let found = raised.chars().next().and_then(|c| RAISED.iter().find(|(r, _)| *r == c));
    match found {
        Some((c, power)) => Some((sign * power, &raised[c.len_utf8()..])),
        None if sign < 0 => None,
        None => Some((1, text)),
    }
}

fn unknown(text: &str, part: &str) -> String {
    let part: String = part.chars().take(20).collect();
    let known: Vec<&str> = UNITS.iter().map(|(name, _)| *name).collect();
    format!(
        "unit {text:?} is not understood at {part:?}; write SI units, for example \"N m\" or \"1/rad²\", of {}",
        known.join(", ")
    )
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMED: [(&str, Dimension); 8] = [
            ("1", Dimension::NONE),
            ("N", Dimension::FORCE),
            ("N m", Dimension::MOMENT),
            ("N m s", Dimension::new(1, 2, -1)),
            ("N s", Dimension::new(1, 1, -1)),
            ("N/m", Dimension::new(1, 0, -2)),
            ("N s/m", Dimension::new(1, 0, -1)),
            ("Pa", Dimension::new(1, -1, -2)),
        ];
        if let Some((name, _)) = NAMED.iter().find(|(_, known)| known == self) {
            return f.write_str(name);
        }
        let mut parts = Vec::new();
        for (name, power) in ["kg", "m", "s"].iter().zip(self.0) {
            match (power / 2, power % 2) {
                (0, 0) => (),
                (1, 0) => parts.push((*name).to_owned()),
                (whole, 0) => parts.push(format!("{name}^{whole}")),
                _ => parts.push(format!("{name}^({power}/2)")),
            }
        }
        f.write_str(&parts.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_as_they_are_written() {
        let of = |text: &str| Dimension::parse(text).unwrap();
        assert_eq!(of("N m"), Dimension::MOMENT);
        assert_eq!(of("kg m²/s²"), Dimension::MOMENT);
        assert_eq!(of("kg·m^2·s⁻²"), Dimension::MOMENT);
        assert_eq!(of("1/rad²"), Dimension::NONE);
        assert_eq!(of(""), Dimension::NONE);
        assert_eq!(of("Pa m²"), Dimension::FORCE);
        assert_eq!(of("m/s").to_string(), "m s^-1");
        assert_eq!(of("kg").root().unwrap().to_string(), "kg^(1/2)");
        for wrong in ["deg", "m^99", "m⁻", "ft/s", "N$m"] {
            assert!(Dimension::parse(wrong).unwrap_err().contains("SI units"), "{wrong}");
        }
    }
}

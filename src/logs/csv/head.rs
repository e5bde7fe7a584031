//! The header of a CSV table. It states which field of a row (a value of the file) fills which column of Greylag's log format.
//! This file also parses the fields' numbers.

use std::collections::BTreeMap;
use std::path::Path;

use super::CsvError;
use super::dialect::{self, Dialect};
use super::raw::Raw;
use super::records::Fields;
use crate::columns::{COLUMNS, EITHER, NEEDED, Place, index};
use crate::mapping::{Entry, Mapping, TEXT};
use crate::{Sample, mixed};

/// Where a field goes: the column, the scale and offset of the conversion, and whether the field is one term of a sum.
type Target = (Place, f64, f64, Share);

/// Whether a field alone fills a column. Otherwise the sum of several fields fills it, such as the elevons that act as an
/// elevator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Share {
    Whole,
    OneOfSeveral,
}

/// The columns that one field fills.
enum To {
    Nowhere,
    /// A single column without conversion, which is the usual case.
    Column(Place),
    Targets(Vec<Target>),
}

impl To {
    fn of(targets: Vec<Target>) -> To {
        match targets[..] {
            [] => To::Nowhere,
            [(place, scale, offset, Share::Whole)] if (scale, offset) == (1.0, 0.0) => {
                To::Column(place)
            }
            _ => To::Targets(targets),
        }
    }
}

/// The columns that the fields of a table fill.
pub(super) struct Head {
    fields: Vec<To>,
    /// Fields that were recognised although their names are not those of the log format.
    pub dialect: Dialect,
    /// Indices of the four fields of the attitude quaternion, if the table has one.
    quaternion: Option<[usize; 4]>,
    decimal: Decimal,
}

impl Head {
    /// Finds the columns that the fields `names` fill. Also returns a table without rows that holds the notes on the header.
    pub fn of(names: &[String], delimiter: u8, path: &Path, mapping: &Mapping) -> (Head, Raw) {
        let dialect = Dialect::of(names, mapping);
        let mut targets: Vec<Vec<Target>> =
            names.iter().map(|name| targets(name, mapping, &dialect)).collect();
        let mixed = mixed::columns(names, mapping);
        for part in &mixed {
            targets[part.field].push((part.place, part.share, 0.0, Share::OneOfSeveral));
        }
        let mut made: Vec<String> = mixed.iter().map(|part| part.column.to_owned()).collect();
        made.extend(COLUMNS.iter().filter(|c| dialect.fills(c.0)).map(|c| c.0.to_owned()));
        let missing = missing_columns(&[names.to_vec(), made].concat(), mapping, path);
        let unknown = names.iter().zip(&targets).filter(|(_, targets)| targets.is_empty());
        let unknown = unknown.map(|(name, _)| name.clone());
        let table = Raw {
            missing,
            unknown_columns: unknown.filter(|n| !n.is_empty() && !dialect.reads(n)).collect(),
            entries: entries(names, mapping, &dialect),
            notes: dialect.said().into_iter().chain(lacking(names, mapping)).collect(),
            ..Raw::default()
        };
        let place = |name: &String| names.iter().position(|n| n == name).unwrap_or(usize::MAX);
        let quaternion = dialect.quaternion.as_ref().map(|q| q.each_ref().map(place));
        let decimal = if delimiter == b',' { Decimal::Point } else { Decimal::PointOrComma };
        let fields = targets.into_iter().map(To::of).collect();
        (Head { fields, dialect, quaternion, decimal }, table)
    }

    /// The sample in a row of the file. `None` if the row has too few fields, a field that is used is not a number, or the time
    /// is missing. An empty field is NaN.
    pub fn sample(&self, record: Fields<'_>) -> Option<Sample> {
        // a row with too few fields is damaged; its sample would also need much more memory than the row
        if record.len() < self.fields.len() {
            return None;
        }
        let mut sample = Sample::default();
        for (to, field) in self.fields.iter().zip(record.iter()) {
            match to {
                To::Nowhere => {}
                To::Column(place) => {
                    let x = number(field, self.decimal)?;
                    if !x.is_nan() {
                        *place(&mut sample) = x;
                    }
                }
                To::Targets(targets) => {
                    let x = number(field, self.decimal)?;
                    targets.iter().filter(|_| !x.is_nan()).for_each(|to| put(to, x, &mut sample));
                }
            }
        }
        sample.time_s.is_finite().then_some(sample)
    }

    /// The components of the attitude quaternion in a row; `None` if the table has no quaternion.
    pub fn quaternion(&self, record: Fields<'_>) -> Option<[f64; 4]> {
        let part = |i| record.get(i).and_then(|f| number(f, self.decimal)).unwrap_or(f64::NAN);
        self.quaternion.map(|q| q.map(part))
    }
}

/// Converts the number `x` of a field and writes it into its column, or adds it there.
fn put((place, scale, offset, share): &Target, x: f64, sample: &mut Sample) {
    let value = if (*scale, *offset) == (1.0, 0.0) { x } else { x * scale + offset };
    let place = place(sample);
    let sums = *share == Share::OneOfSeveral && !place.is_nan();
    *place = if sums { *place + value } else { value };
}

/// Decimal separators that are accepted.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Decimal {
    Point,
    PointOrComma,
}

/// The number in a field. A date is converted to a time in s. NaN if the field is empty; `None` if it is neither a number nor a
/// date.
fn number(field: &[u8], decimal: Decimal) -> Option<f64> {
    if let Some(x) = short(field) {
        return Some(x);
    }
    let field = std::str::from_utf8(field).ok()?.trim();
    if field.is_empty() {
        return Some(f64::NAN);
    }
    let plain = field.parse().ok();
    let comma = || match decimal {
        Decimal::PointOrComma if field.contains(',') => field.replacen(',', ".", 1).parse().ok(),
        _ => None,
    };
    plain.or_else(comma).or_else(|| dialect::time(field))
}

/// Powers of ten that an `f64` represents exactly.
const TENS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Reads a number of at most 15 digits without an exponent; `None` for any other text. Most fields hold such a number. It is
/// the quotient of an integer and a power of ten. Both are exact in `f64`, so the quotient is correctly rounded (Clinger 1990).
fn short(field: &[u8]) -> Option<f64> {
    let (sign, digits) = match field {
        [b'-', rest @ ..] => (-1.0, rest),
        rest => (1.0, rest),
    };
    if digits.len() > TENS.len() {
        return None;
    }
    let (mut whole, mut behind, mut point) = (0u64, 0, false);
    let mut rest = digits;
    while let [b, after @ ..] = rest {
        match b {
            b'0'..=b'9' => {
                whole = 10 * whole + u64::from(b - b'0');
                behind += usize::from(point);
            }
            b'.' if !point => {
                point = true;
                if let Some((digits, after)) = after.split_first_chunk()
                    && let Some(eight) = eight(*digits)
                {
                    whole = 100_000_000 * whole + eight;
                    behind = 8;
                    rest = after;
                    continue;
                }
            }
            _ => return None,
        }
        rest = after;
    }
    let count = digits.len() - usize::from(point);
    (1..TENS.len()).contains(&count).then(|| sign * (whole as f64 / TENS[behind]))
}

/// Reads a number of eight digits (Lemire, "Quickly parsing eight digits"). `None` if a character is not a digit.
fn eight(digits: [u8; 8]) -> Option<u64> {
    const ZEROS: u64 = 0x3030_3030_3030_3030;
    const ABOVE: u64 = 0x4646_4646_4646_4646;
    const HIGH: u64 = 0x8080_8080_8080_8080;
    let letters = u64::from_le_bytes(digits);
    let values = letters.wrapping_sub(ZEROS);
    if (letters.wrapping_add(ABOVE) | values) & HIGH != 0 {
        return None;
    }
    // combines digits to numbers of two digits, these to numbers of four, and these to the whole number
    let pairs = (10 * values + (values >> 8)) & 0x00FF_00FF_00FF_00FF;
    let fours = (100 * pairs + (pairs >> 16)) & 0x0000_FFFF_0000_FFFF;
    Some((10_000 * fours + (fours >> 32)) & 0xFFFF_FFFF)
}

/// The columns that the field `name` of the file fills.
fn targets(name: &str, mapping: &Mapping, dialect: &Dialect) -> Vec<Target> {
    let mut targets: Vec<Target> = mapping
        .of_topic(TEXT)
        .filter(|(_, entry)| entry.field == name)
        .filter_map(|(column, e)| {
            Some((COLUMNS[index(column)?].2, e.scale, e.offset, Share::Whole))
        })
        .collect();
    if mapping.get(name).is_none()
        && let Some(i) = index(name)
    {
        targets.push((COLUMNS[i].2, 1.0, 0.0, Share::Whole));
    }
    let under_other_names = dialect.found.iter().filter(|f| f.field == name);
    targets.extend(
        under_other_names
            .filter_map(|f| Some((COLUMNS[index(&f.column)?].2, f.scale, f.offset, Share::Whole))),
    );
    targets
}

/// The entry of a mapping file for each column that a single field fills.
fn entries(names: &[String], mapping: &Mapping, dialect: &Dialect) -> BTreeMap<String, Entry> {
    let same = |column: &str| {
        names.iter().any(|name| name == column).then(|| Entry::scaled(TEXT, column, 1.0))
    };
    let under_other_name = |column: &str| {
        let found = dialect.found.iter().find(|f| f.column == column)?;
        Some(Entry { offset: found.offset, ..Entry::scaled(TEXT, &found.field, found.scale) })
    };
    let entry = |column: &str| {
        let own = mapping.get(column).cloned();
        own.or_else(|| same(column)).or_else(|| under_other_name(column))
    };
    COLUMNS.iter().filter_map(|c| Some((c.0.to_owned(), entry(c.0)?))).collect()
}

/// A note on the fields that the mapping file names and the table does not have; `None` if it has all.
fn lacking(names: &[String], mapping: &Mapping) -> Option<String> {
    let lacks = |field: &String| !names.contains(field);
    let columns = mapping.of_topic(TEXT).filter(|(_, entry)| lacks(&entry.field));
    let mut parts: Vec<String> =
        columns.map(|(column, entry)| format!("{TEXT}.{} for {column}", entry.field)).collect();
    let turn = mapping.quaternion().filter(|turn| turn.topic == TEXT);
    let fields = turn.into_iter().flat_map(|turn| &turn.fields).filter(|field| lacks(field));
    parts.extend(fields.map(|field| format!("{TEXT}.{field} for the attitude")));
    (!parts.is_empty()).then(|| {
        format!("the mapping names columns that the table does not have: {}", parts.join(", "))
    })
}

/// An error with a remedy for each required column that no field in `names` fills.
fn missing_columns(names: &[String], mapping: &Mapping, path: &Path) -> Vec<CsvError> {
    let has = |column: &str| {
        let name = mapping.get(column).map_or(column, |entry| &entry.field);
        names.iter().any(|n| n == name)
    };
    let missing = |column, remedy| CsvError::Column { path: path.to_owned(), column, remedy };
    let remedy = |column: &str| match mapping.get(column) {
        Some(Entry { topic, field, .. }) => {
            format!("the mapping takes it from {topic}.{field}, which the table does not have")
        }
        None => "add it, in the unit its name ends with".into(),
    };
    let alone = NEEDED.into_iter().filter(|column| !has(column) && !mapping.makes(column));
    let alone = alone.map(|column| missing(column, remedy(column)));
    let either = EITHER.into_iter().filter(|(command, position)| !has(command) && !has(position));
    let either = either.map(|(command, position)| {
        missing(command, format!("add it, or the position `{position}`"))
    });
    alone.chain(either).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_mapping_names_and_the_table_lacks_is_said() {
        let text = "schema = 1\n[columns]\nalpha_rad = { from = \"csv.aoa\" }\n\
            airspeed_mps = { from = \"csv.tas\" }\n\
            [attitude]\nquaternion = [\"csv.a\", \"csv.b\", \"csv.c\", \"csv.d\"]\n";
        let mapping = Mapping::parse(text, Path::new("m.toml")).unwrap();
        let names = ["time_s", "a", "b", "c"].map(str::to_owned);
        let (_, table) = Head::of(&names, b',', Path::new("t.csv"), &mapping);
        let note = table.notes.join("; ");
        for part in ["csv.aoa for alpha_rad", "csv.tas for airspeed_mps", "csv.d for the attitude"]
        {
            assert!(note.contains(part), "{note}");
        }
        let missing: Vec<String> = table.missing.iter().map(CsvError::to_string).collect();
        let missing = missing.join("\n");
        assert!(missing.contains("`roll_rad`") && missing.contains("from csv.tas"), "{missing}");
    }

    #[test]
    fn a_column_has_the_entry_of_its_field_in_the_file() {
        let mapping = "schema = 1\n[columns]\nalpha_rad = { from = \"csv.aoa\", scale = 2.0 }\n";
        let mapping = Mapping::parse(mapping, Path::new("m.toml")).unwrap();
        let names = ["time_s", "Phi (deg)", "aoa", "q_radps", "q0"].map(str::to_owned);
        let (_, table) = Head::of(&names, b',', Path::new("t.csv"), &mapping);
        let of = |column: &str| table.entries.get(column).map(|e| (e.field.as_str(), e.scale));
        assert_eq!(of("roll_rad"), Some(("Phi (deg)", 1_f64.to_radians())));
        assert_eq!(of("alpha_rad"), Some(("aoa", 2.0)));
        assert_eq!(of("q_radps"), Some(("q_radps", 1.0)));
        assert_eq!(of("pitch_rad"), None);
    }

    #[test]
    fn a_short_number_is_that_of_the_standard_library_to_the_bit() {
        let mut seed = 1u64;
        for _ in 0..50_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let (digits, point) = (seed >> 33, (seed >> 20) as usize % 8);
            let text = format!("{:.point$}", digits as f64 / 10f64.powi((seed >> 10) as i32 % 11));
            for text in [text.clone(), format!("-{text}")] {
                let right: f64 = text.parse().unwrap();
                let count = text.bytes().filter(u8::is_ascii_digit).count();
                match short(text.as_bytes()) {
                    Some(own) => assert_eq!(own.to_bits(), right.to_bits(), "{text}"),
                    None => assert!(count > 15, "{text}"),
                }
            }
        }
        for text in [
            "",
            "-",
            ".",
            "1e3",
            "1.2.3",
            "+1",
            " 1",
            "inf",
            "1.1234567.",
            "1.1234567/",
            "1.:2345678",
        ] {
            assert_eq!(short(text.as_bytes()), None, "{text}");
        }
        assert_eq!([&b"1."[..], b".5", b"-0"].map(short), [Some(1.0), Some(0.5), Some(-0.0)]);
        for (from, letter) in (0..=255u8).enumerate() {
            let mut digits = *b"90817263";
            digits[from % 8] = letter;
            let right = std::str::from_utf8(&digits).ok().and_then(|d| d.parse::<u64>().ok());
            let right = right.filter(|_| letter != b'+');
            assert_eq!(eight(digits), right, "{digits:?}");
        }
    }
}

//! Finds the fields of a ROS 2 message type in its text definition, and reads their values from a message in the CDR encoding.
//!
//! The crate `re_ros_msg` (0.36.3) is not used. It rejects a whole definition if the name of one constant is not in
//! capitals, and it builds a map of all fields for each message. This reader stores only the requested fields and stops
//! after the last of them.
//!
//! Strings and the elements of arrays of messages are skipped. A message type with a `wstring` cannot be read.

use std::collections::BTreeMap;

use super::cdr::Cdr;
use crate::number::Number;

/// Largest nesting of message types that is read. Types of MAVROS and PX4 have at most five levels.
const DEPTH: usize = 8;
/// Largest number of fields and array elements, summed over all message types of a bag. `nav_msgs/Odometry` has about a
/// hundred.
pub(super) const STEPS: usize = 1 << 16;
/// Largest number of fields of a message that are read.
const FIELDS: usize = 256;
/// Largest number of elements of an array that are read as fields.
const ELEMENTS: usize = 32;
/// Fields that state the time of a message. Their values come first in a decoded message.
pub(super) const STAMPS: [&str; 4] =
    ["header.stamp.sec", "header.stamp.nanosec", "timestamp", "timestamp_sample"];

/// The number of elements of an array.
#[derive(Clone, Copy, Debug)]
enum Count {
    Fixed(usize),
    /// A number that the message states.
    Sequence,
}

/// One step of reading a message.
#[derive(Debug)]
enum Step {
    /// A number. The index is the place of its value in the decoded message; `None` if it is not requested.
    Number(Number, Option<usize>),
    /// A string, which is skipped.
    Text,
    /// An array of numbers, with a place as in `Number` for each of its first elements.
    Numbers(Number, Count, Vec<Option<usize>>),
    /// An array of strings or messages, which is skipped.
    Each(Count, Vec<Step>),
}

impl Step {
    /// Whether the step stores a value.
    fn reads(&self) -> bool {
        match self {
            Step::Number(_, place) => place.is_some(),
            Step::Numbers(_, _, places) => places.iter().any(Option::is_some),
            Step::Text | Step::Each(..) => false,
        }
    }
}

/// The fields of a message type, each as type and name.
type Fields<'t> = Vec<(&'t str, &'t str)>;

/// The steps by which the requested fields of a message type are read.
#[derive(Debug)]
pub(super) struct Plan {
    steps: Vec<Step>,
    /// Names of the requested fields in the order of their values, such as `outer.inner` or, for an array element, `field[0]`.
    pub fields: Vec<String>,
}

impl Plan {
    /// Makes the plan for the type `name` (`package/msg/Type`) from the definitions in `text`, for the fields that `wanted`
    /// selects. `None` if a definition is missing, or nested too deeply, or needs more steps than are left in `budget`.
    pub fn of(
        name: &str,
        text: &str,
        wanted: &dyn Fn(&str) -> bool,
        budget: &mut usize,
    ) -> Option<Plan> {
        let types = types(name, text);
        let mut maker = Maker { types: &types, wanted, fields: Vec::new(), budget };
        let mut steps = Vec::new();
        maker.message(&short(name), Some(""), DEPTH, &mut steps)?;
        let read = steps.iter().rposition(Step::reads).map_or(0, |last| last + 1);
        steps.truncate(read);
        Some(Plan { steps, fields: maker.fields })
    }

    /// Reads a message into `values`: first the fields of [`STAMPS`], then `fields`. An absent value is NaN. Returns `false` if
    /// the message does not fit the definition.
    pub fn decode(&self, message: &[u8], values: &mut Vec<f64>) -> bool {
        values.clear();
        values.resize(STAMPS.len() + self.fields.len(), f64::NAN);
        let Some(mut cdr) = Cdr::of(message) else { return false };
        run(&self.steps, &mut cdr, values).is_some()
    }
}

fn run(steps: &[Step], cdr: &mut Cdr<'_>, values: &mut [f64]) -> Option<()> {
    for step in steps {
        match step {
            Step::Number(kind, place) => {
                let value = cdr.number(*kind)?;
                if let Some(place) = place {
                    values[*place] = value;
                }
            }
            Step::Text => cdr.pass_text()?,
            Step::Numbers(kind, count, places) => {
                let count = counted(*count, cdr)?;
                for place in places.iter().take(count) {
                    let value = cdr.number(*kind)?;
                    if let Some(place) = place {
                        values[*place] = value;
                    }
                }
                cdr.pass(*kind, count.saturating_sub(places.len()))?;
            }
            Step::Each(count, steps) => {
                for _ in 0..counted(*count, cdr)? {
                    let before = cdr.left();
                    run(steps, cdr, values)?;
                    // Elements without bytes can be stated in any number, so the loop ends at the first one.
                    if cdr.left() == before {
                        break;
                    }
                }
            }
        }
    }
    Some(())
}

fn counted(count: Count, cdr: &mut Cdr<'_>) -> Option<usize> {
    match count {
        Count::Fixed(count) => Some(count),
        Count::Sequence => cdr.length(),
    }
}

/// Makes the steps of a plan.
struct Maker<'m> {
    types: &'m BTreeMap<String, Fields<'m>>,
    wanted: &'m dyn Fn(&str) -> bool,
    fields: Vec<String>,
    /// Number of steps that may still be made.
    budget: &'m mut usize,
}

impl Maker<'_> {
    /// Subtracts `steps` from the budget; `None` if it is too small.
    fn spend(&mut self, steps: usize) -> Option<()> {
        *self.budget = self.budget.checked_sub(steps)?;
        Some(())
    }

    /// Index at which the value of the field `name` is stored; `None` if the field is not requested.
    fn place(&mut self, name: &str) -> Option<usize> {
        if let Some(stamp) = STAMPS.iter().position(|stamp| *stamp == name) {
            // A field with the time is always stored, at a fixed index.
            return Some(stamp);
        }
        let fits = self.fields.len() < FIELDS && (self.wanted)(name);
        (fits && !self.fields.iter().any(|field| field == name)).then(|| {
            self.fields.push(name.to_owned());
            STAMPS.len() + self.fields.len() - 1
        })
    }

    /// Appends the steps for a message of type `name` to `out`. `prefix` precedes the names of its fields. If it is `None`,
    /// the fields are read past and not stored.
    fn message(
        &mut self,
        name: &str,
        prefix: Option<&str>,
        depth: usize,
        out: &mut Vec<Step>,
    ) -> Option<()> {
        let depth = depth.checked_sub(1)?;
        let types = self.types;
        let fields = match types.get(name) {
            Some(fields) => &fields[..],
            None if name == "builtin_interfaces/Time" => &TIME[..],
            None if name == "builtin_interfaces/Duration" => &TIME[..],
            None => return None,
        };
        let package = name.split('/').next().unwrap_or_default();
        for (kind, field) in fields {
            self.spend(1)?;
            let path = prefix.map(|prefix| format!("{prefix}{field}"));
            self.field(kind, package, path.as_deref(), depth, out)?;
        }
        if fields.is_empty() {
            // A message without fields is serialised as one byte.
            out.push(Step::Number(Number::U8, None));
        }
        Some(())
    }

    /// Appends the steps for a field to `out`. `kind` is its type as written in a definition of `package`. `path` is its name
    /// with prefix; if it is `None`, the field is not stored.
    fn field(
        &mut self,
        kind: &str,
        package: &str,
        path: Option<&str>,
        depth: usize,
        out: &mut Vec<Step>,
    ) -> Option<()> {
        let (element, count) = array(kind)?;
        let number = Number::named(element);
        match (number, count) {
            (Some(number), None) => {
                let place = path.and_then(|path| self.place(path));
                out.push(Step::Number(number, place));
            }
            (Some(number), Some(count)) => {
                let most = if let Count::Fixed(n) = count { n.min(ELEMENTS) } else { ELEMENTS };
                self.spend(most)?;
                let mut place = |i: usize| path.and_then(|p| self.place(&format!("{p}[{i}]")));
                let places = (0..most).map(&mut place).collect();
                out.push(Step::Numbers(number, count, places));
            }
            (None, None) if is_text(element) => out.push(Step::Text),
            (None, Some(count)) if is_text(element) => {
                out.push(Step::Each(count, vec![Step::Text]));
            }
            (None, None) => {
                let prefix = path.map(|path| format!("{path}."));
                self.message(&full(element, package), prefix.as_deref(), depth, out)?;
            }
            (None, Some(count)) => {
                let mut steps = Vec::new();
                self.message(&full(element, package), None, depth, &mut steps)?;
                out.push(Step::Each(count, steps));
            }
        }
        Some(())
    }
}

/// The fields of `builtin_interfaces/Time` and `Duration`. Some bags lack the definitions of these two types.
const TIME: [(&str, &str); 2] = [("int32", "sec"), ("uint32", "nanosec")];

/// Element type and number of elements of an array type. A type that is no array is returned as it is, without a number.
fn array(kind: &str) -> Option<(&str, Option<Count>)> {
    let Some((element, count)) = kind.split_once('[') else { return Some((kind, None)) };
    let count = count.strip_suffix(']')?;
    let bound = count.is_empty() || count.starts_with("<=");
    let count = if bound { Count::Sequence } else { Count::Fixed(count.parse().ok()?) };
    Some((element, Some(count)))
}

/// Whether a type is a string, with or without a bound on its length.
fn is_text(kind: &str) -> bool {
    kind.split("<=").next() == Some("string")
}

/// The full name `package/Type` of a type that a definition of `package` names `kind`.
fn full(kind: &str, package: &str) -> String {
    match kind {
        "Header" => "std_msgs/Header".to_owned(),
        _ if kind.contains('/') => short(kind),
        _ => format!("{package}/{kind}"),
    }
}

/// The name `package/Type` from `package/msg/Type`.
fn short(name: &str) -> String {
    match (name.split('/').next(), name.rsplit_once('/')) {
        (Some(package), Some((_, kind))) => format!("{package}/{kind}"),
        _ => name.to_owned(),
    }
}

/// The message types in the definition `text`, with their fields. The first is `name`. Each further one begins with a line
/// `MSG: package/Type`.
fn types<'t>(name: &str, text: &'t str) -> BTreeMap<String, Fields<'t>> {
    let mut types: BTreeMap<String, Fields<'t>> = BTreeMap::new();
    let mut current = short(name);
    types.entry(current.clone()).or_default();
    for line in text.lines() {
        if let Some(next) = line.trim().strip_prefix("MSG:") {
            current = short(next.trim());
            types.entry(current.clone()).or_default();
        } else if let (Some(field), Some(fields)) = (field(line), types.get_mut(&current)) {
            fields.push(field);
        }
    }
    types
}

/// Type and name of the field that a line declares; `None` for a constant, a comment or a separator.
fn field(line: &str) -> Option<(&str, &str)> {
    let line = line.split('#').next()?.trim();
    let (kind, rest) = line.split_once(char::is_whitespace)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len());
    let (name, after) = rest.split_at(end);
    (!after.trim_start().starts_with('=') && !name.is_empty()).then_some((kind, name))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "# a comment\nuint8 small_constant=3\nHeader header\nInner[] inner\nfloat64[3] x # the axes\n\
        uint16[<=4] pulses\nstring<=8 name \"a # b\"\nbool last 1\n================\nMSG: std_msgs/Header\n\
        builtin_interfaces/Time stamp\nstring frame_id\n================\nMSG: own/Inner\nint8 a\nfloat32 b\n";

    /// A message of the type in `TEXT`, encoded by hand in little-endian or big-endian order.
    fn message(little: bool) -> Vec<u8> {
        let mut out = vec![0, u8::from(little), 0, 0];
        let order = |bytes: &[u8]| -> Vec<u8> {
            if little { bytes.to_vec() } else { bytes.iter().rev().copied().collect() }
        };
        let pad = |out: &mut Vec<u8>, to: usize| {
            while !(out.len() - 4).is_multiple_of(to) {
                out.push(0xEE);
            }
        };
        out.extend(order(&7i32.to_le_bytes()));
        out.extend(order(&500_000_000u32.to_le_bytes()));
        out.extend(order(&4u32.to_le_bytes()));
        out.extend(b"map\0");
        out.extend(order(&2u32.to_le_bytes()));
        for (a, b) in [(1u8, 2f32), (3, 4.0)] {
            out.push(a);
            pad(&mut out, 4);
            out.extend(order(&b.to_le_bytes()));
        }
        pad(&mut out, 8);
        for x in [1.5f64, -2.5, 3.5] {
            out.extend(order(&x.to_le_bytes()));
        }
        out.extend(order(&2u32.to_le_bytes()));
        for x in [1500u16, 1600] {
            out.extend(order(&x.to_le_bytes()));
        }
        out.extend(order(&2u32.to_le_bytes()));
        out.extend(b"n\0\x01");
        out
    }

    #[test]
    fn fields_are_read_in_both_byte_orders() {
        let plan = Plan::of(
            "own/msg/Outer",
            TEXT,
            &|f| f.starts_with("x[") || f.starts_with("pulses[") || f == "last",
            &mut 1000,
        );
        let plan = plan.unwrap();
        let mut values = Vec::new();
        for little in [true, false] {
            assert!(plan.decode(&message(little), &mut values));
            assert_eq!(values[..2], [7.0, 5e8]);
            let of = |name: &str| {
                values[STAMPS.len() + plan.fields.iter().position(|f| f == name).unwrap()]
            };
            assert_eq!(
                [of("x[0]"), of("x[2]"), of("pulses[1]"), of("last")],
                [1.5, 3.5, 1600.0, 1.0]
            );
            assert!(of("pulses[2]").is_nan());
        }
        // A message that ends too early does not fit its definition.
        let whole = message(true);
        assert!((0..whole.len()).all(|end| !plan.decode(&whole[..end], &mut values)));
    }

    #[test]
    fn definitions_that_have_no_end_are_not_followed() {
        let wanted = |_: &str| true;
        assert!(Plan::of("own/msg/A", "A a\n", &wanted, &mut STEPS.clone()).is_none());
        assert!(Plan::of("own/msg/A", "B b\n", &wanted, &mut STEPS.clone()).is_none());
        let wide: String = (0..5)
            .map(|i| format!("MSG: own/T{i}\n{}", format!("T{} a\n", i + 1).repeat(20)))
            .collect();
        assert!(
            Plan::of(
                "own/msg/A",
                &format!("T0 a\n{wide}MSG: own/T5\nint8 x\n"),
                &wanted,
                &mut STEPS.clone()
            )
            .is_none()
        );
        // The message states 2³² − 1 elements without bytes.
        let plan = Plan::of(
            "own/msg/A",
            "E[] e\nint8 x\n===\nMSG: own/E\nint8[0] n\n",
            &wanted,
            &mut STEPS.clone(),
        )
        .unwrap();
        let mut values = Vec::new();
        assert!(plan.decode(&[0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 9], &mut values));
        assert_eq!(values[STAMPS.len()], 9.0);
    }
}

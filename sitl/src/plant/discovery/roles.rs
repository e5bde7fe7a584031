//! Assignment of the tried commands to aileron, elevator and rudder.

use super::Found;
use super::document::Names;
use crate::plant::{PlantError, Properties};

/// Response of the aircraft to a command that was tried.
#[derive(Clone, Debug)]
pub(super) struct Tried {
    pub command: String,
    /// Rolling, pitching and yawing moment at the command 1 minus those at 0, each divided by its reference length, lbf.
    pub moments: [f64; 3],
    /// Positions that moved, with their changes at the commands −1 and 1; the first is 0 if −1 is not allowed.
    pub moved: Vec<(String, [f64; 2])>,
    /// The least command that gives the full deflection.
    pub full_at: f64,
    /// Whether the command may be negative.
    pub two_sided: bool,
}

/// Deflection assumed at full command if the aircraft has only a normalised position, rad: 20°.
const SHARE_RAD: f64 = 0.349;
/// Largest difference of the movements of two positions that count as equal, as a fraction.
const ALIKE: f64 = 0.01;
/// Smallest moment of a candidate, as a fraction of the largest about the same axis.
const LEAST: f64 = 0.05;
/// Smallest moment about an axis, as a fraction of the largest about any axis; a smaller moment is attributed to
/// rounding.
const LEAST_OF_ALL: f64 = 1e-3;

/// A control and its axis: 0 roll, 1 pitch, 2 yaw.
struct Role {
    name: &'static str,
    axis: usize,
    /// Sign of the moment of a positive command.
    sense: f64,
    words: [&'static str; 3],
    does: &'static str,
}

const ROLES: [Role; 3] = [
    Role { name: "aileron", axis: 0, sense: 1.0, words: ["ail", "elevon", "roll"], does: "rolls" },
    Role {
        name: "elevator",
        axis: 1,
        sense: -1.0,
        words: ["elev", "elevon", "stab"],
        does: "pitches",
    },
    Role { name: "rudder", axis: 2, sense: -1.0, words: ["rud", "rud", "yaw"], does: "yaws" },
];
/// Parts of the names of commands that are not primary controls.
const OTHERS: [&str; 7] = ["flap", "spoil", "brake", "trim", "slat", "gear", "gain"];

/// One command, or two commands with the sign of each.
struct Choice<'a> {
    parts: Vec<(&'a Tried, f64)>,
    score: f64,
}

/// Assigns the roles. The error names the axis that no command moves and the commands that were tried.
pub(super) fn choose(tried: &[Tried], names: &Names, aircraft: &str) -> Result<Found, PlantError> {
    let mut properties = Properties::default();
    let mut notes = Vec::new();
    for role in &ROLES {
        let Some(choice) = best(tried, role) else {
            if role.name == "rudder" {
                notes.push("no command yaws the aircraft: it is flown without a rudder".to_owned());
                continue;
            }
            return Err(PlantError::Unmoved {
                aircraft: aircraft.to_owned(),
                does: role.does,
                tried: listed(tried, names),
            });
        };
        let (command, position) = named(&choice, role, &mut notes);
        let keys = [format!("{}_command", role.name), format!("{}_position", role.name)];
        for (key, name) in keys.iter().zip([command, position]) {
            if let (Some(place), Some(name)) = (properties.name_mut(key), name) {
                *place = name;
            }
        }
    }
    Ok(Found { properties, notes })
}

/// Short list of the commands, each with the axis that it moves most.
fn listed(tried: &[Tried], names: &Names) -> String {
    if tried.is_empty() {
        return format!("{} commands were tried, none moves anything", names.commands.len());
    }
    let axes = ["rolls", "pitches", "yaws"];
    let one = |t: &Tried| {
        let most = (0..3).max_by(|a, b| t.moments[*a].abs().total_cmp(&t.moments[*b].abs()));
        match most.filter(|k| t.moments[*k].abs() > 1e-9) {
            Some(k) => format!("{} {}", t.command, axes[k]),
            None => format!("{} makes no moment", t.command),
        }
    };
    tried.iter().take(8).map(one).collect::<Vec<_>>().join(", ")
}

/// The command or pair with the highest score: most moment about the axis of `role`, least about the others.
fn best<'a>(tried: &'a [Tried], role: &Role) -> Option<Choice<'a>> {
    let largest = tried.iter().map(|t| t.moments[role.axis].abs()).fold(0.0, f64::max);
    let of_all = tried.iter().flat_map(|t| t.moments).fold(0.0, |most, m| m.abs().max(most));
    if largest < LEAST_OF_ALL * of_all {
        return None;
    }
    let mut all: Vec<Choice<'a>> = Vec::new();
    for (k, one) in tried.iter().enumerate() {
        all.push(Choice { parts: vec![(one, 1.0)], score: 0.0 });
        for other in tried[k + 1..].iter().filter(|other| are_sides(&one.command, &other.command)) {
            all.push(Choice { parts: vec![(one, 1.0), (other, 1.0)], score: 0.0 });
            all.push(Choice { parts: vec![(one, 1.0), (other, -1.0)], score: 0.0 });
        }
    }
    for choice in &mut all {
        choice.score = score(&choice.parts, role, largest);
    }
    all.into_iter().max_by(|a, b| a.score.total_cmp(&b.score)).filter(|c| c.score > 0.0)
}

fn score(parts: &[(&Tried, f64)], role: &Role, largest: f64) -> f64 {
    let sum = |axis: usize| parts.iter().map(|(t, sign)| sign * t.moments[axis]).sum::<f64>().abs();
    let own = sum(role.axis);
    // moments about the other two axes count against a candidate
    let beside: f64 = (0..3).filter(|k| *k != role.axis).map(sum).sum();
    if !(own > LEAST * largest && own > 1e-9) || parts.iter().any(|(t, _)| !t.two_sided) {
        return 0.0;
    }
    let name = |words: &[&str]| {
        parts.iter().all(|(t, _)| words.iter().any(|w| t.command.to_lowercase().contains(w)))
    };
    let words = if name(&role.words) { 4.0 } else { 1.0 };
    let others = if name(&OTHERS) { 0.1 } else { 1.0 };
    let moves = if parts.iter().all(|(t, _)| !positions(t).is_empty()) { 1.0 } else { 0.3 };
    (own / (own + beside)).powi(2) * (own / largest).min(2.0).sqrt() * words * others * moves
}

/// Whether two names denote the left and the right side of one control.
fn are_sides(a: &str, b: &str) -> bool {
    let swapped = a.replace("left", "right") == b.replace("left", "right") && a != b;
    let differ: Vec<(char, char)> = a.chars().zip(b.chars()).filter(|(x, y)| x != y).collect();
    let letters = differ.first().is_some_and(|(x, y)| {
        matches!((x.to_ascii_lowercase(), y.to_ascii_lowercase()), ('l', 'r') | ('r', 'l'))
    });
    swapped || (a.len() == b.len() && differ.len() == 1 && letters)
}

/// The position that a command moves most, and all positions that it moves by the same amount. Normalised positions
/// count only if no position in rad moves. There may be two: on a V-tail, the elevator moves both surfaces the same way
/// and the rudder moves them opposite ways. The mean of both positions, with their signs, is then the position of the
/// control.
fn positions(tried: &Tried) -> Vec<&(String, [f64; 2])> {
    let kind = |name: &str| match name {
        _ if name.contains("deg") => 0,
        _ if name.contains("norm") => 1,
        _ => 2,
    };
    let size = |m: &[f64; 2]| m[0].abs().max(m[1].abs());
    let usable = tried.moved.iter().filter(|(name, m)| kind(name) > 0 && size(m) < 3.0);
    let most = usable
        .clone()
        .max_by(|a, b| kind(&a.0).cmp(&kind(&b.0)).then(size(&a.1).total_cmp(&size(&b.1))));
    let Some((first, m)) = most else { return Vec::new() };
    let alike = |other: &&(String, [f64; 2])| {
        kind(&other.0) == kind(first) && (size(&other.1) - size(m)).abs() < ALIKE * size(m)
    };
    usable.filter(alike).collect()
}

/// Command and position of the choice, written as `--property` takes them.
fn named(
    choice: &Choice,
    role: &Role,
    notes: &mut Vec<String>,
) -> (Option<String>, Option<String>) {
    let moment: f64 = choice.parts.iter().map(|(t, sign)| sign * t.moments[role.axis]).sum();
    let turn = if moment * role.sense < 0.0 { -1.0 } else { 1.0 };
    let (mut commands, mut places) = (Vec::new(), Vec::new());
    for (tried, sign) in &choice.parts {
        let sign = sign * turn;
        commands.push(linked(&tried.command, sign, tried.full_at));
        for (name, [back, ahead]) in positions(tried) {
            let rises = if ahead - back >= 0.0 { sign } else { -sign };
            let is_share = name.contains("norm");
            if is_share {
                notes.push(format!(
                    "{name} is a share of a deflection that the file does not state: {SHARE_RAD} rad are assumed, and only the \
                     {}'s effect at full command is known", role.name
                ));
            }
            places.push(linked(name, rises, if is_share { SHARE_RAD } else { 1.0 }));
        }
    }
    let text = |parts: Vec<String>| (!parts.is_empty()).then(|| parts.join(","));
    (text(commands), text(places))
}

fn linked(name: &str, sign: f64, scale: f64) -> String {
    let minus = if sign < 0.0 { "-" } else { "" };
    match (scale - 1.0).abs() < 1e-3 {
        true => format!("{minus}{name}"),
        false => format!("{minus}{name}*{scale:.4}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_known_by_their_names() {
        assert!(are_sides("fcs/cmdAilL_rad", "fcs/cmdAilR_rad"));
        assert!(are_sides("fcs/left-elevon-cmd", "fcs/right-elevon-cmd"));
        assert!(!are_sides("fcs/cmdAilL_rad", "fcs/cmdFlapR_rad"));
        assert!(!are_sides("fcs/a1", "fcs/a2"));
    }
}

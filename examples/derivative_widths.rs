//! Compares derivatives from textbook formulas and from aerodynamic tools with measured derivatives. Prints the prior standard
//! deviations (widths) that follow from the errors.
//!
//! ```text
//! cargo run --ignore-rust-version --no-default-features --example derivative_widths [-- --write]
//! ```
//!
//! Errors e and widths w are relative to the computed value: e = (computed − measured) / |computed|. A guessed width g has the
//! weight of two aircraft: w² = (2 g² + Σ e²) / (2 + n), with the number n of aircraft.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use greylag::model::derivatives::widths::Tool;
use greylag::model::derivatives::{Beside, read, reference};
use greylag::model::textbook::{Measures, Tail};

/// Result with any error, such as that of reading a file or parsing a number.
type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Weight of a guessed width, as a number of aircraft.
const GUESS: f64 = 2.0;
/// Suffixes of the JSON files of an aircraft, with the tools that wrote them.
const FILES: [(&str, Tool); 4] = [
    ("optvl", Tool::OptVl),
    ("vortexlatticemethod", Tool::AeroSandboxLattice),
    ("aerobuildup", Tool::AeroBuildup),
    ("liftingline", Tool::LiftingLine),
];

/// A row of a table as its cells.
type Row = Vec<String>;
/// Computed values by aircraft, tool and derivative.
type Computed = BTreeMap<(String, String, String), f64>;

fn main() -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("params/widths");
    let measured = table(&folder.join("measured.csv"))?;
    let computed = computed(root)?;
    let mut errors: BTreeMap<(&str, &str), Vec<f64>> = BTreeMap::new();
    println!(
        "| aircraft | derivative | measured | textbook | lattice | AeroSandbox's lattice | AeroBuildup | lifting line |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for row in &measured {
        let [aircraft, kind, name, value, ..] = row.as_slice() else { continue };
        let truth: f64 = value.parse()?;
        let mut cells = Vec::new();
        for family in FAMILIES {
            let key = (aircraft.clone(), family.to_owned(), name.clone());
            let found = computed.get(&key).filter(|x| x.abs() > 1e-9);
            cells.push(found.map_or("-".into(), |x| format!("{x:.3}")));
            if let Some(x) = found {
                errors.entry((family, name)).or_default().push((x - truth) / x.abs());
            }
        }
        println!("| {aircraft} ({kind}) | {name} | {truth} | {} |", cells.join(" | "));
    }
    cross_check(root)?;
    let widths = widths(&table(&folder.join("guesses.csv"))?, &errors)?;
    println!("\n{widths}");
    if std::env::args().any(|a| a == "--write") {
        std::fs::write(folder.join("widths.csv"), widths)?;
    }
    Ok(())
}

/// Prints the derivatives of one aircraft, the example `trainer`, as computed by every tool.
fn cross_check(root: &Path) -> Result<()> {
    let measures = measures("trainer", 2.4, 1.8, 0.45, Tail::Conventional);
    let mut columns = vec![("textbook", coefficients(&measures.model())?)];
    for (file, tool) in FILES {
        let text = std::fs::read_to_string(
            root.join(format!("tests/data/derivatives/trainer-{file}.json")),
        )?;
        let beside = Beside { measures: measures.clone(), metres: 1.0, radians: 1f64.to_radians() };
        columns.push((tool.name(), coefficients(&taken(&read(&text, &beside)?.model, tool))?));
    }
    let heads: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    println!("\n| trainer | {} |\n|---|{}", heads.join(" | "), "---|".repeat(heads.len()));
    for (name, _) in &columns[1].1 {
        let cell = |all: &[(String, f64)]| {
            all.iter().find(|(n, _)| n == name).map_or("-".to_owned(), |(_, x)| format!("{x:.3}"))
        };
        let cells: Vec<String> = columns.iter().map(|(_, all)| cell(all)).collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
    Ok(())
}

/// Families of tools, one per column of the printed table.
const FAMILIES: [&str; 5] =
    ["textbook", "lattice", "aerosandbox-lattice", "aerobuildup", "lifting-line"];

/// The text of the file with the widths.
fn widths(guesses: &[Row], errors: &BTreeMap<(&str, &str), Vec<f64>>) -> Result<String> {
    let mut out = "tool,derivative,width,aircraft,rms_error\n".to_owned();
    for row in guesses {
        let [tool, name, guess] = row.as_slice() else { continue };
        let guess: f64 = guess.parse()?;
        let seen = errors.get(&(tool.as_str(), name.as_str())).map_or(&[][..], Vec::as_slice);
        let (count, sum) = (seen.len() as f64, seen.iter().map(|e| e * e).sum::<f64>());
        let width = ((GUESS * guess * guess + sum) / (GUESS + count)).sqrt();
        let rms =
            if seen.is_empty() { String::new() } else { format!("{:.2}", (sum / count).sqrt()) };
        out.push_str(&format!("{tool},{name},{width:.2},{count},{rms}\n"));
    }
    Ok(out)
}

/// Derivatives computed by the textbook formulas, by the tools, and by the authors of `computed.csv`.
fn computed(root: &Path) -> Result<Computed> {
    let mut all = Computed::new();
    for row in table(&root.join("params/widths/computed.csv"))? {
        let [aircraft, tool, name, value, ..] = row.as_slice() else { continue };
        let tool = Tool::ALL.into_iter().find(|t| t.name() == tool).ok_or("unknown tool")?;
        all.insert((aircraft.clone(), tool.family().into(), name.clone()), value.parse()?);
    }
    for row in table(&root.join("params/widths/aircraft.csv"))? {
        let [aircraft, mass, span, area, tail] = row.as_slice() else { continue };
        let wing = tail == "flying-wing";
        let tail = if wing { Tail::FlyingWing } else { Tail::Conventional };
        let measures = measures(aircraft, mass.parse()?, span.parse()?, area.parse()?, tail);
        let tuned = |name: &str| aircraft == "x8" && TUNED.contains(&name);
        for (name, value) in coefficients(&measures.model())? {
            if !tuned(&name) {
                all.insert((aircraft.into(), "textbook".into(), name), value);
            }
        }
        for (file, tool) in FILES {
            let path = root.join(format!("tests/data/derivatives/{aircraft}-{file}.json"));
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            reference(&text)?;
            let beside =
                Beside { measures: measures.clone(), metres: 1.0, radians: 1f64.to_radians() };
            let found = read(&text, &beside)?;
            println!("{aircraft}, {tool}: {}", found.warnings.join("; "));
            for (name, value) in coefficients(&taken(&found.model, tool))? {
                all.insert((aircraft.into(), tool.family().into(), name), value);
            }
        }
    }
    println!();
    Ok(all)
}

/// Derivatives of a flying wing that the textbook formulas take from the X8. Their errors are not computed for the X8.
const TUNED: [&str; 6] = ["Clp", "Clda", "Cmde", "CLde", "Cmq", "Cnda"];

fn measures(name: &str, mass: f64, span: f64, area: f64, tail: Tail) -> Measures {
    Measures {
        name: name.into(),
        mass,
        span,
        area,
        tail,
        rudder: (tail == Tail::Conventional).then_some(0.4),
        travel: 0.4,
        static_thrust: 5.0 * mass,
        pitch_speed: 50.0,
    }
}

/// The lines of a model file whose values are from the tool, not from the textbook formulas.
fn taken(model: &str, tool: Tool) -> String {
    let own = format!("source = \"{tool}\"");
    model.lines().filter(|line| line.contains(&own)).collect::<Vec<_>>().join("\n")
}

/// Names and values of a model file's coefficients.
fn coefficients(model: &str) -> Result<Vec<(String, f64)>> {
    let line = |line: &str| -> Option<(String, f64)> {
        let (name, rest) = line.split_once(" = { value = ")?;
        Some((name.to_owned(), rest.split(',').next()?.parse().ok()?))
    };
    Ok(model.lines().filter_map(line).filter(|(name, _)| name.starts_with('C')).collect())
}

/// The rows of a CSV file without its header. Lines that begin with # are comments and are omitted.
fn table(path: &PathBuf) -> Result<Vec<Row>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    Ok(lines.map(|line| line.split(',').map(str::to_owned).collect()).collect())
}

//! Hides random effects in JSBSim and tests which formulas `propose` finds for them in the flights.
//!
//! `cargo run --release --ignore-rust-version --no-default-features --features sitl --example propose_hidden --
//! inside 9000 10 >> results/propose-hidden.jsonl`
//!
//! The arguments are a grammar, the first seed and the number of seeds. `inside` draws shapes of the library, `outside` draws
//! shapes that the library lacks, and `nulls` hides nothing. If a folder is named as a fourth argument, the signals of each
//! case are written there for `tests/formulas_by_others.py`. Each seed gives one line of JSON. The seeds must differ from
//! those of earlier runs.

mod draw;
mod judge;

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use draw::Drawn;
use greylag::control::{ControllerKind, build};
use greylag::logs::Flight;
use greylag::model::GreyBox;
use greylag::sim::missing::Missing;
use greylag::sim::starting_model::starting_model;
use greylag::sim::trial::Trial;
use greylag::sysid::diagnose::{Options, Proposal, propose, signals};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::progress::ignore_progress;

/// A model, and flights of an aircraft with an effect that the model lacks.
struct Case {
    seed: u64,
    model: GreyBox,
    search: Vec<Reconstruction>,
    test: Vec<Reconstruction>,
}

fn flights(model: &GreyBox, all: &[Flight]) -> Result<Vec<Reconstruction>, Box<dyn Error>> {
    let one = |f: &Flight| {
        let options = flight_path::Options {
            gravity: model.atmosphere.gravity,
            actuators_clock: ActuatorClock::AsRecorded,
            ..flight_path::Options::new(&f.name, model.airframe.actuators)
        };
        Ok(reconstruct(f, &options)?)
    };
    all.iter().map(one).collect()
}

fn flown(seed: u64, missing: Vec<Missing>) -> Result<Case, Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let reference = std::fs::read_to_string(folder.join("jsbsim.toml"))?;
    let exact = GreyBox::load(&folder.join("jsbsim.toml"))?;
    let text = starting_model(&reference, &format!("hidden-{seed}"), seed, &missing)?;
    let model = GreyBox::parse(&text, &folder.join("hidden.toml"))?;
    let logs = Trial { seed, missing, turbulence: None, ..Trial::default() }
        .fly(build(ControllerKind::Lqi, &exact)?.as_ref())?;
    let (search, test) = (flights(&model, &logs.training)?, flights(&model, &logs.testing)?);
    Ok(Case { seed, model, search, test })
}

impl Case {
    /// The proposal with or without free forms, and its computing time, s.
    fn proposal(&self, free_forms: bool) -> Result<(Proposal, f64), Box<dyn Error>> {
        let options = Options { seed: self.seed, free_forms, ..Options::default() };
        let start = Instant::now();
        let found = propose(&self.model, &self.search, &self.test, &options, &ignore_progress)?;
        Ok((found, start.elapsed().as_secs_f64()))
    }

    fn export(&self, folder: &Path, hidden: Option<&Drawn>) -> Result<(), Box<dyn Error>> {
        let options = Options { seed: self.seed, ..Options::default() };
        let truth = hidden.map_or(String::new(), |h| {
            format!("{};{};{}", h.channel, h.variables.join(" "), h.shape)
        });
        let text = format!("# truth: {truth}\n{}", signals(&self.model, &self.search, &options)?);
        let kind = if hidden.is_some() { "case" } else { "null" };
        std::fs::create_dir_all(folder)?;
        Ok(std::fs::write(folder.join(format!("{kind}-{}.csv", self.seed)), text)?)
    }
}

/// Flies the case of a seed. Returns the comparison of the proposals with the hidden effect as JSON, with the library alone
/// and with free forms.
fn line(what: &str, seed: u64, export: Option<&Path>) -> Result<serde_json::Value, Box<dyn Error>> {
    let hidden = match what {
        "inside" => Some(draw::inside(seed)?),
        "outside" => Some(draw::outside(seed)?),
        "nulls" => None,
        other => return Err(format!("{other:?}: write inside, outside or nulls").into()),
    };
    let named =
        hidden.as_ref().map(|h| format!("{} {} k={:.4}", h.channel, h.shape, h.effect.values[0]));
    let mut line = serde_json::json!({ "seed": seed, "grammar": what, "hidden": named });
    let missing: Result<Vec<Missing>, _> =
        hidden.iter().map(|h| Missing::written(h.effect, &h.effect.values)).collect();
    let case = match missing.map_err(Into::into).and_then(|m| flown(seed, m)) {
        Ok(case) => case,
        Err(why) => {
            line["failed"] = why.to_string().into();
            return Ok(line);
        }
    };
    if let Some(folder) = export {
        case.export(folder, hidden.as_ref())?;
    }
    let (free, seconds) = case.proposal(true)?;
    line["free"] = judge::judged(&free, hidden.as_ref());
    line["seconds"] = ((10.0 * seconds).round() / 10.0).into();
    // if free forms were not searched, both proposals are the same
    if free.free.is_some() {
        let (library, seconds) = case.proposal(false)?;
        line["library"] = judge::judged(&library, hidden.as_ref());
        line["seconds_library"] = ((10.0 * seconds).round() / 10.0).into();
    }
    Ok(line)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let (what, first, count, export) = match &arguments[..] {
        [_, what, first, count] => (what, first, count, None),
        [_, what, first, count, folder] => (what, first, count, Some(Path::new(folder))),
        _ => {
            return Err(
                "write: propose_hidden inside|outside|nulls FIRST_SEED COUNT [FOLDER]".into()
            );
        }
    };
    let (first, count): (u64, u64) = (first.parse()?, count.parse()?);
    for seed in first..first + count {
        println!("{}", line(what, seed, export)?);
    }
    Ok(())
}

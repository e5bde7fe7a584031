//! Uses the library to read a log, reconstruct the flight, diagnose the model, fit it and compare the results. An own effect
//! can be added to the candidates:
//! `cargo run --release --ignore-rust-version --no-default-features --example fit_a_log -- MODEL.toml FIT.csv JUDGE.csv [EFFECT.toml]`.

use std::path::Path;

use anyhow::{Context, bail};
use greylag::logs;
use greylag::model::GreyBox;
use greylag::physics::formula::register;
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, reconstruct};
use greylag::sysid::progress::ignore_progress;
use greylag::sysid::{amend, compare, diagnose};

/// Reads a log of any format and reconstructs its flight with the constant sensor errors.
fn flight(path: &str, model: &GreyBox) -> anyhow::Result<Reconstruction> {
    let log = logs::load(Path::new(path), &Default::default())?;
    println!("{path}: {} samples", log.flight.samples.len());
    let options = flight_path::Options {
        gravity: model.atmosphere.gravity,
        ..flight_path::Options::new(&log.flight.name, model.airframe.actuators)
    };
    Ok(reconstruct(&log.flight, &options)?)
}

/// RMS error of open-loop simulations of 5 s, where the error of each state is divided by its scale x_c.
fn error(model: &GreyBox, flight: &Reconstruction) -> anyhow::Result<f64> {
    let options = compare::Options { horizons_s: vec![5.0], seed: 1 };
    let models = std::slice::from_ref(model);
    let found = compare::compare(models, std::slice::from_ref(flight), &options, &ignore_progress)?;
    let score = found.models[0].free_run.first().context("the flight is shorter than 5 s")?;
    Ok(score.rmse_scaled)
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, fit, judge, own @ ..] = arguments.as_slice() else {
        bail!("say which: fit_a_log MODEL.toml FIT.csv JUDGE.csv [EFFECT.toml]");
    };
    let model = GreyBox::load(Path::new(model))?;
    let [fit, judge] = [fit, judge].map(|path| flight(path, &model));
    let (fit, judge) = (fit?, judge?);

    let mut with = Vec::new();
    for file in own {
        with.extend(register::load(Path::new(file))?.iter().map(|e| e.about.id.to_owned()));
    }
    let options = diagnose::Options { with, ..Default::default() };
    let found = diagnose::diagnose(&model, std::slice::from_ref(&fit), &options, &ignore_progress)?;
    found.sentences.iter().for_each(|sentence| println!("{sentence}"));

    let asserted = found.effects.iter().filter(|e| e.asserted);
    let effects = asserted.map(amend::Added::of).collect();
    let options = amend::Options { effects, ..Default::default() };
    let fitted = amend::amend(
        &model,
        std::slice::from_ref(&fit),
        std::slice::from_ref(&judge),
        &options,
        &ignore_progress,
    )?;
    let [before, after] = [&model, &fitted.model].map(|m| error(m, &judge));
    println!("error of 5 s on the flight held out: {:.4} to {:.4}", before?, after?);
    Ok(())
}

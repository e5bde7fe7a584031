//! Times a training step of the dynamics model on one core.

use std::path::Path;
use std::time::Instant;

use greylag::learn::windows::{Track, windows};
use greylag::learn::{Arithmetic, Engine, Objective, Passes, Penalty, PriorSlopes, Subject};
use greylag::model::residual::Scales;
use greylag::model::{GreyBox, Integrator, Twin};
use greylag::num::{Dense, stream};
use greylag::physics::{Command, State};

const STEPS: usize = 20;
const BATCH: usize = 64;

fn track(model: &GreyBox) -> Track {
    let mut twin = Twin::new(State::NEUTRAL, 600.0);
    let rows: Vec<_> = (0..1000)
        .map(|k| {
            let wave = |w: f64| 0.1 * (w * k as f64).sin();
            let row = (twin.state, twin.actuators.controls(), twin.altitude);
            let command = Command { aileron: wave(0.13), elevator: wave(0.07), throttle: 0.3 };
            twin.step(model, &command);
            row
        })
        .collect();
    Track::new(model, rows.into_iter())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let mut prior = GreyBox::load(&folder.join("prior.toml"))?;
    let tracks = vec![track(&prior)];
    let all = windows(&tracks, STEPS);
    let chosen: Vec<_> = all.iter().step_by(all.len() / BATCH).take(BATCH).copied().collect();
    for integrator in [Integrator::Rk4, Integrator::Jsbsim] {
        prior.integrator = integrator;
        for prior_slopes in [PriorSlopes::None, PriorSlopes::All] {
            let subject = Subject {
                scales: Scales::new(&prior.airframe, prior.scale()),
                prior: prior.clone(),
                network: Passes::new(Dense::silent(&[9, 64, 64, 8], &mut stream::stream(1, &[]))?),
                prior_slopes,
            };
            let objective =
                Objective { scale: prior.scale(), penalty: Penalty::Ratio, unit: 1.0, lambda: 1.0 };
            let arithmetic = Arithmetic::Lanes;
            let mut engine = Engine::new(&subject, BATCH, STEPS, arithmetic);
            let mut best = [f64::MAX; 2];
            for _ in 0..200 {
                let start = Instant::now();
                engine.loss(&subject, &objective, &tracks, &chosen, STEPS);
                best[0] = best[0].min(start.elapsed().as_secs_f64());
                let start = Instant::now();
                engine.step(&subject, &objective, &tracks, &chosen, STEPS);
                best[1] = best[1].min(start.elapsed().as_secs_f64());
            }
            println!(
                "{integrator:?}, prior {prior_slopes:?}: forward {:.2} ms, step {:.2} ms",
                1e3 * best[0],
                1e3 * best[1]
            );
        }
    }
    Ok(())
}

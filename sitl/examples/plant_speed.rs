//! Measures how many steps per second the plant simulates on one core.

use std::time::Instant;

use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start};

const STEPS: u32 = 200_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut plant = Plant::new(&PlantOptions::default())?;
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        plant.reset(&Start::NEUTRAL)?;
        let begun = Instant::now();
        for k in 0..STEPS {
            if k % 1000 == 0 {
                plant.reset(&Start::NEUTRAL)?;
            }
            let t = f64::from(k) * 0.01;
            plant.step(Inputs {
                aileron: 0.2 * t.sin(),
                elevator: 0.05,
                throttle: 0.3,
                rudder: 0.0,
            })?;
        }
        best = best.min(begun.elapsed().as_secs_f64());
    }
    let begun = Instant::now();
    for _ in 0..1000 {
        plant.reset(&Start::NEUTRAL)?;
    }
    println!("plant: {:.1} µs a reset", begun.elapsed().as_secs_f64() * 1e3);
    println!(
        "plant: {:.0} steps/s on one core, {:.2} µs a step (a reset every 1000 steps included)",
        f64::from(STEPS) / best,
        best / f64::from(STEPS) * 1e6
    );
    Ok(())
}

//! Comparison on flights of JSBSim: where each shipped model fails, and that the exact one does not.
#![cfg(feature = "sitl")]

mod compare_support;

use compare_support::{EXACT, Noise, REALISTIC, as_measured, fly_with, model};
use greylag::sysid::compare::{ChannelId, Comparison, ModelResult, Options, compare};
use greylag::sysid::reconstruction::Reconstruction;

fn flights(noise: Noise, excitation: f64, first: u64) -> Vec<Reconstruction> {
    (first..first + 3)
        .map(|seed| {
            as_measured(
                &format!("flight{seed}.csv"),
                &fly_with(seed, 60.0, noise, excitation),
                noise,
            )
        })
        .collect()
}

fn against(models: &[&str], flights: &[Reconstruction]) -> Comparison {
    let models: Vec<_> = models.iter().map(|name| model(name)).collect();
    compare(&models, flights, &Options::default(), &|_| ()).unwrap()
}

fn print(result: &ModelResult) {
    println!("\n{}", result.name);
    result.sentences.iter().for_each(|s| println!("  {s}"));
    for s in &result.free_run {
        println!(
            "  {:>4} s: scaled {:.6}, diverged {}/{}",
            s.horizon_s, s.rmse_scaled, s.diverged, s.runs
        );
    }
    for c in &result.channels {
        println!(
            "  {:?}: unexplained {:.4}, measured {:.3}, residual {:.4}, noise {:.4} {}",
            c.channel, c.unexplained_fraction, c.measured_sd, c.residual_rms, c.noise_sd, c.unit
        );
        for b in &c.bins {
            print!("    {} {:.2};", b.name, b.explained);
        }
        println!();
    }
}

#[test]
fn look() {
    for (noise, excitation) in [(EXACT, 1.0), (REALISTIC, 1.0), (EXACT, 0.0), (REALISTIC, 0.0)] {
        for seed in [1, 11, 21, 31] {
            let flights = flights(noise, excitation, seed);
            let c = against(&["prior-as-printed", "prior"], &flights);
            println!("SEED {seed} {excitation}");
            c.models.iter().for_each(|m| m.sentences.iter().for_each(|s| println!("  {s}")));
        }
    }
}

//! Resampling of a stretch, a part of a log without gaps, to uniform time steps. A measurement without a recorded value
//! nearby is NaN. A command holds until the next one. Deflections have a value at every step.

use super::channels::Channels;
use super::{Present, Track};
use crate::flight_path::Options;
use crate::flight_path::channel::{Channel, wrap};
use greylag_physics::Command;
use greylag_physics::actuators::Actuators;
use greylag_physics::atmosphere::{Atmosphere, Density};

/// Interval over which the altitude is differenced to obtain the climb rate, s. It is also the interval at which an
/// integrated heading is stored.
const CLIMB_WINDOW: f64 = 1.0;

pub(super) fn track(
    channels: &Channels,
    has: &Present,
    [start, end]: [f64; 2],
    [step, gap]: [f64; 2],
    options: &Options,
) -> Track {
    let n = ((end - start) / step + 1e-6).floor() as usize + 1;
    let nan = f64::NAN;
    let times: Vec<f64> = (0..n).map(|k| (start + k as f64 * step).min(end)).collect();
    let reach = gap;
    let near = 0.5 * step;
    let measured = |c: &Channel, t: f64| c.measured(t, reach, near);
    let keep = |use_it: bool, x: f64| if use_it { x } else { nan };
    let mut track = with_room(n);
    track.start = start;
    for &t in &times {
        track.rates.push(std::array::from_fn(|i| channels.rates[i].between(t, 2.0 * reach)));
        let force = std::array::from_fn(|i| channels.force[i].between(t, 2.0 * reach));
        track.force.push(if has.force { force } else { [nan; 3] });
        let angle = |i: usize| wrap(measured(&channels.attitude[i], t));
        track.attitude.push([angle(0), angle(1), keep(has.yaw, angle(2))]);
        track.airspeed.push(measured(&channels.airspeed, t));
        track.vanes.push([
            keep(has.alpha, measured(&channels.vanes[0], t)),
            keep(has.beta, measured(&channels.vanes[1], t)),
        ]);
        let velocity = std::array::from_fn(|i| measured(&channels.velocity[i], t));
        track.velocity.push(if has.velocity { velocity } else { [nan; 3] });
        let altitude = channels.altitude.between(t, f64::INFINITY);
        let held = channels.altitude.held(t);
        track.altitude.push(if altitude.is_nan() { held } else { altitude });
        track.commands.push(command(channels, t));
    }
    if has.altitude && !has.velocity {
        climb(&mut track, step);
    }
    if !has.yaw && !has.velocity {
        heading(&mut track, step);
    }
    let air = Atmosphere { density: Density::Standard, gravity: options.gravity };
    let logged = |t: f64| {
        let density = channels.density.between(t, f64::INFINITY);
        if density.is_nan() { channels.density.held(t) } else { density }
    };
    let standard = |h: f64| air.density_at(if h.is_finite() { h } else { 0.0 });
    track.density = times
        .iter()
        .zip(&track.altitude)
        .map(|(t, h)| Some(logged(*t)).filter(|d| *d > 0.0).unwrap_or_else(|| standard(*h)))
        .collect();
    track.controls = controls(channels, &times, options);
    track
}

/// An empty track with memory for exactly `n` samples. Lists that grow would take up to twice the memory.
fn with_room(n: usize) -> Track {
    Track {
        rates: Vec::with_capacity(n),
        force: Vec::with_capacity(n),
        attitude: Vec::with_capacity(n),
        airspeed: Vec::with_capacity(n),
        vanes: Vec::with_capacity(n),
        velocity: Vec::with_capacity(n),
        altitude: Vec::with_capacity(n),
        commands: Vec::with_capacity(n),
        ..Track::default()
    }
}

/// Computes the vertical velocity (m/s, down) from the altitude once every [`CLIMB_WINDOW`]. The intervals do not overlap, so
/// that the errors of these measurements are independent.
fn climb(track: &mut Track, step: f64) {
    let half = (CLIMB_WINDOW / step / 2.0).round().max(1.0) as usize;
    let mut k = half;
    while k + half < track.len() {
        let rise = track.altitude[k + half] - track.altitude[k - half];
        track.velocity[k][2] = -rise / (2 * half) as f64 / step;
        k += 2 * half;
    }
}

/// Integrates the heading from the gyros, ψ̇ = (q sin φ + r cos φ) / cos θ, and stores it as a measurement once every
/// [`CLIMB_WINDOW`]. It is used if the log has neither yaw nor velocity, because the heading would then be undetermined.
fn heading(track: &mut Track, step: f64) {
    let every = (CLIMB_WINDOW / step).round().max(1.0) as usize;
    let (mut yaw, mut last) = (0.0, [0.0; 2]);
    for k in 0..track.len() {
        let [roll, pitch, _] = track.attitude[k];
        if roll.is_finite() && pitch.is_finite() {
            last = [roll, pitch];
        }
        let ([roll, pitch], [_, q, r]) = (last, track.rates[k]);
        track.attitude[k][2] = if k % every == 0 { wrap(yaw) } else { f64::NAN };
        yaw += step * (q * roll.sin() + r * roll.cos()) / pitch.cos();
    }
}

/// The last command at or before `t` (s): aileron, elevator, throttle, rudder. NaN if one of the first three is missing. A missing
/// rudder is zero.
fn command(channels: &Channels, t: f64) -> [f64; 4] {
    let [aileron, elevator, throttle, rudder] =
        std::array::from_fn(|i| channels.commands[i].held(t));
    let rudder = if rudder.is_finite() { rudder } else { 0.0 };
    let command = [aileron, elevator, throttle, rudder];
    if command.iter().all(|x| x.is_finite()) { command } else { [f64::NAN; 4] }
}

/// Deflections of aileron and elevator (rad), throttle position (0..1) and deflection of the rudder (rad) at `times` (s). They are
/// the logged positions or, if there are none, the commands passed through the actuator model.
fn controls(channels: &Channels, times: &[f64], options: &Options) -> Vec<[f64; 4]> {
    let f = &options.actuators;
    let sent = |t: f64| {
        let [aileron, elevator, throttle, rudder] = std::array::from_fn(|i| {
            let command = channels.commands[i].held(t);
            if command.is_finite() { command.clamp(-1.0, 1.0) } else { 0.0 }
        });
        Command { aileron, elevator, throttle, rudder }
    };
    let mut clock = times.first().copied().unwrap_or(0.0);
    let mut actuators = Actuators::at_rest(&f.controls(&sent(clock)));
    let mut all = Vec::with_capacity(times.len());
    for &t in times {
        while clock + 0.5 * f.step < t {
            actuators.step(&sent(clock + 1e-9), f);
            clock += f.step;
        }
        let simulated = actuators.controls();
        let logged = |i: usize, simulated: f64| {
            let x = channels.positions[i].between(t, f64::INFINITY);
            let x = if x.is_nan() { channels.positions[i].held(t) } else { x };
            if x.is_finite() { x } else { simulated }
        };
        all.push([
            logged(0, simulated.aileron),
            logged(1, simulated.elevator),
            logged(2, simulated.throttle),
            logged(3, if f.rudder.is_some() { simulated.rudder } else { 0.0 }),
        ]);
    }
    all
}

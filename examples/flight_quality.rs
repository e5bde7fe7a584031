//! Measures how controllers fly to a target: error, overshoot, surface travel, load factor, angle of attack.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example flight_quality -- \
//!     lqi hybrid-lqi ilqr hybrid-ilqr every=7 steps=200
//! ```
//!
//! JSBSim simulates the flights and gives load factor, angle of attack and sideslip. Every controller flies to every N-th target
//! of `params/targets.csv` (`every=N`), for 10 s from level flight at the reference airspeed. It then flies N steps between
//! random attitudes (`steps=N`) at the cruise airspeed, 5 s each, ten in a row. `hybrid-ilqr:KEY=VALUE,…` changes settings of
//! this controller. `NAME+free` flies without the envelope limiter.
//!
//! | word | meaning |
//! |---|---|
//! | `model=FILE` `policy=DIR` | model and policy from which the controllers are built |
//! | `aircraft=NAME` | JSBSim's aircraft |
//! | `every=N` `steps=N` | targets and steps that are flown; 0 for none |
//! | `turbulence=N` | MIL-spec severity: 3 light, 4 moderate |
//! | `delay=N` | commands arrive N ticks of 10 ms late |
//! | `trace=FILE` | appends every tick: controller, time, target, roll, pitch, p, q, r (°, °/s), airspeed, α, load factor, commands |
//! | `seed=N` | seed of the steps and of the turbulence |
//! | `draws=N` | builds the controllers from N models with randomly drawn coefficients, each with its own flights |
//!
//! The computing time is the processor time of the thread, which other programs hardly affect.

use std::collections::VecDeque;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use greylag::control::envelope::{Bounds, Guarded};
use greylag::control::ilqr::{Ilqr, Settings, Start, Towards};
use greylag::control::lqi::Lqi;
use greylag::control::policy::Agent;
use greylag::control::quality::{Limits, Moment, Quality, Track, attitude_error_deg};
use greylag::control::{Controller, ControllerKind, Observation, Source, Target, build};
use greylag::model::GreyBox;
use greylag::num::statistics;
use greylag::num::stream::stream;
use greylag::physics::{ActuatorState, Airframe, Command, State, Time};
use greylag::sim::episode::settled_error_deg;
use greylag_sitl::air::Turbulence;
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start as Begin, Truth};
use rand::RngExt;
use rustix::time::{ClockId, clock_gettime};

const STEP: f64 = 0.01;
/// Standard gravity, m/s².
const G0: f64 = 9.80665;
/// Settled error beyond which the aircraft counts as lost, degrees.
const LOST_DEG: f64 = 10.0;
/// Number of ticks of a flight to a target from level flight. `SHORT` is the number of ticks of a step.
const FLIGHT: usize = 1000;
const SHORT: usize = 500;
/// Number of steps flown in a row, after which the aircraft is reset.
const ROW: usize = 10;

#[derive(Clone)]
struct Options {
    model: PathBuf,
    policy: PathBuf,
    aircraft: String,
    every: usize,
    steps: usize,
    turbulence: u8,
    delay: usize,
    seed: u32,
    draws: u32,
    trace: Option<PathBuf>,
    names: Vec<String>,
}

fn options() -> Result<Options> {
    let mut o = Options {
        model: "params/x8/learned/model.toml".into(),
        policy: "params/x8/learned/policy".into(),
        aircraft: "x8".into(),
        every: 7,
        steps: 0,
        turbulence: 0,
        delay: 0,
        seed: 1,
        draws: 0,
        trace: None,
        names: Vec::new(),
    };
    for word in std::env::args().skip(1) {
        match word.split_once('=') {
            Some(("model", x)) => o.model = x.into(),
            Some(("policy", x)) => o.policy = x.into(),
            Some(("aircraft", x)) => o.aircraft = x.into(),
            Some(("every", x)) => o.every = x.parse()?,
            Some(("steps", x)) => o.steps = x.parse()?,
            Some(("turbulence", x)) => o.turbulence = x.parse()?,
            Some(("delay", x)) => o.delay = x.parse()?,
            Some(("trace", x)) => o.trace = Some(x.into()),
            Some(("seed", x)) => o.seed = x.parse()?,
            Some(("draws", x)) => o.draws = x.parse()?,
            Some((key, _)) if !key.contains(':') => bail!("there is no {key}"),
            _ => o.names.push(word),
        }
    }
    Ok(o)
}

/// One flight to one target.
struct Measured {
    /// Mean of the rms errors of roll and pitch over the last fifth, degrees.
    settled: f64,
    quality: Quality,
}

/// An aircraft in JSBSim, with the delayed commands that have not reached it yet.
struct World {
    plant: Plant,
    start: Begin,
    late: VecDeque<Command>,
    delay: usize,
    previous: [Command; 2],
    truth: Truth,
    limits: Limits,
}

impl World {
    fn new(o: &Options, airframe: &Airframe, airspeed: f64) -> Result<World> {
        let mut options =
            PlantOptions { seed: o.seed, aircraft: o.aircraft.clone(), ..Default::default() };
        let start = Begin { airspeed_mps: airspeed, altitude_m: 600.0, ..Begin::NEUTRAL };
        options.start = start;
        for (name, value) in &airframe.conditions {
            options.held.push((name.clone(), *value));
        }
        if o.turbulence > 0 {
            options.air.turbulence =
                Some(Turbulence { wind_20ft_mps: 15.0, severity: o.turbulence });
        }
        let mut plant = Plant::new(&options)?;
        let truth = plant.reset(&start)?;
        Ok(World {
            plant,
            start,
            late: VecDeque::new(),
            delay: o.delay,
            previous: [Command::IDLE; 2],
            truth,
            // if the file states no smallest load factor, that of the limiter is used
            limits: Limits { load_factor: Bounds::of(airframe).load, ..Limits::of(airframe) },
        })
    }

    fn reset(&mut self, seed: u32) -> Result<()> {
        self.plant.reseed(seed);
        self.truth = self.plant.reset(&self.start)?;
        self.previous = [Command::IDLE; 2];
        self.late = std::iter::repeat_n(Command::IDLE, self.delay).collect();
        Ok(())
    }

    fn see(&self) -> Observation {
        let t = &self.truth;
        Observation {
            time: Time::from_micros((t.time_s * 1e6).round() as u64),
            incidence_sd: [0.0; 2],
            state: State {
                roll: t.roll_rad,
                pitch: t.pitch_rad,
                airspeed: t.airspeed_mps,
                p: t.p_radps,
                q: t.q_radps,
                r: t.r_radps,
                alpha: t.alpha_rad,
                beta: t.beta_rad,
            },
            actuators: ActuatorState {
                aileron: t.aileron_rad,
                aileron_rate: t.aileron_rate_radps,
                elevator: t.elevator_rad,
                elevator_rate: t.elevator_rate_radps,
                throttle: t.throttle,
                rudder: t.rudder_rad,
                rudder_rate: t.rudder_rate_radps,
            },
            altitude: t.altitude_m,
            previous: self.previous,
        }
    }

    fn step(&mut self, command: Command) -> Result<()> {
        let command = command.clamped();
        self.previous = [command, self.previous[0]];
        self.late.push_back(command);
        let Some(Command { aileron, elevator, throttle, rudder }) = self.late.pop_front() else {
            bail!("no command");
        };
        self.truth = self.plant.step(Inputs { aileron, elevator, throttle, rudder })?;
        Ok(())
    }
}

/// All flights of one controller in one group of targets.
struct Flown {
    group: &'static str,
    flights: Vec<Measured>,
}

/// Appends a tick to the file of `trace=`.
fn note(o: &Options, name: &str, tick: usize, target: &Target, world: &World) -> Result<()> {
    let Some(path) = &o.trace else { return Ok(()) };
    let mut file = std::fs::OpenOptions::new().create(true).append(true).open(path)?;
    let t = &world.truth;
    let c = world.previous[0];
    writeln!(
        file,
        "{name},{:.2},{:.2},{:.2},{:.2},{:.2},{:.1},{:.1},{:.1},{:.2},{:.2},{:.2},{:.3},{:.3},{:.3}",
        tick as f64 * STEP,
        target.roll.to_degrees(),
        target.pitch.to_degrees(),
        t.roll_rad.to_degrees(),
        t.pitch_rad.to_degrees(),
        t.p_radps.to_degrees(),
        t.q_radps.to_degrees(),
        t.r_radps.to_degrees(),
        t.airspeed_mps,
        t.alpha_rad.to_degrees(),
        load_factor(t),
        c.aileron,
        c.elevator,
        c.throttle,
    )?;
    Ok(())
}

/// Processor time of this thread.
fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
}

fn load_factor(t: &Truth) -> f64 {
    -t.specific_force_mps2[2] / G0
}

/// Flies to a target for `ticks` ticks and measures the quality. The aircraft counts as lost if JSBSim fails, or if the
/// settled error exceeds `LOST_DEG`.
fn leg(
    o: &Options,
    world: &mut World,
    controller: &mut dyn Controller,
    target: &Target,
    ticks: usize,
    times: &mut Vec<f64>,
) -> Measured {
    let mut track = Track {
        moments: Vec::with_capacity(ticks + 1),
        target: *target,
        before: Some(world.previous[0]),
        lost_s: 0.0,
    };
    for tick in 0..ticks {
        let seen = world.see();
        let begun = processor_time();
        let command = controller.command(&seen, target);
        times.push((processor_time() - begun).as_secs_f64() * 1e3);
        track.moments.push(Moment::new(&seen, load_factor(&world.truth), &command));
        if world.step(command).is_err() || !world.truth.roll_rad.is_finite() {
            track.lost_s = (ticks - tick) as f64 * STEP;
            break;
        }
        if let Err(why) = note(o, controller.name(), tick, target, world) {
            eprintln!("trace: {why}");
        }
    }
    if track.lost_s == 0.0 {
        let (seen, last) = (world.see(), world.previous[0]);
        track.moments.push(Moment::new(&seen, load_factor(&world.truth), &last));
    }
    let end = track.moments.len().saturating_sub(ticks / 5);
    let errors: Vec<[f64; 2]> =
        track.moments[end..].iter().map(|m| attitude_error_deg(m.attitude, target)).collect();
    let settled = settled_error_deg(&errors);
    let mut quality = track.quality(&world.limits);
    quality.lost |= settled > LOST_DEG;
    Measured { settled, quality }
}

fn fly(
    o: &Options,
    airframe: &Airframe,
    controller: &mut dyn Controller,
) -> Result<(Vec<Flown>, Vec<f64>)> {
    let mut times = Vec::new();
    let mut all: Vec<Flown> = Vec::new();
    if o.every > 0 {
        let start = airframe.reference.airspeed;
        let mut world = World::new(o, airframe, start)?;
        let mut reader = csv::Reader::from_path("params/targets.csv")?;
        for (number, row) in reader.records().enumerate() {
            let row = row?;
            let group = match &row[0] {
                "easy" => "easy",
                "hard_corners" => "corners",
                _ => "outside",
            };
            if number % o.every != 0 {
                continue;
            }
            let e = &airframe.envelope;
            let [roll, pitch]: [f64; 2] = [row[1].parse()?, row[2].parse()?];
            if roll.abs() > e.bank_max_deg || !(e.pitch_min_deg..=e.pitch_max_deg).contains(&pitch)
            {
                continue;
            }
            let target =
                Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: start };
            world.reset(o.seed + number as u32)?;
            controller.reset(number as u64);
            let m = leg(o, &mut world, controller, &target, FLIGHT, &mut times);
            match all.iter_mut().find(|f| f.group == group) {
                Some(f) => f.flights.push(m),
                None => all.push(Flown { group, flights: vec![m] }),
            }
        }
    }
    if o.steps > 0 {
        let e = airframe.envelope;
        let cruise = e.airspeed_cruise_mps;
        let mut world = World::new(o, airframe, cruise)?;
        let mut flown = Flown { group: "steps", flights: Vec::new() };
        let mut rng = stream(o.seed.into(), &[1951]);
        for number in 0..o.steps {
            if number % ROW == 0 {
                world.reset(o.seed + number as u32)?;
                controller.reset(number as u64);
            }
            let roll = rng.random_range(-e.bank_max_deg..e.bank_max_deg);
            let pitch = rng.random_range(e.pitch_min_deg..e.pitch_max_deg);
            let target =
                Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: cruise };
            flown.flights.push(leg(o, &mut world, controller, &target, SHORT, &mut times));
        }
        all.push(flown);
    }
    Ok((all, times))
}

fn quantile(mut xs: Vec<f64>, q: f64) -> f64 {
    if xs.is_empty() {
        return f64::NAN;
    }
    xs.sort_by(f64::total_cmp);
    xs[((xs.len() - 1) as f64 * q).round() as usize]
}

fn print(name: &str, all: &[Flown], times: &[f64]) {
    let ms = [0.5, 0.999].map(|q| quantile(times.to_vec(), q));
    for Flown { group, flights } in all {
        let settled = |q: f64| quantile(flights.iter().map(|m| m.settled).collect(), q);
        let of = |f: &dyn Fn(&Quality) -> f64, q: f64| {
            quantile(flights.iter().map(|m| f(&m.quality)).collect(), q)
        };
        let count = |f: &dyn Fn(&Quality) -> bool| flights.iter().filter(|m| f(&m.quality)).count();
        let integral = |q: &Quality| q.error_integral_deg_s;
        // ranks of the 95 % interval of the median (binomial distribution, normal approximation)
        let half = 0.98 / (flights.len() as f64).sqrt();
        let interval = [0.5 - half, 0.5 + half].map(|q| of(&integral, q.clamp(0.0, 1.0)));
        println!(
            "{name:<34} {group:<8} {:>4} {:>7.3} {:>7.3} {:>5.2} {:>6.2} {:>6.2} {:>6.2} {:>6.2} {:>5.2} {:>5.2} {:>4.0}% {:>6.2} {:>6.2} {:>5.2} {:>5.2} {:>6.2} {:>6.2} {:>6} {:>6.1} {:>6.1} {:>5.1} {:>5.1} {:>5} {:>6.3} {:>6.3}",
            flights.len(),
            settled(0.5),
            settled(1.0),
            of(&|q| q.to_one_deg_s, 0.5),
            of(&integral, 0.5),
            interval[0],
            interval[1],
            mean(flights.iter()),
            of(&|q| q.overshoot_deg[0], 0.95),
            of(&|q| q.overshoot_deg[1], 0.95),
            100.0 * count(&Quality::overshoots_little) as f64 / flights.len() as f64,
            of(&|q| q.travel.aileron, 0.5),
            of(&|q| q.travel.elevator, 0.5),
            of(&|q| q.travel.rudder, 0.5),
            of(&|q| q.travel.throttle, 0.5),
            of(&|q| q.load_factor[0], 0.0),
            of(&|q| q.load_factor[1], 1.0),
            count(&|q| !q.kept),
            of(&|q| q.alpha_deg[0], 0.0),
            of(&|q| q.alpha_deg[1], 1.0),
            of(&|q| q.sideslip_deg, 1.0),
            of(&|q| q.airspeed_mps[0], 0.0),
            count(&|q| q.lost),
            ms[0],
            ms[1],
        );
    }
}

fn main() -> Result<()> {
    let o = options()?;
    let model = GreyBox::load(&o.model)?;
    let agent = Agent::load(&o.policy, &model.airframe).ok();
    println!(
        "{:<34} {:<8} {:>4} {:>7} {:>7} {:>5} {:>6} {:>6} {:>6} {:>6} {:>5} {:>5} {:>5} {:>6} {:>6} {:>5} {:>5} {:>6} {:>6} {:>6} {:>6} {:>6} {:>5} {:>5} {:>5} {:>6} {:>6}",
        "controller",
        "group",
        "n",
        "settled",
        "worst",
        "to1",
        "IAE",
        "from",
        "to",
        "mean",
        "ovR95",
        "ovP95",
        "fit",
        "ail",
        "elev",
        "rud",
        "thr",
        "nmin",
        "nmax",
        "beyond",
        "amin",
        "amax",
        "bmax",
        "Vmin",
        "lost",
        "ms50",
        "ms99.9"
    );
    let models = models(&o, model);
    let mut first: Vec<f64> = Vec::new();
    for name in &o.names {
        let (mut all, mut times, mut means) = (Vec::new(), Vec::new(), Vec::new());
        for (k, model) in models.iter().enumerate() {
            let mut controller = entrant(name, model, agent.as_ref())?;
            // the steps differ between the drawn models
            let own = Options { seed: o.seed + 1000 * k as u32, ..o.clone() };
            let (flown, of) = fly(&own, &model.airframe, controller.as_mut())?;
            means.push(mean(flown.iter().flat_map(|f| &f.flights)));
            times.extend(of);
            merge(&mut all, flown);
        }
        print(name, &all, &times);
        if first.is_empty() {
            first = means;
        } else if o.draws > 0 {
            let ratios: Vec<f64> =
                means.iter().zip(&first).map(|(own, first)| own / first).collect();
            println!(
                "# {name}: mean integral above {}'s in {} of {} models; ratio median {:.3}, largest {:.3}",
                o.names[0],
                ratios.iter().filter(|r| **r > 1.0).count(),
                ratios.len(),
                quantile(ratios.clone(), 0.5),
                quantile(ratios.clone(), 1.0),
            );
            for (model, ratio) in models.iter().zip(&ratios).filter(|(_, ratio)| **ratio > 1.1) {
                println!("#   {}: {ratio:.2}", model.name);
            }
        }
    }
    Ok(())
}

/// The model itself, or the drawn models from which an LQI can be designed.
fn models(o: &Options, model: GreyBox) -> Vec<GreyBox> {
    if o.draws == 0 {
        return vec![model];
    }
    let drawn = (0..o.draws).map(|k| model.drawn(o.seed.into(), k.into()));
    drawn
        .filter(|drawn| match Lqi::new(drawn) {
            Ok(_) => true,
            Err(why) => {
                println!("# left out: {}: {why}", drawn.name);
                false
            }
        })
        .collect()
}

/// Adds flights to those of their group.
fn merge(all: &mut Vec<Flown>, more: Vec<Flown>) {
    for Flown { group, flights } in more {
        match all.iter_mut().find(|f| f.group == group) {
            Some(f) => f.flights.extend(flights),
            None => all.push(Flown { group, flights }),
        }
    }
}

/// Mean integral of the error, ° s.
fn mean<'a>(flights: impl Iterator<Item = &'a Measured>) -> f64 {
    statistics::mean(&flights.map(|m| m.quality.error_integral_deg_s).collect::<Vec<_>>())
}

/// The controller that `word` names: `NAME`, or `hybrid-ilqr:KEY=VALUE,…` with other settings. The suffix `+free` omits the
/// envelope limiter.
fn entrant(word: &str, model: &GreyBox, agent: Option<&Agent>) -> Result<Box<dyn Controller>> {
    let (word, free) = word.strip_suffix("+free").map_or((word, false), |word| (word, true));
    let bare = match word.split_once(':') {
        Some((_, changes)) => {
            let settings = settings(changes)?;
            let lqi = Lqi::new(model)?;
            Box::new(Ilqr::with("hybrid-ilqr", model, lqi, agent, settings)) as Box<dyn Controller>
        }
        None => {
            let kind: ControllerKind =
                word.parse().with_context(|| format!("controller {word}"))?;
            build(kind, Source { model, agent, changes: &[] })?
        }
    };
    Ok(if free { bare } else { Box::new(Guarded::new(bare, model)) })
}

/// The settings of `hybrid-ilqr` with `changes`, which are KEY=VALUE separated by commas.
fn settings(changes: &str) -> Result<Settings> {
    let mut s = Settings::HYBRID;
    for change in changes.split(',') {
        let (key, value) = change.split_once('=').context("a change is KEY=VALUE")?;
        let number = || value.parse::<f64>().with_context(|| format!("{value} is no number"));
        match (key, s.envelope.as_mut()) {
            ("far", _) => s.far = if value == "none" { None } else { Some(number()?) },
            ("missed", _) => s.missed = if value == "none" { None } else { Some(number()?) },
            ("attitude", _) => s.attitude = number()?,
            ("rate", _) => s.rate = number()?,
            ("sideslip", _) => s.sideslip = number()?,
            ("moves", _) => s.moves = number()?,
            ("last", _) => s.last = number()?,
            ("iterations", _) => s.iterations = value.parse()?,
            ("start", _) => s.start = if value == "policy" { Start::Policy } else { Start::Own },
            ("envelope", _) => s.envelope = None,
            ("direct", _) => s.towards = Towards::Target,
            ("part", Some(e)) => e.part = number()?,
            ("load", Some(e)) => e.load = number()?,
            ("alpha", Some(e)) => e.alpha = number()?,
            ("slip", Some(e)) => e.sideslip = number()?,
            _ => bail!("there is no setting {key}"),
        }
    }
    Ok(s)
}

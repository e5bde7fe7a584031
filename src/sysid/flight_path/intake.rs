//! Intake: a log's rows on one uniform clock a segment.

use crate::logs::rudder::RudderMotion;
use crate::logs::{Flight, FlowAngles, Sample};
use crate::num::statistics::quantile;
use crate::physics::actuators::Actuators;
use crate::physics::atmosphere::{Atmosphere, Density};
use crate::physics::{Command, Controls, Sensors};
use crate::sysid::flight_path::channel::{Channel, Kind, wrap};
use crate::sysid::flight_path::lever_arm;
use crate::sysid::flight_path::{Options, ReconstructError};

/// Fewest samples of a sensor in a segment that are worth using.
const FEWEST: usize = 10;
/// Median row periods that a pause must exceed to be a gap,
const GAP_PERIODS: f64 = 2.5;
/// up to this period, s: at less than 5 Hz nothing is known between the rows.
const SLOWEST_PERIOD: f64 = 0.2;
/// Time over which a climb is taken from the altitude, s.
const CLIMB_WINDOW: f64 = 1.0;
/// Time around a row over which its airspeed is averaged to tell flight from ground, s.
const AIRBORNE_WINDOW: f64 = 1.0;

/// A log on uniform clocks.
#[derive(Clone, Debug)]
pub struct Log {
    /// Time between samples, s.
    pub step: f64,
    /// The stretches without gaps.
    pub tracks: Vec<Track>,
    /// Which sensors the log has.
    pub has: Present,
    /// How often they measure.
    pub periods: Periods,
    /// How the rudder moves, if it does.
    pub rudder: Option<RudderMotion>,
    /// What is known of its sensors and of the wind.
    pub sensors: Sensors,
    /// What the reader must know.
    pub notes: Vec<String>,
}

/// Which of the optional sensors a log has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Present {
    /// Heading.
    pub yaw: bool,
    /// Accelerometers.
    pub force: bool,
    /// Vane for the angle of attack.
    pub alpha: bool,
    /// Vane for sideslip.
    pub beta: bool,
    /// Velocity over ground.
    pub velocity: bool,
    /// Altitude.
    pub altitude: bool,
}

/// Mean time between the measurements of a sensor, s; zero where it is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Periods {
    /// Attitude.
    pub attitude: f64,
    /// Airspeed.
    pub airspeed: f64,
    /// Vanes.
    pub vanes: f64,
    /// Velocity over ground.
    pub velocity: f64,
}

/// The extent in time of a flight with all its stretches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// Its middle on the log's clock, s.
    pub middle: f64,
    /// Its length, s.
    pub length: f64,
}

/// A stretch without gaps, as measured; a missing measurement is NaN. Units as in [`Sample`].
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Time of the first sample, s.
    pub start: f64,
    /// The extent in time of the flight that it is a stretch of.
    pub span: Span,
    /// p, q, r: never missing.
    pub rates: Vec<[f64; 3]>,
    /// Specific force: never missing if the log has it.
    pub force: Vec<[f64; 3]>,
    /// Roll, pitch, yaw, within ±π.
    pub attitude: Vec<[f64; 3]>,
    /// True airspeed.
    pub airspeed: Vec<f64>,
    /// α, β.
    pub vanes: Vec<[f64; 2]>,
    /// Velocity over ground.
    pub velocity: Vec<[f64; 3]>,
    /// Altitude, interpolated; never missing if the segment has it at all.
    pub altitude: Vec<f64>,
    /// Air density: never missing.
    pub density: Vec<f64>,
    /// Commands.
    pub commands: Vec<Option<Command>>,
    /// Deflections: never missing.
    pub controls: Vec<Controls>,
}

impl Track {
    /// The number of samples.
    pub fn len(&self) -> usize {
        self.rates.len()
    }

    /// Time of sample `k`, s; samples `step` (s) apart.
    pub fn time(&self, k: usize, step: f64) -> f64 {
        self.start + k as f64 * step
    }
}

/// The channels of a log.
struct Channels {
    rates: [Channel; 3],
    force: [Channel; 3],
    attitude: [Channel; 3],
    airspeed: Channel,
    vanes: [Channel; 2],
    velocity: [Channel; 3],
    altitude: Channel,
    density: Channel,
    positions: [Channel; 4],
    commands: [Channel; 4],
}

impl Channels {
    fn of(flight: &Flight) -> Channels {
        let channel = |kind, get: &dyn Fn(&Sample) -> f64| {
            Channel::new(flight.samples.iter().map(|s| (s.time_s, get(s))), kind)
        };
        let three = |kind, get: &dyn Fn(&Sample, usize) -> f64| {
            std::array::from_fn(|i| channel(kind, &|s| get(s, i)))
        };
        let four = |get: &dyn Fn(&Sample) -> [f64; 4]| {
            std::array::from_fn(|i| channel(Kind::Kept, &|s| get(s)[i]))
        };
        let vane = |get: &dyn Fn(&Sample) -> f64| match flight.flow_angles {
            FlowAngles::Measured => channel(Kind::Linear, get),
            FlowAngles::Estimated => channel(Kind::Linear, &|_| f64::NAN),
        };
        Channels {
            rates: three(Kind::Linear, &|s, i| s.rates_radps[i]),
            force: three(Kind::Linear, &|s, i| s.specific_force_mps2[i]),
            attitude: three(Kind::Angle, &|s, i| s.attitude_rad[i]),
            airspeed: channel(Kind::Linear, &|s| s.airspeed_mps),
            vanes: [vane(&|s| s.alpha_rad), vane(&|s| s.beta_rad)],
            velocity: three(Kind::Linear, &|s, i| s.velocity_ned_mps[i]),
            altitude: channel(Kind::Kept, &|s| s.altitude_m),
            density: channel(Kind::Kept, &|s| s.air_density_kgpm3),
            positions: four(&|s| [s.aileron_rad, s.elevator_rad, s.throttle, s.rudder_rad]),
            commands: four(&|s| [s.aileron_cmd, s.elevator_cmd, s.throttle_cmd, s.rudder_cmd]),
        }
    }

    fn sensors(&self) -> Present {
        let all = |channels: &[Channel]| channels.iter().all(|c| !c.is_empty() && !c.stuck);
        Present {
            yaw: all(&self.attitude[2..]),
            force: all(&self.force),
            alpha: all(&self.vanes[..1]),
            beta: all(&self.vanes[1..]),
            velocity: all(&self.velocity[..2]),
            altitude: all(std::slice::from_ref(&self.altitude)),
        }
    }

    fn periods(&self) -> Periods {
        Periods {
            attitude: self.attitude[0].period(),
            airspeed: self.airspeed.period(),
            vanes: self.vanes[0].period().max(self.vanes[1].period()),
            velocity: self.velocity[0].period(),
        }
    }

    /// Says which needed channel is missing, or shows one and the same value all the time.
    fn check(&self, flight: &str) -> Result<(), ReconstructError> {
        let missing =
            |channel, column| ReconstructError::Missing { flight: flight.into(), channel, column };
        let sensors: [(&[Channel], _, _); 3] = [
            (&self.attitude[..2], "attitude that changes", "roll_rad, pitch_rad"),
            (&self.rates, "body rates that change", "p_radps, q_radps, r_radps"),
            (std::slice::from_ref(&self.airspeed), "airspeed that changes", "airspeed_mps"),
        ];
        for (channels, what, column) in sensors {
            if channels.iter().any(|c| c.is_empty() || c.stuck) {
                return Err(missing(what, column));
            }
        }
        let actuators = [
            ("aileron command or position", "aileron_cmd or aileron_rad"),
            ("elevator command or position", "elevator_cmd or elevator_rad"),
            ("throttle command or position", "throttle_cmd or throttle"),
        ];
        for (i, (what, column)) in actuators.into_iter().enumerate() {
            if self.commands[i].is_empty() && self.positions[i].is_empty() {
                return Err(missing(what, column));
            }
        }
        Ok(())
    }
}

/// Takes a log in: one clock, gaps split, commands held.
///
/// # Errors
/// A needed channel is missing, the log holds no flight, or no stretch is long enough.
pub fn take_in(flight: &Flight, options: &Options) -> Result<Log, ReconstructError> {
    let channels = Channels::of(flight);
    channels.check(&options.name)?;
    let has = channels.sensors();
    let mut notes = Vec::new();
    declare(&channels, &has, options, &mut notes);
    if flight.flow_angles == FlowAngles::Estimated {
        notes.push(
            "α and β of this log are the flight controller's estimates, not measurements: left out. If the \
             aircraft has vanes, map alpha_rad and beta_rad to them."
                .into(),
        );
    }
    let stretches = stretches(flight, &has, options)?;
    if !has.yaw && !has.velocity {
        notes.push(
            "The log has no heading and no velocity over ground: the heading is integrated from the \
             gyros, and the wind stays at its prior. Log one of them."
                .into(),
        );
    }
    let (step, gap) = (step(&stretches, options), gap(flight, options));
    let rudder = RudderMotion::of(&flight.samples);
    let periods = channels.periods();
    let sensors = options.sensors.overridden_by(&flight.sensors);
    let mut log = Log { step, tracks: Vec::new(), has, periods, rudder, sensors, notes };
    let mut longest = 0.0_f64;
    for times in &stretches {
        let [start, end] = [times[0], times[times.len() - 1]];
        longest = longest.max(end - start);
        let sensed = |c: &Channel| c.count(start, end) >= FEWEST;
        let why = if end - start < options.shortest_s {
            Some("too short")
        } else if !channels.attitude[..2].iter().all(sensed) || !sensed(&channels.airspeed) {
            Some("without attitude or airspeed")
        } else {
            None
        };
        match why {
            Some(why) => log
                .notes
                .push(format!("The stretch from {start:.2} s to {end:.2} s is left out: {why}.")),
            None => {
                let mut track = track(&channels, &has, [start, end], [step, gap], options);
                if let Some(at) = log.sensors.accelerometer_at() {
                    lever_arm::to_the_centre(&mut track, at, step);
                }
                log.tracks.push(track);
            }
        }
    }
    if log.tracks.is_empty() {
        let (flight, shortest_s) = (options.name.clone(), options.shortest_s);
        return Err(ReconstructError::TooShort { flight, longest_s: longest, shortest_s });
    }
    let ends = log.tracks.iter().map(|t| t.time(t.len(), step));
    let (start, end) = (log.tracks[0].start, ends.fold(f64::NEG_INFINITY, f64::max));
    let span = Span { middle: 0.5 * (start + end), length: end - start };
    log.tracks.iter_mut().for_each(|track| track.span = span);
    Ok(log)
}

fn declare(channels: &Channels, has: &Present, options: &Options, notes: &mut Vec<String>) {
    let mut stuck = |channels: &[Channel], what: &str| {
        if channels.iter().any(|c| c.stuck) {
            notes.push(format!("The {what} shows one and the same value all the time: left out."));
        }
    };
    stuck(&channels.attitude[2..], "heading");
    stuck(&channels.force, "accelerometer on an axis");
    stuck(&channels.vanes[..1], "angle-of-attack vane");
    stuck(&channels.vanes[1..], "sideslip vane");
    stuck(&channels.velocity[..2], "velocity over ground");
    let steered = ["aileron", "elevator", "throttle"].into_iter();
    let rudder = options.actuators.rudder.filter(|_| !channels.commands[3].is_empty());
    let absent: Vec<_> = steered
        .chain(rudder.map(|_| "rudder"))
        .zip(&channels.positions)
        .filter(|(_, c)| c.is_empty())
        .map(|(name, _)| name)
        .collect();
    if !absent.is_empty() {
        notes.push(format!(
            "The positions of {} are not logged: reconstructed from the commands through the \
             airframe's actuators.",
            absent.join(", ")
        ));
    }
    notes.push(if !channels.density.is_empty() {
        "Air density: as logged.".into()
    } else if has.altitude {
        "Air density: standard atmosphere at the logged altitude.".into()
    } else {
        "Air density: standard atmosphere at sea level, for want of an altitude.".into()
    });
}

/// The times of the rows of each stretch in flight without a gap.
fn stretches(
    flight: &Flight,
    has: &Present,
    options: &Options,
) -> Result<Vec<Vec<f64>>, ReconstructError> {
    let usable = |s: &&Sample| {
        s.time_s.is_finite()
            && s.rates_radps.iter().all(|x| x.is_finite())
            && (!has.force || s.specific_force_mps2.iter().all(|x| x.is_finite()))
    };
    let airborne = airborne(flight, options)?;
    let gap = gap(flight, options);
    let mut stretches: Vec<Vec<f64>> = Vec::new();
    for s in flight.samples.iter().filter(usable).filter(|s| airborne(s.time_s)) {
        match stretches.last_mut() {
            Some(times) if times.last().is_some_and(|t| s.time_s <= *t) => {}
            Some(times) if times.last().is_some_and(|t| s.time_s - t <= gap) => {
                times.push(s.time_s);
            }
            _ => stretches.push(vec![s.time_s]),
        }
    }
    Ok(stretches)
}

/// Longest time between rows that is no gap, s: longer for a log that is slow throughout.
fn gap(flight: &Flight, options: &Options) -> f64 {
    let times: Vec<f64> = flight.samples.iter().map(|s| s.time_s).collect();
    let periods: Vec<f64> =
        times.windows(2).map(|w| w[1] - w[0]).filter(|period| *period > 0.0).collect();
    let period = if periods.is_empty() { 0.0 } else { quantile(&periods, 0.5) };
    1.000_001 * options.gap_s.max(GAP_PERIODS * period.min(SLOWEST_PERIOD))
}

/// Tells flight from ground by the mean airspeed around a time.
fn airborne(flight: &Flight, options: &Options) -> Result<impl Fn(f64) -> bool, ReconstructError> {
    let rows = flight.samples.iter().map(|s| (s.time_s, s.airspeed_mps));
    let (times, speeds): (Vec<f64>, Vec<f64>) =
        rows.filter(|(t, v)| t.is_finite() && v.is_finite()).unzip();
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    let slowest = options.airspeed_min_mps;
    if fastest < slowest {
        return Err(ReconstructError::NoFlight {
            flight: options.name.clone(),
            fastest_mps: fastest,
        });
    }
    let mut sums = vec![0.0];
    for v in &speeds {
        sums.push(sums[sums.len() - 1] + v);
    }
    Ok(move |t: f64| {
        let a = times.partition_point(|x| *x < t - AIRBORNE_WINDOW / 2.0);
        let b = times.partition_point(|x| *x <= t + AIRBORNE_WINDOW / 2.0);
        b > a && sums[b] - sums[a] >= slowest * (b - a) as f64
    })
}

fn step(stretches: &[Vec<f64>], options: &Options) -> f64 {
    let periods: Vec<f64> =
        stretches.iter().flat_map(|t| t.windows(2).map(|w| w[1] - w[0])).collect();
    let median = quantile(&periods, 0.5);
    // a clock written with few digits must not make a step of 0.010001 s
    if median.is_finite() && median > 1.02 * options.step_s { median } else { options.step_s }
}

fn track(
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
    let mut track = Track { start, ..Track::default() };
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

/// Takes the vertical velocity from the altitude, once every [`CLIMB_WINDOW`], so that the errors of
/// the altitude enter once each.
fn climb(track: &mut Track, step: f64) {
    let half = (CLIMB_WINDOW / step / 2.0).round().max(1.0) as usize;
    let mut k = half;
    while k + half < track.len() {
        let rise = track.altitude[k + half] - track.altitude[k - half];
        track.velocity[k][2] = -rise / (2 * half) as f64 / step;
        k += 2 * half;
    }
}

/// Integrates the heading from the gyros, ψ̇ = (q sin φ + r cos φ) / cos θ, and hands it out once every
/// [`CLIMB_WINDOW`]: where nothing else shows the heading, the path could turn as it likes.
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

/// The command in force at `t`; where only some are logged, the others are NaN.
fn command(channels: &Channels, t: f64) -> Option<Command> {
    let [aileron, elevator, throttle, rudder] =
        std::array::from_fn(|i| channels.commands[i].held(t));
    let rudder = if rudder.is_finite() { rudder } else { 0.0 };
    let command = Command { aileron, elevator, throttle, rudder };
    command.is_finite().then_some(command)
}

/// The deflections at `times`: as logged, else from the commands through the actuators.
fn controls(channels: &Channels, times: &[f64], options: &Options) -> Vec<Controls> {
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
        all.push(Controls {
            aileron: logged(0, simulated.aileron),
            elevator: logged(1, simulated.elevator),
            throttle: logged(2, simulated.throttle),
            rudder: logged(3, if f.rudder.is_some() { simulated.rudder } else { 0.0 }),
            lagged: None,
        });
    }
    all
}

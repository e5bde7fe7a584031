//! Conversion of the smoother's result to the reconstruction of a flight: states, sensor errors, remaining errors of the states,
//! delay of the recorded actuators, and notes.

mod copies;

use nalgebra::Vector3;

use crate::flight_path::actuator_skew::{self, Skew};
use crate::flight_path::equations::{Found, Problem};
use crate::flight_path::intake::{Log, Track};
use crate::flight_path::kinematics::shifted;
use crate::flight_path::levels::CALM;
use crate::flight_path::nuisance::{
    self, BEND, COUNT, DRIFT, FORCE, FORCE_GAIN, GYRO_GAIN, SKEW_FORCE, Values, WIND,
};
use crate::flight_path::path::{Path, flow_angles};
use crate::flight_path::reconstruction::{Instant, Nuisance, Reconstruction, Segment};
use crate::flight_path::rotation::to_euler;
use crate::flight_path::{ActuatorClock, ReconstructError};
use greylag_num::statistics::mean;
use greylag_physics::sensors::Known;
use greylag_physics::{Command, Controls, State};

/// A constant (sensor error or wind) counts as unobservable if its posterior standard deviation exceeds this fraction of its
/// prior standard deviation.
const UNSEEN: f64 = 0.7;
/// A note is written if an estimate differs from its prior mean by more than this number of prior standard deviations.
const FAR: f64 = 3.0;
/// A note is written if the standard deviation of the gusts exceeds this value, m/s.
const ROUGH: f64 = 0.1;
/// Smallest actuator delay that is corrected, in sampling intervals. A smaller delay is within the error of the regression.
const CORRECTED: f64 = 0.25;

/// Length of the blocks over which the difference between estimated and measured attitude is averaged, s. These means count as a
/// systematic error and not as noise.
const DISAGREEING: f64 = 4.0;

/// Standard deviations of the constant errors of pitch and heading that a flight controller's estimator records, rad.
///
/// A log does not show these errors. For example, if the estimator takes an accelerometer bias for a pitch error, its attitude
/// and its corrected accelerations still agree with each other. PX4 in SITL has errors of 0.14° to 0.22° in pitch and 0.11° to
/// 0.30° in heading (results/notes/2026-11-27-flight-path-reconstruction.md). A real board levelled by hand and a compass
/// calibrated by hand are assumed to have at least these errors.
const ALIGNED: [f64; 2] = [0.25 * DEGREE, 0.5 * DEGREE];
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Name of the delay of the recorded deflections among the nuisance parameters.
const LATE: &str = "skew_actuators";

/// Assembles the reconstruction from the result `found` of the smoother.
///
/// # Errors
/// [`ReconstructError::NoPath`] if the equations of the simulated path errors are singular.
pub fn assemble(problem: &Problem, found: &Found) -> Result<Reconstruction, ReconstructError> {
    let Problem { log, options, .. } = *problem;
    let mut nuisances = nuisances(problem, found);
    let mut notes = log.notes.clone();
    declare(problem, found, &nuisances, &mut notes);
    // before the flight itself, because the copies take much memory, too
    let (left, erring) = copies::draws(problem, found)?;
    let segments = path_as_segments(problem, found);
    let finite = |i: &Instant| i.specific_force.iter().all(|f| f.is_finite());
    if !log.has.force {
        notes.push(match segments.iter().flat_map(|s| &s.instants).any(finite) {
            true => "No accelerometers: the specific force is that of the reconstructed path, from the velocity \
                     over ground."
                .into(),
            false => "No accelerometers: the path between samples is smoothed, not driven, and forces cannot be \
                      compared."
                .into(),
        });
    }
    nuisances.extend(unmeasured_angles(problem, found, &segments, &left));
    let instants: Vec<&[Instant]> = segments.iter().map(|s| s.instants.as_slice()).collect();
    let own = actuator_skew::by_axis(&instants, log.step, problem.sampling);
    let skew = actuator_skew::estimate(own, &erring, log.step, found.levels.gusts);
    nuisances.push(Nuisance {
        name: LATE.into(),
        value: skew.late,
        sd: skew.deviation,
        unit: "s",
        prior: None,
    });
    let l = &found.levels;
    let m = &l.measured;
    let mut flight = Reconstruction {
        name: options.name.clone(),
        step_s: log.step,
        sampling: problem.sampling,
        clock: ActuatorClock::AsRecorded,
        segments,
        nuisances,
        installation: Vec::new(),
        noise: [m[0], m[1], m[3], l.gyro[0], l.gyro[1], l.gyro[2], m[4], m[5]],
        left,
        force_noise: if log.has.force { l.force } else { [m[6].max(m[7]) / log.step; 3] },
        gust_step: if l.gusts > CALM { l.gust_step(log.step) } else { 0.0 },
        rudder: log.rudder,
        notes,
    };
    if let Some(skew) = flight.actuators_late() {
        flight.notes.push(left_as_recorded(&skew));
    }
    Ok(match options.actuators_clock {
        ActuatorClock::AsRecorded => flight,
        ActuatorClock::Estimated => flight.with_corrected_clock(),
    })
}

impl Reconstruction {
    /// Delay of the recorded deflections against the gyros, if it is significant and not corrected; else `None`.
    pub fn actuators_late(&self) -> Option<Skew> {
        let found = self.nuisances.iter().find(|n| n.name == LATE)?;
        let skew = Skew { late: found.value, deviation: found.sd };
        let left = self.clock == ActuatorClock::AsRecorded;
        (left && late_beyond_doubt(&skew, self.step_s)).then_some(skew)
    }

    /// The flight with the deflections on the time base of the gyros ([`ActuatorClock::Estimated`]). Their delay is removed if it is
    /// significant.
    pub fn with_corrected_clock(mut self) -> Reconstruction {
        if let Some(skew) = self.actuators_late() {
            correct(&mut self.segments, &skew, self.step_s);
            let left = left_as_recorded(&skew);
            self.notes.retain(|note| *note != left);
            self.notes.push(format!(
                "The recorded actuators came {:.1} ms late against the gyros and were corrected; a lag of \
                 the surfaces that the record does not show would look the same.",
                1e3 * skew.late
            ));
        }
        self.clock = ActuatorClock::Estimated;
        self
    }
}

/// Note on deflections whose delay `skew` is not corrected.
fn left_as_recorded(skew: &Skew) -> String {
    format!(
        "The recorded actuators seem {:.1} ms late against the gyros, by their clock or by a lag that \
         the record does not show; they are left as recorded.",
        1e3 * skew.late
    )
}

/// Makes segments with the states of the paths in `found`.
fn path_as_segments(problem: &Problem, found: &Found) -> Vec<Segment> {
    let Problem { log, options, .. } = *problem;
    let pairs = log.tracks.iter().zip(&found.paths);
    let one =
        |(track, path): (&Track, &Path)| segment(track, path, &found.values, log, options.gravity);
    pairs.map(one).collect()
}

fn segment(track: &Track, path: &Path, values: &Values, log: &Log, gravity: f64) -> Segment {
    let force = match log.has.force {
        true => shifted(&track.force, values[SKEW_FORCE] / log.step),
        false => path_force(track, path, log, gravity),
    };
    let instant = |k: usize| {
        let (state, yaw) = state(track, path, values, log.step, (k, [0.0; 3]));
        let [aileron, elevator, throttle, rudder] = track.commands[k];
        let command = Command { aileron, elevator, throttle, rudder };
        let [aileron, elevator, throttle, rudder] = track.controls[k];
        Instant {
            time_s: track.start + k as f64 * log.step,
            state,
            yaw: if log.has.yaw { yaw } else { f64::NAN },
            controls: Controls { aileron, elevator, throttle, rudder, lagged: None },
            command: command.is_finite().then_some(command),
            specific_force: std::array::from_fn(|i| {
                let gain = if log.has.force { 1.0 + values[FORCE_GAIN + i] } else { 1.0 };
                force[k][i] / gain - values[FORCE + i]
            }),
            // Without a recorded altitude, sea level is assumed; the notes state this.
            altitude: Some(track.altitude[k]).filter(|h| h.is_finite()).unwrap_or(0.0),
            density: track.density[k],
        }
    };
    Segment { instants: (0..track.len()).map(instant).collect() }
}

/// State at sample `k` of a path, with the body rates of `track` less the errors of the gyros plus `noise` (rad/s), and the heading,
/// rad.
fn state(
    track: &Track,
    path: &Path,
    values: &Values,
    step: f64,
    (k, noise): (usize, [f64; 3]),
) -> (State, f64) {
    let [roll, pitch, yaw] = to_euler(&path.attitude[k]);
    let air = path.air_velocity(k);
    let [alpha, beta] = flow_angles(&air);
    let bias = nuisance::gyro_bias(values, track.time(k, step), &track.span);
    let rates = nuisance::without_gain(values, GYRO_GAIN, track.rates[k]);
    let [p, q, r] = std::array::from_fn(|i| rates[i] - bias[i] + noise[i]);
    (State { roll, pitch, airspeed: air.norm(), p, q, r, alpha, beta }, yaw)
}

/// Specific force along a path, for a log without accelerometers: acceleration minus gravity, body axes, m/s². NaN at samples
/// without a measured velocity, and at both ends.
fn path_force(track: &Track, path: &Path, log: &Log, gravity: f64) -> Vec<Vector3<f64>> {
    let nan = Vector3::repeat(f64::NAN);
    let down = Vector3::new(0.0, 0.0, gravity);
    let at = |k: usize| {
        if !log.has.velocity || k == 0 || k + 1 >= path.len() || !track.velocity[k][0].is_finite() {
            return nan;
        }
        let gained = (path.velocity[k + 1] - path.velocity[k - 1]) / (2.0 * log.step);
        path.attitude[k].transpose() * (gained - down)
    };
    (0..path.len()).map(at).collect()
}

/// Whether the delay of the recorded deflections is significant (at least 2 standard deviations) and large enough to be
/// corrected.
fn late_beyond_doubt(skew: &Skew, step: f64) -> bool {
    skew.late.abs() >= CORRECTED * step && skew.late.abs() >= 2.0 * skew.deviation
}

/// Removes the delay of the recorded deflections by linear interpolation.
fn correct(segments: &mut [Segment], skew: &Skew, step: f64) {
    let late = skew.late / step;
    for segment in segments {
        let recorded: Vec<Controls> = segment.instants.iter().map(|i| i.controls).collect();
        let last = recorded.len() - 1;
        for (k, instant) in segment.instants.iter_mut().enumerate() {
            let place = (k as f64 + late).clamp(0.0, last as f64);
            let (i, part) = (place as usize, place.fract());
            let (a, b) = (&recorded[i], &recorded[(i + 1).min(last)]);
            let mix = |a: f64, b: f64| a + part * (b - a);
            instant.controls = Controls {
                aileron: mix(a.aileron, b.aileron),
                elevator: mix(a.elevator, b.elevator),
                throttle: mix(a.throttle, b.throttle),
                rudder: mix(a.rudder, b.rudder),
                lagged: None,
            };
        }
    }
}

/// Estimated constants of the sensors that the log has. The airspeed scale is stated as a factor.
fn nuisances(problem: &Problem, smoothed: &Found) -> Vec<Nuisance> {
    nuisance::ORDER
        .into_iter()
        .filter(|place| nuisance::concerned(*place, &problem.log.has))
        .filter(|place| !nuisance::held(*place, problem.widths[*place]))
        .map(|place| {
            let (name, unit) = nuisance::NAMES[place];
            let offset = nuisance::offset(place);
            let value = offset + problem.means[place];
            Nuisance {
                name: name.into(),
                value: offset + smoothed.values[place],
                sd: smoothed.deviations[place],
                unit,
                prior: Some(Known { value, sd: problem.widths[place] }),
            }
        })
        .collect()
}

/// Standard deviations of α and β without vanes, rad, as nuisance parameters with the value zero. An angle with a vane has no
/// entry.
///
/// Four standard deviations are combined: that of the wind, that of the path, the slow difference between estimated and measured
/// pitch or heading, and the constant error of the measured pitch or heading.
///
/// The first two, which follow from noise, are not sufficient. For example, if gyros and compass differ by a degree over half a
/// minute, the heading has an error of at least this size, and so has β.
fn unmeasured_angles(
    problem: &Problem,
    smoothed: &Found,
    segments: &[Segment],
    left: &[f64; 8],
) -> Vec<Nuisance> {
    let log = problem.log;
    let slow = problem.slow_disagreement(smoothed, DISAGREEING);
    let speeds: Vec<f64> =
        segments.iter().flat_map(|s| s.instants.iter().map(|i| i.state.airspeed)).collect();
    let airspeed = mean(&speeds).max(1.0);
    let [north, east, down] = std::array::from_fn(|i| smoothed.deviations[WIND + i]);
    let across = north.hypot(east) / std::f64::consts::SQRT_2;
    let angles = [
        ("alpha_path", log.has.alpha, down, left[6].hypot(slow[1]).hypot(ALIGNED[0])),
        ("beta_path", log.has.beta, across, left[7].hypot(slow[2]).hypot(ALIGNED[1])),
    ];
    let unmeasured = angles.into_iter().filter(|(_, measured, ..)| !measured);
    unmeasured
        .map(|(name, _, wind, path)| Nuisance {
            name: name.into(),
            value: 0.0,
            sd: (wind / airspeed).hypot(path),
            unit: "rad",
            prior: None,
        })
        .collect()
}

fn declare(problem: &Problem, smoothed: &Found, found: &[Nuisance], notes: &mut Vec<String>) {
    let Problem { log, options, .. } = *problem;
    let has = &log.has;
    let vanes = match (has.alpha, has.beta) {
        (true, true) => "",
        (false, true) => "angle of attack",
        (true, false) => "sideslip",
        (false, false) => "angle of attack and sideslip",
    };
    if !vanes.is_empty() {
        notes.push(format!(
            "No vane for {vanes}: reconstructed from {}; gusts are not seen there, and effects of {vanes} \
             are known less well.",
            match (has.velocity, has.force) {
                (true, true) => "the wind-corrected velocity and the inertial sensors",
                (true, false) => "the wind-corrected velocity",
                (false, true) => "the inertial sensors alone, so that a slow error remains",
                (false, false) => "the airspeed and the attitude, which hardly determine it",
            }
        ));
    }
    let unseen = |place: &usize| {
        let stated = log.sensors.known(nuisance::NAMES[*place].0).is_some();
        // drifts are omitted, because an unobservable drift is too slow to be relevant in this flight
        !stated
            && !nuisance::held(*place, problem.widths[*place])
            && !(DRIFT..BEND).contains(place)
            && smoothed.deviations[*place] > UNSEEN * problem.widths[*place]
    };
    let places: Vec<usize> =
        (0..COUNT).filter(|p| nuisance::concerned(*p, has)).filter(unseen).collect();
    notes.extend(nuisance::unseen(&places, has, options));
    for n in found.iter().filter(|n| n.moved().abs() > FAR) {
        notes.push(format!(
            "{} is found at {:.4} {}, {:.1} standard deviations from the prior mean: check that \
             sensor, or what [sensors] says of it.",
            n.name,
            n.value,
            n.unit,
            n.moved().abs()
        ));
    }
    if smoothed.levels.gusts > ROUGH {
        notes.push(format!(
            "The air was rough: gusts of about {:.1} m/s in addition to the mean wind.",
            smoothed.levels.gusts
        ));
    }
}

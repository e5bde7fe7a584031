//! Constants that are estimated together with the path (sensor errors, wind, Earth's rate): indices, names, units and priors.
//!
//! The path is the reconstructed motion. An instant is one sample of it. Between instants, gyros and accelerometers predict the
//! motion.

use crate::flight_path::Options;
use crate::flight_path::intake::{Log, Present, Span};
use greylag_physics::sensors::CONSTANTS;

/// Number of estimated constants.
pub const COUNT: usize = 42;
/// Index of the angle-of-attack vane's bias, rad.
pub const ALPHA: usize = 0;
/// Index of the sideslip vane's bias, rad.
pub const BETA: usize = 1;
/// Index of the airspeed scale: measured = (1 + scale) · true.
pub const SCALE: usize = 2;
/// First index of the steady wind north, east, down, m/s.
pub const WIND: usize = 3;
/// Index of the attitude's delay relative to the gyros, s.
pub const SKEW_ATTITUDE: usize = 6;
/// Index of the airspeed's delay relative to the gyros, s.
pub const SKEW_AIRSPEED: usize = 7;
/// Index of the vanes' delay relative to the gyros, s.
pub const SKEW_VANES: usize = 8;
/// Index of the ground velocity's delay relative to the gyros, s.
pub const SKEW_VELOCITY: usize = 9;
/// First index of the gains of the α and β vanes less 1. Upwash of a wing or a body causes such gains.
pub const VANE_GAIN: usize = 10;
const BETA_GAIN: usize = VANE_GAIN + 1;
/// Index of the airspeed's offset, m/s: measured = (1 + scale) · true + offset.
pub const AIRSPEED_OFFSET: usize = 12;
/// Index of the offset of the measured heading relative to the velocity over ground, rad.
pub const HEADING: usize = 13;
/// Index of the roll angle of the board (gyros, accelerometers, attitude) against the vanes, rad: the rotation about the forward
/// axis from the vanes' axes to the board's axes.
///
/// With such a roll, the vanes show the sideslip at the board as an angle of attack and vice versa. A pitch or yaw of the board
/// changes α or β by a constant, which is the bias of the vane.
pub const BOARD_ROLL: usize = 14;
/// Index of the first constant that acts between instants. Constants with smaller indices act on the measurements at instants.
pub const INERTIAL: usize = 15;
/// First index of the gyro biases p, q, r in the middle of the flight, rad/s.
pub const GYRO: usize = 15;
/// First index of the accelerometer biases x, y, z, m/s².
pub const FORCE: usize = 18;
/// Index of the accelerometers' delay relative to the gyros, s.
pub const SKEW_FORCE: usize = 21;
/// First index of the drift rates of the gyro biases p, q, r, rad/s².
///
/// The gyro biases of ArduPilot's SITL drift by 0.05°/s per minute, like those of a gyro that warms up. With constant
/// biases, the heading error was 1.5° after four minutes.
pub const DRIFT: usize = 22;
/// First index of the gains of the gyros p, q, r less 1.
pub const GYRO_GAIN: usize = 25;
/// First index of the gains of the accelerometers x, y, z less 1.
pub const FORCE_GAIN: usize = 28;
/// First index of the changes of the drift rates at the inner knots of the flight, p, q, r for each knot, rad/s². The drift
/// of ArduPilot's SITL reverses after five minutes.
pub const BEND: usize = 31;
/// Number of inner knots, equally spaced between the ends of the flight.
const KNOTS: usize = 3;
/// First index of the Earth's rate north and down, rad/s.
///
/// A log without a latitude does not determine this rate. The Coriolis acceleration, 0.003 m/s² at 20 m/s, is twice the
/// standard deviation of an accelerometer bias after a minute.
pub const EARTH: usize = 40;

/// Indices of the constants in the order of the result.
pub const ORDER: [usize; BEND] = [
    15, 16, 17, 22, 23, 24, 25, 26, 27, 18, 19, 20, 28, 29, 30, 0, 1, 10, 11, 14, 2, 12, 13, 3, 4,
    5, 6, 21, 7, 8, 9,
];

/// Prior standard deviation of a delay, in sampling intervals. The 95 % interval is ±1.5 sampling intervals.
pub const SKEW_SAMPLES: f64 = 0.77;

/// Values of the constants.
pub type Values = [f64; COUNT];

/// Names and units, by index: sensor errors and wind, then the Earth's rate.
pub const NAMES: [(&str, &str); COUNT] = {
    let mut all = [("gyro_bend", "rad/s²"); COUNT];
    all[EARTH] = ("earth_rate_north", "rad/s");
    all[EARTH + 1] = ("earth_rate_down", "rad/s");
    assert!(CONSTANTS.len() == BEND && EARTH + 2 == COUNT);
    let mut place = 0;
    while place < CONSTANTS.len() {
        all[place] = CONSTANTS[place];
        place += 1;
    }
    all
};

/// Prior standard deviation of the delay of a sensor that is slower than the log's rows, in periods of the sensor. The
/// sensor's filter is assumed to be about as long as its period.
const SKEW_PERIODS: f64 = 0.5;

/// Prior standard deviation of the drift rate of a gyro's bias, rad/s². It is slightly larger than the drift rate of
/// ArduPilot's SITL (0.05°/s per minute, 1.45e-5 rad/s²).
const DRIFTING: f64 = 2e-5;
/// Time over which a drift rate changes by about its magnitude, s. On ArduPlane's logs, 3000 s gave better results than 300
/// s: a drift rate that changes faster follows slow heading errors of these logs.
const STEADY: f64 = 3000.0;

impl Span {
    /// Time between two knots of the gyro biases, s.
    fn apart(&self) -> f64 {
        self.length / (KNOTS + 1) as f64
    }
}

/// Prior standard deviation of a constant that is held or known exactly, as a fraction of its usual prior standard deviation. A
/// value above zero keeps the equations regular.
pub const HELD: f64 = 1e-4;

/// Rare instrument errors with their prior standard deviations. They are held at zero until a flight shows them
/// significantly (see `calibration`).
const SELDOM: [(usize, f64); 11] = [
    (VANE_GAIN, 0.2),
    (VANE_GAIN + 1, 0.2),
    (AIRSPEED_OFFSET, 2.0),
    (HEADING, 10.0 * std::f64::consts::PI / 180.0),
    (BOARD_ROLL, 5.0 * std::f64::consts::PI / 180.0),
    (GYRO_GAIN, 0.1),
    (GYRO_GAIN + 1, 0.1),
    (GYRO_GAIN + 2, 0.1),
    (FORCE_GAIN, 0.1),
    (FORCE_GAIN + 1, 0.1),
    (FORCE_GAIN + 2, 0.1),
];
/// Prior standard deviation of a delay that a flight has shown to be unusually long, s.
const LATE: f64 = 0.5;

/// Prior standard deviation of a constant that a flight has shown to be significant. `None` for a constant that is always free.
pub fn wide(place: usize) -> Option<f64> {
    let late = matches!(place, SKEW_ATTITUDE..=SKEW_VELOCITY | SKEW_FORCE);
    SELDOM.iter().find(|(of, _)| *of == place).map(|(_, width)| *width).or(late.then_some(LATE))
}

/// Prior standard deviation that holds a rare instrument error at its prior mean, if its usual one is `width`.
pub fn exact(place: usize, width: f64) -> f64 {
    wide(place).map_or(width, |wide| width.min(HELD * wide))
}

/// Whether a rare instrument error, whose prior standard deviation is `width`, is still held at its prior mean.
pub fn held(place: usize, width: f64) -> bool {
    SELDOM.iter().any(|(of, wide)| *of == place && width <= 2.0 * HELD * wide)
}

/// Prior standard deviations of the constants for `log`: as stated for the sensors, or else default values.
pub fn prior_widths(log: &Log) -> Values {
    let mut widths = usual_widths(log);
    for (place, (width, (name, _))) in widths.iter_mut().zip(NAMES).enumerate() {
        if let Some(known) = log.sensors.known(name) {
            let least = if held(place, *width) { *width } else { HELD * *width };
            *width = known.sd.max(least);
        }
    }
    widths
}

fn usual_widths(log: &Log) -> Values {
    let least = SKEW_SAMPLES * log.step;
    let mut width = [least; COUNT];
    let slower = |period: f64| if period > 2.0 * log.step { SKEW_PERIODS * period } else { least };
    width[SKEW_ATTITUDE] = slower(log.periods.attitude);
    width[SKEW_AIRSPEED] = slower(log.periods.airspeed);
    width[SKEW_VANES] = slower(log.periods.vanes);
    width[SKEW_VELOCITY] = slower(log.periods.velocity);
    width[GYRO..GYRO + 3].fill(0.05);
    width[FORCE..FORCE + 3].fill(1.0);
    width[ALPHA..=BETA].fill(5.0_f64.to_radians());
    width[SCALE] = 0.2;
    width[WIND..WIND + 2].fill(15.0);
    // the mean vertical wind over a flight is close to zero
    width[WIND + 2] = 1.0;
    width[DRIFT..DRIFT + 3].fill(DRIFTING);
    let apart = log.tracks.first().map_or(0.0, |track| track.span.apart());
    for place in BEND..EARTH {
        let drift = log.sensors.known(NAMES[DRIFT + (place - BEND) % 3].0);
        let sd = drift.map_or(DRIFTING, |known| known.sd.max(HELD * DRIFTING));
        width[place] = sd * (apart / STEADY).sqrt().max(HELD);
    }
    for (place, wide) in SELDOM {
        width[place] = HELD * wide;
    }
    width[EARTH..EARTH + 2].copy_from_slice(&[1.3e-5, 4.2e-5]);
    width
}

/// Prior means of the constants: as stated for the sensors of `log`, or else zero.
///
/// The Earth's rate to the north has the mean 5.8e-5 rad/s. Mean and standard deviations of the Earth's rate (7.29e-5 rad/s)
/// cover latitudes from −65° to 65°.
pub fn prior_means(log: &Log) -> Values {
    let mut mean = [0.0; COUNT];
    mean[EARTH] = 5.8e-5;
    for (place, (name, _)) in NAMES.iter().enumerate() {
        if let Some(known) = log.sensors.known(name) {
            mean[place] = known.value - offset(place);
        }
    }
    mean
}

/// Indices and factors of the constants that add up to the gyro bias of an axis (0 to 2) at `time` (s).
pub fn gyro_bias_of(axis: usize, time: f64, span: &Span) -> [(usize, f64); 2 + KNOTS] {
    let since_middle = time - span.middle;
    std::array::from_fn(|i| match i {
        0 => (GYRO + axis, 1.0),
        1 => (DRIFT + axis, since_middle),
        _ => {
            let knot = (i - 2) as f64 - 0.5 * (KNOTS - 1) as f64;
            // a change acts from its knot to the nearer end of the flight, so that the bias in the middle of the flight does
            // not change
            let beyond = match knot {
                ..0.0 => (since_middle - knot * span.apart()).min(0.0),
                _ => (since_middle - knot * span.apart()).max(0.0),
            };
            (BEND + 3 * (i - 2) + axis, beyond)
        }
    })
}

/// Gyro biases p, q, r at `time` (s), rad/s.
pub fn gyro_bias(values: &Values, time: f64, span: &Span) -> [f64; 3] {
    std::array::from_fn(|axis| {
        gyro_bias_of(axis, time, span).iter().map(|(place, by)| values[*place] * by).sum()
    })
}

/// The three-axis measurement `measured` divided by 1 + gain: measured = (1 + gain) · (true + bias). `first` is the index of
/// the first gain.
pub fn without_gain(values: &Values, first: usize, measured: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| measured[axis] / (1.0 + values[first + axis]))
}

/// Number that is added to a constant in the result: 1 for the airspeed scale, which the result states as a factor, else 0.
pub fn offset(place: usize) -> f64 {
    if place == SCALE { 1.0 } else { 0.0 }
}

/// Whether the log contains the sensor to which a constant belongs. False for constants that the result does not contain.
pub fn concerned(place: usize, has: &Present) -> bool {
    match place {
        ALPHA | VANE_GAIN => has.alpha,
        BETA | BETA_GAIN => has.beta,
        SKEW_VANES => has.alpha || has.beta,
        BOARD_ROLL => has.alpha && has.beta,
        FORCE..=SKEW_FORCE => has.force,
        SKEW_VELOCITY => has.velocity,
        HEADING => has.yaw && has.velocity,
        FORCE_GAIN..BEND => has.force,
        BEND.. => false,
        _ => true,
    }
}

/// Whether the log cannot determine a constant.
///
/// Without accelerometers and velocity over ground, the air-data sensors are not related to one another. Only the smoothness of
/// the path then determines the constants, and a slow flight is smoother. In a flight without sensor errors, the airspeed scale
/// was estimated as four instead of one.
pub fn unseeable(place: usize, has: &Present) -> bool {
    let of_the_air = place < SKEW_ATTITUDE
        || place == SKEW_AIRSPEED
        || (SKEW_VANES..=AIRSPEED_OFFSET).contains(&place) && place != SKEW_VELOCITY
        || place == BOARD_ROLL;
    of_the_air && !has.force && !has.velocity
}

/// Measurement that would make an unobservable constant observable, in words.
pub fn remedy(place: usize, has: &Present) -> &'static str {
    match place {
        _ if unseeable(place, has) => "log the accelerometers or the velocity over ground",
        SCALE | WIND..SKEW_ATTITUDE if !has.velocity => "log the velocity over ground",
        SCALE | WIND..SKEW_ATTITUDE if !has.yaw => "log the heading",
        SCALE | WIND..SKEW_ATTITUDE => "fly several headings",
        ALPHA | BETA => "fly at several airspeeds and banks",
        _ => "fly livelier manoeuvres",
    }
}

/// Notes on the constants `places`, which keep their priors; one note for each remedy.
pub fn unseen(places: &[usize], has: &Present, options: &Options) -> Vec<String> {
    let mut by_remedy: Vec<(&str, Vec<&str>)> = Vec::new();
    for place in places {
        let (remedy, name) = (remedy(*place, has), NAMES[*place].0);
        match by_remedy.iter_mut().find(|(of, _)| *of == remedy) {
            Some((_, names)) => names.push(name),
            None => by_remedy.push((remedy, vec![name])),
        }
    }
    let note = |(remedy, names): (&str, Vec<&str>)| {
        let (they, keep, them) = match names.len() {
            1 => ("it", "keeps its prior", "it"),
            _ => ("they", "keep their priors", "them"),
        };
        format!(
            "The data of {} do not determine {}: {they} {keep}; {remedy} to see {them}.",
            options.name,
            names.join(", ")
        )
    };
    by_remedy.into_iter().map(note).collect()
}

//! The constants estimated along with the path: their names, units and prior widths.

use crate::flight_path::Options;
use crate::flight_path::intake::{Log, Present, Span};
use greylag_physics::sensors::CONSTANTS;

/// Number of constants.
pub const COUNT: usize = 31;
/// Place of the bias of the angle-of-attack vane.
pub const ALPHA: usize = 0;
/// Place of the bias of the sideslip vane.
pub const BETA: usize = 1;
/// Place of the airspeed scale less one: measured = (1 + scale) · true.
pub const SCALE: usize = 2;
/// Place of the wind north, east, down: the steady part, about which gusts vary.
pub const WIND: usize = 3;
/// Place of the delay of the attitude behind the gyros.
pub const SKEW_ATTITUDE: usize = 6;
/// Place of the delay of the airspeed.
pub const SKEW_AIRSPEED: usize = 7;
/// Place of the delay of the vanes.
pub const SKEW_VANES: usize = 8;
/// Place of the delay of the velocity over ground.
pub const SKEW_VELOCITY: usize = 9;
/// The first of the constants that act between instants; those before it act at instants.
pub const INERTIAL: usize = 10;
/// Place of the gyro biases p, q, r in the middle of the flight.
pub const GYRO: usize = 10;
/// Place of the accelerometer biases x, y, z.
pub const FORCE: usize = 13;
/// Place of the delay of the accelerometers.
pub const SKEW_FORCE: usize = 16;
/// Place of the drifts of the gyro biases p, q, r: their change with time, rad/s². A gyro that warms up drifts
/// by 0.05°/s a minute (so does ArduPilot's SITL): held constant, its bias turned the heading by 1.5° in four minutes.
pub const DRIFT: usize = 17;
/// Place of what bends the drifts, rad/s²: their changes at the inner knots of the flight, p, q, r of each. The drift of
/// ArduPilot's SITL turns back after five minutes.
pub const BEND: usize = 20;
/// Number of inner knots, as far from one another as from the ends of the flight.
const KNOTS: usize = 3;
/// Place of the Earth's rate north and down, rad/s: a log without a latitude does not say them, and
/// their Coriolis acceleration, 0.003 m/s² at 20 m/s, is twice what a minute's accelerometer bias is known to.
pub const EARTH: usize = 29;

/// The constants in the order in which they are handed out.
pub const ORDER: [usize; BEND] =
    [10, 11, 12, 17, 18, 19, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 16, 7, 8, 9];

/// Prior width of a clock skew, samples: ±1.5 samples are its 95 % interval.
pub const SKEW_SAMPLES: f64 = 0.77;

/// Values of the constants.
pub type Values = [f64; COUNT];

/// Names and units, by place: what can be stated of sensors and wind, then the Earth's rate.
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

/// Prior width of the delay of a sensor slower than the log's rows, in its own sample periods: it filters
/// over about as long as it takes to measure.
const SKEW_PERIODS: f64 = 0.5;

/// Usual drift of a gyro's bias, rad/s²: somewhat more than ArduPilot's SITL has (0.05°/s a minute, 1.45e-5).
const DRIFTING: f64 = 2e-5;
/// Time over which a drift changes by about itself, s: of 300 and 3000 the better one on ArduPlane's logs, whose
/// heading errs slowly by itself and would be followed.
const STEADY: f64 = 3000.0;

impl Span {
    /// Time between two knots of the gyros' biases, s.
    fn apart(&self) -> f64 {
        self.length / (KNOTS + 1) as f64
    }
}

/// Part of its usual width to which a constant is held that is known exactly: the equations stay regular.
const HELD: f64 = 1e-4;

/// Standard deviations before the data of `log` is seen: those of its sensors, else the usual ones.
pub fn prior_widths(log: &Log) -> Values {
    let mut widths = usual_widths(log);
    for (width, (name, _)) in widths.iter_mut().zip(NAMES) {
        if let Some(known) = log.sensors.known(name) {
            *width = known.sd.max(HELD * *width);
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
    // air rises and sinks, but not for the length of a flight
    width[WIND + 2] = 1.0;
    width[DRIFT..DRIFT + 3].fill(DRIFTING);
    let apart = log.tracks.first().map_or(0.0, |track| track.span.apart());
    for place in BEND..EARTH {
        let drift = log.sensors.known(NAMES[DRIFT + (place - BEND) % 3].0);
        let sd = drift.map_or(DRIFTING, |known| known.sd.max(HELD * DRIFTING));
        width[place] = sd * (apart / STEADY).sqrt().max(HELD);
    }
    width[EARTH..EARTH + 2].copy_from_slice(&[1.3e-5, 4.2e-5]);
    width
}

/// Means before the data is seen: what is known of the log's sensors, else zero but for the Earth's rate,
/// 7.29e-5 rad/s at any latitude from −65° to 65°, whose north component is never negative. Its deviations
/// are those of the same latitudes.
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

/// The constants of which the bias of the gyro on an axis (0 to 2) is made at `time`, each with its factor.
pub fn gyro_bias_of(axis: usize, time: f64, span: &Span) -> [(usize, f64); 2 + KNOTS] {
    let since_middle = time - span.middle;
    std::array::from_fn(|i| match i {
        0 => (GYRO + axis, 1.0),
        1 => (DRIFT + axis, since_middle),
        _ => {
            let knot = (i - 2) as f64 - 0.5 * (KNOTS - 1) as f64;
            // from the middle to both ends, so that the bias of the middle stays
            let beyond = match knot {
                ..0.0 => (since_middle - knot * span.apart()).min(0.0),
                _ => (since_middle - knot * span.apart()).max(0.0),
            };
            (BEND + 3 * (i - 2) + axis, beyond)
        }
    })
}

/// The gyro biases p, q, r at `time`, rad/s.
pub fn gyro_bias(values: &Values, time: f64, span: &Span) -> [f64; 3] {
    std::array::from_fn(|axis| {
        gyro_bias_of(axis, time, span).iter().map(|(place, by)| values[*place] * by).sum()
    })
}

/// What is added to a constant where it is handed out: the airspeed scale is a factor there.
pub fn offset(place: usize) -> f64 {
    if place == SCALE { 1.0 } else { 0.0 }
}

/// Whether the log has the sensor that a constant belongs to.
pub fn concerned(place: usize, has: &Present) -> bool {
    match place {
        ALPHA => has.alpha,
        BETA => has.beta,
        SKEW_VANES => has.alpha || has.beta,
        FORCE..=SKEW_FORCE => has.force,
        SKEW_VELOCITY => has.velocity,
        BEND.. => false,
        _ => true,
    }
}

/// Whether nothing in the log can tell a constant. Without accelerometers and velocity over ground no
/// sensor of the air meets another one: only the smoothness of the path is left, and that favours whatever
/// makes the aircraft slower (an airspeed scale of four in a flight without any error).
pub fn unseeable(place: usize, has: &Present) -> bool {
    let of_the_air = place < SKEW_ATTITUDE || place == SKEW_AIRSPEED || place == SKEW_VANES;
    of_the_air && !has.force && !has.velocity
}

/// What would let the data see a constant that they do not.
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

/// The notes on the constants that keep their prior: one for each remedy.
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
            "The data of {} cannot tell {}: {they} {keep}; {remedy} to see {them}.",
            options.name,
            names.join(", ")
        )
    };
    by_remedy.into_iter().map(note).collect()
}

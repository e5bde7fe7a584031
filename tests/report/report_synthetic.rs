//! A made-up flight: a second-order answer to twelve targets, with noise from a fixed seed.

use greylag::logs::{Flight, Sample};
use greylag::report::{
    Cycle, Difficulty, Event, EventKind, FlightReport, LoopTiming, Segment, SurfaceTravel,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, LogNormal, Normal};

const STEP_S: f64 = 0.01;
const SEGMENT_S: f64 = 5.0;
/// Roll and pitch, degrees: eight easy, four beyond 45° or 25°.
const TARGETS_DEG: [[f64; 2]; 12] = [
    [0.0, 3.0],
    [20.0, 5.0],
    [-30.0, 0.0],
    [40.0, -10.0],
    [-15.0, 20.0],
    [55.0, 10.0],
    [10.0, -20.0],
    [-58.0, -5.0],
    [30.0, 15.0],
    [-42.0, 8.0],
    [50.0, 28.0],
    [-50.0, -28.0],
];

/// The flight: 60 s at 100 Hz with one pause of 0.3 s and half a second without sideslip.
pub fn flight() -> Flight {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let noise = Normal::new(0.0, 1.0).unwrap();
    let mut angle = [0.0f64, 3.0f64.to_radians()];
    let mut rate = [0.0f64; 2];
    let (mut throttle, mut airspeed) = (0.12, 16.7);
    let mut samples = Vec::new();
    let steps = (TARGETS_DEG.len() as f64 * SEGMENT_S / STEP_S) as usize;
    for step in 0..steps {
        let time_s = step as f64 * STEP_S;
        let target = TARGETS_DEG[(time_s / SEGMENT_S) as usize].map(f64::to_radians);
        let mut acceleration = [0.0; 2];
        for axis in 0..2 {
            // Natural frequency 4 rad/s and 3 rad/s, damping 0.8: settles within 2.5 s.
            let omega = [4.0, 3.0][axis];
            acceleration[axis] =
                omega * omega * (target[axis] - angle[axis]) - 1.6 * omega * rate[axis];
            rate[axis] += acceleration[axis] * STEP_S;
            angle[axis] += rate[axis] * STEP_S;
        }
        let throttle_cmd = (0.2 + 0.9 * target[1]).clamp(0.0, 1.0);
        throttle += (throttle_cmd - throttle) * STEP_S / 0.2;
        airspeed += (18.0 + 8.0 * (throttle - 0.2) - 14.0 * angle[1] - airspeed) * STEP_S / 4.0;
        let mut tremble = |size: f64| size * noise.sample(&mut random);
        let aileron_cmd =
            (0.02 * acceleration[0] + 0.004 * rate[0] + tremble(0.004)).clamp(-1.0, 1.0);
        let elevator_cmd = (0.07 - 0.05 * acceleration[1] + tremble(0.004)).clamp(-1.0, 1.0);
        if (23.0..23.3).contains(&time_s) {
            continue;
        }
        samples.push(Sample {
            time_s,
            attitude_rad: [angle[0] + tremble(3e-4), angle[1] + tremble(3e-4), 0.0],
            rates_radps: [rate[0], rate[1], 0.0],
            airspeed_mps: airspeed + tremble(0.05),
            alpha_rad: 0.04 + 0.05 * rate[1] + tremble(2e-3),
            beta_rad: match time_s {
                37.0..37.5 => f64::NAN,
                _ => 0.03 * rate[0] + tremble(2e-3),
            },
            altitude_m: 600.0 + 3.0 * (0.2 * time_s).sin(),
            aileron_rad: 0.52 * aileron_cmd,
            elevator_rad: 0.52 * elevator_cmd,
            throttle,
            aileron_cmd,
            elevator_cmd,
            throttle_cmd,
            roll_target_rad: target[0],
            pitch_target_rad: target[1],
            ..Sample::default()
        });
    }
    Flight::from(samples)
}

/// The report of `flight`, whose settled errors are those of its samples.
pub fn report(flight: &Flight) -> FlightReport<'_> {
    FlightReport {
        title: "Synthetic flight".into(),
        flight,
        controller: "lqi".into(),
        model: "params/x8/jsbsim.toml".into(),
        seed: Some(7),
        command_line: "report_sample OUT.html".into(),
        versions: vec![("greylag".into(), env!("CARGO_PKG_VERSION").into())],
        segments: (0..TARGETS_DEG.len()).map(|i| segment(flight, i)).collect(),
        tolerance_rad: 0.5f64.to_radians(),
        envelope: None,
        travel: SurfaceTravel { aileron_rad: 0.52, elevator_rad: 0.52 },
        timing: Some(timing(flight)),
        events: events(),
        comparison: None,
        sights: Vec::new(),
        next: "greylag compare --model params/x8/jsbsim.toml --log flight.csv".into(),
    }
}

fn segment(flight: &Flight, index: usize) -> Segment {
    let [roll, pitch] = TARGETS_DEG[index];
    let (start_s, end_s) = (index as f64 * SEGMENT_S, (index + 1) as f64 * SEGMENT_S);
    let settled = end_s - SEGMENT_S / 5.0..end_s;
    let rms = |error: &dyn Fn(&Sample) -> f64| {
        let squares: Vec<f64> = flight
            .samples
            .iter()
            .filter(|s| settled.contains(&s.time_s))
            .map(|s| error(s).powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let roll_rms = rms(&|s| s.attitude_rad[0] - s.roll_target_rad);
    let pitch_rms = rms(&|s| s.attitude_rad[1] - s.pitch_target_rad);
    Segment {
        start_s,
        end_s,
        roll_target_rad: roll.to_radians(),
        pitch_target_rad: pitch.to_radians(),
        difficulty: match (roll.abs() < 45.0, pitch.abs() < 25.0) {
            (true, true) => Difficulty::Easy,
            _ => Difficulty::Hard,
        },
        settled_error_rad: 0.5 * (roll_rms + pitch_rms),
    }
}

fn timing(flight: &Flight) -> LoopTiming {
    let mut random = ChaCha8Rng::seed_from_u64(8);
    // Median 0.35 ms with a tail that stays below the budget of 10 ms.
    let duration = LogNormal::new(350f64.ln(), 0.3).unwrap();
    LoopTiming {
        measure: "state frame to actuator command".into(),
        budget_us: 10_000.0,
        cycles: flight
            .samples
            .iter()
            .map(|s| Cycle { time_s: s.time_s, duration_us: duration.sample(&mut random) })
            .collect(),
    }
}

fn events() -> Vec<Event> {
    let event = |time_s, kind, text: &str| Event { time_s, kind, text: text.into() };
    vec![
        event(0.0, EventKind::Text, "Armed by system 255"),
        event(0.2, EventKind::Mode, "Hold to Offboard"),
        event(23.0, EventKind::Failsafe, "No state frame for 0.3 s: last command held"),
        event(23.3, EventKind::Text, "State frames are back"),
        event(59.9, EventKind::Mode, "Offboard to Hold"),
    ]
}

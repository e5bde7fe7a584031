//! A made-up comparison: two models with two flights, one of them wrong in ways put in by hand.

use greylag::sysid::compare::answer::{Answer, Seen, Stage, Subject, Way};
use greylag::sysid::compare::forecast::ForecastResult;
use greylag::sysid::compare::{
    Bin, ChannelId, ChannelResult, ChannelTrace, Comparison, FlightResult, FlightTrace,
    GrowthPoint, HorizonScore, Map, MapCell, ModelResult, ModelTrace, NuisanceResult, RegimeBins,
    RegimeVariable, Settings, StateScore,
};

const STEP_S: f64 = 0.01;
const RESTART_S: f64 = 3.0;
const STATES: [&str; 8] = greylag::physics::State::<f64>::NAMES;
/// Size of the errors of the two models, relative to each other.
const ERRORS: [(&str, f64); 2] = [("prior-as-printed", 1.0), ("amended", 0.35)];

/// Two flights of `seconds` at 100 Hz each, with one pause in the second.
pub fn comparison(seconds: f64) -> Comparison {
    let flights: Vec<FlightResult> =
        [("flight-a.csv", 0.0), ("flight-b.ulg", 100.0)].map(|f| flight(f, seconds)).into();
    let models: Vec<ModelResult> = ERRORS.map(|(name, size)| model(name, size, &flights)).into();
    Comparison {
        schema: "greylag.comparison/1",
        program: "greylag 0.1.0".into(),
        seed: 1,
        answer: answer(&models),
        sentences: models[0].sentences.clone(),
        doubtful: Vec::new(),
        models,
        forecasts: vec![ForecastResult {
            name: "hold the state",
            free_run: [1.0, 2.0, 5.0, 10.0].map(|h| score(h, 3.0)).into(),
        }],
        flights,
        settings: Settings {
            start_every_s: RESTART_S,
            horizons_s: vec![1.0, 2.0, 5.0, 10.0],
            divergence_bound: 10.0,
            kernel_s: 0.37,
            block_s: 5.0,
            resamples: 1000,
            support: 20,
        },
        notes: vec!["no stretch of flight is 60 s long: no free run reaches that horizon".into()],
    }
}

/// The answer as `compare` composes it.
fn answer(models: &[ModelResult]) -> Answer {
    let stages = models.iter().enumerate().map(|(k, m)| Stage {
        way: if k == 0 { Way::Given } else { Way::Other },
        model: &m.name,
        scores: &m.free_run,
    });
    Answer::of(&Subject {
        stages: stages.collect(),
        flights: vec!["flight-a.csv".into(), "flight-b.ulg".into()],
        seen: Seen::Unknown,
        effects: Vec::new(),
        baseline: None,
    })
}

fn flight((name, start): (&str, f64), seconds: f64) -> FlightResult {
    let mut trace = FlightTrace::default();
    let steps = (seconds / STEP_S) as usize;
    for step in 0..steps {
        let t = step as f64 * STEP_S;
        trace.time_s.push(start + t);
        let paused = start > 0.0 && step == steps / 3;
        for (k, list) in trace.states.iter_mut().enumerate() {
            list.push(if paused { f64::NAN } else { state(k, t + start) });
        }
        for (k, list) in trace.controls.iter_mut().enumerate() {
            list.push(0.1 * (0.7 * t + k as f64).sin());
        }
    }
    let nuisance = |name: &str, value, sd, unit| NuisanceResult {
        name: name.into(),
        value,
        sd,
        unit,
        prior: Some(0.0),
        prior_sd: Some(1.0),
        moved_sd: Some(value),
    };
    FlightResult {
        name: name.into(),
        step_s: STEP_S,
        samples: steps,
        segments_s: vec![[start, start + seconds]],
        nuisances: vec![
            nuisance("gyro_bias_p", 0.004, 0.0003, "rad/s"),
            nuisance("alpha_bias", 0.0174, 0.0011, "rad"),
            nuisance("airspeed_scale", 1.049, 0.004, ""),
            nuisance("wind_north", -5.9, 0.12, "m/s"),
            nuisance("skew_airspeed", 0.0072, 0.0006, "s"),
        ],
        notes: vec!["no vane: α and β from wind-corrected velocity, with less power".into()],
        trace,
    }
}

/// A state over time, SI.
fn state(k: usize, t: f64) -> f64 {
    let (size, rate, mean) = [
        (0.6, 0.5, 0.0),
        (0.2, 0.31, 0.05),
        (2.0, 0.17, 18.0),
        (0.5, 0.9, 0.0),
        (0.3, 1.1, 0.02),
        (0.2, 0.7, 0.0),
        (0.05, 0.8, 0.05),
        (0.03, 1.3, 0.0),
    ][k];
    mean + size * (rate * t).sin() * (0.8 + 0.2 * (0.013 * t * (k + 1) as f64).cos())
}

fn model(name: &str, size: f64, flights: &[FlightResult]) -> ModelResult {
    let traces = flights.iter().map(|f| ModelTrace {
        states: std::array::from_fn(|k| predicted(k, size, &f.trace)),
        channels: ChannelId::ALL[..6]
            .iter()
            .enumerate()
            .map(|(i, id)| channel_trace(*id, i, size, &f.trace))
            .collect(),
    });
    let channels: Vec<ChannelResult> =
        ChannelId::ALL[..6].iter().enumerate().map(|(i, id)| channel(*id, i, size)).collect();
    ModelResult {
        name: name.into(),
        sentences: channels.iter().take(4).map(|c| capital(&c.worst_regime) + ".").collect(),
        free_run: [1.0, 2.0, 5.0, 10.0].map(|h| score(h, size)).into(),
        known: None,
        growth: (1..=100).map(|i| growth(f64::from(i) * 0.1, size)).collect(),
        channels,
        traces: traces.collect(),
    }
}

/// A channel in windows that overlap by half, 5.4 a second; the pause breaks it.
fn channel_trace(id: ChannelId, index: usize, size: f64, flown: &FlightTrace) -> ChannelTrace {
    let scale = [3.0, 5.0, 1.5, 0.2, 0.3, 0.15][index];
    let rows = || (0..flown.time_s.len()).step_by(18);
    let measured = |i: usize| scale * (1.0 + (0.4 * flown.time_s[i] + index as f64).sin());
    let broken = |i: usize, x: f64| if flown.states[0][i].is_nan() { f64::NAN } else { x };
    ChannelTrace {
        channel: id,
        time_s: rows().map(|i| flown.time_s[i]).collect(),
        measured: rows().map(|i| broken(i, measured(i))).collect(),
        predicted: rows().map(|i| broken(i, measured(i) * (1.0 - 0.3 * size))).collect(),
    }
}

/// What was flown, and an error that grows from zero after each restart and is worse in the middle.
fn predicted(k: usize, size: f64, flown: &FlightTrace) -> Vec<f64> {
    let start = flown.time_s[0];
    let row = |(t, x): (&f64, &f64)| {
        let since = (t - start) % RESTART_S;
        let spread = [0.05, 0.03, 0.3, 0.05, 0.05, 0.03, 0.01, 0.006][k];
        x + size * spread * since * (0.6 + (0.02 * (t - start)).sin())
    };
    flown.time_s.iter().zip(&flown.states[k]).map(row).collect()
}

fn score(horizon_s: f64, size: f64) -> HorizonScore {
    let rmse_scaled = size * 0.06 * horizon_s;
    let state = |(k, state): (usize, &&'static str)| StateScore {
        state,
        rmse: size * horizon_s * [0.01, 0.008, 0.2, 0.03, 0.03, 0.02, 0.006, 0.004][k],
        r2: 1.0 - 0.05 * size * horizon_s,
        rmse_scaled: rmse_scaled * (0.5 + 0.15 * k as f64),
        theil_u: (0.04 * size * horizon_s).min(1.0),
        bias_share: 0.5,
        variance_share: 0.2,
        covariance_share: 0.3,
    };
    HorizonScore {
        horizon_s,
        runs: 38,
        diverged: (size * horizon_s / 4.0) as usize,
        divergence_rate: (size * horizon_s / 4.0).floor() / 38.0,
        rmse_scaled,
        states: STATES.iter().enumerate().map(state).collect(),
    }
}

fn growth(time_s: f64, size: f64) -> GrowthPoint {
    let error = size * 0.06 * time_s.powf(1.2);
    GrowthPoint {
        time_s,
        runs: 38,
        diverged: 0,
        rmse_scaled: error,
        median_scaled: 0.7 * error,
        p90_scaled: 1.8 * error,
    }
}

fn channel(id: ChannelId, index: usize, size: f64) -> ChannelResult {
    let scale = [3.0, 5.0, 1.5, 0.2, 0.3, 0.15][index];
    let regime = match id {
        ChannelId::Drag => {
            "forward force along the flight path (thrust less drag, airspeed channel) is 8.2 ± 0.3 N \
             too low for throttle > 60 %, 140 samples, both flights"
        }
        ChannelId::Lift => "lift is 28 ± 4 % too high for α > 9°, 210 samples, both flights",
        ChannelId::Yaw => {
            "yawing moment is 0.14 ± 0.02 N m too far to the left for aileron > 6°, 96 samples, both flights"
        }
        _ => return plain(id, index, size, scale),
    };
    ChannelResult { worst_regime: regime.into(), ..plain(id, index, size, scale) }
}

fn plain(id: ChannelId, index: usize, size: f64, scale: f64) -> ChannelResult {
    ChannelResult {
        abstained: None,
        channel: id,
        name: id.name(),
        unit: id.unit(),
        windows: 900,
        measured_sd: 2.0 * scale,
        residual_rms: size * scale,
        noise_sd: 0.1 * scale,
        unexplained_fraction: size * size * [0.62, 0.11, 0.035, 0.004, 0.2, 1.4][index],
        effect_per_s: size * 0.2,
        offset_share: 0.2,
        worst_regime: format!("{} is explained: 0.4 % of its variation is left", id.name()),
        regime: None,
        bins: RegimeVariable::CONTINUOUS
            .iter()
            .chain([&RegimeVariable::Flight])
            .enumerate()
            .map(|(k, v)| regime(*v, k, index, size * scale))
            .collect(),
        map: map(size * scale),
    }
}

fn regime(variable: RegimeVariable, k: usize, channel: usize, scale: f64) -> RegimeBins {
    let flight = variable == RegimeVariable::Flight;
    let (first, width) = [
        (-4.0, 3.0),
        (-6.0, 2.0),
        (13.0, 1.5),
        (0.0, 0.15),
        (-60.0, 20.0),
        (-30.0, 10.0),
        (-20.0, 7.0),
        (-15.0, 5.0),
        (-10.0, 4.0),
        (-80.0, 30.0),
        (-60.0, 20.0),
        (580.0, 10.0),
        (0.0, 30.0),
        (-0.5, 1.0),
    ][k];
    let bin = |i: usize| {
        let low = first + width * i as f64;
        let samples = if flight { 300 } else { [6, 40, 150, 190, 120, 35, 9][i] };
        let strength = if k == channel { 1.0 } else { 0.15 };
        let mean = scale * strength * (i as f64 - 3.0) / 3.0 + 0.1 * scale;
        let half = 0.9 * scale / f64::from(samples).sqrt();
        Bin {
            low: if i == 0 && !flight { f64::NAN } else { low },
            high: if i == 6 { f64::NAN } else { low + width },
            center: low + 0.5 * width,
            label: if flight { ["flight-a.csv", "flight-b.ulg"][i].into() } else { String::new() },
            mean,
            interval: [mean - half, mean + half],
            q_value: f64::NAN,
            measured: 10.0 * scale,
            independent: samples as usize,
            supported: samples >= 20,
        }
    };
    RegimeBins {
        variable,
        name: variable.name(),
        unit: variable.unit(),
        explained: if k == channel { 0.6 } else { 0.05 / (k + 1) as f64 },
        bins: (0..if flight { 2 } else { 7 }).map(bin).collect(),
    }
}

fn map(scale: f64) -> Map {
    let mut cells = Vec::new();
    for alpha in 0..10usize {
        for beta in 0..8usize {
            let (x, y) = (alpha as f64 - 4.5, beta as f64 - 3.5);
            let samples = (120.0 * (-(x * x + 1.5 * y * y) / 9.0).exp()) as usize;
            if samples > 0 {
                let mean = scale * (x / 5.0 + 0.05 * y);
                cells.push(MapCell {
                    alpha,
                    beta,
                    mean,
                    independent: samples,
                    supported: samples >= 20,
                });
            }
        }
    }
    Map {
        alpha_deg: (0..=10).map(|i| f64::from(i) * 2.0 - 4.0).collect(),
        beta_deg: (0..=8).map(|i| f64::from(i) * 2.0 - 8.0).collect(),
        cells,
    }
}

fn capital(text: &str) -> String {
    text[..1].to_uppercase() + &text[1..]
}

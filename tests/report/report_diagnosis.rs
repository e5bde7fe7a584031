//! A made-up diagnosis: a stall asserted with a look-alike, one candidate refused, the rest chance.
#![allow(dead_code)] // each test that includes this module uses its part

use greylag::sysid::compare::answer::Acting;
use greylag::sysid::compare::{ChannelId, Comparison};
use greylag::sysid::diagnose::{
    Advice, Candidate, ChannelLeft, Curve, Decoy, Diagnosis, Explained, Explanation,
    FlightEstimate, Measurement, Nulls, Parameter, Settings, Status, Tuned, Verdict,
};

const FLIGHTS: [&str; 3] = ["train-1.csv", "train-2.csv", "train-3.ulg"];

/// Id, description, evidence, threshold, first parameter with its value, half width, unit, smallest
/// amount that would have been seen.
type Row = (&'static str, &'static str, f64, f64, &'static str, f64, f64, &'static str, f64);

const CANDIDATES: [Row; 12] = [
    (
        "lift_stall",
        "Lift falls off beyond the stall angle.",
        143.0,
        12.4,
        "alpha0",
        0.262,
        0.006,
        "rad",
        0.31,
    ),
    (
        "lift_alpha2",
        "Lift curves with the angle of attack.",
        136.0,
        10.9,
        "CLalpha2",
        -2.31,
        0.19,
        "a coefficient, dimensionless",
        0.4,
    ),
    (
        "drag_alpha2",
        "Drag grows with the square of the angle of attack.",
        31.0,
        11.2,
        "CDalpha2",
        0.42,
        0.2,
        "a coefficient, dimensionless",
        0.12,
    ),
    (
        "pitch_break",
        "The pitching moment breaks at high angle of attack.",
        9.1,
        11.8,
        "Cmalpha3",
        -0.8,
        1.1,
        "1/rad³",
        1.4,
    ),
    (
        "unsteady_lift",
        "Lift follows the rate of the angle of attack.",
        6.3,
        13.0,
        "CLalphadot",
        1.2,
        1.9,
        "a coefficient, dimensionless",
        3.2,
    ),
    (
        "thrust_scale",
        "Thrust is another than the model's throughout.",
        4.4,
        9.8,
        "dCp",
        0.02,
        0.04,
        "a coefficient, dimensionless",
        0.06,
    ),
    (
        "motor_torque",
        "The motor's torque rolls the aircraft.",
        2.2,
        9.9,
        "k",
        0.01,
        0.02,
        "N m",
        0.05,
    ),
    ("actuator_lag", "The surfaces follow late.", 1.9, 10.4, "tau", 0.002, 0.006, "s", 0.012),
    ("dead_zone", "Small deflections do nothing.", 0.7, 10.0, "width", 0.001, 0.004, "rad", 0.011),
    (
        "asymmetry",
        "The airframe is not symmetric.",
        -1.2,
        12.0,
        "Cl0",
        0.0002,
        0.0006,
        "a coefficient, dimensionless",
        0.001,
    ),
    (
        "ground_effect",
        "The ground lifts within one span.",
        f64::NAN,
        f64::NAN,
        "k",
        0.0,
        f64::NAN,
        "a coefficient, dimensionless",
        f64::NAN,
    ),
    (
        "cg_shift",
        "The centre of gravity lies elsewhere.",
        -2.5,
        10.8,
        "x",
        0.001,
        0.004,
        "m",
        0.006,
    ),
];

/// Id, kind and probability. What is below 0.5 % is not shown.
const EXPLANATIONS: [(&str, Explained, f64); 3] = [
    ("lift_stall", Explained::Aircraft, 0.932),
    ("nothing", Explained::Nothing, 0.064),
    ("unknown", Explained::Unknown, 0.004),
];

fn explanation((id, kind, probability): (&str, Explained, f64)) -> Explanation {
    Explanation { id: id.into(), kind, probability }
}

fn candidate(
    &(id, description, evidence, threshold, name, value, half, unit, least): &Row,
) -> Candidate {
    let asserted = id == "lift_stall";
    let parameter = |name: &str, value: f64, half: f64, unit: &str| Parameter {
        name: name.into(),
        value,
        ci95: [value - half, value + half],
        unit: unit.into(),
        by_flight: Vec::new(),
    };
    let by_flight = |(i, flight): (usize, &&str)| FlightEstimate {
        flight: (*flight).into(),
        value: value + half * [0.5, -0.7, 0.3][i],
        sd: 0.8 * half,
    };
    let by_flight: Vec<FlightEstimate> = FLIGHTS.iter().enumerate().map(by_flight).collect();
    let mut parameters = vec![parameter(name, value, half, unit)];
    parameters[0].by_flight.clone_from(&by_flight);
    if asserted {
        parameters.push(parameter("M", 52.0, 9.0, "sharpness of the blend"));
    }
    let shown = matches!(id, "lift_stall" | "lift_alpha2" | "drag_alpha2");
    Candidate {
        id: id.into(),
        description,
        asserted,
        status: match id {
            "drag_alpha2" => Status::Refused,
            _ if asserted => Status::Indistinguishable,
            _ => Status::NotShown,
        },
        evidence,
        threshold,
        parameters,
        channels: vec![if id.starts_with("drag") { "D" } else { "L" }.into()],
        acts: match asserted {
            true => {
                vec![acts(ChannelId::Lift, [0.182, 0.016]), acts(ChannelId::Drag, [0.09, 0.02])]
            }
            false => Vec::new(),
        },
        indistinguishable_from: match id {
            "lift_stall" => vec!["lift_alpha2".into()],
            "lift_alpha2" => vec!["lift_stall".into()],
            _ => Vec::new(),
        },
        heldout_error_reduction: if shown { 0.43 } else { f64::NAN },
        selected_in_bootstraps: if asserted { 0.94 } else { f64::NAN },
        by_flight,
        minimum_detectable: least.is_finite().then_some(least),
        refused: match id {
            "drag_alpha2" => {
                vec!["the flights disagree: 0.1 in train-1.csv, 0.7 in train-3.ulg".into()]
            }
            _ => Vec::new(),
        },
        curve: shown.then(|| curve(id)),
    }
}

/// Six minutes of windows, half overlapping: lift that falls short beyond 12°.
fn curve(id: &str) -> Curve {
    let lost = |alpha: f64| match id {
        "lift_stall" => -6.0 * (alpha - 12.0).max(0.0),
        "lift_alpha2" => -0.08 * alpha * alpha,
        _ => 0.02 * alpha * alpha,
    };
    // Scatter without a random number: incommensurable sines.
    let scatter = |i: f64| 2.1 * (1.7 * i).sin() + 1.4 * (2.9 * i + 1.0).sin() * (0.31 * i).cos();
    let x: Vec<f64> = (0..1950).map(|i| 6.0 + 9.5 * (0.37 * f64::from(i)).sin()).collect();
    let residual =
        x.iter().enumerate().map(|(i, a)| -6.0 * (a - 12.0f64).max(0.0) + scatter(i as f64));
    let at: Vec<f64> = (0..60).map(|i| -3.5 + 19.0 * f64::from(i) / 59.0).collect();
    let contribution = at
        .iter()
        .map(|a| {
            let half = 0.15 + 0.25 * (a - 9.0f64).max(0.0);
            [lost(*a), lost(*a) - half, lost(*a) + half]
        })
        .collect();
    Curve {
        channel: if id.starts_with("drag") { "D" } else { "L" }.into(),
        variable: "angle of attack (°)".into(),
        unit: "N".into(),
        residual: residual.collect(),
        x,
        at,
        contribution,
    }
}

/// A channel with its unexplained shares, without and with the effects.
fn acts(channel: ChannelId, [tuned, after]: [f64; 2]) -> Acting {
    Acting { channel, name: channel.name(), given: None, tuned: Some(tuned), after }
}

/// Three flights diagnosed.
pub fn diagnosis() -> Diagnosis {
    let left = |(channel, tuned, with): (&str, f64, f64)| ChannelLeft {
        channel: channel.into(),
        tuned_unexplained_fraction: tuned,
        unexplained_fraction: with,
        worst_regime: match channel {
            "L" => Some("lift is 24 ± 3 % too high for α > 12°, 96 samples, all 3 flights".into()),
            _ => None,
        },
        left_with: (channel == "L").then(|| "α²".into()),
        abstained: channel == "n",
        why_abstained: (channel == "n").then(|| "these flights do not move it".into()),
    };
    let measured = |flight: &str, id: &str, value, sd, unit: &str, asserted| Measurement {
        flight: flight.into(),
        id: id.into(),
        name: id.into(),
        value,
        sd,
        unit: unit.into(),
        asserted,
    };
    let tuned = |(i, name): (usize, &&str)| {
        let prior = [0.0254, 3.87, -0.46, 0.35, 4.02, -0.73, -1.3, 0.28][i];
        let prior_sd = 0.15 * f64::abs(prior);
        let pull = [0.4, -0.2, 1.1, -0.8, 2.6, 0.1, -1.4, 0.6][i];
        let value = prior + pull * prior_sd;
        Tuned { name: (*name).into(), prior, prior_sd, value, sd: prior_sd * 0.2 }
    };
    let names = [
        "drag_linear.CD0",
        "lift_linear.CLq",
        "pitch_linear.Cmalpha",
        "drag_linear.CDalpha",
        "lift_linear.CLalpha",
        "roll_linear.Clp",
        "pitch_linear.Cmq",
        "lift_linear.CLde",
    ];
    Diagnosis {
        explanations: EXPLANATIONS.map(explanation).into(),
        schema: "greylag.diagnosis/1",
        version: "0.1.0",
        model: "prior".into(),
        verdict: Verdict::Effect,
        sentences: vec![
            "The model lacks lift_stall (lift falls off beyond the stall angle): alpha0 is 15.0 ± 0.3°, \
             and it explains 91 % of what the tuned model leaves in lift."
                .into(),
            "These flights cannot tell lift_stall from lift_alpha2; a slow deceleration to the stall would."
                .into(),
            "drag_alpha2 stands above chance and is refused, for the flights disagree on it.".into(),
            "All else in the catalogue shows no more than chance.".into(),
        ],
        doubtful: Vec::new(),
        effects: CANDIDATES.iter().map(candidate).collect(),
        channels: [
            ("D", 0.031, 0.024),
            ("L", 0.182, 0.016),
            ("Y", 0.004, 0.004),
            ("l", 0.006, 0.006),
            ("m", 0.012, 0.011),
            ("n", f64::NAN, f64::NAN),
        ]
        .map(left)
        .into(),
        measurement: vec![
            measured("train-1.csv", "alpha_bias", 0.0174, 0.0011, "rad", true),
            measured("train-1.csv", "airspeed_scale", 1.002, 0.003, "", false),
            measured("train-2.csv", "wind_north", -5.9, 0.12, "m/s", true),
        ],
        trims: Vec::new(),
        tuned: names.iter().enumerate().map(tuned).collect(),
        advice: vec![
            Advice {
                manoeuvre: "Decelerate from 18 m/s to the stall with throttle idle, wings level, twice"
                    .into(),
                why: "separates lift_stall from lift_alpha2 (expected evidence 60 in 40 s)".into(),
                between: Some(["lift_stall".into(), "lift_alpha2".into()]),
            },
            Advice {
                manoeuvre: "Throttle steps at three speeds".into(),
                why: "would show thrust_decay from 0.08 on".into(),
                between: None,
            },
        ],
        nulls: Nulls {
            count: 100,
            best: (0..100).map(|i| 13.5 * (f64::from(i) / 99.0).powf(2.2) - 0.4).collect(),
            level: 0.01,
        },
        decoys: (0..10)
            .map(|i| Decoy {
                name: format!("{} reversed in time", CANDIDATES[i].0),
                evidence: 7.5 / (i + 1) as f64,
            })
            .collect(),
        learnable_remainder: 0.08,
        notes: vec!["train-3.ulg has no vane: its α and β count for less".into()],
        settings: Settings {
            seed: 1,
            nulls: 100,
            bootstraps: 50,
            without: vec!["ground_effect".into()],
            per_flight: Default::default(),
        },
    }
}

/// As given, tuned, and with the effect, on the flights of `comparison`, whose two models it takes.
pub fn held_out(mut comparison: Comparison) -> Comparison {
    let tuned = comparison.models[0].clone();
    comparison.models.insert(1, tuned);
    // The tuned model errs half as much as the one given.
    for score in &mut comparison.models[1].free_run {
        score.rmse_scaled *= 0.5;
    }
    for point in &mut comparison.models[1].growth {
        point.rmse_scaled *= 0.5;
        point.median_scaled *= 0.5;
    }
    for channel in &mut comparison.models[1].channels {
        channel.unexplained_fraction *= 0.5;
    }
    let names = ["prior", "prior, tuned", "prior, tuned, with lift_stall"];
    comparison.models.iter_mut().zip(names).for_each(|(m, name)| m.name = name.into());
    comparison
        .flights
        .iter_mut()
        .zip(["test-1.csv", "test-2.csv"])
        .for_each(|(f, n)| f.name = n.into());
    comparison
}

//! A made-up amendment: a stall added, another effect refused.

use greylag::sysid::amend::{
    AddedEffect, Amendment, FittedFlight, FlightEstimate, Parameter, Settings,
};
use greylag::sysid::compare::HorizonScore;
use greylag::sysid::compare::answer::{Answer, Seen, Stage, Subject, Way};

const FLIGHTS: [&str; 2] = ["train-1.csv", "train-2.csv"];

fn scores(size: f64) -> Vec<HorizonScore> {
    let score = |horizon_s: f64| HorizonScore {
        horizon_s,
        runs: 38,
        diverged: 0,
        divergence_rate: 0.0,
        rmse_scaled: size * horizon_s,
        states: Vec::new(),
    };
    [1.0, 2.0, 5.0, 10.0].map(score).into()
}

fn parameter(name: &str, added: bool, [prior, prior_sd, value, sd]: [f64; 4]) -> Parameter {
    let by_flight = |(i, flight): (usize, &&str)| FlightEstimate {
        flight: (*flight).into(),
        value: value + sd * [0.8, -0.8][i],
        sd: 1.4 * sd,
    };
    Parameter {
        name: name.into(),
        meaning: "a made-up coefficient, dimensionless",
        added,
        prior,
        prior_sd,
        value,
        sd,
        ci95: [value - 1.96 * sd, value + 1.96 * sd],
        at_bound: name == "lift_stall.M",
        by_flight: if added {
            FLIGHTS.iter().enumerate().map(by_flight).collect()
        } else {
            Vec::new()
        },
        same_as: None,
    }
}

/// The answer as an amendment has it.
fn answer() -> Answer {
    let scores = [scores(0.06), scores(0.03), scores(0.007)];
    let ways = [Way::Given, Way::Tuned, Way::Effects];
    let stage = |(way, scores)| Stage { way, model: "prior", scores };
    Answer::of(&Subject {
        stages: ways.into_iter().zip(scores.iter().map(Vec::as_slice)).map(stage).collect(),
        flights: vec!["test-1.csv".into()],
        seen: Seen::Of(0),
        effects: Vec::new(),
        baseline: None,
    })
}

/// Two flights fitted, two held out.
pub fn amendment() -> Amendment {
    Amendment {
        schema: "greylag.amend/1",
        version: "0.1.0",
        model: "prior".into(),
        answer: answer(),
        sentences: vec![
            "With lift_stall the error after 5 s falls from 0.15 to 0.035 on flights that the fit never saw."
                .into(),
            "drag_alpha2 was refused: it does not lower the error on flights unseen.".into(),
        ],
        effects: vec![
            AddedEffect {
                id: "lift_stall".into(),
                description: "Lift falls off beyond the stall angle.",
                joined: true,
                refused: Vec::new(),
                fly_next: String::new(),
            },
            AddedEffect {
                id: "drag_alpha2".into(),
                description: "Drag grows with the square of the angle of attack.",
                joined: false,
                refused: vec!["it lowers the error on flights unseen by 2 % only".into()],
                fly_next: "a push-over at fixed elevator".into(),
            },
        ],
        conventions: Vec::new(),
        parameters: vec![
            parameter("lift_linear.CLalpha", false, [4.02, 0.6, 4.4, 0.05]),
            parameter("drag_linear.CD0", false, [0.0254, 0.004, 0.0381, 0.0004]),
            parameter("lift_stall.alpha0", true, [0.3, 0.2, 0.262, 0.003]),
            parameter("lift_stall.M", true, [50.0, 40.0, 200.0, 30.0]),
        ],
        tuned: Vec::new(),
        flights: FLIGHTS
            .map(|flight| FittedFlight {
                flight: flight.into(),
                seconds: 60.0,
                actuators_late_s: [0.007, 0.0004],
                airspeed_scale: [0.01, 0.002],
                alpha_bias_rad: [0.002, 0.001],
                beta_bias_rad: [0.0, 0.001],
                own: Vec::new(),
            })
            .into(),
        held_out: vec!["test-1.csv".into(), "test-2.csv".into()],
        given: scores(0.06),
        before: scores(0.03),
        after: scores(0.007),
        decrease: Some([1.45, 0.21]),
        notes: vec!["train-2.csv has no vane".into()],
        settings: Settings {
            lengths_s: vec![1.0, 5.0],
            horizons_s: vec![1.0, 2.0, 5.0, 10.0],
            judged_at_s: 5.0,
            per_flight: Default::default(),
        },
    }
}

//! Tests of the ARX forecast on flights whose pitch rate follows a linear second-order recursion.

use super::*;
use crate::compare::free_run::End;
use crate::flight_path::reconstruction::{Reconstruction, Segment};
use greylag_physics::{Controls, State};

/// Time between samples, s.
const DT: f64 = 0.01;

/// A flight of `samples` samples with a random elevator δ, in which nothing moves but the pitch rate:
/// q(k + 1) = 1.6 q(k) − 0.8 q(k − 1) − 0.2 δ(k).
fn second_order(samples: usize, seed: u64) -> Prepared {
    let mut random = greylag_num::stream::stream(seed, &[]);
    let (mut q, mut before) = (0.0, 0.0);
    let instant = |k: usize| {
        let elevator: f64 = rand::RngExt::random_range(&mut random, -0.1..0.1);
        let now = Instant {
            time_s: DT * k as f64,
            state: State { q, ..State::NEUTRAL },
            yaw: f64::NAN,
            controls: Controls { elevator, throttle: 0.1, ..Controls::default() },
            command: None,
            specific_force: [f64::NAN; 3],
            altitude: 600.0,
            density: 1.15,
        };
        (q, before) = (1.6 * q - 0.8 * before - 0.2 * elevator, q);
        now
    };
    let segments = vec![Segment { instants: (0..samples).map(instant).collect() }];
    let flight = Reconstruction { segments, ..Reconstruction::empty("f") };
    Prepared::new(&flight, 5.0).unwrap()
}

fn of_order(order: usize) -> Choice {
    Choice { order, ridge: 0.0 }
}

#[test]
fn a_second_order_flight_is_predicted_by_order_two_which_is_chosen() {
    let flights = [1, 2, 3].map(|seed| second_order(1500, seed));
    let (seen, unseen) = flights.split_at(2);
    let error = |order: usize| {
        let arx = Arx::fit(seen, of_order(order)).unwrap();
        arx.scores(unseen, [1.0; 8], &[1.0, 5.0]).unwrap()[1].rmse_scaled
    };
    // the pitch rate varies by 0.04 rad/s; numpy gives errors of 0.010 and 1e-16 for the same two fits
    let [first, second] = [1, 2].map(error);
    assert!(first > 1e-3 && second < 1e-8, "{first} {second}");
    assert_eq!(choose(&flights, [1.0; 8], &[1.0, 5.0]), Ok(of_order(2)));
}

#[test]
fn a_free_run_is_the_recursion_by_hand() {
    let flight = second_order(40, 1);
    let segment = &flight.segments[0];
    // states are in the columns 0 to 7, deflections in 8 to 11, both of the sample before in 12 to 23, the constant in 24
    let (q, elevator): (usize, usize) = (4, 9);
    let mut slopes = DMatrix::<f64>::zeros(8, 25);
    slopes[(q, q)] = -3.0;
    slopes[(q, elevator)] = -5.0;
    slopes[(q, OF_SAMPLE + q)] = 1.0;
    slopes[(q, OF_SAMPLE + elevator)] = 2.0;
    slopes[(q, 24)] = 0.1;
    let arx = Forecast::Linear(Arx { order: 2, substeps: flight.substeps, slopes });
    let recorded = |k: usize| (segment[k].state.q, segment[k].controls.elevator);
    // no sample precedes sample 0: in the run from there, sample 0 also serves as the preceding sample
    for start in [0_usize, 5] {
        let (mut now, mut last) = (recorded(start).0, recorded(start.saturating_sub(1)).0);
        let mut by_hand = Vec::new();
        for k in start..start + 3 {
            let (present, before) = (recorded(k).1, recorded(k.saturating_sub(1)).1);
            let rate = -3.0 * now + last - 5.0 * present + 2.0 * before + 0.1;
            (now, last) = (now + DT * rate, now);
            by_hand.push(now);
        }
        let (looks, _) = arx.run(segment, DT, start, &[1, 3], (&[1.0; 8], End::Wrong));
        let flown: Vec<f64> = looks.iter().map(|look| look.unwrap()[1][q]).collect();
        let expected = [by_hand[0], by_hand[2]];
        assert_eq!(flown.len(), 2);
        for (a, b) in flown.iter().zip(expected) {
            assert!((a - b).abs() < 1e-12, "from {start}: {flown:?}, {expected:?}");
        }
    }
}

#[test]
fn roll_is_continuous_in_the_past() {
    let mut flight = second_order(4, 1);
    let segment = &mut flight.segments[0];
    for (instant, degrees) in segment.iter_mut().zip([178.0_f64, 179.0, -180.0, -179.0]) {
        instant.state.roll = degrees.to_radians();
    }
    let roll: Vec<f64> = past(segment, 3, 5).iter().map(|s| s[0].to_degrees()).collect();
    for (found, expected) in roll.iter().zip([-179.0, -180.0, -181.0, -182.0, -182.0]) {
        assert!((found - expected).abs() < 1e-9, "{roll:?}");
    }
}

#[test]
fn too_little_data_is_an_error() {
    let short = [second_order(20, 1), second_order(20, 2)];
    // twelve of twenty samples have seven before them and one after them
    let why = Arx::fit(&short[..1], of_order(8)).unwrap_err();
    assert_eq!(why, ArxError::TooLittle { order: 8, rows: 12, needed: 97 });
    assert!(why.to_string().contains("12 steps between samples for 97 unknowns"), "{why}");
    let none = Arx::fit(&[], of_order(1)).unwrap_err();
    assert_eq!(none, ArxError::TooLittle { order: 1, rows: 0, needed: 13 });
    assert_eq!(Arx::fit(&short, of_order(0)).unwrap_err(), ArxError::NoOrder);
    let alone = choose(&short[..1], [1.0; 8], &[1.0]);
    assert_eq!(alone, Err(ArxError::TooFewFlights { flights: 1 }));
    // 0.2 s are shorter than the horizon
    let why = choose(&short, [1.0; 8], &[5.0, 1.0]);
    assert_eq!(why, Err(ArxError::TooShort { flights: 2, shortest_s: 1.0 }));
}

#[test]
fn flights_sampled_otherwise_are_refused() {
    let flight = second_order(200, 1);
    let slow = flight.every_other();
    let why = ArxError::Steps { one: flight.substeps, other: 2 * flight.substeps };
    let both = [flight.clone(), slow.clone()];
    assert_eq!(Arx::fit(&both, of_order(2)).unwrap_err(), why);
    assert_eq!(choose(&both, [1.0; 8], &[1.0]), Err(why.clone()));
    let arx = Arx::fit(&[flight], of_order(2)).unwrap();
    assert_eq!(arx.scores(&[slow], [1.0; 8], &[1.0]).unwrap_err(), why);
}

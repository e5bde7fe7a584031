//! Tests of the table of a binary log.

use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, standard_density};

use super::*;
use crate::stretches::Keep;

/// The altitude has a gap from 4 to 7 s, and ends before the airspeed does.
#[test]
fn without_an_altitude_the_last_one_makes_the_airspeed_true() {
    let topic = |field: &str, every: u32, value: f64| {
        let mut topic = Topic::new([field], Keep::All);
        for k in (0..500).step_by(every as usize) {
            if every == 1 || !(200..350).contains(&k) {
                topic.push(0.02 * f64::from(k), &[value]);
            }
        }
        topic
    };
    let mut topics = Topics::default();
    for (name, field, every, value) in
        [("ATT", "Roll", 1, 0.1), ("ARSP", "Airspeed", 1, 20.0), ("POS", "Alt", 5, 2000.0)]
    {
        topics.topics.insert((name.to_owned(), 0), topic(field, every, value));
    }
    let rules = [
        Rule::linear("roll_rad", "ATT", "Roll", 1.0),
        Rule::linear("airspeed_mps", "ARSP", "Airspeed", 1.0).equivalent(),
        Rule::linear("altitude_m", "POS", "Alt", 1.0),
    ];
    let rows = build(&topics, &rules, &[]).rows;
    let right = 20.0 * (SEA_LEVEL_DENSITY / standard_density(2000.0)).sqrt();
    assert!(rows.iter().all(|row| (row.airspeed_mps - right).abs() < 1e-9));
    assert!(rows.len() == 500 && rows.iter().any(|row| row.altitude_m.is_nan()));
}

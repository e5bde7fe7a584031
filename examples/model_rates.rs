//! Prints the rates of a model with their exact derivatives at random points, one JSON object per line:
//! `model_rates MODEL.toml COUNT`. Other implementations of the model can be checked against these values.

use std::path::Path;

use greylag::model::{GreyBox, Twin};
use greylag::num::{Dual, Real, stream};
use greylag::physics::atmosphere::STANDARD_GRAVITY;
use greylag::physics::{Controls, State};
use rand::RngExt;

/// Number of variables: the eight states, then aileron and elevator (rad) and throttle.
const VARIABLES: usize = 11;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let (path, count) = words.next().zip(words.next()).ok_or("name a model file and a count")?;
    let model = GreyBox::load(Path::new(&path))?;
    let altitude = model.airframe.reference.altitude;
    for number in 0..count.parse::<u64>()? {
        let mut random = stream::stream(1, &[number]);
        let mut draw = |size: f64| random.random_range(-size..size);
        let v0 = model.airframe.reference.airspeed;
        let around = [0.0, 0.0, 1.2 * v0, 0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.5];
        let by = [1.0, 0.5, 0.4 * v0, 2.0, 1.5, 1.0, 0.15, 0.15, 0.4, 0.4, 0.5];
        let point: [f64; VARIABLES] = std::array::from_fn(|k| around[k] + draw(by[k]));
        let split = |v: [Dual<VARIABLES>; VARIABLES]| {
            let [s @ .., aileron, elevator, throttle] = v;
            let rudder = Dual::from_f64(0.0);
            (State::from_array(s), Controls { aileron, elevator, throttle, rudder, lagged: None })
        };
        let (state, controls) = split(std::array::from_fn(|k| Dual::variable(point[k], k)));
        let rate = model.rate(&state, &controls, altitude).to_array();
        let here = Controls {
            aileron: point[8],
            elevator: point[9],
            throttle: point[10],
            ..Controls::default()
        };
        let (state, _) = point.split_at(8);
        let state: [f64; 8] = state.try_into()?;
        let force = Twin::at_rest(State::from_array(state), &here, altitude).specific_force(&model);
        let line = serde_json::json!({
            "state": state,
            "controls": &point[8..],
            "rate": rate.map(|x| x.value),
            "jacobian": rate.map(|x| x.gradient),
            "load_factor": -force[2] / STANDARD_GRAVITY,
        });
        println!("{line}");
    }
    Ok(())
}

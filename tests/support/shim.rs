//! The shim on a thread of its own, and how well an attitude was held.
#![allow(dead_code)] // each test that includes this module uses its part

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use greylag::logs::Sample;
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{self, ShimOptions};
use mavlink::dialects::ardupilotmega::*;

/// The shim on a thread of its own.
pub struct Shim {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<shim::Summary>,
    told: Arc<Mutex<Vec<String>>>,
}

impl Shim {
    pub fn start(
        link: &str,
        pace: shim::Pace,
        duration_s: f64,
        change: impl FnOnce(&mut ShimOptions),
    ) -> Self {
        let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
        options.link = link.parse().unwrap();
        (options.pace, options.duration_s) = (pace, Some(duration_s));
        change(&mut options);
        let stop = Arc::new(AtomicBool::new(false));
        let told = stop.clone();
        let notices = Arc::new(Mutex::new(Vec::new()));
        let heard = notices.clone();
        let thread = std::thread::spawn(move || {
            let mut hear = |notice: shim::Notice| {
                heard.lock().unwrap().push(notice.event.to_string());
            };
            shim::run(&options, &told, &mut hear).unwrap()
        });
        Shim { stop, thread, told: notices }
    }

    pub fn is_flying(&self) -> bool {
        !self.thread.is_finished()
    }

    /// What the shim has told so far.
    pub fn told(&self) -> Vec<String> {
        self.told.lock().unwrap().clone()
    }

    pub fn end(self) -> shim::Summary {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// Mean of roll and pitch RMSE over samples, degrees.
pub fn error_deg(samples: &[Sample], (roll, pitch): (f64, f64)) -> f64 {
    let rmse = |axis: usize, wanted: f64| {
        let sum: f64 =
            samples.iter().map(|s| (s.attitude_rad[axis].to_degrees() - wanted).powi(2)).sum();
        (sum / samples.len() as f64).sqrt()
    };
    (rmse(0, roll) + rmse(1, pitch)) / 2.0
}

/// PARAM_SET of a real parameter.
pub fn parameter(name: &str, value: f32) -> MavMessage {
    MavMessage::PARAM_SET(PARAM_SET_DATA {
        param_value: value,
        target_system: 1,
        target_component: 1,
        param_id: name.into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    })
}

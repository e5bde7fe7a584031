//! Steps the aircraft frame by frame: held at its start before launch, simulated after launch.

use std::collections::VecDeque;

use super::error::ShimError;
use super::options::{Launch, Pace, ShimOptions};
use super::sensors::Sensors;
use super::telemetry::{FRAME_US, StateFrame};
use super::truth_log::TruthLog;
use crate::plant::{Inputs, Plant, Travel, Truth};

/// Why a flight is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// The requested duration has been flown.
    Duration,
    /// The aircraft has reached sea level.
    Ground,
}

/// The plant with its clock, sensors and truth file.
pub struct Flight {
    plant: Plant,
    travel: Travel,
    sensors: Sensors,
    log: Option<TruthLog>,
    /// States not yet sent, oldest first; the last is the present state.
    pending: VecDeque<(u64, Truth)>,
    /// Number of steps by which the plant runs ahead of the state that is sent.
    ahead: usize,
    time_us: u64,
    launched: bool,
    flown: u64,
    last: Option<u64>,
    home_m: f64,
}

impl Flight {
    /// Builds the plant and puts it at its start.
    pub fn new(options: &ShimOptions) -> Result<Self, ShimError> {
        let mut plant = Plant::new(&options.plant)?;
        let travel = plant.travel()?;
        let start = plant.reset(&options.start)?;
        let ahead = match options.pace {
            Pace::RealTime => 0,
            Pace::Lockstep => (options.faults.delay_ms * 1e3 / FRAME_US as f64).ceil() as usize,
        };
        let zero = (options.clock_start_s * 1e6) as u64 / FRAME_US * FRAME_US;
        // Time 0 is never sent: an answer with the echo 0 answers no frame.
        let pending: VecDeque<_> =
            (1..=ahead as u64 + 1).map(|k| (zero + k * FRAME_US, start)).collect();
        let steps = |seconds: f64| (seconds * 1e6 / FRAME_US as f64).round().max(1.0) as u64;
        Ok(Flight {
            plant,
            travel,
            sensors: Sensors::new(options.noise, options.bias, options.seed),
            log: options
                .truth
                .as_ref()
                .map(|t| TruthLog::create(t, FRAME_US as f64 * 1e-6, &travel))
                .transpose()?,
            time_us: zero + (ahead as u64 + 1) * FRAME_US,
            pending,
            ahead,
            launched: options.launch == Launch::Immediate,
            flown: 0,
            last: options.duration_s.map(steps),
            home_m: start.altitude_m,
        })
    }

    /// The time of the frame that is due, µs.
    pub fn shown_us(&self) -> u64 {
        self.time_us - self.ahead as u64 * FRAME_US
    }

    /// Travel of the aircraft's surfaces.
    pub fn travel(&self) -> Travel {
        self.travel
    }

    /// Notes on the aircraft, one sentence each.
    pub fn notes(&self) -> Vec<String> {
        self.plant.notes()
    }

    /// Altitude of the start above mean sea level, m.
    pub fn home_m(&self) -> f64 {
        self.home_m
    }

    /// Whether the aircraft has been launched.
    pub fn is_launched(&self) -> bool {
        self.launched
    }

    /// Simulated time since launch, s.
    pub fn flown_s(&self) -> f64 {
        self.flown as f64 * FRAME_US as f64 * 1e-6
    }

    /// Releases the aircraft from its start.
    pub fn launch(&mut self) {
        self.launched = true;
    }

    /// Measures the state that is due; returns its frame and the measurement.
    pub fn measure(&mut self) -> (StateFrame, Truth) {
        let (time_us, truth) = self.pending.front().copied().unwrap_or_default();
        let measured = self.sensors.measure(&truth);
        (StateFrame::new(time_us, &measured, self.travel), measured)
    }

    /// Advances by one frame, with a plant step at `inputs` if launched. Returns why the flight is over; `None` if it
    /// continues.
    pub fn advance(&mut self, inputs: Inputs) -> Result<Option<Over>, ShimError> {
        let mut truth = self.pending.back().map_or_else(Truth::default, |(_, truth)| *truth);
        if self.launched {
            if let Some(log) = &mut self.log {
                log.row(self.time_us, &truth, inputs)?;
            }
            truth = self.plant.step(inputs)?;
            self.flown += 1;
        }
        self.time_us += FRAME_US;
        self.pending.pop_front();
        self.pending.push_back((self.time_us, truth));
        if truth.altitude_m <= 0.0 {
            return Ok(Some(Over::Ground));
        }
        Ok(self.last.filter(|&last| self.flown >= last).map(|_| Over::Duration))
    }

    /// Writes the buffered rows to the truth file.
    pub fn finish(&mut self) -> Result<(), ShimError> {
        self.log.as_mut().map_or(Ok(()), TruthLog::finish)
    }
}

//! The profile `sitl` without link or clock: bytes in, bytes out, one step per call.

use super::answer::Answer;
use super::codec::{Encoder, HilActuatorControls, Parser};
use super::distortion::{Distorter, Distortion};
use super::error::ShimError;
use super::flight::{Flight, Over};
use super::options::ShimOptions;
use super::session::{COMPANION, SHIM};
use super::telemetry::{StateFrame, encode_slow};
use crate::plant::{Inputs, Truth};

/// Largest age of an answer that is used, µs; the same limit as in real time.
const STALE_US: u64 = 500_000;

/// The shim without link and clock, for in-process tests. As in real time, a step uses the newest answer that arrived before it.
/// Without a new answer, the last command holds.
pub struct Bench {
    flight: Flight,
    parser: Parser,
    encoder: Encoder,
    distorter: Distorter,
    newest: Option<Answer>,
    /// Newest frame time that the companion has answered, µs.
    answered_us: u64,
    shown_us: u64,
    measured: Truth,
    inputs: Inputs,
}

impl Bench {
    /// Puts the aircraft at its start.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded or started, or a file of the options cannot be used.
    pub fn new(options: &ShimOptions) -> Result<Self, ShimError> {
        let (measured, inputs) = (Truth::default(), Inputs::default());
        Ok(Bench {
            flight: Flight::new(options)?,
            parser: Parser::default(),
            encoder: Encoder::new(SHIM.0, SHIM.1),
            distorter: Distorter::default(),
            newest: None,
            answered_us: 0,
            shown_us: 0,
            measured,
            inputs,
        })
    }

    /// Sets the sensor distortion from the next frame on.
    pub fn distort(&mut self, distortion: Distortion) {
        self.distorter.now = distortion;
    }

    /// Appends a state frame and the other messages that are due.
    pub fn show(&mut self, out: &mut Vec<u8>) {
        let (frame, measured) = self.flight.measure();
        self.measured = measured;
        let (time_us, shown) = self.distorter.apply(frame.time_us, measured);
        self.shown_us = time_us;
        encode_slow(time_us, &shown, self.flight.home_m(), &mut self.encoder, out);
        StateFrame::new(time_us, &shown, self.flight.travel()).encode(&mut self.encoder, out);
    }

    /// Parses received bytes and keeps the newest valid answer of the companion.
    pub fn receive(&mut self, bytes: &[u8]) {
        let mut frames = Vec::new();
        self.parser.stream(bytes, &mut |frame| frames.push(frame));
        for frame in frames.iter().filter(|f| (f.system, f.component) == COMPANION) {
            let message = frame.decode::<HilActuatorControls>();
            let Some(answer) = message.and_then(|m| Answer::read(&m)) else { continue };
            let age = self.shown_us.saturating_sub(answer.echo_us);
            // After the clock was set back, answers with earlier times count as new.
            let newer = answer.echo_us > self.answered_us || self.shown_us < self.answered_us;
            if answer.echo_us <= self.shown_us && age <= STALE_US && newer {
                self.answered_us = answer.echo_us;
                self.newest = Some(answer);
            }
        }
    }

    /// Makes one step with the newest answer. Returns why the flight is over; `None` if it continues.
    ///
    /// # Errors
    /// If the plant cannot be stepped, or the truth file cannot be written.
    pub fn fly(&mut self) -> Result<Option<Over>, ShimError> {
        if let Some(answer) = self.newest.take() {
            self.inputs = answer.inputs;
            if answer.armed && !self.flight.is_launched() {
                self.flight.launch();
            }
        }
        self.flight.advance(self.inputs)
    }

    /// Last measurement, before the distortion.
    pub fn measured(&self) -> Truth {
        self.measured
    }

    /// The present command of the actuators.
    pub fn inputs(&self) -> Inputs {
        self.inputs
    }
}

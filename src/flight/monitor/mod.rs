//! The model monitor compares accelerations measured in flight with the model's predictions, and warns of deviations.
//!
//! There are six channels: the specific force along each body axis and the angular acceleration about each. The residual of a
//! channel is the measurement minus the prediction at the measured state and surfaces. The half width of its band is two
//! standard deviations of the prediction. This standard deviation combines those of the model's coefficients (15 % if the model
//! file states none) and those of the measured inputs. Without incidence vanes it includes the effect of gusts. A channel is
//! reported once its smoothed residual has been outside the band for 2 s. It is reported again only after the residual has
//! stayed below 0.7 of the half width for 5 s. Deviations of several channels of one plane of motion (longitudinal or lateral)
//! within 20 s are attributed to one cause and reported once.
//!
//! The monitor does not influence the commands.

mod channel;
mod prediction;
mod watch;

pub use channel::{Channel, Warning};
use prediction::{Predictor, Six};
use watch::Watch;

use greylag_link::vehicle::{Faults, Telemetry};
use greylag_model::GreyBox;
use greylag_physics::{State, Time};

/// Sample intervals over which body rates may be differenced, s.
const STEPS_S: std::ops::RangeInclusive<f64> = 0.002..=0.05;
/// Deviations in one plane of motion within this time are attributed to one cause, s.
const ONE_CAUSE_S: f64 = 20.0;
/// The monitor compares only above this fraction of the envelope's smallest airspeed.
const SLOWEST: f64 = 0.8;

/// Measurement and prediction of one channel: m/s² for specific forces, rad/s² for angular accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Compared {
    /// Measured value. A specific force is the value at the sample. An angular acceleration is the mean over the step before
    /// the sample.
    pub measured: f64,
    /// Value that the model predicts.
    pub predicted: f64,
    /// Half width of the band about the prediction: two standard deviations.
    pub band: f64,
}

/// Monitor of one aircraft against one model.
#[derive(Clone, Debug)]
pub struct Monitor {
    predictor: Predictor,
    slowest: f64,
    last: Option<Seen>,
    /// Whether each channel was compared at the last state. Otherwise its residual is unknown.
    compared: [bool; 6],
    /// Measured and predicted values at the last comparison.
    values: [[f64; 2]; 6],
    watches: [Watch; 6],
    /// Time of the last report in the longitudinal and the lateral plane.
    reported: [Option<Time>; 2],
}

/// The previous sample.
#[derive(Clone, Copy, Debug)]
struct Seen {
    time: Time,
    state: State,
    predicted: Six,
}

impl Monitor {
    /// A monitor with `model` for its predictions.
    pub fn new(model: GreyBox) -> Self {
        let slowest = SLOWEST * model.airframe.envelope.airspeed_min_mps;
        let predictor = Predictor::new(model);
        Monitor {
            predictor,
            slowest,
            last: None,
            compared: [false; 6],
            values: [[f64::NAN; 2]; 6],
            watches: [Watch::default(); 6],
            reported: [None; 2],
        }
    }

    /// Compares the accelerations measured in `frame` with the predictions. If deviations are due for a report, returns a
    /// warning for the channel that deviates most. Nothing is compared at the first state after a gap, nor at an unusable state
    /// and the first one after it. The function allocates no memory.
    pub fn see(&mut self, frame: &Telemetry) -> Option<Warning> {
        self.compared = [false; 6];
        if frame.faults != Faults::NONE
            || frame.state.airspeed.is_nan()
            || frame.state.airspeed < self.slowest
        {
            self.last = None;
            return None;
        }
        let predicted = self.predictor.mean(frame);
        let now = Seen { time: frame.time, state: frame.state, predicted };
        let before = self.last.replace(now)?;
        let dt = now.time.since(before.time).as_secs_f64();
        if !STEPS_S.contains(&dt) {
            return None;
        }
        self.compare(frame, &before, &predicted, dt);
        self.due(now.time)
    }

    /// Forgets residuals and earlier reports, for instance when another pilot takes control.
    pub fn forget(&mut self) {
        (self.last, self.compared) = (None, [false; 6]);
        self.watches = [Watch::default(); 6];
        self.reported = [None; 2];
    }

    /// Smoothed residuals divided by the half widths of their bands, in the order of [`Channel::ALL`]. Outside −1..1 a residual
    /// is outside its band. NaN for a channel that could not be compared at the last state.
    pub fn shares(&self) -> Six {
        std::array::from_fn(|k| if self.compared[k] { self.watches[k].share() } else { f64::NAN })
    }

    /// Measurements and predictions at the last state, in the order of [`Channel::ALL`]; `None` for a channel that could not
    /// be compared there.
    pub fn channels(&self) -> [Option<Compared>; 6] {
        std::array::from_fn(|k| {
            let [measured, predicted] = self.values[k];
            self.compared[k].then(|| Compared { measured, predicted, band: self.watches[k].band() })
        })
    }

    fn compare(&mut self, frame: &Telemetry, before: &Seen, predicted: &Six, dt: f64) {
        let variance = self.predictor.variance(frame, predicted);
        let [p, q, r] = [
            frame.state.p - before.state.p,
            frame.state.q - before.state.q,
            frame.state.r - before.state.r,
        ]
        .map(|change| change / dt);
        let [x, y, z] = frame.specific_force;
        let measured = [x, y, z, p, q, r];
        let surfaces = [
            0.0,
            0.0,
            0.0,
            frame.actuators.aileron,
            frame.actuators.elevator,
            frame.actuators.rudder,
        ];
        for (k, watch) in self.watches.iter_mut().enumerate() {
            // an angular acceleration from differenced rates is a mean over the step, a specific force is the value at its end
            let expected =
                if k < 3 { predicted[k] } else { 0.5 * (predicted[k] + before.predicted[k]) };
            let residual = measured[k] - expected;
            if residual.is_finite() && variance[k].is_finite() {
                watch.see(residual, variance[k], surfaces[k], dt);
                self.values[k] = [measured[k], expected];
                self.compared[k] = true;
            }
        }
    }

    fn due(&mut self, now: Time) -> Option<Warning> {
        let size = |watch: &Watch| watch.share().abs();
        let due = self.watches.iter().enumerate().filter(|(k, w)| self.compared[*k] && w.is_due());
        let (k, _) = due.max_by(|(_, a), (_, b)| size(a).total_cmp(&size(b)))?;
        let watch = &mut self.watches[k];
        watch.report();
        let (channel, share) = (Channel::ALL[k], watch.share());
        let reported = &mut self.reported[channel.plane()];
        if reported.is_some_and(|reported| now.since(reported).as_secs_f64() < ONE_CAUSE_S) {
            return None;
        }
        *reported = Some(now);
        Some(Warning { channel, share, follows_surface: watch.follows_surface() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable;
    use greylag_link::vehicle::Order;
    use greylag_model::Trim;
    use greylag_physics::{ActuatorState, Controls};
    use std::path::Path;
    use std::time::Duration;

    const DT: f64 = 0.01;

    fn model() -> GreyBox {
        GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap()
    }

    /// Warnings of the monitor, with their times (s), in a simulated flight of the model `truth`. `commanded` computes the
    /// deflections that telemetry reports from time, state and trim. `acting` computes the deflections that act on the aircraft
    /// from the reported ones and the trim.
    fn warnings(
        seconds: f64,
        truth: &GreyBox,
        commanded: impl Fn(f64, &State, Controls) -> Controls,
        acting: impl Fn(Controls, Controls) -> Controls,
    ) -> Vec<(f64, Warning)> {
        let trim = Trim::level(&model(), 18.0, 600.0).unwrap();
        let (mut state, altitude) = (trim.state, 600.0);
        let (mut monitor, mut found) = (Monitor::new(model()), Vec::new());
        for i in 0..(seconds / DT) as u64 {
            let at = i as f64 * DT;
            let reported = commanded(at, &state, trim.controls);
            let controls = acting(reported, trim.controls);
            let air = truth.air(&state, altitude);
            let (linear, _) = truth.accelerations(&state, &controls, &air);
            let gravity =
                greylag_physics::rigid_body::gravity_in_body(&state, truth.atmosphere.gravity);
            let Controls { aileron, elevator, throttle, rudder, .. } = reported;
            let frame = Telemetry {
                time: Time::default().plus(Duration::from_millis(10 * i)),
                order: Order::Next { lost: 0 },
                state,
                specific_force: std::array::from_fn(|k| linear[k] - gravity[k]),
                actuators: ActuatorState {
                    aileron,
                    elevator,
                    throttle,
                    rudder,
                    ..ActuatorState::default()
                },
                altitude,
                ..usable()
            };
            found.extend(monitor.see(&frame).map(|warning| (at, warning)));
            state = state.advance(&truth.rate(&state, &controls, altitude), DT);
        }
        found
    }

    /// Deflections of a simple control law that holds the wings level and follows a pitch command of alternating sign.
    fn flown(at: f64, state: &State, trim: Controls) -> Controls {
        let wanted = 0.04 + if at % 8.0 < 4.0 { 0.06 } else { -0.06 };
        let elevator = trim.elevator + 0.8 * (state.pitch - wanted) + 0.15 * state.q;
        let aileron = trim.aileron - 0.6 * state.roll - 0.1 * state.p;
        Controls { aileron: aileron.clamp(-0.5, 0.5), elevator: elevator.clamp(-0.5, 0.5), ..trim }
    }

    #[test]
    fn a_flight_of_the_models_own_aircraft_is_quiet() {
        assert_eq!(warnings(60.0, &model(), flown, |reported, _| reported), []);
    }

    #[test]
    fn an_elevator_that_sticks_is_found_in_the_pitching_moment() {
        let stuck = |reported, trim: Controls| Controls { elevator: trim.elevator, ..reported };
        let found = warnings(30.0, &model(), flown, stuck);
        let (at, first) = found.first().expect("a warning");
        assert_eq!(first.channel, Channel::Pitch, "{found:?}");
        assert!(*at < 10.0, "{found:?}");
        assert!(first.to_string().contains("elevator"), "{first}");
    }

    #[test]
    fn a_load_that_has_shifted_and_drag_of_ice_are_found_in_their_channels() {
        let changed = |name: &str, value: f64| {
            let mut truth = model();
            assert!(truth.set_coefficient(name, value), "{name}");
            truth
        };
        // Cm0 changes from 0.0227 to −0.08. This changes the trim, as a shift of the centre of gravity does.
        let found = warnings(30.0, &changed("pitch_linear.Cm0", -0.08), flown, |r, _| r);
        assert!(found.iter().any(|(at, w)| w.channel == Channel::Pitch && *at < 10.0), "{found:?}");
        let found = warnings(30.0, &changed("drag_table.k", 3.0), flown, |r, _| r);
        let (at, first) = found.first().expect("a warning");
        assert!(first.channel == Channel::Forward && first.share < 0.0 && *at < 10.0, "{found:?}");
        assert!(first.to_string().contains("ice"), "{first}");
    }
}

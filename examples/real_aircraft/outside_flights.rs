//! Flights inside an envelope, to be fitted, and outside of it, to be predicted: of the X8 in JSBSim and of the Ultra Stick.

use std::path::Path;

use anyhow::{Result, anyhow};
use greylag::control::{Controller, ControllerKind, build};
use greylag::manoeuvres::{Axis, Excitation, Schedule, Shape, Step};
use greylag::model::GreyBox;
use greylag::num::statistics::quantile;
use greylag::num::stream::{Stream, stream};
use greylag::sim::flight_test::fly_within_bounds;
use greylag::sim::instruments::Instruments;
use greylag::sysid::flight_path::reconstruction::{Instant, Reconstruction, Segment};
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag_sitl::plant::PlantOptions;
use rand::RngExt;

use crate::aircraft::{self, numbered, pieces, seconds};

/// Number of the random stream for schedules, turbulence and instruments.
const FLOWN: u64 = 531;
/// Number of flights of the X8 that are fitted.
const TRAINING: u64 = 3;
/// Number and duration (s) of the steps of a flight of the X8.
const STEPS: usize = 8;
const STEP_S: f64 = 5.0;
/// Duration of a piece of the Ultra Stick's flights, s.
const PIECE_S: f64 = 6.0;
/// Shortest stretch inside the envelope that is fitted, s.
const SHORTEST_S: f64 = 1.0;

/// Flights to be predicted that have something in common.
pub struct Group {
    /// What the flights have in common.
    pub name: &'static str,
    /// The flights, each of which is judged apart.
    pub tests: Vec<Reconstruction>,
}

/// Flights to be fitted and flights to be predicted.
pub struct Set {
    /// Flights inside the envelope.
    pub fit: Vec<Reconstruction>,
    /// Flights to be predicted.
    pub groups: Vec<Group>,
}

/// Commanded flight of the X8. Each range is that of the draws for the steps of a flight.
struct Class {
    name: &'static str,
    /// Bank to either side, degrees.
    bank_deg: [f64; 2],
    pitch_deg: [f64; 2],
    airspeed_mps: [f64; 2],
    /// Elevator pulse that pulls the nose up for 0.4 s, −1..1; 0 for none.
    pull: f64,
}

/// The envelope that is fitted: bank to 20°, near the trim at 18 m/s.
const INSIDE: Class = Class {
    name: "inside the envelope that was fitted",
    bank_deg: [0.0, 20.0],
    pitch_deg: [2.0, 4.0],
    airspeed_mps: [17.0, 19.0],
    pull: 0.0,
};

/// Flights outside of the envelope, one property apart.
const OUTSIDE: [Class; 3] = [
    Class {
        name: "banked 45°",
        bank_deg: [42.0, 48.0],
        pitch_deg: [3.0, 5.0],
        airspeed_mps: [18.0, 20.0],
        pull: 0.0,
    },
    Class {
        name: "26 m/s",
        bank_deg: [0.0, 20.0],
        pitch_deg: [-3.0, 0.0],
        airspeed_mps: [25.0, 27.0],
        pull: 0.0,
    },
    Class {
        name: "14 m/s, nose pulled up",
        bank_deg: [0.0, 20.0],
        pitch_deg: [4.0, 7.0],
        airspeed_mps: [13.5, 14.5],
        pull: 0.25,
    },
];

impl Class {
    /// A step with the multisines that all flights have.
    fn step(&self, random: &mut Stream) -> Step {
        let side = if random.random::<bool>() { 1.0 } else { -1.0 };
        let mut within = |[low, high]: [f64; 2]| -> f64 { random.random_range(low..high) };
        let (bank, pitch) = (side * within(self.bank_deg), within(self.pitch_deg));
        let mut step = Step::hold(STEP_S, bank, pitch, within(self.airspeed_mps));
        let sines =
            [(Axis::Aileron, 0.05, 3.0), (Axis::Elevator, 0.04, 3.0), (Axis::Throttle, 0.1, 1.0)];
        for (axis, amplitude, high_hz) in sines {
            let shape = Shape::multisine(0.2, high_hz, random.random::<u32>().into());
            step = step.with(Excitation::new(axis, amplitude, 0.0, shape));
        }
        if self.pull == 0.0 {
            return step;
        }
        let pulse = Excitation::new(Axis::Elevator, -self.pull, 2.0, Shape::Step { width: 0.4 });
        // with its full reaction the controller would cancel the pulse
        step.with(pulse.against(0.3))
    }
}

/// The X8 in JSBSim, and a wrong model of it.
pub struct X8 {
    /// The model before any fit: nine coefficients are wrong by 75 to 100 %, and it has neither the stall nor the drag of
    /// sideslip and elevator of the aircraft. The prior standard deviations are as large as the values.
    pub model: GreyBox,
    controller: Box<dyn Controller>,
}

impl X8 {
    /// Reads the models and designs the controller that flies.
    ///
    /// # Errors
    /// If a model cannot be read or has no controller.
    pub fn load() -> Result<X8> {
        let folder = Path::new("params/x8");
        let exact = GreyBox::load(&folder.join("jsbsim.toml"))?;
        let wrong = GreyBox::load(&folder.join("prior-severe.toml"))?;
        let model = wrong.with_widths(|c| Some(c.value.abs()));
        Ok(X8 { model, controller: build(ControllerKind::Lqi, &exact)? })
    }

    /// The flights of `seed`. The first group is inside the envelope.
    ///
    /// # Errors
    /// If the aircraft cannot be flown, or a log cannot be reconstructed.
    pub fn set(&self, seed: u64) -> Result<Set> {
        let fit = (0..TRAINING).map(|k| self.fly(&INSIDE, seed, k)).collect::<Result<_>>()?;
        let mut groups = Vec::new();
        for (class, k) in [&INSIDE].into_iter().chain(&OUTSIDE).zip(TRAINING..) {
            groups.push(Group { name: class.name, tests: vec![self.fly(class, seed, k)?] });
        }
        Ok(Set { fit, groups })
    }

    /// Flight number `k` of `seed`, reconstructed from the log of a small autopilot's instruments.
    fn fly(&self, class: &Class, seed: u64, k: u64) -> Result<Reconstruction> {
        let mut random = stream(seed, &[FLOWN, k]);
        let name = format!("{}, flight {}", class.name, k + 1);
        let steps: Vec<Step> = (0..STEPS).map(|_| class.step(&mut random)).collect();
        let schedule = Schedule::new(name.clone(), "Steps with multisines.", steps);
        let schedule = schedule.map_err(|why| anyhow!("schedule {name}: {why}"))?;
        let plant = PlantOptions { seed: random.random(), ..PlantOptions::default() };
        let flown = fly_within_bounds(&plant, self.controller.as_ref(), &schedule)?;
        let noise: u64 = random.random();
        let log = Instruments::drawn(noise).log(&flown, &name, noise);
        let options = flight_path::Options {
            gravity: self.model.atmosphere.gravity,
            actuators_clock: ActuatorClock::AsRecorded,
            ..flight_path::Options::new(&log.name, self.model.airframe.actuators)
        };
        Ok(reconstruct(&log, &options)?)
    }
}

/// An envelope about the median airspeed and angle of attack of a flight.
struct Envelope {
    airspeed_mps: f64,
    alpha_rad: f64,
}

impl Envelope {
    /// The envelope about the medians of all samples of `flights`.
    fn about(flights: &[Reconstruction]) -> Envelope {
        let median = |of: fn(&Instant) -> f64| {
            let all = flights.iter().flat_map(|f| &f.segments).flat_map(|s| &s.instants);
            quantile(&all.map(of).collect::<Vec<_>>(), 0.5)
        };
        Envelope {
            airspeed_mps: median(|i| i.state.airspeed),
            alpha_rad: median(|i| i.state.alpha),
        }
    }

    /// Whether a sample is inside: bank within 20°, airspeed within 10 % and angle of attack within 3° of the medians.
    fn holds(&self, at: &Instant) -> bool {
        let state = &at.state;
        state.roll.abs() <= 20f64.to_radians()
            && (state.airspeed - self.airspeed_mps).abs() <= 0.1 * self.airspeed_mps
            && (state.alpha - self.alpha_rad).abs() <= 3f64.to_radians()
    }

    /// Share of the samples of `flight` that are outside.
    fn outside(&self, flight: &Reconstruction) -> f64 {
        let all = || flight.segments.iter().flat_map(|s| &s.instants);
        all().filter(|at| !self.holds(at)).count() as f64 / all().count().max(1) as f64
    }

    /// The stretches of `flight` inside the envelope.
    fn inside(&self, flight: &Reconstruction) -> Vec<Segment> {
        let long = |stretch: &&[Instant]| stretch.len() as f64 * flight.step_s >= SHORTEST_S;
        let mut segments = Vec::new();
        for segment in &flight.segments {
            let stretches = segment.instants.chunk_by(|a, b| self.holds(a) == self.holds(b));
            let kept = stretches.filter(|s| self.holds(&s[0])).filter(long);
            segments.extend(kept.map(|s| Segment { instants: s.to_vec() }));
        }
        segments
    }
}

/// The model of the Ultra Stick from geometry, and its flights cut into pieces of 6 s. The half of the pieces with the largest
/// share outside of the envelope is predicted. Of the other half, what is inside of it is fitted.
///
/// # Errors
/// If a file cannot be read, or a flight cannot be reconstructed.
pub fn ultra_stick() -> Result<(GreyBox, Set)> {
    let aircraft = aircraft::thor()?;
    let flights = &aircraft.flights;
    let envelope = Envelope::about(flights);
    let count = (seconds(flights) / PIECE_S).round() as usize;
    let all = numbered(pieces(flights, count));
    let shares: Vec<f64> = all.iter().map(|piece| envelope.outside(piece)).collect();
    let limit = quantile(&shares, 0.5);
    let (near, tests): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|piece| envelope.outside(piece) <= limit);
    let mut fit = Vec::new();
    for flight in flights {
        let start = format!("{}, part ", flight.name);
        let own = near.iter().filter(|piece| piece.name.starts_with(&start));
        let segments: Vec<Segment> = own.flat_map(|piece| envelope.inside(piece)).collect();
        if !segments.is_empty() {
            fit.push(Reconstruction { segments, ..flight.clone() });
        }
    }
    let groups = vec![Group { name: "pieces outside of the envelope", tests }];
    Ok((aircraft.model, Set { fit, groups }))
}

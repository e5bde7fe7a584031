//! Prepares a reconstructed flight for a comparison with models. The flight is resampled to model steps, the parts in flight
//! are kept, and they are divided into windows. In the weak form, the equations of motion are integrated over a window with
//! a smooth weight, the kernel. A regime variable, such as α, describes the flight condition in a window.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

use crate::flight_path::reconstruction::{Instant, Reconstruction};
use crate::per_flight::askew::{self, Turning};
use crate::weak_form::channels::RegimeVariable;
use crate::weak_form::kernel::{Kernel, weigh};
use greylag_logs::Sampling;
use greylag_model::{GreyBox, Integrator, Memory, STEP};
use greylag_physics::State;

/// Airspeed below which an aircraft of any size counts as not in flight, m/s.
const FLYING_FLOOR: f64 = 3.0;

/// The sampling interval of a flight is outside 1e-6 to 1 s.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("flight {flight} has a sampling interval of {step_s} s; it must be 1e-6 to 1 s")]
pub struct ClockError {
    /// Name of the flight.
    pub flight: String,
    /// Sampling interval of the flight, s.
    pub step_s: f64,
}

/// A flight whose sampling interval is a multiple of the model step [`STEP`].
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Name of the flight.
    pub name: String,
    /// Time between samples, s.
    pub dt: f64,
    /// Number of model steps of [`STEP`] between samples.
    pub substeps: usize,
    /// Meaning of body rates and deflections between samples.
    pub sampling: Sampling,
    /// Stretches in flight without gaps.
    pub segments: Vec<Vec<Instant>>,
    /// Standard deviations of the white noise that roll, pitch, airspeed, p, q, r, α and β have after the reconstruction, in the
    /// units of the state; 0 if not known.
    pub noise: [f64; 8],
    /// Standard deviations of the specific force's white noise, body axes, m/s²; 0 if not known.
    pub force_noise: [f64; 3],
    /// Mean changes of α and β over the flight, per rad of misalignment of the sensor axes.
    pub turning: Turning,
    /// Misalignment by which the axes were rotated back ([`Self::turned_back`]), rad about each body axis.
    pub turned: [f64; askew::NAMES.len()],
    /// Kernel sampled at the interval `dt`.
    pub kernel: Kernel,
    /// Windows in time order.
    pub windows: Vec<Window>,
}

/// A window of the weak form.
#[derive(Clone, Debug)]
pub struct Window {
    /// Index of the segment that contains the window.
    pub segment: usize,
    /// Index of the window's first sample in the segment.
    pub start: usize,
    /// Time of the window's middle on the log's clock, s.
    pub time_s: f64,
    /// Means of the regime variables over the window, in the order and units of [`RegimeVariable::CONTINUOUS`].
    pub regime: [f64; RegimeVariable::CONTINUOUS.len()],
}

impl Prepared {
    /// Keeps the parts of `flight` with an airspeed of at least `slowest` (m/s), or of 3 m/s if that is more, and resamples them
    /// to a multiple of the model step.
    ///
    /// # Errors
    /// If the sampling interval of `flight` is outside 1e-6 to 1 s.
    pub fn new(flight: &Reconstruction, slowest: f64) -> Result<Prepared, ClockError> {
        let substeps = substeps(flight)?;
        let dt = STEP * substeps as f64;
        let segments: Vec<Vec<Instant>> = flight
            .segments
            .iter()
            .flat_map(|segment| in_the_air(&segment.instants, slowest.max(FLYING_FLOOR)))
            .map(|piece| on_clock(piece, flight.step_s, dt))
            .filter(|piece| piece.len() > 1)
            .collect();
        let kernel = Kernel::hann(dt);
        let left = |stated: f64, of: &dyn Fn(&Instant) -> f64| {
            if stated.is_finite() { stated.min(white_noise(&segments, of)) } else { 0.0 }
        };
        let noise = std::array::from_fn(|k| left(flight.noise[k], &|i| i.state.to_array()[k]));
        let force_noise =
            std::array::from_fn(|k| left(flight.force_noise[k], &|i| i.specific_force[k]));
        let first = flight.segments.iter().find_map(|s| s.instants.first());
        let windows = windows(&segments, &kernel, first.map_or(0.0, |i| i.time_s));
        let turning = Turning::of(flight, &segments);
        Ok(Prepared {
            name: flight.name.clone(),
            dt,
            substeps,
            sampling: flight.sampling,
            segments,
            noise,
            force_noise,
            turning,
            turned: [0.0; askew::NAMES.len()],
            kernel,
            windows,
        })
    }

    /// The flight with its axes rotated back by the misalignment `angles`, rad about each body axis.
    pub fn turned_back(&self, angles: &[f64; askew::NAMES.len()]) -> Prepared {
        let mut right = self.clone();
        let all = right.segments.iter_mut().flatten();
        all.for_each(|at| askew::turn_back(&self.turning, angles, at));
        right.turned = std::array::from_fn(|axis| self.turned[axis] + angles[axis]);
        right
    }

    /// The flight with every other sample.
    pub fn every_other(&self) -> Prepared {
        let thin = |s: &Vec<Instant>| s.iter().step_by(2).copied().collect::<Vec<_>>();
        let segments: Vec<_> = self.segments.iter().map(thin).filter(|s| s.len() > 1).collect();
        let kernel = Kernel::hann(2.0 * self.dt);
        let origin = segments.first().map_or(0.0, |s| s[0].time_s);
        Prepared {
            name: self.name.clone(),
            dt: 2.0 * self.dt,
            substeps: 2 * self.substeps,
            sampling: self.sampling,
            noise: self.noise,
            force_noise: self.force_noise,
            turning: self.turning,
            turned: self.turned,
            windows: windows(&segments, &kernel, origin),
            segments,
            kernel,
        }
    }

    /// The flight with the deflections that act on the aircraft according to `model`. They are the recorded deflections, passed
    /// through the input effects of `model`, for example an actuator lag.
    pub fn acting(&self, model: &GreyBox) -> Cow<'_, Prepared> {
        if model.acts_at_once() {
            return Cow::Borrowed(self);
        }
        let mut acting = self.clone();
        for instants in &mut acting.segments {
            let Some(first) = instants.first() else { continue };
            let mut memory = model.at_rest(&first.controls);
            let mut before = first.controls;
            for instant in instants {
                let measured = instant.controls;
                for j in 1..=self.substeps {
                    let input = match self.sampling {
                        Sampling::Held => measured,
                        Sampling::Instants => {
                            before.towards(&measured, j as f64 / self.substeps as f64)
                        }
                    };
                    instant.controls = model.act(&input, &mut memory);
                }
                before = measured;
            }
        }
        Cow::Owned(acting)
    }

    /// `model` with the integrator that matches this flight's sampling. If rates are held, as a simulator logs them, the model
    /// keeps its integrator. For samples at instants, JSBSim's integrator is replaced by RK4.
    pub fn stepping<'a>(&self, model: &'a GreyBox) -> Cow<'a, GreyBox> {
        match (self.sampling, model.integrator) {
            (Sampling::Instants, Integrator::Jsbsim) => {
                let mut model = model.clone();
                model.integrator = Integrator::Rk4;
                Cow::Owned(model)
            }
            _ => Cow::Borrowed(model),
        }
    }

    /// Integrates `model` from `state` over the time from the sample `at` to the sample `next`. `model` must come from
    /// [`Self::stepping`]. The deflections are those of `at` or, for samples at instants, are interpolated from `at` to `next`.
    pub fn advance(
        &self,
        model: &GreyBox,
        state: State,
        [at, next]: [&Instant; 2],
        memory: &mut Memory,
    ) -> State {
        (0..self.substeps).fold(state, |s, j| {
            let controls = match self.sampling {
                Sampling::Held => at.controls,
                Sampling::Instants => {
                    let part = (j as f64 + 0.5) / self.substeps as f64;
                    at.controls.towards(&next.controls, part)
                }
            };
            model.step(&s, &controls, at.altitude, memory)
        })
    }

    /// The samples of a window.
    pub fn samples(&self, window: &Window) -> &[Instant] {
        &self.segments[window.segment][window.start..=window.start + self.kernel.steps()]
    }

    /// Whether in at least one window all samples have a specific force.
    pub fn has_force(&self) -> bool {
        self.windows.iter().any(|w| self.force_in(w))
    }

    /// Whether all samples of a window have a specific force.
    pub fn force_in(&self, window: &Window) -> bool {
        self.samples(window).iter().all(|i| i.specific_force.iter().all(|f| f.is_finite()))
    }

    /// Total number of samples.
    pub fn sample_count(&self) -> usize {
        self.segments.iter().map(Vec::len).sum()
    }
}

/// Number of model steps of [`STEP`] between samples, rounded to the nearest whole number, at least 1.
fn substeps(flight: &Reconstruction) -> Result<usize, ClockError> {
    let step_s = flight.step_s;
    if !(1e-6..=1.0).contains(&step_s) {
        return Err(ClockError { flight: flight.name.clone(), step_s });
    }
    Ok(((step_s / STEP).round() as usize).max(1))
}

/// Resamples a stretch from the interval `step_s` to the interval `dt` (s).
///
/// If the intervals are equal, the samples stay as they are. If `dt` is n times `step_s`, every n-th sample is kept. In all
/// other cases, states are interpolated linearly, and a deflection is that of the sample before.
fn on_clock(instants: &[Instant], step_s: f64, dt: f64) -> Vec<Instant> {
    if (step_s / dt - 1.0).abs() < 1e-6 {
        return instants.to_vec();
    }
    let every = (dt / step_s).round() as usize;
    if every > 1 && (dt / (step_s * every as f64) - 1.0).abs() < 1e-6 {
        return instants.iter().step_by(every).copied().collect();
    }
    let count = ((instants.len() - 1) as f64 * step_s / dt).floor() as usize;
    let at = |k: usize| {
        let place = k as f64 * dt / step_s;
        let i = (place.floor() as usize).min(instants.len() - 2);
        between(&instants[i], &instants[i + 1], place - i as f64)
    };
    (0..=count).map(at).collect()
}

/// Standard deviation of the white noise in a series, from third differences. It is infinite if there are none.
///
/// Third differences of a smooth signal nearly vanish. Those of white noise have 1 + 9 + 9 + 1 = 20 times its variance.
fn white_noise(segments: &[Vec<Instant>], of: &dyn Fn(&Instant) -> f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for four in segments.iter().flat_map(|s| s.windows(4)) {
        let third = of(&four[3]) - of(&four[0]) - 3.0 * (of(&four[2]) - of(&four[1]));
        if third.is_finite() {
            sum += third * third;
            count += 1.0;
        }
    }
    if count > 0.0 { (sum / count / 20.0_f64).sqrt() } else { f64::INFINITY }
}

fn between(a: &Instant, b: &Instant, part: f64) -> Instant {
    let mix = |x: f64, y: f64| x + (y - x) * part;
    let (x, mut y) = (a.state.to_array(), b.state.to_array());
    // roll is interpolated over the smaller angle between the two values
    y[0] = x[0] + (y[0] - x[0] + PI).rem_euclid(TAU) - PI;
    Instant {
        time_s: mix(a.time_s, b.time_s),
        state: State::from_array(std::array::from_fn(|k| mix(x[k], y[k]))),
        specific_force: std::array::from_fn(|k| mix(a.specific_force[k], b.specific_force[k])),
        altitude: mix(a.altitude, b.altitude),
        density: mix(a.density, b.density),
        ..*a
    }
}

/// The parts with an airspeed of at least `slowest` (m/s) whose values are all finite.
fn in_the_air(instants: &[Instant], slowest: f64) -> impl Iterator<Item = &[Instant]> {
    let flown = move |i: &Instant| {
        let z = i.controls;
        i.state.airspeed >= slowest
            && i.state.is_finite()
            && [z.aileron, z.elevator, z.throttle, i.altitude].iter().all(|x| x.is_finite())
    };
    instants.chunk_by(move |a, b| flown(a) && flown(b)).filter(|piece| piece.len() > 1)
}

fn windows(segments: &[Vec<Instant>], kernel: &Kernel, origin: f64) -> Vec<Window> {
    let steps = kernel.steps();
    let mut windows = Vec::new();
    for (segment, instants) in segments.iter().enumerate() {
        let count = instants.len().saturating_sub(steps);
        for start in (0..count).step_by(kernel.stride()) {
            let samples = &instants[start..=start + steps];
            let time_s = 0.5 * (samples[0].time_s + samples[steps].time_s);
            let regime = regime(samples, kernel, time_s - origin);
            windows.push(Window { segment, start, time_s, regime });
        }
    }
    windows
}

/// Regime variables of a window, averaged with the weights of the kernel.
fn regime(
    samples: &[Instant],
    kernel: &Kernel,
    since_start: f64,
) -> [f64; RegimeVariable::CONTINUOUS.len()] {
    use RegimeVariable as V;
    let mean = |of: fn(&Instant) -> f64| weigh(&kernel.sample, samples.iter().map(of));
    let rate = |of: fn(&Instant) -> f64| weigh(&kernel.slope, samples.iter().map(of));
    RegimeVariable::CONTINUOUS.map(|variable| match variable {
        V::Alpha => mean(|i| i.state.alpha).to_degrees(),
        V::Beta => mean(|i| i.state.beta).to_degrees(),
        V::Airspeed => mean(|i| i.state.airspeed),
        V::Throttle => mean(|i| i.controls.throttle),
        V::P => mean(|i| i.state.p).to_degrees(),
        V::Q => mean(|i| i.state.q).to_degrees(),
        V::R => mean(|i| i.state.r).to_degrees(),
        V::Aileron => mean(|i| i.controls.aileron).to_degrees(),
        V::Elevator => mean(|i| i.controls.elevator).to_degrees(),
        V::AileronRate => rate(|i| i.controls.aileron).to_degrees(),
        V::ElevatorRate => rate(|i| i.controls.elevator).to_degrees(),
        V::Altitude => mean(|i| i.altitude),
        V::Time => since_start,
        V::Flight => f64::NAN,
    })
}

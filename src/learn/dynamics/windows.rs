//! Recorded flights as training data: tracks of states and controls, cut into windows. A window is the stretch of a track over
//! which a rollout (simulation) is compared with the record.

use sha2::{Digest, Sha256};

use crate::dynamics::packet::Packet;
use crate::dynamics::rollout::Recorded;
use greylag_logs::Flight;
use greylag_model::GreyBox;
use greylag_physics::inputs::InputMemory;
use greylag_physics::{Controls, State};

/// A section of flight without gaps, with a sample every 0.01 s.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// State at each sample.
    pub states: Vec<State>,
    /// Deflections and throttle that act on the aircraft from each sample to the next: those measured, changed by the model's
    /// input effects, such as backlash.
    pub controls: Vec<Controls>,
    /// Altitude at each sample, m.
    pub altitude: Vec<f64>,
    /// Air density at each sample by the model's atmosphere, kg/m³.
    pub density: Vec<f64>,
}

impl Track {
    /// Makes a track from `samples` (state, measured controls, altitude in m). The acting controls and the air density are
    /// computed with `model`.
    pub fn new(model: &GreyBox, samples: impl Iterator<Item = (State, Controls, f64)>) -> Track {
        let mut track = Track::default();
        let mut memory: Option<InputMemory> = None;
        for (state, controls, altitude) in samples {
            let memory = memory.get_or_insert_with(|| model.at_rest(&controls));
            track.states.push(state);
            track.controls.push(model.act(&controls, memory));
            track.altitude.push(altitude);
            track.density.push(model.atmosphere.density_at(altitude));
        }
        track
    }

    /// The track of a recorded flight with exact states, as `greylag collect` writes it.
    pub fn of(model: &GreyBox, flight: &Flight) -> Track {
        let rows = flight.samples.iter().map(|s| {
            let [roll, pitch, _] = s.attitude_rad;
            let [p, q, r] = s.rates_radps;
            let (airspeed, alpha, beta) = (s.airspeed_mps, s.alpha_rad, s.beta_rad);
            let state = State { roll, pitch, airspeed, p, q, r, alpha, beta };
            let (aileron, elevator) = (s.aileron_rad, s.elevator_rad);
            let rudder = if s.rudder_rad.is_finite() { s.rudder_rad } else { 0.0 };
            let controls =
                Controls { aileron, elevator, throttle: s.throttle, rudder, lagged: None };
            (state, controls, s.altitude_m)
        });
        Track::new(model, rows)
    }

    /// Splits the track into the samples before `at` and the samples from `at` on.
    pub fn split(&self, at: usize) -> [Track; 2] {
        let part = |range: std::ops::Range<usize>| Track {
            states: self.states[range.clone()].to_vec(),
            controls: self.controls[range.clone()].to_vec(),
            altitude: self.altitude[range.clone()].to_vec(),
            density: self.density[range].to_vec(),
        };
        [part(0..at), part(at..self.states.len())]
    }

    /// Indices of the samples at which a rollout of `steps` steps can start. Such a sample has one sample before it and `steps`
    /// samples after it.
    pub fn starts(&self, steps: usize) -> std::ops::Range<usize> {
        1..self.states.len().saturating_sub(steps).max(1)
    }
}

/// The start of a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Index of the track.
    pub track: u32,
    /// Index of the start sample in the track, at least 1.
    pub start: u32,
    /// Weight in the loss; 1 in \[GSFM26\] (see `src/lib.rs`).
    pub weight: f64,
}

/// Largest |pitch| of samples for training, rad. Euler angles are singular near the vertical.
const STEEPEST: f64 = 1.4;
/// Airspeed below which flow angles are undefined, m/s.
const SLOWEST: f64 = 5.0;

/// Whether the state is finite, away from the vertical, and fast enough for defined flow angles.
pub(crate) fn regular(state: &State) -> bool {
    state.is_finite() && state.pitch.abs() < STEEPEST && state.airspeed > SLOWEST
}

/// All windows of `steps` steps, in order, whose samples are all usable (finite, not near the vertical, fast enough). This
/// includes the sample before the start.
pub fn windows(tracks: &[Track], steps: usize) -> Vec<Window> {
    let mut all = Vec::new();
    for (track, t) in tracks.iter().enumerate() {
        // for each sample, the number of consecutive regular samples that end with it
        let mut run = 0;
        let runs: Vec<usize> = t
            .states
            .iter()
            .map(|s| {
                run = if regular(s) { run + 1 } else { 0 };
                run
            })
            .collect();
        let good = |start: &usize| runs[start + steps] >= steps + 2;
        let starts = t.starts(steps).filter(good);
        all.extend(starts.map(|start| Window {
            track: track as u32,
            start: start as u32,
            weight: 1.0,
        }));
    }
    all
}

/// SHA-256 of the tracks, hexadecimal.
pub fn hash(tracks: &[Track]) -> String {
    let mut hash = Sha256::new();
    for track in tracks {
        hash.update((track.states.len() as u64).to_le_bytes());
        for k in 0..track.states.len() {
            let Controls { aileron, elevator, throttle, rudder, .. } = track.controls[k];
            let rest = [aileron, elevator, throttle, track.altitude[k]];
            // the hash of tracks without a rudder is the same as in earlier versions of the program
            let rudder = Some(&rudder).filter(|x| **x != 0.0);
            for x in track.states[k].to_array().iter().chain(&rest).chain(rudder) {
                hash.update(x.to_le_bytes());
            }
        }
    }
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

impl<R: Packet> Recorded<R> {
    /// Loads the recorded samples of the windows, one window per lane, for rollouts of `steps` steps. Lanes beyond `windows`
    /// repeat the first window with weight zero.
    ///
    /// # Panics
    ///
    /// If `windows` is empty or has more entries than there are lanes.
    pub fn fill(&mut self, tracks: &[Track], windows: &[Window], steps: usize) {
        assert!((1..=R::WIDTH).contains(&windows.len()), "a window for each lane");
        let of = |lane: usize| windows.get(lane).unwrap_or(&windows[0]);
        let pick = |k: usize, get: &dyn Fn(&Track, usize) -> f64| {
            R::gather(|lane| {
                let Window { track, start, .. } = *of(lane);
                get(&tracks[track as usize], start as usize - 1 + k)
            })
        };
        self.states.clear();
        self.controls.clear();
        self.density.clear();
        self.lagged.clear();
        for k in 0..steps + 2 {
            self.states.push(std::array::from_fn(|i| pick(k, &|t, s| t.states[s].to_array()[i])));
        }
        for k in 0..steps + 1 {
            self.controls.push([
                pick(k, &|t, s| t.controls[s].aileron),
                pick(k, &|t, s| t.controls[s].elevator),
                pick(k, &|t, s| t.controls[s].throttle),
                pick(k, &|t, s| t.controls[s].rudder),
            ]);
            self.density.push(pick(k, &|t, s| t.density[s]));
            if tracks[windows[0].track as usize].controls[0].lagged.is_some() {
                let lag = |i: usize| {
                    pick(k, &|t, s| t.controls[s].lagged.map_or(f64::NAN, |lagged| lagged[i]))
                };
                self.lagged.push(std::array::from_fn(lag));
            }
        }
        let counts = |lane: usize| windows.get(lane).map_or(0.0, |w| w.weight);
        self.weight = Some(R::gather(counts));
    }
}

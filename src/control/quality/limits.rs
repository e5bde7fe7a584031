//! Envelope limits of an aircraft, and the time that a flight spends outside each limit.

use serde::Serialize;

use super::{Moment, Track};
use greylag_physics::Airframe;

/// Accepted excess of load factor and angle of attack in transients, as a fraction of the limit.
pub const TRANSIENT: f64 = 0.05;

/// Tolerance for rounding errors in the rate of a command, as a fraction of its limit.
const ROUNDING: f64 = 1e-9;

/// Limits against which a flight is measured. A limit that the airframe file does not state is infinite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Limits {
    /// Largest magnitude of the bank, degrees.
    pub bank_deg: f64,
    /// Smallest and largest pitch, degrees.
    pub pitch_deg: [f64; 2],
    /// Smallest and largest load factor.
    pub load_factor: [f64; 2],
    /// Angle of attack at which the wing stalls, degrees.
    pub stall_deg: f64,
    /// Largest magnitude of the sideslip, degrees.
    pub sideslip_deg: f64,
    /// Smallest and largest airspeed, m/s.
    pub airspeed_mps: [f64; 2],
    /// Slew limit: largest rate of a surface command (−1..1), 1/s.
    pub slew_per_s: f64,
}

/// Time outside each limit, s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct OutsideS {
    /// Time above the largest bank, s.
    pub bank: f64,
    /// Time outside the pitch limits, s.
    pub pitch: f64,
    /// Time above the largest load factor, s.
    pub load_factor: f64,
    /// Time below the smallest load factor, s.
    pub load_factor_low: f64,
    /// Time above the stall angle of attack, s.
    pub stall: f64,
    /// Time above the largest sideslip, s.
    pub sideslip: f64,
    /// Time below the smallest airspeed, s.
    pub slow: f64,
    /// Time above the largest airspeed, s.
    pub fast: f64,
    /// Time in which a surface command changes faster than the slew limit, s.
    pub slew: f64,
    /// Time outside any of the limits, s.
    pub any: f64,
}

/// A limit of the flight envelope.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Bank beyond [`Limits::bank_deg`].
    Bank,
    /// Pitch outside [`Limits::pitch_deg`].
    Pitch,
    /// Load factor above the second of [`Limits::load_factor`].
    LoadFactor,
    /// Load factor below the first of [`Limits::load_factor`].
    LeastLoadFactor,
    /// Angle of attack above [`Limits::stall_deg`].
    Stall,
    /// Sideslip beyond [`Limits::sideslip_deg`].
    Sideslip,
    /// Airspeed below the first of [`Limits::airspeed_mps`].
    LeastAirspeed,
    /// Airspeed above the second of [`Limits::airspeed_mps`].
    LargestAirspeed,
    /// Rate of a surface command beyond [`Limits::slew_per_s`].
    SurfaceRate,
}

impl Limit {
    /// Name in sentences.
    pub const fn name(self) -> &'static str {
        match self {
            Limit::Bank => "bank",
            Limit::Pitch => "pitch",
            Limit::LoadFactor => "load factor",
            Limit::LeastLoadFactor => "least load factor",
            Limit::Stall => "stall",
            Limit::Sideslip => "sideslip",
            Limit::LeastAirspeed => "least airspeed",
            Limit::LargestAirspeed => "largest airspeed",
            Limit::SurfaceRate => "surface rate",
        }
    }
}

impl OutsideS {
    /// The exceeded limits, each with the time outside it, s.
    pub fn passed(&self) -> Vec<(Limit, f64)> {
        let all = [
            (Limit::Bank, self.bank),
            (Limit::Pitch, self.pitch),
            (Limit::LoadFactor, self.load_factor),
            (Limit::LeastLoadFactor, self.load_factor_low),
            (Limit::Stall, self.stall),
            (Limit::Sideslip, self.sideslip),
            (Limit::LeastAirspeed, self.slow),
            (Limit::LargestAirspeed, self.fast),
            (Limit::SurfaceRate, self.slew),
        ];
        all.into_iter().filter(|(_, seconds)| *seconds > 0.0).collect()
    }
}

impl Limits {
    /// The limits of an airframe file.
    pub fn of(airframe: &Airframe) -> Limits {
        let e = &airframe.envelope;
        Limits {
            bank_deg: e.bank_max_deg,
            pitch_deg: [e.pitch_min_deg, e.pitch_max_deg],
            load_factor: [e.load_factor_min.unwrap_or(f64::NEG_INFINITY), e.load_factor_max],
            stall_deg: airframe.incidence.stall.map_or(f64::INFINITY, f64::to_degrees),
            sideslip_deg: e.sideslip_max_deg.unwrap_or(f64::INFINITY),
            airspeed_mps: [e.airspeed_min_mps, e.airspeed_max_mps],
            slew_per_s: e.surface_slew_per_s,
        }
    }

    /// Whether a flight kept the limits of load factor and angle of attack, with the allowance [`TRANSIENT`]. The arguments are
    /// the smallest and largest values of the flight, `alpha_deg` in degrees. The smallest angle of attack is not checked.
    pub fn kept(&self, load_factor: [f64; 2], alpha_deg: [f64; 2]) -> bool {
        let room = |limit: f64| limit.abs() * TRANSIENT;
        let [least, most] = self.load_factor;
        // NaN violates no limit
        !(load_factor[0] < least - room(least)
            || load_factor[1] > most + room(most)
            || alpha_deg[1] > self.stall_deg + room(self.stall_deg))
    }

    /// Time outside each limit, s. Each sample is weighted with the time to the next sample.
    pub(super) fn outside(&self, track: &Track) -> OutsideS {
        let mut total = OutsideS::default();
        for (moment, before, length) in track.ticks() {
            let slew = before.map_or(0.0, |(old, since)| {
                let new = &moment.command;
                let by = [
                    new.aileron - old.aileron,
                    new.elevator - old.elevator,
                    new.rudder - old.rudder,
                ];
                by.iter().fold(0.0, |most: f64, by| most.max(by.abs())) / since
            });
            total.add(self.beyond(moment, slew), length);
        }
        total
    }

    /// For each limit, in the order of [`OutsideS::each`]: whether the sample lies outside it. `slew` is the largest rate of the
    /// surface commands, 1/s.
    fn beyond(&self, m: &Moment, slew: f64) -> [bool; 9] {
        let [roll, pitch] = m.attitude.map(f64::to_degrees);
        [
            roll.abs() > self.bank_deg,
            pitch < self.pitch_deg[0] || pitch > self.pitch_deg[1],
            m.load_factor > self.load_factor[1],
            m.load_factor < self.load_factor[0],
            m.alpha.to_degrees() > self.stall_deg,
            m.beta.to_degrees().abs() > self.sideslip_deg,
            m.airspeed < self.airspeed_mps[0],
            m.airspeed > self.airspeed_mps[1],
            slew > self.slew_per_s * (1.0 + ROUNDING),
        ]
    }
}

impl OutsideS {
    fn each(&mut self) -> [&mut f64; 9] {
        [
            &mut self.bank,
            &mut self.pitch,
            &mut self.load_factor,
            &mut self.load_factor_low,
            &mut self.stall,
            &mut self.sideslip,
            &mut self.slow,
            &mut self.fast,
            &mut self.slew,
        ]
    }

    fn add(&mut self, beyond: [bool; 9], length: f64) {
        let seconds = |out: bool| if out { length } else { 0.0 };
        self.each().into_iter().zip(beyond).for_each(|(total, out)| *total += seconds(out));
        self.any += seconds(beyond.contains(&true));
    }

    /// The sum of the times of two flights.
    pub fn plus(mut self, mut other: OutsideS) -> OutsideS {
        self.each().into_iter().zip(other.each()).for_each(|(total, more)| *total += *more);
        self.any += other.any;
        self
    }
}

//! The air an aircraft flies in: steady wind, MIL-spec turbulence, discrete gusts.

/// The air around the aircraft; the default is calm.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Air {
    /// Steady wind, the velocity of the air over the ground, north-east-down, m/s.
    pub wind_ned_mps: [f64; 3],
    /// Continuous turbulence, if any.
    pub turbulence: Option<Turbulence>,
    /// One-minus-cosine gusts; they must not overlap in time.
    pub gusts: Vec<Gust>,
}

/// Dryden turbulence of MIL-F-8785C in the discretisation of MIL-STD-1797A (JSBSim `ttMilspec`).
///
/// Below 1000 ft the intensity is 0.1 of `wind_20ft_mps`. Above 2000 ft it is read from the standard's table, as a function of
/// `severity` alone. Between these altitudes it is interpolated linearly. An episode that starts at 600 m (1969 ft) therefore
/// depends almost only on `severity`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turbulence {
    /// Wind speed 20 ft above ground, m/s, not negative: 7.6 light, 15 moderate, 23 severe.
    pub wind_20ft_mps: f64,
    /// Index of the standard's probability-of-exceedance curve, 1 to 7: 3 light, 4 moderate, 6 severe.
    pub severity: u8,
}

/// A gust whose velocity rises as one minus cosine, holds its peak and falls as one minus cosine (JSBSim `cosine-gust`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gust {
    /// Start, s of the plant's time; the gust begins in the first step at or after this time.
    pub start_s: f64,
    /// Velocity at the peak, north-east-down, m/s; not zero.
    pub velocity_ned_mps: [f64; 3],
    /// Duration of the rise, s, positive.
    pub rise_s: f64,
    /// Duration at the peak, s, not negative.
    pub hold_s: f64,
    /// Duration of the fall, s, positive.
    pub fall_s: f64,
}

impl Gust {
    /// End of the gust, s of the plant's time.
    pub fn end_s(&self) -> f64 {
        self.start_s + self.rise_s + self.hold_s + self.fall_s
    }
}

/// Why the air is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AirError {
    /// A component of the steady wind is not finite or exceeds the accepted range.
    #[error("steady wind: {value} m/s is not within ±{MAX_AIR_MPS} m/s; give finite components")]
    Wind {
        /// The component that is out of range, m/s.
        value: f64,
    },
    /// Turbulence outside the tables of the standard.
    #[error(
        "turbulence: wind at 20 ft {wind_20ft_mps} m/s with severity {severity}; give a wind from 0 \
         to {MAX_AIR_MPS} m/s and a severity from 1 to 7"
    )]
    Turbulence {
        /// Wind at 20 ft, m/s.
        wind_20ft_mps: f64,
        /// Severity as given; 1 to 7 are allowed.
        severity: u8,
    },
    /// A gust with an invalid shape.
    #[error(
        "gust {index}: start and hold must not be negative, rise and fall must be positive, the \
         velocity must be within ±{MAX_AIR_MPS} m/s and not zero"
    )]
    Gust {
        /// Position in the list, from 0.
        index: usize,
    },
    /// Two gusts overlap, which JSBSim cannot simulate.
    #[error(
        "gusts overlap: one starts at {start_s} s before the one before it ends at {end_s} s; move it"
    )]
    Overlap {
        /// Start of the later gust, s.
        start_s: f64,
        /// End of the earlier gust, s.
        end_s: f64,
    },
}

/// Largest accepted magnitude of an air velocity or of one of its components, m/s.
const MAX_AIR_MPS: f64 = 100.0;

impl Air {
    /// Checks the air and returns it with its gusts sorted by start time.
    ///
    /// # Errors
    /// [`AirError`] if a wind or turbulence figure is out of range, a gust has an invalid shape, or two gusts overlap.
    pub fn checked(mut self) -> Result<Self, AirError> {
        if let Some(&value) = self.wind_ned_mps.iter().find(|v| !is_speed(**v)) {
            return Err(AirError::Wind { value });
        }
        if let Some(Turbulence { wind_20ft_mps, severity }) = self.turbulence
            && !(is_speed(wind_20ft_mps) && wind_20ft_mps >= 0.0 && (1..=7).contains(&severity))
        {
            return Err(AirError::Turbulence { wind_20ft_mps, severity });
        }
        if let Some(index) = self.gusts.iter().position(|gust| !has_shape(gust)) {
            return Err(AirError::Gust { index });
        }
        self.gusts.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        for pair in self.gusts.windows(2) {
            if pair[1].start_s < pair[0].end_s() + GUST_GAP_S {
                return Err(AirError::Overlap { start_s: pair[1].start_s, end_s: pair[0].end_s() });
            }
        }
        Ok(self)
    }
}

/// Least time from the end of a gust to the next start, s: JSBSim clears a gust two frames (of 10 ms) after its end.
const GUST_GAP_S: f64 = 0.02;

fn is_speed(v: f64) -> bool {
    v.is_finite() && v.abs() <= MAX_AIR_MPS
}

fn has_shape(gust: &Gust) -> bool {
    let positive = |v: f64| v.is_finite() && v > 0.0;
    let not_negative = |v: f64| v.is_finite() && v >= 0.0;
    not_negative(gust.start_s)
        && not_negative(gust.hold_s)
        && positive(gust.rise_s)
        && positive(gust.fall_s)
        && gust.velocity_ned_mps.iter().all(|v| is_speed(*v))
        && gust.velocity_ned_mps.iter().any(|v| *v != 0.0)
}

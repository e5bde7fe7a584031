//! The state vector of the model: eight flight states.

use greylag_num::{Real, each};

/// The physical state s^p = \[φ, θ, V_a, p, q, r, α, β\], eq. (4) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct State<R = f64> {
    /// Roll angle φ, rad.
    pub roll: R,
    /// Pitch angle θ, rad.
    pub pitch: R,
    /// True airspeed V_a, m/s.
    pub airspeed: R,
    /// Roll rate p, body axes, rad/s.
    pub p: R,
    /// Pitch rate q, body axes, rad/s.
    pub q: R,
    /// Yaw rate r, body axes, rad/s.
    pub r: R,
    /// Angle of attack α, rad.
    pub alpha: R,
    /// Sideslip angle β, rad.
    pub beta: R,
}

impl State {
    /// Names of the components, in the order of [`State::to_array`], with their units.
    pub const NAMES: [&'static str; 8] = [
        "roll_rad",
        "pitch_rad",
        "airspeed_mps",
        "p_radps",
        "q_radps",
        "r_radps",
        "alpha_rad",
        "beta_rad",
    ];

    /// The initial state of an episode (one flight): wings level, α = β = 0, 16.67 m/s (section V-A of \[GSFM26\]).
    pub const NEUTRAL: State = State {
        roll: 0.0,
        pitch: 0.0,
        airspeed: 16.67,
        p: 0.0,
        q: 0.0,
        r: 0.0,
        alpha: 0.0,
        beta: 0.0,
    };

    /// Whether every component is a finite number.
    pub fn is_finite(&self) -> bool {
        self.to_array().iter().all(|x| x.is_finite())
    }
}

impl<R: Copy> State<R> {
    /// The components in the order of eq. (4) of \[GSFM26\].
    #[inline(always)]
    pub fn to_array(&self) -> [R; 8] {
        [self.roll, self.pitch, self.airspeed, self.p, self.q, self.r, self.alpha, self.beta]
    }

    /// A state from components in the order of eq. (4) of \[GSFM26\].
    #[inline(always)]
    pub fn from_array([roll, pitch, airspeed, p, q, r, alpha, beta]: [R; 8]) -> Self {
        State { roll, pitch, airspeed, p, q, r, alpha, beta }
    }

    /// Converts every component with `f`.
    #[inline(always)]
    pub fn map<S: Copy>(&self, f: impl FnMut(R) -> S) -> State<S> {
        State::from_array(each(self.to_array(), f))
    }
}

impl<R: Real> State<R> {
    /// Euler step: `self + step · rate` for each component.
    #[inline(always)]
    pub fn advance(&self, rate: &State<R>, step: f64) -> Self {
        State {
            roll: self.roll + rate.roll.scale(step),
            pitch: self.pitch + rate.pitch.scale(step),
            airspeed: self.airspeed + rate.airspeed.scale(step),
            p: self.p + rate.p.scale(step),
            q: self.q + rate.q.scale(step),
            r: self.r + rate.r.scale(step),
            alpha: self.alpha + rate.alpha.scale(step),
            beta: self.beta + rate.beta.scale(step),
        }
    }

    /// Selects `then` in the SIMD lanes in which `chosen` is above zero, and `self` in the others.
    #[inline(always)]
    pub fn replaced(&self, chosen: R, then: &State<R>) -> Self {
        let (mut all, then) = (self.to_array(), then.to_array());
        for (x, then) in all.iter_mut().zip(then) {
            *x = R::where_less(R::zero(), chosen, then, *x);
        }
        State::from_array(all)
    }
}

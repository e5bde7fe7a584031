//! What a plan costs, and what it starts from.

/// Sizes of the errors that are as bad as one another (Bryson's rule), and what a tick does with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Attitude error, rad.
    pub attitude: f64,
    /// Attitude error beyond which the cost grows linearly (pseudo-Huber), rad; `None`: it is quadratic throughout.
    pub far: Option<f64>,
    /// Body rates beside those of the steady turn, rad/s.
    pub rate: f64,
    /// Sideslip beside the steady one, rad.
    pub sideslip: f64,
    /// A step of the command, in units of the largest deflection.
    pub moves: f64,
    /// What the last state costs, in stages.
    pub last: f64,
    /// Whether the envelope's load factor, incidence and sideslip cost where they are passed.
    pub envelope: Option<Barrier>,
    /// Iterations a tick.
    pub iterations: usize,
    /// Where a tick may start from beside the last plan and the LQI's.
    pub start: Start,
}

/// What passing a limit costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Barrier {
    /// Part of the limit from which on it costs.
    pub part: f64,
    /// Excess of the load factor that is as bad as an error of `attitude`, g.
    pub load: f64,
    /// Excess of the angle of attack, rad.
    pub alpha: f64,
    /// Excess of the sideslip, rad.
    pub sideslip: f64,
}

/// A start beside the last plan and the LQI's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// None.
    Own,
    /// The way that the policy would fly in the model, where there is a policy.
    Policy,
}

impl Settings {
    /// Those of `ilqr`. Of a few tried on every seventh target they settle as soon as any and are the steadiest in moderate
    /// turbulence.
    pub const PLAIN: Settings = Settings {
        attitude: 0.05,
        far: None,
        rate: 2.0,
        sideslip: 0.3,
        moves: 0.3,
        last: 20.0,
        envelope: None,
        iterations: 1,
        start: Start::Own,
    };
    /// Those of `hybrid-ilqr`.
    pub const HYBRID: Settings = Settings {
        far: Some(0.15),
        envelope: Some(Barrier { part: 0.94, load: 0.05, alpha: 0.01, sideslip: 0.05 }),
        start: Start::Policy,
        ..Settings::PLAIN
    };
}

//! Settings of iLQR: cost scales and starting points.

/// Cost scales by Bryson's rule (errors of these sizes cost the same), and the number of iterations per tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Attitude error scale, rad.
    pub attitude: f64,
    /// Attitude error beyond which the cost grows linearly (pseudo-Huber), rad; `None` keeps it quadratic.
    pub far: Option<f64>,
    /// Scale of body rates relative to the steady turn, rad/s.
    pub rate: f64,
    /// Scale of sideslip relative to the steady turn, rad.
    pub sideslip: f64,
    /// Scale of a change of the command, as a fraction of the largest deflection.
    pub moves: f64,
    /// Weight of the terminal state as a multiple of a stage.
    pub last: f64,
    /// Soft limits on load factor, incidence and sideslip; `None` leaves them out.
    pub envelope: Option<Barrier>,
    /// Reference that the plan follows.
    pub towards: Towards,
    /// Iterations per tick.
    pub iterations: usize,
    /// Starting points other than the last plan and the LQI's.
    pub start: Start,
}

/// Soft limits: scales of the excess over the envelope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Barrier {
    /// Fraction of the limit from which it costs.
    pub part: f64,
    /// Scale of the load-factor excess, g.
    pub load: f64,
    /// Scale of the angle-of-attack excess, rad.
    pub alpha: f64,
    /// Scale of the sideslip excess, rad.
    pub sideslip: f64,
}

/// Starting points other than the last plan and the LQI's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// No further starting point.
    Own,
    /// The policy's simulated flight, where there is a policy.
    Policy,
}

/// Reference that the plan follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Towards {
    /// The target itself, at once.
    Target,
    /// A path to the target within the rates and the load factor that the aircraft can fly.
    Path,
}

impl Settings {
    /// Settings of `ilqr`. Among a few variants, flown on every seventh target, they settle as fast as any and are
    /// the steadiest in moderate turbulence.
    pub const PLAIN: Settings = Settings {
        attitude: 0.05,
        far: None,
        rate: 2.0,
        sideslip: 0.3,
        moves: 0.3,
        last: 20.0,
        envelope: None,
        towards: Towards::Target,
        iterations: 1,
        start: Start::Own,
    };
    /// Settings of the controller `hybrid-ilqr`.
    pub const HYBRID: Settings = Settings {
        moves: 0.15,
        far: Some(0.15),
        envelope: Some(Barrier { part: 0.94, load: 0.05, alpha: 0.01, sideslip: 0.05 }),
        towards: Towards::Path,
        start: Start::Policy,
        ..Settings::PLAIN
    };
}

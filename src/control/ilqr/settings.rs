//! Settings of iLQR (iterative linear-quadratic regulator): cost scales, the reference, iterations and starting points.

/// Settings of iLQR. The cost scales follow Bryson's rule: an error of the size of its scale has the same cost in every term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Attitude error scale, rad.
    pub attitude: f64,
    /// Attitude error beyond which the cost grows linearly (pseudo-Huber), rad. `None` keeps the cost quadratic.
    pub far: Option<f64>,
    /// Scale of the difference between the body rates and their reference, rad/s.
    pub rate: f64,
    /// Scale of the difference between the sideslip and that of the steady turn, rad.
    pub sideslip: f64,
    /// Scale of the change of a command from one step to the next, as a fraction of full command.
    pub moves: f64,
    /// Weight of the terminal state's cost as a multiple of the other steps' weight.
    pub last: f64,
    /// Soft limits on load factor, angle of attack and sideslip. `None` omits them.
    pub envelope: Option<Barrier>,
    /// Reference that the plan follows.
    pub towards: Towards,
    /// Largest accepted difference between the attitude and its prediction a quarter of a second before, rad. After a larger
    /// difference the LQI flies for 5 s. `None` disables the comparison.
    pub missed: Option<f64>,
    /// Number of iterations per tick.
    pub iterations: usize,
    /// Starting points in addition to the last plan and the LQI's commands.
    pub start: Start,
}

/// Soft limits of the envelope: where they begin, and the scales of the excess.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Barrier {
    /// Fraction of the envelope's limit above which a quantity adds to the cost.
    pub part: f64,
    /// Scale of the load-factor excess, g.
    pub load: f64,
    /// Scale of the angle-of-attack excess, rad.
    pub alpha: f64,
    /// Scale of the sideslip excess, rad.
    pub sideslip: f64,
}

/// Starting points in addition to the last plan and the LQI's commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// No further starting point.
    Own,
    /// The policy's simulated flight, if there is a policy.
    Policy,
}

/// Reference that the plan follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Towards {
    /// The target itself from the first step on.
    Target,
    /// A path to the target within the rates and the load factors that the aircraft can fly.
    Path,
}

impl Settings {
    /// Settings of the controller `ilqr`. Several variants flew every seventh target of the target file. With these settings the
    /// attitude settles as fast as with any other variant and is the steadiest in moderate turbulence.
    pub const PLAIN: Settings = Settings {
        attitude: 0.05,
        far: None,
        rate: 2.0,
        sideslip: 0.3,
        moves: 0.3,
        last: 20.0,
        envelope: None,
        towards: Towards::Target,
        missed: None,
        iterations: 1,
        start: Start::Own,
    };
    /// Settings of the controller `hybrid-ilqr`.
    pub const HYBRID: Settings = Settings {
        moves: 0.15,
        far: Some(0.15),
        envelope: Some(Barrier { part: 0.94, load: 0.05, alpha: 0.01, sideslip: 0.05 }),
        towards: Towards::Path,
        // with limits from 0.12 to 0.3 rad no step response of an aircraft whose coefficients were drawn from their
        // standard deviations diverged (results/flight-quality.txt)
        missed: Some(0.15),
        start: Start::Policy,
        ..Settings::PLAIN
    };
}

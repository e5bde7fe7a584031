//! Design of the LQI (linear quadratic controller with integral action) at one flight condition.

use nalgebra::{RowSVector, SMatrix, SVector};

use super::riccati;
use greylag_model::{GreyBox, Linear, STEP, Trim, linearise};
use greylag_physics::servos::Surface;

/// Number of states of the design: φ θ p q r α β, then four for aileron and four for elevator, then ∫φ and ∫θ. The four
/// states of a surface are its deflection now and one step ago, and its last two commanded deflections.
pub(super) const STATES: usize = 17;

/// Number of additional states of a design with a rudder: its deflection now and one step ago, and its last two commanded
/// deflections.
pub(super) const RUDDER_STATES: usize = 4;
pub(super) const ALL: usize = STATES + RUDDER_STATES;

/// The LQI gain at one flight condition.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gain {
    /// Gain rows of aileron and elevator, rad per unit of each state.
    pub surfaces: SMatrix<f64, 2, STATES>,
    /// The rows and columns for the rudder. `None` for an aircraft without a rudder.
    pub rudder: Option<RudderGain>,
}

/// The rows and columns that a rudder adds to the gain.
#[derive(Clone, Copy, Debug)]
pub(super) struct RudderGain {
    /// Gains from the rudder's four states to aileron and elevator.
    pub coupling: SMatrix<f64, 2, RUDDER_STATES>,
    /// Gains from the other states to the rudder.
    pub row: RowSVector<f64, STATES>,
    /// Gains from the rudder's four states to the rudder.
    pub own: RowSVector<f64, RUDDER_STATES>,
}

impl Gain {
    /// Zero gain, with or without a rudder.
    pub fn zeros(with_rudder: bool) -> Gain {
        let rudder = with_rudder.then(|| RudderGain {
            coupling: SMatrix::zeros(),
            row: RowSVector::zeros(),
            own: RowSVector::zeros(),
        });
        Gain { surfaces: SMatrix::zeros(), rudder }
    }

    /// Adds `other` multiplied by `part` to this gain.
    pub fn add(&mut self, other: &Gain, part: f64) {
        self.surfaces += other.surfaces * part;
        if let (Some(rudder), Some(other)) = (&mut self.rudder, &other.rudder) {
            rudder.coupling += other.coupling * part;
            rudder.row += other.row * part;
            rudder.own += other.own * part;
        }
    }
}

/// Indices of φ θ p q r α β in the model's state. Airspeed is a scheduling variable and is not fed back.
const ATTITUDE_STATES: [usize; 7] = [0, 1, 3, 4, 5, 6, 7];

/// Cost scales by Bryson's rule. The weight of a cost term is one over the square of its scale. A larger scale therefore gives
/// the term less weight.
///
/// The scales were tuned on the model `params/x8/jsbsim.toml` for a small settled error, the mean attitude error over the last
/// fifth of a flight to a commanded attitude. The settled error is not sensitive to the scales.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Attitude error scale, rad.
    pub attitude: f64,
    /// Scale of the integrated attitude error, rad s.
    pub integral: f64,
    /// Body rate scale, rad/s.
    pub rate: f64,
    /// Sideslip scale without a rudder, rad.
    pub sideslip: f64,
    /// Sideslip scale with a rudder, rad.
    pub sideslip_by_rudder: f64,
    /// Scale of the deviation of the commanded deflection from trim, rad.
    pub deflection: f64,
}

impl Weights {
    /// Weights of the default design.
    pub const DEFAULT: Weights = Weights {
        attitude: 0.05,
        integral: 0.02,
        rate: 2.0,
        sideslip: 0.3,
        sideslip_by_rudder: 0.03,
        deflection: 0.3,
    };
    /// Weights of softer loops with a larger delay margin. In pitch the margin is 104 ms; with the default weights it is 46 ms.
    /// With ArduPlane's filter and sampling it is 78 ms; with the default weights it is 32 ms (`examples/delay_margin.rs`).
    /// Weights of 0.15 (attitude), 0.1 (integral) and 0.15 (deflection) give 200 ms.
    pub const DAMPED: Weights =
        Weights { attitude: 0.08, integral: 0.05, deflection: 0.2, ..Weights::DEFAULT };
}

/// The gain at `trim` and `altitude` (m). `None` if the model cannot be stabilised at this trim.
pub(super) fn design(model: &GreyBox, trim: &Trim, altitude: f64, w: &Weights) -> Option<Gain> {
    Some(match loops(model, trim, altitude, w)? {
        Loops::Two(_, _, k) => Gain { surfaces: k, rudder: None },
        Loops::Three(_, _, k) => {
            let rudder = RudderGain {
                coupling: k.fixed_view::<2, RUDDER_STATES>(0, STATES).into(),
                row: k.fixed_view::<1, STATES>(2, 0).into(),
                own: k.fixed_view::<1, RUDDER_STATES>(2, STATES).into(),
            };
            Gain { surfaces: k.fixed_view::<2, STATES>(0, 0).into(), rudder: Some(rudder) }
        }
    })
}

/// The matrices a, b and k of a discrete linear system with state feedback: x₊ = a x + b u, u = −k x.
type Closed<const N: usize, const M: usize> =
    (SMatrix<f64, N, N>, SMatrix<f64, N, M>, SMatrix<f64, M, N>);

/// The matrices a, b and k of the design at one flight condition.
#[expect(clippy::large_enum_variant, reason = "one lives at a time, while a gain is designed")]
pub(super) enum Loops {
    /// Two inputs: aileron and elevator.
    Two(SMatrix<f64, STATES, STATES>, SMatrix<f64, STATES, 2>, SMatrix<f64, 2, STATES>),
    /// Three inputs: aileron, elevator and rudder.
    Three(SMatrix<f64, ALL, ALL>, SMatrix<f64, ALL, 3>, SMatrix<f64, 3, ALL>),
}

/// Designs the gain at `trim` and `altitude` (m). `None` if the model cannot be stabilised at this trim.
pub(super) fn loops(model: &GreyBox, trim: &Trim, altitude: f64, w: &Weights) -> Option<Loops> {
    let linear = linearise(model, trim, altitude);
    let figures = &model.airframe.actuators;
    let (aileron, elevator) = ((0, 7, &figures.aileron), (1, 11, &figures.elevator));
    match &figures.rudder {
        Some(rudder) if model.has_rudder() => {
            let surfaces = [aileron, elevator, (3, STATES, rudder)];
            let (a, b, k) = solve(&linear, surfaces, w.sideslip_by_rudder, w)?;
            Some(Loops::Three(a, b, k))
        }
        _ => {
            let (a, b, k) = solve(&linear, [aileron, elevator], w.sideslip, w)?;
            Some(Loops::Two(a, b, k))
        }
    }
}

/// A surface of the design: its column in the linear model, the index of its first state, and its actuator filter.
type Actuated<'a> = (usize, usize, &'a Surface);

/// Designs the gain for N states and M `surfaces`, with the sideslip scale `sideslip` (rad). `None` if the system cannot be
/// stabilised.
fn solve<const N: usize, const M: usize>(
    linear: &Linear,
    surfaces: [Actuated; M],
    sideslip: f64,
    w: &Weights,
) -> Option<Closed<N, M>> {
    let (a, b) = augmented(linear, surfaces);
    let square = |x: f64| 1.0 / (x * x);
    let mut q = SVector::<f64, N>::zeros();
    (q[0], q[1]) = (square(w.attitude), square(w.attitude));
    (q[2], q[3], q[4]) = (square(w.rate), square(w.rate), square(w.rate));
    q[6] = square(sideslip);
    (q[15], q[16]) = (square(w.integral), square(w.integral));
    let r = SMatrix::<f64, M, M>::from_diagonal_element(square(w.deflection));
    let k = riccati::gain(&a, &b, &SMatrix::from_diagonal(&q), &r)?;
    Some((a, b, k))
}

/// Attitude dynamics, actuator filters and integrators as one discrete linear system.
fn augmented<const N: usize, const M: usize>(
    linear: &Linear,
    surfaces: [Actuated; M],
) -> (SMatrix<f64, N, N>, SMatrix<f64, N, M>) {
    let mut a = SMatrix::<f64, N, N>::zeros();
    let mut b = SMatrix::<f64, N, M>::zeros();
    for (i, from) in ATTITUDE_STATES.into_iter().enumerate() {
        for (j, to) in ATTITUDE_STATES.into_iter().enumerate() {
            a[(i, j)] = linear.a[(from, to)];
        }
        for (column, at, _) in surfaces {
            a[(i, at)] = linear.b[(from, column)];
        }
    }
    for (surface, (_, at, figures)) in surfaces.into_iter().enumerate() {
        let [b0, a1, a2] = figures.filter;
        let (position, before, input, input_before) = (at, at + 1, at + 2, at + 3);
        a[(position, position)] = -a1;
        a[(position, before)] = -a2;
        a[(position, input)] = 2.0 * b0;
        a[(position, input_before)] = b0;
        b[(position, surface)] = b0;
        a[(before, position)] = 1.0;
        b[(input, surface)] = 1.0;
        a[(input_before, input)] = 1.0;
    }
    for axis in 0..2 {
        a[(15 + axis, axis)] = STEP;
        a[(15 + axis, 15 + axis)] = 1.0;
    }
    (a, b)
}

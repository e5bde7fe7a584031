//! Trim: the controls that hold a steady flight condition.

use super::GreyBox;
use super::jacobian::Four;
use super::newton;
use greylag_num::Real;
use greylag_physics::{Controls, State};

/// Angle by which a descent at full throttle must be shallower than the glide at idle, rad. Otherwise the glide at idle is
/// used.
const SHALLOWER: f64 = 1e-6;
/// Number of bisections of the throttle, which gives double precision.
const HALVINGS: usize = 52;

/// A steady flight condition and the controls that hold it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    /// The state. Its rates are zero, except the airspeed's in the case described at [`Trim::attitude`].
    pub state: State,
    /// Controls that hold the condition.
    pub controls: Controls,
    /// Rate of change of the airspeed V̇, m/s², if the throttle is at a limit and cannot hold the airspeed. Otherwise zero.
    pub acceleration: f64,
}

/// Reason why a condition has no trim.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "model {model} has no trim at roll {roll_deg:.1}°, pitch {pitch_deg:.1}°, {airspeed_mps:.1} m/s: \
     the aircraft cannot hold it there; ask for less bank or pitch, or for more airspeed"
)]
pub struct TrimError {
    /// Name of the model.
    pub model: String,
    /// Requested roll angle, degrees.
    pub roll_deg: f64,
    /// Requested pitch angle, degrees.
    pub pitch_deg: f64,
    /// Requested airspeed, m/s.
    pub airspeed_mps: f64,
}

impl Trim {
    /// Straight and level flight at `airspeed` (m/s) and `altitude` (m): γ = 0, and thus θ = α.
    ///
    /// The controls may lie outside their ranges. The caller must check whether the aircraft has this throttle and travel.
    ///
    /// # Errors
    /// If no controls hold level flight at this airspeed.
    pub fn level(model: &GreyBox, airspeed: f64, altitude: f64) -> Result<Trim, TrimError> {
        if airspeed.is_nan() || airspeed <= 0.0 {
            return Err(failure(model, 0.0, 0.0, airspeed));
        }
        let condition = |x: [Four; 3]| level_condition(x, airspeed);
        let from = |throttle: f64| {
            let x = newton::solve([0.03, 0.0, throttle], [0.1, 0.2, 0.5], |x| {
                let (state, controls) = condition(x);
                let rate = model.rate(&state, &controls, altitude);
                [rate.airspeed, rate.q, rate.alpha]
            })?;
            let (state, controls) = level_condition(x, airspeed);
            Some(Trim { state, controls, acceleration: 0.0 })
        };
        within_stops(from, 0.2)
            .or_else(|| halved(|held| straight_at(model, airspeed, altitude, held), Trim::path))
            .ok_or_else(|| failure(model, 0.0, 0.0, airspeed))
    }

    /// Straight flight with level wings at `airspeed` (m/s) and `altitude` (m). The flight is level if a throttle within 0..1
    /// holds level flight. Otherwise it is a descent: at full throttle if this is shallower than the glide at idle, else at
    /// idle. If no descent has a trim, the result is that of `Trim::level`.
    ///
    /// # Errors
    /// If neither level flight nor a descent has a trim.
    pub fn straight(model: &GreyBox, airspeed: f64, altitude: f64) -> Result<Trim, TrimError> {
        match Trim::level(model, airspeed, altitude) {
            Ok(level) if (0.0..=1.0).contains(&level.controls.throttle) => Ok(level),
            // with a propeller that brakes at low throttle, the level trim may have a negative throttle
            level => descent(model, airspeed, altitude).map_or(level, Ok),
        }
    }

    /// Flight-path angle with level wings and zero sideslip, rad, positive upwards.
    pub fn path(&self) -> f64 {
        self.state.pitch - self.state.alpha
    }

    /// A steady turn that holds roll and pitch (rad) at `airspeed` (m/s) and `altitude` (m).
    ///
    /// If the throttle that holds the airspeed is outside 0..1, it is set to the limit. The airspeed then changes with
    /// [`acceleration`](Trim::acceleration).
    ///
    /// # Errors
    /// If no deflections hold this attitude.
    pub fn attitude(
        model: &GreyBox,
        roll: f64,
        pitch: f64,
        airspeed: f64,
        altitude: f64,
    ) -> Result<Trim, TrimError> {
        let fail = || failure(model, roll, pitch, airspeed);
        let solve = |thrust| solve_attitude(model, roll, pitch, [airspeed, altitude], thrust);
        let held = |stop: f64| {
            let mut held = solve(Thrust::Held(stop))?;
            held.acceleration = model.rate(&held.state, &held.controls, altitude).airspeed;
            Some(held)
        };
        match within_stops(|start| solve(Thrust::From(start)), 0.3) {
            Some(free) if (0.0..=1.0).contains(&free.controls.throttle) => Ok(free),
            Some(free) => held(free.controls.throttle.clamp(0.0, 1.0)).ok_or_else(fail),
            // a thrust that is nonlinear in throttle may not give the required thrust at any throttle
            None => held(0.0)
                .filter(|idle| idle.acceleration >= 0.0)
                .or_else(|| held(1.0).filter(|full| full.acceleration <= 0.0))
                .or_else(|| halved(held, |trim| trim.acceleration))
                .ok_or_else(fail),
        }
    }
}

/// The trim found from the initial throttle `start`. If its throttle is outside 0..1, the search is repeated from full
/// throttle, and the second trim is used if its throttle is within 0..1. Two trims exist if the thrust first falls and then
/// rises with throttle, as for a windmilling propeller.
fn within_stops(from: impl Fn(f64) -> Option<Trim>, start: f64) -> Option<Trim> {
    let holds = |trim: &Trim| (0.0..=1.0).contains(&trim.controls.throttle);
    let first = from(start);
    if first.as_ref().is_some_and(holds) {
        return first;
    }
    from(1.0).filter(holds).or(first)
}

/// The trim at the throttle at which the quantity `left` of the trim rises through zero, found by bisection. Newton's method
/// may oscillate about a kink of a thrust table. `None` if `left` does not rise through zero between idle and full throttle.
fn halved(held: impl Fn(f64) -> Option<Trim>, left: impl Fn(&Trim) -> f64) -> Option<Trim> {
    let [idle, full] = [held(0.0)?, held(1.0)?];
    if !(left(&idle) < 0.0 && left(&full) > 0.0) {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if left(&held(middle)?) < 0.0 { low = middle } else { high = middle }
    }
    held(high)
}

/// The descent at `airspeed` (m/s) and full throttle if it is shallower than the glide at idle, else the glide.
fn descent(model: &GreyBox, airspeed: f64, altitude: f64) -> Option<Trim> {
    let [idle, full] = [0.0, 1.0].map(|throttle| straight_at(model, airspeed, altitude, throttle));
    let powered = |full: &Trim| {
        full.path() < 0.0 && idle.as_ref().is_none_or(|idle| full.path() > idle.path() + SHALLOWER)
    };
    full.filter(powered).or(idle)
}

/// Straight flight at `airspeed` (m/s), `altitude` (m) and the given throttle. The unknowns are α, δe and θ.
fn straight_at(model: &GreyBox, airspeed: f64, altitude: f64, throttle: f64) -> Option<Trim> {
    let condition = |[alpha, elevator, pitch]: [Four; 3]| {
        let held = Four::from_f64(throttle);
        let (mut state, controls) = level_condition([alpha, elevator, held], airspeed);
        state.pitch = pitch;
        (state, controls)
    };
    let x = newton::solve([0.03, 0.0, 0.0], [0.1, 0.2, 0.1], |x| {
        let (state, controls) = condition(x);
        let rate = model.rate(&state, &controls, altitude);
        [rate.airspeed, rate.q, rate.alpha]
    })?;
    let (mut state, controls) = level_condition([x[0], x[1], throttle], airspeed);
    state.pitch = x[2];
    Some(Trim { state, controls, acceleration: 0.0 })
}

/// Treatment of the throttle when an attitude is trimmed.
#[derive(Clone, Copy)]
enum Thrust {
    /// The throttle is an unknown that holds the airspeed. The value is its initial guess.
    From(f64),
    /// The throttle is fixed at this value.
    Held(f64),
}

fn level_condition<R: Real>(
    [alpha, elevator, throttle]: [R; 3],
    airspeed: f64,
) -> (State<R>, Controls<R>) {
    let zero = R::zero();
    let state = State {
        roll: zero,
        pitch: alpha,
        airspeed: R::from_f64(airspeed),
        p: zero,
        q: zero,
        r: zero,
        alpha,
        beta: zero,
    };
    (state, Controls { aileron: zero, elevator, throttle, rudder: zero, lagged: None })
}

/// Solves for α, the lateral unknown, p, q, r, δa, δe and δt. If the model has a rudder that yaws, the lateral unknown is δr
/// at β = 0 (a coordinated turn), else β at δr = 0. With a fixed throttle, δt = throttle replaces V̇ = 0.
fn solve_attitude(
    model: &GreyBox,
    roll: f64,
    pitch: f64,
    [airspeed, altitude]: [f64; 2],
    thrust: Thrust,
) -> Option<Trim> {
    let sideways = Sideways::of(model);
    // the initial rates are those of a point mass in a coordinated turn, which are close to the solution
    let turn = model.atmosphere.gravity / airspeed * roll.tan();
    let start = [
        0.05,
        0.0,
        -turn * pitch.sin(),
        turn * pitch.cos() * roll.sin(),
        turn * pitch.cos() * roll.cos(),
        0.0,
        0.0,
        match thrust {
            Thrust::From(start) => start,
            Thrust::Held(_) => 0.3,
        },
    ];
    let x = newton::solve(start, [0.1, 0.1, 0.5, 0.5, 0.5, 0.2, 0.2, 0.5], |x| {
        let (state, controls) = attitude_condition(x, roll, pitch, airspeed, sideways);
        let rate = model.rate(&state, &controls, altitude);
        let along = match thrust {
            Thrust::Held(t) => x[7] - Four::from_f64(t),
            Thrust::From(_) => rate.airspeed,
        };
        [rate.roll, rate.pitch, rate.p, rate.q, rate.r, rate.alpha, rate.beta, along]
    })?;
    let (state, controls) = attitude_condition(x, roll, pitch, airspeed, sideways);
    Some(Trim { state, controls, acceleration: 0.0 })
}

/// Lateral unknown of a turn.
#[derive(Clone, Copy)]
enum Sideways {
    /// Sideslip at zero rudder.
    Sideslip,
    /// Rudder at zero sideslip.
    Rudder,
}

impl Sideways {
    fn of(model: &GreyBox) -> Sideways {
        if model.has_rudder() { Sideways::Rudder } else { Sideways::Sideslip }
    }
}

fn attitude_condition<R: Real>(
    x: [R; 8],
    roll: f64,
    pitch: f64,
    airspeed: f64,
    sideways: Sideways,
) -> (State<R>, Controls<R>) {
    let [alpha, free, p, q, r, aileron, elevator, throttle] = x;
    let (beta, rudder) = match sideways {
        Sideways::Sideslip => (free, R::zero()),
        Sideways::Rudder => (R::zero(), free),
    };
    let [roll, pitch, airspeed] = [roll, pitch, airspeed].map(R::from_f64);
    (
        State { roll, pitch, airspeed, p, q, r, alpha, beta },
        Controls { aileron, elevator, throttle, rudder, lagged: None },
    )
}

fn failure(model: &GreyBox, roll: f64, pitch: f64, airspeed: f64) -> TrimError {
    TrimError {
        model: model.name.clone(),
        roll_deg: roll.to_degrees(),
        pitch_deg: pitch.to_degrees(),
        airspeed_mps: airspeed,
    }
}

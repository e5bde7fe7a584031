//! Trim: the deflections that hold a flight condition.

use super::GreyBox;
use super::newton;
use greylag_num::{Dual, Real};
use greylag_physics::{Controls, State};

/// Path angle by which a descent at full throttle must be shallower than at idle to be one with an engine, rad.
const SHALLOWER: f64 = 1e-6;
/// Bisections of the throttle: to the last digit.
const HALVINGS: usize = 52;

/// A steady flight condition with the controls that hold it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trim {
    /// The state, whose rates vanish (see [`Trim::attitude`] for airspeed).
    pub state: State,
    /// The controls.
    pub controls: Controls,
    /// What is left of V̇ where the throttle is at its stop, m/s²; else zero.
    pub acceleration: f64,
}

/// Why a condition has no trim.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "model {model} has no trim at roll {roll_deg:.1}°, pitch {pitch_deg:.1}°, {airspeed_mps:.1} m/s: \
     the aircraft cannot hold it there; ask for less bank or pitch, or for more airspeed"
)]
pub struct TrimError {
    /// The model's name.
    pub model: String,
    /// Roll asked for.
    pub roll_deg: f64,
    /// Pitch asked for.
    pub pitch_deg: f64,
    /// Airspeed asked for.
    pub airspeed_mps: f64,
}

impl Trim {
    /// Straight and level at `airspeed` (m/s) and `altitude` (m): γ = 0, so θ = α.
    ///
    /// The controls that hold it may lie beyond their stops: whether the aircraft has that much
    /// thrust is for the caller to see.
    ///
    /// # Errors
    /// If no controls hold level flight at that airspeed.
    pub fn level(model: &GreyBox, airspeed: f64, altitude: f64) -> Result<Trim, TrimError> {
        if airspeed.is_nan() || airspeed <= 0.0 {
            return Err(failure(model, 0.0, 0.0, airspeed));
        }
        let condition = |x: [Dual<3>; 3]| level_condition(x, airspeed);
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

    /// Straight flight with level wings at `airspeed` (m/s) and `altitude` (m): level, or where no throttle holds level
    /// flight the descent at full throttle if that is shallower, else at idle, as a glider's.
    ///
    /// # Errors
    /// If no elevator holds either.
    pub fn straight(model: &GreyBox, airspeed: f64, altitude: f64) -> Result<Trim, TrimError> {
        Trim::level(model, airspeed, altitude)
            .or_else(|why| descent(model, airspeed, altitude).ok_or(why))
    }

    /// Angle of the flight path above the horizon with level wings and no sideslip, rad.
    pub fn path(&self) -> f64 {
        self.state.pitch - self.state.alpha
    }

    /// A steady turn that holds roll and pitch (rad) at `airspeed` (m/s) and `altitude` (m).
    ///
    /// Where the throttle that would hold the airspeed lies beyond its stops it is left at the
    /// stop, and the airspeed drifts with [`acceleration`](Trim::acceleration).
    ///
    /// # Errors
    /// If no deflection holds that attitude.
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
            // a thrust that is no line in throttle may miss the one that is wanted at any throttle
            None => held(0.0)
                .filter(|idle| idle.acceleration >= 0.0)
                .or_else(|| held(1.0).filter(|full| full.acceleration <= 0.0))
                .or_else(|| halved(held, |trim| trim.acceleration))
                .ok_or_else(fail),
        }
    }
}

/// What a search for a trim finds from the throttle `start`; from full throttle where that lies beyond the
/// stops and this within: thrust that falls before it rises with throttle, as a windmilling propeller's does,
/// has two trims.
fn within_stops(from: impl Fn(f64) -> Option<Trim>, start: f64) -> Option<Trim> {
    let holds = |trim: &Trim| (0.0..=1.0).contains(&trim.controls.throttle);
    let first = from(start);
    if first.as_ref().is_some_and(holds) {
        return first;
    }
    from(1.0).filter(holds).or(first)
}

/// The trim at the throttle where what is `left` rises through zero, by bisection: Newton's steps may go to and fro about
/// a kink of a table of thrust. `None` if it does not lie between idle and full throttle.
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

/// The descent at `airspeed`, m/s, at full throttle where that is shallower than at idle.
fn descent(model: &GreyBox, airspeed: f64, altitude: f64) -> Option<Trim> {
    let [idle, full] = [0.0, 1.0].map(|throttle| straight_at(model, airspeed, altitude, throttle));
    let powered = |full: &Trim| {
        full.path() < 0.0 && idle.as_ref().is_none_or(|idle| full.path() > idle.path() + SHALLOWER)
    };
    full.filter(powered).or(idle)
}

/// The straight flight at `airspeed` (m/s) and that throttle. Unknowns: α, δe, θ.
fn straight_at(model: &GreyBox, airspeed: f64, altitude: f64, throttle: f64) -> Option<Trim> {
    let condition = |[alpha, elevator, pitch]: [Dual<3>; 3]| {
        let held = Dual::from_f64(throttle);
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

/// The throttle of an attitude's trim.
#[derive(Clone, Copy)]
enum Thrust {
    /// It holds the airspeed; the search starts here.
    From(f64),
    /// It is held here.
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

/// Unknowns: α, the sideways unknown, p, q, r, δa, δe, δt. The sideways unknown is δr at β = 0 where the
/// model has a rudder that yaws (a coordinated turn), else β at δr = 0. Where the throttle is held,
/// δt = throttle replaces V̇ = 0.
fn solve_attitude(
    model: &GreyBox,
    roll: f64,
    pitch: f64,
    [airspeed, altitude]: [f64; 2],
    thrust: Thrust,
) -> Option<Trim> {
    let sideways = Sideways::of(model);
    // the coordinated turn of a point mass starts the search close by
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
            Thrust::Held(t) => x[7] - Dual::from_f64(t),
            Thrust::From(_) => rate.airspeed,
        };
        [rate.roll, rate.pitch, rate.p, rate.q, rate.r, rate.alpha, rate.beta, along]
    })?;
    let (state, controls) = attitude_condition(x, roll, pitch, airspeed, sideways);
    Some(Trim { state, controls, acceleration: 0.0 })
}

/// What balances a turn sideways.
#[derive(Clone, Copy)]
enum Sideways {
    /// Sideslip.
    Sideslip,
    /// The rudder, without sideslip.
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

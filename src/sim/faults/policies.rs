//! The flight rules, as formulas of signal temporal logic. Every flight must meet these requirements, whatever its faults.
//!
//! The robustness of a formula in a flight is a normalised margin. It is negative if the flight violates the formula.

use super::counterpart::ControllerMode;
use super::judge::{ABOVE_STALL, OVERSHOOT_DEG};
use super::temporal::Formula;
use greylag_control::Target;
use greylag_flight::pilot::{Decision, Source, TICK_S};
use greylag_link::autopilot::Mode;
use greylag_physics::Command;
use greylag_physics::airframe::Envelope;

/// Margin of an angle that counts as a robustness of 1, degrees. `UNIT_M` and `UNIT_S` are the margins of an altitude (m)
/// and of a time (s).
const UNIT_DEG: f64 = 30.0;
const UNIT_M: f64 = 100.0;
const UNIT_S: f64 = 5.0;
/// Altitude loss that is accepted in a flight of turns, climbs and descents, m.
const ALTITUDE_LOSS_M: f64 = 400.0;
/// Time for which violations are excused after the aircraft was exposed to a condition that the companion cannot prevent
/// ([`Sample::exposed`]), s.
const MEMORY_S: f64 = 3.0;
/// RMS of a surface's high-pass filtered command (−1..1) above which the surface counts as oscillating.
const SWING: f64 = 0.5;
/// Longest time for which a command may be held, s: 50 ms, and half a step (5 ms) for the arrival times of states.
const HELD_S: f64 = 0.055;
/// Time within which a commanded attitude must be reached, s.
const REACHED_S: f64 = 5.0;
/// Age above which a decision is disregarded, s. It exceeds the time for which an overloaded processor suspends the companion.
const STALE_S: f64 = 0.5;
/// Time for which the companion may suppress the repetition of a report, s.
const COMPLAINED_S: f64 = 5.0;
/// Time within which an oscillation must end, s. The companion's oscillation guard needs 1 s to detect an oscillation, and
/// then returns control.
const SWING_S: f64 = 2.5;
/// Rounding tolerance for the change of a surface command (−1..1) in one step, and for an envelope limit (degrees).
const ROUNDING: f64 = 1e-9;

/// Sample of a flight at one step.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// The pilot's last decision; `None` before the first.
    pub decision: Option<Decision>,
    /// Age of that decision, s.
    pub age_s: f64,
    /// Time for which the command has been held without a usable state, on the vehicle's clock, s.
    pub held_s: f64,
    /// Largest change of a surface command (−1..1) since the last sample; 0 without a new decision.
    pub moved: f64,
    /// Whether the flight controller executes the companion's commands. Always true for the shim, the simulator's MAVLink side.
    pub steered: bool,
    /// Whether the companion intends to control.
    pub engaged: bool,
    /// Whether the flight controller's reported mode confirms to the companion that its commands are executed.
    pub confirmed: bool,
    /// Time since data last arrived from the vehicle, s.
    pub silent_s: f64,
    /// Time since the client's last setpoint, s.
    pub client_silent_s: f64,
    /// Time for which the companion has held the same commanded attitude, s. Turbulence, an exposure, or a fault of link,
    /// sensors, clock or processor resets this time to 0.
    pub steady_s: f64,
    /// Roll and pitch angle, degrees.
    pub attitude_deg: [f64; 2],
    /// True airspeed V_a, m/s.
    pub airspeed_mps: f64,
    /// Altitude loss since the start, m.
    pub lost_m: f64,
    /// The larger of two RMS values: those of the high-pass filtered aileron and elevator commands (−1..1) over about 1 s.
    /// Surfaces that the companion does not command are excluded.
    pub swing: f64,
    /// Whether the aircraft is exposed to a condition that its companion cannot prevent: no command arrives, no state
    /// is usable, or a sensor is wrong.
    pub exposed: bool,
    /// Whether a fault of link, sensors, clock or processor is active.
    pub disturbed: bool,
    /// Whether a text was sent to the ground stations.
    pub spoke: bool,
    /// Whether a client has requested the companion to fly and no other pilot has taken control since then.
    pub asked: bool,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
    /// The companion's status for its clients; `None` while the companion's process does not run.
    pub shown: Option<Shown>,
    /// The flight controller's mode; `None` for the shim.
    pub controller: Option<ControllerMode>,
    /// The envelope in the companion's parameters.
    pub envelope: Envelope,
    /// The companion's offboard timeout, s.
    pub offboard_loss_s: f64,
}

/// The companion's status for its clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The active mode.
    pub mode: Mode,
    /// Whether outputs are enabled.
    pub armed: bool,
    /// Whether a failsafe is active.
    pub failsafe: bool,
}

impl Sample {
    fn decided(&self, holds: impl Fn(&Decision) -> bool) -> bool {
        self.decision.as_ref().is_some_and(holds)
    }

    /// Larger of the roll and pitch errors, degrees; `None` before the first decision.
    fn error_deg(&self) -> Option<f64> {
        let target = self.decision.as_ref()?.target;
        let off = (self.attitude_deg[0] - target.roll.to_degrees()).abs();
        Some(off.max((self.attitude_deg[1] - target.pitch.to_degrees()).abs()))
    }
}

/// A flight rule.
pub struct Policy {
    /// Name of the rule.
    pub id: &'static str,
    /// Requirement of the rule as text.
    pub asks: &'static str,
    /// Whether the rule applies to flight controllers only, not to the shim.
    pub of_controllers: bool,
    /// The formula that must always hold.
    pub always: Formula<Sample>,
}

type Rule = Formula<Sample>;

fn is(statement: impl Fn(&Sample) -> bool + Send + Sync + 'static) -> Rule {
    Formula::is(statement)
}

fn decided(holds: impl Fn(&Decision) -> bool + Send + Sync + 'static) -> Rule {
    is(move |s| s.decided(&holds))
}

/// Formula: `rule` holds, or the aircraft was exposed within the last `MEMORY_S`.
fn unless_exposed(rule: Rule) -> Rule {
    is(|s| s.exposed).once(MEMORY_S).or(rule)
}

/// Formula: the attitude error is below `most` degrees. It holds before the first decision.
fn near(most: f64) -> Rule {
    Formula::atom(move |s: &Sample| s.error_deg().map_or(1.0, |e| (most - e) / most))
}

/// Formula: the companion has held the same commanded attitude for less than `seconds`.
fn steady_for_less(seconds: f64) -> Rule {
    Formula::atom(move |s: &Sample| (seconds - s.steady_s) / UNIT_S)
}

/// Formula: a text is sent within 1 s after `event` starts, or a text was sent in the last `COMPLAINED_S`.
fn reported(event: Rule) -> Rule {
    let spoke = || is(|s| s.spoke);
    event.rises().implies(spoke().eventually(1.0).or(spoke().once(COMPLAINED_S)))
}

/// Formula: the condition `state` ends within `seconds`, or the last decision becomes older than `STALE_S`.
fn ends(state: impl Fn(&Sample) -> bool + Copy + Send + Sync + 'static, seconds: f64) -> Rule {
    is(state).implies(is(move |s| !state(s) || s.age_s > STALE_S).eventually(seconds))
}

/// Formula: the commanded angle lies between its limits. `of` reads the angle from the target (rad), `ends` reads the limits
/// from the envelope (degrees). The formula holds while no attitude is commanded.
fn target_inside(of: fn(&Target) -> f64, ends: fn(&Envelope) -> [f64; 2]) -> Rule {
    Formula::atom(move |s: &Sample| {
        let [least, most] = ends(&s.envelope);
        let angle = s.decision.map(|d| of(&d.target).to_degrees()).filter(|x| x.is_finite());
        angle.map_or(1.0, |x| ((most - x).min(x - least) + ROUNDING) / UNIT_DEG)
    })
}

/// All rules for an aircraft with this envelope.
pub fn policies(envelope: &Envelope) -> Vec<Policy> {
    let mut all = of_commands();
    all.extend(of_the_aircraft(envelope));
    all.extend(of_the_loop());
    all.extend(of_handing_over());
    all.extend(of_reports());
    all
}

fn policy(id: &'static str, asks: &'static str, always: Rule) -> Policy {
    Policy { id, asks, of_controllers: false, always }
}

fn of_commands() -> Vec<Policy> {
    vec![
        policy(
            "finite",
            "every command is finite",
            decided(|d| d.command.is_finite()).or(is(|s| s.decision.is_none())),
        ),
        policy(
            "range",
            "surfaces stay within their travel, throttle within 0..1",
            Formula::atom(|s: &Sample| {
                s.decision.map_or(1.0, |d| {
                    let c = d.command;
                    1.0 + ROUNDING
                        - c.aileron.abs().max(c.elevator.abs()).max((2.0 * c.throttle - 1.0).abs())
                })
            }),
        ),
        policy(
            "slew",
            "armed, no surface is commanded faster than the slew limit",
            Formula::atom(|s: &Sample| {
                let step = s.envelope.surface_slew_per_s * TICK_S;
                (step + ROUNDING - s.moved) / step
            }),
        ),
        policy(
            "idle",
            "disarmed, the command is idle",
            decided(|d| d.armed || d.command == Command::IDLE).or(is(|s| s.decision.is_none())),
        ),
        policy(
            "bank-target",
            "the commanded bank angle is inside the envelope",
            target_inside(|t| t.roll, |e| [-e.bank_max_deg, e.bank_max_deg]),
        ),
        policy(
            "pitch-target",
            "the commanded pitch angle is inside the envelope",
            target_inside(|t| t.pitch, |e| [e.pitch_min_deg, e.pitch_max_deg]),
        ),
        policy(
            "held",
            "without a usable state, a command is held for at most 0.055 s",
            Formula::atom(|s: &Sample| (HELD_S - s.held_s) / HELD_S),
        ),
    ]
}

fn of_the_aircraft(envelope: &Envelope) -> Vec<Policy> {
    let e = *envelope;
    let beyond = OVERSHOOT_DEG;
    let angle = |room: fn(&Envelope, [f64; 2]) -> f64| {
        unless_exposed(Formula::atom(move |s: &Sample| {
            (room(&s.envelope, s.attitude_deg) + beyond) / UNIT_DEG
        }))
    };
    let stall = e.airspeed_min_mps / ABOVE_STALL;
    vec![
        policy(
            "bank",
            "bank stays within 15 degrees of the envelope",
            angle(|e, [roll, _]| e.bank_max_deg - roll.abs()),
        ),
        policy(
            "nose-up",
            "pitch stays less than 15 degrees above the envelope",
            angle(|e, [_, pitch]| e.pitch_max_deg - pitch),
        ),
        policy(
            "nose-down",
            "pitch stays less than 15 degrees below the envelope",
            angle(|e, [_, pitch]| pitch - e.pitch_min_deg),
        ),
        policy(
            "stall",
            "airspeed stays above the stall",
            unless_exposed(Formula::atom(move |s: &Sample| (s.airspeed_mps - stall) / stall)),
        ),
        policy(
            "overspeed",
            "airspeed stays below the envelope's largest",
            unless_exposed(Formula::atom(move |s: &Sample| {
                (e.airspeed_max_mps - s.airspeed_mps) / e.airspeed_max_mps
            })),
        ),
        policy(
            "altitude",
            "no more than 400 m are lost",
            unless_exposed(Formula::atom(|s: &Sample| (ALTITUDE_LOSS_M - s.lost_m) / UNIT_M)),
        ),
    ]
}

fn of_the_loop() -> Vec<Policy> {
    vec![
        policy(
            "reached",
            "in calm air and without faults, the commanded attitude is reached within 5 degrees in 5 s",
            steady_for_less(REACHED_S).or(near(5.0).once(REACHED_S)),
        ),
        policy(
            "kept",
            "in calm air and without faults, after 8 s the commanded attitude is held within 5 degrees",
            steady_for_less(8.0).or(near(5.0)),
        ),
        policy(
            "no-oscillation",
            "no surface oscillates for 2.5 s with an RMS above half its maximum deflection",
            unless_exposed(
                is(|s| s.swing > SWING).implies(is(|s| s.swing <= SWING).eventually(SWING_S)),
            ),
        ),
    ]
}

fn of_handing_over() -> Vec<Policy> {
    let of_controllers = |id, asks, always| Policy { id, asks, of_controllers: true, always };
    fn ours(s: &Sample) -> bool {
        s.steered && s.engaged
    }
    vec![
        of_controllers(
            "dead-link",
            "when no data has arrived from the vehicle for 0.3 s, control returns to the flight \
             controller within 0.3 s",
            is(|s| ours(s) && s.silent_s >= 0.3).implies(is(|s| !ours(s)).eventually(0.3)),
        ),
        of_controllers(
            "refusal",
            "after a fault found by the sign check or oscillation guard, control returns to the \
             flight controller within 5 s",
            ends(|s| ours(s) && s.decided(|d| d.refused.is_some()), 5.0),
        ),
        of_controllers(
            "no-state",
            "without a usable state, control returns to the flight controller within 5 s",
            ends(|s| ours(s) && s.decided(|d| d.source == Source::Level), 5.0),
        ),
        of_controllers(
            "unasked",
            "the companion takes control only at a client's request",
            is(|s| s.steered).rises().implies(is(|s| s.asked)),
        ),
        of_controllers(
            "after-disarm",
            "after disarming, control returns to the flight controller within 3 s",
            ends(|s| ours(s) && s.decided(|d| !d.armed), 3.0),
        ),
        policy(
            "client-lost",
            "a client that is silent for GL_OFFB_LOSS_S (1 s) ends OFFBOARD within 1 s",
            ends(
                |s| {
                    let offboard =
                        |d: &Decision| d.armed && d.mode == Mode::Offboard && !d.failsafe;
                    s.client_silent_s >= s.offboard_loss_s && s.decided(offboard)
                },
                1.0,
            ),
        ),
    ]
}

fn of_reports() -> Vec<Policy> {
    vec![
        policy(
            "refusal-reported",
            "a fault found by the sign check or oscillation guard is reported within 1 s",
            reported(decided(|d| d.refused.is_some())),
        ),
        policy(
            "failsafe-reported",
            "a failsafe is reported within 1 s",
            reported(decided(|d| d.armed && d.failsafe)),
        ),
        policy(
            "level-reported",
            "flight without a usable state is reported within 1 s",
            reported(decided(|d| d.armed && d.source == Source::Level)),
        ),
        policy(
            "disarm-reported",
            "disarming is reported within 1 s",
            reported(decided(|d| !d.armed).and(is(|s| s.decision.is_some()))),
        ),
        Policy {
            of_controllers: true,
            ..policy(
                "hand-back-reported",
                "the loss of control authority is reported within 1 s, unless a fault conceals it \
                 from the companion",
                // the companion notices the change only through its link
                is(|s| s.disturbed).once(1.0).or(reported(is(|s| !s.steered))),
            )
        },
    ]
}

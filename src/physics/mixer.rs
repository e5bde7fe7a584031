//! The mixer maps the four controls of a model to the surfaces and motors of an aircraft, and their positions back to the
//! controls.
//!
//! Model, planner and logs have four controls: aileron, elevator, rudder, throttle. An aircraft may have other effectors
//! (surfaces and motors): two elevons, a V-tail, several motors. Effector i receives the command u_i = Σ_j g_ij c_j, where c_j
//! are the commands of the controls. A surface moves to the deflection that belongs to u_i, which is limited to −1..1. The
//! inverse mapping is c = g⁺ u by least squares, where u_i is now the deflection divided by half the travel. This mapping is
//! linear. Forces that are linear in the deflections of the surfaces are therefore also linear in those of the controls.

use crate::Command;
use crate::servos::{Travel, Travels};

/// Names of the controls, in the order of an effector's gains.
pub const CONTROLS: [&str; 4] = ["aileron", "elevator", "rudder", "throttle"];
/// Relative tolerance for linear dependence. A control's column of gains is dependent if its part orthogonal to the preceding
/// columns is shorter than this fraction of its length.
const DEPENDENT: f64 = 1e-6;
/// Largest relative difference between the travel of a control that a file states and the travel that its surfaces give.
const TRAVEL: f64 = 1e-3;

/// Kind of an effector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Does {
    /// A surface, with its travel: the deflections at the commands −1 and 1, rad.
    Deflects(Travel),
    /// A tractor or pusher motor, with a command of 0..1.
    Pulls,
}

/// A named surface or motor.
#[derive(Clone, Debug, PartialEq)]
pub struct Effector {
    /// Name of the effector. Its columns in a log are `NAME_rad` and `NAME_cmd`.
    pub name: String,
    /// Kind of the effector.
    pub does: Does,
    /// Gain from each of [`CONTROLS`]: the effector's command if this control alone has the command 1.
    pub gains: [f64; 4],
    /// Servo output of the flight controller that moves the effector, from 1. `None` if unknown.
    pub channel: Option<u8>,
    /// JSBSim property of the effector's command, −1..1 for a surface or 0..1 for a motor.
    pub command: Option<String>,
    /// JSBSim property of the surface's deflection, rad, or of the motor's throttle, 0..1.
    pub position: Option<String>,
}

impl Effector {
    /// The command limited to the effector's range.
    fn limited(&self, command: f64) -> f64 {
        match self.does {
            Does::Deflects(_) => command.clamp(-1.0, 1.0),
            Does::Pulls => command.clamp(0.0, 1.0),
        }
    }

    /// Position at a command: the deflection (rad) of a surface, or 0..1 for a motor.
    pub fn position(&self, command: f64) -> f64 {
        match self.does {
            Does::Deflects(travel) => travel.deflection(command),
            Does::Pulls => command,
        }
    }

    /// Position per command: half the travel (rad) of a surface, or one for a motor.
    fn unit(&self) -> f64 {
        match self.does {
            Does::Deflects(travel) => 0.5 * (travel.most - travel.least),
            Does::Pulls => 1.0,
        }
    }
}

/// Error in the definition of a mixer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MixerError {
    /// No effector moves a control.
    #[error(
        "nothing moves the {control}: give a surface or motor {control} = …, its command for a full {control}"
    )]
    Unmoved {
        /// Name of the control.
        control: &'static str,
    },
    /// An effector moves a control that the aircraft does not have.
    #[error(
        "{effector} has {control} = …, but there is no [controls.{control}]: add that section or leave the gain out"
    )]
    NoSuchControl {
        /// Name of the effector.
        effector: String,
        /// Name of the control.
        control: &'static str,
    },
    /// Two controls are linearly dependent.
    #[error(
        "the mixer is singular: {effectors} move with the {control} as with {others}, so that no setting gives one without \
         the other; give one of them a gain of the other sign, or add what moves the {control} alone"
    )]
    Singular {
        /// Name of the dependent control.
        control: &'static str,
        /// Names of the preceding controls on which it depends.
        others: String,
        /// Names of the effectors that the control moves.
        effectors: String,
    },
    /// A control's travel in the file differs from the travel that its surfaces give.
    #[error(
        "controls.{control} goes from {given_least:.4} to {given_most:.4} rad, its surfaces give {least:.4} to {most:.4}: \
         write these"
    )]
    Travel {
        /// Name of the control.
        control: &'static str,
        /// Lower limit in the file, rad.
        given_least: f64,
        /// Upper limit in the file, rad.
        given_most: f64,
        /// Lower limit from the surfaces, rad.
        least: f64,
        /// Upper limit from the surfaces, rad.
        most: f64,
    },
}

/// Mapping between controls, surfaces and motors.
#[derive(Clone, Debug, PartialEq)]
pub struct Mixer {
    effectors: Vec<Effector>,
    /// Pseudo-inverse g⁺: command of each control per command of each effector, one row per effector.
    back: Vec<[f64; 4]>,
    /// Deflection of each control at the command 1, rad: the mean over the surfaces that it moves. It is 1 for the throttle.
    unit: [f64; 4],
}

impl Mixer {
    /// Builds the mixer of `effectors` for an aircraft with or without a `rudder`.
    ///
    /// # Errors
    /// If a control moves no effector, an effector has a gain for a missing rudder, or two controls are linearly dependent.
    pub fn new(effectors: Vec<Effector>, rudder: bool) -> Result<Mixer, MixerError> {
        let has = [true, true, rudder, true];
        for (j, control) in CONTROLS.into_iter().enumerate() {
            let mover = effectors.iter().find(|e| e.gains[j] != 0.0);
            match (has[j], mover) {
                (true, None) => return Err(MixerError::Unmoved { control }),
                (false, Some(e)) => {
                    return Err(MixerError::NoSuchControl { effector: e.name.clone(), control });
                }
                _ => {}
            }
        }
        let back = pseudo_inverse(&effectors)?;
        let unit = std::array::from_fn(|j| unit(&effectors, j));
        Ok(Mixer { effectors, back, unit })
    }

    /// All surfaces and motors of the aircraft.
    pub fn effectors(&self) -> &[Effector] {
        &self.effectors
    }

    /// Commands of the effectors for `command`, clamped to their ranges.
    pub fn mix(&self, command: &Command) -> Vec<f64> {
        let asked = [command.aileron, command.elevator, command.rudder, command.throttle];
        let sum = |e: &Effector| e.gains.iter().zip(asked).map(|(g, c)| g * c).sum::<f64>();
        self.effectors.iter().map(|e| e.limited(sum(e))).collect()
    }

    /// Deflections of the controls (rad; 0..1 for the throttle) at the effectors' `positions`. They are sums of the positions
    /// times [`Self::shares`].
    pub fn deflections(&self, positions: &[f64]) -> [f64; 4] {
        let mut out = [0.0; 4];
        for (shares, position) in self.shares().zip(positions) {
            out.iter_mut().zip(shares).for_each(|(sum, share)| *sum += share * position);
        }
        out
    }

    /// For each effector: contribution of its position (rad; 0..1 for a motor) to the deflection of each control (rad; 0..1 for
    /// the throttle), per unit.
    pub fn shares(&self) -> impl Iterator<Item = [f64; 4]> {
        let both = self.back.iter().zip(&self.effectors);
        both.map(|(row, e)| std::array::from_fn(|j| row[j] * self.unit[j] / e.unit()))
    }

    /// For each effector: contribution of its command to the command of each control, per unit.
    pub fn command_shares(&self) -> &[[f64; 4]] {
        &self.back
    }

    /// Travels of the controls (rad): deflections of each control when it alone is at −1 or 1.
    pub fn travels(&self) -> Travels {
        let travel = |j: usize| {
            let at = |value: f64| {
                // the throttle is at one half, where differential thrust can yaw the aircraft to both sides
                let given = |e: &Effector| e.limited(e.gains[j] * value + 0.5 * e.gains[3]);
                let positions: Vec<f64> =
                    self.effectors.iter().map(|e| e.position(given(e))).collect();
                self.deflections(&positions)[j]
            };
            Travel { least: at(-1.0), most: at(1.0) }
        };
        let moved = self.effectors.iter().any(|e| e.gains[2] != 0.0);
        Travels { aileron: travel(0), elevator: travel(1), rudder: moved.then(|| travel(2)) }
    }

    /// Checks that the `travels` of an airframe file agree with the travels that the surfaces give.
    ///
    /// # Errors
    /// If a travel differs by more than 0.1 %. The error names the first control with such a difference.
    pub fn checked(self, travels: &Travels) -> Result<Mixer, MixerError> {
        let own = self.travels();
        let pairs = [
            (Some(own.aileron), Some(travels.aileron)),
            (Some(own.elevator), Some(travels.elevator)),
            // if only motors yaw the aircraft, the travel of the rudder is not an angle
            (own.rudder.filter(|_| self.rudder_deflects()), travels.rudder),
        ];
        for (control, (own, given)) in CONTROLS.into_iter().zip(pairs) {
            let (Some(own), Some(given)) = (own, given) else { continue };
            let apart = |a: f64, b: f64| (a - b).abs() > TRAVEL * b.abs();
            if apart(given.least, own.least) || apart(given.most, own.most) {
                return Err(MixerError::Travel {
                    control,
                    given_least: given.least,
                    given_most: given.most,
                    least: own.least,
                    most: own.most,
                });
            }
        }
        Ok(self)
    }

    fn rudder_deflects(&self) -> bool {
        self.effectors.iter().any(|e| e.gains[2] != 0.0 && e.does != Does::Pulls)
    }
}

/// Deflection of control `j` at the command 1: the mean over the surfaces that it moves (rad). If it moves only motors, it is
/// the mean over these motors (0..1).
fn unit(effectors: &[Effector], j: usize) -> f64 {
    if j == 3 {
        return 1.0;
    }
    let of = |motors: bool| -> Vec<f64> {
        let moved = effectors.iter().filter(|e| e.gains[j] != 0.0);
        moved
            .filter(|e| (e.does == Does::Pulls) == motors)
            .map(|e| e.gains[j].abs() * e.unit())
            .collect()
    };
    let sizes = Some(of(false)).filter(|sizes| !sizes.is_empty()).unwrap_or_else(|| of(true));
    sizes.iter().sum::<f64>() / sizes.len().max(1) as f64
}

/// The pseudo-inverse g⁺ of the gains by modified Gram–Schmidt: g = Q R, g⁺ = R⁻¹ Qᵀ. The result has one row per effector.
/// The column of a control without gains is zero.
fn pseudo_inverse(effectors: &[Effector]) -> Result<Vec<[f64; 4]>, MixerError> {
    let column = |j: usize| -> Vec<f64> { effectors.iter().map(|e| e.gains[j]).collect() };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut orthogonal: Vec<(usize, Vec<f64>)> = Vec::new();
    let mut r = [[0.0; 4]; 4];
    for j in 0..4 {
        let mut rest = column(j);
        let whole = dot(&rest, &rest).sqrt();
        if whole == 0.0 {
            continue;
        }
        for (k, q) in &orthogonal {
            r[*k][j] = dot(q, &rest);
            rest.iter_mut().zip(q).for_each(|(x, y)| *x -= r[*k][j] * y);
        }
        r[j][j] = dot(&rest, &rest).sqrt();
        if r[j][j] < DEPENDENT * whole {
            return Err(singular(effectors, j, &r, orthogonal.iter().map(|(k, _)| *k)));
        }
        rest.iter_mut().for_each(|x| *x /= r[j][j]);
        orthogonal.push((j, rest));
    }
    let mut rows = vec![[0.0; 4]; effectors.len()];
    for (i, row) in rows.iter_mut().enumerate() {
        // solves R x = Qᵀ e_i by back substitution
        for (place, (j, q)) in orthogonal.iter().enumerate().rev() {
            let later: f64 = orthogonal[place + 1..].iter().map(|(k, _)| r[*j][*k] * row[*k]).sum();
            row[*j] = (q[i] - later) / r[*j][*j];
        }
    }
    Ok(rows)
}

fn singular(
    effectors: &[Effector],
    j: usize,
    r: &[[f64; 4]; 4],
    before: impl Iterator<Item = usize>,
) -> MixerError {
    let alike: Vec<&str> =
        before.filter(|k| r[*k][j].abs() > DEPENDENT).map(|k| CONTROLS[k]).collect();
    let moving = effectors.iter().filter(|e| e.gains[j] != 0.0);
    MixerError::Singular {
        control: CONTROLS[j],
        others: alike.join(" and "),
        effectors: moving.map(|e| e.name.as_str()).collect::<Vec<_>>().join(", "),
    }
}

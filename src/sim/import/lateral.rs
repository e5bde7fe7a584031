//! Determines lateral derivatives of a JSBSim aircraft by finite differences. The stability derivatives are determined as
//! functions of the lift coefficient, the aileron derivatives as functions of the angle of attack.

use greylag_sitl::plant::{Inputs, PlantError, Start};

use super::{ALPHA, ANGLE, COMMAND, RATE, Subject};

/// Derivatives count as constant if their changes between two angles of attack are below this fraction of the largest
/// derivative of their group.
const CONSTANT: f64 = 0.02;

/// Lateral derivatives as linear functions of the lift coefficient.
#[derive(Clone, Copy, Debug)]
pub(super) struct WithLift {
    /// Clr, Clβ, Cnp, Cnβ at zero lift.
    pub(super) without: [f64; 4],
    /// Slopes of these derivatives over the lift coefficient.
    pub(super) by_lift: [f64; 4],
}

/// The derivatives Clδa and Cnδa at zero angle of attack, 1/rad, and their slopes over the angle of attack, 1/rad².
#[derive(Clone, Copy, Debug)]
pub(super) struct AileronOverIncidence {
    pub(super) without: [f64; 2],
    pub(super) by_incidence: [f64; 2],
}

impl Subject<'_> {
    /// Clδa and Cnδa as linear functions of the angle of attack, from their values at two angles. `unit` is the aileron
    /// deflection (rad) at [`COMMAND`]. `None` if the derivatives are nearly equal at both angles.
    pub(super) fn aileron_over_incidence(
        &mut self,
        unit: f64,
    ) -> Result<Option<AileronOverIncidence>, PlantError> {
        let mut at = [[0.0; 2]; 2];
        for (own, sign) in at.iter_mut().zip([-1.0, 1.0]) {
            let base = Start { alpha_rad: ALPHA + sign * ANGLE, ..self.start };
            let [up, down] = [COMMAND, -COMMAND]
                .map(|aileron| self.at(&base, &Inputs { aileron, ..Inputs::default() }));
            let (up, down) = (up?, down?);
            *own = [3, 5].map(|c| (up[c] - down[c]) / (2.0 * unit));
        }
        let [low, high] = at;
        let by_incidence: [f64; 2] = std::array::from_fn(|k| (high[k] - low[k]) / (2.0 * ANGLE));
        let without = std::array::from_fn(|k| low[k] - by_incidence[k] * (ALPHA - ANGLE));
        let changes = (0..2).any(|k| (high[k] - low[k]).abs() > CONSTANT * high[0].abs());
        Ok(changes.then_some(AileronOverIncidence { without, by_incidence }))
    }

    /// Clr, Clβ, Cnp and Cnβ as linear functions of the lift coefficient, from their values at two angles of attack. `None` if
    /// the derivatives or the lift coefficients are nearly equal at both angles.
    pub(super) fn lateral_with_lift(&mut self) -> Result<Option<WithLift>, PlantError> {
        let mut at = [[0.0; 5]; 2];
        for (own, sign) in at.iter_mut().zip([-1.0, 1.0]) {
            let base = Start { alpha_rad: ALPHA + sign * ANGLE, ..self.start };
            let rate = RATE * 2.0 * self.start.airspeed_mps / self.span;
            let mut slope = |unit: f64, set: &dyn Fn(&mut Start, f64)| {
                let mut side = |k: f64| {
                    let mut state = base;
                    set(&mut state, k);
                    self.at(&state, &Inputs::default())
                };
                let (up, down) = (side(1.0)?, side(-1.0)?);
                Ok::<_, PlantError>([3, 5].map(|c| (up[c] - down[c]) / (2.0 * unit)))
            };
            let [by_r, _] = slope(RATE, &|s, k| s.r_radps = k * rate)?;
            let [_, by_p] = slope(RATE, &|s, k| s.p_radps = k * rate)?;
            let [roll, yaw] = slope(ANGLE, &|s, k| s.beta_rad = k * ANGLE)?;
            let lift = self.at(&base, &Inputs::default())?[2];
            *own = [by_r, roll, by_p, yaw, lift];
        }
        let [low, high] = at;
        let lift = high[4] - low[4];
        let by_lift: [f64; 4] = std::array::from_fn(|k| (high[k] - low[k]) / lift);
        let without = std::array::from_fn(|k| low[k] - by_lift[k] * low[4]);
        let most = |k: [usize; 2]| {
            k.map(|k| low[k].abs().max(high[k].abs())).into_iter().fold(0.0, f64::max)
        };
        // changes of Clr and Cnp are relative to the larger of the two, changes of Clβ and Cnβ likewise
        let scale = [most([0, 2]), most([1, 3]), most([0, 2]), most([1, 3])];
        let changes = (0..4).any(|k| (high[k] - low[k]).abs() > CONSTANT * scale[k]);
        Ok((changes && lift.abs() > 1e-3).then_some(WithLift { without, by_lift }))
    }
}

//! Measures effects of a running propeller on an aircraft in JSBSim: slipstream on the tail, gyroscopic moments, P-factor.
//!
//! The slipstream changes the effectiveness of a surface in proportion to the thrust coefficient T/(q S), which is the thrust
//! divided by dynamic pressure and wing area.

use greylag_sitl::plant::{Inputs, PlantError, Start, Travel};

use super::propulsion::{LBF_FT, NO_ARM};
use super::{ALPHA, ANGLE, COMMAND, RATE, Subject, at_command};
use greylag_num::least_squares;

/// Throttle values at which the effects are measured, after the engines have reached a steady state.
const THROTTLES: [f64; 3] = [0.2, 0.6, 1.0];
/// Smallest relative change of a surface's effectiveness at full throttle that counts as slipstream.
const NO_SLIPSTREAM: f64 = 0.01;
/// Angular momentum that counts as zero, as a fraction of mass · span² per second.
const NO_MOMENTUM: f64 = 1e-4;
/// P-factor that counts as zero: distance of the thrust from the hub, in chords per radian of the angle of attack.
const NO_OFFSET: f64 = 1e-2;

/// Propeller effects of the aircraft; `None` for an effect that counts as zero.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Propeller {
    /// Elevator effectiveness without thrust, 1/rad, and its slope over the thrust coefficient.
    pub(super) elevator: Option<[f64; 2]>,
    /// Rudder effectiveness in yaw without thrust, 1/rad, and its slope over the thrust coefficient.
    pub(super) rudder: Option<[f64; 2]>,
    /// Angular momentum at idle and its increase at full throttle, N m s.
    pub(super) gyro: Option<[f64; 2]>,
    /// Lateral offset of the thrust to the left of the centre of gravity, m.
    pub(super) sideways: Option<f64>,
    /// Slope of the thrust's distance from the hub over the angle of attack, chords per rad.
    pub(super) p_factor: Option<f64>,
}

impl Subject<'_> {
    /// Measures the effects about the reference state.
    pub(super) fn propeller(&mut self, travel: &Travel) -> Result<Propeller, PlantError> {
        let base = Start { alpha_rad: ALPHA, ..self.start };
        let elevator =
            self.slipstream(&base, at_command(travel.elevator), 4, |i, x| i.elevator = x)?;
        let rudder = match travel.rudder {
            Some(stops) => self.slipstream(&base, at_command(stops), 5, |i, x| i.rudder = x)?,
            None => None,
        };
        let rate = RATE * 2.0 * self.start.airspeed_mps / self.span;
        let (mut momenta, mut throttles) = (Vec::new(), Vec::new());
        let (mut arms, mut yaws) = (Vec::new(), Vec::new());
        for throttle in THROTTLES {
            let inputs = Inputs { throttle, ..Inputs::default() };
            let turned = |k: f64| Start { r_radps: k * rate, ..base };
            let [up, down] = [1.0, -1.0].map(|k| self.engine_moments(&turned(k), &inputs));
            let ((_, [up, _]), (_, [down, _])) = (up?, down?);
            momenta.push((up - down) / (2.0 * rate));
            throttles.push([1.0, throttle]);
            for sign in [1.0, -1.0] {
                let alpha_rad = ALPHA + sign * ANGLE;
                let (thrust, [_, yaw]) =
                    self.engine_moments(&Start { alpha_rad, ..self.start }, &inputs)?;
                arms.push([thrust, -self.chord * thrust * alpha_rad]);
                yaws.push(yaw);
            }
        }
        let gyro = least_squares(&throttles, &momenta).unwrap_or_default();
        let heavy = NO_MOMENTUM * self.mass.mass_kg * self.span * self.span;
        let [sideways, p_factor] = least_squares(&arms, &yaws).unwrap_or_default();
        Ok(Propeller {
            elevator,
            rudder,
            gyro: (gyro[0].abs() + gyro[1].abs() > heavy).then_some(gyro),
            sideways: (sideways.abs() > NO_ARM * self.chord).then_some(sideways),
            p_factor: (p_factor.abs() > NO_OFFSET).then_some(p_factor),
        })
    }

    /// Steady-state thrust (N), and pitching and yawing moment of the engines (N m), in `state`.
    fn engine_moments(
        &mut self,
        state: &Start,
        inputs: &Inputs,
    ) -> Result<(f64, [f64; 2]), PlantError> {
        let (_, thrust) = self.plant.powered_loads(state, inputs)?;
        // an aircraft without engines has no such property
        let mut moment = |name: &str| LBF_FT * self.plant.property(name).unwrap_or(0.0);
        Ok((thrust, [moment("moments/m-prop-lbsft"), moment("moments/n-prop-lbsft")]))
    }

    /// Effectiveness of a surface: the derivative of the coefficient with index `of` with respect to the deflection, 1/rad.
    /// Returns the effectiveness without thrust, and its slope over the thrust coefficient. `set` commands the surface to
    /// ±`COMMAND`, at which its deflection is ±`unit` (rad). `None` if there is no slipstream.
    fn slipstream(
        &mut self,
        base: &Start,
        unit: f64,
        of: usize,
        set: impl Fn(&mut Inputs, f64),
    ) -> Result<Option<[f64; 2]>, PlantError> {
        let (mut rows, mut slopes, mut full) = (Vec::new(), Vec::new(), 0.0);
        for throttle in THROTTLES {
            let (mut sides, mut share) = ([0.0; 2], 0.0);
            for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
                let mut inputs = Inputs { throttle, ..Inputs::default() };
                set(&mut inputs, sign * COMMAND);
                let (loads, thrust) = self.plant.powered_loads(base, &inputs)?;
                let pressure = self.pressure(&loads);
                *side = self.steady(&loads, pressure)?[of];
                share = thrust / pressure;
            }
            rows.push([1.0, share]);
            slopes.push((sides[0] - sides[1]) / (2.0 * unit));
            full = share;
        }
        let found = least_squares(&rows, &slopes);
        Ok(found.filter(|[still, by]| (by * full).abs() > NO_SLIPSTREAM * still.abs()))
    }
}

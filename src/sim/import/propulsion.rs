//! Propulsion of an imported JSBSim aircraft: settled thrust (after the engines' transient), thrust lag and moments.

use greylag_sitl::plant::{PlantError, Start};

use super::fits::{ThrustLag, thrust_lag};
use super::{ALPHA, Subject};
use greylag_model::textbook::Estimate;
use greylag_num::{Grid, least_squares};
use greylag_physics::atmosphere::{SEA_LEVEL_DENSITY, STANDARD_GRAVITY};

/// Root mean square residual of the thrust polynomial, as a fraction of the largest thrust, above which the residual is
/// reported.
const REPORTED_FROM: f64 = 0.02;
/// Throttle before and after the step with which the lag of the thrust is measured.
const THRUST_STEP: [f64; 2] = [0.4, 0.7];
/// Root mean square residual, as a fraction of the change of thrust, above which the step response is reported not to be that
/// of a first-order lag.
const LAG_REPORTED_FROM: f64 = 0.1;
/// Observation time of the step response, s.
const STEP_S: f64 = 20.0;
/// Mean, amplitude and frequency (rad/s) of the throttle sine with which the lag is validated. `WAVE_S` is its duration, s.
const WAVE: [f64; 3] = [0.5, 0.1, 3.0];
const WAVE_S: f64 = 10.0;
/// Rolling moment of the propeller that counts as zero, as a fraction of weight times span.
const NO_MOMENT: f64 = 1e-5;
/// Vertical offset of the thrust from the centre of gravity that counts as zero, as a fraction of the chord.
pub(super) const NO_ARM: f64 = 1e-3;
/// Airspeeds of the thrust table as fractions of the cruise airspeed. `THROTTLES` has its throttle values.
const SPEEDS: [f64; 14] = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7];
const THROTTLES: [f64; 11] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];
/// Newton metres in a pound foot.
pub(super) const LBF_FT: f64 = 1.355_817_948_331_4;

/// Parameters of the propulsion in the model.
pub(super) struct Propulsion {
    /// Coefficients of the settled thrust as a polynomial of throttle and airspeed.
    pub(super) thrust: Vec<Estimate>,
    /// Settled thrust over throttle and airspeed (N, at sea-level density); `None` if it depends on more than these two.
    pub(super) table: Option<Grid>,
    /// Time constant from throttle position to thrust, s; `None` if the thrust has no first-order lag.
    pub(super) lag: Option<f64>,
    /// Rolling moment at full throttle, positive to the left, N m; `None` if negligible.
    pub(super) torque: Option<f64>,
    /// Vertical offset of the thrust, positive below the centre of gravity, m; `None` if negligible.
    pub(super) arm: Option<f64>,
}

impl Subject<'_> {
    /// Measures settled thrust and moments, and the thrust after a throttle step.
    pub(super) fn propulsion(
        &mut self,
        left_out: &mut Vec<String>,
    ) -> Result<Propulsion, PlantError> {
        let (mut rows, mut thrusts) = (Vec::new(), Vec::new());
        // Σ l δ, Σ δ², Σ m T, Σ T²: l is the rolling moment, δ the throttle, m the pitching moment, T the thrust
        let mut moments = [0.0; 4];
        for speed in [0.8, 1.0, 1.25] {
            for throttle in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let airspeed_mps = speed * self.start.airspeed_mps;
                let start = Start { airspeed_mps, alpha_rad: ALPHA, ..self.start };
                let (thrust, truth) = self.plant.settled_thrust(&start, throttle)?;
                let (d, v) = (truth.throttle, truth.airspeed_mps);
                let share = truth.air_density_kgpm3 / SEA_LEVEL_DENSITY;
                rows.push([1.0, d, d * d, v, d * v, v * v].map(|x| x * share));
                thrusts.push(thrust);
                // an aircraft without engines has no such property
                let mut moment = |name: &str| LBF_FT * self.plant.property(name).unwrap_or(0.0);
                let (roll, pitch) =
                    (moment("moments/l-prop-lbsft"), moment("moments/m-prop-lbsft"));
                for (sum, x) in
                    moments.iter_mut().zip([roll * d, d * d, pitch * thrust, thrust * thrust])
                {
                    *sum += x;
                }
            }
        }
        let fit = least_squares(&rows, &thrusts).unwrap_or_default();
        let along = |row: &[f64; 6]| row.iter().zip(&fit).map(|(a, b)| a * b).sum::<f64>();
        let missed = rows.iter().zip(&thrusts).map(|(row, t)| (along(row) - t).powi(2));
        let left = (missed.sum::<f64>() / thrusts.len() as f64).sqrt();
        let most = thrusts.iter().fold(1e-9_f64, |most, t| most.max(t.abs()));
        let table = self.thrust_table()?;
        if table.is_none() && left > REPORTED_FROM * most {
            left_out.push(format!(
                "the thrust is a polynomial in the model; {left:.1} N (rms) of up to {most:.0} N are left out"
            ));
        }
        let names = ["T0_n", "Tt_n", "Ttt_n", "TV_nspm", "TtV_nspm", "TVV_ns2pm2"];
        let source = "least squares over JSBSim's thrust, 0.8 to 1.25 of the cruise airspeed";
        let thrust: Vec<Estimate> =
            names.into_iter().zip(fit.iter()).map(|(n, x)| (n, *x, 0.02, source)).collect();
        let lag = self.thrust_lag(&thrust, left_out)?;
        let [roll, throttle, pitch, squared] = moments;
        let (torque, arm) = (-roll / throttle.max(1e-9), pitch / squared.max(1e-9));
        let weight = self.mass.mass_kg * STANDARD_GRAVITY;
        Ok(Propulsion {
            thrust,
            table,
            lag,
            torque: (torque.abs() > NO_MOMENT * weight * self.span).then_some(torque),
            arm: (arm.abs() > NO_ARM * self.chord).then_some(arm),
        })
    }

    /// Settled thrust over throttle and airspeed, N at sea-level density. `None` if the engines change the commanded throttle,
    /// or if the airspeed changes during the measurement.
    fn thrust_table(&mut self) -> Result<Option<Grid>, PlantError> {
        let airspeeds = SPEEDS.map(|part| part * self.start.airspeed_mps);
        let mut rows = Vec::with_capacity(THROTTLES.len());
        for throttle in THROTTLES {
            let mut row = Vec::with_capacity(SPEEDS.len());
            for airspeed_mps in airspeeds {
                let start = Start { airspeed_mps, alpha_rad: ALPHA, ..self.start };
                let (thrust, truth) = self.plant.settled_thrust(&start, throttle)?;
                let moved = (truth.airspeed_mps / airspeed_mps - 1.0).abs();
                if (truth.throttle - throttle).abs() > 1e-6 || moved > 1e-3 {
                    return Ok(None);
                }
                row.push(thrust * SEA_LEVEL_DENSITY / truth.air_density_kgpm3);
            }
            rows.push(row);
        }
        Ok(Grid::new(&THROTTLES, &airspeeds, &rows).ok())
    }

    /// Time constant (s) from throttle position to thrust; `None` if the thrust has no first-order lag. `thrust` contains the
    /// coefficients of the settled thrust.
    fn thrust_lag(
        &mut self,
        thrust: &[Estimate],
        left_out: &mut Vec<String>,
    ) -> Result<Option<f64>, PlantError> {
        let start = Start { alpha_rad: ALPHA, ..self.start };
        let step = self.plant.step_s();
        let steps = |seconds: f64| (seconds / step) as usize;
        let [from, to] = THRUST_STEP;
        let raised: Vec<f64> =
            std::iter::once(from).chain(std::iter::repeat_n(to, steps(STEP_S))).collect();
        let wave = |k: usize| WAVE[0] + WAVE[1] * (WAVE[2] * step * k as f64).sin();
        let waved: Vec<f64> = (0..steps(WAVE_S)).map(wave).collect();
        let raised = self.plant.thrust_response(&start, &raised)?;
        let waved = self.plant.thrust_response(&start, &waved)?;
        let of = |name: &str| thrust.iter().find(|e| e.0 == name).map_or(0.0, |e| e.1);
        let slope = of("Tt_n") + of("TtV_nspm") * self.start.airspeed_mps;
        let Some(found) = thrust_lag([&raised, &waved], step, [slope, of("Ttt_n")]) else {
            return Ok(None);
        };
        let ThrustLag { lag, left, better } = found;
        if !better {
            left_out.push(format!(
                "how late the thrust follows the throttle: a lag of {lag:.2} s describes a step best, and small movements no \
                 better than none"
            ));
            return Ok(None);
        }
        if left > LAG_REPORTED_FROM {
            left_out.push(format!(
                "the thrust lags by {lag:.2} s in the model; its answer to a step of the throttle is off by {:.0} % of the \
                 step (rms)",
                100.0 * left
            ));
        }
        Ok(Some(lag))
    }
}

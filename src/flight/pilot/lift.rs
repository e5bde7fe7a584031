//! Angle of attack that the measured lift corrects, for control where no vane measures it or the vane is refused.
//!
//! The link estimates the angle of attack from attitude and climb rate. Air that rises by 1 m/s then counts as 3° at 20 m/s.
//! Beside ArduPlane in light turbulence the error reached 12°, and the elevator that answered it pitched the aircraft up by 60°.
//! The accelerometer shows the lift, whatever the air does, and the model states at which angle of attack the wing has it. If the
//! model's lift is wrong by 10 %, the angle is wrong by 0.7° in level flight of the X8. Records, the monitor and diagnoses keep the
//! link's estimate, because an angle from the model's lift would agree with this lift.

use greylag_link::vehicle::{Faults, Telemetry};
use greylag_model::{GreyBox, Trim, TrimError, Twin};
use greylag_physics::atmosphere::standard_density;
use greylag_physics::{State, Time};

/// First angle of attack of the lift curve, spacing of its points, and their number.
const FIRST_DEG: f64 = -10.0;
const SPACING_DEG: f64 = 1.0;
const COUNT: usize = 31;
/// Elevator deflection from which its lift is computed, rad.
const ELEVATOR: f64 = 0.1;
/// Pitch rate from which its lift is computed, rad/s.
const PITCH_RATE: f64 = 0.1;
/// Time constant with which the lift corrects the estimate, s: a few samples, against the vibration that an accelerometer measures.
/// With 0.15 s the estimate ran away from the lift by 2° in a pull-up, and the envelope limiter pitched the aircraft up.
const TIME_S: f64 = 0.05;
/// Time constant with which a correction is forgotten without an accelerometer, s.
const FORGOTTEN_S: f64 = 2.0;
/// Time between two states above which the correction restarts, s.
const GAP_S: f64 = 0.5;
/// Standard deviations of the corrected angle of attack and sideslip, rad. With the exact model in light turbulence 0.5° and 0.7°
/// were measured; the rest allows for a lift and a side force that are wrong by 10 %.
pub(super) const CORRECTED_SD: [f64; 2] = [0.7 * DEGREE, 1.0 * DEGREE];
/// Lowest airspeed at which the lift is used, m/s.
pub(super) const SLOWEST_MPS: f64 = 5.0;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Lift of a model in straight flight: upward specific force by dynamic pressure (m/s² per Pa) over the angle of attack.
#[derive(Clone, Debug, PartialEq)]
pub struct LiftCurve {
    /// Values that rise with the angle of attack, at `from` and then every [`SPACING_DEG`].
    rising: Vec<f64>,
    /// Angle of attack of the first value, rad.
    from: f64,
    /// Change per q/V, rad/m.
    by_pitch_rate: f64,
    /// Change per rad of elevator, from its deflection `trim` (rad) on.
    by_elevator: f64,
    trim: f64,
}

impl LiftCurve {
    /// The curve of `model` at the true airspeed `airspeed` (m/s). `None` if its lift does not rise over five degrees.
    ///
    /// # Errors
    /// If the model has no straight-flight trim at `airspeed`.
    pub fn of(model: &GreyBox, airspeed: f64) -> Result<Option<LiftCurve>, TrimError> {
        let altitude = model.airframe.reference.altitude;
        let trim = Trim::straight(model, airspeed, altitude)?;
        let pressure = 0.5 * model.atmosphere.density_at(altitude) * airspeed * airspeed;
        let at_trim = trim.controls;
        let lift_at = |alpha: f64, elevator: f64, q: f64| {
            let state = State { alpha, airspeed, q, ..State::NEUTRAL };
            let mut controls = at_trim;
            controls.elevator += elevator;
            let [_, _, down] = Twin::at_rest(state, &controls, altitude).specific_force(model);
            -down / pressure
        };
        let lift = |alpha: f64, elevator: f64| lift_at(alpha, elevator, 0.0);
        let angle = |k: usize| (FIRST_DEG + SPACING_DEG * k as f64) * DEGREE;
        let all: Vec<f64> = (0..COUNT).map(|k| lift(angle(k), 0.0)).collect();
        // the longest rising part around zero: up to the stall, and from a stall on the back on
        let zero = (-FIRST_DEG / SPACING_DEG) as usize;
        let rises = |k: &usize| all[k + 1] > all[*k];
        let last = (zero..COUNT - 1).take_while(rises).last().map_or(zero, |k| k + 1);
        let first = (0..zero).rev().take_while(rises).last().unwrap_or(zero);
        let at = trim.state.alpha;
        let by_elevator = (lift(at, ELEVATOR) - lift(at, 0.0)) / ELEVATOR;
        let by_pitch_rate = (lift_at(at, 0.0, PITCH_RATE) - lift(at, 0.0)) / PITCH_RATE * airspeed;
        let wide =
            (last - first) as f64 * SPACING_DEG >= 5.0 && (by_elevator + by_pitch_rate).is_finite();
        Ok(wide.then(|| LiftCurve {
            rising: all[first..=last].to_vec(),
            from: angle(first),
            by_pitch_rate,
            by_elevator,
            trim: trim.controls.elevator,
        }))
    }

    /// Upward specific force by dynamic pressure (m/s² per Pa) at an angle of attack (rad), with the elevator and the pitch rate of
    /// `frame` at the true airspeed `airspeed` (m/s). Beyond the ends of the rising part it is that of the end.
    pub(super) fn lift(&self, alpha: f64, frame: &Telemetry, airspeed: f64) -> f64 {
        let last = (self.rising.len() - 1) as f64;
        let place = ((alpha - self.from) / (SPACING_DEG * DEGREE)).clamp(0.0, last);
        let k = (place as usize).min(self.rising.len() - 2);
        let [low, high] = [self.rising[k], self.rising[k + 1]];
        low + (high - low) * (place - k as f64) + self.besides(frame, airspeed)
    }

    /// Part of the lift that depends on elevator and pitch rate, m/s² per Pa.
    fn besides(&self, frame: &Telemetry, airspeed: f64) -> f64 {
        self.by_elevator * (frame.actuators.elevator - self.trim)
            + self.by_pitch_rate * frame.state.q / airspeed
    }

    /// Lift by dynamic pressure at the end of the rising part, m/s² per Pa.
    pub(super) fn largest(&self) -> f64 {
        self.rising[self.rising.len() - 1]
    }

    /// Angle of attack (rad) with the upward specific force `lift` by dynamic pressure at the trim's elevator without a pitch rate.
    /// Beyond the ends of the rising part it is that of the end.
    fn angle(&self, lift: f64) -> f64 {
        let k = self.rising.partition_point(|x| *x < lift).clamp(1, self.rising.len() - 1);
        let [low, high] = [self.rising[k - 1], self.rising[k]];
        let part = ((lift - low) / (high - low)).clamp(0.0, 1.0);
        self.from + SPACING_DEG * DEGREE * (k as f64 - 1.0 + part)
    }

    /// Angle of attack (rad) at which the model has the measured lift of `frame` at the true airspeed `airspeed` (m/s). `None`
    /// without an accelerometer and at a low airspeed.
    pub(super) fn measured(&self, frame: &Telemetry, airspeed: f64) -> Option<f64> {
        let whole = !frame.faults.contains(Faults::SPECIFIC_FORCE) && airspeed > SLOWEST_MPS;
        let pressure = 0.5 * standard_density(frame.altitude) * airspeed * airspeed;
        let lift = -frame.specific_force[2] / pressure - self.besides(frame, airspeed);
        (whole && lift.is_finite()).then(|| self.angle(lift))
    }
}

/// The correction of an estimated angle by the angle that follows from a measured force.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Correction {
    /// Time of the last state, and the correction then, rad.
    last: Option<(Time, f64)>,
    /// Time and value of the last new force, m/s².
    force: Option<(Time, f64)>,
}

impl Correction {
    /// The angle `estimated` (rad) at `time`, corrected with the time constant `time_s` (s) by the angle `measured` (rad) that
    /// follows from the specific force `force` (m/s²). A force that has not changed is an old one, and corrects nothing.
    pub(super) fn corrected(
        &mut self,
        time: Time,
        estimated: f64,
        (force, measured): (f64, Option<f64>),
        time_s: f64,
    ) -> f64 {
        let since = |before: Time| time.since(before).as_secs_f64();
        let last = self.last.filter(|(before, _)| since(*before) <= GAP_S);
        let mut added = last.map_or(0.0, |(_, added)| added);
        let step = last.map_or(0.0, |(before, _)| since(before));
        let is_new = self.force.is_none_or(|(_, last)| last != force);
        match measured {
            Some(angle) if is_new => {
                let passed = self.force.map_or(0.0, |(before, _)| since(before).min(GAP_S));
                added += (angle - estimated - added) * (passed / time_s).min(1.0);
            }
            _ => added -= added * (step / FORGOTTEN_S).min(1.0),
        }
        if is_new {
            self.force = Some((time, force));
        }
        self.last = Some((time, added));
        estimated + added
    }
}

/// The correction of an estimated angle of attack by the measured lift.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ByLift(Correction);

impl ByLift {
    /// The angle of attack `estimated` (rad) in `frame`, corrected by its lift at the true airspeed `airspeed` (m/s).
    pub(super) fn alpha(
        &mut self,
        curve: &LiftCurve,
        frame: &Telemetry,
        estimated: f64,
        airspeed: f64,
    ) -> f64 {
        let lift = (frame.specific_force[2], curve.measured(frame, airspeed));
        self.0.corrected(frame.time, estimated, lift, TIME_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable_at;
    use greylag_physics::ActuatorState;

    fn model() -> GreyBox {
        let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        GreyBox::load(&std::path::Path::new(root).join("params/x8/jsbsim.toml")).unwrap()
    }

    fn corrected(by_lift: &mut ByLift, curve: &LiftCurve, frame: &Telemetry) -> f64 {
        by_lift.alpha(curve, frame, frame.state.alpha, frame.state.airspeed)
    }

    /// A state in level flight at 20 m/s, `k` hundredths of a second after the first, with the link's estimate of the angle of attack
    /// and the specific force of the model at the angle `truth` (rad).
    fn frame(model: &GreyBox, k: u64, estimated: f64, truth: f64) -> Telemetry {
        let altitude = model.airframe.reference.altitude;
        let trim = Trim::straight(model, 20.0, altitude).unwrap();
        let state = State { alpha: truth, airspeed: 20.0, ..State::NEUTRAL };
        let mut specific_force =
            Twin::at_rest(state, &trim.controls, altitude).specific_force(model);
        // each state has a new measurement
        specific_force[2] += 1e-9 * k as f64;
        Telemetry {
            state: State { alpha: estimated, ..state },
            incidence_sd: [0.02; 2],
            specific_force,
            actuators: ActuatorState { elevator: trim.controls.elevator, ..Default::default() },
            altitude,
            ..usable_at(k)
        }
    }

    #[test]
    fn in_air_that_rises_the_lift_tells_the_angle_of_attack() {
        let model = model();
        let curve = LiftCurve::of(&model, 20.0).unwrap().unwrap();
        let (mut by_lift, mut alpha) = (ByLift::default(), 0.0);
        for k in 0..100 {
            // the air rises by 3.5 m/s
            alpha = corrected(&mut by_lift, &curve, &frame(&model, k, 0.03 + 0.175, 0.03));
        }
        assert!((alpha - 0.03).to_degrees().abs() < 0.3, "{}", alpha.to_degrees());
        // without an accelerometer the estimate is believed again
        for k in 100..1100 {
            let mut blind = frame(&model, k, 0.1, 0.03);
            blind.faults.insert(Faults::SPECIFIC_FORCE);
            alpha = corrected(&mut by_lift, &curve, &blind);
        }
        assert!((alpha - 0.1).to_degrees().abs() < 0.1, "{}", alpha.to_degrees());
    }

    #[test]
    fn what_is_no_number_corrects_nothing() {
        let model = model();
        let curve = LiftCurve::of(&model, 20.0).unwrap().unwrap();
        let mut by_lift = ByLift::default();
        for k in 0..50 {
            let bad = Telemetry { specific_force: [f64::NAN; 3], ..frame(&model, k, 0.2, 0.03) };
            assert_eq!(corrected(&mut by_lift, &curve, &bad), 0.2);
        }
    }

    #[test]
    fn lift_and_angle_are_inverse_on_the_rising_part() {
        let model = model();
        let curve = LiftCurve::of(&model, 20.0).unwrap().unwrap();
        for (degrees, elevator, q) in
            [(-5.0, 0.0, 0.0), (0.0, 0.1, 0.5), (3.3, -0.1, 0.0), (10.0, 0.05, -0.2)]
        {
            let alpha = degrees * DEGREE;
            let mut frame = usable_at(0);
            (frame.actuators.elevator, frame.state.q) = (elevator, q);
            let pressure = 0.5 * standard_density(frame.altitude) * 20.0 * 20.0;
            frame.specific_force[2] = -curve.lift(alpha, &frame, 20.0) * pressure;
            let again = curve.measured(&frame, 20.0).unwrap();
            assert!((again - alpha).abs() < 1e-9, "{degrees} {}", again.to_degrees());
        }
        assert!(curve.largest() >= curve.lift(3.0 * DEGREE, &frame(&model, 0, 0.0, 0.03), 20.0));
    }
}

//! Angle of attack and airspeed for control: measured ones if other sensors agree with them.
//!
//! Each of the two measurements has two references. The flow reference follows from attitude, velocity over ground and wind. The
//! lift reference is the value at which the model has the measured lift, given the other of the two. A measurement is refused
//! while both references lie to the same side of it by more than a limit. One faulty sensor therefore never causes the refusal of
//! another: a wrong accelerometer leaves the flow references right, a wrong velocity, wind or attitude the lift references. A gust
//! changes measurement and lift together, and a stall measurement and flow. PX4 and ArduPilot check airspeed sensors similarly
//! (innovations, load factor). A flight controller without a vane is left to its own checks; only the dynamic pressure is checked.

use super::ground_velocity::GroundVelocity;
use super::lift::{ByLift, LiftCurve, SLOWEST_MPS};
use greylag_link::vehicle::{Faults, Telemetry, VANE_SD};
use greylag_physics::Time;
use greylag_physics::atmosphere::standard_density;

/// Least disagreement for which an angle of attack is refused, rad. It exceeds the error of a lift curve that is wrong by 30 %.
const ALPHA_LIMIT: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Least disagreement for which an airspeed is refused, m/s and as a fraction of the measurement.
const AIRSPEED_LIMIT: (f64, f64) = (3.0, 0.2);
/// A measurement is refused after this time of disagreement, s. Ten states must agree on it. One that jumps away from both
/// references is refused at once.
const REFUSED_AFTER_S: f64 = 0.1;
/// Time from a jump of a measurement for which it counts as one, s.
const JUMP_S: f64 = 0.03;
/// A refused measurement is used again after this time of agreement, s.
const TRUSTED_AFTER_S: f64 = 1.0;
/// Time between two states above which disagreement and agreement are counted anew, s.
const GAP_S: f64 = 0.5;
/// Least lift by dynamic pressure, as a fraction of the value at the end of the rising lift curve, from which an airspeed follows.
const LEAST_LIFT: f64 = 0.15;

/// Measured quantity that the references contradict.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// The angle of attack of the vane.
    Alpha,
    /// The airspeed of the pitot tube.
    Airspeed,
}

/// Change of a measurement's use for control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Change {
    quantity: Refused,
    /// Measured and used value, rad or m/s, if the measurement is refused from now on; `None` if it is used again.
    values: Option<[f64; 2]>,
}

impl Change {
    /// The text for the ground stations.
    pub(super) fn words(&self) -> String {
        match (self.quantity, self.values) {
            (Refused::Alpha, Some([measured, used])) => format!(
                "angle of attack {:.0} deg refused, {:.0} by attitude and lift: check the vane",
                measured.to_degrees(),
                used.to_degrees()
            ),
            (Refused::Airspeed, Some([measured, used])) => format!(
                "airspeed {measured:.0} m/s refused, {used:.0} by ground speed, wind, lift: check the pitot tube"
            ),
            (Refused::Alpha, None) => "angle of attack used again".into(),
            (Refused::Airspeed, None) => "airspeed used again".into(),
        }
    }

    /// Whether the measurement is refused.
    pub(super) fn is_refusal(&self) -> bool {
        self.values.is_some()
    }
}

/// The two quantities as control uses them, with the history of their checks.
#[derive(Clone, Debug, Default)]
pub(super) struct AirDataCheck {
    /// Corrects the angle of attack that is used where none is measured or the measured one is refused.
    by_lift: ByLift,
    /// Corrects the measured angle of attack. The result is the lift reference: like the measurement it follows a gust at once.
    reference: ByLift,
    alpha: Check,
    airspeed: Check,
    changes: Vec<Change>,
    velocity: GroundVelocity,
    /// The last airspeed for control, or for forces without a vane, m/s.
    last_airspeed: f64,
}

/// History of the check of one measurement.
#[derive(Clone, Copy, Debug, Default)]
struct Check {
    refused: bool,
    /// Time of the last state, and time for which it has contradicted the present use, s.
    last: Option<(Time, f64)>,
    /// Time and value of the last measurement.
    measured: Option<(Time, f64)>,
    /// Time of the last jump.
    jumped: Option<Time>,
}

impl Check {
    /// Registers the measurement `value` at `time`. Returns whether it has just jumped: it changed by more than `limit` from one
    /// state to the next.
    fn jumps(&mut self, time: Time, value: f64, limit: f64) -> bool {
        let soon = |before: Time| time.since(before).as_secs_f64() <= JUMP_S;
        let last = self.measured.replace((time, value));
        if last.is_some_and(|(before, last)| soon(before) && (value - last).abs() > limit) {
            self.jumped = Some(time);
        }
        self.jumped.is_some_and(soon)
    }

    /// Registers whether the references contradict the measurement at `time`, and whether it has just jumped. Returns whether its
    /// use changes.
    fn see(&mut self, time: Time, contradicted: bool, jumped: bool) -> bool {
        let before = self.last.map(|(at, lasted)| (time.since(at).as_secs_f64(), lasted));
        let lasted = match before {
            Some((passed, lasted)) if contradicted != self.refused && passed <= GAP_S => {
                lasted + passed
            }
            _ => 0.0,
        };
        let needed = match self.refused {
            true => TRUSTED_AFTER_S,
            false if jumped => 0.0,
            false => REFUSED_AFTER_S,
        };
        let changes = contradicted != self.refused && lasted >= needed - 1e-6;
        self.refused ^= changes;
        self.last = Some((time, if changes { 0.0 } else { lasted }));
        changes
    }
}

impl AirDataCheck {
    /// Angle of attack (rad) and airspeed (m/s) for control in `frame`. `curve` is the lift of the model. Without it, or without
    /// velocity and wind, they are those of the frame.
    pub(super) fn for_control(&mut self, curve: Option<&LiftCurve>, frame: &Telemetry) -> [f64; 2] {
        let measured = [frame.state.alpha, frame.state.airspeed];
        let Some(curve) = curve else { return measured };
        if frame.incidence_sd[0] > VANE_SD[0] {
            let airspeed = self.for_forces(frame);
            return [self.by_lift.alpha(curve, frame, measured[0], airspeed), measured[1]];
        }
        if frame.faults.contains(Faults::SPECIFIC_FORCE) {
            *self =
                AirDataCheck { changes: std::mem::take(&mut self.changes), ..Default::default() };
            return measured;
        }
        let Some(flow) = self.velocity.flow(frame) else {
            let alpha = self.reference.alpha(curve, frame, measured[0], self.last_airspeed);
            return [
                if self.alpha.refused { alpha } else { measured[0] },
                if self.airspeed.refused { self.last_airspeed } else { measured[1] },
            ];
        };
        // a refused measurement is no reference of the other
        let [alpha, airspeed] = [
            if self.alpha.refused { flow[0] } else { measured[0] },
            if self.airspeed.refused { flow[1] } else { measured[1] },
        ];
        let limits = [ALPHA_LIMIT, AIRSPEED_LIMIT.0.max(AIRSPEED_LIMIT.1 * measured[1])];
        let jumped = [
            self.alpha.jumps(frame.time, measured[0], limits[0]),
            self.airspeed.jumps(frame.time, measured[1], limits[1]),
        ];
        let corrected = self.reference.alpha(curve, frame, measured[0], airspeed);
        // a gust that makes the vane jump makes the lift jump too
        let at_once = jumped[0].then(|| curve.measured(frame, airspeed)).flatten();
        let lift = [
            at_once.unwrap_or(corrected),
            airspeed_by_lift(curve, frame, alpha).unwrap_or(measured[1]),
        ];
        let used = [self.by_lift.alpha(curve, frame, flow[0], airspeed), flow[1]];
        let contradicted = |k: usize| {
            let off = [flow[k] - measured[k], lift[k] - measured[k]];
            off.iter().all(|x| *x > limits[k]) || off.iter().all(|x| *x < -limits[k])
        };
        let kinds = [(Refused::Alpha, &mut self.alpha), (Refused::Airspeed, &mut self.airspeed)];
        let mut answer = measured;
        for (k, (quantity, check)) in kinds.into_iter().enumerate() {
            if check.see(frame.time, contradicted(k), jumped[k]) {
                let values = check.refused.then_some([measured[k], used[k]]);
                self.changes.push(Change { quantity, values });
            }
            if check.refused {
                answer[k] = used[k];
            }
        }
        self.last_airspeed = answer[1];
        answer
    }

    /// Airspeed (m/s) for the dynamic pressure of a vehicle without vanes. With that of a blocked tube, lift and side force would
    /// give wrong angles.
    fn for_forces(&mut self, frame: &Telemetry) -> f64 {
        let whole = !frame.faults.contains(Faults::SPECIFIC_FORCE);
        let other = whole.then(|| self.velocity.instead(frame)).flatten();
        self.last_airspeed = other.unwrap_or(frame.state.airspeed);
        self.last_airspeed
    }

    /// Airspeed (m/s) of the last frame's dynamic pressure.
    pub(super) fn last_airspeed(&self) -> f64 {
        self.last_airspeed
    }

    /// Takes the changes since the last call.
    pub(super) fn take_changes(&mut self) -> Vec<Change> {
        std::mem::take(&mut self.changes)
    }
}

/// Airspeed (m/s) at which the model has the measured lift at the angle of attack `alpha` (rad). `None` if the lift is too small.
fn airspeed_by_lift(curve: &LiftCurve, frame: &Telemetry, alpha: f64) -> Option<f64> {
    let by_pressure = curve.lift(alpha, frame, frame.state.airspeed.max(SLOWEST_MPS));
    let pressure = -frame.specific_force[2] / by_pressure;
    let enough = by_pressure.abs() > LEAST_LIFT * curve.largest() && pressure > 0.0;
    enough.then(|| (2.0 * pressure / standard_density(frame.altitude)).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::frames::usable;
    use greylag_model::{GreyBox, Trim, Twin};
    use greylag_physics::rigid_body::body_to_horizon;
    use greylag_physics::{ActuatorState, State};

    /// Level flight of the X8 at 20 m/s to the north-east in a wind of 6 m/s, with right sensors, after `k` hundredths of a second.
    struct Level {
        curve: LiftCurve,
        frame: Telemetry,
        check: AirDataCheck,
        k: u64,
    }

    impl Level {
        fn new() -> Level {
            let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
            let model =
                GreyBox::load(&std::path::Path::new(root).join("params/x8/jsbsim.toml")).unwrap();
            let altitude = model.airframe.reference.altitude;
            let trim = Trim::straight(&model, 20.0, altitude).unwrap();
            let specific_force =
                Twin::at_rest(trim.state, &trim.controls, altitude).specific_force(&model);
            let State { alpha, airspeed, .. } = trim.state;
            let body = [airspeed * alpha.cos(), 0.0, airspeed * alpha.sin()];
            let [ahead, _, down] = body_to_horizon(&trim.state, body);
            let (sin, cos) = 0.8f64.sin_cos();
            let frame = Telemetry {
                state: trim.state,
                yaw: 0.8,
                specific_force,
                actuators: ActuatorState { elevator: trim.controls.elevator, ..Default::default() },
                altitude,
                velocity: [cos * ahead + 6.0, sin * ahead, down],
                wind: [6.0, 0.0, 0.0],
                ..usable()
            };
            let curve = LiftCurve::of(&model, 20.0).unwrap().unwrap();
            Level { curve, frame, check: AirDataCheck::default(), k: 0 }
        }

        /// The values for control after `seconds` in which the sensors differ from the right ones by `change`.
        fn fly(&mut self, seconds: f64, change: impl Fn(&mut Telemetry)) -> [f64; 2] {
            let mut answer = [f64::NAN; 2];
            for _ in 0..(seconds * 100.0).round() as u64 {
                self.k += 1;
                let mut frame =
                    Telemetry { time: Time::from_micros(10_000 * self.k), ..self.frame };
                // ten new velocities a second, and a new force in each state
                frame.velocity[0] += 1e-9 * (self.k / 10) as f64;
                frame.specific_force[2] += 1e-9 * self.k as f64;
                change(&mut frame);
                answer = self.check.for_control(Some(&self.curve), &frame);
            }
            answer
        }

        /// Largest error of `values`: of the angle of attack in degrees, of the airspeed in m/s.
        fn error(&self, [alpha, airspeed]: [f64; 2]) -> f64 {
            let off = (alpha - self.frame.state.alpha).to_degrees().abs();
            off.max((airspeed - self.frame.state.airspeed).abs())
        }

        fn changes(&mut self) -> Vec<bool> {
            self.check.take_changes().iter().map(Change::is_refusal).collect()
        }
    }

    #[test]
    fn a_vane_that_is_wrong_by_eleven_degrees_is_refused_within_a_quarter_of_a_second() {
        for degrees in [11.0f64, -11.0] {
            let mut level = Level::new();
            let wrong = move |frame: &mut Telemetry| frame.state.alpha += degrees.to_radians();
            let right = level.fly(1.0, |_| ());
            assert!(level.error(right) < 1e-9 && level.changes().is_empty());
            let late = level.fly(0.25, wrong);
            assert!(level.error(late) < 0.5, "{late:?}");
            assert_eq!(level.changes(), [true]);
            let long = level.fly(5.0, wrong);
            assert!(level.error(long) < 0.5, "{long:?}");
            level.fly(1.5, |_| ());
            assert_eq!(level.changes(), [false]);
        }
    }

    #[test]
    fn a_vane_that_jumps_by_eleven_degrees_is_refused_at_once() {
        let mut level = Level::new();
        level.fly(1.0, |_| ());
        let first = level.fly(0.01, |frame| frame.state.alpha += 0.19);
        assert!(level.error(first) < 0.5, "{first:?}");
        assert_eq!(level.changes(), [true]);
        let mut level = Level::new();
        level.fly(1.0, |_| ());
        let first = level.fly(0.01, |frame| frame.state.airspeed = 28.0);
        assert!(level.error(first) < 1e-6, "{first:?}");
        assert_eq!(level.changes(), [true]);
    }

    #[test]
    fn a_blocked_pitot_tube_is_refused_and_the_vane_is_not() {
        for blocked in [12.0, 28.0] {
            let mut level = Level::new();
            level.fly(1.0, |_| ());
            let found = level.fly(3.0, |frame| frame.state.airspeed = blocked);
            assert!(level.error(found) < 1e-6, "{found:?}");
            let changes = level.check.take_changes();
            assert_eq!(changes.len(), 1);
            assert!(changes[0].words().starts_with("airspeed"), "{}", changes[0].words());
        }
    }

    #[test]
    fn vane_and_pitot_tube_wrong_at_once_are_both_refused() {
        let mut level = Level::new();
        let found = level.fly(5.0, |frame| {
            frame.state.alpha += 0.2;
            frame.state.airspeed = 28.0;
        });
        assert!(level.error(found) < 0.5, "{found:?}");
    }

    /// Each reference may be wrong by itself.
    #[test]
    fn no_other_sensor_and_no_gust_makes_a_right_measurement_be_refused() {
        let mut level = Level::new();
        let wrong: [fn(&mut Telemetry); 5] = [
            |frame| frame.specific_force[2] *= 2.0,
            |frame| frame.specific_force[2] *= 0.3,
            |frame| frame.wind = [-6.0, 6.0, 5.0],
            |frame| frame.state.pitch += 0.3,
            |frame| frame.faults.insert(Faults::SPECIFIC_FORCE),
        ];
        for change in wrong {
            let found = level.fly(3.0, change);
            assert!(level.changes().is_empty() && level.error(found).is_finite());
        }
        // an upward gust of 3.5 m/s: vane and lift rise together, attitude and velocity do not
        let by_pressure =
            |alpha: f64| level.curve.lift(alpha, &level.frame, level.frame.state.airspeed);
        let alpha = level.frame.state.alpha;
        let ratio = by_pressure(alpha + 0.175) / by_pressure(alpha);
        let gust = move |frame: &mut Telemetry| {
            frame.state.alpha += 0.175;
            frame.specific_force[2] *= ratio;
        };
        let found = level.fly(2.0, gust);
        assert!((found[0] - alpha - 0.175).abs() < 1e-9 && level.changes().is_empty());
    }

    /// A pull-up of 30°/s at a constant angle of attack. Its lift is more than the model's, and the old velocity says that the nose
    /// is far above the path.
    #[test]
    fn an_old_velocity_is_no_reference() {
        let mut level = Level::new();
        let Level { frame: Telemetry { velocity, state, .. }, .. } = level;
        for k in 0..200 {
            let pitch = state.pitch + 0.0052 * k as f64;
            level.fly(0.01, |frame| {
                frame.velocity = velocity;
                frame.state.pitch = pitch;
                frame.specific_force =
                    [9.81 * pitch.sin(), 0.0, -9.81 * pitch.cos() - 0.52 * state.airspeed];
            });
        }
        assert!(level.changes().is_empty());
    }

    #[test]
    fn without_velocity_or_wind_the_measurements_are_used() {
        let mut level = Level::new();
        let found = level.fly(2.0, |frame| {
            frame.wind = [f64::NAN; 3];
            frame.state.alpha += 0.3;
        });
        assert!((found[0] - level.frame.state.alpha - 0.3).abs() < 1e-12);
    }
}

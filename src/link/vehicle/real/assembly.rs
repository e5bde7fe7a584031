//! Assembles state frames from a flight controller's message streams. Each attitude message completes a state frame.

use std::time::Duration;

use super::air_data::{self, AirData, Measured};
use super::gusts::Gusts;
use crate::vehicle::{Faults, Order, Telemetry, VehicleCounts, limits};
use crate::wire::controller::ControllerMessage;
use crate::wire::setpoint::euler;
use greylag_physics::actuators::Actuators;
use greylag_physics::airframe::ActuatorFigures;
use greylag_physics::atmosphere::{self, SEA_LEVEL_DENSITY};
use greylag_physics::{Command, Controls, State, Time};

/// Nominal time between states, µs.
const PERIOD_US: u64 = 10_000;
/// Step back of the controller's clock (ms) above which it counts as restarted. After a smaller one the message came late.
const RESTART_MS: i32 = 1000;
/// Age of a measurement above which it is no longer used.
const STALE: Duration = Duration::from_millis(300);
/// Largest number of steps of the actuator model after a gap: 0.2 s, after which the actuators have settled.
const CATCH_UP: u64 = 20;
/// The last value of a stream with its arrival time by this computer's clock; `None` before the first value.
type Heard<T> = Option<(Duration, T)>;

/// The latest values of a flight controller's streams, and the state frame made from them.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    figures: ActuatorFigures,
    specific_force: Heard<[f64; 3]>,
    density: Heard<f64>,
    /// Equivalent airspeed (m/s), altitude (m), climb rate (m/s).
    air: Heard<[f64; 3]>,
    incidence: Heard<[f64; 2]>,
    estimator: AirData,
    gusts: Gusts,
    /// Whether a velocity over ground has arrived since the last update of `estimator`.
    new_velocity: bool,
    actuators: Actuators,
    boot_ms: Option<u32>,
    pub(super) last: Telemetry,
    /// Assumed standard deviation of the reported wind, m/s.
    wind_sd: f64,
    /// Bit patterns of the last state's sensor values, to detect frozen sensors.
    shown: [u64; 13],
    pub(super) counts: VehicleCounts,
}

impl Assembly {
    pub(super) fn new(figures: ActuatorFigures) -> Self {
        let nan = f64::NAN;
        Assembly {
            figures,
            specific_force: None,
            density: None,
            air: None,
            incidence: None,
            estimator: AirData::default(),
            gusts: Gusts::default(),
            new_velocity: false,
            actuators: Actuators::at_rest(&Controls::default()),
            boot_ms: None,
            shown: [0; 13],
            last: Telemetry {
                time: Time::default(),
                order: Order::First,
                faults: Faults::NONE,
                state: State::NEUTRAL,
                incidence_sd: air_data::DEVIATION,
                yaw: 0.0,
                rate_hold_s: 0.0,
                specific_force: [0.0, 0.0, -9.81],
                actuators: Default::default(),
                altitude: 0.0,
                position: [nan; 2],
                velocity: [nan; 3],
                wind: [nan; 3],
            },
            wind_sd: f64::NAN,
            counts: VehicleCounts::default(),
        }
    }

    /// Roll and pitch of the last state, rad; NaN if implausible.
    pub(super) fn attitude(&self) -> [f64; 2] {
        match self.last.faults.contains(Faults::ATTITUDE) {
            true => [f64::NAN; 2],
            false => [self.last.state.roll, self.last.state.pitch],
        }
    }

    /// Stores the measurement in `message`. An attitude completes a state, which is returned. `command` acted since the last one.
    pub(super) fn take(
        &mut self,
        host: Duration,
        message: &ControllerMessage,
        command: &Command,
    ) -> Option<Telemetry> {
        match *message {
            ControllerMessage::Imu { specific_force, density, .. } => {
                self.specific_force = Some((host, specific_force));
                self.density = Some((host, density)).filter(|_| density.is_finite());
            }
            ControllerMessage::Air { airspeed, altitude, climb } => {
                self.air = Some((host, [airspeed, altitude, climb]));
            }
            ControllerMessage::Incidence(angles) => self.incidence = Some((host, angles)),
            ControllerMessage::Position { position, velocity }
                if limits::position(position) && limits::ground_velocity(velocity) =>
            {
                (self.last.position, self.last.velocity) = (position, velocity);
                self.new_velocity = true;
            }
            ControllerMessage::Wind { velocity, sd } if limits::wind(velocity) => {
                (self.last.wind, self.wind_sd) = (velocity, sd);
            }
            ControllerMessage::Attitude { boot_ms, quaternion, rates } => {
                return self.complete(host, boot_ms, quaternion, rates, command);
            }
            _ => {}
        }
        None
    }

    fn complete(
        &mut self,
        host: Duration,
        boot_ms: u32,
        quaternion: [f64; 4],
        rates: [f64; 3],
        command: &Command,
    ) -> Option<Telemetry> {
        if self.specific_force.is_none() || self.air.is_none() {
            self.counts.incomplete += 1;
            return None;
        }
        let (time, order) = self.order(boot_ms);
        let step = time.since(self.last.time);
        let mut next = Telemetry { time, order, faults: Faults::NONE, ..self.last };
        if matches!(order, Order::Late | Order::Repeated) {
            return Some(next);
        }
        match euler(quaternion) {
            Ok((roll, pitch, yaw)) => {
                (next.state.roll, next.state.pitch, next.yaw) = (roll, pitch, yaw);
            }
            Err(_) => next.faults.insert(Faults::ATTITUDE),
        }
        match limits::rates(rates) {
            true => [next.state.p, next.state.q, next.state.r] = rates,
            false => next.faults.insert(Faults::RATES),
        }
        self.fill_force(host, &mut next);
        let climb = self.fill_air(host, &mut next);
        // a state with faults, such as an old measurement, is not tested for frozen sensors
        if self.stands_still(quaternion, rates) && next.faults.is_empty() {
            // the estimator would change the angles, and the pilot could not see that all sensors are frozen
            (next.state.alpha, next.state.beta) = (self.last.state.alpha, self.last.state.beta);
        } else {
            self.fill_incidence(host, &mut next, climb, step.as_secs_f64());
        }
        let steps = (step.as_micros() as u64 + PERIOD_US / 2) / PERIOD_US;
        for _ in 0..steps.clamp(1, CATCH_UP) {
            self.actuators.step(command, &self.figures);
        }
        next.actuators = self.actuators.observed(&self.figures);
        self.counts.faulty += u64::from(!next.faults.is_empty());
        self.last = next;
        Some(next)
    }

    /// Whether every sensor value equals that of the last state bit by bit. Stores the present values.
    fn stands_still(&mut self, quaternion: [f64; 4], rates: [f64; 3]) -> bool {
        let force = self.specific_force.map_or([0.0; 3], |(_, force)| force);
        let air = self.air.map_or([0.0; 3], |(_, air)| air);
        let mut shown = [0; 13];
        let values = quaternion.iter().chain(&rates).chain(&force).chain(&air);
        shown.iter_mut().zip(values).for_each(|(to, x)| *to = x.to_bits());
        std::mem::replace(&mut self.shown, shown) == shown
    }

    fn fill_force(&self, host: Duration, next: &mut Telemetry) {
        match fresh(self.specific_force, host).filter(|force| limits::specific_force(*force)) {
            Some(force) => next.specific_force = force,
            None => next.faults.insert(Faults::SPECIFIC_FORCE),
        }
    }

    /// Sets true airspeed and altitude in `next`. Returns the climb rate, m/s; NaN if the air data are too old.
    fn fill_air(&self, host: Duration, next: &mut Telemetry) -> f64 {
        let Some([equivalent, altitude, climb]) = fresh(self.air, host) else {
            next.faults.insert(Faults::LATE_AIR);
            return f64::NAN;
        };
        let standard = || standard_density(altitude);
        let density = fresh(self.density, host).unwrap_or_else(standard);
        let airspeed = equivalent * (SEA_LEVEL_DENSITY / density).sqrt();
        match limits::air(airspeed, altitude) {
            true => (next.state.airspeed, next.altitude) = (airspeed, altitude),
            false => next.faults.insert(Faults::AIR),
        }
        climb
    }

    fn fill_incidence(&mut self, host: Duration, next: &mut Telemetry, climb: f64, step: f64) {
        let reported = fresh(self.incidence, host).filter(|[a, b]| limits::incidence(*a, *b));
        let s = &next.state;
        let measured = Measured {
            attitude: [s.roll, s.pitch, next.yaw],
            rates: [s.p, s.q, s.r],
            specific_force: next.specific_force,
            airspeed: s.airspeed,
            climb,
            velocity: match std::mem::take(&mut self.new_velocity) {
                true => next.velocity,
                false => [f64::NAN; 3],
            },
            wind: next.wind,
            wind_sd: self.wind_sd,
        };
        let estimated = self.estimator.update(&measured, step);
        let whole = !next.faults.contains(Faults::SPECIFIC_FORCE);
        // ArduPilot's reported angles (AOA_SSA) come from its wind estimate, not from vanes. With ArduPlane, the standard
        // deviation of their sideslip error was 1.7°. That of `estimator` was 0.4°, so its angles are preferred.
        match estimated.filter(|_| whole).or(reported) {
            Some([alpha, beta]) => (next.state.alpha, next.state.beta) = (alpha, beta),
            None => next.faults.insert(Faults::INCIDENCE),
        }
        let incidence = estimated.unwrap_or([f64::NAN; 2]);
        let Measured { attitude, airspeed, velocity, .. } = measured;
        self.gusts.update(attitude, incidence, airspeed, velocity, step);
        let gust = self.gusts.incidence(airspeed);
        next.incidence_sd = air_data::DEVIATION.map(|sd| sd.hypot(gust));
    }

    /// The vehicle time of a state and its order relative to the last one. The 32-bit count of milliseconds wraps after 49 days.
    fn order(&mut self, boot_ms: u32) -> (Time, Order) {
        let first = Time::from_micros(1000 * u64::from(boot_ms));
        let Some(before) = self.boot_ms else {
            return self.start(boot_ms, first);
        };
        let passed = boot_ms.wrapping_sub(before) as i32;
        let past =
            |ms: u64| Time::from_micros(self.last.time.as_micros().saturating_sub(1000 * ms));
        match passed {
            ..0 if passed < -RESTART_MS => self.start(boot_ms, first),
            ..0 => {
                self.counts.late += 1;
                (past(u64::from(passed.unsigned_abs())), Order::Late)
            }
            0 => {
                self.counts.repeated += 1;
                (self.last.time, Order::Repeated)
            }
            1.. => {
                self.boot_ms = Some(boot_ms);
                let us = 1000 * passed as u64;
                let lost = ((us + PERIOD_US / 2) / PERIOD_US).saturating_sub(1);
                self.counts.lost += lost;
                self.counts.states += 1;
                let time = Time::from_micros(self.last.time.as_micros() + us);
                (time, Order::Next { lost: u32::try_from(lost).unwrap_or(u32::MAX) })
            }
        }
    }

    fn start(&mut self, boot_ms: u32, time: Time) -> (Time, Order) {
        self.boot_ms = Some(boot_ms);
        self.estimator = AirData::default();
        self.gusts = Gusts::default();
        self.counts.starts += 1;
        self.counts.states += 1;
        (time, Order::First)
    }
}

fn fresh<T: Copy>(heard: Heard<T>, host: Duration) -> Option<T> {
    heard.filter(|(at, _)| host.saturating_sub(*at) <= STALE).map(|(_, value)| value)
}

fn standard_density(altitude: f64) -> f64 {
    let altitude = if altitude.is_finite() { altitude.clamp(-1000.0, 11_000.0) } else { 0.0 };
    atmosphere::standard_density(altitude)
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::Airframe;
    use std::path::Path;

    fn assembly() -> Assembly {
        let airframe = Airframe::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/airframe.toml"
        )))
        .unwrap();
        Assembly::new(airframe.actuators)
    }

    fn attitude(boot_ms: u32) -> ControllerMessage {
        ControllerMessage::Attitude { boot_ms, quaternion: [1.0, 0.0, 0.0, 0.0], rates: [0.0; 3] }
    }

    fn fed(assembly: &mut Assembly, host: Duration) {
        let imu = ControllerMessage::Imu {
            time: Time::default(),
            specific_force: [0.0, 0.0, -9.81],
            density: 1.0,
        };
        let air = ControllerMessage::Air { airspeed: 20.0, altitude: 600.0, climb: 0.0 };
        assembly.take(host, &imu, &Command::IDLE);
        assembly.take(host, &air, &Command::IDLE);
    }

    #[test]
    fn milliseconds_wrap_after_49_days_without_a_step_in_time() {
        let mut assembly = assembly();
        let host = Duration::from_secs(1);
        fed(&mut assembly, host);
        let mut times = Vec::new();
        for i in 0..10u32 {
            let boot = (u32::MAX - 45).wrapping_add(10 * i);
            let state = assembly.take(host, &attitude(boot), &Command::IDLE).unwrap();
            times.push(state.time.as_micros());
        }
        assert!(times.windows(2).all(|w| w[1] - w[0] == 10_000), "{times:?}");
        assert_eq!((assembly.counts.starts, assembly.counts.lost), (1, 0));
    }

    #[test]
    fn a_clock_that_starts_again_is_a_new_start_and_a_late_frame_is_not() {
        let mut assembly = assembly();
        let host = Duration::from_secs(1);
        fed(&mut assembly, host);
        let orders: Vec<_> = [50_000, 50_010, 50_000, 50_030, 40]
            .map(|ms| assembly.take(host, &attitude(ms), &Command::IDLE).unwrap().order)
            .into();
        let next = |lost| Order::Next { lost };
        assert_eq!(orders, [Order::First, next(0), Order::Late, next(1), Order::First]);
    }

    #[test]
    fn equivalent_airspeed_becomes_true_and_a_stale_one_a_fault() {
        let mut assembly = assembly();
        let host = Duration::from_secs(1);
        assert!(assembly.take(host, &attitude(10), &Command::IDLE).is_none());
        fed(&mut assembly, host);
        let state = assembly.take(host, &attitude(20), &Command::IDLE).unwrap();
        // true airspeed is √(1.225 / 1.0) times the equivalent airspeed
        assert!((state.state.airspeed - 20.0 * 1.106_797).abs() < 1e-4);
        assert!(state.faults.is_empty(), "{}", state.faults);
        let late = host + STALE + Duration::from_millis(1);
        let state = assembly.take(late, &attitude(30), &Command::IDLE).unwrap();
        assert!(
            state.faults.contains(Faults::LATE_AIR) && state.faults.contains(Faults::INCIDENCE)
        );
    }

    #[test]
    fn an_absurd_wind_is_left_out_and_faults_are_counted() {
        let mut assembly = assembly();
        let host = Duration::from_secs(1);
        let wind = |x| ControllerMessage::Wind { velocity: [x, 0.0, 0.0], sd: 0.5 };
        assembly.take(host, &wind(1000.0), &Command::IDLE);
        fed(&mut assembly, host);
        let state = assembly.take(host, &attitude(20), &Command::IDLE).unwrap();
        assert!(state.wind[0].is_nan());
        assembly.take(host, &wind(8.0), &Command::IDLE);
        let late = host + STALE + Duration::from_millis(1);
        let state = assembly.take(late, &attitude(30), &Command::IDLE).unwrap();
        assert_eq!(state.wind, [8.0, 0.0, 0.0]);
        let counts = assembly.counts;
        assert_eq!((counts.faulty, counts.states, counts.starts), (1, 2, 1));
    }

    #[test]
    fn an_absurd_position_is_left_out_and_an_unknown_density_is_the_standard_one() {
        let mut assembly = assembly();
        let host = Duration::from_secs(1);
        fed(&mut assembly, host);
        let imu = ControllerMessage::Imu {
            time: Time::default(),
            specific_force: [0.0, 0.0, -9.81],
            density: f64::NAN,
        };
        assembly.take(host, &imu, &Command::IDLE);
        let position =
            |at| ControllerMessage::Position { position: [at, 7.5], velocity: [20.0, 0.0, 0.0] };
        assembly.take(host, &position(91.0), &Command::IDLE);
        let state = assembly.take(host, &attitude(20), &Command::IDLE).unwrap();
        assert!(state.position[0].is_nan() && state.velocity[0].is_nan());
        // the factor is √(1.225 / 1.156) with the density of the standard atmosphere at 600 m
        assert!((state.state.airspeed - 20.588).abs() < 0.005, "{}", state.state.airspeed);
        assembly.take(host, &position(45.0), &Command::IDLE);
        let state = assembly.take(host, &attitude(30), &Command::IDLE).unwrap();
        assert_eq!((state.position, state.velocity), ([45.0, 7.5], [20.0, 0.0, 0.0]));
        assert_eq!(standard_density(f64::NAN), standard_density(0.0));
    }
}

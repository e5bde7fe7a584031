//! One flight of 60 s under faults, in lockstep in this process.

mod client;
mod disk;
mod error;
mod faulty;
mod monitored;
mod traced;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use greylag_sitl::plant::{Inputs, PlantOptions};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::counterpart::{Aircraft, Counterpart, vehicle};
use super::judge::{Cause, Finding, Found, Judge};
use super::mix::{Fault, FaultKind};
use super::policies::Sample;
use super::scenario::{Asking, Scenario, Setting};
use super::wire::Wire;
use disk::Disk;
pub use error::FaultsError;
use greylag_control::{Controller, ControllerKind, build};
use greylag_flight::desk::Desk;
use greylag_flight::pilot::Pilot;
use greylag_flight::recorder::Recorder;
use greylag_flight::runtime::Companion;
use greylag_link::autopilot::{Autopilot, ParameterValue, Verdict};
use greylag_link::vehicle::Vehicle;
use greylag_model::GreyBox;
use greylag_physics::airframe::Envelope;
pub use monitored::{ATTITUDE_DEG, FAILS_S, Failure, Watched};
use traced::Follower;

/// Steps of a flight: 60 s.
const STEPS: u64 = 6000;
/// A dead link must have handed the aircraft back after this time, s.
const HAND_BACK_S: f64 = 0.5;

/// Stream of the random numbers of a starved processor.
const STARVED: u64 = 20;

/// A flight to be flown.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Its number, from which everything random follows.
    pub seed: u64,
    /// Who steers.
    pub controller: ControllerKind,
    /// Whom it steers through.
    pub counterpart: Counterpart,
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Report {
    /// The flight.
    pub case: Case,
    /// The faults that it met.
    pub faults: Vec<Fault>,
    /// What was found wrong.
    pub findings: Vec<Found>,
    /// What was said to the ground stations, with nothing left out: when, s, and what.
    pub texts: Vec<(f64, String)>,
}

/// A flight with all that was seen and heard of it.
#[derive(Clone, Debug)]
pub struct Witnessed {
    /// The flight, every 10 ms; it ends with a panic or on the ground.
    pub samples: Vec<Sample>,
    /// What the judge of a flight found.
    pub findings: Vec<Found>,
    /// What the companion said to the ground stations: when, s, and what.
    pub texts: Vec<(f64, String)>,
    /// What the client asked the companion for besides setpoints, and the answers: when, s.
    pub answers: Vec<(f64, Asking, Verdict)>,
}

/// A companion fresh from the factory: the design of its controller is not made again.
pub struct CompanionFactory {
    companion: Companion,
    fallback: Box<dyn Controller>,
    model: GreyBox,
    plant: PlantOptions,
}

impl CompanionFactory {
    /// The factory that builds companions with `companion`, for the aircraft of `model`; as in flight, the
    /// fallback is an LQI.
    ///
    /// # Errors
    /// If the model has no LQI.
    pub fn new(companion: Companion, model: &GreyBox) -> Result<Self, FaultsError> {
        let fallback = match companion.controller.name() == ControllerKind::Lqi.name() {
            true => companion.controller.boxed_clone(),
            false => build(ControllerKind::Lqi, model)?,
        };
        let plant = PlantOptions::default();
        Ok(CompanionFactory { companion, fallback, model: model.clone(), plant })
    }

    /// The same with the simulator's aircraft `plant`, from its start.
    pub fn with_aircraft(self, plant: PlantOptions) -> Self {
        CompanionFactory { plant, ..self }
    }

    /// The envelope of its aircraft.
    pub fn envelope(&self) -> Envelope {
        self.model.airframe.envelope
    }

    fn desk(&self, counterpart: Counterpart) -> Result<Desk, FaultsError> {
        let config = self.companion.pilot.config().clone();
        let mut pilot = Pilot::new(config, self.fallback.boxed_clone())?;
        if let Some(limiter) = self.companion.pilot.protection() {
            pilot.protect_with(limiter.clone());
        }
        let controller = self.companion.controller.boxed_clone();
        let companion = Companion { pilot, controller, placement: self.companion.placement };
        Ok(Desk::new(companion, vehicle(counterpart, &self.model)))
    }

    /// Flies `case`; a panic of the companion is a finding. What an aircraft did is laid to a cause if it
    /// was exposed to it, and does not do it when the same flight is flown without the faults of that kind; to none
    /// of them if it does it without any.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded.
    pub fn fly(&self, case: Case) -> Result<Report, FaultsError> {
        let scenario = Scenario::of_seed(case.counterpart, case.seed);
        let mut report = self.fly_under(case, scenario.faults)?;
        for cause in Cause::OF_FAULTS {
            if !report.findings.iter().any(|found| found.is_open_to(cause)) {
                continue;
            }
            let rest = report.faults.iter().filter(|fault| !cause.is_of(fault.kind));
            let without = self.fly_under(case, rest.copied().collect())?;
            for found in report.findings.iter_mut().filter(|found| found.is_open_to(cause)) {
                let still = without.findings.iter().any(|other| other.finding == found.finding);
                found.cause = (!still).then_some(cause);
            }
        }
        let open = |found: &Found| found.cause.is_none() && !found.finding.is_own();
        if report.findings.iter().any(open) {
            let spared = self.fly_under(case, Vec::new())?;
            for found in report.findings.iter_mut().filter(|found| open(found)) {
                let same = spared.findings.iter().any(|other| other.finding == found.finding);
                found.cause = same.then_some(Cause::Itself);
            }
        }
        Ok(report)
    }

    fn fly_under(&self, case: Case, faults: Vec<Fault>) -> Result<Report, FaultsError> {
        let scenario = Scenario { faults, ..Scenario::of_seed(case.counterpart, case.seed) };
        let flight = self.flown(&scenario, None)?;
        let findings = flight.judge.findings();
        Ok(Report { case, faults: scenario.faults, findings, texts: flight.texts })
    }

    /// Flies `scenario` for its samples, every 10 ms, and what the judge of a flight found. The samples end with a panic.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded.
    pub fn trace(&self, scenario: &Scenario) -> Result<(Vec<Sample>, Vec<Found>), FaultsError> {
        self.witness(scenario).map(|flown| (flown.samples, flown.findings))
    }

    /// The same with what was said and answered.
    ///
    /// # Errors
    /// If the aircraft cannot be loaded.
    pub fn witness(&self, scenario: &Scenario) -> Result<Witnessed, FaultsError> {
        let mut flight = self.flown(scenario, Some(Vec::with_capacity(STEPS as usize)))?;
        let samples = flight.trace.take().unwrap_or_default();
        let Flight { judge, texts, answers, .. } = flight;
        Ok(Witnessed { samples, findings: judge.findings(), texts, answers })
    }

    fn flown(
        &self,
        scenario: &Scenario,
        trace: Option<Vec<Sample>>,
    ) -> Result<Flight, FaultsError> {
        let Scenario { counterpart, seed, faults, .. } = scenario;
        let mut desk = self.desk(*counterpart)?;
        scenario.parameters.iter().try_for_each(|setting| set(&mut desk, setting))?;
        let kills = faults.iter().filter(|f| f.kind == FaultKind::Killed).count();
        let spares: Result<Vec<_>, _> = (0..kills).map(|_| self.desk(*counterpart)).collect();
        let disk = faults.iter().any(|f| f.kind == FaultKind::Disk).then(Disk::default);
        if let Some(disk) = &disk {
            let folder = std::path::PathBuf::new();
            desk.record(Recorder::over(folder, disk.clone(), disk.clone(), disk.clone())?);
        }
        let mut random = ChaCha8Rng::seed_from_u64(*seed);
        random.set_stream(STARVED);
        let mut flight = Flight {
            aircraft: Aircraft::new(&self.plant, scenario)?,
            desk,
            down: Wire::new(*seed, 0),
            up: Wire::new(*seed, 1),
            judge: Judge::new(self.model.airframe.envelope),
            scenario: scenario.clone(),
            trace,
            follower: Follower::default(),
            cruise: self.model.airframe.envelope.airspeed_cruise_mps,
            random,
            disk,
            asleep_until: 0,
            unread: Vec::new(),
            flown: Inputs::default(),
            clock_us: 0,
            armed: false,
            killed: false,
            spares: spares?,
            dead_since: None,
            texts: Vec::new(),
            answers: Vec::new(),
        };
        // What a panic leaves behind is only read, to be judged.
        if catch_unwind(AssertUnwindSafe(|| flight.fly())).is_err() {
            flight.judge.note(0.0, Finding::Panic);
        }
        Ok(flight)
    }
}

/// Sets a parameter of the companion of `desk`.
fn set(desk: &mut Desk, Setting { name, times }: &Setting) -> Result<(), FaultsError> {
    let refused = |why: String| FaultsError::Parameter { name: name.clone(), times: *times, why };
    let pilot = desk.pilot();
    let place = pilot.parameters().iter().position(|p| p.name == name);
    let Some(place) = place else {
        return Err(refused(
            "there is no such parameter; docs/reference/parameters.md lists them".into(),
        ));
    };
    let ParameterValue::Real(default) = pilot.parameters()[place].value else {
        return Err(refused("it is no real number and has no multiples".into()));
    };
    match pilot.set_parameter(place, ParameterValue::Real(default * *times as f32)) {
        Verdict::Rejected(why) | Verdict::Denied(why) => Err(refused(why)),
        _ => Ok(()),
    }
}

/// A flight under way.
struct Flight {
    aircraft: Aircraft,
    desk: Desk,
    down: Wire,
    up: Wire,
    judge: Judge,
    scenario: Scenario,
    /// The samples so far, where they are wanted.
    trace: Option<Vec<Sample>>,
    follower: Follower,
    /// Airspeed at which the aircraft cruises, m/s.
    cruise: f64,
    random: ChaCha8Rng,
    disk: Option<Disk>,
    /// The companion gets no processor before this step.
    asleep_until: u64,
    /// What has arrived meanwhile.
    unread: Vec<Vec<u8>>,
    /// The command that the actuators got at the last step.
    flown: Inputs,
    /// What jumps have added to the vehicle's clock, µs.
    clock_us: i64,
    armed: bool,
    /// Whether the companion is killed, and the companions that start after it.
    killed: bool,
    spares: Vec<Desk>,
    /// Since when nothing has come, while steering through a real controller.
    dead_since: Option<f64>,
    texts: Vec<(f64, String)>,
    answers: Vec<(f64, Asking, Verdict)>,
}

impl Flight {
    fn fly(&mut self) {
        for step in 0..STEPS {
            let now_s = step as f64 * 0.01;
            if !self.step(step, now_s) {
                return self.judge.note(now_s, Finding::Crash);
            }
        }
        let end = STEPS as f64 * 0.01;
        let truth = self.aircraft.truth();
        // Who was handed back flies level; who was not flies the client's last leg, or level.
        let pitch = truth.pitch_rad.to_degrees().clamp(-2.0, 6.0);
        self.judge.end(end, &truth, [0.0, pitch]);
        self.hear_of_the_disk(end);
    }

    /// One step of 10 ms; `false` when the aircraft is lost.
    fn step(&mut self, step: u64, now_s: f64) -> bool {
        let acting: Vec<Fault> =
            self.scenario.faults.iter().filter(|f| f.acts(now_s)).copied().collect();
        let distortion = self.distortion(&acting, step);
        let bytes = self.aircraft.show(distortion);
        let rebooting = acting.iter().any(|fault| fault.kind == FaultKind::Reboot);
        if !rebooting && !bytes.is_empty() {
            self.down.send(step, bytes, &acting);
        }
        let arrived = self.down.receive(step);
        self.watch_link(now_s, !arrived.is_empty());
        self.follower.heard(now_s, !arrived.is_empty());
        self.unread.extend(arrived);
        if self.is_alive(&acting) && step >= self.asleep_until {
            self.companion(step, now_s, &acting);
            self.asleep_until = step + self.nap(&acting);
        }
        for batch in self.up.receive(step) {
            self.aircraft.hear(&batch);
        }
        self.take_over(step);
        let flies = self.aircraft.fly();
        let exposure = self.exposure(&acting);
        self.judge.aircraft(now_s, &self.aircraft.truth(), exposure);
        self.sample(now_s, &acting);
        flies
    }

    /// What the companion does when it has the processor.
    fn companion(&mut self, step: u64, now_s: f64, acting: &[Fault]) {
        let host = Duration::from_secs(1) + Duration::from_millis(10 * step);
        let mut up = Vec::new();
        for batch in std::mem::take(&mut self.unread) {
            let (judge, follower) = (&mut self.judge, &mut self.follower);
            self.desk.hear(host, &batch, &mut up, |_, decision| {
                judge.decision(now_s, decision);
                follower.decided(decision);
            });
        }
        self.client(step, now_s, host, acting);
        self.desk.poll(host, &mut up);
        self.hear_texts(now_s);
        if !up.is_empty() {
            self.up.send(step, up, acting);
        }
    }

    fn hear_texts(&mut self, now_s: f64) {
        self.texts.extend(self.desk.texts.drain(..).map(|text| (now_s, text.words)));
    }

    /// A link that is dead hands the aircraft back within half a second.
    fn watch_link(&mut self, now_s: f64, heard: bool) {
        let real = matches!(self.aircraft, Aircraft::Real(_));
        let engaged = match self.desk.vehicle() {
            Vehicle::Real(session) => session.is_engaged(),
            Vehicle::Sitl(_) => false,
        };
        if heard || !real || !engaged || !self.aircraft.is_steered() {
            self.dead_since = None;
            return;
        }
        let since = *self.dead_since.get_or_insert(now_s);
        if now_s - since > HAND_BACK_S {
            self.judge.note(now_s, Finding::SlowHandBack);
        }
    }
}

impl std::fmt::Display for Case {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "--controller {} --counterpart {} --first {} --flights 1",
            self.controller.name(),
            self.counterpart.name(),
            self.seed
        )
    }
}

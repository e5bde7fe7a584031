//! One flight of 60 s under faults, within this process. Simulator and companion advance in lockstep. A finding is a violated
//! requirement.

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

/// Number of steps of a flight: 60 s.
const STEPS: u64 = 6000;
/// Time within which control must be returned to the flight controller after the link has failed, s.
const HAND_BACK_S: f64 = 0.5;

/// Id of the random stream for the times at which an overloaded processor suspends the companion.
const STARVED: u64 = 20;

/// Conditions of a flight.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Seed of all random numbers of the flight.
    pub seed: u64,
    /// The companion's controller.
    pub controller: ControllerKind,
    /// The vehicle's end of the link.
    pub counterpart: Counterpart,
}

/// Result of a flight.
#[derive(Clone, Debug)]
pub struct Report {
    /// Conditions of the flight.
    pub case: Case,
    /// The faults that occurred.
    pub faults: Vec<Fault>,
    /// The violated requirements.
    pub findings: Vec<Found>,
    /// Texts to the ground stations with their times, s.
    pub texts: Vec<(f64, String)>,
}

/// A flight with its samples, texts and replies.
#[derive(Clone, Debug)]
pub struct Witnessed {
    /// Samples at intervals of 10 ms. They end early at a panic or at ground contact.
    pub samples: Vec<Sample>,
    /// The violated requirements.
    pub findings: Vec<Found>,
    /// Texts of the companion to the ground stations with their times, s.
    pub texts: Vec<(f64, String)>,
    /// Times (s) of the client's requests other than setpoints, with the requests and the replies.
    pub answers: Vec<(f64, Asking, Verdict)>,
}

/// Flies cases, each with a copy of one companion, so that its controller is designed only once.
pub struct CompanionFactory {
    companion: Companion,
    fallback: Box<dyn Controller>,
    model: GreyBox,
    plant: PlantOptions,
}

impl CompanionFactory {
    /// A factory of copies of `companion` for the aircraft of `model`. Their fallback controller is an LQI, as in flight.
    ///
    /// # Errors
    ///
    /// If no LQI can be designed from the model.
    pub fn new(companion: Companion, model: &GreyBox) -> Result<Self, FaultsError> {
        let fallback = match companion.controller.name() == ControllerKind::Lqi.name() {
            true => companion.controller.boxed_clone(),
            false => build(ControllerKind::Lqi, model)?,
        };
        let plant = PlantOptions::default();
        Ok(CompanionFactory { companion, fallback, model: model.clone(), plant })
    }

    /// The same factory with the simulator's aircraft and start `plant`.
    pub fn with_aircraft(self, plant: PlantOptions) -> Self {
        CompanionFactory { plant, ..self }
    }

    /// Flight envelope of the aircraft.
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

    /// Flies `case`. A panic of the companion is a finding. A finding on the aircraft is attributed to a cause under two
    /// conditions: the aircraft was exposed to this cause, and the finding vanishes when the flight is repeated without
    /// the faults that produce the cause. The cause is `Cause::Itself` if the finding remains without any faults.
    ///
    /// # Errors
    ///
    /// If the flight cannot be set up; `FaultsError` lists the reasons.
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

    /// Flies `scenario` and returns its samples at intervals of 10 ms and the violated requirements. The samples end early
    /// at a panic or at ground contact.
    ///
    /// # Errors
    ///
    /// If the flight cannot be set up; `FaultsError` lists the reasons.
    pub fn trace(&self, scenario: &Scenario) -> Result<(Vec<Sample>, Vec<Found>), FaultsError> {
        self.witness(scenario).map(|flown| (flown.samples, flown.findings))
    }

    /// Flies `scenario` and returns its samples, findings, texts and replies.
    ///
    /// # Errors
    ///
    /// If the flight cannot be set up; `FaultsError` lists the reasons.
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
        // after a panic only the judge, the samples and the texts of the flight are used
        if catch_unwind(AssertUnwindSafe(|| flight.fly())).is_err() {
            let at_s = flight.judge.now_s();
            flight.judge.note(at_s, Finding::Panic);
        }
        Ok(flight)
    }
}

/// Sets a parameter of the companion in `desk`, which runs a companion without sockets and clocks.
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
        return Err(refused("it is not a real number and has no multiples".into()));
    };
    match pilot.set_parameter(place, ParameterValue::Real(default * *times as f32)) {
        Verdict::Rejected(why) | Verdict::Denied(why) => Err(refused(why)),
        _ => Ok(()),
    }
}

/// State of a running flight.
struct Flight {
    aircraft: Aircraft,
    desk: Desk,
    down: Wire,
    up: Wire,
    judge: Judge,
    scenario: Scenario,
    /// Samples so far; `None` unless requested.
    trace: Option<Vec<Sample>>,
    follower: Follower,
    /// Cruise airspeed of the aircraft, m/s.
    cruise: f64,
    random: ChaCha8Rng,
    disk: Option<Disk>,
    /// Step before which the companion is suspended.
    asleep_until: u64,
    /// Bytes that have arrived since the companion last ran.
    unread: Vec<Vec<u8>>,
    /// The actuators' command at the last step.
    flown: Inputs,
    /// Sum of the jumps of the vehicle's clock, µs.
    clock_us: i64,
    armed: bool,
    /// Whether the companion is killed at present. The `spares` are started in its place later.
    killed: bool,
    spares: Vec<Desk>,
    /// Start of the interval in which nothing has arrived while the companion controls through a flight controller, s.
    /// `None` outside such an interval.
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
        // required at the end are level wings and a pitch of −2° to 6°, as in level flight or in the client's last leg
        let pitch = truth.pitch_rad.to_degrees().clamp(-2.0, 6.0);
        self.judge.end(end, &truth, [0.0, pitch]);
        self.hear_of_the_disk(end);
    }

    /// Advances a step of 10 ms. Returns `false` when the aircraft is lost.
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

    /// Passes the arrived bytes to the companion, then runs the client and the companion's step.
    fn companion(&mut self, step: u64, now_s: f64, acting: &[Fault]) {
        let host = Duration::from_secs(1) + Duration::from_millis(10 * step);
        let mut up = Vec::new();
        for batch in std::mem::take(&mut self.unread) {
            let (judge, follower) = (&mut self.judge, &mut self.follower);
            self.desk.receive(host, &batch, &mut up, |_, decision| {
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

    /// Checks that control is returned to the flight controller within half a second after the link has failed.
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

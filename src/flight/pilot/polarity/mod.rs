//! The polarity check of the surfaces: does the aircraft respond to them with the signs that the model predicts?
//!
//! A flight controller can fly well with its own loops although the channel order, a reversal or a mixer between the
//! companion's commands and the surfaces is wrong. When control authority is given, the companion therefore first
//! commands level trim with small pulses of aileron and elevator, at different times. Measured rates are regressed on
//! the modelled responses to these pulses. The regression gives a gain: the ratio of the measured to the modelled response.
//! Gusts are uncorrelated with the pulses. The check ends when both signs are certain, usually after 0.3 s. It has up to
//! three rounds of pulses. The pulses of each round are larger than those of the round before.

mod answers;
mod evidence;

pub use answers::Answers;
use evidence::{Evidence, Fit};

use greylag_link::vehicle::{Axis, Fault};
use greylag_physics::{Command, State, Time};

/// Pulse amplitude of each round as a fraction of full deflection. For the X8, 0.06 is 1.9° and causes a roll rate of
/// 9 °/s.
const PULSES: [f64; 3] = [0.06, 0.1, 0.15];
/// Signs of a round's pulses, each [`LENGTH`] state frames long. Their effects on the attitude cancel.
const PATTERN: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
/// Length of a pulse in state frames of 10 ms.
const LENGTH: usize = 12;
/// Delay of the elevator's pulses relative to the aileron's, state frames.
const OFFSET: usize = 6;
/// Length of a round in state frames.
const ROUND: usize = PATTERN.len() * LENGTH + 2 * OFFSET;
/// Number of state frames after which a check ends.
const LONGEST: usize = PULSES.len() * ROUND;
/// Ratio of the gain to its standard error above which a sign is certain. It is tested at every state frame.
const CERTAIN: f64 = 7.0;
/// Numbers of state frames after which the signs of aileron and elevator are evaluated. By then the surface has moved both
/// ways and the aircraft has responded. The response to a single movement could be mistaken for a gust.
const SEEN: [usize; 2] = [LENGTH + ANSWERED, OFFSET + LENGTH + ANSWERED];
/// Number of state frames within which the response to a movement of the surface appears.
const ANSWERED: usize = 7;
/// Smallest gain that counts as a response. A model may be wrong, but not by a factor of ten.
const ANSWER: f64 = 0.1;
/// Change of bank or pitch that aborts the check, rad: 20°.
const DEPARTED: f64 = 20.0 * std::f64::consts::PI / 180.0;

/// Result of the check after a state frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// The check is not finished.
    Open,
    /// Both signs are right. The values are the gains of roll and pitch.
    Right([f64; 2]),
    /// Control must be returned to the flight controller.
    Wrong(Fault),
}

/// Time, attitude and command at the first state of a check.
#[derive(Clone, Copy, Debug)]
struct Begun {
    at: Time,
    /// Roll and pitch, rad.
    attitude: [f64; 2],
    /// Command to which pulses are added.
    level: Command,
}

/// Phase of a check.
#[derive(Clone, Debug)]
enum Stage {
    /// No check is active: control authority is not demanded, or the check has ended.
    Rest,
    /// Control authority is demanded and not yet given.
    Waiting,
    /// Control authority was given. `begun` is `None` until the first state after that.
    Running { begun: Option<Begun>, evidence: Evidence, last: Command },
}

/// The check of one aircraft, repeated at every engagement.
#[derive(Clone, Debug)]
pub(super) struct Check {
    answers: Answers,
    stage: Stage,
}

impl Check {
    /// A check against the modelled responses `answers`.
    pub(super) fn new(answers: Answers) -> Self {
        Check { answers, stage: Stage::Rest }
    }

    /// Starts to wait for the requested control authority.
    pub(super) fn await_authority(&mut self) {
        self.stage = Stage::Waiting;
    }

    /// Ends the check: control authority is no longer demanded.
    pub(super) fn rest(&mut self) {
        self.stage = Stage::Rest;
    }

    /// Starts the check when control authority is given. `in_force` is the last command to the surfaces.
    pub(super) fn begin(&mut self, in_force: Command) {
        if matches!(self.stage, Stage::Waiting) {
            let evidence = Evidence::default();
            self.stage = Stage::Running { begun: None, evidence, last: in_force };
        }
    }

    /// Whether the check is waiting or running: controllers must not fly yet.
    pub(super) fn is_open(&self) -> bool {
        !matches!(self.stage, Stage::Rest)
    }

    /// Evaluates the state at vehicle time `now`. `level` is the level-trim command.
    pub(super) fn see(&mut self, now: Time, state: &State, level: Command) -> Verdict {
        let Stage::Running { begun, evidence, .. } = &mut self.stage else { return Verdict::Open };
        let attitude = [state.roll, state.pitch];
        let begun = begun.get_or_insert(Begun { at: now, attitude, level });
        let index = begun.index(now);
        evidence.rates(index, [state.p, state.q]);
        let verdict = match evidence.fit(&self.answers) {
            Some(fits) => judged(&fits, index),
            // too many states were lost, or the clock has jumped ahead
            None if index >= LONGEST => Verdict::Wrong(Fault::SignsUnknown),
            None => Verdict::Open,
        };
        let departed = (0..2).any(|i| (attitude[i] - begun.attitude[i]).abs() > DEPARTED);
        let verdict = match verdict {
            Verdict::Open if departed => Verdict::Wrong(Fault::SignsUnknown),
            verdict => verdict,
        };
        if verdict != Verdict::Open {
            self.stage = Stage::Rest;
        }
        verdict
    }

    /// The command in reply to the state of vehicle time `now`: level trim with pulses. `None` before the first state
    /// and while no check is running.
    pub(super) fn command(&self, now: Time) -> Option<Command> {
        let Stage::Running { begun: Some(begun), .. } = &self.stage else { return None };
        let index = begun.index(now) as isize;
        Some(Command {
            aileron: begun.level.aileron + pulse(index),
            elevator: begun.level.elevator + pulse(index - OFFSET as isize),
            ..begun.level
        })
    }

    /// Records the command that was sent in reply to the state of vehicle time `now`.
    pub(super) fn commanded(&mut self, now: Time, command: Command) {
        let Stage::Running { begun: Some(begun), evidence, last } = &mut self.stage else { return };
        let index = begun.index(now);
        evidence.change(0, index, command.aileron - last.aileron);
        evidence.change(1, index, command.elevator - last.elevator);
        *last = command;
    }
}

impl Begun {
    /// Number of state frames of 10 ms since the start.
    fn index(&self, now: Time) -> usize {
        ((now.since(self.at).as_micros() as usize) + 5000) / 10_000
    }
}

/// The pulse at state frame `index`, counted from the start of the surface's pulses, as a fraction of full deflection.
fn pulse(index: isize) -> f64 {
    let Ok(index) = usize::try_from(index) else { return 0.0 };
    let (round, within) = (index / ROUND, index % ROUND);
    match (PULSES.get(round), PATTERN.get(within / LENGTH)) {
        (Some(size), Some(sign)) => size * sign,
        _ => 0.0,
    }
}

/// The verdict that follows from the estimated gains after state frame `index`.
fn judged(fits: &[Fit; 2], index: usize) -> Verdict {
    let certain = |axis: usize| {
        let fit = &fits[axis];
        index >= SEEN[axis] && fit.certainty().abs() > CERTAIN && fit.gain.abs() > ANSWER
    };
    for (axis, name) in [Axis::Roll, Axis::Pitch].into_iter().enumerate() {
        if certain(axis) && fits[axis].gain < 0.0 {
            return Verdict::Wrong(Fault::Reversed(name));
        }
    }
    if (0..2).all(certain) {
        return Verdict::Right(fits.map(|fit| fit.gain));
    }
    if index < LONGEST {
        return Verdict::Open;
    }
    // the signs are not certain after all rounds: the response is too small, or there is too much turbulence
    let dead = |fit: &Fit| fit.gain + 3.0 * fit.error < 0.5;
    match (dead(&fits[0]), dead(&fits[1])) {
        (true, _) => Verdict::Wrong(Fault::Unanswered(Axis::Roll)),
        (false, true) => Verdict::Wrong(Fault::Unanswered(Axis::Pitch)),
        (false, false) => Verdict::Wrong(Fault::SignsUnknown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_model::{GreyBox, Trim, Twin};
    use std::collections::VecDeque;
    use std::path::Path;

    /// Verdict of the check on a simulated flight of the model, and the number of state frames until the verdict.
    /// Commands are delayed by `late` frames. `wired` maps commanded to actual aileron and elevator.
    fn verdict(late: usize, wired: impl Fn([f64; 2]) -> [f64; 2]) -> (Verdict, u64) {
        verdict_after(2, late, wired)
    }

    /// Like `verdict`, but control authority was given `early` states before its notice arrives.
    fn verdict_after(
        early: usize,
        late: usize,
        wired: impl Fn([f64; 2]) -> [f64; 2],
    ) -> (Verdict, u64) {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        let full = model.airframe.actuators.elevator.travel.most;
        let trim = Trim::level(&model, 20.0, 600.0).unwrap();
        let (elevator, throttle) = (trim.controls.elevator / full, trim.controls.throttle);
        let level = Command { elevator, throttle, ..Command::IDLE };
        let mut check = Check::new(Answers::of(&model, 22.0).unwrap());
        let mut twin = Twin::at_rest(trim.state, &trim.controls, 600.0);
        let mut wire = VecDeque::from(vec![level; late]);
        check.await_authority();
        assert_eq!(check.command(Time::default()), None);
        check.begin(level);
        for _ in 0..early {
            let [aileron, elevator] = wired([level.aileron, level.elevator]);
            twin.step(&model, &Command { aileron, elevator, throttle, rudder: 0.0 });
        }
        for k in 0..1000 {
            let now = Time::from_micros(5_000_000 + 10_000 * k);
            match check.see(now, &twin.state, level) {
                Verdict::Open => {}
                verdict => return (verdict, k),
            }
            let command = check.command(now).unwrap();
            check.commanded(now, command);
            wire.push_back(command);
            let command = wire.pop_front().unwrap();
            let [aileron, elevator] = wired([command.aileron, command.elevator]);
            twin.step(&model, &Command { aileron, elevator, throttle, rudder: 0.0 });
        }
        panic!("it does not end")
    }

    #[test]
    fn right_signs_pass_however_late_the_commands_arrive() {
        // Up to 60 ms: twice the delay of a serial link to a flight controller that samples its channels at 50 Hz.
        for late in 0..=6 {
            let (verdict, states) = verdict(late, |surfaces| surfaces);
            let Verdict::Right(gains) = verdict else { panic!("{late}: {verdict:?}") };
            // The modelled responses are for 22 m/s and the aircraft flies at 20 m/s, where the same deflection has 0.8
            // times the force.
            assert!(gains.iter().all(|gain| (0.5..1.2).contains(gain)), "{late}: {gains:?}");
            assert!(states < ROUND as u64, "{late}: after {states}");
        }
    }

    #[test]
    fn wrong_signs_are_named() {
        for late in [0, 3, 6] {
            let roll = verdict(late, |[aileron, elevator]| [-aileron, elevator]).0;
            assert_eq!(roll, Verdict::Wrong(Fault::Reversed(Axis::Roll)), "{late}");
            // The trim deflection of a reversed elevator pitches the nose up before the first pulse.
            for early in 0..=4 {
                let (pitch, _) =
                    verdict_after(early, late, |[aileron, elevator]| [aileron, -elevator]);
                let named = pitch == Verdict::Wrong(Fault::Reversed(Axis::Pitch));
                assert!(named, "{late}, {early}: {pitch:?}");
            }
        }
    }

    #[test]
    fn surfaces_that_do_nothing_or_something_else_are_refused() {
        let trim = 0.131;
        let (dead, _) = verdict(2, |[_, elevator]| [0.0, elevator]);
        assert_eq!(dead, Verdict::Wrong(Fault::Unanswered(Axis::Roll)));
        let (dead, _) = verdict(2, |[aileron, _]| [aileron, trim]);
        assert_eq!(dead, Verdict::Wrong(Fault::Unanswered(Axis::Pitch)));
        // The left elevon is reversed: an aileron command pitches and an elevator command rolls.
        let (mixed, _) = verdict(2, |[aileron, elevator]| [elevator - trim, aileron + trim]);
        assert!(matches!(mixed, Verdict::Wrong(_)), "{mixed:?}");
    }

    /// A clock jump, at the first states or later, ends the check. Otherwise the check would not end, or would allocate
    /// memory for the skipped states.
    #[test]
    fn a_clock_that_jumps_ahead_ends_the_check() {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        for before in [1, 30] {
            let mut check = Check::new(Answers::of(&model, 22.0).unwrap());
            check.await_authority();
            check.begin(Command::IDLE);
            for k in 0..before {
                let now = Time::from_micros(10_000 * k);
                assert_eq!(check.see(now, &State::NEUTRAL, Command::IDLE), Verdict::Open);
                check.commanded(now, check.command(now).unwrap());
            }
            let later = Time::from_micros(u64::MAX / 2);
            let verdict = check.see(later, &State::NEUTRAL, Command::IDLE);
            assert!(matches!(verdict, Verdict::Wrong(_)), "{before}: {verdict:?}");
            assert!(!check.is_open());
        }
    }

    #[test]
    fn only_an_attitude_that_departs_from_the_first_ends_the_check() {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        for (roll_deg, pitch_deg, open) in
            [(35.0, 15.0, true), (14.0, 15.0, false), (56.0, 15.0, false), (35.0, -6.0, false)]
        {
            let mut check = Check::new(Answers::of(&model, 22.0).unwrap());
            check.await_authority();
            check.begin(Command::IDLE);
            let mut see = |k: u64, roll: f64, pitch: f64| {
                let (roll, pitch) = (roll.to_radians(), pitch.to_radians());
                let state = State { roll, pitch, ..State::NEUTRAL };
                check.see(Time::from_micros(10_000 * k), &state, Command::IDLE)
            };
            // The check starts in a turn. Only a change of attitude by more than 20° ends it.
            assert_eq!(see(0, 35.0, 15.0), Verdict::Open);
            assert_eq!(see(1, roll_deg, pitch_deg) == Verdict::Open, open, "{roll_deg}");
        }
    }

    #[test]
    fn pulses_begin_to_the_right_and_down_one_after_the_other_and_sum_to_nothing() {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        let level = Command { elevator: 0.1, throttle: 0.2, ..Command::IDLE };
        let mut check = Check::new(Answers::of(&model, 22.0).unwrap());
        check.await_authority();
        check.begin(level);
        check.see(Time::default(), &State::NEUTRAL, level);
        let pulses: Vec<[f64; 2]> = (0..60)
            .map(|k| {
                let command = check.command(Time::from_micros(10_000 * k)).unwrap();
                assert_eq!((command.throttle, command.rudder), (0.2, 0.0));
                [command.aileron, command.elevator - 0.1]
            })
            .collect();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{pulses:?}");
        near(pulses[0][0], 0.06);
        near(pulses[5][1], 0.0);
        near(pulses[6][1], 0.06);
        for axis in [0, 1] {
            near(pulses.iter().map(|pulse| pulse[axis]).sum(), 0.0);
            assert!(pulses.iter().filter(|pulse| pulse[axis] < 0.0).count() == 24);
        }
    }
}

//! The gentle check of signs, right after engaging: does the aircraft answer as it should?
//!
//! The first command is held for a third of a second with a small pulse of both surfaces on it, one way
//! and then the other. The roll rate must follow the aileron, the pitch rate oppose the elevator.
//! A wire, a reversal or a mixer that is wrong is found while the surfaces have moved by a few
//! degrees, before a control loop drives them to their stops.

use crate::physics::Command;

/// Each pulse, normalised deflection: 1.9° for the X8, which rolls it at about 10 °/s.
const PULSE: f64 = 0.06;
/// States that each pulse lasts.
const LENGTH: u32 = 15;
/// States after which a pulse shows in the rates, and for how many more they are taken.
const DELAY: u32 = 8;
const WINDOW: u32 = 9;
/// Difference of the rates between the two pulses that is an answer, rad/s: 1.7 °/s, six times the
/// noise of a gyroscope's mean over the window.
const ANSWER: f64 = 0.03;

/// What came of a state.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Verdict {
    /// To be sent now; more is to come.
    Running(Command),
    /// Both surfaces do what they should.
    Right,
    /// One does not.
    Wrong(&'static str),
}

/// A check under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Probe {
    base: Option<Command>,
    states: u32,
    /// Sums of p and q after the first and after the second pulse.
    sums: [[f64; 2]; 2],
}

impl Probe {
    /// Takes the rates (rad/s) of the next state; `demanded` is what the pilot wants.
    pub(super) fn step(&mut self, demanded: &Command, [p, q, _]: [f64; 3]) -> Verdict {
        let base = *self.base.get_or_insert(*demanded);
        let now = self.states;
        for (pulse, sums) in self.sums.iter_mut().enumerate() {
            let begins = pulse as u32 * LENGTH + DELAY;
            if (begins..begins + WINDOW).contains(&now) {
                sums[0] += p / f64::from(WINDOW);
                sums[1] += q / f64::from(WINDOW);
            }
        }
        self.states += 1;
        if now >= LENGTH + DELAY + WINDOW {
            return self.verdict();
        }
        let pulse = if now < LENGTH { PULSE } else { -PULSE };
        let (aileron, elevator) = (base.aileron + pulse, base.elevator + pulse);
        Verdict::Running(Command { aileron, elevator, throttle: base.throttle }.clamped())
    }

    fn verdict(&self) -> Verdict {
        let [first, second] = self.sums;
        let roll = first[0] - second[0];
        // A positive elevator pitches down.
        let pitch = second[1] - first[1];
        if roll < -ANSWER {
            Verdict::Wrong(
                "it rolls left when the aileron goes right: check RC1_REVERSED, the servo's direction, the mixer",
            )
        } else if pitch < -ANSWER {
            Verdict::Wrong(
                "it pitches up when the elevator goes down: check RC2_REVERSED, the servo's direction, the mixer",
            )
        } else if roll < ANSWER || !roll.is_finite() {
            Verdict::Wrong(
                "it does not answer to the aileron: check the servo, its wire, the mixer",
            )
        } else if pitch < ANSWER || !pitch.is_finite() {
            Verdict::Wrong(
                "it does not answer to the elevator: check the servo, its wire, the mixer",
            )
        } else {
            Verdict::Right
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An aircraft whose rates follow the surfaces within 0.1 s by a gain.
    fn probed(roll_gain: f64, pitch_gain: f64) -> Verdict {
        let mut probe = Probe::default();
        let (mut p, mut q) = (0.0, 0.0);
        for _ in 0..100 {
            match probe.step(&Command { aileron: 0.1, elevator: 0.2, throttle: 0.3 }, [p, q, 0.0]) {
                Verdict::Running(c) => {
                    assert!((c.aileron - 0.1).abs() < 0.061 && c.throttle == 0.3);
                    p += 0.1 * (roll_gain * (c.aileron - 0.1) - p);
                    q += 0.1 * (pitch_gain * (c.elevator - 0.2) - q);
                }
                verdict => return verdict,
            }
        }
        panic!("it does not end")
    }

    #[test]
    fn signs_are_told_apart_and_a_dead_surface_is_found() {
        assert_eq!(probed(3.0, -3.0), Verdict::Right);
        let wrong = |verdict: Verdict, words: &str| match verdict {
            Verdict::Wrong(said) => assert!(said.contains(words), "{said}"),
            other => panic!("{other:?}"),
        };
        wrong(probed(-3.0, -3.0), "rolls left");
        wrong(probed(3.0, 3.0), "pitches up");
        wrong(probed(0.0, -3.0), "does not answer to the aileron");
        wrong(probed(3.0, 0.0), "does not answer to the elevator");
    }
}

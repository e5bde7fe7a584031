//! Data of the polarity check, which finds out whether aileron and elevator act in the direction that the model predicts. The
//! measured roll and pitch rates are regressed on the modelled responses to the recorded commands.

use std::ops::RangeInclusive;

use nalgebra::{Matrix3, Vector3};

use super::LONGEST;
use super::answers::Answers;

/// Largest delay of link and flight controller that is tried, in state frames (messages with the state) of 10 ms. It adds to
/// the delay within the modelled response.
const LATENESS: isize = 9;
/// Smallest number of rate changes for a regression.
const LEAST: usize = 14;
/// Upper limit of the lag-one autocorrelation of the regression residuals.
const MAX_AUTOCORRELATION: f64 = 0.9;
/// Times that are tried for the handover of control to the companion, in state frames before the first state of the check.
/// The exact time is unknown: the notice of the handover shares the link with the states, and the flight controller samples
/// the commands at its own times.
const TAKEN: RangeInclusive<isize> = -1..=2;

/// Estimated ratio of the measured to the modelled response of one axis, with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    /// Gain: 1 is the modelled response, −1 the opposite response.
    pub gain: f64,
    /// Standard error of the gain estimate.
    pub error: f64,
    /// Mean square of the regression residual, (rad/s)².
    misfit: f64,
}

impl Fit {
    /// The gain divided by its standard error.
    pub(super) fn certainty(&self) -> f64 {
        self.gain / self.error
    }
}

/// Record of a polarity check, one entry per state frame of 10 ms from the start of the check.
#[derive(Clone, Debug, Default)]
pub(super) struct Evidence {
    /// Roll and pitch rate, rad/s; `None` for a lost state.
    rates: Vec<Option<[f64; 2]>>,
    /// Changes of the aileron and elevator commands: index of the state frame and size of each change.
    changes: [Vec<(isize, f64)>; 2],
}

impl Evidence {
    /// Stores the rates of state frame `index`, rad/s. Frames that are already stored or after the longest check are ignored.
    pub(super) fn rates(&mut self, index: usize, rates: [f64; 2]) {
        if (self.rates.len()..=LONGEST).contains(&index) {
            self.rates.resize(index + 1, None);
            self.rates[index] = Some(rates);
        }
    }

    /// Stores the change `by` of the command of `axis` that was sent in reply to state frame `index`.
    pub(super) fn change(&mut self, axis: usize, index: usize, by: f64) {
        if by != 0.0 {
            self.changes[axis].push((index as isize, by));
        }
    }

    /// The estimates for roll and pitch. Both axes have the same delay and handover time, which are chosen for the best fit.
    /// `None` if the record is too short or does not determine the gains.
    pub(super) fn fit(&self, answers: &Answers) -> Option<[Fit; 2]> {
        let both = (0..=LATENESS).flat_map(|late| {
            let answered = [0, 1].map(|axis| self.answered(answers, axis, late));
            TAKEN.filter_map(move |taken| {
                let [roll, pitch] = &answered;
                Some([self.axis(answers, 0, roll, taken)?, self.axis(answers, 1, pitch, taken)?])
            })
        });
        let misfit =
            |fits: &[Fit; 2]| fits[0].misfit.max(1e-12).ln() + fits[1].misfit.max(1e-12).ln();
        both.min_by(|a, b| misfit(a).total_cmp(&misfit(b)))
    }

    /// Modelled change of the rate of `axis` from each state frame to the next, rad/s, if the commands are delayed by `late`
    /// frames.
    fn answered(&self, answers: &Answers, axis: usize, late: isize) -> Vec<f64> {
        let at = |state: isize| -> f64 {
            let terms = self.changes[axis].iter();
            terms.map(|(at, by)| by * answers.after(axis, state - at - late)).sum()
        };
        let states: Vec<f64> = (0..self.rates.len() as isize).map(at).collect();
        states.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    /// Estimates the gain of one axis by least squares. The measured changes of the rate from frame to frame are regressed on
    /// three regressors: the modelled response to the commands, the modelled response to a step of unknown size at the
    /// handover, and a constant. The handover is `taken` frames before the first. Changes are used because the effect of gusts
    /// on the rates resembles a random walk, whose changes are nearly white. The standard error is corrected for the remaining
    /// autocorrelation.
    fn axis(&self, answers: &Answers, axis: usize, answered: &[f64], taken: isize) -> Option<Fit> {
        let to_step = |state: isize| answers.after(axis, state + taken);
        let rows = || {
            let states = self.rates.windows(2).zip(answered).enumerate();
            states.filter_map(|(state, (pair, answered))| {
                let [Some(before), Some(after)] = pair else { return None };
                let now = state as isize + 1;
                let row = Vector3::new(*answered, to_step(now) - to_step(now - 1), 1.0);
                Some((row, after[axis] - before[axis]))
            })
        };
        let (mut normal, mut right, mut count) = (Matrix3::zeros(), Vector3::zeros(), 0);
        for (x, y) in rows() {
            normal += x * x.transpose();
            right += x * y;
            count += 1;
        }
        if count < LEAST {
            return None;
        }
        let inverse = normal.try_inverse().filter(|inverse| inverse[(0, 0)] > 0.0)?;
        let solution = inverse * right;
        let (mut square, mut product, mut last) = (1e-12, 0.0, 0.0);
        for (x, y) in rows() {
            let left = y - solution.dot(&x);
            square += left * left;
            product += left * last;
            last = left;
        }
        let misfit = square / (count - 3) as f64;
        let autocorrelation = (product / square).clamp(0.0, MAX_AUTOCORRELATION);
        let error =
            (misfit * inverse[(0, 0)] * (1.0 + autocorrelation) / (1.0 - autocorrelation)).sqrt();
        let fit = Fit { gain: solution[0], error, misfit };
        (fit.gain.is_finite() && error.is_finite() && error > 0.0).then_some(fit)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LONGEST, SEEN, Verdict, judged};
    use super::*;
    use greylag_link::vehicle::{Axis, Fault};
    use greylag_model::GreyBox;
    use std::path::Path;

    /// A gain estimate with a given ratio to its standard error.
    fn fit(gain: f64, certainty: f64) -> Fit {
        Fit { gain, error: gain.abs() / certainty, misfit: 0.0 }
    }

    #[test]
    fn a_sign_is_judged_when_it_is_certain_large_enough_and_answered_both_ways() {
        let right = fit(0.9, 8.0);
        let reversed = |axis| Verdict::Wrong(Fault::Reversed(axis));
        for (roll, pitch, index, verdict) in [
            (right, right, SEEN[1], Verdict::Right([0.9; 2])),
            (right, right, SEEN[1] - 1, Verdict::Open),
            (fit(-0.9, 8.0), right, SEEN[0], reversed(Axis::Roll)),
            (fit(-0.9, 8.0), right, SEEN[0] - 1, Verdict::Open),
            (right, fit(-0.9, 8.0), SEEN[1], reversed(Axis::Pitch)),
            // First a gain that is large but not certain, then two gains that are certain but too small for a response.
            (fit(-0.9, 6.9), right, SEEN[1], Verdict::Open),
            (fit(-0.09, 50.0), right, SEEN[1], Verdict::Open),
            (right, fit(0.09, 50.0), LONGEST - 1, Verdict::Open),
        ] {
            assert_eq!(judged(&[roll, pitch], index), verdict, "{roll:?} {pitch:?} {index}");
        }
    }

    #[test]
    fn what_is_not_certain_in_the_end_is_no_answer_or_too_much_air() {
        let right = fit(0.9, 8.0);
        // A surface does not respond if gain + 3 errors is below 0.5: 0.2 + 3 · 0.09 is below, 0.6 + 3 · 0.3 is not.
        for (roll, pitch, fault) in [
            (fit(0.2, 2.2), right, Fault::Unanswered(Axis::Roll)),
            (right, fit(0.2, 2.2), Fault::Unanswered(Axis::Pitch)),
            (right, fit(0.6, 2.0), Fault::SignsUnknown),
            (fit(0.6, 2.0), right, Fault::SignsUnknown),
        ] {
            assert_eq!(
                judged(&[roll, pitch], LONGEST),
                Verdict::Wrong(fault),
                "{roll:?} {pitch:?}"
            );
        }
    }

    /// The record of an aircraft that responds as the model does. Both rates also contain a disturbance. At state frame k it
    /// changes by `leftover(k)`, rad/s.
    fn record(answers: &Answers, states: usize, leftover: impl Fn(usize) -> f64) -> Evidence {
        let mut evidence = Evidence::default();
        let changes = [[(0, 0.06), (12, -0.12)], [(6, 0.06), (18, -0.12)]];
        for (axis, changes) in changes.iter().enumerate() {
            changes.iter().for_each(|(index, by)| evidence.change(axis, *index, *by));
        }
        let mut left = 0.0;
        for index in 0..states {
            left += leftover(index);
            let rate = |axis: usize| -> f64 {
                let after = |at: usize| answers.after(axis, index as isize - at as isize);
                changes[axis].iter().map(|(at, by)| by * after(*at)).sum()
            };
            evidence.rates(index, [rate(0) + left, rate(1) + left]);
        }
        evidence
    }

    fn x8() -> Answers {
        let model = GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap();
        Answers::of(&model, 20.0).unwrap()
    }

    #[test]
    fn fourteen_changes_of_the_rates_say_something_and_thirteen_nothing() {
        let answers = x8();
        let fit = |states| record(&answers, states, |_| 0.0).fit(&answers);
        assert!(fit(14).is_none());
        assert!((fit(15).unwrap()[0].gain - 1.0).abs() < 1e-3);
    }

    #[test]
    fn gusts_that_wander_leave_more_doubt_than_as_large_ones_that_do_not() {
        // The rates change by ±0.01 rad/s per state frame. The sign alternates every nine frames, or every frame.
        let answers = x8();
        let doubt = |states: usize| {
            let gust = |index: usize| if (index / states).is_multiple_of(2) { 0.01 } else { -0.01 };
            record(&answers, 60, gust).fit(&answers).unwrap().map(|fit| fit.error)
        };
        let (wandering, white) = (doubt(9), doubt(1));
        for (wandering, white) in wandering.into_iter().zip(white) {
            assert!(wandering > 1.8 * white, "{wandering} {white}");
        }
    }
}

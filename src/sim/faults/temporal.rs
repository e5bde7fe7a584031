//! Signal temporal logic: computes how robustly a flight, given by samples, meets a formula.
//!
//! A formula is a statement on the flight. It has a robustness at each sample (Donzé and Maler, Robust Satisfaction of Temporal
//! Logic over Real-Valued Signals, FORMATS 2010). The robustness is positive where the formula holds and negative where it is
//! violated. Its magnitude is the margin. Two conventions hold at the ends of a flight. Where the window of `Eventually` extends
//! past the end, the formula holds. In the window of `Once`, the time before the first sample counts as violated.

use std::collections::VecDeque;

use greylag_flight::pilot::TICK_S;

/// A formula over samples `S`, of which there is one every 10 ms.
pub enum Formula<S> {
    /// A statement on one sample. The function returns its robustness: positive if the statement holds. It is limited to −1..1,
    /// and NaN counts as −1.
    Atom(Box<dyn Fn(&S) -> f64 + Send + Sync>),
    /// Negation: the formula does not hold.
    Not(Box<Formula<S>>),
    /// Conjunction: all formulas hold.
    All(Vec<Formula<S>>),
    /// Disjunction: at least one formula holds.
    Any(Vec<Formula<S>>),
    /// Eventually: the formula holds at some sample within this time from now, s.
    Eventually(f64, Box<Formula<S>>),
    /// Once: the formula has held at some sample within this past time, s.
    Once(f64, Box<Formula<S>>),
    /// Rise: the formula holds now and did not hold at the previous sample. At the first sample there is no rise.
    Rises(Box<Formula<S>>),
}

impl<S> Formula<S> {
    /// A statement on one sample with the robustness `distance`, which is limited to −1..1.
    pub fn atom(distance: impl Fn(&S) -> f64 + Send + Sync + 'static) -> Self {
        Formula::Atom(Box::new(distance))
    }

    /// A statement on one sample with robustness 1 if it is true and −1 if it is false.
    pub fn is(statement: impl Fn(&S) -> bool + Send + Sync + 'static) -> Self {
        Formula::atom(move |sample| if statement(sample) { 1.0 } else { -1.0 })
    }

    /// Implication: where `self` holds, `then` holds too.
    pub fn implies(self, then: Self) -> Self {
        Formula::Any(vec![Formula::Not(Box::new(self)), then])
    }

    /// Disjunction of `self` and `other`.
    pub fn or(self, other: Self) -> Self {
        Formula::Any(vec![self, other])
    }

    /// Conjunction of `self` and `other`.
    pub fn and(self, other: Self) -> Self {
        Formula::All(vec![self, other])
    }

    /// Eventually: `self` holds at some sample within the next `seconds`.
    pub fn eventually(self, seconds: f64) -> Self {
        Formula::Eventually(seconds, Box::new(self))
    }

    /// Once: `self` has held at some sample within the last `seconds`.
    pub fn once(self, seconds: f64) -> Self {
        Formula::Once(seconds, Box::new(self))
    }

    /// Rise: `self` holds now and did not hold at the previous sample.
    pub fn rises(self) -> Self {
        Formula::Rises(Box::new(self))
    }

    /// The robustness at each sample.
    pub fn distances(&self, samples: &[S]) -> Vec<f64> {
        match self {
            Formula::Atom(distance) => samples
                .iter()
                .map(|sample| Some(distance(sample)).filter(|d| !d.is_nan()))
                .map(|d| d.map_or(-1.0, |d| d.clamp(-1.0, 1.0)))
                .collect(),
            Formula::Not(of) => of.distances(samples).into_iter().map(|d| -d).collect(),
            Formula::All(of) => together(of, samples, 1.0, f64::min),
            Formula::Any(of) => together(of, samples, -1.0, f64::max),
            Formula::Eventually(seconds, of) => {
                let mut ahead = of.distances(samples);
                ahead.reverse();
                let mut best = largest_of_the_last(&ahead, count(*seconds), 1.0);
                best.reverse();
                best
            }
            Formula::Once(seconds, of) => {
                largest_of_the_last(&of.distances(samples), count(*seconds), -1.0)
            }
            Formula::Rises(of) => {
                let now = of.distances(samples);
                let before = std::iter::once(1.0).chain(now.iter().copied());
                now.iter().zip(before).map(|(now, before)| now.min(-before)).collect()
            }
        }
    }

    /// The index of the sample with the smallest robustness, and this robustness. `None` without samples.
    pub fn least(&self, samples: &[S]) -> Option<(usize, f64)> {
        self.distances(samples).into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

fn count(seconds: f64) -> usize {
    (seconds / TICK_S).round() as usize
}

fn together<S>(
    of: &[Formula<S>],
    samples: &[S],
    neutral: f64,
    join: fn(f64, f64) -> f64,
) -> Vec<f64> {
    let mut sum = vec![neutral; samples.len()];
    for formula in of {
        sum.iter_mut().zip(formula.distances(samples)).for_each(|(x, d)| *x = join(*x, d));
    }
    sum
}

/// Moving maximum over each value and the `before` values that precede it. The values before the first one count as `beyond`.
fn largest_of_the_last(values: &[f64], before: usize, beyond: f64) -> Vec<f64> {
    // indices of values that decrease; the first is that of the maximum in the window
    let mut falling = VecDeque::<usize>::new();
    let mut largest = Vec::with_capacity(values.len());
    for (place, value) in values.iter().enumerate() {
        while falling.back().is_some_and(|last| values[*last] <= *value) {
            falling.pop_back();
        }
        falling.push_back(place);
        while falling.front().is_some_and(|first| first + before < place) {
            falling.pop_front();
        }
        let here = falling.front().map_or(*value, |first| values[*first]);
        largest.push(if place < before { here.max(beyond) } else { here });
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value() -> Formula<f64> {
        Formula::atom(|x: &f64| *x)
    }

    #[test]
    fn windows_look_ahead_and_back() {
        let flight = [0.1, -0.5, 0.3, -0.2, -0.4];
        // the windows reach two samples ahead and back; a window past the end of the flight counts as 1
        assert_eq!(value().eventually(0.02).distances(&flight), [0.3, 0.3, 0.3, 1.0, 1.0]);
        assert_eq!(value().once(0.02).distances(&flight), [0.1, 0.1, 0.3, 0.3, 0.3]);
        assert_eq!(value().once(0.0).distances(&flight), flight);
        assert_eq!(value().least(&flight), Some((1, -0.5)));
    }

    #[test]
    fn an_event_is_answered_in_time_or_not() {
        // 1 stands for a request, 2 for a reply
        let answered = Formula::is(|x: &f64| *x == 1.0)
            .rises()
            .implies(Formula::is(|x: &f64| *x == 2.0).eventually(0.02));
        let held = |flight: &[f64]| answered.least(flight).unwrap().1;
        assert_eq!(held(&[0.0, 1.0, 1.0, 2.0, 0.0]), 1.0);
        assert_eq!(held(&[0.0, 1.0, 1.0, 1.0, 2.0]), -1.0);
        assert_eq!(held(&[0.0, 0.0, 0.0]), 1.0);
    }

    #[test]
    fn what_is_no_number_does_not_hold() {
        assert_eq!(value().distances(&[f64::NAN, 7.0]), [-1.0, 1.0]);
        assert_eq!(Formula::Not(Box::new(value())).distances(&[0.25]), [-0.25]);
        assert_eq!(value().and(Formula::is(|_| true)).distances(&[0.5]), [0.5]);
    }
}

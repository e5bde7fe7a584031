//! Changes of single settings of the planner, given as `KEY=VALUE` on a command line.
//!
//! The planner is a sampling MPC. In each tick (10 ms) it draws candidates, which are sequences of commands, and simulates them
//! with the model. It then fits the distribution of the next candidates to the best ones, the elites.

use std::fmt;
use std::str::FromStr;

use super::Aids;
use super::rollout::{HORIZON, WIDTH};
use super::settings::{Instructions, Settings, Start, Update, Value};

/// A value that replaces the default of one planner setting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Replaces [`Settings::population`], the number of candidates per iteration.
    Population(usize),
    /// Replaces the number of elites, see [`Update::Elites`].
    Elites(usize),
    /// Replaces the temperature λ of MPPI, see [`Update::Weighted`].
    Temperature(f64),
    /// Replaces [`Settings::iterations`], the number of iterations per tick.
    Iterations(usize),
    /// Replaces [`Settings::start`], the mean of the first iteration's distribution.
    Start(Start),
    /// Replaces [`Settings::spread`], the standard deviation of the first iteration's distribution.
    Spread(f64),
    /// Replaces [`Settings::persistence`], the correlation of a candidate's noise between consecutive steps.
    Persistence(f64),
    /// Replaces [`Settings::kept`], the number of elites that the next iteration evaluates again.
    Kept(usize),
    /// Replaces [`Settings::proposals`], the number of candidates that the policy proposes.
    Proposals(usize),
    /// Replaces [`Settings::noise`], the noise on the policy's proposals. This is its standard deviation, and it is truncated at
    /// three standard deviations.
    Noise(f64),
    /// Replaces [`Settings::alpha`], the weight of the terminal value, an estimate of the return after the end of a candidate.
    /// `None` omits this value.
    Alpha(Option<f64>),
    /// Replaces [`Settings::value`], the terminal value function.
    Value(Value),
    /// Replaces [`Settings::steps`], the horizon in steps.
    Steps(usize),
    /// Replaces [`Settings::chunk`], the number of ticks for which a plan is flown.
    Chunk(usize),
    /// Replaces [`Settings::delay`], whether a plan is made one tick in advance.
    Delay(bool),
    /// Replaces [`Settings::margin`], by how much the return of a plan must exceed that of the base controller, an LQI.
    Margin(f64),
    /// Replaces [`Settings::ilqr`], whether the plan of an iLQR is a candidate.
    Ilqr(bool),
    /// Replaces [`Settings::disturbance`], the time constant of the disturbance estimate, s; `None` disables it.
    Disturbance(Option<f64>),
    /// Replaces [`Settings::trust`], the largest prediction error at which plans are made; `None` sets no limit.
    Trust(Option<f64>),
    /// Replaces [`Settings::known`], the largest distance from the training data at which plans are made; `None` sets no limit.
    Known(Option<f64>),
    /// Replaces [`Settings::instructions`], the vector instruction set.
    Instructions(Instructions),
    /// Replaces [`Settings::cores`], the number of processor cores used.
    Cores(usize),
}

impl Change {
    pub(super) fn made(self, s: Settings) -> Settings {
        match self {
            Change::Population(population) => Settings { population, ..s },
            Change::Elites(count) => Settings { update: Update::Elites(count), ..s },
            Change::Temperature(scale) => Settings { update: Update::Weighted(scale), ..s },
            Change::Iterations(iterations) => Settings { iterations, ..s },
            Change::Start(start) => Settings { start, ..s },
            Change::Spread(spread) => Settings { spread, ..s },
            Change::Persistence(persistence) => Settings { persistence, ..s },
            Change::Kept(kept) => Settings { kept, ..s },
            Change::Proposals(proposals) => Settings { proposals, ..s },
            Change::Noise(deviation) => Settings { noise: [deviation, 3.0 * deviation], ..s },
            Change::Alpha(alpha) => Settings { alpha, ..s },
            Change::Value(value) => Settings { value, ..s },
            Change::Steps(steps) => Settings { steps, ..s },
            Change::Chunk(chunk) => Settings { chunk, ..s },
            Change::Delay(delay) => Settings { delay, ..s },
            Change::Margin(margin) => Settings { margin, ..s },
            Change::Ilqr(ilqr) => Settings { ilqr, ..s },
            Change::Disturbance(disturbance) => Settings { disturbance, ..s },
            Change::Trust(trust) => Settings { trust, ..s },
            Change::Known(known) => Settings { known, ..s },
            Change::Instructions(instructions) => Settings { instructions, ..s },
            Change::Cores(cores) => Settings { cores, ..s },
        }
    }

    /// Names what a planner with `aids` would need for the change to have an effect; `None` if it has one. A setting that is
    /// switched off is never missing anything.
    pub(crate) fn lacks(self, aids: &Aids) -> Option<&'static str> {
        match self {
            Change::Trust(Some(_)) | Change::Known(Some(_))
                if aids.base.is_none() && aids.agent.is_none() =>
            {
                Some("LQI or policy that flies where no plan is made")
            }
            Change::Margin(_) | Change::Ilqr(true) if aids.base.is_none() => {
                Some("LQI as its base controller")
            }
            _ => None,
        }
    }
}

impl fmt::Display for Change {
    /// Writes the change as `KEY=VALUE`, the form that is parsed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let switch = |on: bool| if on { "yes" } else { "no" };
        let unless_none = |x: Option<f64>| x.map_or("none".to_owned(), |x| x.to_string());
        match *self {
            Change::Population(n) => write!(f, "population={n}"),
            Change::Elites(n) => write!(f, "elites={n}"),
            Change::Temperature(x) => write!(f, "temperature={x}"),
            Change::Iterations(n) => write!(f, "iterations={n}"),
            Change::Start(Start::Neutral) => write!(f, "start=neutral"),
            Change::Start(Start::Policy) => write!(f, "start=policy"),
            Change::Start(Start::Last) => write!(f, "start=last"),
            Change::Spread(x) => write!(f, "spread={x}"),
            Change::Persistence(x) => write!(f, "persistence={x}"),
            Change::Kept(n) => write!(f, "kept={n}"),
            Change::Proposals(n) => write!(f, "proposals={n}"),
            Change::Noise(x) => write!(f, "noise={x}"),
            Change::Alpha(x) => write!(f, "alpha={}", unless_none(x)),
            Change::Value(Value::Critics) => write!(f, "value=critics"),
            Change::Value(Value::Fitted) => write!(f, "value=fitted"),
            Change::Steps(n) => write!(f, "steps={n}"),
            Change::Chunk(n) => write!(f, "chunk={n}"),
            Change::Delay(on) => write!(f, "delay={}", switch(on)),
            Change::Margin(x) => write!(f, "margin={x}"),
            Change::Ilqr(on) => write!(f, "ilqr={}", switch(on)),
            Change::Disturbance(x) => write!(f, "disturbance={}", unless_none(x)),
            Change::Trust(x) => write!(f, "trust={}", unless_none(x)),
            Change::Known(x) => write!(f, "known={}", unless_none(x)),
            Change::Instructions(Instructions::Widest) => write!(f, "instructions=widest"),
            Change::Instructions(Instructions::Avx2) => write!(f, "instructions=avx2"),
            Change::Instructions(Instructions::Portable) => write!(f, "instructions=portable"),
            Change::Cores(n) => write!(f, "cores={n}"),
        }
    }
}

/// A text that is not a valid [`Change`].
#[derive(Debug, thiserror::Error)]
#[error(
    "{text:?} changes no setting of the planner: {why}; give KEY=VALUE with population, elites, \
     temperature, iterations, start (neutral, policy, last), spread, persistence, kept, proposals, noise, \
     alpha (or none), value (critics, fitted), steps, chunk, delay (yes, no), margin, \
     ilqr (yes, no), disturbance (s, or none), trust (or none), known (or none), \
     instructions (widest, avx2, portable), cores (1, 2)"
)]
pub struct ChangeError {
    text: String,
    why: String,
}

impl FromStr for Change {
    type Err = ChangeError;

    fn from_str(text: &str) -> Result<Change, ChangeError> {
        parse(text).map_err(|why| ChangeError { text: text.into(), why })
    }
}

fn parse(text: &str) -> Result<Change, String> {
    let (key, value) = text.split_once('=').ok_or("there is no '='")?;
    let count = |[low, high]: [usize; 2]| match value.parse::<usize>() {
        Ok(x) if (low..=high).contains(&x) => Ok(x),
        _ => Err(format!("{value:?} is not a whole number from {low} to {high}")),
    };
    let lanes = |[low, high]: [usize; 2]| match count([low, high])? {
        x if x % WIDTH == 0 => Ok(x),
        x => Err(format!("{x} is not a multiple of {WIDTH}")),
    };
    let number = |[low, high]: [f64; 2]| match value.parse::<f64>() {
        Ok(x) if (low..=high).contains(&x) => Ok(x),
        _ => Err(format!("{value:?} is not a number from {low} to {high}")),
    };
    let switch = || match value {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err(format!("{value:?} is neither yes nor no")),
    };
    let unless_none = |range| if value == "none" { Ok(None) } else { number(range).map(Some) };
    Ok(match key {
        "population" => Change::Population(lanes([WIDTH, 16384])?),
        "elites" => Change::Elites(count([1, 16384])?),
        "temperature" => Change::Temperature(number([1e-6, 1e3])?),
        "iterations" => Change::Iterations(count([1, 50])?),
        "start" => Change::Start(match value {
            "neutral" => Start::Neutral,
            "policy" => Start::Policy,
            "last" => Start::Last,
            _ => return Err(format!("there is no start {value:?}")),
        }),
        "spread" => Change::Spread(number([0.0, 2.0])?),
        "persistence" => Change::Persistence(number([0.0, 1.0])?),
        "kept" => Change::Kept(count([0, WIDTH - 1])?),
        "proposals" => Change::Proposals(lanes([0, 16384])?),
        "noise" => Change::Noise(number([0.0, 2.0])?),
        "alpha" => Change::Alpha(unless_none([0.0, 1e3])?),
        "value" => Change::Value(match value {
            "critics" => Value::Critics,
            "fitted" => Value::Fitted,
            _ => return Err(format!("there is no value {value:?}")),
        }),
        "steps" => Change::Steps(count([HORIZON, 500])?),
        "chunk" => Change::Chunk(count([1, HORIZON])?),
        "margin" => Change::Margin(number([0.0, 1e3])?),
        "ilqr" => Change::Ilqr(switch()?),
        "delay" => Change::Delay(switch()?),
        "cores" => Change::Cores(count([1, 2])?),
        "instructions" => Change::Instructions(match value {
            "widest" => Instructions::Widest,
            "avx2" => Instructions::Avx2,
            "portable" => Instructions::Portable,
            _ => return Err(format!("there are no instructions {value:?}")),
        }),
        "trust" => Change::Trust(unless_none([0.0, 1e3])?),
        "known" => Change::Known(unless_none([0.0, 1e3])?),
        "disturbance" => Change::Disturbance(unless_none([0.01, 60.0])?),
        _ => return Err(format!("there is no setting {key:?}")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_written_as_they_are_read() {
        for text in [
            "population=32",
            "elites=8",
            "temperature=0.01",
            "iterations=3",
            "start=policy",
            "spread=0.1",
            "persistence=0.5",
            "kept=2",
            "proposals=16",
            "noise=0.02",
            "alpha=none",
            "value=fitted",
            "steps=60",
            "chunk=2",
            "delay=yes",
            "margin=0.05",
            "ilqr=no",
            "disturbance=0.3",
            "trust=none",
            "known=1.5",
            "instructions=avx2",
            "instructions=portable",
            "cores=2",
        ] {
            assert_eq!(text.parse::<Change>().unwrap().to_string(), text);
        }
    }

    #[test]
    fn changes_are_read_and_made() {
        let read = |text: &str| text.parse::<Change>().map_err(|e| e.to_string());
        let changes = [read("spread=0.1"), read("alpha=none"), read("start=policy")];
        let changes: Vec<Change> = changes.into_iter().map(Result::unwrap).collect();
        let changed = Settings::HYBRID.with(&changes);
        let expected =
            Settings { spread: 0.1, alpha: None, start: Start::Policy, ..Settings::HYBRID };
        assert_eq!(changed, expected);
        assert_eq!(Settings::HYBRID.with(&[]), Settings::HYBRID);
        for (text, why) in [
            ("spread", "there is no '='"),
            ("spread=x", "not a number from 0 to 2"),
            ("alpha=NaN", "not a number"),
            ("population=100", "not a multiple of 16"),
            ("population=0", "not a whole number from 16"),
            ("start=there", "no start"),
            ("delay=1", "neither yes nor no"),
            ("cores=3", "not a whole number from 1 to 2"),
            ("speed=1", "no setting \"speed\""),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(why) && error.contains("give KEY=VALUE"), "{error}");
        }
    }
}

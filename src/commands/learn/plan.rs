//! The stages of `greylag learn`. Each stage is a command line of this program.
//!
//! The stages lead from a prior, which is a physical model that may be wrong, to a policy that flies the aircraft. They collect
//! flights, learn a model from them, and train the policy in this model.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::budget::{Algorithm, Budget};
use crate::commands::collect::Explorer;

/// Name of the flights' folder in the output folder of `greylag learn`.
pub const FLIGHTS: &str = "flights";
/// Name of the last model's folder in the output folder of `greylag learn`.
pub const MODEL: &str = "model";
/// Name of the policy's folder in the output folder of `greylag learn`.
pub const POLICY: &str = "policy";

/// Source of the flights from which the model is learned.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// Flights in JSBSim, flown by `greylag collect`.
    Simulator {
        /// Further options of `greylag collect`, which select the aircraft.
        options: Vec<OsString>,
        /// Controller of the first flights; `None` for random actions.
        explorer: Option<Explorer>,
    },
    /// Recorded logs at these paths.
    Logs(Vec<PathBuf>),
    /// Recent logs and the results of an earlier run, which is continued.
    Recent(Recent),
}

/// Results of an earlier run, and the recent logs with which it is continued.
#[derive(Clone, Debug, PartialEq)]
pub struct Recent {
    /// Folder of the earlier run's flights; `None` if there is none.
    pub flights: Option<PathBuf>,
    /// Folder of the earlier run's policy.
    pub policy: PathBuf,
    /// Paths of the recent logs.
    pub logs: Vec<PathBuf>,
    /// Fraction of the training samples that are taken from these logs.
    pub share: f64,
}

/// Inputs that determine the stages.
#[derive(Clone, Debug)]
pub struct Inputs<'a> {
    /// Path of the prior's model file.
    pub prior: &'a Path,
    /// Folder of all outputs.
    pub out: &'a Path,
    /// Source of the flights.
    pub source: Source,
    /// Number of rounds of simulated flights after the first ones. A planner flies them with the model learned so far.
    pub rounds: u32,
    /// Coefficients of the prior that are learned. An empty list freezes the prior.
    pub trainable: &'a [String],
    /// Whether learning ignores the prior standard deviations of the coefficients.
    pub from_scratch: bool,
    /// Training algorithm of the policy.
    pub algorithm: Algorithm,
    /// Amount of computing work.
    pub budget: Budget,
    /// Seed of all random draws.
    pub seed: u32,
}

/// One stage of `greylag learn`.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// Description of the stage's result.
    pub what: String,
    /// Command line of the stage, without the program's name.
    pub line: Vec<OsString>,
}

/// A command line under construction.
struct Line(Vec<OsString>);

impl Line {
    fn of(words: &[&str]) -> Line {
        Line(words.iter().map(OsString::from).collect())
    }

    fn with(mut self, name: &str, value: impl Into<OsString>) -> Line {
        self.0.extend([name.into(), value.into()]);
        self
    }

    fn and(mut self, words: impl IntoIterator<Item = OsString>) -> Line {
        self.0.extend(words);
        self
    }
}

impl Inputs<'_> {
    /// The stages in order. In simulation: first flights, a model, flights planned with this model, the next model and so on, and
    /// finally the policy. With logs: the model and the policy.
    pub fn stages(&self) -> Vec<Stage> {
        let mut stages = Vec::new();
        if let Source::Simulator { .. } = self.source {
            stages.push(self.flights(0));
            for round in 1..=self.rounds {
                stages.push(self.model(Some(round)));
                stages.push(self.flights(round));
            }
        }
        stages.push(self.model(None));
        stages.push(self.policy());
        stages
    }

    /// The folder of the model with which `round` is planned. For `None`, the folder of the last model.
    fn folder(&self, round: Option<u32>) -> PathBuf {
        match round {
            Some(round) => self.out.join(format!("{MODEL}-{round}")),
            None => self.out.join(MODEL),
        }
    }

    fn flights(&self, round: u32) -> Stage {
        let sizes = self.budget.sizes();
        let episodes = if round == 0 { sizes.episodes } else { sizes.planned };
        let mut line = Line::of(&["collect"])
            .with("--out", self.out.join(FLIGHTS))
            .with("--round", round.to_string())
            .with("--episodes", episodes.to_string())
            .with("--seed", self.seed.to_string());
        if round > 0 {
            line = line.with("--model", self.folder(Some(round)).join("model.toml"));
        }
        let mut how = match round {
            0 => "with random actions".to_owned(),
            _ => "planned through that model".to_owned(),
        };
        if let Source::Simulator { options, explorer } = &self.source {
            if let Some(explorer) = explorer.filter(|_| round == 0) {
                line = line.with("--controller", explorer.name()).with("--model", self.prior);
                how = format!("flown by {} with random actions", explorer.name());
            }
            line = line.and(options.iter().cloned());
        }
        Stage { what: format!("{episodes} flights {how}"), line: line.0 }
    }

    /// The stage that trains the model with which `round` is planned. For `None`, the stage that trains the last model.
    fn model(&self, round: Option<u32>) -> Stage {
        let sizes = self.budget.sizes();
        let updates = round.map_or(sizes.updates, |_| sizes.passing_updates);
        let mut line = Line::of(&["train", "dynamics"])
            .with("--prior", self.prior)
            .with("--updates", updates.to_string())
            .with("--hidden", sizes.hidden)
            .with("--seed", self.seed.to_string())
            .with("--out", self.folder(round));
        match &self.source {
            Source::Simulator { .. } => {
                line = line.with("--collect", self.out.join(FLIGHTS));
                line = line.with("--integrator", "jsbsim");
            }
            Source::Logs(logs) => {
                line = line.and(["--log".into()]);
                line = line.and(logs.iter().map(OsString::from));
            }
            Source::Recent(recent) => {
                if let Some(flights) = &recent.flights {
                    line = line.with("--collect", flights);
                }
                line = line.and(["--recent".into()]);
                line = line.and(recent.logs.iter().map(OsString::from));
                line = line.with("--recent-share", recent.share.to_string());
            }
        }
        if self.from_scratch {
            line = line.and(["--from-scratch".into()]);
        }
        if !self.trainable.is_empty() {
            line = line.with("--trainable", self.trainable.join(","));
        }
        let what = match round {
            Some(round) => format!("a model to plan round {round} with"),
            None => "the model".into(),
        };
        Stage { what, line: line.0 }
    }

    fn policy(&self) -> Stage {
        let algorithm = match self.algorithm {
            Algorithm::Analytic => "analytic",
            Algorithm::Td3 => "td3",
        };
        let mut environment = OsString::from("model:");
        environment.push(self.folder(None));
        let mut line = Line::of(&["train", "policy"]);
        if let Source::Recent(recent) = &self.source {
            line = line.with("--start", &recent.policy);
        }
        let line = line
            .with("--env", environment)
            .with("--algorithm", algorithm)
            .and(self.budget.policy(self.algorithm).iter().map(OsString::from))
            .with("--seed", self.seed.to_string())
            .with("--out", self.out.join(POLICY));
        Stage { what: "a policy with its critics, trained in the model".into(), line: line.0 }
    }
}

impl Stage {
    /// The command as it is typed in a shell.
    pub fn command(&self) -> String {
        let quoted = |word: &OsString| match word.to_string_lossy() {
            word if word.contains([' ', '\'', '"', '$', '*']) => {
                format!("'{}'", word.replace('\'', "'\\''"))
            }
            word => word.into_owned(),
        };
        self.line.iter().fold("greylag".into(), |line, word| line + " " + &quoted(word))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stages_of(source: Source, trainable: &[String]) -> Vec<Stage> {
        let inputs = Inputs {
            prior: Path::new("prior.toml"),
            out: Path::new("out"),
            source,
            rounds: 2,
            trainable,
            from_scratch: false,
            algorithm: Algorithm::Analytic,
            budget: Budget::Quick,
            seed: 7,
        };
        inputs.stages()
    }

    #[test]
    fn every_round_is_flown_by_the_model_of_the_rounds_before() {
        let options = vec!["--hide".into(), "gain=0.1".into()];
        let stages = stages_of(Source::Simulator { options, explorer: Some(Explorer::Any) }, &[]);
        let lines: Vec<String> = stages.iter().map(Stage::command).collect();
        assert_eq!(lines.len(), 7, "{lines:#?}");
        for (k, round) in [(0, 0), (2, 1), (4, 2)] {
            assert!(lines[k].contains(&format!("--round {round} ")), "{}", lines[k]);
            assert!(lines[k].ends_with("--hide gain=0.1"), "{}", lines[k]);
        }
        for (k, folder) in [(1, "out/model-1"), (3, "out/model-2"), (5, "out/model")] {
            assert!(lines[k].contains(&format!("--out {folder} --collect")), "{}", lines[k]);
        }
        assert!(lines[0].contains("--controller any --model prior.toml"), "{}", lines[0]);
        assert!(!lines[2].contains("--controller"), "{}", lines[2]);
        assert!(lines[2].contains("--model out/model-1/model.toml"), "{}", lines[2]);
        assert!(lines[4].contains("--model out/model-2/model.toml"), "{}", lines[4]);
        assert!(lines[6].contains("--env model:out/model ") && lines[6].contains("--seed 7"));
    }

    #[test]
    fn logs_are_learned_from_once() {
        let names = ["roll_linear.Clp".into(), "roll_linear.Clda".into()];
        let stages = stages_of(Source::Logs(vec!["a.ulg".into(), "b.ulg".into()]), &names);
        assert_eq!(stages.len(), 2);
        let line = stages[0].command();
        assert!(line.contains("--log a.ulg b.ulg --trainable roll_linear.Clp,roll_linear.Clda"));
        assert!(!line.contains("--integrator"), "{line}");
    }
}

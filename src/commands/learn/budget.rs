//! Budgets of `greylag learn`: numbers of flights, updates and hidden units.

use clap::ValueEnum;

/// A budget by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Budget {
    /// Tens of seconds, for a first try.
    Quick,
    /// A controller that flies acceptably, in minutes on two cores.
    Standard,
    /// The paper's numbers of flights and updates: hours with td3.
    Paper,
}

/// Name of the training algorithm of the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Algorithm {
    /// Analytic policy gradient through the model, then critics fitted to the resulting policy.
    Analytic,
    /// TD3 as in the paper.
    Td3,
}

/// Numbers of flights and updates of a budget, without those of the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Number of random episodes.
    pub episodes: u32,
    /// Number of planned episodes in a round.
    pub planned: u32,
    /// Number of planned rounds.
    pub rounds: u32,
    /// Updates of an intermediate model, which only plans the next round.
    pub passing_updates: u64,
    /// Updates of the last model.
    pub updates: u64,
    /// Units of the residual's hidden layers, separated by commas.
    pub hidden: &'static str,
}

impl Budget {
    /// The numbers of flights and updates.
    pub const fn sizes(self) -> Sizes {
        match self {
            Budget::Quick => Sizes {
                episodes: 12,
                planned: 4,
                rounds: 1,
                passing_updates: 100,
                updates: 600,
                hidden: "16,16",
            },
            Budget::Standard => Sizes {
                episodes: 175,
                planned: 25,
                rounds: 5,
                passing_updates: 1500,
                updates: 20_000,
                hidden: "32,32",
            },
            Budget::Paper => Sizes {
                episodes: 175,
                planned: 25,
                rounds: 5,
                passing_updates: 20_000,
                updates: 20_000,
                hidden: "64,64",
            },
        }
    }

    /// Whether planners, which take milliseconds a step, are flown in the model as well.
    pub fn flies_planners(self) -> bool {
        self != Budget::Quick
    }

    /// The options of `train policy`.
    pub const fn policy(self, algorithm: Algorithm) -> &'static [&'static str] {
        use Algorithm::{Analytic, Td3};
        match (self, algorithm) {
            (Budget::Quick, Analytic) => &[
                "--actor",
                "32,32",
                "--critic",
                "32,32",
                "--updates",
                "200",
                "--window",
                "50",
                "--gradient-batch",
                "16",
                "--valuation",
                "300",
                "--corners",
                "0.3",
            ],
            (Budget::Standard, Analytic) => &[
                "--actor",
                "64,64",
                "--critic",
                "64,64",
                "--updates",
                "800",
                "--window",
                "200",
                "--gradient-batch",
                "64",
                "--valuation",
                "10000",
                "--corners",
                "0.3",
            ],
            (Budget::Paper, Analytic) => &[
                "--actor",
                "128,128",
                "--critic",
                "128,128",
                "--updates",
                "2000",
                "--window",
                "200",
                "--gradient-batch",
                "64",
                "--valuation",
                "20000",
                "--corners",
                "0.3",
            ],
            (Budget::Quick, Td3) => {
                &["--actor", "32,32", "--critic", "32,32", "--steps", "20000", "--warmup", "4000"]
            }
            (Budget::Standard, Td3) => {
                &["--actor", "128,128", "--critic", "128,128", "--steps", "100000"]
            }
            (Budget::Paper, Td3) => &["--steps", "700000", "--evaluate", "20000"],
        }
    }
}

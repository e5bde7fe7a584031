//! Budgets of `greylag learn`: numbers of flights, of gradient updates and of hidden units. The command learns a model (a
//! physical prior with a neural residual) from simulated flights, and then trains a policy in the model. The paper is
//! \[GSFM26\] (see `src/lib.rs`).

use clap::ValueEnum;

/// Amount of computation by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Budget {
    /// Takes tens of seconds, for a first try.
    Quick,
    /// Gives a controller that flies acceptably, in minutes on two cores.
    Standard,
    /// Uses the paper's numbers of flights and updates: hours with td3.
    Paper,
}

/// Training algorithm of the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Algorithm {
    /// Analytic policy gradient through the model; then critics (value functions) are fitted to the resulting policy.
    Analytic,
    /// TD3 (twin delayed deep deterministic policy gradient) as in the paper.
    Td3,
}

/// Numbers of flights, updates and hidden units with which a budget learns the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Number of first flights, with random actions.
    pub episodes: u32,
    /// Number of flights in each later round, with actions planned through the model learned so far.
    pub planned: u32,
    /// Number of later rounds.
    pub rounds: u32,
    /// Gradient updates of each intermediate model, which is used only to plan the next round.
    pub passing_updates: u64,
    /// Gradient updates of the last model.
    pub updates: u64,
    /// Numbers of units of the residual's hidden layers, separated by commas.
    pub hidden: &'static str,
}

impl Budget {
    /// The numbers with which this budget learns the model.
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

    /// Whether planners, too, are scored in simulations of the model. A planner takes milliseconds per step.
    pub fn flies_planners(self) -> bool {
        self != Budget::Quick
    }

    /// The options of `greylag train policy` with this budget and `algorithm`.
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

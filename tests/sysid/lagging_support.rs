//! Three logs of an aircraft whose actuators lag by 50 ms, and what `greylag amend` makes of the first two.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;

use crate::amend_support::{Manoeuvres, errors, fly, sensors};
use greylag::logs::csv;

/// The model, which does not know the lag.
pub const MODEL: &str = "params/x8/jsbsim.toml";

/// The logs and the amendment of [`MODEL`] with the lag, made once for all tests.
pub struct Lagging {
    /// The three logs; the first is fitted to, the second held out, the third unseen.
    pub logs: [PathBuf; 3],
    /// The arguments of the amendment.
    pub line: Vec<String>,
    /// What the amendment said.
    pub amended: Output,
    /// The folder that the amendment wrote.
    pub out: PathBuf,
    /// The model's file before the amendment.
    pub model_before: Vec<u8>,
}

impl Lagging {
    /// The path of log `k` as an argument.
    pub fn log(&self, k: usize) -> &str {
        self.logs[k].to_str().unwrap()
    }
}

/// The flights and the amendment.
pub static LAGGING: LazyLock<Lagging> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lagging");
    // what an earlier run of the tests left there
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let logs = [0, 1, 2].map(|k: u64| {
        let flown = fly("actuator_lag=0.05", 25.0, Manoeuvres::Usual, 20 + k);
        let path = folder.join(format!("flight-{k}.csv"));
        csv::save(&sensors::spoil(&flown, &errors(20 + k), k), &path).unwrap();
        path
    });
    let model_before = std::fs::read(MODEL).unwrap();
    let out = folder.join("amended");
    let words = |path: &Path| path.to_str().unwrap().to_owned();
    let mut line = ["amend", "--model", MODEL, "--log"].map(str::to_owned).to_vec();
    line.extend([words(&logs[0]), words(&logs[1])]);
    line.extend(["--effect", "actuator_lag", "--out"].map(str::to_owned));
    line.push(words(&out));
    let amended = Command::new(env!("CARGO_BIN_EXE_greylag")).args(&line).output().unwrap();
    Lagging { logs, line, amended, out, model_before }
});

//! Golden flights of the official JSBSim: reads them and compares other flights with them.

use std::path::{Path, PathBuf};

use greylag_sitl::plant::{Inputs, Truth};

/// Names of the command histories and of their files.
pub const HISTORIES: [&str; 6] =
    ["white", "held", "ornstein_uhlenbeck", "pid_30_5", "pid_50_20", "pid_m40_m20"];

/// Names of the columns for state and actuators.
pub const COLUMNS: [&str; 14] = [
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "airspeed_mps",
    "p_radps",
    "q_radps",
    "r_radps",
    "alpha_rad",
    "beta_rad",
    "altitude_m",
    "aileron_rad",
    "elevator_rad",
    "throttle",
    "thrust_n",
];

/// State and actuators in the order of [`COLUMNS`].
pub type Row = [f64; 14];

/// The values of `t` in the order of [`COLUMNS`].
pub fn row(t: &Truth) -> Row {
    [
        t.roll_rad,
        t.pitch_rad,
        t.yaw_rad,
        t.airspeed_mps,
        t.p_radps,
        t.q_radps,
        t.r_radps,
        t.alpha_rad,
        t.beta_rad,
        t.altitude_m,
        t.aileron_rad,
        t.elevator_rad,
        t.throttle,
        t.thrust_n,
    ]
}

/// One golden flight: a command for every step, and a state after some of them.
pub struct Golden {
    /// Commands, each with the state after it; `None` if the file has no state for the step.
    pub steps: Vec<(Inputs, Option<Row>)>,
}

/// The folder of the golden files.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

impl Golden {
    /// Reads `folder/name.csv`.
    pub fn read(folder: &Path, name: &str) -> Golden {
        let path = folder.join(format!("{name}.csv"));
        let text =
            std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let mut lines = text.lines();
        let header = format!("aileron,elevator,throttle,{}", COLUMNS.join(","));
        assert_eq!(lines.next(), Some(header.as_str()), "{}", path.display());
        let number = |cell: &str| cell.parse::<f64>().unwrap_or_else(|_| panic!("{name}: {cell}"));
        let steps = lines
            .map(|line| {
                let cells: Vec<&str> = line.split(',').collect();
                assert_eq!(cells.len(), 3 + COLUMNS.len(), "{name}: {line}");
                let [aileron, elevator, throttle] = [0, 1, 2].map(|i| number(cells[i]));
                let state =
                    (!cells[3].is_empty()).then(|| std::array::from_fn(|i| number(cells[3 + i])));
                (Inputs { aileron, elevator, throttle, rudder: 0.0 }, state)
            })
            .collect();
        Golden { steps }
    }

    /// The states in the file.
    pub fn states(&self) -> impl Iterator<Item = &Row> {
        self.steps.iter().filter_map(|(_, state)| state.as_ref())
    }

    /// Largest difference in each column, divided by the column's largest magnitude in this flight.
    pub fn worst<'a>(&self, other: impl Iterator<Item = &'a Row>) -> Row {
        let mut scale = [0.0_f64; 14];
        let mut worst = [0.0_f64; 14];
        for (golden, other) in self.states().zip(other) {
            for i in 0..golden.len() {
                scale[i] = scale[i].max(golden[i].abs());
                worst[i] = worst[i].max(difference(i, golden[i], other[i]));
            }
        }
        std::array::from_fn(|i| worst[i] / scale[i])
    }
}

/// Difference of two values. Yaw angles are compared modulo 2π, because yaw starts at the discontinuity.
fn difference(column: usize, a: f64, b: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let plain = (a - b).abs();
    if column == 2 { plain.min((plain - turn).abs()) } else { plain }
}

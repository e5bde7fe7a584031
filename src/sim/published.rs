//! Published results of the controllers of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`), for comparison with
//! evaluations.
//!
//! The settled error is the mean of the roll and pitch RMSE over the last fifth of a flight to a target.

/// A published value with its 95 % confidence interval, in degrees or in percent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    /// The value as the paper states it.
    pub value: f64,
    /// Lower and upper bound of the interval.
    pub ci95: [f64; 2],
}

/// Results of one controller on one group of targets, from three tables of \[GSFM26\]: XI ("true frozen prior", ten policies),
/// VIII (six models, sixty policies) and V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Name of the controller in this program.
    pub controller: &'static str,
    /// Name of the group of targets in this program; `all` means the paper's 240 targets.
    pub targets: &'static str,
    /// Median settled error, degrees.
    pub median_deg: Value,
    /// Interquartile mean of the settled error, degrees.
    pub iqm_deg: Value,
    /// Mean settled error, degrees.
    pub mean_deg: Value,
    /// Fraction of the targets with a settled error above 10° (diverged), percent. The fraction covers all six models.
    pub diverged_percent: Value,
    /// Computing time per step, ms.
    pub ms_per_step: f64,
}

/// The published results of `controller` on the group `targets`. `None` if the paper has none.
pub fn published(controller: &str, targets: &str) -> Option<&'static Published> {
    ALL.iter().find(|p| p.controller == controller && p.targets == targets)
}

const fn row(
    controller: &'static str,
    targets: &'static str,
    [median, iqm, mean, diverged]: [[f64; 3]; 4],
    ms_per_step: f64,
) -> Published {
    const fn value([value, low, high]: [f64; 3]) -> Value {
        Value { value, ci95: [low, high] }
    }
    Published {
        controller,
        targets,
        median_deg: value(median),
        iqm_deg: value(iqm),
        mean_deg: value(mean),
        diverged_percent: value(diverged),
        ms_per_step,
    }
}

/// Median, interquartile mean and mean of Table XI; divergence of Table VIII; time of Table V.
#[rustfmt::skip]
const ALL: [Published; 15] = [
    row("policy", "all", [[0.91, 0.75, 1.22], [0.97, 0.79, 1.17], [0.97, 0.83, 1.12], [1.7, 1.3, 2.2]], 0.187),
    row("cem", "all", [[19.50, 18.94, 20.60], [19.61, 18.89, 20.44], [19.60, 18.86, 20.29], [31.5, 31.1, 31.8]], 12.047),
    row("cem-policy", "all", [[19.63, 18.87, 20.78], [19.76, 18.97, 20.87], [20.05, 19.24, 21.04], [32.8, 32.3, 33.4]], 16.625),
    row("cem-critic", "all", [[0.65, 0.57, 0.75], [0.67, 0.58, 0.74], [0.66, 0.59, 0.73], [1.0, 0.7, 1.5]], 16.341),
    row("hybrid", "all", [[0.64, 0.56, 0.69], [0.64, 0.57, 0.68], [0.63, 0.58, 0.68], [1.1, 0.8, 1.5]], 21.252),
    row("policy", "easy", [[0.56, 0.51, 0.61], [0.55, 0.52, 0.60], [0.56, 0.52, 0.59], [0.0, 0.0, 0.0]], 0.187),
    row("cem", "easy", [[4.79, 4.77, 4.81], [4.79, 4.77, 4.81], [4.79, 4.78, 4.80], [7.1, 7.1, 7.1]], 12.047),
    row("cem-policy", "easy", [[4.79, 4.76, 4.80], [4.79, 4.76, 5.08], [4.95, 4.77, 5.29], [7.1, 7.1, 7.1]], 16.625),
    row("cem-critic", "easy", [[0.50, 0.43, 0.56], [0.50, 0.44, 0.57], [0.51, 0.46, 0.57], [0.0, 0.0, 0.0]], 16.341),
    row("hybrid", "easy", [[0.43, 0.40, 0.47], [0.43, 0.40, 0.48], [0.44, 0.41, 0.49], [0.0, 0.0, 0.0]], 21.252),
    row("policy", "hard_corners", [[1.52, 0.97, 2.15], [1.55, 1.07, 2.04], [1.56, 1.21, 1.90], [4.1, 3.1, 5.2]], 0.187),
    row("cem", "hard_corners", [[40.13, 38.73, 42.78], [40.38, 38.64, 42.36], [40.34, 38.55, 41.99], [65.6, 64.8, 66.4]], 12.047),
    row("cem-policy", "hard_corners", [[40.43, 37.84, 43.16], [40.49, 38.52, 43.37], [41.19, 39.09, 43.69], [68.8, 67.6, 70.1]], 16.625),
    row("cem-critic", "hard_corners", [[0.93, 0.66, 1.06], [0.90, 0.72, 1.04], [0.87, 0.75, 0.99], [2.5, 1.6, 3.5]], 16.341),
    row("hybrid", "hard_corners", [[0.97, 0.79, 0.99], [0.92, 0.81, 0.99], [0.89, 0.81, 0.97], [2.7, 1.8, 3.6]], 21.252),
];

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_control::ControllerKind;

    #[test]
    fn published_values_lie_in_their_intervals_and_have_controllers() {
        for p in &ALL {
            assert!(
                ControllerKind::ALL.iter().any(|k| k.name() == p.controller),
                "{}",
                p.controller
            );
            for v in [p.median_deg, p.iqm_deg, p.mean_deg, p.diverged_percent] {
                assert!(v.ci95[0] <= v.value && v.value <= v.ci95[1], "{p:?}");
            }
        }
        // of the paper's 240 targets, 140 are easy and 100 are hard
        let mean = |targets| published("hybrid", targets).unwrap().mean_deg.value;
        let all = (140.0 * mean("easy") + 100.0 * mean("hard_corners")) / 240.0;
        assert!((all - mean("all")).abs() < 0.01);
    }
}

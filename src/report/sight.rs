//! Figures about a planner at one control step: the simulated candidate plans (rollouts), the chosen plan, and the computation
//! time of each phase of planning.

use super::Align::Right;
use super::{Figure, Style, Table, XyFigure, XyMark, XySeries};
use crate::kit::numbers::number;
use greylag_control::insight::{Insight, Path};
use greylag_model::STEP;

/// Data about a planner at one control step.
#[derive(Clone, Debug)]
pub struct Sight {
    /// Time of the step, s, on the page's time axis.
    pub time_s: f64,
    /// Commanded roll and pitch, rad.
    pub target: [f64; 2],
    /// Candidates and chosen plan of the step.
    pub insight: Insight,
}

impl Sight {
    /// Figures of roll and of pitch over time, with the candidates and the plan.
    pub(super) fn fans(&self) -> [Figure; 2] {
        [self.fan(0, "Roll"), self.fan(1, "Pitch")]
    }

    fn fan(&self, axis: usize, angle: &str) -> Figure {
        let line = |path: &Path| -> [Vec<f64>; 2] {
            let x = (0..path.len()).map(|k| self.time_s + k as f64 * STEP);
            let y = path.iter().map(|angles| angles[axis].to_degrees());
            // a NaN separates the curves
            [x.chain([f64::NAN]).collect(), y.chain([f64::NAN]).collect()]
        };
        let mut all = [Vec::new(), Vec::new()];
        for path in &self.insight.candidates {
            let [x, y] = line(path);
            all[0].extend(x);
            all[1].extend(y);
        }
        let [x, y] = all;
        let [chosen_x, chosen_y] = line(&self.insight.chosen);
        let chosen = if self.insight.searched { "plan flown" } else { "the LQI flies" };
        let steps = self.insight.chosen.len().saturating_sub(1);
        let ends = [self.time_s, self.time_s + steps as f64 * STEP];
        let series =
            |label: &str, style, mark, x, y| XySeries { label: label.into(), style, mark, x, y };
        Figure::Xy(XyFigure {
            title: format!("{angle} seen ahead at {:.2} s", self.time_s),
            x_label: "Time (s)".into(),
            y_label: format!("{angle} (°)"),
            bands: Vec::new(),
            series: vec![
                series("candidates", Style::Measured, XyMark::Path, x, y),
                series(
                    "command",
                    Style::Command,
                    XyMark::Path,
                    ends.to_vec(),
                    vec![self.target[axis].to_degrees(); 2],
                ),
                series(chosen, Style::Actual, XyMark::Line, chosen_x, chosen_y),
            ],
        })
    }
}

/// Table of the computation time of each phase, ms, with one row for each control step.
pub(super) fn phases<'a>(sights: impl IntoIterator<Item = &'a Sight>) -> Table {
    let mut sights = sights.into_iter().peekable();
    let mut columns = vec![("At (s)", Right)];
    if let Some(first) = sights.peek() {
        columns.extend(first.insight.phases.iter().map(|(name, _)| (*name, Right)));
    }
    let mut table = Table::new("Time of the parts of a tick, ms", &columns);
    for sight in sights {
        let parts = sight.insight.phases.iter().map(|(_, spent)| number(spent.as_secs_f64() * 1e3));
        table.push(std::iter::once(number(sight.time_s)).chain(parts));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planner_without_a_plan_is_drawn() {
        let insight = Insight {
            candidates: Vec::new(),
            chosen: Vec::new(),
            searched: false,
            phases: Vec::new(),
        };
        let sight = Sight { time_s: 2.0, target: [0.1, 0.2], insight };
        let [Figure::Xy(roll), _] = sight.fans() else { panic!("two figures") };
        assert_eq!(roll.series[1].x, [2.0, 2.0]);
    }
}

//! The HTML page of learning curves. It shows the evaluations during the trainings of policies (neural-network controllers) over
//! the steps of the training and over time. An evaluation flies to commanded attitudes, the targets.

use super::Align::{Left, Right};
use super::{
    Choice, ChoiceOption, Curves, Figure, Finding, Findings, Page, Section, Series, Style, Table,
};
use crate::kit::curves::Range;
use crate::kit::numbers::{number, percent};
use greylag_learn::policy::learning_curve::{CurvePoint, best, knee, spread};

/// A training that was run with one or several seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Training {
    /// Name that distinguishes this training from the others.
    pub name: String,
    /// For each seed: its name and its evaluations in time order, of which there is at least one.
    pub seeds: Vec<(String, Vec<CurvePoint>)>,
}

/// The trainings to be compared on the page, as in Figure 2 of \[GSFM26\] (see `src/lib.rs`).
#[derive(Clone, Debug)]
pub struct LearningReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Subtitle of the page.
    pub subtitle: String,
    /// The trainings on the page.
    pub trainings: &'a [Training],
    /// The command that the page proposes to the user as the next one.
    pub next: String,
    /// Command lines, files and other inputs of the page, as pairs of name and value.
    pub provenance: Vec<(String, String)>,
}

/// A quantity of an evaluation, with title, axis label and axis scale of its figure.
struct Quantity {
    title: &'static str,
    label: &'static str,
    linear: bool,
    get: fn(&CurvePoint) -> f64,
}

const QUANTITIES: [Quantity; 4] = [
    Quantity {
        title: "Settled error, easy targets",
        label: "Error (°)",
        linear: false,
        get: |p| p.easy_deg,
    },
    Quantity {
        title: "Settled error, hard targets (corners)",
        label: "Error (°)",
        linear: false,
        get: |p| p.hard_deg,
    },
    Quantity {
        title: "Reward while training",
        label: "Reward of a step",
        linear: true,
        get: |p| p.reward,
    },
    Quantity {
        title: "Targets lost",
        label: "Lost (%)",
        linear: true,
        get: |p| 100.0 * p.divergence_rate,
    },
];

impl LearningReport<'_> {
    /// Builds the page of the trainings.
    pub fn page(&self) -> Page {
        let over = [
            ("Steps", self.figures("Thousand steps", |p| p.steps as f64 / 1000.0)),
            ("Time", self.figures("Minutes", |p| p.seconds / 60.0)),
        ];
        let options = over.map(|(name, figures)| ChoiceOption { name: name.into(), figures });
        let choice =
            Choice { anchor: "over".into(), label: "Over".into(), options: options.into() };
        let note = "Each point is an evaluation of the policy at that time, in its training environment. The targets \
                    differ from those of the final evaluation. Lines: interquartile mean over the seeds; shaded: \
                    smallest to largest value.";
        let ends = "TD3 keeps the policy with the smallest error, the analytic gradient keeps the last policy. The \
                    knee is the first evaluation with 90 % of the reduction from the first to the smallest error.";
        let mut provenance = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
        self.provenance
            .iter()
            .for_each(|(item, value)| provenance.push([item.clone(), value.clone()]));
        let mut sections = vec![
            self.answer(),
            Section::new("Learning curves", note, vec![Figure::Choice(choice)]),
            Section::new("Best and last evaluations", ends, vec![Figure::Table(self.table())]),
            Section::new("Provenance", "", vec![Figure::Table(provenance)]),
        ];
        sections.retain(|s| !s.figures.is_empty());
        Page { title: self.title.clone(), subtitle: self.subtitle.clone(), sections }
    }

    /// A section with one sentence on the best evaluation of each seed. The first sentence is emphasised.
    fn answer(&self) -> Section {
        let all = self.trainings.iter().flat_map(|t| t.seeds.iter().map(move |s| (t, s)));
        let said = all.filter_map(|(training, (seed, points))| {
            let b = points[best(points)?];
            let sentence = format!(
                "{}, seed {seed}: settles within {}° (easy) and {}° (hard corners) and loses {} % of the targets, at its best \
                 after {} steps.",
                training.name,
                number(b.easy_deg),
                number(b.hard_deg),
                percent(b.divergence_rate),
                b.steps
            );
            Some(Finding { sentence, link: None })
        });
        let mut lead: Vec<Finding> = said.collect();
        let rest = lead.split_off(lead.len().min(1));
        match lead.is_empty() {
            true => Section::default(),
            false => Section::new(
                "",
                "",
                vec![Figure::Findings(Findings { lead, rest, next: self.next.clone() })],
            ),
        }
    }

    fn figures(&self, label: &str, over: fn(&CurvePoint) -> f64) -> Vec<Figure> {
        let points = self.trainings.iter().flat_map(|t| &t.seeds).flat_map(|(_, points)| points);
        let mut x: Vec<f64> = points.map(over).collect();
        x.sort_by(f64::total_cmp);
        x.dedup();
        let figure = |quantity: &Quantity| {
            let mut figure = Curves {
                title: quantity.title.into(),
                x_label: label.into(),
                y_label: quantity.label.into(),
                x: x.clone(),
                linear: quantity.linear,
                ..Curves::default()
            };
            for (k, training) in self.trainings.iter().enumerate() {
                let curves: Vec<&[CurvePoint]> =
                    training.seeds.iter().map(|(_, points)| points.as_slice()).collect();
                let spread = spread(&curves, over, quantity.get, &x);
                figure.series.push(Series::new(&training.name, Style::nth(k), spread.middle));
                if curves.len() > 1 {
                    figure.ranges.push(Range { of: k, low: spread.low, high: spread.high });
                }
            }
            let seen = figure.series.iter().flat_map(|s| &s.values);
            seen.into_iter().any(|v| v.is_finite()).then_some(Figure::Curves(figure))
        };
        QUANTITIES.iter().filter_map(figure).collect()
    }

    /// Table of the best and the last evaluation of each seed of each training.
    pub fn table(&self) -> Table {
        let columns = [
            ("Training", Left),
            ("Seed", Left),
            ("Steps", Right),
            ("Minutes", Right),
            ("Best after", Right),
            ("Easy (°)", Right),
            ("Hard (°)", Right),
            ("Lost (%)", Right),
            ("Knee at step", Right),
            ("Knee (min)", Right),
            ("Episodes lost (%)", Right),
        ];
        let mut table = Table::new("Trainings", &columns);
        for training in self.trainings {
            for (seed, points) in &training.seeds {
                let (Some(last), Some(b), Some(k)) = (points.last(), best(points), knee(points))
                else {
                    continue;
                };
                let b = points[b];
                table.push([
                    training.name.clone(),
                    seed.clone(),
                    last.steps.to_string(),
                    number(last.seconds / 60.0),
                    b.steps.to_string(),
                    number(b.easy_deg),
                    number(b.hard_deg),
                    percent(b.divergence_rate),
                    k.steps.to_string(),
                    number(k.seconds / 60.0),
                    percent(last.lost as f64 / last.episodes as f64),
                ]);
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(steps: [u64; 3], easy: [f64; 3]) -> Vec<CurvePoint> {
        let point = |(&steps, &easy_deg): (&u64, &f64)| CurvePoint {
            steps,
            updates: steps,
            seconds: 60.0 * steps as f64,
            easy_deg,
            hard_deg: 0.0,
            divergence_rate: 0.0,
            loss: 0.0,
            reward: -0.1,
            episodes: 10,
            lost: 1,
        };
        steps.iter().zip(&easy).map(point).collect()
    }

    #[test]
    fn trainings_of_several_seeds_have_ranges_and_a_row_a_seed() {
        let two = Training {
            name: "two".into(),
            seeds: vec![
                ("1".into(), points([1, 2, 3], [8.0, 4.0, 1.0])),
                ("2".into(), points([1, 2, 3], [6.0, 2.0, 3.0])),
            ],
        };
        let one = Training {
            name: "one".into(),
            seeds: vec![("1".into(), points([2, 4, 6], [9.0, 3.0, 2.0]))],
        };
        let trainings = [two, one];
        let report = LearningReport {
            title: "Curves".into(),
            subtitle: String::new(),
            trainings: &trainings,
            next: "greylag evaluate --controller policy --policy two/seed-1".into(),
            provenance: Vec::new(),
        };
        let figures = report.figures("Minutes", |p| p.seconds / 60.0);
        let Figure::Curves(easy) = &figures[0] else { panic!("{figures:?}") };
        assert_eq!(easy.x, [1.0, 2.0, 3.0, 4.0, 6.0]);
        assert_eq!(easy.series[0].values[..3], [7.0, 3.0, 2.0]);
        assert_eq!(
            (easy.ranges.len(), easy.ranges[0].low[2], easy.ranges[0].high[2]),
            (1, 1.0, 3.0)
        );
        assert_eq!(easy.series[1].values[1..], [9.0, 6.0, 3.0, 2.0]);
        let table = report.table();
        assert_eq!(table.rows.len(), 3);
        assert_eq!(table.rows[1].cells[4..6], ["2", "2.00"]);
        let page = report.page().render();
        assert!(page.contains("Learning curves") && page.contains("--policy two/seed-1"));
    }
}

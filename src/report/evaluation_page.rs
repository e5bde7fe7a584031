//! Page of an evaluation: scores beside those of the paper (T. Guerin et al., 2026), step responses, and the candidate plans of
//! planners.

pub(crate) mod answer;
mod excess;
pub(crate) mod names;
mod way;

use super::Align::{Left, Right};
use super::sight::{Sight, phases};
use super::{
    Band, Choice, ChoiceOption, Figure, Finding, Findings, Page, Panel, Scale, Section, Series,
    Style, Table, TimeFigure, Whisker, Whiskers,
};
use crate::kit::numbers::number;
use greylag_control::Target;
use greylag_model::STEP;
use greylag_sim::evaluation::Evaluation;
use greylag_sim::published::{Published, Value, published};
use greylag_sim::tracking::{Tracking, seconds};
use names::{label, only_model};

/// Results of an evaluation with their provenance.
#[derive(Clone, Debug)]
pub struct EvaluationReport<'a> {
    /// Subtitle of the page.
    pub subtitle: String,
    /// Results, one element per controller.
    pub evaluations: &'a [Evaluation],
    /// Single flights: each target with one flight of each controller, in the order of `evaluations`.
    pub flights: &'a [(Target, Vec<Tracking>)],
    /// Whether the controllers flew with the envelope limiter.
    pub limited: bool,
    /// The command that the user should run next; empty if there is none.
    pub next: String,
    /// Inputs of the evaluation, such as files and options, as pairs of name and value.
    pub provenance: Vec<(String, String)>,
}

impl EvaluationReport<'_> {
    /// Builds the page of the evaluation.
    pub fn page(&self) -> Page {
        let mut sections = vec![self.verdict(), self.intervals()];
        if !self.flights.is_empty() {
            sections.push(self.tracking());
            sections.extend(self.sight());
        }
        sections.extend(way::sections(self));
        sections.push(self.scores());
        sections.retain(|s| !s.figures.is_empty());
        sections.push(self.provenance());
        Page { title: "Controllers".into(), subtitle: self.subtitle(), sections }
    }

    /// The subtitle, with the name of the model if all controllers share it.
    fn subtitle(&self) -> String {
        match only_model(self.evaluations) {
            Some(model) => format!("{}; model {model}", self.subtitle),
            None => self.subtitle.clone(),
        }
    }

    /// Section with the summary in sentences.
    fn verdict(&self) -> Section {
        let plain = |sentence: String| Finding { sentence, link: None };
        let mut lead: Vec<Finding> =
            answer::sentences(self.evaluations, self.limited).into_iter().map(plain).collect();
        // the first sentence, on the smallest settled error, is prominent
        let rest = lead.split_off(lead.len().min(1));
        let next = self.next.clone();
        match lead.is_empty() {
            true => Section::default(),
            false => Section::new("", "", vec![Figure::Findings(Findings { lead, rest, next })]),
        }
    }

    fn groups(&self) -> Vec<&str> {
        let Some(first) = self.evaluations.first() else { return Vec::new() };
        first.groups.iter().map(|score| score.targets.as_str()).collect()
    }

    fn intervals(&self) -> Section {
        let figures = self.groups().into_iter().map(|group| {
            let mut rows = Vec::new();
            for e in self.evaluations {
                let Some(score) = e.score(group) else { continue };
                let ours = Value { value: score.mean_deg, ci95: score.mean_ci95_deg };
                rows.push(whisker(label(e, self.evaluations), Style::Actual, ours));
                if let Some(p) = published(&e.controller, group) {
                    let name = format!("{} in the paper", p.controller);
                    rows.push(whisker(name, Style::Measured, p.mean_deg));
                }
            }
            Figure::Whiskers(Whiskers {
                title: group.replace('_', " "),
                unit: "settled error, °, mean".into(),
                scale: Scale::Log { floor: 1e-4 },
                lines: Vec::new(),
                legend: String::new(),
                rows,
            })
        });
        let note = "Mean of the settled error (mean of roll and pitch RMSE over the last fifth \
                    of ten seconds) with its 95 % bootstrap interval, over the targets here, over ten \
                    policies in the paper (Table XI: true frozen prior), on a scale of decades.";
        Section::new("Settled error", note, figures.collect())
    }

    fn scores(&self) -> Section {
        let columns = [
            ("Controller", Left),
            ("Targets", Left),
            ("n", Right),
            ("Median (°)", Right),
            ("IQM (°)", Right),
            ("Mean (°)", Right),
            ("Paper's mean (°)", Right),
            ("Least, most (°)", Right),
            ("To 1° (s)", Right),
            ("Diverged (%)", Right),
            ("Paper's (%)", Right),
            ("ms a step: median, p99.9", Right),
            ("Paper's", Right),
        ];
        let mut table = Table::new("Scores", &columns);
        for e in self.evaluations {
            for s in &e.groups {
                let paper = published(&e.controller, &s.targets);
                let of = |get: &dyn Fn(&Published) -> String| paper.map_or_else(|| "–".into(), get);
                table.push([
                    label(e, self.evaluations),
                    s.targets.replace('_', " "),
                    s.count.to_string(),
                    with_interval(s.median_deg, s.median_ci95_deg),
                    with_interval(s.iqm_deg, s.iqm_ci95_deg),
                    with_interval(s.mean_deg, s.mean_ci95_deg),
                    of(&|p| with_interval(p.mean_deg.value, p.mean_deg.ci95)),
                    format!("{}, {}", number(s.min_deg), number(s.max_deg)),
                    number(s.settling_s),
                    with_interval(100.0 * s.divergence_rate, s.divergence_ci95.map(|x| 100.0 * x)),
                    of(&|p| with_interval(p.diverged_percent.value, p.diverged_percent.ci95)),
                    format!("{}, {}", number(e.ms_per_step.p50), number(e.ms_per_step.p999)),
                    of(&|p| number(p.ms_per_step)),
                ]);
            }
        }
        let note = "95 % bootstrap intervals in brackets. The paper's: Table XI, divergence of Table VIII \
                    (all six models), time of Table V.";
        Section::new("Scores", note, vec![Figure::Table(table)])
    }

    fn tracking(&self) -> Section {
        let option = |(target, flights): &(Target, Vec<Tracking>)| {
            let time: Vec<f64> =
                (0..flights.first().map_or(0, |f| f.attitude.len())).map(seconds).collect();
            let panel = |axis: usize, title: &str, wanted: f64| {
                let mut series = vec![Series::new(
                    "command",
                    Style::Command,
                    vec![wanted.to_degrees(); time.len()],
                )];
                for (k, (e, flight)) in self.evaluations.iter().zip(flights).enumerate() {
                    let values =
                        flight.attitude.iter().map(|angles| angles[axis].to_degrees()).collect();
                    series.push(Series::new(&label(e, self.evaluations), Style::nth(k), values));
                }
                let band = Band { around: 0, half_width: 5.0, label: "within".into() };
                Panel { bands: vec![band], ..Panel::new(title, "°", series) }
            };
            let mut figure = TimeFigure::default();
            let panels = vec![panel(0, "Roll", target.roll), panel(1, "Pitch", target.pitch)];
            figure.add_track(&time, 10.0 * STEP, panels);
            ChoiceOption { name: name(target), figures: vec![Figure::Time(figure)] }
        };
        let choice = Choice {
            anchor: "tracking".into(),
            label: "Target".into(),
            options: self.flights.iter().map(option).collect(),
        };
        let note =
            "Ten seconds from level flight towards the targets of the paper's Figures 7 to 9.";
        Section::new("Single flights", note, vec![Figure::Choice(choice)])
    }

    /// Section on the candidate plans that the planners simulated during the flights; `None` if no planner flew.
    fn sight(&self) -> Option<Section> {
        let mut options = Vec::new();
        for (target, flights) in self.flights {
            for (e, flight) in self.evaluations.iter().zip(flights) {
                if flight.insights.is_empty() {
                    continue;
                }
                let sights: Vec<Sight> = flight
                    .insights
                    .iter()
                    .map(|(step, insight)| Sight {
                        time_s: seconds(*step),
                        target: [target.roll, target.pitch],
                        insight: insight.clone(),
                    })
                    .collect();
                let mut figures: Vec<Figure> = sights.iter().flat_map(Sight::fans).collect();
                figures.push(Figure::Table(phases(&sights)));
                let name = format!("{}, {}", label(e, self.evaluations), name(target));
                options.push(ChoiceOption { name, figures });
            }
        }
        if options.is_empty() {
            return None;
        }
        let choice = Choice { anchor: "sight".into(), label: "Planner".into(), options };
        let note = "Some of the candidates of the last iteration and the plan that was flown, in the planner's \
                    own model, at three moments; then the time that the parts of those ticks took.";
        Some(Section::new("What the planner saw", note, vec![Figure::Choice(choice)]))
    }

    fn provenance(&self) -> Section {
        let mut table = Table::new("Provenance", &[("Thing", Left), ("Value", Left)]);
        self.provenance.iter().for_each(|(k, v)| table.push([k.clone(), v.clone()]));
        Section::new("Provenance", "", vec![Figure::Table(table)])
    }
}

fn name(target: &Target) -> String {
    let [roll, pitch] = [target.roll, target.pitch].map(f64::to_degrees);
    format!("roll {roll:.0}°, pitch {pitch:.0}°")
}

fn with_interval(value: f64, [low, high]: [f64; 2]) -> String {
    format!("{} [{}, {}]", number(value), number(low), number(high))
}

fn whisker(label: String, style: Style, Value { value, ci95 }: Value) -> Whisker {
    Whisker { label, style, value, interval: ci95, text: with_interval(value, ci95) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_control::insight::Insight;
    use greylag_control::quality::{Limits, Moment, Track};
    use greylag_physics::{Airframe, Command};
    use greylag_sim::evaluation::courses;
    use greylag_sim::targets::Row;
    use greylag_sim::{Group, Outcome};
    use std::time::Duration;

    fn evaluated(controller: &str, settled_deg: f64) -> Evaluation {
        let groups = [Group::Easy, Group::HardCorners];
        let row = |(n, group)| Row { number: n, group, roll_deg: 10.0, pitch_deg: 5.0 };
        let rows: Vec<Row> = (1..).zip(groups.into_iter().cycle()).take(8).map(row).collect();
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/airframe.toml");
        let limits = Limits::of(&Airframe::load(&path).unwrap());
        let target = Target { roll: 0.2, pitch: 0.1, airspeed: 16.67 };
        let moment = |k: u32| Moment {
            time_s: f64::from(k) * STEP,
            attitude: [0.2, 0.1],
            airspeed: 16.0,
            alpha: 0.1,
            beta: 0.0,
            load_factor: 2.25,
            command: Command { aileron: 0.01 * f64::from(k), ..Command::IDLE },
        };
        let moments = (0..=100).map(moment).collect();
        let track = Track { moments, target, before: None, lost_s: 0.0 };
        let cost = vec![Duration::from_micros(300)];
        let outcome = Outcome { settled_deg, settling_s: 0.5, cost, track };
        let names = [controller, "exact <model>"];
        Evaluation::measured(names, &courses(&rows, 16.67), &vec![outcome; 8], &limits)
    }

    #[test]
    fn the_answer_names_the_best_and_whether_the_targets_tell_it_from_the_next() {
        let answer = |errors: [f64; 2]| {
            let [a, b] = errors;
            answer::sentences(&[evaluated("hybrid", a), evaluated("lqi", b)], false)
        };
        let said = answer([0.25, 0.1]);
        assert_eq!(
            said,
            [
                "Smallest settled error: lqi, on average 0.100° (95 %: 0.100 to 0.100°). It keeps its limits of load factor and angle \
                 of attack in all 8 flights.",
                "Flown without the envelope limiter.",
                "Its worst target: roll +10°, pitch +5°, settled error 0.100°.",
                "Behind it: hybrid 0.250°.",
                "No target was lost."
            ]
        );
        let alike = answer([0.1, 0.1]);
        assert_eq!(alike[3], "Not distinguished from it by these targets: lqi 0.100°.");
        assert!(answer::sentences(&[], false).is_empty());
        let alone = answer::sentences(&[evaluated("lqi", 0.1)], false);
        assert!(alone[0].starts_with("lqi keeps its limits of load factor"), "{alone:?}");
    }

    #[test]
    fn controllers_are_named_with_their_models_if_these_differ() {
        let mut all = [evaluated("lqi", 0.1), evaluated("pid", 0.2), evaluated("lqi", 0.3)];
        all[1].model = "-".into();
        assert_eq!(all.iter().map(|e| label(e, &all)).collect::<Vec<_>>(), ["lqi", "pid", "lqi"]);
        all[2].model = "prior".into();
        let named: Vec<String> = all.iter().map(|e| label(e, &all)).collect();
        assert_eq!(named, ["lqi (exact <model>)", "pid", "lqi (prior)"]);
        // one policy beside the one model is no difference
        all[2].model = "exact <model>, policies/one".into();
        assert_eq!(only_model(&all), Some("exact <model>, policies/one"));
        assert_eq!(all.iter().map(|e| label(e, &all)).collect::<Vec<_>>(), ["lqi", "pid", "lqi"]);
    }

    #[test]
    fn who_leaves_the_envelope_more_often_is_not_the_best() {
        let mut all = [evaluated("lqi", 0.002), evaluated("hybrid-ilqr", 0.005)];
        for (e, kept) in all.iter_mut().zip([0.5, 1.0]) {
            e.groups.iter_mut().for_each(|s| s.kept_rate = kept);
        }
        assert_eq!(answer::best(&all).unwrap().controller, "hybrid-ilqr");
        let said = answer::sentences(&all, true);
        assert!(said[0].contains("that keep their limits most often: hybrid-ilqr, on"), "{said:?}");
        assert_eq!(
            said[3],
            "Behind it: lqi 0.00200°, but outside the limits of load factor or angle of attack in 4 of 8."
        );
        // a controller that leaves the envelope in up to one flight in twenty keeps its rank
        all[0].groups.iter_mut().for_each(|s| s.kept_rate = 0.96);
        assert_eq!(answer::best(&all).unwrap().controller, "lqi");
        // of 100 flights it leaves them in four, and the answer names the one that keeps them
        all.iter_mut().flat_map(|e| &mut e.groups).for_each(|s| s.count = 100);
        let said = &answer::sentences(&all, true)[0];
        assert!(said.contains("in 4 of 100 flights; hybrid-ilqr keeps its limits"), "{said}");
    }

    #[test]
    fn the_papers_result_stays_beside_its_controller_where_another_lacks_the_group() {
        let mut evaluations =
            [evaluated("lqi", 0.1), evaluated("lqi", 0.2), evaluated("hybrid", 0.25)];
        evaluations[1].groups.retain(|score| score.targets != "easy");
        let report = EvaluationReport {
            subtitle: String::new(),
            evaluations: &evaluations,
            flights: &[],
            limited: false,
            next: String::new(),
            provenance: Vec::new(),
        };
        let section = report.intervals();
        let easy = section.figures.iter().find_map(|figure| match figure {
            Figure::Whiskers(whiskers) if whiskers.title == "easy" => Some(whiskers),
            _ => None,
        });
        let labels: Vec<&str> = easy.unwrap().rows.iter().map(|r| r.label.as_str()).collect();
        assert_eq!(labels.last(), Some(&"hybrid in the paper"), "{labels:?}");
    }

    /// The page shows every controller with its interval and the paper's result. It contains no NaN for a flight that ends early.
    #[test]
    fn the_page_has_ours_and_the_papers() {
        let evaluations = [evaluated("hybrid", 0.25), evaluated("lqi", 1e-7)];
        let insight = Insight {
            candidates: vec![vec![[0.1, 0.2], [f64::NAN, 0.3]]],
            chosen: vec![[0.1, 0.2], [0.15, 0.25]],
            searched: true,
            phases: vec![("fly", Duration::from_micros(900))],
        };
        let flown = |insights| Tracking { attitude: vec![[0.1, 0.2], [f64::NAN; 2]], insights };
        let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
        let flights = [(target, vec![flown(vec![(10, insight)]), flown(Vec::new())])];
        let page = EvaluationReport {
            subtitle: "Flown in JSBSim".into(),
            evaluations: &evaluations,
            flights: &flights,
            limited: true,
            next: "greylag demo --controller lqi".into(),
            provenance: vec![("seed".into(), "1".into())],
        };
        let html = page.page().render();
        for part in [
            "Flown in JSBSim; model exact &lt;model&gt;",
            "hybrid in the paper",
            "Next: <code>greylag demo --controller lqi</code>",
            "<p>Smallest settled error: lqi, on average",
            "Flown with the envelope limiter.",
            "0.440 [0.410, 0.490]",
            "Roll seen ahead at 0.10 s",
            "plan flown",
            "roll 29°, pitch 6°",
            "Error against surface travel",
            // a load factor of 2.25 exceeds the limit of 2.2 by less than the transient margin
            "load factor – to 2.20, stall 12.3°",
            "<td>Outside the load factor (s)</td><td class=\"number\">1.00 [1.00, 1.00], worst 1.00</td>",
            "Graham and Lathrop",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert!(!html.contains("lqi in the paper"));
        assert!(!html.contains("inf%") && !html.contains("NaN%"));
    }
}

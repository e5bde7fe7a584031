//! Page of the training of one grey-box model: its error, the history of loss and coefficients, and the residual.
//!
//! The prior is the physical part of the model, the residual the learned network that is added to it.

use super::Align::{Left, Right};
use super::{
    Choice, ChoiceOption, Curves, Figure, Finding, Findings, HeatCell, HeatMap, Page, Section,
    Series, Style, Table, XyFigure, XyMark, XySeries,
};
use crate::kit::numbers::{number, percent};
use greylag_learn::dynamics::residual_map::{Cell, ResidualMap};
use greylag_learn::dynamics::score::Horizon;
use greylag_learn::{Learned, Moment};
use greylag_model::STEP;

/// Results of a training, with its inputs.
#[derive(Clone, Debug)]
pub struct TrainingReport<'a> {
    /// Title of the page.
    pub title: String,
    /// Subtitle of the page.
    pub subtitle: String,
    /// History of the training, in order.
    pub history: &'a [Moment],
    /// The trained coefficients.
    pub coefficients: &'a [Learned],
    /// Errors of the prior alone on the held-out flights (not used in the training), one for each prediction horizon.
    pub prior: &'a [Horizon],
    /// Errors of the trained model on the held-out flights, one for each horizon.
    pub learned: &'a [Horizon],
    /// Map of the residual over flight conditions; `None` for a model without residual.
    pub residual: Option<&'a ResidualMap>,
    /// The command that the user should run next; empty if there is none.
    pub next: String,
    /// Notes for the user.
    pub notes: &'a [String],
    /// Inputs of the training (files, hashes, options), as pairs of name and value.
    pub provenance: Vec<(String, String)>,
}

impl TrainingReport<'_> {
    /// Builds the page of the training.
    pub fn page(&self) -> Page {
        let mut sections = vec![self.answer(), self.errors(), self.losses(), self.tracks()];
        if let Some(residual_map) = self.residual {
            sections.extend([shares(residual_map), curves(residual_map), map(residual_map)]);
        }
        sections.push(self.notes());
        sections.push(self.provenance());
        sections.retain(|s| !s.figures.is_empty());
        Page { title: self.title.clone(), subtitle: self.subtitle.clone(), sections }
    }

    /// Section on the change of the error at the two longest horizons that both models have.
    fn answer(&self) -> Section {
        let change = |(p, l): (&Horizon, &Horizon)| {
            let by = 100.0 * (l.rms / p.rms - 1.0);
            let verb = if by <= 0.0 { "falls" } else { "rises" };
            let lost = match l.lost {
                lost if lost > 0.0 => format!("; {} % of the runs are lost", percent(lost)),
                _ => String::new(),
            };
            let sentence = format!(
                "On flights not fitted the error at {} s {verb} from {} (prior) to {} (learned, {}{:.0} %){lost}.",
                number(p.steps as f64 * STEP),
                number(p.rms),
                number(l.rms),
                if by <= 0.0 { "−" } else { "+" },
                by.abs()
            );
            Finding { sentence, link: None }
        };
        let both = self
            .prior
            .iter()
            .zip(self.learned)
            .filter(|(p, l)| p.rms.is_finite() && l.rms.is_finite());
        let mut lead: Vec<Finding> = both.rev().take(2).map(change).collect();
        let rest = lead.split_off(lead.len().min(1));
        let next = self.next.clone();
        match lead.is_empty() {
            true => Section::default(),
            false => Section::new("", "", vec![Figure::Findings(Findings { lead, rest, next })]),
        }
    }

    fn errors(&self) -> Section {
        let rms = |h: &[Horizon]| h.iter().map(|h| h.rms).collect();
        let figure = Curves {
            title: "Error over the horizon".into(),
            x_label: "Steps of 0.01 s".into(),
            y_label: "NRMSE".into(),
            x: self.prior.iter().map(|h| h.steps as f64).collect(),
            series: vec![
                Series::new("bare prior", Style::nth(0), rms(self.prior)),
                Series::new("learned", Style::nth(1), rms(self.learned)),
            ],
            ..Curves::default()
        };
        let columns = [
            ("Steps", Right),
            ("Runs", Right),
            ("Bare prior", Right),
            ("Learned", Right),
            ("Ratio", Right),
            ("Lost by the prior (%)", Right),
            ("Lost (%)", Right),
        ];
        let mut table = Table::new("Free runs over the flights held out", &columns);
        for (p, l) in self.prior.iter().zip(self.learned) {
            table.push([
                p.steps.to_string(),
                p.runs.to_string(),
                number(p.rms),
                number(l.rms),
                number(l.rms / p.rms),
                percent(p.lost),
                percent(l.lost),
            ]);
        }
        let note = "Root mean square over runs and states of the error divided by x_c; a run that \
                    reaches 1 counts as lost, with 1.";
        Section::new("Errors", note, vec![Figure::Curves(figure), Figure::Table(table)])
    }

    fn losses(&self) -> Section {
        let line = |title: &str, label: &str, get: &dyn Fn(&Moment) -> f64| {
            let values = self.history.iter().map(get).collect();
            Figure::Curves(Curves {
                title: title.into(),
                x_label: "Updates".into(),
                y_label: label.into(),
                x: self.history.iter().map(|m| m.update as f64).collect(),
                series: vec![Series::new(label, Style::nth(0), values)],
                ..Curves::default()
            })
        };
        if self.history.is_empty() {
            return Section::default();
        }
        let note = "The prediction error over the bare prior's, the size of the residual relative to the \
                    prior, and λ, whose inverse weighs it.";
        let figures = vec![
            line("Prediction error, eq. (23)", "L / L_prior", &|m| m.normalised),
            line("Size of the residual, eq. (22)", "‖F_a‖/‖F_p‖", &|m| m.ratio),
            line("Weight of the prediction, eq. (24)", "λ", &|m| m.lambda),
        ];
        Section::new("Training", note, figures)
    }

    fn tracks(&self) -> Section {
        let columns =
            [("Coefficient", Left), ("At the start", Right), ("Learned", Right), ("True", Right)];
        let mut table = Table::new("Coefficients of the prior that were trained", &columns);
        let mut options = Vec::new();
        for (k, c) in self.coefficients.iter().enumerate() {
            let truth = c.truth.map_or_else(|| "–".into(), number);
            table.push([c.name.clone(), number(c.start), number(c.value), truth]);
            let x: Vec<f64> = self.history.iter().map(|m| m.update as f64).collect();
            let y = self.history.iter().map(|m| m.coefficients.get(k).copied());
            let path = |label: &str, style, y: Vec<f64>| XySeries {
                label: label.into(),
                style,
                mark: XyMark::Path,
                x: x.clone(),
                y,
            };
            let level = |value: f64| vec![value; x.len()];
            let learned = y.map(|v| v.unwrap_or(f64::NAN)).collect();
            let mut series = vec![
                path("learned", Style::Actual, learned),
                path("at the start", Style::Third, level(c.start)),
            ];
            series.extend(c.truth.map(|t| path("true", Style::Command, level(t))));
            let figure = XyFigure {
                title: c.name.clone(),
                x_label: "Updates".into(),
                y_label: c.name.clone(),
                bands: Vec::new(),
                series,
            };
            options.push(ChoiceOption {
                name: c.name.rsplit('.').next().unwrap_or(&c.name).into(),
                figures: vec![Figure::Xy(figure)],
            });
        }
        if options.is_empty() {
            return Section::default();
        }
        let choice = Choice { anchor: "coefficients".into(), label: "Coefficient".into(), options };
        Section::new("The prior", "", vec![Figure::Choice(choice), Figure::Table(table)])
    }

    fn notes(&self) -> Section {
        let mut table = Table::new("Notes", &[("Note", Left)]);
        self.notes.iter().for_each(|note| table.push([note.clone()]));
        match table.rows.is_empty() {
            true => Section::default(),
            false => Section::new("Notes", "", vec![Figure::Table(table)]),
        }
    }

    fn provenance(&self) -> Section {
        let mut table = Table::new("Provenance", &[("Item", Left), ("Value", Left)]);
        self.provenance.iter().for_each(|(item, value)| table.push([item.clone(), value.clone()]));
        Section::new("Provenance", "", vec![Figure::Table(table)])
    }
}

fn shares(residual_map: &ResidualMap) -> Section {
    let columns =
        [("Rate of", Left), ("Prior", Right), ("Residual", Right), ("Strongest at", Left)];
    let mut table = Table::new("What the residual adds", &columns);
    for share in &residual_map.channels {
        let place = share
            .strongest
            .as_ref()
            .map_or(String::new(), |(over, [low, high])| format!("{over} {low:.0} to {high:.0}"));
        table.push([share.channel.into(), number(share.prior), number(share.learned), place]);
    }
    let note = format!(
        "Root mean square in units of x_c a second over the flights held out; ‖F_a‖/‖F_p‖ is {}. A \
         residual that stands out in one regime is an effect that the prior lacks: `greylag diagnose` \
         says which.",
        number(residual_map.ratio)
    );
    Section::new("The residual", &note, vec![Figure::Table(table)])
}

fn curves(residual_map: &ResidualMap) -> Section {
    let mut options: Vec<ChoiceOption> = Vec::new();
    for curve in residual_map.curves.iter().filter(|c| c.points.iter().any(|p| p[2] > 0.0)) {
        let column = |i: usize| -> Vec<f64> { curve.points.iter().map(|p| p[i]).collect() };
        let figure = Figure::Xy(XyFigure {
            title: format!("{} over {}", curve.channel, curve.over),
            x_label: curve.over.into(),
            y_label: format!("F_a of {} / x_c (1/s)", curve.channel),
            bands: Vec::new(),
            series: vec![XySeries {
                label: "mean".into(),
                style: Style::Actual,
                mark: XyMark::Line,
                x: column(0),
                y: column(1),
            }],
        });
        match options.last_mut().filter(|o| o.name == curve.channel) {
            Some(option) => option.figures.push(figure),
            None => {
                options.push(ChoiceOption { name: curve.channel.into(), figures: vec![figure] });
            }
        }
    }
    if options.is_empty() {
        return Section::default();
    }
    let choice = Choice { anchor: "residual".into(), label: "Rate of".into(), options };
    Section::new("Where it acts", "", vec![Figure::Choice(choice)])
}

fn map(residual_map: &ResidualMap) -> Section {
    let edges = |get: &dyn Fn(&Cell) -> f64, half: f64| -> Vec<f64> {
        let mut all: Vec<f64> = residual_map.map.iter().map(get).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let (Some(low), Some(high)) = (all.first(), all.last()) else { return Vec::new() };
        let count = ((high - low) / (2.0 * half)).round() as usize + 1;
        (0..=count).map(|k| low - half + 2.0 * half * k as f64).collect()
    };
    let [half_alpha, half_beta] = greylag_learn::dynamics::residual_map::HALF_CELL_DEG;
    let x_edges = edges(&|c| c.alpha_deg, half_alpha);
    let y_edges = edges(&|c| c.beta_deg, half_beta);
    let most = residual_map.map.iter().map(|c| c.norm).fold(0.0, f64::max);
    if most <= 0.0 || x_edges.is_empty() {
        return Section::default();
    }
    let place = |edges: &[f64], x: f64| edges.iter().filter(|e| **e < x).count().saturating_sub(1);
    let cells = residual_map.map.iter().map(|c| HeatCell {
        x: place(&x_edges, c.alpha_deg),
        y: place(&y_edges, c.beta_deg),
        value: c.norm,
        samples: c.samples,
        supported: true,
    });
    let cells = cells.collect();
    let figure = HeatMap {
        title: "Size of the residual over the flow angles".into(),
        x_label: "Angle of attack α (°)".into(),
        y_label: "Sideslip β (°)".into(),
        unit: "1/s".into(),
        limit: most,
        x_edges,
        y_edges,
        cells,
    };
    Section::new("α–β map of the residual", "", vec![Figure::HeatMap(figure)])
}

//! Page of a diagnosis, which names the effects that a model lacks: first the findings in words, then the evidence.

use crate::comparison::page::channel_name;
use crate::diagnosis::DiagnosisReport;
use crate::diagnosis::{place, proof, suspects, tables};
use crate::kit::bars::value_text;
use crate::kit::html::file_names;
use crate::kit::numbers::percent;
use crate::{
    AnswerBox, BarGroup, Bars, Choice, ChoiceOption, Figure, Finding, Findings, First, Grid,
    GridCell, GridRow, Link, Page, Section, Style, Table,
};
use greylag_sysid::amend::Prior;
use greylag_sysid::compare::answer::Method;
use greylag_sysid::compare::{ChannelId, ChannelResult, Comparison, ModelResult, RegimeVariable};
use greylag_sysid::diagnose::{Diagnosis, Verdict};

/// Number of findings that are shown prominently, before the others.
const LEADING: usize = 2;
/// Share of the residual's variance below which a cell of the map is blank.
const BLANK: f64 = 0.05;

/// Text by which sentences on sensor errors are recognised; there is one such sentence per flight.
const SENSORS: &str = ": errors of the sensors and the wind";

/// The page of `report`: first the answer, then the evidence for it.
pub fn diagnosis_page(report: &DiagnosisReport) -> Page {
    let d = report.diagnosis;
    let answer = report.answer.cloned();
    let words = || Figure::Findings(findings(d));
    let (first, later) = match answer {
        Some(answer) => {
            // that a forecast without aerodynamics is better than the model comes before what the model lacks
            let error_first = answer.behind_baseline() || d.effects.iter().any(|c| c.asserted);
            let first = if error_first { First::Error } else { First::Effect };
            let place = match answer.acts.is_empty() {
                true => place::of_diagnosis(d),
                false => place::variables(d),
            };
            let answer = AnswerBox { answer, place, first };
            let answer = Figure::Answer(Box::new(answer));
            (answer, Section::new("In words", "", vec![words()]))
        }
        None => (words(), Section::default()),
    };
    let mut sections = vec![Section::new("", "", vec![first])];
    sections.push(suspects::curves(d));
    sections.push(where_it_fails(d, report.failing));
    sections.push(suspects::ranking(d));
    sections.push(suspects::agreement(d));
    sections.push(later);
    sections.push(proof::chance(d));
    sections.extend(report.held_out.map(proof::stated));
    sections.push(tables::advice(report));
    sections.push(tables::unseen(d).folded());
    sections.push(tables::tuned(&d.tuned, &[], Prior::File, Method::EquationError));
    sections.push(tables::measurement(d).folded());
    sections.push(tables::trims(d).folded());
    sections.push(tables::candidates(d).folded());
    sections.push(tables::notes(d).folded());
    sections.push(tables::provenance(report).folded());
    sections.retain(|s| !s.figures.is_empty());
    Page { title: report.title.clone(), subtitle: subtitle(report), sections }
}

fn subtitle(report: &DiagnosisReport) -> String {
    let d = report.diagnosis;
    let verdict = match d.verdict {
        Verdict::Effect => "an effect is missing",
        Verdict::Adequate => "nothing is seen to be missing",
        Verdict::Unknown => "these flights cannot say",
        Verdict::Unexplained => "something is missing that the catalogue does not hold",
    };
    format!("{} with {}: {verdict}.", d.model, file_names(&report.log_files))
}

fn findings(d: &Diagnosis) -> Findings {
    let finding = |s: &String| Finding { sentence: s.clone(), link: link(d, s) };
    // sentences on sensor errors are omitted, because a separate table contains the sensor errors
    let said = || d.sentences.iter().filter(|s| !s.contains(SENSORS));
    let mut lead: Vec<Finding> = said().take(LEADING).map(finding).collect();
    if lead.is_empty() {
        let sentence = "The diagnosis says nothing: the notes say why.".into();
        lead.push(Finding { sentence, link: None });
    }
    let rest = said().skip(LEADING).map(finding).collect();
    Findings { lead, rest, ..Findings::default() }
}

/// Link to the curve of the effect whose identifier `sentence` contains.
fn link(d: &Diagnosis, sentence: &str) -> Option<Link> {
    let letter = |c: char| c.is_alphanumeric() || c == '_';
    let names = |id: &str| sentence.split(|c| !letter(c)).any(|word| word == id);
    let of = d.effects.iter().find(|c| c.curve.is_some() && names(&c.id))?;
    Some(Link { anchor: suspects::ANCHOR.into(), option: of.id.clone() })
}

/// A channel's name from its symbol; an unknown symbol is returned unchanged.
pub(crate) fn channel_of(symbol: &str) -> String {
    let id = ChannelId::ALL.into_iter().find(|id| id.symbol() == symbol);
    id.map_or_else(|| symbol.to_string(), channel_name)
}

fn where_it_fails(d: &Diagnosis, failing: Option<&Comparison>) -> Section {
    let mut figures = Vec::new();
    figures.extend(failing.and_then(|c| maps(d, c)));
    if !d.channels.is_empty() {
        figures.push(left(d));
        figures.extend(worst(d));
    }
    let note = "Left, in the table and in the bars: the share of each channel's variation that is neither explained by \
                the model nor by the sensors' noise. “Tuned” is the model with its own coefficients fitted first, \
                by a regression of forces and moments (equation error); `amend` fits free runs (output error), which leaves \
                other shares. What is left then is for a missing effect to explain; the rest was wrong coefficients.";
    Section::new("Where it fails", note, figures)
}

/// Maps of the channels' residuals over the regime variables (those that describe the flight condition), one map for each model.
/// The first map, that of the tuned model, is shown initially.
fn maps(d: &Diagnosis, c: &Comparison) -> Option<Figure> {
    // the colours of all maps have the same scale
    let option = |(k, m): (usize, &ModelResult)| {
        let of = (k == 0).then_some(d);
        Some(ChoiceOption { name: m.name.clone(), figures: vec![map(m, of)?] })
    };
    let options: Vec<ChoiceOption> = c.models.iter().enumerate().filter_map(option).collect();
    let choice = Choice { anchor: "fails".into(), label: "Model".into(), options };
    (!choice.options.is_empty()).then_some(Figure::Choice(choice))
}

/// The unexplained share of a channel of the comparison. For the tuned model it is the share that the diagnosis `tuned` states, as
/// in the bars and in the answer: the diagnosis and the comparison fit the coefficients by different methods.
fn unexplained(channel: &ChannelResult, tuned: Option<&Diagnosis>) -> f64 {
    let symbol = channel.channel.symbol();
    let stated = tuned.and_then(|d| d.channels.iter().find(|ch| ch.channel == symbol));
    stated.map_or(channel.unexplained_fraction, |ch| ch.tuned_unexplained_fraction)
}

/// Map with a row for each channel and a column for each regime variable: the share of the residual's variance that the variable
/// explains. `tuned` is the diagnosis if `model` is its tuned model.
fn map(model: &ModelResult, tuned: Option<&Diagnosis>) -> Option<Figure> {
    let channels = &model.channels;
    let variables: Vec<RegimeVariable> = RegimeVariable::CONTINUOUS
        .into_iter()
        .chain([RegimeVariable::Flight])
        .filter(|v| channels.iter().any(|ch| ch.bins.iter().any(|b| b.variable == *v)))
        .collect();
    if variables.is_empty() {
        return None;
    }
    let row = |ch: &ChannelResult| {
        let left = unexplained(ch, tuned);
        let text = if left.is_finite() { value_text(100.0 * left, "%") } else { "–".into() };
        let mut cells = vec![GridCell { text, weight: 0.0 }];
        cells.extend(variables.iter().map(|v| cell(ch, left, *v)));
        GridRow { label: channel_name(ch.channel), cells }
    };
    let mut columns = vec![(
        "left".to_string(),
        "share of the channel's variation that is unexplained".to_string(),
    )];
    columns.extend(variables.iter().map(|v| (sign(*v).to_string(), v.name().to_string())));
    Some(Figure::Grid(Grid {
        title: format!("Unexplained share by channel and variable, {}", model.name),
        unit: "how much of the unexplained follows each variable, %".into(),
        corner: "Channel".into(),
        columns,
        rows: channels.iter().map(row).collect(),
    }))
}

/// The cell of a channel of which the share `left` is unexplained.
fn cell(channel: &ChannelResult, left: f64, variable: RegimeVariable) -> GridCell {
    let found = channel.bins.iter().find(|b| b.variable == variable);
    let share = found.map_or(0.0, |b| b.explained);
    if share.is_nan() || share < BLANK {
        return GridCell { text: String::new(), weight: 0.0 };
    }
    // The cells of a channel are pale if its unexplained fraction is below 10 %.
    let importance = if left.is_finite() { (left / 0.1).clamp(0.0, 1.0) } else { 0.0 };
    GridCell { text: percent(share), weight: share * importance }
}

fn sign(variable: RegimeVariable) -> &'static str {
    match variable {
        RegimeVariable::Alpha => "α",
        RegimeVariable::Beta => "β",
        RegimeVariable::Airspeed => "V",
        RegimeVariable::Throttle => "thr.",
        RegimeVariable::P => "p",
        RegimeVariable::Q => "q",
        RegimeVariable::R => "r",
        RegimeVariable::Aileron => "δa",
        RegimeVariable::Elevator => "δe",
        RegimeVariable::AileronRate => "δ̇a",
        RegimeVariable::ElevatorRate => "δ̇e",
        RegimeVariable::Altitude => "h",
        RegimeVariable::Time => "time",
        RegimeVariable::Flight => "flight",
    }
}

fn left(d: &Diagnosis) -> Figure {
    let asserted = d.effects.iter().any(|c| c.asserted);
    let mut keys = vec![("tuned by equation error".to_string(), Style::Actual)];
    if asserted {
        keys.push(("with the asserted effects".to_string(), Style::Second));
    }
    let group = |ch: &greylag_sysid::diagnose::ChannelLeft| BarGroup {
        label: channel_of(&ch.channel),
        values: [ch.tuned_unexplained_fraction, ch.unexplained_fraction]
            .iter()
            .take(keys.len())
            .map(|x| 100.0 * x)
            .collect(),
    };
    let groups: Vec<BarGroup> = d.channels.iter().map(group).collect();
    let all = groups.iter().flat_map(|g| &g.values).copied().filter(|v| v.is_finite());
    // The scale ends at the largest share but not below 5 % or above 100 %, so that small shares can be distinguished.
    let full = all.fold(0.0, f64::max).clamp(5.0, 100.0);
    Figure::Bars(Bars { title: "Left unexplained".into(), unit: "%".into(), keys, groups, full })
}

/// Table of the regimes in which most is left; `None` if no channel has one.
fn worst(d: &Diagnosis) -> Option<Figure> {
    use crate::Align::Left;
    let columns = [("Channel", Left), ("What is left", Left), ("Goes with", Left)];
    let mut table = Table::new("Worst regime", &columns);
    for channel in &d.channels {
        if channel.worst_regime.is_some() || channel.left_with.is_some() {
            let text = |of: &Option<String>| of.clone().unwrap_or("–".into());
            let (worst, term) = (text(&channel.worst_regime), text(&channel.left_with));
            table.push([channel_of(&channel.channel), worst, term]);
        }
    }
    (!table.rows.is_empty()).then_some(Figure::Table(table))
}

//! The page on a comparison of models with flights. A channel is a force, a moment or a rate in which model and flight are
//! compared. The unexplained share is the part of a channel's variation that neither model nor sensor noise explains. A regime
//! is a flight condition, such as a range of the angle of attack.

use crate::comparison::ComparisonReport;
use crate::comparison::{place, regimes, tables, traces};
use crate::{
    AnswerBox, BarGroup, Bars, ChoiceOption, Curves, Figure, Finding, Findings, First, Link, Page,
    Section, Series, Style,
};
use greylag_sysid::compare::answer::Way;
use greylag_sysid::compare::{ChannelId, Comparison, GrowthPoint, ModelResult};

/// Number of sentences on the last model that are shown prominently.
const LEADING: usize = 2;
/// Largest number of sentences on each model before the last.
const OF_OTHERS: usize = 2;

/// A curve of the error growth ends where fewer runs than this, or than a fifth of the runs, are long enough.
const FEW: usize = 5;

/// The page of `report`: first the answer, then the evidence for it. If an estimate is physically impossible, the page begins with it
/// and shows no forces and moments.
pub fn comparison_page(report: &ComparisonReport) -> Page {
    let c = report.comparison;
    let answer = c.answer.clone();
    let boxed = AnswerBox { answer, place: place::of_comparison(c), first: First::Error };
    let answer = Figure::Answer(Box::new(boxed));
    // with a single model no sentence is prominent, because the answer box already names the worst channel
    let leading = if c.models.len() == 1 { 0 } else { LEADING };
    let words = Figure::Findings(findings(c, leading));
    // the page of a single model begins with its failures, that of several models with their differences
    let sound = c.doubtful.is_empty();
    let (first, later) = match c.models.len() {
        _ if !sound => (vec![words, answer], Section::default()),
        0 | 1 => (vec![answer, words], Section::default()),
        _ => (vec![answer], Section::new("In words", "", vec![words])),
    };
    let mut sections = vec![Section::new("", "", first)];
    if sound {
        let named = place::named(&c.answer.numbers.acts);
        sections.push(Section::new("Unexplained", &unexplained_note(c), unexplained(c, &named)));
    }
    sections.push(Section::new("Error growth", &growth_note(c), growth(c)));
    sections.push(later);
    if sound {
        sections.push(regimes::regimes(c));
        sections.push(regimes::maps(c));
    }
    sections.extend(traces::section(c));
    sections.push(tables::summary(c).folded());
    sections.push(tables::baselines(c).folded());
    sections.push(tables::nuisances(c).folded());
    sections.push(tables::notes(c).folded());
    sections.push(tables::provenance(report).folded());
    sections.retain(|s| !s.figures.is_empty());
    Page { title: report.title.clone(), subtitle: subtitle(c), sections }
}

/// The section of a flight report on the errors of the model with which the aircraft was flown.
pub(crate) fn short_section(c: &Comparison) -> Section {
    let mut found = findings(c, LEADING);
    // the links are removed, because the figures to which they point are on the page of the comparison only
    for finding in found.lead.iter_mut().chain(&mut found.rest) {
        finding.link = None;
    }
    let mut figures = vec![Figure::Findings(found)];
    if c.doubtful.is_empty() {
        figures.extend(unexplained(c, &[]));
    }
    figures.extend(growth(c));
    Section::new("Model against flight", UNEXPLAINED_NOTE, figures)
}

const UNEXPLAINED_NOTE: &str = "Share of each channel's variation that is neither explained by \
     the model nor by the sensors' noise. Over 100 % the model is worse than a constant.";

/// The note on the unexplained share. If the second model is the first with re-estimated ("tuned") coefficients and added
/// effects, the note adds that tuning alone removes much of the first model's unexplained share.
fn unexplained_note(c: &Comparison) -> String {
    let tuned = c.answer.numbers.steps.iter().any(|step| step.way == Way::Tuned);
    match (tuned, &c.models[..]) {
        (true, [given, after]) => format!(
            "{UNEXPLAINED_NOTE} “{}” is the model as given: much of its bars is wrong coefficients, which tuning alone (a fit of \
             free runs, output error) takes away; “{}” is tuned so and has what was added.",
            given.name, after.name
        ),
        _ => UNEXPLAINED_NOTE.into(),
    }
}

fn subtitle(c: &Comparison) -> String {
    let names = |all: Vec<&str>| all.join(", ");
    let seconds: f64 = c.flights.iter().flat_map(|f| &f.segments_s).map(|s| s[1] - s[0]).sum();
    format!(
        "{} against {}, {seconds:.0} s in the air.",
        names(c.models.iter().map(|m| m.name.as_str()).collect()),
        names(c.flights.iter().map(|f| f.name.as_str()).collect()),
    )
}

/// Name of a channel for display: its symbol and its name in words.
pub(crate) fn channel_name(id: ChannelId) -> String {
    format!("{} {}", id.symbol(), id.name())
}

/// Physically impossible estimates, and the sentences on all models, the worst channels first. The last model comes first, with the first `leading` of its sentences
/// prominent. With several models, each sentence begins with the name of its model.
fn findings(c: &Comparison, leading: usize) -> Findings {
    let mut found = Findings::default();
    let plain = |said: &String| Finding { sentence: said.clone(), link: None };
    found.lead.extend(c.doubtful.iter().map(plain));
    let last = c.models.len().saturating_sub(1);
    for (k, model) in c.models.iter().enumerate().rev() {
        let own = if k == last { usize::MAX } else { OF_OTHERS };
        let all = model.sentences_worst_first().into_iter();
        let said_once = all.filter(|said| c.doubtful.iter().all(|first| first != said));
        for (i, said) in said_once.take(own).enumerate() {
            let sentence = match last {
                0 => said.into(),
                _ => format!("{}: {said}", named(c, k)),
            };
            let finding = Finding { sentence, link: link(model, said) };
            let prominent = k == last && i < leading;
            let list = if prominent { &mut found.lead } else { &mut found.rest };
            list.push(finding);
        }
    }
    if found.lead.is_empty() && found.rest.is_empty() {
        let sentence = "No channel could be compared: the notes say why.".into();
        found.lead.push(Finding { sentence, link: None });
    }
    found
}

/// The name of the model with index `k`, marked as given if the last model was made from it.
fn named(c: &Comparison, k: usize) -> String {
    let made = c.answer.numbers.steps.iter().any(|s| matches!(s.way, Way::Tuned | Way::Effects));
    let given = if k == 0 && made { " (as given)" } else { "" };
    format!("{}{given}", c.models[k].name)
}

/// Link to the regimes of the channel whose worst regime `sentence` describes.
fn link(model: &ModelResult, sentence: &str) -> Option<Link> {
    let plain = |text: &str| text.trim_end_matches('.').to_lowercase();
    let of = model.channels.iter().find(|ch| plain(&ch.worst_regime) == plain(sentence))?;
    Some(Link { anchor: regimes::ANCHOR.into(), option: channel_name(of.channel) })
}

/// The name and the line style of each model.
pub(crate) fn keys(c: &Comparison) -> Vec<(String, Style)> {
    c.models.iter().enumerate().map(|(i, m)| (m.name.clone(), Style::nth(i))).collect()
}

/// Bars of the unexplained shares: first the channels `named` by the answer, then the worst channels of the first model. The rates of
/// V, α and β have bars of their own if the logs contain the forces, of which the sentences speak then.
pub(crate) fn unexplained(c: &Comparison, named: &[ChannelId]) -> Vec<Figure> {
    use ChannelId::{Airspeed, Alpha, Beta, Drag, Lift, Side};
    let mut seen: Vec<ChannelId> = Vec::new();
    for id in c.models.iter().flat_map(ModelResult::worst_first).map(|ch| ch.channel) {
        if !seen.contains(&id) {
            seen.push(id);
        }
    }
    seen.sort_by_key(|id| named.iter().position(|other| other == id).unwrap_or(usize::MAX));
    let forces = seen.iter().any(|id| matches!(id, Drag | Lift | Side));
    let again = |id: &ChannelId| forces && matches!(id, Airspeed | Alpha | Beta);
    let (rates, stated): (Vec<ChannelId>, Vec<ChannelId>) = seen.into_iter().partition(again);
    let title = if forces { "Unexplained share: forces and moments" } else { "Unexplained share" };
    let rates_title =
        "Unexplained share: rates of V, α and β, the forces again as changes of the state";
    let both = [(title, stated), (rates_title, rates)];
    both.into_iter().filter(|(_, ids)| !ids.is_empty()).map(|(t, ids)| bars(c, t, ids)).collect()
}

/// Bars of the unexplained shares of the channels `ids`, %, one bar for each model.
fn bars(c: &Comparison, title: &str, ids: Vec<ChannelId>) -> Figure {
    let share = |model: &ModelResult, id: ChannelId| {
        let of = model.channels.iter().find(|ch| ch.channel == id);
        of.map_or(f64::NAN, |ch| 100.0 * ch.unexplained_fraction)
    };
    let group = |id: ChannelId| BarGroup {
        label: channel_name(id),
        values: c.models.iter().map(|m| share(m, id)).collect(),
    };
    Figure::Bars(Bars {
        title: title.into(),
        unit: "%".into(),
        keys: keys(c),
        groups: ids.into_iter().map(group).collect(),
        full: 100.0,
    })
}

fn growth_note(c: &Comparison) -> String {
    format!(
        "Free runs on the recorded actuators, started from reconstructed states every {} s; each \
         state's error is divided by its characteristic value x_c. A run that has diverged counts \
         as {}. The curves end where fewer than {FEW} runs or a fifth of them are long enough.",
        c.settings.start_every_s, c.settings.divergence_bound
    )
}

/// The growth of the error of `model` up to the time that enough runs reach. Beyond it, a curve would change because runs end.
fn well_founded(model: &ModelResult) -> &[GrowthPoint] {
    let all = model.growth.iter().map(|p| p.runs).max().unwrap_or(0);
    let least = all.div_ceil(5).max(FEW).min(all);
    let end = model.growth.iter().position(|p| p.runs < least);
    &model.growth[..end.unwrap_or(model.growth.len())]
}

pub(crate) fn growth(c: &Comparison) -> Vec<Figure> {
    let longest = c.models.iter().map(well_founded).max_by_key(|g| g.len());
    let Some(longest) = longest.filter(|g| !g.is_empty()) else { return Vec::new() };
    let curves = |title: &str, value: fn(&GrowthPoint) -> f64| {
        // all models have the same runs, so the curves have the same times up to the end of the shorter one
        let series = c.models.iter().enumerate().map(|(i, m)| {
            let mut values: Vec<f64> = well_founded(m).iter().map(value).collect();
            values.resize(longest.len(), f64::NAN);
            Series::new(&m.name, Style::nth(i), values)
        });
        Figure::Curves(Curves {
            title: title.into(),
            x_label: "Time after the start (s)".into(),
            y_label: "Error / x_c".into(),
            x: longest.iter().map(|p| p.time_s).collect(),
            series: series.collect(),
            ..Curves::default()
        })
    };
    vec![
        curves("Root mean square over the runs", |p| p.rmse_scaled),
        curves("Median run", |p| p.median_scaled),
    ]
}

/// The alternatives of a choice between channels: one for each channel for which `figures` returns any. The channel that the answer
/// box names comes first, so that the page opens on it.
pub(crate) fn by_channel(
    c: &Comparison,
    figures: impl Fn(ChannelId) -> Vec<Figure>,
) -> Vec<ChoiceOption> {
    let seen =
        |id: &ChannelId| c.models.iter().any(|m| m.channels.iter().any(|x| x.channel == *id));
    let option = |id| ChoiceOption { name: channel_name(id), figures: figures(id) };
    let named = place::channel_of(c);
    let mut ids: Vec<ChannelId> = ChannelId::ALL.into_iter().filter(seen).collect();
    ids.sort_by_key(|id| Some(*id) != named);
    let all = ids.into_iter().map(option);
    all.filter(|o| !o.figures.is_empty()).collect()
}

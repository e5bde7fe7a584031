//! The figures that show in which flight conditions a model fails. A channel is a force, a moment or a rate. The figures show the
//! mean residual (measured minus model) of each channel. It is drawn over each regime variable (a quantity of the flight
//! condition, such as the airspeed), and as a map over α and β.

use crate::comparison::page::{by_channel, keys};
use crate::{Choice, Figure, HeatCell, HeatMap, IntervalBins, IntervalPanel, Intervals, Section};
use greylag_sysid::compare::{
    ChannelId, ChannelResult, Comparison, Map, RegimeBins, RegimeVariable,
};

/// Anchor of the section in the page, for links to it.
pub(crate) const ANCHOR: &str = "regimes";

pub(crate) fn regimes(c: &Comparison) -> Section {
    let options = by_channel(c, |id| panels(c, id).map(Figure::Intervals).into_iter().collect());
    let note = format!(
        "Mean of measured less model in bins, with its 95 % interval by block bootstrap and the \
         uncertainty of the sensor errors; a positive one means that the model is too low. Grey: fewer than {} independent samples.",
        c.settings.support
    );
    choice("Where it fails", &note, ANCHOR, options)
}

pub(crate) fn maps(c: &Comparison) -> Section {
    let options = by_channel(c, |id| heat_maps(c, id));
    let note = "Mean of measured less model over angle of attack and sideslip, one map a model on \
                one scale. Orange: the model is too low; blue: too high.";
    choice("α–β map", note, "map", options)
}

fn choice(title: &str, note: &str, anchor: &str, options: Vec<crate::ChoiceOption>) -> Section {
    if options.is_empty() {
        return Section::default();
    }
    let choice = Choice { anchor: anchor.into(), label: "Channel".into(), options };
    Section::new(title, note, vec![Figure::Choice(choice)])
}

fn of(c: &Comparison, id: ChannelId) -> Vec<Option<&ChannelResult>> {
    c.models.iter().map(|m| m.channels.iter().find(|ch| ch.channel == id)).collect()
}

fn panels(c: &Comparison, id: ChannelId) -> Option<Intervals> {
    let channels = of(c, id);
    let bins = |ch: Option<&'_ ChannelResult>, variable| -> Option<RegimeBins> {
        ch?.bins.iter().find(|b| b.variable == variable).cloned()
    };
    let variables = RegimeVariable::CONTINUOUS.into_iter().chain([RegimeVariable::Flight]);
    let mut found: Vec<(f64, IntervalPanel)> = Vec::new();
    for variable in variables {
        let lines: Vec<Option<RegimeBins>> =
            channels.iter().map(|ch| bins(*ch, variable)).collect();
        let Some(some) = lines.iter().flatten().find(|b| !b.bins.is_empty()) else { continue };
        // one flight alone shows no difference between flights
        if variable == RegimeVariable::Flight && some.bins.len() < 2 {
            continue;
        }
        let explained = lines.iter().flatten().map(|b| b.explained).fold(0.0, f64::max);
        let panel = IntervalPanel {
            title: capital(some.name),
            unit: some.unit.into(),
            names: some.bins.iter().map(|b| b.label.clone()).filter(|l| !l.is_empty()).collect(),
            lines: lines.iter().map(|l| l.as_ref().map_or_else(Default::default, line)).collect(),
        };
        found.push((explained, panel));
    }
    // the variable that explains the largest part of the residual's variance comes first
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    (!found.is_empty()).then(|| Intervals {
        y_label: format!("Measured − model: {} ({})", id.name(), id.unit()),
        unit: id.unit().into(),
        keys: keys(c),
        panels: found.into_iter().map(|(_, panel)| panel).collect(),
    })
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |c| c.to_uppercase().chain(letters).collect())
}

fn line(regime: &RegimeBins) -> IntervalBins {
    let flights = regime.variable == RegimeVariable::Flight;
    let mut bins = IntervalBins::default();
    for (i, b) in regime.bins.iter().enumerate() {
        let middle = if flights { i as f64 } else { b.center };
        bins.from.push(b.low);
        bins.to.push(b.high);
        bins.center.push(middle);
        bins.mean.push(b.mean);
        bins.low.push(b.interval[0]);
        bins.high.push(b.interval[1]);
        bins.samples.push(b.independent);
        bins.supported.push(b.supported);
    }
    bins
}

fn heat_maps(c: &Comparison, id: ChannelId) -> Vec<Figure> {
    let channels = of(c, id);
    let cells = |supported_only: bool| {
        let all = channels.iter().flatten().flat_map(|ch| &ch.map.cells);
        let sizes = all.filter(move |x| x.supported || !supported_only).map(|x| x.mean.abs());
        sizes.filter(|v| v.is_finite()).fold(0.0, f64::max)
    };
    // a cell with few samples may deviate by chance: it sets the scale only if every cell has few samples
    let limit = [cells(true), cells(false)].into_iter().find(|l| *l > 0.0);
    let Some(limit) = limit else { return Vec::new() };
    let models = c.models.iter().zip(&channels);
    models
        .filter_map(|(model, ch)| Some((model, &(*ch)?.map)))
        .map(|(model, map)| Figure::HeatMap(heat_map(&model.name, id, map, limit)))
        .collect()
}

fn heat_map(title: &str, id: ChannelId, map: &Map, limit: f64) -> HeatMap {
    let cell = |c: &greylag_sysid::compare::MapCell| HeatCell {
        x: c.alpha,
        y: c.beta,
        value: c.mean,
        samples: c.independent,
        supported: c.supported,
    };
    HeatMap {
        title: title.into(),
        x_label: "Angle of attack α (°)".into(),
        y_label: "Sideslip β (°)".into(),
        unit: id.unit().into(),
        limit,
        x_edges: map.alpha_deg.clone(),
        y_edges: map.beta_deg.clone(),
        cells: map.cells.iter().map(cell).collect(),
    }
}

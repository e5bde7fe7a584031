//! Plots of measured and predicted states, forces and moments over time: selected stretches of the flights, then whole flights.
//!
//! The states are predicted by free runs: the model is simulated with the recorded actuators from a reconstructed state. The
//! forces and moments are compared in weak form: they are averaged over a short window with a smooth weight (kernel).

use crate::comparison::page::channel_name;
use crate::{Choice, ChoiceOption, Figure, Panel, Section, Series, Style, TimeFigure};
use greylag_sysid::compare::{ChannelId, ChannelTrace, Comparison, FlightTrace, ModelTrace};

/// Length of a stretch, s.
const STRETCH_S: f64 = 30.0;
/// Largest number of rows per stretch in a plot.
const STRETCH_ROWS: usize = 1000;
/// Largest number of values in the plots of all whole flights together. The limit keeps the page near 2 MB.
const WHOLE_VALUES: usize = 120_000;
/// Largest number of whole flights in plots.
const WHOLE_FLIGHTS: usize = 6;
/// Display names and units of the states, in the order of `State::NAMES`, with the factor from SI units.
const STATES: [(&str, &str, f64); 8] = [
    ("Roll φ", "°", DEGREE),
    ("Pitch θ", "°", DEGREE),
    ("Airspeed V", "m/s", 1.0),
    ("Roll rate p", "°/s", DEGREE),
    ("Pitch rate q", "°/s", DEGREE),
    ("Yaw rate r", "°/s", DEGREE),
    ("Angle of attack α", "°", DEGREE),
    ("Sideslip β", "°", DEGREE),
];
const DEGREE: f64 = 180.0 / std::f64::consts::PI;

/// A stretch of one flight: index of the flight, range of rows, and mean of the first model's errors (see [`errors`]).
#[derive(Clone, Copy)]
struct Stretch {
    flight: usize,
    first: usize,
    end: usize,
    error: f64,
}

/// The section on traces; `None` if the comparison contains no traces.
pub(crate) fn section(c: &Comparison) -> Option<Section> {
    let mut stretches = stretches(c);
    let mut options = Vec::new();
    stretches.sort_by(|a, b| b.error.total_cmp(&a.error));
    let picks = [("worst", 0), ("typical", stretches.len() / 2), ("best", stretches.len())];
    let mut shown = Vec::new();
    for (word, at) in picks {
        let at = at.min(stretches.len().saturating_sub(1));
        if at < stretches.len() && !shown.contains(&at) {
            shown.push(at);
            options.push(option(c, word, stretches[at]));
        }
    }
    let flown: Vec<usize> =
        (0..c.flights.len()).filter(|f| !c.flights[*f].trace.time_s.is_empty()).collect();
    let drawn = &flown[..flown.len().min(WHOLE_FLIGHTS)];
    for &flight in drawn {
        let lines = STATES.len() * (1 + c.models.len());
        let rows = (WHOLE_VALUES / lines / drawn.len().max(1)).clamp(300, 4000);
        let end = c.flights[flight].trace.time_s.len();
        let name = format!("all of {}", c.flights[flight].name);
        let figures = vec![Figure::Time(figure(c, flight, 0..end, rows))];
        options.push(ChoiceOption { name, figures });
    }
    if options.is_empty() {
        return None;
    }
    let mut note = format!(
        "The model flies on the recorded actuators and is put back on the reconstructed state \
         every {} s; forces and moments are averages over {} s. Stretches of {STRETCH_S:.0} s are \
         ranked by the error of {}.",
        c.settings.start_every_s,
        c.settings.kernel_s,
        c.models.first().map_or("the model", |m| &m.name)
    );
    let left_out: Vec<&str> =
        flown[drawn.len()..].iter().map(|f| c.flights[*f].name.as_str()).collect();
    if !left_out.is_empty() {
        note.push_str(&format!(" Not drawn as a whole: {}.", left_out.join(", ")));
    }
    let choice = Choice { anchor: "time".into(), label: "Stretch".into(), options };
    Some(Section::new("Measured against predicted", &note, vec![Figure::Choice(choice)]))
}

fn option(c: &Comparison, word: &str, s: Stretch) -> ChoiceOption {
    let time = &c.flights[s.flight].trace.time_s;
    let (from, to) = (time[s.first], time[s.end - 1]);
    let flight = match c.flights.len() {
        1 => String::new(),
        _ => format!(" of {}", c.flights[s.flight].name),
    };
    ChoiceOption {
        name: format!("{word}: {from:.0} to {to:.0} s{flight}"),
        figures: vec![Figure::Time(figure(c, s.flight, s.first..s.end, STRETCH_ROWS))],
    }
}

/// Squared error of the first model at every row of every flight, summed over the states. Each state's squared error is divided
/// by its mean over all flights.
fn errors(c: &Comparison) -> Vec<Vec<f64>> {
    let Some(model) = c.models.first() else { return Vec::new() };
    let pairs: Vec<(&FlightTrace, &ModelTrace)> =
        c.flights.iter().map(|f| &f.trace).zip(&model.traces).collect();
    let square = |(f, m): (&FlightTrace, &ModelTrace), k: usize, i: usize| {
        let at = |list: &Vec<f64>| list.get(i).copied().unwrap_or(f64::NAN);
        (at(&m.states[k]) - at(&f.states[k])).powi(2)
    };
    let mut sums: Vec<Vec<f64>> = pairs.iter().map(|(f, _)| vec![0.0; f.time_s.len()]).collect();
    for k in 0..STATES.len() {
        let rows = |p: usize| 0..pairs[p].0.time_s.len();
        let all = (0..pairs.len()).flat_map(|p| rows(p).map(move |i| (p, i)));
        let finite: Vec<f64> =
            all.map(|(p, i)| square(pairs[p], k, i)).filter(|e| e.is_finite()).collect();
        let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
        for (p, sum) in sums.iter_mut().enumerate().filter(|_| mean > 0.0) {
            for (i, s) in sum.iter_mut().enumerate() {
                *s += square(pairs[p], k, i) / mean;
            }
        }
    }
    sums
}

/// Divides the flights into stretches and keeps those for which the first model has enough finite errors.
fn stretches(c: &Comparison) -> Vec<Stretch> {
    let mut found = Vec::new();
    for (flight, errors) in errors(c).iter().enumerate() {
        let time = &c.flights[flight].trace.time_s;
        let mut first = 0;
        while first < time.len() {
            let last = time[first] + STRETCH_S;
            let end = first + time[first..].iter().take_while(|t| **t < last).count().max(1);
            let own: Vec<f64> =
                errors[first..end].iter().copied().filter(|e| e.is_finite()).collect();
            // Excludes stretches that are mostly a gap, and a short remainder at the end of a flight.
            if time[end - 1] - time[first] > 0.5 * STRETCH_S && 2 * own.len() > end - first {
                let error = own.iter().sum::<f64>() / own.len() as f64;
                found.push(Stretch { flight, first, end, error });
            }
            first = end;
        }
    }
    found
}

fn figure(c: &Comparison, flight: usize, rows: std::ops::Range<usize>, most: usize) -> TimeFigure {
    let trace = &c.flights[flight].trace;
    let every = rows.len().div_ceil(most).max(1);
    let gap = |i: usize| trace.states.iter().all(|s| s.get(i).is_none_or(|v| v.is_nan()));
    // Rows of NaN are always kept, because they separate the line segments.
    let kept: Vec<usize> =
        rows.clone().filter(|i| (i - rows.start).is_multiple_of(every) || gap(*i)).collect();
    let take = |list: &[f64], factor: f64| -> Vec<f64> {
        kept.iter().map(|i| factor * list.get(*i).copied().unwrap_or(f64::NAN)).collect()
    };
    let panels = STATES.iter().enumerate().map(|(k, (title, unit, factor))| {
        let measured = Series::new("measured", Style::Measured, take(&trace.states[k], *factor));
        let mut series = vec![measured];
        for (i, model) in c.models.iter().enumerate() {
            if let Some(own) = model.traces.get(flight) {
                let values = take(&own.states[k], *factor);
                series.push(Series::new(&model.name, Style::nth(i), values));
            }
        }
        Panel::new(title, unit, series)
    });
    let mut figure = TimeFigure::default();
    // Gaps do not interrupt the lines, because thinned rows may be far apart. Rows of NaN separate the segments.
    figure.add_track(&take(&trace.time_s, 1.0), f64::INFINITY, panels.collect());
    if let (Some(first), Some(last)) =
        (trace.time_s.get(rows.start), trace.time_s.get(rows.end - 1))
    {
        add_channels(&mut figure, c, flight, [*first, *last], most);
    }
    if every > 1 {
        figure.notes.push(format!("One sample in {every} is drawn."));
    }
    figure
}

/// Adds one panel for each channel, which is a force or moment in weak form, between two times, s.
fn add_channels(
    figure: &mut TimeFigure,
    c: &Comparison,
    flight: usize,
    [from, to]: [f64; 2],
    most: usize,
) {
    let of = |id: ChannelId| -> Vec<(usize, &ChannelTrace)> {
        let traces = c.models.iter().map(|m| m.traces.get(flight));
        let own = traces.map(|t| t.and_then(|t| t.channels.iter().find(|t| t.channel == id)));
        own.enumerate().filter_map(|(i, t)| Some((i, t?))).collect()
    };
    // All channels of a flight have the same windows.
    let Some((_, any)) = ChannelId::ALL.into_iter().find_map(|id| of(id).first().copied()) else {
        return;
    };
    let rows = thinned(any, [from, to], most);
    let take = |list: &[f64]| -> Vec<f64> {
        rows.iter().map(|i| list.get(*i).copied().unwrap_or(f64::NAN)).collect()
    };
    let panel = |id: ChannelId| {
        let traces = of(id);
        let (_, first) = traces.first()?;
        let mut series = vec![Series::new("measured", Style::Measured, take(&first.measured))];
        for (i, trace) in &traces {
            series.push(Series::new(&c.models[*i].name, Style::nth(*i), take(&trace.predicted)));
        }
        Some(Panel::new(&channel_name(id), id.unit(), series))
    };
    let panels = ChannelId::ALL.into_iter().filter_map(panel).collect();
    figure.add_track(&take(&any.time_s), f64::INFINITY, panels);
}

/// Indices of the windows that are drawn between two times, s: every nth window, and all windows of NaN, which break the
/// curves.
fn thinned(trace: &ChannelTrace, [from, to]: [f64; 2], most: usize) -> Vec<usize> {
    let rows = 0..trace.time_s.len();
    let inside: Vec<usize> = rows.filter(|i| (from..=to).contains(&trace.time_s[*i])).collect();
    let every = inside.len().div_ceil(most).max(1);
    let drawn = |(k, i): &(usize, &usize)| k.is_multiple_of(every) || trace.measured[**i].is_nan();
    inside.iter().enumerate().filter(drawn).map(|(_, i)| *i).collect()
}

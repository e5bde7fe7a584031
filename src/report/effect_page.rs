//! Page about one effect: its entry in the catalogue of effects, and plots of its signature. The signature shows forces, moments
//! and motions of a model with and without the effect.

use super::{Align, Figure, Page, Section, Style, Table, XyFigure, XyMark, XySeries};
use greylag_physics::effects::Description;
use greylag_sysid::signature::{MANOEUVRE, Pair, Signature};

/// Contents of the page about one effect.
#[derive(Clone, Debug)]
pub struct EffectReport<'a> {
    /// Catalogue description of the effect.
    pub about: Description,
    /// Text that names the channels (components of force and moment) on which the effect acts.
    pub channels: String,
    /// What the effect acts on: aerodynamics and body, deflections, or measurements.
    pub place: &'static str,
    /// Signature of the effect; `None` for a measurement error.
    pub signature: Option<&'a Signature>,
    /// Name of the model for which the signature was computed.
    pub model: String,
    /// Values of the coefficients for the signature, in the order and the units of the effect's coefficients.
    pub values: Vec<f64>,
}

impl EffectReport<'_> {
    /// Builds the page about the effect.
    pub fn page(&self) -> Page {
        let mut sections =
            vec![Section::new("", "", vec![Figure::Table(self.facts())]), self.parameters()];
        if let Some(signature) = self.signature {
            let at = self.drawn_at();
            if !signature.sweeps.is_empty() {
                let note = format!(
                    "One quantity changes at a time, from level flight with a little of everything: {at}."
                );
                sections.push(Section::new(
                    "Along airflow and controls",
                    &note,
                    figures(&signature.sweeps),
                ));
            }
            let note = format!("{MANOEUVRE} The same commands with the effect and without, {at}.");
            sections.push(Section::new("In a manoeuvre", &note, figures(&signature.manoeuvre)));
        }
        Page {
            title: format!("Effect {}", self.about.id),
            subtitle: self.about.description.into(),
            sections,
        }
    }

    fn facts(&self) -> Table {
        let mut table = Table::new(
            "entry of the catalogue",
            &[("", Align::Left), (self.about.id, Align::Left)],
        );
        for [name, text] in facts(&self.about, self.place, &self.channels) {
            table.push([name, text]);
        }
        table
    }

    fn parameters(&self) -> Section {
        let columns = [
            ("parameter", Align::Left),
            ("what it is", Align::Left),
            ("unit", Align::Left),
            ("least", Align::Right),
            ("most", Align::Right),
        ];
        let mut table = Table::new("parameters with their physical bounds", &columns);
        for c in self.about.coefficients {
            let (low, high) = c.bounds;
            let cells = [c.name, c.meaning, c.unit].map(String::from);
            table.push(cells.into_iter().chain([low.to_string(), high.to_string()]));
        }
        Section::new("Parameters", "", vec![Figure::Table(table)])
    }

    fn drawn_at(&self) -> String {
        let each = self.about.coefficients.iter().zip(&self.values);
        let values: Vec<String> =
            each.map(|(c, v)| format!("{} = {v} {}", c.name, c.unit).trim_end().into()).collect();
        format!("model {}, {}", self.model, values.join(", "))
    }
}

/// Catalogue properties of an effect except its parameters, as pairs of name and text.
pub fn facts(about: &Description, place: &str, channels: &str) -> Vec<[String; 2]> {
    let mut rows = vec![
        ["what it is".into(), about.description.into()],
        ["acts on".into(), place.into()],
        ["formula".into(), about.formula.into()],
        ["source".into(), about.source.into()],
        ["channels".into(), channels.into()],
    ];
    if let Some(entry) = about.entry {
        rows.push(["easily mistaken for".into(), entry.look_alikes.join(", ")]);
        rows.push(["distinguished by".into(), entry.separated_by.into()]);
    }
    rows
}

fn figures(pairs: &[Pair]) -> Vec<Figure> {
    let line = |pair: &Pair, label: &str, style, y: &[f64]| XySeries {
        label: label.into(),
        style,
        mark: XyMark::Path,
        x: pair.x.clone(),
        y: y.to_vec(),
    };
    pairs
        .iter()
        .map(|pair| {
            let without = line(pair, "without the effect", Style::Measured, &pair.without);
            let with = line(pair, "with it", Style::Actual, &pair.with);
            let bare = |label: &str| label.split(',').next().unwrap_or_default().to_owned();
            Figure::Xy(XyFigure {
                bands: Vec::new(),
                title: format!("{} over {}", bare(pair.y_label), bare(pair.x_label)),
                x_label: pair.x_label.into(),
                y_label: pair.y_label.into(),
                series: vec![without, with],
            })
        })
        .collect()
}

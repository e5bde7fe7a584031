//! Edits the XML of an aircraft to write hidden effects into it.

use super::expression::{INPUT, product, property, sum, value};
use super::{FilterKind, HiddenError};
use crate::plant::Properties;

/// Property with the thrust that hidden effects add, lbf.
pub(crate) const THRUST_PROPERTY: &str = "hidden/thrust-lbs";

/// Properties of the engine's thrust and of the lagged thrust, both one frame old, lbf.
const THRUST_BEFORE: &str = "hidden/thrust-before-lbs";
const THRUST_LAGGED: &str = "hidden/thrust-lagged-lbs";

/// An axis of JSBSim's aerodynamics.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Axis {
    Drag,
    Side,
    Lift,
    Roll,
    Pitch,
    Yaw,
}

impl Axis {
    fn name(self) -> &'static str {
        match self {
            Axis::Drag => "DRAG",
            Axis::Side => "SIDE",
            Axis::Lift => "LIFT",
            Axis::Roll => "ROLL",
            Axis::Pitch => "PITCH",
            Axis::Yaw => "YAW",
        }
    }

    /// Property of the axis's reference length, ft.
    fn length(self) -> &'static str {
        if self == Axis::Pitch { "metrics/cbarw-ft" } else { "metrics/bw-ft" }
    }
}

#[derive(Clone, Copy)]
pub(super) enum Surface {
    Aileron,
    Elevator,
}

const SURFACES: [Surface; 2] = [Surface::Aileron, Surface::Elevator];

impl Surface {
    fn name(self) -> &'static str {
        match self {
            Surface::Aileron => "aileron",
            Surface::Elevator => "elevator",
        }
    }
}

/// An aircraft's XML document and the edits that `finish` still has to write.
pub(super) struct Document<'a> {
    xml: String,
    properties: &'a Properties,
    /// Length of a step, s.
    pub(super) step_s: f64,
    components: String,
    passed: usize,
    factors: Vec<String>,
    saturation: Option<f64>,
    thrust: Vec<String>,
    thrust_offset_ft: Option<f64>,
}

impl<'a> Document<'a> {
    pub(super) fn new(xml: &str, properties: &'a Properties, step_s: f64) -> Self {
        Document {
            xml: xml.to_owned(),
            properties,
            step_s,
            components: String::new(),
            passed: 0,
            factors: Vec::new(),
            saturation: None,
            thrust: Vec::new(),
            thrust_offset_ft: None,
        }
    }

    /// Property of the throttle position, as a JSBSim expression.
    pub(super) fn throttle(&self) -> String {
        property(&self.properties.throttle_position)
    }

    /// `expression` with its placeholders replaced by the properties of the positions.
    pub(super) fn with_positions(&self, expression: &str) -> String {
        expression
            .replace("{aileron}", &self.properties.aileron_position)
            .replace("{elevator}", &self.properties.elevator_position)
            .replace("{rudder}", &self.properties.rudder_position)
            .replace("{throttle}", &self.properties.throttle_position)
    }

    /// The deflection of `surface` after all effects, rad.
    pub(super) fn deflection(&self, surface: Surface) -> String {
        property(self.position(surface))
    }

    fn position(&self, surface: Surface) -> &'a str {
        match surface {
            Surface::Aileron => &self.properties.aileron_position,
            Surface::Elevator => &self.properties.elevator_position,
        }
    }

    pub(super) fn has(&self, text: &str) -> bool {
        self.xml.contains(text)
    }

    /// Adds the force ½ρV²S · `amplitude` · `terms`, lbf.
    pub(super) fn force(
        &mut self,
        axis: Axis,
        name: &str,
        amplitude: f64,
        terms: &[String],
    ) -> Done {
        let mut all =
            vec![property("aero/qbar-psf"), property("metrics/Sw-sqft"), value(amplitude)];
        all.extend_from_slice(terms);
        self.function(axis, name, &product(&all))
    }

    /// Adds the moment ½ρV²S · reference length · `amplitude` · `terms`, lbf ft.
    pub(super) fn moment(
        &mut self,
        axis: Axis,
        name: &str,
        amplitude: f64,
        terms: &[String],
    ) -> Done {
        let mut all = vec![property(axis.length())];
        all.extend_from_slice(terms);
        self.force(axis, name, amplitude, &all)
    }

    /// Adds a function to an axis, in lbf or lbf ft.
    pub(super) fn function(&mut self, axis: Axis, name: &str, expression: &str) -> Done {
        let end = self.axis(axis)?.end;
        let function = format!("<function name=\"hidden/{name}\">{expression}</function>\n");
        self.xml.insert_str(end, &function);
        Ok(())
    }

    /// Passes the deflections of aileron and elevator through a further flight-control component before they act.
    pub(super) fn pass_deflections(&mut self, component: &str, settings: &str) {
        self.pass_each([(component, settings); 2]);
    }

    /// The same with components of their own, each with its settings, for aileron and elevator in this order. [`INPUT`] in the
    /// settings stands for the property of the deflection that comes in.
    pub(super) fn pass_each(&mut self, components: [(&str, &str); 2]) {
        for (surface, (component, settings)) in SURFACES.into_iter().zip(components) {
            let (input, name) = (
                self.passed_name(surface, self.passed),
                self.passed_name(surface, self.passed + 1),
            );
            let settings = settings.replace(INPUT, &input);
            self.components += &format!(
                "<{component} name=\"{name}\"><input>{input}</input>{settings}</{component}>\n"
            );
        }
        self.passed += 1;
    }

    /// Adds a filter of `kind` from the expression `input` to the property `output`. `time_s` is its time constant or
    /// delay, s.
    pub(super) fn filter(
        &mut self,
        output: &str,
        input: &str,
        kind: FilterKind,
        time_s: f64,
    ) -> Done {
        self.components += &format!(
            "<fcs_function name=\"{output}-input\"><function>{input}</function></fcs_function>\n"
        );
        let (component, settings) = match kind {
            // a lag without a time constant is a unit gain
            FilterKind::Lag if time_s <= 0.0 => ("pure_gain", "<gain>1</gain>".to_owned()),
            FilterKind::Lag => ("lag_filter", format!("<c1>{}</c1>", 1.0 / time_s)),
            FilterKind::Delay => ("actuator", self.delay(time_s)?),
        };
        self.components += &format!(
            "<{component} name=\"{output}\"><input>{output}-input</input>{settings}</{component}>\n"
        );
        Ok(())
    }

    /// Settings of an actuator that delays by `time_s`, s, which must be a whole number of steps.
    pub(super) fn delay(&self, time_s: f64) -> Result<String, HiddenError> {
        let frames = (time_s / self.step_s).round();
        if frames < 1.0 || (time_s - frames * self.step_s).abs() > 1e-9 {
            return Err(HiddenError::Delay { amplitude: time_s, step_s: self.step_s });
        }
        // JSBSim's actuator delays by one frame less than its setting.
        Ok(format!("<delay type=\"frames\">{}</delay>", frames + 1.0))
    }

    /// Property of the deflection of `surface` after the first `passed` components.
    fn passed_name(&self, surface: Surface, passed: usize) -> String {
        match passed {
            0 => self.position(surface).to_owned(),
            _ => format!("hidden/{}-{passed}", surface.name()),
        }
    }

    /// Multiplies the deflections of aileron and elevator by `factor` where they act.
    pub(super) fn scale_deflections(&mut self, factor: String) {
        self.factors.push(factor);
    }

    /// Makes each deflection δ act as δ (1 + `cubic` δ²) in roll and in pitch.
    pub(super) fn saturate(&mut self, cubic: f64) {
        self.saturation = Some(cubic);
    }

    /// Adds a force along the body x axis, lbf.
    pub(super) fn add_thrust(&mut self, expression: String) {
        self.thrust.push(expression);
    }

    /// Lets the thrust act through a first-order lag with the time constant `constant`, s.
    pub(super) fn lag_thrust(&mut self, constant: f64) {
        let thrust = property("propulsion/engine/thrust-lbs");
        // flight controls are evaluated before the engines: both components hold the value of the previous frame
        for (component, name, settings) in [
            ("pure_gain", THRUST_BEFORE, "<gain>1</gain>".to_owned()),
            ("lag_filter", THRUST_LAGGED, format!("<c1>{}</c1>", 1.0 / constant)),
        ] {
            self.components += &format!(
                "<{component} name=\"{name}\"><input>propulsion/engine/thrust-lbs</input>{settings}</{component}>\n"
            );
        }
        let (step, double) = (self.step_s, 2.0 * constant);
        let gain = value(step / (double + step));
        let keep = value((double - step) / (double + step));
        self.add_thrust(product(&[gain.clone(), thrust.clone()]));
        self.add_thrust(product(&[gain, property(THRUST_BEFORE)]));
        self.add_thrust(product(&[keep, property(THRUST_LAGGED)]));
        self.add_thrust(product(&[value(-1.0), thrust]));
    }

    /// Lets the whole thrust act `arm_ft`, ft, below the centre of gravity.
    pub(super) fn offset_thrust(&mut self, arm_ft: f64) {
        self.thrust_offset_ft = Some(arm_ft);
    }

    /// Moves the centre of gravity aft by `aft`, m.
    pub(super) fn shift_cg(&mut self, aft: f64) -> Done {
        let place =
            || HiddenError::Place { place: "<location name=\"CG\"> with an <x>".to_owned() };
        let at = self.xml.find("name=\"CG\"").ok_or_else(place)?;
        let tag = self.xml[at..].find('>').ok_or_else(place)? + at;
        let unit = self.xml[at..tag].to_owned();
        let per_metre = match () {
            () if unit.contains("\"M\"") => 1.0,
            () if unit.contains("\"FT\"") => 1.0 / 0.3048,
            () => 1.0 / 0.0254,
        };
        self.change_after(tag, "x", |x, _| x + aft * per_metre)
    }

    /// Replaces the number in the first element `name` by the result of `new`, which gets that number and the opening tag.
    pub(super) fn change(&mut self, name: &str, new: impl Fn(f64, &str) -> f64) -> Done {
        self.change_after(0, name, new)
    }

    fn change_after(&mut self, from: usize, name: &str, new: impl Fn(f64, &str) -> f64) -> Done {
        let place = || HiddenError::Place { place: format!("a number in <{name}>") };
        let tag = self.find_tag(from, name).ok_or_else(place)?;
        let open = self.xml[tag..].find('>').ok_or_else(place)? + tag + 1;
        let close = self.xml[open..].find('<').ok_or_else(place)? + open;
        let number: f64 = self.xml[open..close].trim().parse().map_err(|_| place())?;
        let changed = new(number, &self.xml[tag..open]);
        self.xml.replace_range(open..close, &format!(" {changed} "));
        Ok(())
    }

    /// Byte offset of the first tag `<name` at or after `from`.
    fn find_tag(&self, from: usize, name: &str) -> Option<usize> {
        let tag = format!("<{name}");
        self.xml[from..]
            .match_indices(&tag)
            .map(|(at, _)| at + from)
            .find(|at| self.xml[at + tag.len()..].starts_with([' ', '>', '\t', '\n', '\r']))
    }

    /// Byte range of an aerodynamic axis without its end tag.
    fn axis(&self, axis: Axis) -> Result<std::ops::Range<usize>, HiddenError> {
        let name = format!("<axis name=\"{}\"", axis.name());
        let place = || HiddenError::Place { place: format!("{name}>") };
        let start = self.xml.find(&name).ok_or_else(place)?;
        let length = self.xml[start..].find("</axis>").ok_or_else(place)?;
        Ok(start..start + length)
    }

    /// Writes the pending edits and returns the document.
    pub(super) fn finish(mut self) -> Result<String, HiddenError> {
        self.write_thrust()?;
        if !self.components.is_empty() {
            let channel = format!("<channel name=\"hidden\">\n{}</channel>\n", self.components);
            self.insert_before("</flight_control>", &channel)?;
        }
        for surface in SURFACES {
            self.write_deflection(surface)?;
        }
        Ok(self.xml)
    }

    fn write_thrust(&mut self) -> Done {
        let mut whole = vec![property("propulsion/engine/thrust-lbs")];
        if !self.thrust.is_empty() {
            whole.push(property(THRUST_PROPERTY));
            let force = format!(
                "<external_reactions><force name=\"hidden_thrust\" frame=\"BODY\">\
                 <function name=\"{THRUST_PROPERTY}\">{}</function>\
                 <location unit=\"IN\"><x>0</x><y>0</y><z>0</z></location>\
                 <direction><x>1</x><y>0</y><z>0</z></direction></force></external_reactions>\n",
                sum(&self.thrust)
            );
            self.insert_before("</fdm_config>", &force)?;
        }
        let Some(arm) = self.thrust_offset_ft else {
            return Ok(());
        };
        self.function(Axis::Pitch, "thrust-line-offset", &product(&[value(arm), sum(&whole)]))
    }

    /// Makes the aerodynamics read the deflection of `surface` after all effects.
    fn write_deflection(&mut self, surface: Surface) -> Done {
        let mut name = self.passed_name(surface, self.passed);
        let mut functions = String::new();
        if !self.factors.is_empty() {
            let scaled = format!("hidden/{}-scaled", surface.name());
            let terms = [vec![property(&name)], self.factors.clone()].concat();
            functions += &format!("<function name=\"{scaled}\">{}</function>\n", product(&terms));
            name = scaled;
        }
        if let Some(cubic) = self.saturation {
            let saturated = format!("hidden/{}-saturated", surface.name());
            let square = product(&[value(cubic), property(&name), property(&name)]);
            let terms = [property(&name), sum(&[value(1.0), square])];
            functions +=
                &format!("<function name=\"{saturated}\">{}</function>\n", product(&terms));
            for axis in [Axis::Roll, Axis::Pitch] {
                let range = self.axis(axis)?;
                self.rename(range, self.position(surface), &saturated);
            }
        }
        let (start, end) = self.aerodynamics()?;
        self.rename(start..end, self.position(surface), &name);
        self.xml.insert_str(start, &functions);
        Ok(())
    }

    /// Byte offsets at which the content of `<aerodynamics>` begins and ends.
    fn aerodynamics(&self) -> Result<(usize, usize), HiddenError> {
        let place = || HiddenError::Place { place: "<aerodynamics>".to_owned() };
        let tag = self.find_tag(0, "aerodynamics").ok_or_else(place)?;
        let start = self.xml[tag..].find('>').ok_or_else(place)? + tag + 1;
        let end = self.xml[start..].find("</aerodynamics>").ok_or_else(place)? + start;
        Ok((start, end))
    }

    /// Renames a property within `range`, whole names only.
    fn rename(&mut self, range: std::ops::Range<usize>, from: &str, to: &str) {
        let part = |c: char| c.is_ascii_alphanumeric() || "_-/[]".contains(c);
        let old = &self.xml[range.clone()];
        let mut new = String::with_capacity(old.len());
        let mut rest = old;
        while let Some(at) = rest.find(from) {
            let (before, after) = (&rest[..at], &rest[at + from.len()..]);
            let alone = !before.ends_with(part) && !after.starts_with(part);
            new += before;
            new += if alone { to } else { from };
            rest = after;
        }
        new += rest;
        self.xml.replace_range(range, &new);
    }

    fn insert_before(&mut self, tag: &str, text: &str) -> Done {
        let place = || HiddenError::Place { place: tag.to_owned() };
        let at = self.xml.rfind(tag).ok_or_else(place)?;
        self.xml.insert_str(at, text);
        Ok(())
    }
}

type Done = Result<(), HiddenError>;

//! HTML page of the failsafe scenarios: the form and the result.

use super::choices::{
    FAULTS, NOTHING, REQUESTS, TURBULENCE, controllers, counterpart, fault, file_name,
};
use super::form::{Form, NUMBERS, Wrong};
use greylag_report::escape;
use greylag_sim::faults::{Counterpart, FaultKind};

/// Example scenarios: the name, and the fields that differ from the defaults.
const EXAMPLES: [(&str, &str); 8] = [
    ("Link cut in a turn", ""),
    ("Client dies", "fault=client&for_s=8&request=none"),
    ("Companion killed", "fault=killed&for_s=10&at_s=35"),
    (
        "Companion killed, radio bound",
        "counterpart=ardupilot&radio=yes&fault=killed&for_s=10&request=none",
    ),
    ("Station takes over", "fault=none&request=take-over"),
    ("Half of the frames corrupted", "fault=corruption&for_s=2&pitch_deg=-16&wind_mps=7"),
    (
        "Airspeed blocked in a turn",
        "counterpart=px4-attitude&fault=airspeed&for_s=7&strength=65&request=none&roll_deg=-53&pitch_deg=9&wind_mps=8&wind_from_deg=251&turbulence=3&seed=2",
    ),
    ("Disarm in the air", "counterpart=sitl&fault=none&request=disarm"),
];

/// The page with the values of `form` and the HTML `shown` of the result. The field that `wrong` names is marked as invalid.
pub(super) fn render(form: &Form, wrong: Option<&Wrong>, shown: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Failsafes: Greylag workbench</title>\n<link rel=\"icon\" href=\"data:,\">\n\
         <link rel=\"stylesheet\" href=\"/assets/workbench.css\">\n\
         <link rel=\"stylesheet\" href=\"/assets/failsafes.css\">\n\
         <script type=\"module\" src=\"/assets/failsafes.js\"></script>\n</head>\n<body>\n\
         <header class=\"bar\"><h1>Greylag workbench</h1>\
         <p class=\"about\">Failsafes: every choice is flown by the pilot that flies the aircraft</p>\
         <a class=\"elsewhere\" href=\"/\">Workbench</a>\
         <button type=\"button\" id=\"theme\">Light or dark</button></header>\n\
         <main class=\"failsafes\">\n{}\n\
         <section class=\"pane\" id=\"flown\" aria-labelledby=\"flown-title\">\
         <h2 id=\"flown-title\">What happens</h2><div class=\"body\">\n{shown}</div></section>\n\
         <p id=\"heard\" aria-live=\"polite\"></p>\n</main>\n</body>\n</html>\n",
        choices(form, wrong)
    )
}

/// HTML in place of the result if a value is invalid.
pub(super) fn refused(wrong: &Wrong) -> String {
    let (field, why) = (wrong.field, escape(&wrong.why));
    format!(
        "<p class=\"bad\" role=\"alert\" id=\"wrong\" data-field=\"{field}\">Not flown: {why}</p>\n"
    )
}

/// HTML in place of the result if the flight fails.
pub(super) fn failed(why: &str) -> String {
    format!("<p class=\"bad\" role=\"alert\" id=\"wrong\">Cannot fly: {}</p>\n", escape(why))
}

fn choices(form: &Form, wrong: Option<&Wrong>) -> String {
    let field = |name: &str, label: &str| number(form, name, label, wrong);
    let controllers: Vec<_> = controllers().map(|kind| (kind.name(), kind.name())).collect();
    let who = [
        group(
            "counterpart",
            "Flight controller",
            &Counterpart::ALL.map(|c| (c.name(), counterpart(c))),
            form,
        ),
        group("radio", "Radio", &[("no", "none"), ("yes", "bound, sticks released")], form),
        select("controller", "Companion's controller", form, &controllers, wrong),
        select("mode", "Companion's mode", form, &MODES, wrong),
    ];
    let fault = [
        faults(form, wrong),
        field("from_s", "From (s)"),
        field("for_s", "For (s)"),
        field("strength", "Strength (%)"),
    ];
    let asked = [
        select("request", "Request", form, &REQUESTS, wrong),
        field("at_s", "At (s)"),
        field("roll_deg", "Roll (°)"),
        field("pitch_deg", "Pitch (°)"),
    ];
    let air = [
        field("wind_mps", "Wind (m/s)"),
        field("wind_from_deg", "Wind from (°)"),
        select("turbulence", "Turbulence", form, &TURBULENCE, wrong),
        field("seed", "Seed"),
    ];
    let part = |legend: &str, fields: &[String]| {
        format!("<fieldset><legend>{legend}</legend>{}</fieldset>\n", fields.concat())
    };
    format!(
        "<section class=\"pane\" aria-labelledby=\"choices-title\"><h2 id=\"choices-title\">Choices</h2><div class=\"body\">\n\
         {}<form id=\"choices\" action=\"/failsafes\" method=\"get\">\n{}{}{}{}\
         <div class=\"row\"><button class=\"main\" type=\"submit\">Fly it</button></div>\n<p class=\"note\">{NOTE}</p>\n</form></div></section>",
        examples(),
        part("Who flies", &who),
        part("What goes wrong", &fault),
        part("What the client asks for", &asked),
        part("Air and chance", &air),
    )
}

/// Conditions of every flight of the page.
const NOTE: &str = "60 s of the X8 as shipped. The attitude is asked for from 8 to 45 s; level before and after. The flight \
                    controllers are simulated: their modes, time-outs and rules, not their firmware.";

fn examples() -> String {
    let one = |(name, query): &(&str, &str)| {
        format!("<li><a href=\"/failsafes?{}\">{}</a></li>", escape(query), escape(name))
    };
    let all: String = EXAMPLES.iter().map(one).collect();
    format!("<nav aria-label=\"Examples\"><ul class=\"examples\">{all}</ul></nav>\n")
}

const MODES: [(&str, &str); 2] = [("offboard", "OFFBOARD"), ("hold", "HOLD")];

/// A selection field with `options`, which are pairs of value and displayed text.
fn select(
    name: &str,
    label: &str,
    form: &Form,
    options: &[(&str, &str)],
    wrong: Option<&Wrong>,
) -> String {
    let option = |(value, words): &(&str, &str)| {
        let selected = if form.value(name) == *value { " selected" } else { "" };
        format!("<option value=\"{value}\"{selected}>{}</option>", escape(words))
    };
    let options: String = options.iter().map(option).collect();
    let state = state(name, wrong);
    format!(
        "<label><span>{label}</span><select id=\"{name}\" name=\"{name}\"{state}>{options}</select></label>"
    )
}

/// The field `fault` with its options. Each option states whether the fault has a length and a strength, and describes it.
fn faults(form: &Form, wrong: Option<&Wrong>) -> String {
    let chosen = form.value("fault");
    let nothing = if chosen == NOTHING { " selected" } else { "" };
    let option = |kind: &FaultKind| {
        let (words, note) = fault(*kind);
        let value = file_name(*kind);
        let selected = if chosen == value { " selected" } else { "" };
        let has = |what: &str, has: bool| if has { format!(" data-{what}") } else { String::new() };
        format!(
            "<option value=\"{value}\" data-note=\"{}\"{}{}{selected}>{}</option>",
            escape(note),
            has("length", kind.has_length()),
            has("strength", kind.has_strength()),
            escape(words)
        )
    };
    let options: String = FAULTS.iter().map(option).collect();
    let note = FAULTS.iter().find(|kind| file_name(**kind) == chosen).map_or("", |k| fault(*k).1);
    format!(
        "<label><span>Fault</span><select id=\"fault\" name=\"fault\" aria-describedby=\"fault-note\"{}>\
         <option value=\"{NOTHING}\"{nothing}>Nothing</option>{options}</select></label>\
         <p class=\"note\" id=\"fault-note\">{}</p>",
        state("fault", wrong),
        escape(note)
    )
}

fn number(form: &Form, name: &str, label: &str, wrong: Option<&Wrong>) -> String {
    let value = escape(form.value(name));
    let limits = NUMBERS.iter().find(|n| n.field == name).map_or([0.0; 2], |n| n.limits);
    let [least, most] = limits;
    let state = state(name, wrong);
    format!(
        "<label title=\"{least} to {most}\"><span>{label}</span><input id=\"{name}\" name=\"{name}\" inputmode=\"decimal\" size=\"6\" autocomplete=\"off\" value=\"{value}\"{state}></label>"
    )
}

/// A group of radio buttons.
fn group(name: &str, legend: &str, options: &[(&str, &str)], form: &Form) -> String {
    let option = |(value, words): &(&str, &str)| {
        let checked = if form.value(name) == *value { " checked" } else { "" };
        format!(
            "<label><input type=\"radio\" name=\"{name}\" value=\"{value}\"{checked}>{}</label>",
            escape(words)
        )
    };
    let options: String = options.iter().map(option).collect();
    format!(
        "<fieldset class=\"pick\" data-field=\"{name}\"><legend>{legend}</legend>{options}</fieldset>"
    )
}

/// HTML attribute that marks an invalid field.
fn state(name: &str, wrong: Option<&Wrong>) -> &'static str {
    match wrong.is_some_and(|w| w.field == name) {
        true => " aria-invalid=\"true\"",
        false => "",
    }
}

//! Result of a failsafe flight as HTML: verdict, time lines, texts, rules, and the command for the scenario. In a failsafe
//! flight, a simulated vehicle, companion and client meet the faults of a scenario. The rules are requirements on the flight.

use super::Flown;
use super::verdict::Happened;
use greylag_control::ControllerKind;
use greylag_report::{TimeLine, escape};
use greylag_sim::faults::policies::Policy;

/// Name of the scenario file in the command.
const FILE: &str = "scenario.json";

/// A rule whose distance from being broken is at least this counts as far from broken. The largest distance is 1.
const FAR: f64 = 0.9995;

/// The result of the flight `flown` as HTML.
pub(super) fn html(flown: &Flown) -> String {
    let close_up = flown.close_up().as_ref().map_or_else(String::new, TimeLine::html);
    format!(
        "<p class=\"verdict {}\">{}</p>\n{close_up}{}{KEY}<div class=\"two\">{}{}</div>{}",
        flown.standing(),
        escape(&flown.sentence()),
        flown.time_line().html(),
        events(flown),
        rules(flown),
        again(flown)
    )
}

/// Legend of the bands' colours, as HTML.
const KEY: &str = "<ul class=\"tones\"><li><i class=\"tone-asked\"></i>flies what is asked</li>\
                   <li><i class=\"tone-safe\"></i>flies level without a command</li><li><i class=\"tone-begins\"></i>on the way, or a failsafe's mode</li>\
                   <li><i class=\"tone-wrong\"></i>fault, failsafe</li><li><i class=\"tone-idle\"></i>does nothing</li></ul>\n";

fn events(flown: &Flown) -> String {
    let stack = flown.scenario.counterpart.stack();
    let row = |event: &Happened| {
        let Happened { at_s, who, what } = event;
        format!(
            "<tr><td class=\"number\">{at_s:.2}</td><td>{}</td><td>{}</td></tr>\n",
            escape(who.name(stack)),
            escape(what)
        )
    };
    let rows: String = flown.events().iter().map(row).collect();
    format!(
        "<section><h3>What happened and what was said</h3><div class=\"scroll\"><table class=\"events\" id=\"events\"><thead><tr>\
         <th scope=\"col\" class=\"number\">s</th><th scope=\"col\">Who</th><th scope=\"col\">What</th></tr></thead>\n<tbody>{rows}</tbody></table></div></section>\n"
    )
}

/// The applicable rules with their smallest distances, in order of increasing distance, as HTML.
fn rules(flown: &Flown) -> String {
    let judged = flown.rules.iter().zip(&flown.judged);
    let mut judged: Vec<(&Policy, f64, f64)> =
        judged.filter_map(|(rule, d)| d.map(|(distance, at_s)| (rule, distance, at_s))).collect();
    judged.sort_by(|a, b| a.1.total_cmp(&b.1));
    let row = |(rule, distance, at_s): &(&Policy, f64, f64)| {
        let (class, word) = if *distance < 0.0 { ("bad", "broken") } else { ("good", "held") };
        format!(
            "<tr><td class=\"{class}\">{word}</td><td class=\"number\">{}</td><td class=\"number\">{at_s:.2}</td><td><b>{}</b>: {}</td></tr>\n",
            format!("{distance:.3}").replace('-', "−"),
            escape(rule.id),
            escape(rule.asks)
        )
    };
    let near = judged.iter().take_while(|(_, distance, _)| *distance < FAR).count();
    let table = |id: &str, judged: &[(&Policy, f64, f64)]| {
        let rows: String = judged.iter().map(row).collect();
        format!(
            "<div class=\"scroll\"><table class=\"events\" id=\"{id}\"><thead><tr><th scope=\"col\">Rule</th><th scope=\"col\" \
             class=\"number\">Distance</th><th scope=\"col\" class=\"number\">s</th><th scope=\"col\">It asks</th></tr></thead>\n<tbody>{rows}</tbody></table></div>"
        )
    };
    let far = judged.len() - near;
    format!(
        "<section><h3>Rules of flight, the nearest to being broken first</h3>{}\
         <p class=\"note\">Distance: 1 is far from broken, below 0 it is broken.</p>\
         <details><summary>{far} rules that nothing came near</summary>{}</details></section>\n",
        table("rules", &judged[..near]),
        table("far", &judged[near..])
    )
}

/// The command that repeats the flight.
pub(super) fn command(controller: ControllerKind) -> String {
    format!("greylag faults --controller {} --scenario {FILE}", controller.name())
}

/// The content of the scenario file and the command that repeats the flight, as HTML.
fn again(flown: &Flown) -> String {
    // serialisation of numbers and names does not fail
    let json = serde_json::to_string_pretty(&flown.scenario).unwrap_or_default();
    let command = command(flown.controller);
    format!(
        "<details class=\"command\"><summary>The same flight on the command line</summary>\
         <p class=\"note\">Write this to {FILE}, then:</p><code id=\"command\">{}</code>\
         <pre id=\"scenario\" tabindex=\"0\" aria-label=\"{FILE}\">{}</pre></details>\n",
        escape(&command),
        escape(&json)
    )
}

//! The report of a diagnosis as a file: the story in order, in words as well as in figures, with input made to break it.

use std::collections::BTreeMap;

use crate::report_comparison;
use crate::report_diagnosis;
use greylag::report::{DiagnosisReport, Figure, Page, Probabilities};
use greylag::sysid::compare::{Answer, Comparison};
use greylag::sysid::diagnose::{Diagnosis, Explained, Explanation, Verdict};
use serde_json::Value;

fn report<'a>(d: &'a Diagnosis, both: Option<[&'a Comparison; 2]>) -> DiagnosisReport<'a> {
    DiagnosisReport {
        title: "What the model lacks".into(),
        diagnosis: d,
        answer: None,
        failing: both.map(|b| b[0]),
        held_out: both.map(|b| b[1]),
        model_file: "prior.toml".into(),
        effect_files: BTreeMap::from([("lift_alpha2".to_owned(), "effects/mine.toml".to_owned())]),
        log_files: vec!["train-1.csv".into(), "train-2.csv".into(), "train-3.ulg".into()],
        command_line: "greylag diagnose".into(),
        versions: Vec::new(),
    }
}

fn page(d: &Diagnosis) -> Page {
    report(d, None).page()
}

/// With both comparisons.
fn whole(d: &Diagnosis) -> String {
    let failing = report_comparison::comparison(60.0);
    let held_out = report_diagnosis::held_out(report_comparison::comparison(60.0));
    report(d, Some([&failing, &held_out])).page().render()
}

/// The data of the plots, as a browser would read it.
fn figures(html: &str) -> Vec<Value> {
    let (_, rest) = html.split_once("id=\"figures\">").expect("the page has data");
    let (json, _) = rest.split_once("</script>").expect("the data ends");
    serde_json::from_str(json).expect("the data is JSON")
}

/// The page's text without its marks, style and data, as who cannot see figures reads it.
fn text(html: &str) -> String {
    let (_, main) = html.split_once("<main>").expect("the page has a body");
    let (main, _) = main.split_once("</main>").expect("the body ends");
    main.split('<')
        .filter_map(|part| part.split_once('>'))
        .map(|(_, text)| text)
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn the_story_stands_in_order_and_loads_nothing() {
    let html = whole(&report_diagnosis::diagnosis());
    let own = html.replace(include_str!("../../src/report/kit/assets/uPlot.iife.min.js"), "");
    for foreign in ["http:", "https:", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
        assert!(!own.contains(foreign), "the page holds {foreign}");
    }
    // Three curves of at most 1500 points and a comparison's growth: far from a megabyte.
    assert!(html.len() < 600_000, "the page has {} bytes", html.len());
    let order = [
        "The effect",
        "Where it fails",
        "Suspects",
        "Do the flights agree?",
        "What chance reaches",
        "Before and after",
        "What to fly next",
        "What could not have been seen",
        "Tuned coefficients",
        "Sensors and wind",
        "Every candidate",
        "Notes",
        "Provenance",
    ];
    let places: Vec<usize> = order
        .iter()
        .map(|t| html.find(&format!("<h2>{t}</h2>")).unwrap_or_else(|| panic!("no section {t}")))
        .collect();
    assert!(places.is_sorted(), "{places:?}");
}

#[test]
fn who_reads_the_words_alone_misses_nothing() {
    let said = text(&whole(&report_diagnosis::diagnosis()));
    for words in [
        // The sentence, with the evidence and what chance reaches.
        "The model lacks lift_stall",
        "143, chance 12.4",
        // The look-alike, and what separates the two.
        "Asserted: lift_stall or a look-alike",
        "greylag design --model prior.toml --between lift_stall effects/mine.toml",
        // Why the third is refused; what chance reached; the strongest decoy.
        "refused: the flights disagree",
        "The strongest reached 13.1",
        "lift_stall reversed in time",
        // Parameters, all and by flight: 0.262 ± 0.006, 0.5 half widths higher in the first.
        "0.256 to 0.268",
        "0.265 (",
        // Before and after: 0.5 × 0.3 to 0.35 × 0.3 at 5 s.
        "falls by 30 % from “prior, tuned” to “prior, tuned, with lift_stall”",
        // 4.02 + 2.6 × 0.15 × 4.02.
        "4.02 → 5.59 ± 0.236",
        "1 of 8 moved by more than two standard deviations",
        // A bias in degrees; a smallest amount; what is left to learn.
        "0.997",
        "Not seen below",
        "could still remove 8 %",
    ] {
        assert!(said.contains(words), "the page does not say {words:?}");
    }
}

#[test]
fn sentences_lead_to_the_curve_of_the_effect_they_name() {
    let d = report_diagnosis::diagnosis();
    let page = page(&d);
    let Figure::Findings(found) = &page.sections[0].figures[0] else {
        panic!("the page starts with {:?}", page.sections[0].figures[0]);
    };
    assert_eq!(found.lead[0].sentence, d.sentences[0]);
    let link = found.lead[0].link.as_ref().expect("the stall has a curve");
    assert_eq!(link.option, "lift_stall");
    let html = page.render();
    assert!(html.contains(&format!("id=\"{}\"", link.anchor)), "the link leads nowhere");
    assert!(html.contains("<div class=\"option\" data-option=\"lift_stall\">"));
    // "All else in the catalogue" names none.
    assert!(found.rest.last().unwrap().link.is_none());
}

#[test]
fn the_curve_lies_in_its_interval_over_the_measured_scatter() {
    let d = report_diagnosis::diagnosis();
    let figures = figures(&page(&d).render());
    let xy: Vec<&Value> =
        figures.iter().filter(|f| f["kind"] == "xy").map(|f| &f["data"]).collect();
    // The stall, its look-alike and the refused one.
    assert_eq!(xy.len(), 3);
    let curve = d.effects[0].curve.as_ref().unwrap();
    let (band, scatter, line) = (&xy[0]["bands"][0], &xy[0]["series"][0], &xy[0]["series"][1]);
    assert_eq!((&scatter["mark"], &line["mark"]), (&"dots".into(), &"line".into()));
    // 1950 windows: every second one is drawn.
    assert_eq!(scatter["x"].as_array().unwrap().len(), 975);
    let at = |list: &Value, i: usize| list[i].as_f64().unwrap();
    for i in 0..curve.at.len() {
        assert!(
            at(&band["low"], i) < at(&line["y"], i) && at(&line["y"], i) < at(&band["high"], i)
        );
        assert!((at(&line["y"], i) - curve.contribution[i][0]).abs() < 1e-4 * 30.0);
    }
}

#[test]
fn chance_is_counted_with_the_suspect_marked() {
    let figures = figures(&page(&report_diagnosis::diagnosis()).render());
    let chance = figures.iter().find(|f| f["kind"] == "histogram").unwrap();
    let counts: u64 =
        chance["data"]["counts"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    // Of 100 flights, those under a tenth are not drawn: 13.5 x^2.2 − 0.4 is one from x = 0.226 on.
    assert_eq!(counts, 77);
    let rules = chance["data"]["rules"].as_array().unwrap();
    let of = |label: &str| {
        rules.iter().find(|r| r["label"] == label).unwrap()["value"].as_f64().unwrap()
    };
    assert_eq!([of("lift_stall"), of("threshold"), of("best decoy")], [143.0, 12.4, 7.5]);
}

/// The figure of the probabilities; `None` if the page has none.
fn probabilities(page: &Page) -> Option<&Probabilities> {
    let mut figures = page.sections.iter().flat_map(|s| &s.figures);
    figures.find_map(|figure| match figure {
        Figure::Probabilities(found) => Some(found),
        _ => None,
    })
}

/// The most probable explanation comes first. Without explanations, as with the verdict "unknown", there is no figure.
#[test]
fn the_probable_explanations_stand_beside_the_suspects() {
    let mut d = report_diagnosis::diagnosis();
    let html = page(&d).render();
    let (_, suspects) = html.split_once("<h2>Suspects</h2>").unwrap();
    let (suspects, _) = suspects.split_once("</section>").unwrap();
    let places = [
        "How probable each explanation is",
        "<dt>lift_stall</dt>",
        ">93 %<",
        "<dt>nothing is missing that these flights could show</dt>",
        ">6 %<",
        "Evidence against chance",
    ]
    .map(|part| suspects.find(part).unwrap_or_else(|| panic!("no {part}")));
    assert!(places.is_sorted(), "{places:?}");
    // 0.4 % is below the limit of 0.5 %
    assert!(!suspects.contains("something that the catalogue lacks"));
    d.explanations.clear();
    assert!(probabilities(&page(&d)).is_none());
}

#[test]
fn the_workbench_words_the_probabilities_like_the_page() {
    let script = include_str!("../../src/workbench/assets/suspects.js");
    let page = page(&report_diagnosis::diagnosis());
    let figure = probabilities(&page).expect("the page has probabilities");
    let kinds = [Explained::Nothing, Explained::OtherEffect, Explained::Unknown];
    let of = |kind| Explanation { id: String::new(), kind, probability: 0.5 };
    let phrases = kinds.map(|kind| of(kind).words().to_string());
    for words in [&figure.title, &figure.note].into_iter().chain(&phrases) {
        assert!(script.contains(&format!("\"{words}\"")), "the workbench does not say {words:?}");
    }
}

#[test]
fn hostile_text_stays_text() {
    let hostile = "</script><script>alert(1)</script><!-- \"' & <b>\u{0}";
    let mut d = report_diagnosis::diagnosis();
    d.model = hostile.into();
    d.sentences = vec![hostile.into(); 4];
    d.notes = vec![hostile.into()];
    for c in &mut d.effects {
        c.id = hostile.into();
        c.refused = vec![hostile.into()];
        c.channels = vec![hostile.into()];
        c.indistinguishable_from = vec![hostile.into()];
        for p in &mut c.parameters {
            (p.name, p.unit) = (hostile.into(), hostile.into());
            p.by_flight.iter_mut().for_each(|f| f.flight = hostile.into());
        }
        c.by_flight.iter_mut().for_each(|f| f.flight = hostile.into());
        for curve in c.curve.iter_mut() {
            (curve.channel, curve.variable, curve.unit) =
                (hostile.into(), hostile.into(), hostile.into());
        }
    }
    d.explanations.iter_mut().for_each(|e| e.id = hostile.into());
    d.tuned.iter_mut().for_each(|t| t.name = hostile.into());
    d.decoys.iter_mut().for_each(|x| x.name = hostile.into());
    d.channels.iter_mut().for_each(|c| c.channel = hostile.into());
    d.measurement.iter_mut().for_each(|m| (m.flight, m.unit) = (hostile.into(), hostile.into()));
    for a in &mut d.advice {
        (a.manoeuvre, a.why) = (hostile.into(), hostile.into());
        a.between = Some([hostile.into(), hostile.into()]);
    }
    d.settings.without = vec![hostile.into()];
    let mut report = report(&d, None);
    (report.title, report.model_file) = (hostile.into(), hostile.into());
    let html = report.page().render();
    assert!(!html.contains("<script>alert") && !html.contains("<b>"));
    figures(&html);
}

/// The channel and the variable of the effect, with what tuning and the effect leave; where nothing is asserted, that is
/// said first, and no suspect stands under the heading of a found effect.
#[test]
fn the_box_says_where_the_tuned_model_fails() {
    let answer = Answer::nothing().with_effect("Nothing is missing here.".into());
    let said = |d: &Diagnosis| {
        let report = DiagnosisReport { answer: Some(&answer), ..report(d, None) };
        text(&report.page().render())
    };
    let mut d = report_diagnosis::diagnosis();
    let found = said(&d);
    assert!(
        found.contains("Where it fails: lift, with angle of attack (tuned 18.2 % unexplained"),
        "{found}"
    );
    assert!(found.contains("unexplained, with lift_stall 1.60 %"), "{found}");
    assert!(found.find(&answer.error) < found.find(&answer.effect));
    // an answer that names both channels of the effect is not repeated by the box, and the first figure names both as well
    let acts = "lift_stall acts in lift (unexplained: 18.2 % tuned by equation error, 1.6 % with it) and in drag less thrust \
                (unexplained: 9 % tuned by equation error, 2 % with it).";
    let both = Answer { acts: acts.into(), ..answer.clone() };
    let page = text(&DiagnosisReport { answer: Some(&both), ..report(&d, None) }.page().render());
    assert!(page.contains("Its curve: lift over angle of attack."), "{page}");
    assert!(!page.contains("Where it fails: lift") && page.matches(acts).count() == 2, "{page}");

    d.verdict = Verdict::Adequate;
    d.effects.iter_mut().for_each(|c| c.asserted = false);
    let none = said(&d);
    assert!(
        none.contains("nowhere clearly; 18.2 % of lift is the most left after tuning"),
        "{none}"
    );
    assert!(none.find(&answer.effect) < none.find(&answer.error));
    assert!(none.contains("Nearest suspects, none proven"));
    assert!(none.contains("Worst regime") && !none.contains("has no curve"));

    // the figures begin with the candidate that the answer calls the nearest, and an empty table is not drawn
    d.effects[0].curve = None;
    for channel in &mut d.channels {
        (channel.worst_regime, channel.left_with) = (None, None);
    }
    let none = said(&d);
    let nearest = format!("{}, the nearest, has no curve", d.effects[0].id);
    assert!(none.contains(&nearest) && !none.contains("Worst regime"), "{none}");
}

/// The table of the tuned model states the share that the bars state. The comparison alone has 11 % of lift in its first model.
#[test]
fn the_table_and_the_bars_state_the_same_share() {
    let d = report_diagnosis::diagnosis();
    let failing = report_comparison::comparison(60.0);
    let held_out = report_diagnosis::held_out(report_comparison::comparison(60.0));
    let page = report(&d, Some([&failing, &held_out])).page();
    let figures: Vec<&Figure> = page.sections.iter().flat_map(|s| &s.figures).collect();
    let maps = figures.iter().find_map(|figure| match figure {
        Figure::Choice(choice) if choice.anchor == "fails" => Some(choice),
        _ => None,
    });
    let Figure::Grid(tuned) = &maps.expect("there are maps").options[0].figures[0] else {
        panic!("the first map is no table");
    };
    let bars = figures.iter().find_map(|figure| match figure {
        Figure::Bars(bars) if bars.title == "Left unexplained" => Some(bars),
        _ => None,
    });
    let lift = tuned.rows.iter().find(|row| row.label == "L lift").expect("lift has a row");
    let bar = bars.expect("there are bars").groups.iter().find(|g| g.label == "L lift");
    // 0.182 in the diagnosis
    assert_eq!(lift.cells[0].text, "18 %");
    assert!((bar.expect("lift has a bar").values[0] - 18.2).abs() < 1e-9);
}

/// The parameter on which the flights differ most stands first, whatever its place in the effect.
#[test]
fn the_parameter_on_which_the_flights_differ_comes_first() {
    let mut d = report_diagnosis::diagnosis();
    let stall = d.effects.iter_mut().find(|c| c.id == "lift_stall").unwrap();
    let mut apart = stall.parameters[0].by_flight.clone();
    apart.iter_mut().zip([40.0, 52.0, 70.0]).for_each(|(f, value)| (f.value, f.sd) = (value, 1.0));
    stall.parameters[1].by_flight = apart;
    let html = page(&d).render();
    let (_, agree) = html.split_once("<h2>Do the flights agree?</h2>").unwrap();
    let [first, second] = ["lift_stall: M", "lift_stall: alpha"].map(|title| agree.find(title));
    assert!(first.is_some() && first < second, "{first:?} {second:?}");
}

#[test]
fn a_diagnosis_that_found_nothing_is_still_a_page() {
    let mut d = report_diagnosis::diagnosis();
    d.verdict = Verdict::Adequate;
    d.effects.retain(|c| !c.asserted);
    d.effects.iter_mut().for_each(|c| c.evidence = 1.0);
    let html = page(&d).render();
    assert!(html.contains("nothing is seen to be missing"));
    assert!(html.contains("No more than chance") && !html.contains("Above chance"));
    assert!(!html.contains("with the asserted effects</span>"));

    d.verdict = Verdict::Unexplained;
    (d.effects, d.channels, d.measurement) = Default::default();
    (d.tuned, d.advice, d.decoys, d.notes) = Default::default();
    d.sentences.clear();
    d.nulls.best.clear();
    let html = page(&d).render();
    assert!(html.contains("The diagnosis says nothing") && html.contains("Provenance"));
    figures(&html);

    let mut broken = report_diagnosis::diagnosis();
    let nan = f64::NAN;
    for c in &mut broken.effects {
        (c.evidence, c.threshold, c.minimum_detectable) = (nan, f64::INFINITY, Some(nan));
        for p in &mut c.parameters {
            (p.value, p.ci95) = (nan, [f64::NEG_INFINITY, nan]);
            p.by_flight.iter_mut().for_each(|f| (f.value, f.sd) = (nan, nan));
        }
        c.by_flight.iter_mut().for_each(|f| (f.value, f.sd) = (nan, nan));
        for curve in c.curve.iter_mut() {
            curve.residual.fill(nan);
            curve.contribution.fill([nan; 3]);
        }
    }
    broken.tuned.iter_mut().for_each(|t| (t.prior_sd, t.value) = (0.0, nan));
    broken.nulls.best = vec![nan, f64::INFINITY, -1.0];
    broken.decoys.iter_mut().for_each(|x| x.evidence = nan);
    broken.explanations.iter_mut().for_each(|e| e.probability = nan);
    let html = page(&broken).render();
    assert!(html.contains("cannot be determined"));
    assert!(!html.contains("NaN") && !html.contains(">inf"), "a number that is none is printed");
    figures(&html);
}

//! The report of an amendment as a file: before and after, the effects as fitted, with input made to break it.

use crate::report_amendment;
use crate::report_comparison;
use greylag::report::AmendmentReport;
use greylag::sysid::amend::{Amendment, Prior};
use serde_json::Value;

fn report(amendment: &Amendment) -> AmendmentReport<'_> {
    AmendmentReport {
        title: "The model amended".into(),
        amendment,
        answer: None,
        held_out: None,
        model_files: vec!["prior.toml".into(), "out/model.toml".into()],
        log_files: vec!["train-1.csv".into(), "train-2.csv".into()],
        prior: Prior::File,
        command_line: "greylag amend".into(),
        versions: Vec::new(),
    }
}

/// The data of the plots, as a browser would read it.
fn figures(html: &str) -> Vec<Value> {
    let (_, rest) = html.split_once("id=\"figures\">").expect("the page has data");
    let (json, _) = rest.split_once("</script>").expect("the data ends");
    serde_json::from_str(json).expect("the data is JSON")
}

#[test]
fn before_and_after_stand_side_by_side() {
    let amendment = report_amendment::amendment();
    let html = report(&amendment).page().render();
    let figures = figures(&html);
    let curves = &figures.iter().find(|f| f["kind"] == "curves").unwrap()["data"];
    let at_5s = |k: usize| curves["series"][k]["values"][2].as_f64().unwrap();
    // 0.06, 0.03 and 0.007 a second over 5 s.
    for (k, wanted) in [(0, 0.3), (1, 0.15), (2, 0.035)] {
        assert!((at_5s(k) - wanted).abs() < 1e-6, "{k} {}", at_5s(k));
    }
    for words in [
        "as given",
        "amended",
        "0.0350",
        "refused: it lowers the error on flights unseen by 2 % only; to decide, fly: a push-over",
        "at a bound of what is possible",
        "0.256 to 0.268",
        // (0.0381 − 0.0254) / 0.004 is 3.2 standard deviations.
        "1 of 2 moved by more than two standard deviations",
        "7.00",
        "Fitted along over 120 s of flight",
    ] {
        assert!(html.contains(words), "the page does not say {words:?}");
    }
    // With the growth of the errors, that takes the horizons' place.
    let comparison = report_comparison::comparison(60.0);
    let with = AmendmentReport { held_out: Some(&comparison), ..report(&amendment) };
    let html = with.page().render();
    assert!(html.contains("Root mean square over the runs") && !html.contains("as given</td>"));
}

#[test]
fn an_estimate_at_its_bound_has_no_interval_and_bounds_are_no_prior_to_move_from() {
    let mut amendment = report_amendment::amendment();
    let drag = amendment.parameters.iter_mut().find(|p| p.name == "drag_linear.CD0").unwrap();
    (drag.value, drag.at_bound) = (0.0, true);
    let html = report(&amendment).page().render();
    assert!(html.contains(" → 0, at its bound") && !html.contains(" → 0 ±"), "{html}");
    assert!(html.contains("moved by more than two standard deviations"));
    let scratch = AmendmentReport { prior: Prior::Bounds, ..report(&amendment) };
    let html = scratch.page().render();
    assert!(!html.contains("moved by more than") && html.contains("only within what is possible"));
}

#[test]
fn hostile_or_empty_input_is_still_a_page() {
    let hostile = "</script><script>alert(1)</script><!-- \"' & <b>\u{0}";
    let mut a = report_amendment::amendment();
    a.model = hostile.into();
    a.sentences = vec![hostile.into(); 3];
    a.notes = vec![hostile.into()];
    a.held_out = vec![hostile.into()];
    for e in &mut a.effects {
        (e.id, e.fly_next, e.refused) = (hostile.into(), hostile.into(), vec![hostile.into()]);
    }
    for p in &mut a.parameters {
        p.name = hostile.into();
        (p.value, p.ci95, p.prior_sd) = (f64::NAN, [f64::NEG_INFINITY, f64::NAN], 0.0);
        p.by_flight.iter_mut().for_each(|f| (f.flight, f.sd) = (hostile.into(), f64::INFINITY));
    }
    let html = report(&a).page().render();
    assert!(!html.contains("<script>alert") && !html.contains("<b>") && !html.contains("NaN"));
    figures(&html);

    (a.sentences, a.effects, a.parameters) = Default::default();
    (a.flights, a.notes, a.given) = Default::default();
    (a.before, a.after) = Default::default();
    let html = report(&a).page().render();
    assert!(!html.contains("In words") && html.contains("Provenance"));
    figures(&html);
}

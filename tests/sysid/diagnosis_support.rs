//! Every sentence of a diagnosis read beside its numbers.

use greylag::sysid::diagnose::{Candidate, Diagnosis, Status, Verdict};

/// Fails on a sentence that contradicts the numbers of its own diagnosis, and on a number that ought to be said and is not.
pub fn agree(d: &Diagnosis) {
    let wrong = contradictions(d);
    assert!(wrong.is_empty(), "{wrong:#?}\n{:#?}", d.sentences);
}

/// What contradicts what.
pub fn contradictions(d: &Diagnosis) -> Vec<String> {
    let mut wrong = Vec::new();
    let said = |text: &str| d.sentences.iter().any(|s| s.contains(text));
    let mut expect = |holds: bool, what: String| {
        if !holds {
            wrong.push(what);
        }
    };
    let asserted = d.effects.iter().any(|c| c.asserted);
    expect(asserted == (d.verdict == Verdict::Effect), "verdict and asserted effects".into());
    let all_abstain = d.channels.iter().all(|c| c.abstained);
    let sensors = all_abstain && said("in every channel the uncertainty of the sensor errors");
    let of_no_state = d.learnable_remainder < 0.1
        && (said("is not a function of the states") || said("One flight cannot say whether"));
    let faultless = said("The model as given has no sure error in any channel");
    let reasons = [!d.doubtful.is_empty(), sensors, of_no_state, faultless];
    expect(
        (d.verdict == Verdict::Unknown) == (reasons.into_iter().filter(|r| *r).count() == 1),
        "verdict unknown without its one reason".into(),
    );
    expect(
        d.doubtful.is_empty()
            || d.sentences[..d.doubtful.len()] == d.doubtful[..]
            || said("rudder"),
        "doubts come first".into(),
    );
    expect(d.doubtful.is_empty() || !said("Missing:"), "a force beside what cannot be".into());
    expect(
        said("Something is missing") == (d.verdict == Verdict::Unexplained),
        "something is missing".into(),
    );
    expect(
        said("Nothing is missing") == (d.verdict == Verdict::Adequate),
        "nothing is missing".into(),
    );
    for share in shares_of(d, "a flexible model could remove ") {
        expect(share > 0.0, "a flexible model that could remove nothing".into());
        expect(
            (share - 100.0 * d.learnable_remainder).abs() < 0.51,
            format!("{share} % removable"),
        );
    }
    for c in &d.effects {
        let own = d
            .sentences
            .iter()
            .find(|s| s.starts_with("Missing:") && s.contains(&format!("({};", c.id)));
        expect(own.is_some() == c.asserted, format!("{} asserted and said", c.id));
        expect(
            c.asserted == matches!(c.status, Status::Missing | Status::Indistinguishable),
            format!("{} {:?}", c.id, c.status),
        );
        if let Some(own) = own {
            expect(c.evidence > c.threshold, format!("{} is missing below chance", c.id));
            expect(!all_may_be_zero(c), format!("{} is missing and may be zero", c.id));
            expect(
                c.indistinguishable_from.iter().all(|other| own.contains(other)),
                format!("{} could be others, unsaid", c.id),
            );
            for p in &c.parameters {
                let text = format!("{} = {}", p.name, figures(p.value));
                expect(own.contains(&text), format!("{text} is not said"));
                let half = 0.5 * (p.ci95[1] - p.ci95[0]);
                let text = format!("± {}", figures(half));
                expect(
                    half == 0.0 || own.contains(&text),
                    format!("{} {text} is not said", p.name),
                );
            }
        }
    }
    for c in &d.channels {
        let judged = !d.sentences.iter().any(|s| {
            s.strip_prefix("No judgement in ").is_some_and(|rest| {
                rest.split(':').next().is_some_and(|list| list.split(", ").any(|n| n == c.channel))
            })
        });
        expect(judged != c.abstained, format!("{} abstained and said", c.channel));
        expect(
            c.abstained == c.why_abstained.is_some(),
            format!("{} abstained without a reason", c.channel),
        );
    }
    for m in d.measurement.iter().filter(|m| m.asserted) {
        let name = m.name.trim_start_matches("askew_");
        let own = d.sentences.iter().any(|s| s.starts_with(&m.flight) && s.contains(name));
        expect(own, format!("{} of {} is not said", m.name, m.flight));
        expect(m.value.abs() > 0.0 && m.sd.is_finite(), format!("{} of {}", m.name, m.flight));
    }
    for s in &d.sentences {
        expect(!s.contains("NaN") && !s.contains("inf "), format!("no number: {s}"));
    }
    wrong
}

/// Percentages that follow `text` in any sentence.
fn shares_of(d: &Diagnosis, text: &str) -> Vec<f64> {
    let of = |s: &String| {
        let (_, rest) = s.split_once(text)?;
        rest.split(' ').next()?.parse().ok()
    };
    d.sentences.iter().filter_map(of).collect()
}

fn all_may_be_zero(c: &Candidate) -> bool {
    !c.parameters.is_empty() && c.parameters.iter().all(|p| p.ci95[0] < 0.0 && 0.0 < p.ci95[1])
}

/// Three significant figures.
fn figures(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let places = (2 - x.abs().log10().floor() as i32).clamp(0, 9) as usize;
    format!("{x:.places$}")
}

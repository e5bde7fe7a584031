//! By how much the error falls with an effect is known before the effect is accepted.

use std::fs;

use crate::session::{at_5_s, logs};
use crate::workbench_support::{Bench, MODEL};
use serde_json::{Value, json};

#[test]
fn the_error_with_the_asserted_effect_is_known_before_the_tick_and_stays_as_it_was() {
    let scratch = tempfile::tempdir().unwrap();
    let session = scratch.path().join("session");
    let bench = Bench::open(&session, &["--model", MODEL]);
    for log in logs(scratch.path()) {
        let name = log.file_name().unwrap().to_str().unwrap();
        assert_eq!(bench.drop_file(name, &fs::read(&log).unwrap()).0, 200);
    }
    let state = bench.state();
    assert_eq!(state["ahead"], Value::Null, "without a diagnosis there is no next effect");
    // as a diagnosis leaves it; a change of the session reads it
    let key = state["diagnosis"]["key"].as_str().unwrap();
    let effect = |id: &str, asserted: bool| json!({ "id": id, "asserted": asserted });
    let effects = [effect("drag_beta2", false), effect("actuator_lag", true)];
    let stored = json!({ "effects": effects, "tried": [] });
    fs::write(session.join(format!("{key}.json")), stored.to_string()).unwrap();
    let test = |role: &str| bench.act(json!({ "do": "role", "flight": 2, "role": role })).1;
    let state = test("test");
    assert_eq!(
        (&state["ahead"]["id"], &state["ahead"]["status"]),
        (&json!("actuator_lag"), &json!("unfitted")),
        "{}",
        state["ahead"]
    );

    // the fit that follows a diagnosis
    assert_eq!(bench.act(json!({ "do": "fit" })).0, 200);
    let state = bench.until("the fit ahead", |s| s["ahead"]["status"] == "fitted");
    assert_eq!(state["stack"], json!([]), "nothing is accepted by it");
    let story = &state["ahead"]["story"];
    assert_eq!(story["effects"][0]["joined"], true, "{}", story["effects"]);
    let [before, after] = ["before", "after"].map(|k| at_5_s(&story[k]));
    assert!(at_5_s(&story["given"]) > 0.0 && after < 0.5 * before, "{before} to {after}");
    // what is shown of the models does not change
    assert_eq!(bench.get("/api/failing").1["ways"], json!(["given", "tuned"]));

    // the tick takes that fit at once, and no effect is left to come
    let (status, ticked) = bench.act(json!({ "do": "tick", "effect": "actuator_lag" }));
    assert_eq!((status, &ticked["stack"][0]["status"]), (200, &json!("fitted")));
    assert_eq!(&ticked["stack"][0]["story"], story);
    assert_eq!(ticked["ahead"], Value::Null);
    // taken back, it is the next one again, also after kill -9
    bench.until("no job", |s| s["jobs"] == json!([]));
    assert_eq!(bench.act(json!({ "do": "undo" })).1["ahead"]["status"], "fitted");
    drop(bench);
    let state = Bench::open(&session, &[]).state();
    assert_eq!(&state["ahead"]["story"], story);
}

//! The workbench's page of failsafes, over real HTTP: what is chosen is flown, shown, and flown again by its command.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use crate::workbench_support::{Bench, MODEL};
use greylag::sim::faults::{Asking, ControllerSetting, Counterpart, FaultKind, Scenario};

/// The page for a query, with its status.
fn page(bench: &Bench, query: &str) -> (u16, String) {
    let (status, head, body) =
        bench.raw("GET", &format!("/failsafes?{query}"), &bench.headers(), b"");
    assert!(head.to_lowercase().contains("text/html"), "{head}");
    (status, String::from_utf8(body).unwrap())
}

/// The text of the element `id`, which has no element in it.
fn text(page: &str, id: &str) -> String {
    let start =
        page.split(&format!("id=\"{id}\"")).nth(1).unwrap_or_else(|| panic!("{id}: {page}"));
    let text = start.split_once('>').unwrap().1.split('<').next().unwrap();
    text.replace("&quot;", "\"").replace("&#39;", "'").replace("&amp;", "&")
}

fn verdict(page: &str) -> &str {
    let start = page.split("<p class=\"verdict ").nth(1).unwrap_or_else(|| panic!("{page}"));
    start.split_once('>').unwrap().1.split('<').next().unwrap()
}

/// The rules of a page with their distances, as they are written.
fn rules(page: &str) -> BTreeMap<String, String> {
    let row = |row: &str| {
        let distance = row.split("class=\"number\">").nth(1)?.split('<').next()?;
        let rule = row.split("<b>").nth(1)?.split('<').next()?;
        Some((rule.to_owned(), distance.replace('−', "-")))
    };
    page.split("<tr>").filter_map(row).collect()
}

#[test]
fn what_is_chosen_is_flown_and_its_command_flies_the_same() {
    let scratch = tempfile::tempdir().unwrap();
    let bench = Bench::open(&scratch.path().join("session"), &["--model", MODEL]);
    // from the workbench to the page
    let (_, _, workbench) = bench.raw("GET", "/", &bench.headers(), b"");
    assert!(String::from_utf8_lossy(&workbench).contains("href=\"/failsafes\""));
    for asset in ["failsafes.css", "failsafes.js"] {
        assert_eq!(bench.raw("GET", &format!("/assets/{asset}"), &bench.headers(), b"").0, 200);
    }

    // the flight that it begins with
    let (status, first) = page(&bench, "");
    assert_eq!(status, 200, "{first}");
    let said = verdict(&first);
    for part in [
        "Link cut from 15.0 to 18.0 s: the companion handed back at 15.3",
        "PX4 changed to HOLD at 15.5",
        "The client arms and asks for OFFBOARD at 25.0 s: the companion asked for the aircraft",
        "PX4 changed to MANUAL",
        "rules of flight that apply hold",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    for part in
        ["handed back to the controller", "signs are right", "aria-label=\"PX4&#39;s mode: "]
    {
        assert!(first.contains(part), "{part}");
    }
    assert!(first.matches("<polyline").count() >= 6);
    // the same choices are the same flight
    assert_eq!(page(&bench, "").1, first);

    // its command finds the same distances
    let file = scratch.path().join("scenario.json");
    fs::write(&file, text(&first, "scenario")).unwrap();
    let line = text(&first, "command");
    let words: Vec<&str> = line.split(' ').skip(1).collect();
    let words =
        words.iter().map(|w| if *w == "scenario.json" { file.to_str().unwrap() } else { w });
    let made = Command::new(env!("CARGO_BIN_EXE_greylag"))
        .args(words)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let printed = String::from_utf8_lossy(&made.stdout);
    let shown = rules(&first);
    assert!(made.status.success() && shown.len() == printed.lines().count(), "{made:?}");
    for line in printed.lines() {
        let mut words = line.split_whitespace();
        let distance = words.nth(1).unwrap();
        let rule = line.split("s  ").nth(1).unwrap().split(':').next().unwrap();
        assert_eq!(shown[rule], distance, "{line}");
    }
}

#[test]
fn a_killed_companion_engages_no_more_unasked_and_a_radio_keeps_ardupilot_in_manual_until_its_failsafe()
 {
    let scratch = tempfile::tempdir().unwrap();
    let bench = Bench::open(&scratch.path().join("session"), &["--model", MODEL]);
    let (_, killed) = page(&bench, "fault=killed&for_s=10&request=none");
    let said = verdict(&killed);
    assert!(said.contains("PX4 changed to HOLD at 15.5"), "{said}");
    assert!(said.contains("the companion started again at 25.0"), "{said}");
    assert!(said.contains("At the end PX4 flies HOLD, the companion is disarmed"), "{said}");
    // a client that asks gets it back
    let (_, again) = page(&bench, "fault=killed&for_s=5&request=again&at_s=30");
    assert!(verdict(&again).contains("At the end the companion steers, in OFFBOARD"), "{again}");

    let channels = "counterpart=ardupilot&fault=killed&for_s=30&request=none";
    let (_, without) = page(&bench, channels);
    let home = ["ArduPilot changed to CIRCLE", "ArduPilot changed to RTL"];
    assert!(home.iter().any(|said| verdict(&without).contains(said)), "{}", verdict(&without));
    let (_, radio) = page(&bench, &format!("{channels}&radio=yes"));
    assert!(radio.contains("a radio is bound"), "{}", verdict(&radio));
    assert!(verdict(&radio).contains("ArduPilot changed to RTL"), "{}", verdict(&radio));
    let end = "At the end ArduPilot flies RTL, the companion is disarmed";
    assert!(verdict(&radio).contains(end), "{}", verdict(&radio));
    let scenario: Scenario = serde_json::from_str(&text(&radio, "scenario")).unwrap();
    assert_eq!(scenario.counterpart, Counterpart::Ardupilot);
    let bound = ControllerSetting { name: "SIM_RC_FAIL".into(), value: 0.0 };
    assert_eq!(scenario.controller_parameters, [bound]);
    assert_eq!(scenario.faults[0].kind, FaultKind::Killed);
}

#[test]
fn requests_are_answered_and_what_is_no_choice_is_said_once() {
    let scratch = tempfile::tempdir().unwrap();
    let bench = Bench::open(&scratch.path().join("session"), &["--model", MODEL]);
    let (_, refused) = page(&bench, "counterpart=sitl&fault=none&request=disarm");
    assert!(verdict(&refused).contains("disarming refused: flying at"), "{}", verdict(&refused));
    let (_, taken) = page(&bench, "fault=none&request=take-over&controller=pid-retuned");
    assert!(verdict(&taken).contains("PX4 changed to HOLD at 25.0"), "{}", verdict(&taken));
    assert!(text(&taken, "command").contains("--controller pid-retuned"));
    let scenario: Scenario = serde_json::from_str(&text(&taken, "scenario")).unwrap();
    assert_eq!(scenario.asked[0].what, Asking::TakeOver);

    let (status, wrong) = page(&bench, "from_s=%3Cb%3Esoon&roll_deg=30");
    assert_eq!((status, wrong.matches("role=\"alert\"").count()), (422, 1), "{wrong}");
    let said = text(&wrong, "wrong");
    assert!(
        said.contains("the fault's beginning cannot be") && said.contains("1 to 55 s"),
        "{said}"
    );
    // what was typed stays, as text, and its field is marked
    assert!(wrong.contains("value=\"&lt;b&gt;soon\" aria-invalid=\"true\""), "{wrong}");
    assert!(wrong.contains("name=\"roll_deg\"") && wrong.contains("value=\"30\""));
    assert!(!wrong.contains("<b>soon") && !wrong.contains("<p class=\"verdict"));
    // whoever has no token gets no flight
    let host = format!("Host: {}\r\n", bench.host);
    assert_eq!(bench.raw("GET", "/failsafes", &host, b"").0, 401);
}

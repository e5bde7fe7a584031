//! Effects of the catalogue that are files: known like the compiled ones, found on an aircraft with and without a rudder.

use std::path::Path;

use crate::lacking_support;
use greylag::model::GreyBox;
use greylag::physics::catalogue;
use greylag::physics::formula::{Status, register};
use greylag::sim::missing::Missing;
use greylag::sysid::diagnose::{Options, Verdict, diagnose};
use greylag::sysid::progress::ignore_progress;

fn params() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("params")
}

#[test]
fn every_file_is_an_effect_that_names_what_it_is_mistaken_for() {
    let files = std::fs::read_dir(params().join("catalogue")).unwrap();
    let mut names: Vec<String> =
        files.map(|f| f.unwrap().file_name().to_str().unwrap().replace(".toml", "")).collect();
    names.sort();
    let shipped = register::shipped();
    assert_eq!(names, shipped.iter().map(|e| e.about.id).collect::<Vec<_>>());
    let all: Vec<_> = catalogue::all().collect();
    let known = |name: &str| {
        let (effect, coefficient) = name.split_once('.').unwrap_or((name, ""));
        let about = all.iter().find(|about| about.id == effect);
        about.is_some_and(|about| {
            coefficient.is_empty() || about.coefficients.iter().any(|c| c.name == coefficient)
        })
    };
    for effect in shipped {
        assert_eq!(effect.status, Status::Accepted);
        let entry = effect.about.entry.unwrap();
        assert!(!entry.separated_by.is_empty() && !entry.look_alikes.is_empty());
        assert!(entry.look_alikes.iter().all(|name| known(name)), "{}", effect.about.id);
        let mut model = GreyBox::load(&params().join("aerosonde/jsbsim.toml")).unwrap();
        model.join(effect.about.id, &effect.values).unwrap();
    }
}

/// A model file needs no `effect_files` for them.
#[test]
fn a_model_file_names_one_by_its_id() {
    let path = params().join("aerosonde/jsbsim.toml");
    let text = std::fs::read_to_string(&path).unwrap()
        + "\n[effects.thrust_line_sideways]\ny_m = { value = 0.05, source = \"a test\" }\n";
    let model = GreyBox::parse(&text, &path).unwrap();
    assert!(model.has("thrust_line_sideways"));
}

/// The X8 has no rudder: that half of the effect stays at zero, and the other is found.
#[test]
fn a_slipstream_over_the_elevator_is_found_without_a_rudder() {
    let effect = register::find("tail_slipstream").unwrap();
    let (model, search, _) =
        lacking_support::flown(Missing::written(effect, &[-0.8, 0.0]).unwrap(), 4401);
    let found = diagnose(&model, &search, &Options::default(), &ignore_progress).unwrap();
    println!("{:?}", found.sentences);
    assert_eq!(found.verdict, Verdict::Effect);
    let asserted: Vec<_> = found.effects.iter().filter(|e| e.asserted).collect();
    assert_eq!(asserted.len(), 1, "{:?}", found.sentences);
    assert_eq!(asserted[0].id, "tail_slipstream");
    let of = |name: &str| asserted[0].parameters.iter().find(|p| p.name == name);
    let elevator = of("Cmde_T").unwrap();
    assert!((elevator.value + 0.8).abs() < 0.04, "{elevator:?}");
    assert!(of("Cndr_T").is_none_or(|rudder| rudder.value == 0.0));
}

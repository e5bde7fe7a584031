//! Model files that are wrong are refused in one line that says what, where, and what to do.

use std::fs;
use std::path::Path;

use greylag::model::GreyBox;

fn shipped(name: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8").join(name)).unwrap()
}

/// What loading says of the prior after `edit`, with its airframe after `edit_airframe`.
fn complaint(edit: (&str, &str), edit_airframe: (&str, &str)) -> String {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, (from, to): (&str, &str)| {
        let text = shipped(name);
        assert!(text.contains(from), "{name} no longer holds {from:?}");
        fs::write(folder.path().join(name), text.replacen(from, to, 1)).unwrap();
    };
    write("prior.toml", edit);
    write("airframe.toml", edit_airframe);
    let error = GreyBox::load(&folder.path().join("prior.toml")).unwrap_err().to_string();
    assert_eq!(error.lines().count(), 1, "more than one line: {error}");
    error
}

fn says(error: &str, words: &[&str]) {
    for word in words {
        assert!(error.contains(word), "{error:?} does not say {word:?}");
    }
}

const AS_IT_IS: (&str, &str) = ("schema = ", "schema = ");

#[test]
fn shipped_files_load() {
    for name in ["prior", "prior-mild", "prior-severe", "prior-as-printed", "jsbsim"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("params/x8/{name}.toml"));
        let model = GreyBox::load(&path).unwrap();
        assert_eq!(model.name, name);
    }
}

#[test]
fn a_missing_file_is_named() {
    let error = GreyBox::load(Path::new("nowhere/none.toml")).unwrap_err().to_string();
    says(&error, &["nowhere/none.toml", "params/x8/prior.toml"]);
}

#[test]
fn wrong_schema() {
    says(
        &complaint(("schema = 1", "schema = 2"), AS_IT_IS),
        &["prior.toml", "schema is 2", "schema 1"],
    );
    says(&complaint(AS_IT_IS, ("schema = 2", "schema = 9")), &["airframe.toml", "schema is 9"]);
}

#[test]
fn unknown_keys() {
    says(&complaint(("CL0 =", "CL_0 ="), AS_IT_IS), &["lift_linear.CL_0", "unknown", "CL0"]);
    says(
        &complaint(("[effects.lift_linear]", "[effects.lift_linaer]"), AS_IT_IS),
        &["lift_linaer", "lift_linear"],
    );
    says(&complaint(("mass_kg", "mass_lb"), AS_IT_IS), &["mass_lb", "mass_kg"]);
    says(&complaint(AS_IT_IS, ("bank_max_deg", "bank_max_rad")), &["bank_max_rad"]);
}

#[test]
fn missing_numbers() {
    let clda = "Clda = { value = 0.1202, source = \"Gryte et al. 2018\" }";
    says(&complaint((clda, ""), AS_IT_IS), &["roll_linear.Clda", "missing"]);
    says(&complaint((", source = \"Gryte et al. 2018\" }", " }"), AS_IT_IS), &["source"]);
}

#[test]
fn numbers_that_no_aircraft_has() {
    says(
        &complaint(("value = 3.364", "value = -3.364"), AS_IT_IS),
        &["mass_kg", "-3.364", "positive"],
    );
    says(
        &complaint(("value = -0.9343", "value = -1.9343"), AS_IT_IS),
        &["jxz_kgm2", "not physical"],
    );
    says(
        &complaint(("Clp = { value = -0.4042", "Clp = { value = 0.4042"), AS_IT_IS),
        &["Clp", "not physical", "roll damping"],
    );
    says(&complaint(("value = 0.0867", "value = nan"), AS_IT_IS), &["CL0", "not physical"]);
    says(&complaint(AS_IT_IS, ("value = 2.1,", "value = 0.0,")), &["span_m", "positive"]);
    says(
        &complaint(AS_IT_IS, ("airspeed_min_mps = 13.0", "airspeed_min_mps = 33.0")),
        &["airspeed_min_mps"],
    );
    says(
        &complaint(AS_IT_IS, ("pitch_min_deg = -30.0", "pitch_min_deg = 10.0")),
        &["pitch_min_deg"],
    );
    says(
        &complaint(AS_IT_IS, ("surface_slew_per_s = 20.0", "surface_slew_per_s = inf")),
        &["surface_slew_per_s"],
    );
    says(&complaint(AS_IT_IS, ("value = 0.2,", "value = 1e-310,")), &["controls.throttle.lag_s"]);
    says(&complaint(("value = 3.364", "value = 1e300"), AS_IT_IS), &["mass_kg", "at most"]);
}

#[test]
fn numbers_without_their_form() {
    let mass = "mass_kg = { value = 3.364, source = \"Gryte et al. 2018\" }";
    says(&complaint((mass, "mass_kg = 3.364"), AS_IT_IS), &["a number with its source", "line"]);
    says(&complaint(("density = {", "density = 1.156 #"), AS_IT_IS), &["standard"]);
    says(&complaint(("density = { kgpm3", "density = { foo = 3, kgpm3"), AS_IT_IS), &["density"]);
    says(&complaint(("name = \"prior\"", "name = \"\""), AS_IT_IS), &["name"]);
}

//! Effects of files in a model: they trim, linearise, step in lanes, are written back, and do not fly unaccepted.

use std::fs;
use std::path::{Path, PathBuf};

use greylag::control::aircraft_check::check;
use greylag::control::{ControllerKind, SetupError, build};
use greylag::model::{GreyBox, Trim, linearise};
use greylag::physics::Channel;
use greylag::physics::formula::register;

/// Altitude of the tests, m.
const ALTITUDE: f64 = 600.0;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("params")
}

/// The shipped prior with a moment of the thrust about the vertical, its effect file beside it.
fn folder(status: &str) -> tempfile::TempDir {
    folder_of("yaw_by_throttle", status)
}

/// The same with the effect under the name `id`: a process knows each name once.
fn folder_of(id: &str, status: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let effect = fs::read_to_string(root().join("effects/yaw_by_throttle.toml")).unwrap();
    let effect = effect.replace("\"accepted\"", &format!("\"{status}\""));
    let effect = effect.replace("yaw_by_throttle", id);
    fs::write(folder.path().join("own.toml"), effect).unwrap();
    fs::copy(root().join("x8/airframe.toml"), folder.path().join("airframe.toml")).unwrap();
    let model = fs::read_to_string(root().join("x8/prior.toml")).unwrap();
    let model = model.replace("schema = 1\n", "schema = 1\neffect_files = [\"own.toml\"]\n")
        + &format!("\n[effects.{id}]\nk = {{ value = 1.16, source = \"40 mm of 29 N\" }}\n");
    fs::write(folder.path().join("model.toml"), model).unwrap();
    folder
}

#[test]
fn a_model_takes_part_of_what_its_effect_file_says() {
    let folder = folder("accepted");
    let model = GreyBox::load(&folder.path().join("model.toml")).unwrap();
    let plain = GreyBox::load(&root().join("x8/prior.toml")).unwrap();
    let trim = Trim::level(&plain, 18.0, ALTITUDE).unwrap();
    let air = model.air(&trim.state, ALTITUDE);
    let yaw = |m: &GreyBox| m.wrench(&trim.state, &trim.controls, &air).get(Channel::Yaw);
    let added = yaw(&model) - yaw(&plain);
    assert!((added - 1.16 * trim.controls.throttle).abs() < 1e-12, "{added}");
    // the same turn needs other controls, and the linear model knows the new column
    let turn = Trim::attitude(&model, 0.3, 0.03, 18.0, ALTITUDE).unwrap();
    let rate = model.rate(&turn.state, &turn.controls, ALTITUDE);
    assert!(rate.r.abs() < 1e-9 && rate.p.abs() < 1e-9, "{rate:?}");
    let (a, b) = (linearise(&model, &trim, ALTITUDE).b, linearise(&plain, &trim, ALTITUDE).b);
    // r over throttle: 0.01 s of 1.16 N m by Jx / (Jx Jz − Jxz²), of which the damping of the roll that Jxz
    // couples in takes a sixth within the step
    let rigid = 0.01 * 1.16 * 1.229 / (1.229 * 0.8808 - 0.9343_f64.powi(2));
    let share = (a - b)[(5, 2)] / rigid;
    assert!((0.75..1.0).contains(&share), "{share}");
    let linear = model.linear();
    let place = model.coefficients().iter().position(|c| c.name == "yaw_by_throttle.k").unwrap();
    assert!(linear[place]);
}

#[test]
fn what_a_search_proposed_does_not_fly() {
    const ID: &str = "yaw_of_a_search";
    let folder = folder_of(ID, "proposed");
    let model = GreyBox::load(&folder.path().join("model.toml")).unwrap();
    let refused = build(ControllerKind::Lqi, &model).err().unwrap();
    assert!(matches!(&refused, SetupError::Proposed { effect, .. } if *effect == ID));
    assert!(refused.to_string().contains("status = \"accepted\""));
    // the envelope is not the reason
    let findings = check(&model).unwrap().findings;
    let finding = findings.iter().find(|f| f.contains("status = \"accepted\"")).unwrap();
    assert!(!finding.contains("less bank"), "{finding}");
    let accepted = folder_of(ID, "accepted");
    let model = GreyBox::load(&accepted.path().join("model.toml")).unwrap();
    assert!(build(ControllerKind::Lqi, &model).is_ok());
}

#[test]
fn an_unknown_effect_says_where_its_file_goes() {
    let folder = folder("accepted");
    let path = folder.path().join("model.toml");
    let text = fs::read_to_string(&path).unwrap();
    let lost = text.replace("effects.yaw_by_throttle", "effects.yaw_by_magic");
    let why = GreyBox::parse(&lost, &path).unwrap_err().to_string();
    assert!(why.contains("effect_files"), "{why}");
    let gone = text.replace("own.toml", "gone.toml");
    let why = GreyBox::parse(&gone, &path).unwrap_err().to_string();
    assert!(why.contains("gone.toml"), "{why}");
}

#[test]
fn a_joined_effect_of_a_file_starts_at_zero() {
    let effects = register::load(&root().join("effects")).unwrap();
    assert!(effects.iter().any(|e| e.about.id == "yaw_by_throttle"));
    let mut model = GreyBox::load(&root().join("x8/prior.toml")).unwrap();
    model.join("yaw_by_throttle", &[0.0]).unwrap();
    assert!(model.has("yaw_by_throttle") && model.proposed().is_none());
    assert!(model.join("yaw_by_throttle", &[0.0]).is_err());
}

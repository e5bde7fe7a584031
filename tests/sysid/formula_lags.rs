//! Lags and delays in formulas: what JSBSim's own filters make of the same effect, what settles, what is refused, and
//! that fit and diagnosis find the time constant.

use std::path::Path;

use crate::lacking_support::flown;
use crate::validate_support::{controls, histories, inputs as sent, model, plant};
use greylag::model::block::Block;
use greylag::model::{GreyBox, Memory};
use greylag::num::Real;
use greylag::physics::formula::{Written, file, register};
use greylag::physics::{Channel, Controls, State};
use greylag::sim::missing::Missing;
use greylag::sysid::amend::{Added, Options, amend};
use greylag::sysid::diagnose;
use greylag::sysid::progress::ignore_progress;

/// An effect file with one channel, the parameters being k (N m) and `time` with its `bounds`.
fn text(id: &str, shape: &str, time: &str, bounds: &str) -> String {
    format!(
        "schema = 1\nid = {id:?}\ndescription = \"d\"\nsource = \"s\"\nstatus = \"accepted\"\n\
         [parameters.k]\nvalue = 1.2\nwidth = 2.0\nbounds = [-20.0, 20.0]\nunit = \"N m\"\nmeaning = \"amount\"\n\
         [parameters.{time}]\nvalue = 0.1\nbounds = {bounds}\nunit = \"s\"\nmeaning = \"time\"\n\
         [[channels]]\nchannel = \"yaw\"\nshape = \"{shape}\"\n"
    )
}

fn registered(folder: &Path, id: &str, text: &str) -> &'static Written {
    let path = folder.join(format!("{id}.toml"));
    std::fs::write(&path, text).unwrap();
    register::load(&path).unwrap()[0]
}

#[test]
fn jsbsim_filters_make_the_same_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let cases = [
        ("lagged", "k*lag(throttle - 2*elevator*aileron, tau)", "tau", "[0.0, 3.0]", 0.13),
        ("delayed", "k*delay(abs(elevator) + throttle^2, late)", "late", "[0.0, 0.2]", 0.07),
    ];
    for (id, shape, time, bounds, amount) in cases {
        let effect = registered(folder.path(), id, &text(id, shape, time, bounds));
        let missing = Missing::written(effect, &[1.2, amount]).unwrap();
        let mut with = model("jsbsim");
        with.join(id, &[1.2, amount]).unwrap();
        assert!(!with.acts_at_once() && with.lags() == 1);
        let mut worst = 0.0_f64;
        for (_, commands) in histories() {
            let mut plant = plant(&[missing.hidden.unwrap()]);
            let mut memory = with.at_rest(&Controls::default());
            for command in &commands {
                let seen = controls(&plant.step(sent(command)).unwrap());
                let ours = with.act(&seen, &mut memory).lagged.unwrap()[0];
                let theirs = plant.property(&format!("hidden/{id}-filter-0")).unwrap();
                worst = worst.max((ours - theirs).abs());
            }
        }
        assert!(worst < 1e-12, "{id}: {worst:e}");
    }
}

#[test]
fn without_a_past_it_has_settled() {
    let folder = tempfile::tempdir().unwrap();
    let text = text("settles", "k*lag(throttle, tau)", "tau", "[0.0, 3.0]");
    registered(folder.path(), "settles", &text);
    let plain = model("jsbsim");
    let mut with = plain.clone();
    with.join("settles", &[1.2, 0.3]).unwrap();
    let held = Controls { throttle: 0.5, ..Controls::default() };
    let state = State::NEUTRAL;
    let yaw =
        |m: &GreyBox, z: &Controls| m.wrench(&state, z, &m.air(&state, 600.0)).get(Channel::Yaw);
    let settled = yaw(&with, &held) - yaw(&plain, &held);
    assert!((settled - 0.6).abs() < 1e-12, "{settled}");
    // after a step of the throttle the moment follows 1 − e^(−t/τ), to the bilinear rule's accuracy
    let mut memory = with.at_rest(&Controls::default());
    for step in 0..60 {
        let acting = with.act(&held, &mut memory);
        let moment = yaw(&with, &acting) - yaw(&plain, &acting);
        let time = 0.01 * (f64::from(step) + 0.5);
        let expected = 0.6 * (1.0 - (-time / 0.3_f64).exp());
        assert!((moment - expected).abs() < 1e-3, "{step}: {moment} {expected}");
    }
    // the lanes of a planner remember what a single aircraft does
    let (mut single, mut lanes) = (Memory::default(), Memory::default());
    let mut past = with.at_rest(&Controls::default());
    let acting = with.act(&held, &mut past);
    let next = with.step(&state, &acting, 600.0, &mut single);
    let block = Block::from_f64;
    let wide = with.step_block(&state.map(block), &acting.map(block), 600.0, &mut lanes);
    for (one, all) in next.to_array().iter().zip(wide.to_array()) {
        assert!((one - f64::from(all.0[3])).abs() < 1e-5, "{one} {all:?}");
    }
}

#[test]
fn what_cannot_be_remembered_is_refused_with_its_cure() {
    let cases = [
        ("k*lag(alpha, tau)", "[0.0, 3.0]", "alpha_dot"),
        ("k*lag(throttle, throttle) + 0*k*tau", "[0.0, 3.0]", "a parameter in s"),
        ("k*lag(throttle, 0.3) + 0*k*tau", "[0.0, 3.0]", "so that it has bounds"),
        ("k*lag(lag(throttle, tau), tau)", "[0.0, 3.0]", "write only one"),
        ("k*lag(throttle, tau)", "[-1.0, 3.0]", "bounds"),
        ("k*delay(throttle, tau)", "[0.0, 3.0]", "0.22 s"),
        ("k*lag(throttle)", "[0.0, 3.0]", "2 arguments"),
        (
            "k*lag(throttle, tau) + k*lag(elevator, tau) + k*lag(aileron, tau)",
            "[0.0, 3.0]",
            "2 are the most",
        ),
    ];
    for (shape, bounds, cure) in cases {
        let why = file::parse(&text("refused", shape, "tau", bounds)).unwrap_err();
        assert!(why.contains(cure), "{shape}: {why}");
    }
    let wrong = text("refused", "k*lag(throttle, tau)", "tau", "[0.0, 3.0]");
    let why = file::parse(&wrong.replace("unit = \"s\"", "unit = \"m\"")).unwrap_err();
    assert!(why.contains("in s"), "{why}");
}

#[test]
fn a_model_has_no_more_lags_than_it_can_remember() {
    let folder = tempfile::tempdir().unwrap();
    let mut model = model("jsbsim");
    for (k, id) in ["first_lag", "second_lag", "third_lag"].into_iter().enumerate() {
        let shape = ["k*lag(throttle, tau)", "k*lag(elevator, tau)", "k*lag(aileron, tau)"][k];
        registered(folder.path(), id, &text(id, shape, "tau", "[0.0, 3.0]"));
        let joined = model.join(id, &[1.0, 0.1]);
        assert_eq!(joined.is_ok(), k < 2, "{joined:?}");
    }
}

/// A thrust line 40 mm to the left behind an engine of 0.5 s; the file believes 0.3 s.
#[test]
fn fit_and_diagnosis_find_the_time_constant() {
    const SEED: u64 = 8823;
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let effect = register::load(&params.join("effects/yaw_by_spool.toml")).unwrap()[0];
    let (model, mut fit, test) = flown(Missing::written(effect, &[1.16, 0.5]).unwrap(), SEED);
    // two flights are enough: pitch, and everything at once
    fit.remove(1);
    let effects = vec![Added { id: "yaw_by_spool".into(), start: None }];
    let options = Options { effects, ..Options::default() };
    let amended = amend(&model, &fit, &test, &options, &ignore_progress).unwrap();
    let value = |name: &str| {
        let all = amended.model.coefficients();
        all.iter().find(|c| c.name == format!("yaw_by_spool.{name}")).unwrap().value
    };
    assert!((value("k") - 1.16).abs() < 0.02, "{}", value("k"));
    assert!((value("tau") - 0.5).abs() < 0.02, "{}", value("tau"));

    // the diagnosis names it; 10 ms are the doubt of the actuators' clock
    let options = diagnose::Options { with: vec!["yaw_by_spool".into()], ..Default::default() };
    let found = diagnose::diagnose(&model, &fit, &options, &ignore_progress).unwrap();
    let first = &found.effects[0];
    assert!(first.asserted && first.id == "yaw_by_spool", "{:?}", found.sentences);
    let tau = first.parameters.iter().find(|p| p.name == "tau").unwrap().value;
    assert!((tau - 0.5).abs() < 0.02, "{tau}");
}

//! Training on flights imagined in a known model: what is missing is found, and found again.

use crate::learn_support::{flight, model, moved};
use greylag::learn::dynamics::export;
use greylag::learn::dynamics::score::free_run;
use greylag::learn::dynamics::windows::Track;
use greylag::learn::{
    Checkpoint, Criterion, JXZ, Joint, Learned, Recipe, Start, TrainError, Trainer, trainable,
};
use greylag::model::{GreyBox, Integrator};
use greylag::num::stream;
use rand::RngExt;

fn recipe(updates: u64) -> Recipe {
    Recipe { hidden: vec![16], steps: vec![4, 8], batch: 32, updates, ..Recipe::default() }
}

fn tracks(truth: &GreyBox, prior: &GreyBox) -> Vec<Track> {
    (0..6).map(|seed| flight(truth, prior, seed, 300)).collect()
}

/// The coefficients of the severe prior come back when the flights are those of the true one.
#[test]
fn wrong_coefficients_are_found() {
    let (truth, prior) = (model("prior"), model("prior-severe"));
    let names = ["roll_linear.Clda", "roll_linear.Clp", "lift_linear.CLde", "drag_linear.CD0"]
        .map(String::from);
    let changed: Vec<String> = truth
        .coefficients()
        .iter()
        .zip(prior.coefficients())
        .filter(|(t, p)| t.value != p.value)
        .map(|(t, _)| t.name.clone())
        .collect();
    assert!(names.iter().all(|n| changed.contains(n)));
    // equation error has them before the first update, but for the integration over a window of 50 ms:
    // it shows drag, the smallest of the forces, to 6 % in these 18 s of flight
    let begun = Recipe { trainable: changed.clone(), ..recipe(10) };
    let trainer = Trainer::new(begun, &prior, tracks(&truth, &prior)).unwrap();
    for Learned { name, value: now, truth, .. } in trainer.coefficients(Some(&truth)) {
        let bound = if name.starts_with("drag") { 0.1 } else { 0.02 };
        assert!((now / truth.unwrap() - 1.0).abs() < bound, "{name} {now}");
    }
    // the paper's way: from where they were given, along with the residual
    for (joint, prior_rate, updates, most) in
        [(Joint::Gradient, 1e-2, 1500, 0.1), (Joint::Projection, 0.0, 3000, 0.25)]
    {
        let along =
            Recipe { start: Start::AsGiven, joint, prior_rate, rate: 1e-3, ..recipe(updates) };
        let recipe = Recipe { trainable: changed.clone(), tau: 1.0, ..along };
        let mut trainer = Trainer::new(recipe, &prior, tracks(&truth, &prior)).unwrap();
        assert!(trainer.unseen().is_empty());
        let first = trainer.run(1).unwrap();
        // the residual starts at zero, so the first minibatch is off as the bare prior is
        assert!(first.loss.learned == 0.0 && (0.2..5.0).contains(&first.normalised), "{first:?}");
        trainer.run(updates).unwrap();
        let learned = trainer.coefficients(Some(&truth));
        let median = |value: &dyn Fn(&Learned) -> f64| {
            let mut off: Vec<f64> =
                learned.iter().map(|l| (value(l) / l.truth.unwrap() - 1.0).abs()).collect();
            off.sort_by(f64::total_cmp);
            off[off.len() / 2]
        };
        let (before, after) = (median(&|l| l.start), median(&|l| l.value));
        println!("{joint:?}: median error {before} -> {after}");
        assert!(after < most * before, "{joint:?}: {before} -> {after}");
    }
}

/// Flights that hardly show a coefficient leave it where its stated width has it; without one it goes where the noise of the
/// states sends it, but no further than an aircraft can be.
#[test]
fn what_flights_do_not_show_stays_within_its_width() {
    let (truth, prior) = (model("jsbsim"), model("prior"));
    let quiet = |seed| {
        let mut track = moved(&truth, &prior, seed, 300, 0.01);
        let mut rng = stream::stream(seed, &[77]);
        for state in &mut track.states {
            state.p += 0.002 * rng.random_range(-1.0..1.0);
            state.alpha += 0.001 * rng.random_range(-1.0..1.0);
        }
        track
    };
    let tracks: Vec<Track> = (0..3).map(quiet).collect();
    let worst = |prior: &GreyBox| {
        let recipe = Recipe { trainable: trainable(prior), ..recipe(10) };
        let trainer = Trainer::new(recipe, prior, tracks.clone()).unwrap();
        let learned = trainer.coefficients(None);
        for l in &learned {
            let bounds = prior.bounds_of(&l.name);
            assert!(
                bounds.is_none_or(|(a, b)| (a..=b).contains(&l.value)),
                "{} {}",
                l.name,
                l.value
            );
        }
        let moved = learned.iter().filter(|l| l.name != JXZ).map(|l| {
            let width = prior.coefficients().iter().find(|c| c.name == l.name).unwrap().width();
            (l.value - l.start).abs() / width
        });
        moved.filter(|x| x.is_finite()).fold(0.0, f64::max)
    };
    let stated = prior.clone().with_widths(|c| Some(0.15 * c.value.abs()));
    let [with, without] = [&stated, &prior].map(worst);
    println!("moved by {with} widths where they are stated, by {without} without");
    assert!(with < 4.0 && without > 2.0 * with, "{with} {without}");
}

/// The prior as printed has the product of inertia with the wrong sign and its thrust in pounds; its drag
/// lacks what the simulator's table has, which is not to be taken for thrust.
#[test]
fn thrust_is_told_from_a_drag_that_is_too_small() {
    let [truth, prior] = ["jsbsim", "prior-as-printed"].map(|name| {
        let mut model = model(name);
        // its spin over a window is a sum, not an integral to be approximated
        model.integrator = Integrator::Jsbsim;
        model
    });
    let names = vec![JXZ.into(), "thrust_linear.Cp_n".into()];
    let recipe = Recipe { trainable: names, ..recipe(10) };
    let trainer = Trainer::new(recipe, &prior, tracks(&truth, &prior)).unwrap();
    for Learned { name, value, truth, .. } in trainer.coefficients(Some(&model("prior"))) {
        let off = value / truth.unwrap() - 1.0;
        println!("{name} {value} {off}");
        assert!(off.abs() < 0.03, "{name} {value}");
    }
}

/// An amended model is learned through: a coefficient of an effect that acts on what others make is found by the
/// regression, and by the gradient of rollouts from a start that is far off.
#[test]
fn a_coefficient_of_an_effect_on_other_effects_is_learned() {
    let with = |k: f64| {
        let mut model = model("jsbsim");
        model.join("propwash", &[k]).unwrap();
        model
    };
    let (truth, prior) = (with(0.6), with(0.1));
    for (start, updates, most) in [(Start::EquationError, 0, 0.02), (Start::AsGiven, 1500, 0.1)] {
        let trainable = vec!["propwash.k".to_owned()];
        let rates = Recipe { prior_rate: 1e-2, rate: 1e-3, tau: 1.0, ..recipe(updates.max(1)) };
        let recipe = Recipe { trainable, start, ..rates };
        let mut trainer = Trainer::new(recipe, &prior, tracks(&truth, &prior)).unwrap();
        trainer.run(updates).unwrap();
        let found = trainer.coefficients(Some(&truth))[0].value;
        println!("{start:?}: {found}");
        assert!((found - 0.6).abs() < most, "{start:?}: {found}");
    }
}

/// Where the prior errs little the residual is good as well, though a stall is all of the mean square.
#[test]
fn quiet_flight_is_learned_beside_stalls() {
    let (truth, prior) = (model("jsbsim"), model("prior"));
    let quiet = |seed| moved(&truth, &prior, seed, 300, 0.03);
    let held_out: Vec<Track> = (100..103).map(quiet).collect();
    let off = |floor: Option<f64>| {
        let recipe = Recipe { floor, steps: vec![8], ..recipe(3000) };
        let wild = (0..6).map(|seed| moved(&truth, &prior, seed, 1000, 0.8));
        let tracks: Vec<Track> = wild.chain((10..14).map(quiet)).collect();
        let mut trainer = Trainer::new(recipe, &prior, tracks).unwrap();
        trainer.run(3000).unwrap();
        let [one] = free_run(&trainer.model().unwrap(), &held_out, &[50])[..] else { panic!() };
        println!("{floor:?}: {one:?}");
        one.rms
    };
    assert!(off(Recipe::default().floor) < 0.7 * off(None));
}

/// What a frozen prior lacks is learned by the residual, and the model files carry it.
#[test]
fn what_is_missing_goes_into_the_residual_and_into_the_files() {
    let truth = model("jsbsim");
    for integrator in [Integrator::Rk4, Integrator::Jsbsim] {
        let mut prior = model("prior");
        prior.integrator = integrator;
        let mut truth = truth.clone();
        truth.integrator = integrator;
        let held_out = [flight(&truth, &prior, 100, 600)];
        let recipe = Recipe { rate: 3e-3, ..recipe(3000) };
        let mut trainer = Trainer::new(recipe, &prior, tracks(&truth, &prior)).unwrap();
        trainer.run(3000).unwrap();
        let learned = trainer.model().unwrap();
        let [before, after] = [&prior, &learned].map(|m| free_run(m, &held_out, &[1, 50]));
        println!("{integrator:?}: {before:?} {after:?}");
        // a small network in a few seconds: half the error, over 50 steps too
        assert!(after[0].rms < 0.5 * before[0].rms && after[1].rms < 0.5 * before[1].rms);

        let folder = tempfile::tempdir().unwrap();
        let source = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/prior.toml");
        let origin = export::origin(&learned, trainer.data(), 1);
        let said = export::Text { about: "Learned here.", trained: &[] };
        export::save(&learned, &source, said, &origin, folder.path()).unwrap();
        let read = GreyBox::load(&folder.path().join(export::MODEL)).unwrap();
        assert_eq!(read.description, "Learned here.");
        assert_eq!(read.residual, learned.residual);
        assert_eq!(free_run(&read, &held_out, &[50]), free_run(&learned, &held_out, &[50]));
        std::fs::remove_file(folder.path().join(export::RESIDUAL)).unwrap();
        let said = GreyBox::load(&folder.path().join(export::MODEL)).unwrap_err().to_string();
        assert!(said.contains("residual.safetensors"), "{said}");
    }
}

/// A training that was interrupted and went on ends where one that was not does, to the bit.
#[test]
fn an_interrupted_training_ends_the_same_to_the_bit() {
    let (truth, prior) = (model("jsbsim"), model("prior-mild"));
    let recipe =
        Recipe { trainable: vec!["roll_linear.Clda".into(), JXZ.into()], batch: 48, ..recipe(90) };
    let new = || Trainer::new(recipe.clone(), &prior, tracks(&truth, &prior)).unwrap();
    let mut whole = new();
    whole.run(1000).unwrap();
    assert!(whole.is_done());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    // in the first length of rollouts, at its end, in the second
    for stop in [7, 45, 77] {
        let mut first = new();
        first.run(stop).unwrap();
        first.checkpoint().save(&path).unwrap();
        let mut second = new();
        second.resume(Checkpoint::load(&path).unwrap()).unwrap();
        second.run(1000).unwrap();
        assert_eq!(second.checkpoint(), whole.checkpoint(), "after {stop} updates");
    }
    // a checkpoint of another training is refused
    let other = Recipe { seed: 2, ..recipe.clone() };
    let mut other = Trainer::new(other, &prior, tracks(&truth, &prior)).unwrap();
    let refused = other.resume(Checkpoint::load(&path).unwrap());
    assert!(matches!(refused, Err(TrainError::Checkpoint(_))));
    std::fs::write(&path, b"half a file").unwrap();
    assert!(Checkpoint::load(&path).is_err());
}

/// A table is no coefficient, but the residual has learned what it leaves over.
#[test]
fn a_checkpoint_of_a_prior_with_another_table_or_gravity_is_refused() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let prior = GreyBox::parse(&text, &path).unwrap();
    let changed = text.replace("0.1308, 0.2146", "0.1308, 0.2147");
    assert_ne!(changed, text);
    let other = GreyBox::parse(&changed, &path).unwrap();
    let trainer = |prior: &GreyBox| Trainer::new(recipe(10), prior, tracks(prior, prior)).unwrap();
    let flights = tracks(&prior, &prior);
    let mut same = Trainer::new(recipe(10), &prior, flights.clone()).unwrap();
    same.resume(trainer(&prior).checkpoint()).unwrap();
    let mut another = Trainer::new(recipe(10), &other, flights.clone()).unwrap();
    assert!(another.resume(trainer(&prior).checkpoint()).is_err());
    let mut lighter = prior.clone();
    lighter.atmosphere.gravity = 9.8;
    let mut another = Trainer::new(recipe(10), &lighter, flights).unwrap();
    assert!(another.resume(trainer(&prior).checkpoint()).is_err());
}

#[test]
fn what_cannot_be_trained_is_said_by_name() {
    let (truth, prior) = (model("prior"), model("prior"));
    let tracks = tracks(&truth, &prior);
    let names = |name: &str| Recipe { trainable: vec![name.into()], ..recipe(10) };
    let said = |recipe: Recipe, prior: &GreyBox, tracks: &[Track]| {
        Trainer::new(recipe, prior, tracks.to_vec()).err().map(|e| e.to_string()).unwrap()
    };
    assert!(said(names("roll_linear.Clwrong"), &prior, &tracks).contains("Clwrong"));
    let short = [Track { states: tracks[0].states[..5].to_vec(), ..tracks[0].clone() }];
    assert!(said(recipe(10), &prior, &short).contains("samples"));
    assert!(said(names("roll_linear.Clda"), &prior, &short).contains("samples"));
    let wide = Recipe { hidden: vec![200], ..recipe(10) };
    assert!(said(wide, &prior, &tracks).contains("up to 128 units"));
    let mut low = prior.clone();
    low.join("ground_effect", &[0.1, 0.1, 600.0]).unwrap();
    assert!(said(recipe(10), &low, &tracks).contains("ground_effect"));
    // an elevator that never moves leaves its own coefficients in the dark
    let mut still = tracks;
    still.iter_mut().for_each(|t| t.controls.iter_mut().for_each(|c| c.elevator = 0.0));
    let trainer = Trainer::new(names("pitch_linear.Cmde"), &prior, still).unwrap();
    assert_eq!(trainer.unseen(), ["pitch_linear.Cmde"]);
    assert_eq!(trainer.coefficients(None)[0].start, trainer.coefficients(None)[0].value);
    let none = Recipe { floor: Some(0.0), ..recipe(10) };
    assert!(said(none, &prior, &short).contains("floor"));
    let plain = Recipe { criterion: Criterion::Plain, tau: -1.0, ..recipe(10) };
    assert!(said(plain, &prior, &short).contains("tau"));
}

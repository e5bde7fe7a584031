//! Effects that are read from files: what they give, what they refuse.

use greylag::num::{Dual, Lanes, Real};
use greylag::physics::airframe::Geometry;
use greylag::physics::effects::{Kind, Own, Terms};
use greylag::physics::formula::{Status, Written, file, register};
use greylag::physics::point::Base;
use greylag::physics::rigid_body::ForceAxes;
use greylag::physics::{AirData, Channel, Controls, Point, State};

/// An effect file with `channels` and parameters k and w.
fn text(channels: &str, unit: &str) -> String {
    format!(
        r#"schema = 1
id = "tried"
description = "d"
source = "s"
status = "accepted"
[parameters.k]
value = 1.5
bounds = [-20.0, 20.0]
unit = "{unit}"
meaning = "amount"
[parameters.w]
value = 0.1
width = 0.05
bounds = [0.01, 0.5]
unit = ""
meaning = "width"
{channels}"#
    )
}

/// One channel with the shape constant w in it.
fn channel(factor: &str, shape: &str) -> String {
    format!(
        "[[channels]]\nchannel = \"roll\"\nfactor = \"{factor}\"\nshape = \"{shape} + 0*k*w\"\n"
    )
}

struct All<R>(Vec<(usize, Channel, R)>);

impl<R> Terms<R> for All<R> {
    fn add(&mut self, index: usize, channel: Channel, amount: R) {
        self.0.push((index, channel, amount));
    }
}

/// What one unit of each coefficient of `kind` gives at a point of flight, α and δt being `alpha`, `throttle`.
fn given<R: Real>(kind: Kind, shape: &[f64], alpha: R, throttle: R) -> Vec<(usize, Channel, R)> {
    let number = R::from_f64;
    let geometry = Geometry { area: 0.75, span: 2.1, chord: 0.3571 };
    let state = State { alpha, beta: number(-0.07), p: number(0.4), ..State::NEUTRAL.map(number) };
    let controls = Controls {
        aileron: number(0.1),
        elevator: number(-0.05),
        throttle,
        rudder: number(0.02),
        lagged: None,
    };
    let air = AirData::new(&state, number(1.2), 600.0, &geometry);
    let base = Base::zero();
    let at = Point {
        state: &state,
        controls: &controls,
        air: &air,
        geometry: &geometry,
        axes: ForceAxes::Wind,
        base: &base,
    };
    let mut all = All(Vec::new());
    kind.independent_basis(&at, Own { shape, ..Own::default() }, &mut all);
    kind.dependent_basis(&at, Own { shape, ..Own::default() }, &mut all);
    all.0
}

fn read(text: &str) -> Written {
    file::parse(text).unwrap_or_else(|why| panic!("{why}\n{text}"))
}

#[test]
fn a_formula_gives_what_the_same_effect_of_the_catalogue_gives() {
    // ids of the catalogue with the same as files; the constants differ in name only
    let pairs = [
        (Kind::DihedralAlpha, "roll", "qbar*S*b", "k*alpha*beta"),
        (Kind::DragAlpha2, "drag", "qbar*S", "k*alpha^2"),
        (Kind::PitchBreak, "pitch", "qbar*S*c", "k*alpha^3"),
        (Kind::DragElevatorAbs, "drag", "qbar*S", "k*abs(elevator)"),
    ];
    for (kind, channel, factor, shape) in pairs {
        let text = text("", "1").replace("[parameters.w]", "[unused]");
        let text = text.split("[unused]").next().unwrap().to_owned()
            + &format!(
                "[[channels]]\nchannel = \"{channel}\"\nfactor = \"{factor}\"\nshape = \"{shape}\"\n"
            );
        let own = Kind::Written(Box::leak(Box::new(read(&text))));
        for alpha in [-0.1, 0.0, 0.23] {
            let (a, b) = (given(kind, &[], alpha, 0.3), given(own, &[], alpha, 0.3));
            let amount = |all: &[(usize, Channel, f64)]| all.last().unwrap().2;
            // the order of the products differs: a few units in the last place
            let (a, b) = (amount(&a), amount(&b));
            assert!((a - b).abs() <= 1e-12 * a.abs().max(1.0), "{}: {a} {b}", kind.describe().id);
        }
        let x = |v: f64| Dual::<2>::variable(v, 0);
        let throttle = Dual::<2>::variable(0.3, 1);
        let slope = |kind| given(kind, &[], x(0.23), throttle).last().unwrap().2.gradient[0];
        let (a, b) = (slope(kind), slope(own));
        assert!((a - b).abs() <= 1e-12 * a.abs().max(1.0), "{}: {a} {b}", kind.describe().id);
    }
}

/// What a formula of the angle of attack must give.
type Native = fn(f64) -> f64;

#[test]
fn every_function_is_what_it_says() {
    let w = 0.1;
    let cases: [(&str, Native); 12] = [
        ("k*max(alpha - w, 0)^2", |a| (a - 0.1_f64).max(0.0).powi(2)),
        ("k*min(alpha, w)", |a| a.min(0.1)),
        ("k*sign(alpha)", |a| if a == 0.0 { 0.0 } else { a.signum() }),
        ("k*tanh(alpha/w)", |a| (a / 0.1).tanh()),
        ("k*exp(-alpha/w)", |a| (-a / 0.1_f64).exp()),
        ("k*sin(alpha)*cos(alpha)", |a| a.sin() * a.cos()),
        ("k*sqrt(alpha^2 + w^2)", |a| (a * a + 0.01).sqrt()),
        ("k*deadband(alpha, w)", |a| a - a.clamp(-0.1, 0.1)),
        ("k*smoothstep(0, w, alpha)", |a| {
            let t = (a / 0.1).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }),
        ("k*table(alpha; -0.1:1, 0.1:3)", |a| 2.0 + 10.0 * a.clamp(-0.1, 0.1)),
        ("k*alpha/(1 + alpha^2)", |a| a / (1.0 + a * a)),
        ("k*clamp(alpha, -w, w) - k*alpha^-2*0.0001", |a| a.clamp(-0.1, 0.1) - 1e-4 / (a * a)),
    ];
    for (shape, truth) in cases {
        let full = shape.replace("alpha^-2", "max(abs(alpha), 0.01)^-2");
        let effect =
            Kind::Written(Box::leak(Box::new(read(&text(&channel("qbar*S*b", &full), "1")))));
        for alpha in [-0.23, 0.04, 0.31] {
            let all = given(effect, &[w], alpha, 0.5);
            let q_s = 0.5 * 1.2 * 16.67_f64.powi(2) * 0.75 * 2.1;
            let (got, meant) = (all[0].2, q_s * truth(alpha));
            assert!((got - meant).abs() < 1e-9 * q_s, "{shape} at {alpha}: {got} {meant}");
            let lanes = given(effect, &[w], Lanes::<16>::splat(alpha as f32), Lanes::splat(0.5));
            let single = f64::from(lanes[0].2.0[7]);
            assert!((single - meant).abs() < 1e-4 * q_s, "{shape} in lanes: {single} {meant}");
            let dual = given(effect, &[w], Dual::<1>::variable(alpha, 0), Dual::from_f64(0.5));
            let h = 1e-6;
            let slope = q_s * (truth(alpha + h) - truth(alpha - h)) / (2.0 * h);
            let own = dual[0].2.gradient[0];
            assert!((own - slope).abs() < 1e-4 * slope.abs().max(q_s), "{shape}: {own} {slope}");
        }
    }
}

#[test]
fn what_is_wrong_is_said_with_line_and_cure() {
    let cases = [
        (channel("qbar*S", "k*alpha"), "1", ["line 20", "unit m"]),
        (channel("qbar*S*b", "k*alhpa"), "1", ["column 12", "alpha"]),
        (channel("qbar*S*b", "k*(airspeed - 17)"), "1", ["balance", "m s^-1"]),
        (channel("qbar*S*b", "k*tanh(p)"), "1", ["tanh takes a number", "s^-1"]),
        (channel("qbar*S*b", "k/alpha"), "1", ["not finite at", "max"]),
        (channel("qbar*S*b", "k*sqrt(alpha)"), "1", ["not finite at", "alpha = -0.6"]),
        (channel("qbar*S*b", "k + 0.1"), "1", ["no parameter", "k*"]),
        (channel("qbar*S*b", "k*lag(alpha, 0.1)"), "1", ["takes only aileron", "alpha_dot"]),
        (channel("qbar*S*b", "k"), "furlong", ["furlong", "SI units"]),
        (String::new(), "1", ["channels", "missing"]),
    ];
    for (channels, unit, words) in cases {
        let text = text(&channels, unit);
        let why = file::parse(&text).unwrap_err();
        assert!(words.iter().all(|w| why.contains(w)), "{words:?} not in: {why}\n{text}");
    }
    let same = text(&channel("qbar*S*b", "k"), "1").replace("\"tried\"", "\"cg_shift\"");
    assert!(file::parse(&same).unwrap_err().contains("another id"));
}

#[test]
fn a_file_read_again_after_an_edit_takes_its_place() {
    let shipped = include_str!("../../params/effects/yaw_by_throttle.toml");
    let first = register::read(shipped).unwrap();
    assert!(std::ptr::eq(first, register::read(shipped).unwrap()));
    assert_eq!(first.status, Status::Accepted);
    assert_eq!(first.about.formula, "yaw = k*throttle");
    let edited = register::read(&shipped.replace("20.0", "30.0")).unwrap();
    let found = Kind::from_id("yaw_by_throttle").unwrap();
    assert_eq!(found.describe().coefficients[0].bounds, (-30.0, 30.0));
    assert!(!std::ptr::eq(first, edited));
    let all = given(Kind::Written(first), &[], 0.0, 0.25);
    assert_eq!(all, [(0, Channel::Yaw, 0.25)]);
}

#[test]
fn shape_constants_come_last_and_have_starts() {
    let effect = read(&text(&channel("qbar*S*b", "k*max(abs(beta) - w, 0)"), "1"));
    let names: Vec<&str> = effect.about.coefficients.iter().map(|c| c.name).collect();
    assert_eq!((names, effect.about.shape), (vec!["k", "w"], 1));
    let starts = effect.about.entry.unwrap().starts;
    // its own place, the constant a width below and above, and all with the other sign
    assert_eq!(starts.len(), 6);
    assert_eq!(starts[1], [1.5, 0.05]);
    assert_eq!(effect.kinks(), ["max", "abs"]);
}

#[test]
fn no_text_makes_the_reader_panic() {
    // 3000 mutations take a second; examples/fuzz_effect_files.rs runs a million
    greylag::physics::formula::fuzz::run(3000, 7, &mut |_, _| ());
}

/// The shipped effect file with one text of it replaced.
fn changed(from: &str, to: &str) -> Result<(), String> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("params/effects/yaw_by_throttle.toml");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from}");
    greylag::physics::formula::file::parse(&text.replace(from, to)).map(drop)
}

const SHAPED: &str = "\n[parameters.w]\nvalue = 0.1\nbounds = [0.0, 0.5]\nunit = \"\"\nmeaning = \"m\"\n[[channels]]";

#[test]
fn a_constant_whose_bound_makes_the_formula_no_number_is_refused() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("params/effects/yaw_by_throttle.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let with = |shape: &str, bounds: &str| {
        let text = text.replacen("[[channels]]", &SHAPED.replace("[0.0, 0.5]", bounds), 1);
        let line = text.lines().find(|l| l.starts_with("shape")).unwrap().to_owned();
        greylag::physics::formula::file::parse(
            &text.replace(&line, &format!("shape = \"{shape}\"")),
        )
    };
    // a search may move w to 0, where alpha = 0 divides by it
    let said = with("k*throttle*exp(-alpha/w)", "[0.0, 0.5]").unwrap_err();
    assert!(said.contains("with w at its bound 0"), "{said}");
    with("k*throttle*exp(-alpha/w)", "[0.01, 0.5]").unwrap();
}

#[test]
fn a_unit_of_a_power_beyond_reason_is_an_error() {
    assert!(changed("unit = \"N m\"", "unit = \"m^-32768\"").unwrap_err().contains("unit"));
}

#[test]
fn a_formula_that_never_ends_is_refused() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("params/effects/yaw_by_throttle.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let line = text.lines().find(|l| l.starts_with("shape")).unwrap().to_owned();
    // each of sixty parts multiplies by 161 variables
    let long = format!("shape = \"(k{})*throttle{}\"", "+k".repeat(59), "*alpha^4".repeat(40));
    let four = format!("\n[[channels]]\nchannel = \"yaw\"\n{long}\n").repeat(4);
    let said =
        greylag::physics::formula::file::parse(&(text.replace(&line, &long) + &four)).unwrap_err();
    assert!(said.contains("operations"), "{said}");
}

//! Compares the evaluation time of an effect from a file with that of the same effect in Rust. The times are measured for SIMD
//! lanes, for double precision and for dual numbers with derivatives.
//!
//! `cargo run --release --ignore-rust-version --no-default-features --features speed --example formula_speed`

use std::hint::black_box;
use std::time::Instant;

use greylag::num::{Dual, Lanes, Real};
use greylag::physics::airframe::Geometry;
use greylag::physics::effects::{Kind, Own, Terms};
use greylag::physics::formula::file;
use greylag::physics::point::Base;
use greylag::physics::rigid_body::ForceAxes;
use greylag::physics::{AirData, Channel, Controls, Point, State};

const FILE: &str = r#"schema = 1
id = "tried"
description = "d"
source = "s"
status = "accepted"
[parameters.k]
value = 1.5
bounds = [-20.0, 20.0]
unit = ""
meaning = "amount"
[[channels]]
channel = "roll"
factor = "qbar*S*b"
shape = "k*alpha*beta"
"#;

struct Sum<R>(R);

impl<R: Real> Terms<R> for Sum<R> {
    #[inline(always)]
    fn add(&mut self, _: usize, _: Channel, amount: R) {
        self.0 += amount;
    }
}

/// Time of one evaluation of `kind`, ns: the smallest of ten runs.
fn time<R: Real>(kind: Kind) -> f64 {
    const TIMES: usize = 200_000;
    let number = R::from_f64;
    let geometry = Geometry { area: 0.75, span: 2.1, chord: 0.3571 };
    let mut state = State::NEUTRAL.map(number);
    (state.alpha, state.beta) = (number(0.1), number(-0.05));
    let controls = Controls::default();
    let controls = Controls {
        aileron: number(0.1),
        elevator: number(controls.elevator),
        throttle: number(0.3),
        rudder: number(0.0),
        lagged: None,
    };
    let air = AirData::new(&state, number(1.2), 600.0, &geometry);
    let base = Base::zero();
    let run = || {
        let begun = Instant::now();
        let mut sum = Sum(R::zero());
        for _ in 0..TIMES {
            let at = Point {
                state: black_box(&state),
                controls: &controls,
                air: black_box(&air),
                geometry: &geometry,
                axes: ForceAxes::Wind,
                base: &base,
            };
            kind.independent_basis(&at, Own::default(), &mut sum);
            kind.dependent_basis(&at, Own::default(), &mut sum);
        }
        black_box(sum.0);
        begun.elapsed().as_secs_f64() * 1e9 / TIMES as f64
    };
    (0..10).map(|_| run()).fold(f64::INFINITY, f64::min)
}

fn main() {
    let written = Kind::Written(Box::leak(Box::new(file::parse(FILE).expect("an effect file"))));
    let native = Kind::DihedralAlpha;
    println!("ns an evaluation of l = Q b k α β       file   Rust");
    let line = |name: &str, a: f64, b: f64| println!("{name:38}{a:6.1} {b:6.1}");
    line("f64", time::<f64>(written), time::<f64>(native));
    line("8 lanes of f32", time::<Lanes<8>>(written), time::<Lanes<8>>(native));
    line("16 lanes of f32", time::<Lanes<16>>(written), time::<Lanes<16>>(native));
    line("value and 5 derivatives, f64", time::<Dual<5>>(written), time::<Dual<5>>(native));
    line("value and 11 derivatives, f64", time::<Dual<11>>(written), time::<Dual<11>>(native));
}

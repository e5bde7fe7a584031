//! Compares the speed of training, planning and policies with burn and PyTorch, on one core.
//!
//! ```text
//! examples/side_by_side/setup target/torch-venv       # PyTorch from PyPI: 3 GB, once; not needed
//! cargo run --release --ignore-rust-version --features sitl,learn,speed --example side_by_side -- \
//!     [--python target/torch-venv/bin/python] [--rounds 9]
//! ```
//!
//! In each round, all methods of a task run one after the other. The times are processor times, which other programs hardly
//! affect. The printed times are medians over the rounds, and the printed ratios are medians of the ratios in each round.

mod alone;
mod burn_side;
mod clock;
#[path = "../../tests/learn/learn_support/in_burn.rs"]
mod in_burn;
mod problem;
mod processor;
mod torch;

use std::cell::RefCell;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use greylag::control::{self, ControllerKind, Source};
use greylag::learn::{Arithmetic, Engine, Passes, PriorSlopes, Subject};
use greylag::model::Integrator;

use problem::{BATCH, PLANS, Rollouts, STEPS, Scoring};
use torch::Torch;

/// Times of calls, and the result of the last call.
#[derive(Clone, Debug, Default, serde::Deserialize)]
pub struct Timed {
    /// Time of each call, or the mean time of several calls, s.
    pub seconds: Vec<f64>,
    /// Result of the last call.
    pub value: f64,
}

/// An implementation of a task.
struct Method<'a> {
    name: &'static str,
    /// Required ratio of this method's time to Greylag's.
    asked: Option<f64>,
    /// Expected result, with a relative tolerance of 0.001; `None` if the result is not checked.
    expected: Option<f64>,
    /// Makes and times the given number of calls.
    run: Box<dyn FnMut(usize) -> Result<Timed> + 'a>,
}

impl<'a> Method<'a> {
    fn new(name: &'static str, run: impl FnMut(usize) -> Result<Timed> + 'a) -> Method<'a> {
        Method { name, asked: None, expected: None, run: Box::new(run) }
    }

    fn finds(self, value: f64) -> Method<'a> {
        Method { expected: Some(value), ..self }
    }

    fn asked(self, ratio: f64) -> Method<'a> {
        Method { asked: Some(ratio), ..self }
    }
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// Runs all methods in each of `rounds` rounds, with `calls` calls each, and prints a line for each method. The first method
/// must be Greylag's.
fn compare(task: &str, [rounds, calls]: [usize; 2], mut methods: Vec<Method>) -> Result<()> {
    let mut seconds = vec![Vec::new(); methods.len()];
    for _ in 0..rounds {
        for (method, seconds) in methods.iter_mut().zip(&mut seconds) {
            let timed = (method.run)(calls)?;
            if let Some(expected) = method.expected {
                let off = (timed.value / expected - 1.0).abs();
                let said = format!("{task}, {}: {} is not {expected}", method.name, timed.value);
                ensure!(off < 1e-3, "{said}: another sum was computed");
            }
            seconds.push(median(timed.seconds));
        }
    }
    println!("{task}");
    for (method, times) in methods.iter().zip(&seconds) {
        let ratio = median(times.iter().zip(&seconds[0]).map(|(a, b)| a / b).collect());
        let asked = method.asked.map(|x| format!("   asked: {x}")).unwrap_or_default();
        let time = 1e3 * median(times.clone());
        println!("  {:<20} {time:>9.3} ms {ratio:>8.2} times ours{asked}", method.name);
    }
    Ok(())
}

/// Makes a function that times Greylag's training steps.
fn train(problem: &Rollouts) -> impl FnMut(usize) -> Result<Timed> + '_ {
    let subject = Subject {
        scales: problem.scales(),
        prior: problem.prior.clone(),
        network: Passes::new(problem.network.clone()),
        prior_slopes: PriorSlopes::All,
    };
    let mut engine = Engine::new(&subject, BATCH, STEPS, Arithmetic::Lanes);
    move |calls| {
        let Rollouts { objective, tracks, windows, .. } = problem;
        let mut timed = Timed::default();
        for _ in 0..calls {
            let start = clock::now();
            let (loss, _) = engine.step(&subject, objective, tracks, windows, STEPS);
            timed.seconds.push(clock::now() - start);
            timed.value = loss.objective;
        }
        Ok(timed)
    }
}

/// Makes a function that times ticks of Greylag's planner. A tick includes sampling and refitting, with its rollouts in four
/// iterations.
fn plan(problem: &Scoring) -> Result<impl FnMut(usize) -> Result<Timed> + '_> {
    let source = Source { model: &problem.model, agent: Some(&problem.agent), changes: &[] };
    let mut controller = control::build(ControllerKind::Hybrid, source)?;
    controller.reset(1);
    Ok(move |calls| {
        let mut timed = Timed::default();
        for _ in 0..calls {
            let start = clock::now();
            std::hint::black_box(controller.command(&problem.seen, &problem.target));
            timed.seconds.push(clock::now() - start);
        }
        Ok(timed)
    })
}

struct Arguments {
    python: Option<PathBuf>,
    rounds: usize,
}

fn arguments() -> Result<Arguments> {
    let mut found = Arguments { python: None, rounds: 9 };
    let mut given = std::env::args().skip(1);
    while let Some(flag) = given.next() {
        let value = given.next().with_context(|| format!("{flag} takes a value"))?;
        match flag.as_str() {
            "--python" => found.python = Some(value.into()),
            "--rounds" => found.rounds = value.parse().context("--rounds takes a number")?,
            _ => anyhow::bail!("{flag} is unknown; there are --python PATH and --rounds N"),
        }
    }
    Ok(found)
}

fn main() -> Result<()> {
    let Arguments { python, rounds } = arguments()?;
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let schemes = [Integrator::Rk4, Integrator::Jsbsim].map(Rollouts::new);
    let scorings = [
        Scoring::new("shipped", &[128, 128], &[128, 128])?,
        Scoring::new("paper", &[300, 300], &[200, 200, 200])?,
    ];
    let [rk4, jsbsim] = schemes;
    let (rk4, jsbsim) = (rk4?, jsbsim?);
    let told = problem::told(&rk4, &scorings);
    let torch = python.map(|python| Torch::start(&python, &told)).transpose()?.map(RefCell::new);
    let ask = |task: String| {
        let torch = torch.as_ref()?;
        Some(move |calls: usize| torch.borrow_mut().time(&task, calls))
    };
    for (problem, scheme) in [(&rk4, "rk4"), (&jsbsim, "jsbsim")] {
        let mut ours = Method::new("ours", train(problem));
        let value = (ours.run)(1)?.value;
        let burn = Method::new("burn, autodiff", burn_side::rollouts(problem));
        let mut methods = vec![ours, burn.finds(value).asked(20.0)];
        if let Some(run) = ask(format!("rollouts-{scheme}-eager")) {
            methods.push(Method::new("PyTorch, eager", run).finds(value));
        }
        if let Some(run) = ask(format!("rollouts-{scheme}-compiled")) {
            methods.push(Method::new("PyTorch, compiled", run).finds(value).asked(5.0));
        }
        let task = format!("training step, {scheme}: {BATCH} rollouts of {STEPS} steps, 2 × 64");
        compare(&task, [rounds, 3], methods)?;
    }
    for problem in &scorings {
        // the other methods score given plans; Greylag's planner draws its own
        let value = problem.expected();
        let burn = Method::new("burn", burn_side::scoring(problem));
        let mut methods =
            vec![Method::new("ours, whole tick", plan(problem)?), burn.finds(value).asked(4.0)];
        let how = [("eager", "PyTorch, eager"), ("compiled", "PyTorch, compiled")];
        for (how, name) in how {
            if let Some(run) = ask(format!("scoring-{}-{how}", problem.name)) {
                methods.push(Method::new(name, run).finds(value).asked(4.0));
            }
        }
        let sizes = [problem.agent.actor.network().sizes(), problem.critics()[0].network().sizes()];
        compare(&format!("{PLANS} plans scored, {sizes:?}"), [rounds, 5], methods)?;
    }
    let mut methods = vec![Method::new("ours, on burn", alone::updates()?)];
    if let Some(run) = ask("td3".into()) {
        methods.push(Method::new("PyTorch, eager, fused Adam", run).asked(1.0));
    }
    compare("TD3 update, Table VII (asked: 6.43 ms)", [rounds, 20], methods)?;
    alone::print(&scorings)
}

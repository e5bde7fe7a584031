//! CEM-MPC: the cross-entropy method over a short horizon of the model, section III-D of \[GSFM26\].

mod rollout;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::control::task::Task;
use crate::control::{Controller, Observation, Target};
use crate::model::GreyBox;
use crate::num::{Lanes, Real, stream};
use crate::physics::Command;
use rollout::{Block, HORIZON, Instructions, Scene, WIDTH};

/// Size of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Candidates per iteration N, a multiple of 16.
    pub population: usize,
    /// Candidates kept K.
    pub elites: usize,
    /// Iterations I.
    pub iterations: usize,
    /// Standard deviation of the first iteration, in units of the action.
    pub spread: f64,
}

impl Settings {
    /// H = 5 is the paper's; N, K, I are not given there: 1024 rollouts a step in all.
    pub const PAPER: Settings =
        Settings { population: 256, elites: 16, iterations: 4, spread: 1.0 };
}

/// An action in the paper's units: aileron, elevator and throttle in −1..1 (eq. 29).
type Action = [f64; 3];

/// The planner. All its memory is taken when it is built; a plan costs the same every time.
#[derive(Clone, Debug)]
pub struct Cem {
    model: GreyBox,
    settings: Settings,
    instructions: Instructions,
    blocks: Vec<Block>,
    returns: Vec<Lanes<WIDTH>>,
    order: Vec<(f32, u32)>,
    seed: u64,
    tick: u64,
}

impl Cem {
    /// A planner through `model`.
    pub fn new(model: &GreyBox, settings: Settings) -> Cem {
        let count = settings.population.div_ceil(WIDTH);
        Cem {
            model: model.clone(),
            settings,
            instructions: Instructions::detect(),
            blocks: vec![[[Lanes::zero(); 3]; HORIZON]; count],
            returns: vec![Lanes::zero(); count],
            order: Vec::with_capacity(count * WIDTH),
            seed: 0,
            tick: 0,
        }
    }

    fn sample(&mut self, rng: &mut impl Rng, mean: &[Action; HORIZON], spread: &[Action; HORIZON]) {
        for block in &mut self.blocks {
            for ((actions, mean), spread) in block.iter_mut().zip(mean).zip(spread) {
                for ((lanes, m), s) in actions.iter_mut().zip(mean).zip(spread) {
                    for x in &mut lanes.0 {
                        let normal: f64 = StandardNormal.sample(rng);
                        *x = (m + s * normal).clamp(-1.0, 1.0) as f32;
                    }
                }
            }
        }
    }

    /// Mean and standard deviation of the elites' actions; `None` if no candidate stays finite.
    fn refit(&mut self) -> Option<([Action; HORIZON], [Action; HORIZON])> {
        self.order.clear();
        for (b, returns) in self.returns.iter().enumerate() {
            for (i, &value) in returns.0.iter().enumerate() {
                // a candidate that leaves the numbers is the worst there is
                let value = if value.is_finite() { value } else { f32::NEG_INFINITY };
                self.order.push((value, (b * WIDTH + i) as u32));
            }
        }
        let elites = self.settings.elites.clamp(1, self.order.len());
        // ties go to the lower index, so the order is the same everywhere
        self.order
            .select_nth_unstable_by(elites - 1, |a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let chosen = &mut self.order[..elites];
        if chosen.iter().any(|(value, _)| *value == f32::NEG_INFINITY) {
            return None;
        }
        chosen.sort_unstable_by_key(|&(_, index)| index);
        let mut mean = [[0.0; 3]; HORIZON];
        let mut square = [[0.0; 3]; HORIZON];
        for &(_, index) in chosen.iter() {
            let (block, lane) = (index as usize / WIDTH, index as usize % WIDTH);
            for h in 0..HORIZON {
                for c in 0..3 {
                    let a = f64::from(self.blocks[block][h][c].0[lane]);
                    mean[h][c] += a / elites as f64;
                    square[h][c] += a * a / elites as f64;
                }
            }
        }
        let deviation =
            |h: usize, c: usize| (square[h][c] - mean[h][c] * mean[h][c]).max(0.0).sqrt();
        let spread = std::array::from_fn(|h| std::array::from_fn(|c| deviation(h, c)));
        Some((mean, spread))
    }
}

impl Controller for Cem {
    fn name(&self) -> &'static str {
        "cem"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, seed: u64) {
        (self.seed, self.tick) = (seed, 0);
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let mut rng = stream::stream(self.seed, &[self.tick]);
        self.tick += 1;
        let mut mean = [[0.0; 3]; HORIZON];
        let mut spread = [[self.settings.spread; 3]; HORIZON];
        for _ in 0..self.settings.iterations {
            self.sample(&mut rng, &mean, &spread);
            let scene = Scene { model: &self.model, task: &Task::PAPER, seen, target };
            self.instructions.returns(&scene, &self.blocks, &mut self.returns);
            match self.refit() {
                Some(fitted) => (mean, spread) = fitted,
                // said by a command that is no number: whoever flies has a fallback
                None => {
                    return Command { aileron: f64::NAN, elevator: f64::NAN, throttle: f64::NAN };
                }
            }
        }
        let [aileron, elevator, thrust] = mean[0];
        Command { aileron, elevator, throttle: (thrust + 1.0) / 2.0 }.clamped()
    }
}

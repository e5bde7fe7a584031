//! The candidates of one iteration of the cross-entropy method (CEM): sampling, simulation, and update of the distribution.
//!
//! A candidate is a plan: aileron, elevator and throttle at every step of the horizon. A block holds one candidate per SIMD
//! lane.

use std::cmp::Ordering;
use std::time::Instant;

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::rollout::{Actions, HORIZON, Scene, WIDTH, Worth};
use super::{Cem, Plan, Update, Valued};
use crate::disturbance::{self, Disturbance};
use crate::task::Task;
use crate::{Observation, Target};

impl Cem {
    /// Samples the candidates of the blocks from `first` on, with the mean `mean` and the standard deviation `spread`. The
    /// noise of a candidate is correlated over the steps by `Settings::persistence`. Actions are clamped to ±1.
    pub(super) fn sample(&mut self, rng: &mut impl Rng, first: usize, mean: &Plan, spread: &Plan) {
        let begun = Instant::now();
        let old = self.settings.persistence;
        let new = (1.0 - old * old).sqrt();
        for block in &mut self.blocks[first..] {
            let mut noise = [[0.0; WIDTH]; 3];
            for h in 0..HORIZON {
                for c in 0..3 {
                    for i in 0..WIDTH {
                        let normal: f64 = StandardNormal.sample(rng);
                        let part = if h == 0 { [0.0, 1.0] } else { [old, new] };
                        noise[c][i] = part[0] * noise[c][i] + part[1] * normal;
                        let x = mean[h][c] + spread[h][c] * noise[c][i];
                        block[h][c][i] = x.clamp(-1.0, 1.0) as f32;
                    }
                }
            }
        }
        self.spent.draw += begun.elapsed();
    }

    /// Samples the noise that is added to the plans proposed by the policy or the base controller, in the blocks from `first`
    /// up to `end`. The first candidate has no noise.
    pub(super) fn sample_noise(&mut self, rng: &mut impl Rng, [first, end]: [usize; 2]) {
        let begun = Instant::now();
        let [deviation, most] = self.settings.noise;
        for (b, block) in self.blocks[first..end].iter_mut().enumerate() {
            for lanes in block.iter_mut().flatten() {
                for (i, x) in lanes.iter_mut().enumerate() {
                    let normal: f64 = StandardNormal.sample(rng);
                    let noise = (deviation * normal).clamp(-most, most);
                    *x = if b + i == 0 { 0.0 } else { noise as f32 };
                }
            }
        }
        self.spent.draw += begun.elapsed();
    }

    /// Simulates the candidates in the blocks from `first` up to `end` and stores their returns.
    pub(super) fn fly(
        &mut self,
        seen: &Observation,
        target: &Target,
        actions: Actions,
        [first, end]: [usize; 2],
    ) {
        let begun = Instant::now();
        let scene = Scene {
            model: &self.model,
            task: &Task::PAPER,
            seen,
            target,
            agent: self.agent.as_ref(),
            alpha: self.settings.alpha,
            surrogate: self.surrogate,
            memory: self.disturbance().map(Disturbance::memory).unwrap_or_default(),
            disturbance: self.disturbance().map_or(disturbance::NONE, Disturbance::rate),
            ahead: self.base.as_ref().map(|base| &base.ahead),
            steps: self.settings.steps.max(HORIZON),
            sideslip: self.sideslip,
        };
        let (blocks, worth) = (&mut self.blocks[first..end], &mut self.worth[first..end]);
        // the split keeps the pairs of blocks that one core would form, so that the results are bit-identical
        let half = blocks.len().div_ceil(4) * 2;
        match &mut self.second {
            Some(second) if half < blocks.len() => {
                let (head, tail) = blocks.split_at_mut(half);
                let (worth_head, worth_tail) = worth.split_at_mut(half);
                let machine = &mut self.machine;
                rayon::join(
                    || machine.fly(&scene, actions, head, worth_head),
                    || second.fly(&scene, actions, tail, worth_tail),
                );
            }
            _ => self.machine.fly(&scene, actions, blocks, worth),
        }
        self.spent.fly += begun.elapsed();
    }

    /// The plan and the return of the candidate `index`, and the disagreement of the critics on its terminal value.
    pub(super) fn candidate(&self, index: usize) -> Valued {
        let (block, lane) = (index / WIDTH, index % WIDTH);
        let actions = &self.blocks[block];
        let plan = std::array::from_fn(|h| std::array::from_fn(|c| actions[h][c][lane].into()));
        let Worth { returns, doubt, .. } = self.worth[block];
        Valued { plan, worth: returns[lane], doubt: doubt[lane] }
    }

    /// Weighted mean and standard deviation of the actions of the candidates in the blocks up to `end`, and the best candidate.
    /// [`Update`] sets the weights. `None` if too few returns are finite.
    pub(super) fn refit(&mut self, end: usize) -> Option<(Plan, Plan, Valued)> {
        let begun = Instant::now();
        let refitted = self.refitted(end);
        self.spent.refit += begun.elapsed();
        refitted
    }

    fn refitted(&mut self, end: usize) -> Option<(Plan, Plan, Valued)> {
        self.order.clear();
        for (b, worth) in self.worth[..end].iter().enumerate() {
            for (i, &value) in worth.returns.iter().enumerate() {
                // a return that is not finite ranks last
                let value = if value.is_finite() { value } else { f32::NEG_INFINITY };
                self.order.push((value, (b * WIDTH + i) as u32));
            }
        }
        let &best = self.order.iter().min_by(|a, b| better(a, b))?;
        let count = match self.settings.update {
            Update::Elites(count) => count.clamp(1, self.order.len()),
            Update::Weighted(_) => self.order.len(),
        };
        self.order.select_nth_unstable_by(count - 1, better);
        let weighted = matches!(self.settings.update, Update::Weighted(_));
        let chosen = &mut self.order[..count];
        let lost = |(value, _): &(f32, u32)| *value == f32::NEG_INFINITY;
        if lost(&best) || !weighted && chosen.iter().any(lost) {
            return None;
        }
        chosen.sort_unstable_by_key(|&(_, index)| index);
        let mut all = 0.0;
        let mut mean = [[0.0; 3]; HORIZON];
        let mut square = [[0.0; 3]; HORIZON];
        for &(value, index) in chosen.iter() {
            let weight = match self.settings.update {
                Update::Elites(_) => 1.0,
                Update::Weighted(scale) => (f64::from(value - best.0) / scale).exp(),
            };
            all += weight;
            let (block, lane) = (index as usize / WIDTH, index as usize % WIDTH);
            for h in 0..HORIZON {
                for c in 0..3 {
                    let a = f64::from(self.blocks[block][h][c][lane]);
                    mean[h][c] += weight * a;
                    square[h][c] += weight * a * a;
                }
            }
        }
        mean.iter_mut().chain(&mut square).flatten().for_each(|x| *x /= all);
        let deviation =
            |h: usize, c: usize| (square[h][c] - mean[h][c] * mean[h][c]).max(0.0).sqrt();
        let spread = std::array::from_fn(|h| std::array::from_fn(|c| deviation(h, c)));
        Some((mean, spread, self.candidate(best.1 as usize)))
    }

    /// Keeps the plans of the `count` best candidates as candidates of the next iteration.
    pub(super) fn keep(&mut self, count: usize) {
        let count = count.min(self.order.len());
        self.kept.clear();
        if count == 0 {
            return;
        }
        self.order.select_nth_unstable_by(count - 1, better);
        for k in 0..count {
            let plan = self.candidate(self.order[k].1 as usize).plan;
            self.kept.push(plan);
        }
    }

    /// Writes `plan` into one lane of a block.
    pub(super) fn put(&mut self, block: usize, lane: usize, plan: &Plan) {
        for (actions, given) in self.blocks[block].iter_mut().zip(plan) {
            actions.iter_mut().zip(given).for_each(|(lanes, x)| lanes[lane] = *x as f32);
        }
    }
}

/// Orders candidates by falling return. Between equal returns the lower index comes first, so that the order is the same on
/// every machine.
fn better(a: &(f32, u32), b: &(f32, u32)) -> Ordering {
    b.0.total_cmp(&a.0).then(a.1.cmp(&b.1))
}

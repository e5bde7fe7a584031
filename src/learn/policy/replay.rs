//! The replay buffer: the most recent transitions, from which minibatches are sampled.

use rand::{Rng, RngExt};

use greylag_control::policy::{ACTIONS, OBSERVATIONS};

/// One transition of an aircraft: observation, action, reward, next observation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Observation o of the step.
    pub observed: [f32; OBSERVATIONS],
    /// Action a of the step.
    pub action: [f32; ACTIONS],
    /// Reward r of the step.
    pub reward: f32,
    /// Next observation, o'.
    pub next: [f32; OBSERVATIONS],
    /// Factor on the value of the next state in the critic's target: 1, or 0 if the aircraft was lost (terminal state).
    pub goes_on: f32,
}

/// Number of values stored per transition.
const NUMBERS: usize = 2 * OBSERVATIONS + ACTIONS + 2;

/// A minibatch, row after row.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Number of rows.
    pub size: usize,
    /// Observations o, `[size, OBSERVATIONS]`.
    pub observed: Vec<f32>,
    /// Actions a, `[size, ACTIONS]`.
    pub action: Vec<f32>,
    /// Rewards r, `[size]`.
    pub reward: Vec<f32>,
    /// Next observations o', `[size, OBSERVATIONS]`.
    pub next: Vec<f32>,
    /// Factors on the value of the next state, see [`Transition::goes_on`].
    pub goes_on: Vec<f32>,
}

/// The replay buffer. When it is full the oldest transition is overwritten.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    capacity: usize,
    numbers: Vec<f32>,
    /// Number of transitions ever added.
    added: u64,
}

impl Replay {
    /// A buffer of `capacity` transitions, allocated as they are added.
    pub fn new(capacity: usize) -> Replay {
        Replay { capacity, numbers: Vec::new(), added: 0 }
    }

    /// The buffer with the contents [`numbers`](Replay::numbers) and [`added`](Replay::added) of an earlier buffer.
    /// `None` if the number of values does not match the capacity.
    pub fn restore(capacity: usize, numbers: Vec<f32>, added: u64) -> Option<Replay> {
        let held = (capacity as u64).min(added) as usize;
        (numbers.len() == held * NUMBERS).then_some(Replay { capacity, numbers, added })
    }

    /// Number of transitions stored.
    pub fn held(&self) -> usize {
        self.numbers.len() / NUMBERS
    }

    /// Number of transitions ever added.
    pub fn added(&self) -> u64 {
        self.added
    }

    /// All stored values, for a checkpoint.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// Adds a transition to the buffer.
    pub fn add(&mut self, t: &Transition) {
        let mut row = [0.0; NUMBERS];
        let mut place = 0;
        let parts: [&[f32]; 5] = [&t.observed, &t.action, &[t.reward], &t.next, &[t.goes_on]];
        for part in parts {
            row[place..place + part.len()].copy_from_slice(part);
            place += part.len();
        }
        let at = (self.added % self.capacity as u64) as usize * NUMBERS;
        if at == self.numbers.len() {
            self.numbers.extend(row);
        } else {
            self.numbers[at..at + NUMBERS].copy_from_slice(&row);
        }
        self.added += 1;
    }

    /// Samples `size` transitions uniformly, with replacement, into `batch`.
    ///
    /// # Panics
    ///
    /// If the buffer is empty.
    pub fn draw(&self, rng: &mut impl Rng, size: usize, batch: &mut Batch) {
        let Batch { observed, action, reward, next, goes_on, .. } = batch;
        [&mut *observed, action, reward, next, goes_on].into_iter().for_each(|part| part.clear());
        for _ in 0..size {
            let row = &self.numbers[rng.random_range(0..self.held()) * NUMBERS..][..NUMBERS];
            let (o, rest) = row.split_at(OBSERVATIONS);
            let (a, rest) = rest.split_at(ACTIONS);
            observed.extend(o);
            action.extend(a);
            reward.push(rest[0]);
            next.extend(&rest[1..=OBSERVATIONS]);
            goes_on.push(rest[1 + OBSERVATIONS]);
        }
        batch.size = size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_num::stream;

    fn transition(k: usize) -> Transition {
        let x = k as f32;
        Transition {
            observed: [x; OBSERVATIONS],
            action: [x; 3],
            reward: x,
            next: [-x; OBSERVATIONS],
            goes_on: 1.0,
        }
    }

    #[test]
    fn the_oldest_gives_way_and_rows_stay_together() {
        let mut replay = Replay::new(10);
        (0..25).for_each(|k| replay.add(&transition(k)));
        assert_eq!((replay.held(), replay.added()), (10, 25));
        let mut batch = Batch::default();
        replay.draw(&mut stream::stream(1, &[]), 400, &mut batch);
        let mut seen = [false; 25];
        for k in 0..400 {
            let x = batch.reward[k];
            seen[x as usize] = true;
            assert!(batch.observed[OBSERVATIONS * k..][..OBSERVATIONS].iter().all(|o| *o == x));
            assert!(batch.action[3 * k..3 * k + 3].iter().all(|a| *a == x));
            assert!(batch.next[OBSERVATIONS * k..][..OBSERVATIONS].iter().all(|o| *o == -x));
        }
        // 400 draws miss a given one of ten transitions with a probability below 10⁻¹⁸
        assert_eq!(seen.iter().position(|s| *s), Some(15));
        assert!(seen[15..].iter().all(|s| *s));
    }

    #[test]
    fn a_memory_is_restored_from_its_numbers() {
        let mut replay = Replay::new(10);
        (0..13).for_each(|k| replay.add(&transition(k)));
        let again = Replay::restore(10, replay.numbers().to_vec(), replay.added());
        assert_eq!(again, Some(replay.clone()));
        assert_eq!(Replay::restore(9, replay.numbers().to_vec(), replay.added()), None);
    }
}

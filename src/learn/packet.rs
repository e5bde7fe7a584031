//! Packets: a scalar, or a block of lanes, that rollouts move in together.

use crate::num::{Lanes, Real};

/// Rollouts in a block of lanes.
pub const WIDTH: usize = 16;

/// A [`Real`] of which the single numbers can be reached.
pub trait Packet: Real {
    /// How many numbers it holds.
    const WIDTH: usize;
    /// A packet of the numbers `lane(0)`, `lane(1)`, …
    fn gather(lane: impl FnMut(usize) -> f64) -> Self;
    /// The number in lane `index`.
    fn lane(&self, index: usize) -> f64;
    /// The sum over the lanes.
    fn sum(self) -> Self::Sum;
    /// What a sum over the lanes is kept in.
    type Sum: Into<f64>;
}

impl Packet for f64 {
    const WIDTH: usize = 1;
    type Sum = f64;
    #[inline(always)]
    fn gather(mut lane: impl FnMut(usize) -> f64) -> Self {
        lane(0)
    }
    #[inline(always)]
    fn lane(&self, _: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn sum(self) -> f64 {
        self
    }
}

impl<const FUSED: bool> Packet for Lanes<WIDTH, FUSED> {
    const WIDTH: usize = WIDTH;
    type Sum = f32;
    #[inline(always)]
    fn gather(mut lane: impl FnMut(usize) -> f64) -> Self {
        Lanes(std::array::from_fn(|i| lane(i) as f32))
    }
    #[inline(always)]
    fn lane(&self, index: usize) -> f64 {
        self.0[index].into()
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        // by halves, in an order that every instruction set keeps
        let mut x = self.0;
        for half in [8, 4, 2, 1] {
            for i in 0..half {
                x[i] += x[i + half];
            }
        }
        x[0]
    }
}

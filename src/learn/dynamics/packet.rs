//! Packets: number types that hold one value for each of several simulations that are computed at once. A packet is a scalar
//! (one simulation) or a SIMD vector (one simulation per lane).

use greylag_num::{Lanes, Packed, ROW, Real, Register};

/// A [`Real`] with access to its lanes.
pub trait Packet: Real {
    /// Number of lanes.
    const WIDTH: usize;
    /// The packet with the value `lane(i)` in each lane i.
    fn gather(lane: impl FnMut(usize) -> f64) -> Self;
    /// The number in lane `index`.
    fn lane(&self, index: usize) -> f64;
    /// The sum over the lanes.
    fn sum(self) -> Self::Sum;
    /// Number type of a sum over the lanes.
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

/// One row of [`ROW`] single-precision lanes, for any SIMD instruction set.
impl<const N: usize, const FUSED: bool, V: Register> Packet for Lanes<N, FUSED, V> {
    const WIDTH: usize = {
        assert!(N == ROW && V::LANES == ROW, "a packet is one row");
        ROW
    };
    type Sum = f32;
    #[inline(always)]
    fn gather(mut lane: impl FnMut(usize) -> f64) -> Self {
        let row = std::array::from_fn(|i| lane(i) as f32);
        Self::pack(
            #[inline(always)]
            |_| row,
        )
    }
    #[inline(always)]
    fn lane(&self, index: usize) -> f64 {
        self.unpack(0)[index].into()
    }
    #[inline(always)]
    fn sum(self) -> f32 {
        Lanes::sum(self)
    }
}

//! Peak performance of the processor, and number of operations of a model step.

use std::cell::Cell;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::time::Instant;

use greylag::model::{GreyBox, Memory};
#[cfg(target_arch = "x86_64")]
use greylag::num::{Avx2, Avx512};
use greylag::num::{BASE_FUSED, Base, Packed, ROW, Real};
use greylag::physics::{Controls, State};

/// Peak performance of one core in single precision, FLOP/s. A fused multiply-add counts as two operations.
pub fn peak() -> f64 {
    let best = |run: &dyn Fn() -> f64| (0..20).map(|_| run()).fold(0.0, f64::max);
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f") {
        // SAFETY: the processor has the feature
        return best(&|| unsafe { peak_avx512() });
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the features
        return best(&|| unsafe { peak_avx2() });
    }
    best(&|| chains::<Base<BASE_FUSED>, 3>())
}

/// Peak performance in vectors of four numbers, as in NEON, FLOP/s. A multiplication and an addition replace the fused
/// multiply-add if the baseline has none.
pub fn narrow_peak() -> f64 {
    let run = chains::<Base<BASE_FUSED>, 3>;
    (0..20).map(|_| run()).fold(0.0, f64::max)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn peak_avx512() -> f64 {
    chains::<Avx512<true>, 12>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn peak_avx2() -> f64 {
    chains::<Avx2<true>, 5>()
}

/// Speed of multiply-adds in `C` independent chains of blocks, FLOP/s. Independent chains hide the latency of the
/// instruction.
#[inline(always)]
fn chains<R: Packed, const C: usize>() -> f64 {
    const ROUNDS: usize = 1_000_000;
    let factor = R::from_f64(std::hint::black_box(0.999));
    let mut sums = [R::from_f64(std::hint::black_box(1.0)); C];
    let start = Instant::now();
    for _ in 0..ROUNDS {
        let mut c = 0;
        while c < C {
            sums[c] = sums[c].mul_add(factor, factor);
            c += 1;
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    for sum in sums {
        std::hint::black_box(sum.unpack(0));
    }
    (2 * ROUNDS * ROW * C) as f64 / seconds
}

thread_local! {
    static COUNTS: Cell<Operations> = const { Cell::new(Operations::NONE) };
}

/// Numbers of floating-point operations.
#[derive(Clone, Copy, Debug)]
pub struct Operations {
    /// Number of additions, subtractions and multiplications.
    pub simple: u64,
    /// Number of fused multiply-adds.
    pub fused: u64,
    /// Number of divisions and square roots.
    pub divisions: u64,
    /// Number of sines with their cosines.
    pub sines: u64,
}

/// Number of additions and multiplications in the SIMD sine and cosine, without comparisons.
const SINE: u64 = 26;

impl Operations {
    const NONE: Operations = Operations { simple: 0, fused: 0, divisions: 0, sines: 0 };

    /// Total number of floating-point operations. A division counts as one.
    pub fn all(&self) -> u64 {
        self.simple + 2 * self.fused + self.divisions + SINE * self.sines
    }

    /// Operations of one step of `model` from `state`.
    pub fn of_step(model: &GreyBox, state: &State, controls: &Controls) -> Operations {
        let state = state.map(Counted);
        let controls = Controls {
            aileron: Counted(controls.aileron),
            elevator: Counted(controls.elevator),
            throttle: Counted(controls.throttle),
            rudder: Counted(controls.rudder),
            lagged: None,
        };
        COUNTS.set(Operations::NONE);
        std::hint::black_box(model.step(&state, &controls, 600.0, &mut Memory::default()));
        COUNTS.get()
    }
}

/// A number that counts the operations on it.
#[derive(Clone, Copy, Debug)]
struct Counted(f64);

fn count(kind: impl Fn(&mut Operations) -> &mut u64) {
    let mut counts = COUNTS.get();
    *kind(&mut counts) += 1;
    COUNTS.set(counts);
}

macro_rules! counted {
    ($trait:ident, $method:ident, $op:tt, $kind:ident) => {
        impl $trait for Counted {
            type Output = Counted;
            fn $method(self, other: Counted) -> Counted {
                count(|c| &mut c.$kind);
                Counted(self.0 $op other.0)
            }
        }
    };
}
counted!(Add, add, +, simple);
counted!(Sub, sub, -, simple);
counted!(Mul, mul, *, simple);
counted!(Div, div, /, divisions);

impl AddAssign for Counted {
    fn add_assign(&mut self, other: Counted) {
        *self = *self + other;
    }
}
impl SubAssign for Counted {
    fn sub_assign(&mut self, other: Counted) {
        *self = *self - other;
    }
}
// a change of sign is not counted, because it is part of the operation that follows
impl Neg for Counted {
    type Output = Counted;
    fn neg(self) -> Counted {
        Counted(-self.0)
    }
}

impl Real for Counted {
    fn from_f64(x: f64) -> Counted {
        Counted(x)
    }
    fn sin_cos(self) -> (Counted, Counted) {
        count(|c| &mut c.sines);
        let (s, c) = self.0.sin_cos();
        (Counted(s), Counted(c))
    }
    fn atan2(self, x: Counted) -> Counted {
        Counted(self.0.atan2(x.0))
    }
    fn sqrt(self) -> Counted {
        count(|c| &mut c.divisions);
        Counted(self.0.sqrt())
    }
    fn exp(self) -> Counted {
        Counted(self.0.exp())
    }
    fn where_less(a: Counted, b: Counted, then: Counted, otherwise: Counted) -> Counted {
        if a.0 < b.0 { then } else { otherwise }
    }
    fn mul_add(self, factor: Counted, addend: Counted) -> Counted {
        count(|c| &mut c.fused);
        Counted(self.0 * factor.0 + addend.0)
    }
}

/// Number of blocks of aircraft, which are stepped one after the other.
const BLOCKS: usize = 64;

/// Number of steps of `model` per second on one core in SIMD lanes.
pub fn steps_per_second(model: &GreyBox, state: &State, controls: &Controls) -> f64 {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx512f") {
        // SAFETY: the processor has the feature
        return unsafe { steps_avx512(model, state, controls) };
    } else if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the features
        return unsafe { steps_avx2(model, state, controls) };
    }
    steps::<Base<BASE_FUSED>>(model, state, controls)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn steps_avx512(model: &GreyBox, state: &State, controls: &Controls) -> f64 {
    steps::<Avx512<true>>(model, state, controls)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn steps_avx2(model: &GreyBox, state: &State, controls: &Controls) -> f64 {
    steps::<Avx2<true>>(model, state, controls)
}

#[inline(always)]
fn steps<R: Packed>(model: &GreyBox, state: &State, controls: &Controls) -> f64 {
    const ROUNDS: usize = 100;
    let lane = R::from_f64;
    let mut states = [state.map(lane); BLOCKS];
    let controls = Controls {
        aileron: lane(controls.aileron),
        elevator: lane(controls.elevator),
        throttle: lane(controls.throttle),
        rudder: lane(controls.rudder),
        lagged: None,
    };
    let mut memory = Memory::default();
    let start = Instant::now();
    for _ in 0..ROUNDS {
        for state in &mut states {
            *state = model.step_inlined(state, &controls, 600.0, &mut memory);
        }
    }
    let seconds = start.elapsed().as_secs_f64();
    for state in &states {
        std::hint::black_box(state.roll.unpack(0));
    }
    (ROUNDS * ROW * BLOCKS) as f64 / seconds
}

//! Passes compiled for the widest vectors that the processor has.

use crate::learn::packet::Packet;
use crate::learn::rollout::{Gradient, Pass, SumSlopes, Sums, Trace};

/// The vector instructions that a pass is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instructions {
    /// 512 bits.
    #[cfg(target_arch = "x86_64")]
    Avx512,
    /// 256 bits with fused multiply-add.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// What the target always has: NEON on aarch64.
    Baseline,
}

impl Instructions {
    /// The widest that this processor has.
    pub fn detect() -> Instructions {
        #[cfg(target_arch = "x86_64")]
        {
            let fma = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if fma && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") {
                return Instructions::Avx512;
            }
            if fma {
                return Instructions::Avx2;
            }
        }
        Instructions::Baseline
    }

    /// Whether multiply-adds are fused in one instruction.
    pub fn fused(self) -> bool {
        self != Instructions::Baseline || cfg!(target_arch = "aarch64")
    }

    /// [`Pass::forward`].
    pub fn forward<R: Packet>(self, pass: &Pass<R>, trace: &mut Trace<R>) -> (Sums, R) {
        match self {
            // SAFETY: `detect` has seen the processor's features
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { forward_avx512(pass, trace) },
            // SAFETY: as above
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { forward_avx2(pass, trace) },
            Instructions::Baseline => pass.forward(trace),
        }
    }

    /// [`Pass::reverse`].
    pub fn reverse<R: Packet>(
        self,
        pass: &Pass<R>,
        trace: &mut Trace<R>,
        of: &SumSlopes,
        gradient: &mut Gradient,
    ) {
        match self {
            // SAFETY: `detect` has seen the processor's features
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => unsafe { reverse_avx512(pass, trace, of, gradient) },
            // SAFETY: as above
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => unsafe { reverse_avx2(pass, trace, of, gradient) },
            Instructions::Baseline => pass.reverse(trace, of, gradient),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
fn forward_avx512<R: Packet>(pass: &Pass<R>, trace: &mut Trace<R>) -> (Sums, R) {
    pass.forward(trace)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn forward_avx2<R: Packet>(pass: &Pass<R>, trace: &mut Trace<R>) -> (Sums, R) {
    pass.forward(trace)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx2,fma")]
fn reverse_avx512<R: Packet>(
    pass: &Pass<R>,
    trace: &mut Trace<R>,
    of: &SumSlopes,
    gradient: &mut Gradient,
) {
    pass.reverse(trace, of, gradient);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn reverse_avx2<R: Packet>(
    pass: &Pass<R>,
    trace: &mut Trace<R>,
    of: &SumSlopes,
    gradient: &mut Gradient,
) {
    pass.reverse(trace, of, gradient);
}

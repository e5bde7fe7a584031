//! Functions of the model training, each compiled once for each instruction set. A forward pass simulates recorded
//! flights from their states. A reverse pass computes the gradient of the loss.
//!
//! The prior is the physical part of the model. Its code is by far the largest part, so it is called instead of inlined.
//! Its callers are compiled for the same instructions. Both integration schemes share one copy of the code that computes
//! the prior's outputs and their derivatives with respect to the state and to the coefficients.

use crate::dynamics::packet::Packet;
use crate::dynamics::prior::{At, PriorOutputs, Slopes};
use crate::dynamics::rollout::{Gradient, Pass, SumSlopes, Sums, Trace};
use greylag_model::GreyBox;
#[cfg(target_arch = "aarch64")]
use greylag_num::Base;
#[cfg(target_arch = "x86_64")]
use greylag_num::{Avx2, Avx512};

/// A set of processor instructions with its number type.
pub trait InstructionSet: Copy + Send + Sync {
    /// The number type of a pass: a vector with one lane for each rollout, the simulation of a section of a flight.
    type Number: Packet;
    /// Calls [`At::ask`], which evaluates the prior. `WHOLE` is explained there.
    fn ask<const WHOLE: bool>(
        self,
        model: &GreyBox,
        at: &At<Self::Number>,
    ) -> PriorOutputs<Self::Number>;
    /// Calls [`At::slope`], which computes the gradient of the loss with respect to the state.
    fn slope<const WHOLE: bool>(
        self,
        model: &GreyBox,
        at: &At<Self::Number>,
        slopes: &Slopes<Self::Number>,
    ) -> [Self::Number; 8];
    /// Calls [`At::coefficients`], which adds the gradient of the loss with respect to the coefficients to `sums`.
    fn coefficients<const WHOLE: bool>(
        self,
        model: &GreyBox,
        at: &At<Self::Number>,
        slopes: &Slopes<Self::Number>,
        sums: &mut [Self::Number],
    );
    /// Calls [`Pass::forward`] on a block of rollouts.
    fn forward(self, pass: &Pass<Self>, trace: &mut Trace<Self::Number>) -> (Sums, Self::Number);
    /// Calls [`Pass::reverse`] on a block of rollouts.
    fn reverse(
        self,
        pass: &Pass<Self>,
        trace: &mut Trace<Self::Number>,
        of: &SumSlopes,
        gradient: &mut Gradient,
    );
}

/// One rollout at a time in double precision, with the baseline instructions of the target. It serves for tests.
#[derive(Clone, Copy, Debug)]
pub struct Double;

/// AVX2 with fused multiply-add: vectors of 256 bits.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct In256(());

/// AVX-512: vectors of 512 bits.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct In512(());

#[cfg(target_arch = "x86_64")]
impl In256 {
    /// The instruction set; `None` if this processor does not support it.
    pub fn detect() -> Option<In256> {
        let there = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        there.then_some(In256(()))
    }
}

#[cfg(target_arch = "x86_64")]
impl In512 {
    /// The instruction set; `None` if this processor does not support it.
    pub fn detect() -> Option<In512> {
        is_x86_feature_detected!("avx512f").then_some(In512(()))
    }
}

/// Vectors with the baseline instructions of the target.
#[cfg(target_arch = "aarch64")]
#[derive(Clone, Copy, Debug)]
pub struct Neon;

/// Implements [`InstructionSet`] by functions compiled with the given features.
macro_rules! compiled {
    ($set:ty, $number:ty $(, $features:literal)?) => {
        impl InstructionSet for $set {
            type Number = $number;

            #[inline(always)]
            fn ask<const WHOLE: bool>(
                self,
                model: &GreyBox,
                at: &At<$number>,
            ) -> PriorOutputs<$number> {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn compiled<const WHOLE: bool>(
                    model: &GreyBox,
                    at: &At<$number>,
                ) -> PriorOutputs<$number> {
                    at.ask::<WHOLE>(model)
                }
                compiled!(call compiled::<WHOLE>(model, at) $($features)?)
            }

            #[inline(always)]
            fn slope<const WHOLE: bool>(
                self,
                model: &GreyBox,
                at: &At<$number>,
                slopes: &Slopes<$number>,
            ) -> [$number; 8] {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn compiled<const WHOLE: bool>(
                    model: &GreyBox,
                    at: &At<$number>,
                    slopes: &Slopes<$number>,
                ) -> [$number; 8] {
                    at.slope::<WHOLE>(model, slopes)
                }
                compiled!(call compiled::<WHOLE>(model, at, slopes) $($features)?)
            }

            #[inline(always)]
            fn coefficients<const WHOLE: bool>(
                self,
                model: &GreyBox,
                at: &At<$number>,
                slopes: &Slopes<$number>,
                sums: &mut [$number],
            ) {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn compiled<const WHOLE: bool>(
                    model: &GreyBox,
                    at: &At<$number>,
                    slopes: &Slopes<$number>,
                    sums: &mut [$number],
                ) {
                    at.coefficients::<WHOLE>(model, slopes, sums);
                }
                compiled!(call compiled::<WHOLE>(model, at, slopes, sums) $($features)?)
            }

            fn forward(self, pass: &Pass<$set>, trace: &mut Trace<$number>) -> (Sums, $number) {
                $(#[target_feature(enable = $features)])?
                fn compiled(pass: &Pass<$set>, trace: &mut Trace<$number>) -> (Sums, $number) {
                    pass.forward(trace)
                }
                compiled!(call compiled(pass, trace) $($features)?)
            }

            fn reverse(
                self,
                pass: &Pass<$set>,
                trace: &mut Trace<$number>,
                of: &SumSlopes,
                gradient: &mut Gradient,
            ) {
                $(#[target_feature(enable = $features)])?
                fn compiled(
                    pass: &Pass<$set>,
                    trace: &mut Trace<$number>,
                    of: &SumSlopes,
                    gradient: &mut Gradient,
                ) {
                    pass.reverse(trace, of, gradient);
                }
                compiled!(call compiled(pass, trace, of, gradient) $($features)?)
            }
        }
    };
    (call $function:ident::<$generic:ident>($($argument:expr),*) $features:literal) => {
        // SAFETY: a value of the set is made only where the processor has its features
        unsafe { $function::<$generic>($($argument),*) }
    };
    (call $function:ident::<$generic:ident>($($argument:expr),*)) => {
        $function::<$generic>($($argument),*)
    };
    (call $function:ident($($argument:expr),*) $features:literal) => {
        // SAFETY: a value of the set is made only where the processor has its features
        unsafe { $function($($argument),*) }
    };
    (call $function:ident($($argument:expr),*)) => { $function($($argument),*) };
}

compiled!(Double, f64);
#[cfg(target_arch = "x86_64")]
compiled!(In256, Avx2<true>, "avx2,fma");
#[cfg(target_arch = "x86_64")]
compiled!(In512, Avx512<true>, "avx512f");
#[cfg(target_arch = "aarch64")]
compiled!(Neon, Base<true>);

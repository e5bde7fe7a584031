//! Instruction sets: what a pass is made of, each part compiled once for each set.
//!
//! The prior is by far the largest part, so it is called and not inlined: what calls it is compiled for
//! the same instructions, and two schemes through time share one copy of its value, its slopes and its
//! coefficients' slopes.

use crate::dynamics::packet::Packet;
use crate::dynamics::prior::{At, Said, Slopes};
use crate::dynamics::rollout::{Gradient, Pass, SumSlopes, Sums, Trace};
use greylag_model::GreyBox;
#[cfg(target_arch = "aarch64")]
use greylag_num::Base;
#[cfg(target_arch = "x86_64")]
use greylag_num::{Avx2, Avx512};

/// A set of instructions with the numbers that it moves.
pub trait InstructionSet: Copy + Send + Sync {
    /// What a pass computes in.
    type Number: Packet;
    /// [`At::ask`].
    fn ask<const WHOLE: bool>(self, model: &GreyBox, at: &At<Self::Number>) -> Said<Self::Number>;
    /// [`At::slope`].
    fn slope<const WHOLE: bool>(
        self,
        model: &GreyBox,
        at: &At<Self::Number>,
        slopes: &Slopes<Self::Number>,
    ) -> [Self::Number; 8];
    /// [`At::coefficients`].
    fn coefficients<const WHOLE: bool>(
        self,
        model: &GreyBox,
        at: &At<Self::Number>,
        slopes: &Slopes<Self::Number>,
        sums: &mut [Self::Number],
    );
    /// [`Pass::forward`].
    fn forward(self, pass: &Pass<Self>, trace: &mut Trace<Self::Number>) -> (Sums, Self::Number);
    /// [`Pass::reverse`].
    fn reverse(
        self,
        pass: &Pass<Self>,
        trace: &mut Trace<Self::Number>,
        of: &SumSlopes,
        gradient: &mut Gradient,
    );
}

/// One rollout at a time in double precision, in whatever the target always has: for tests.
#[derive(Clone, Copy, Debug)]
pub struct Double;

/// Lanes in 256 bits with fused multiply-add.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct In256(());

/// Lanes in 512 bits.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct In512(());

#[cfg(target_arch = "x86_64")]
impl In256 {
    /// The set, if this processor has it.
    pub fn detect() -> Option<In256> {
        let there = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        there.then_some(In256(()))
    }
}

#[cfg(target_arch = "x86_64")]
impl In512 {
    /// The set, if this processor has it.
    pub fn detect() -> Option<In512> {
        is_x86_feature_detected!("avx512f").then_some(In512(()))
    }
}

/// Lanes in what the target always has.
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
            ) -> Said<$number> {
                $(#[target_feature(enable = $features)])?
                #[inline(never)]
                fn compiled<const WHOLE: bool>(
                    model: &GreyBox,
                    at: &At<$number>,
                ) -> Said<$number> {
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

//! One model step of sixteen aircraft at once, in the widest vector registers that the processor has.

use crate::{GreyBox, Memory};
#[cfg(target_arch = "x86_64")]
use greylag_num::{Avx2, Avx512};
use greylag_num::{Base, Lanes, Packed, ROW};
use greylag_physics::{Controls, State};

/// Sixteen numbers, one for each aircraft.
pub type Block = Lanes<ROW>;

impl GreyBox {
    /// Advances sixteen aircraft at the same `altitude` (m) by one [`step`](GreyBox::step). No multiply-add is fused, so that
    /// all processors give bit-identical results.
    pub fn step_block(
        &self,
        state: &State<Block>,
        controls: &Controls<Block>,
        altitude: f64,
        memory: &mut Memory<Block>,
    ) -> State<Block> {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has the feature
            return unsafe { in_avx512(self, state, controls, altitude, memory) };
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: as above
            return unsafe { in_avx2(self, state, controls, altitude, memory) };
        }
        step::<Base<false>>(self, state, controls, altitude, memory)
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn in_avx512(
    model: &GreyBox,
    state: &State<Block>,
    controls: &Controls<Block>,
    altitude: f64,
    memory: &mut Memory<Block>,
) -> State<Block> {
    step::<Avx512<false>>(model, state, controls, altitude, memory)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn in_avx2(
    model: &GreyBox,
    state: &State<Block>,
    controls: &Controls<Block>,
    altitude: f64,
    memory: &mut Memory<Block>,
) -> State<Block> {
    step::<Avx2<false>>(model, state, controls, altitude, memory)
}

#[inline(always)]
fn step<R: Packed>(
    model: &GreyBox,
    state: &State<Block>,
    controls: &Controls<Block>,
    altitude: f64,
    memory: &mut Memory<Block>,
) -> State<Block> {
    let lanes = |x: Block| R::pack(|_| x.0);
    let block = |x: R| Lanes(x.unpack(0));
    let controls = controls.map(lanes);
    let mut remembered = memory.map(lanes);
    let next = model.step_inlined(&state.map(lanes), &controls, altitude, &mut remembered);
    *memory = remembered.map(block);
    next.map(block)
}

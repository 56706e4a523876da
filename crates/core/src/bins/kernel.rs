//! Picks the kernels for the processor at run time.

use super::{Bins, CHUNK, Mapping, Parted, Split, scalar};
use crate::{AreaScale, PrimRef, SahConstants};
use rayon::prelude::*;

/// An instruction set that the inner loops exist for. All give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernel(Isa);

/// Private, so that nobody makes one that the processor does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Isa {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

/// Calls the function of this name in the module for the instruction set.
macro_rules! dispatch {
    ($kernel:expr, $function:ident($($argument:expr),*)) => {
        match $kernel.0 {
            Isa::Scalar => scalar::$function($($argument),*),
            // SAFETY: `Avx2` is only made where the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Isa::Avx2 => unsafe { super::avx2::$function($($argument),*) },
        }
    };
}

impl Kernel {
    /// Any processor: the reference.
    pub const SCALAR: Self = Self(Isa::Scalar);

    /// The fastest that this processor can run.
    #[must_use]
    pub fn fastest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return Self(Isa::Avx2);
        }
        Self::SCALAR
    }

    /// Adds primitives to the bins.
    #[inline]
    pub fn fill(self, bins: &mut Bins, prims: &[PrimRef], mapping: &Mapping) {
        dispatch!(self, fill(bins, prims, mapping));
    }

    /// Bins of many primitives, by all threads of the current pool.
    #[must_use]
    pub fn fill_parallel(self, prims: &[PrimRef], mapping: &Mapping) -> Box<Bins> {
        prims
            .par_chunks(CHUNK)
            .map(|chunk| {
                let mut bins = Bins::new();
                self.fill(&mut bins, chunk, mapping);
                bins
            })
            .reduce_with(|mut a, b| {
                a.merge(&b, mapping.bins());
                a
            })
            .unwrap_or_else(Bins::new)
    }

    /// The split of least cost between the first `number` bins, the first axis and then the first
    /// bin among equals. `None` if no split between bins has primitives on both sides.
    #[must_use]
    #[inline]
    pub fn best(
        self,
        bins: &Bins,
        number: usize,
        scale: AreaScale,
        sah: &SahConstants,
    ) -> Option<Split> {
        dispatch!(self, best(bins, number, scale, sah))
    }

    /// Moves primitives below the split to the front.
    #[inline]
    pub fn partition(self, prims: &mut [PrimRef], mapping: &Mapping, split: &Split) -> Parted {
        dispatch!(self, partition(prims, mapping, split))
    }
}

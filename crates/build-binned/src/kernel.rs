//! Picks the kernels for the processor at run time.

use crate::bins::{self, Bins, Mapping, Parted, Split};
use niwaki_core::{AreaScale, PrimRef, SahConstants};

/// An instruction set that the inner loops exist for. All give the same tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// Any processor: the reference.
    Scalar,
    /// x86-64 with AVX2. Made by [`Kernel::fastest`] only, where the processor has it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

/// Calls the function of this name in the module for the instruction set.
macro_rules! dispatch {
    ($kernel:expr, $function:ident($($argument:expr),*)) => {
        match $kernel {
            Kernel::Scalar => bins::$function($($argument),*),
            // SAFETY: `Avx2` is only made where the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe { crate::avx2::$function($($argument),*) },
        }
    };
}

impl Kernel {
    /// The fastest that this processor can run.
    pub(crate) fn fastest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Scalar
    }

    #[inline]
    pub(crate) fn fill(self, bins: &mut Bins, prims: &[PrimRef], mapping: &Mapping) {
        dispatch!(self, fill(bins, prims, mapping));
    }

    #[inline]
    pub(crate) fn best(
        self,
        bins: &Bins,
        number: usize,
        scale: AreaScale,
        sah: &SahConstants,
    ) -> Option<Split> {
        dispatch!(self, best(bins, number, scale, sah))
    }

    #[inline]
    pub(crate) fn partition(
        self,
        prims: &mut [PrimRef],
        mapping: &Mapping,
        split: &Split,
    ) -> Parted {
        dispatch!(self, partition(prims, mapping, split))
    }
}

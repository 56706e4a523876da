//! The choice of instruction set and what every kernel returns.

use niwaki_core::{Aabb, PrimRef};

/// The instruction set that the sweep runs on. All kernels form boxes, areas and costs by the same
/// operations in the same order, so the tree is the same to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Kernel {
    /// Portable code, one primitive at a time.
    Scalar,
    /// 256-bit registers: areas and costs of eight positions at once. Falls back to
    /// [`Kernel::Scalar`] on machines without AVX2.
    Avx2,
}

impl Kernel {
    /// The fastest kernel that this machine can run.
    #[must_use]
    pub fn best() -> Self {
        if Self::has_avx2() { Self::Avx2 } else { Self::Scalar }
    }

    /// All kernels that this machine can run, slowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        if Self::has_avx2() { vec![Self::Scalar, Self::Avx2] } else { vec![Self::Scalar] }
    }

    pub(crate) fn has_avx2() -> bool {
        #[cfg(target_arch = "x86_64")]
        {
            std::arch::is_x86_feature_detected!("avx2")
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            false
        }
    }

    /// This kernel if the machine has it, else the scalar one.
    pub(crate) fn or_fallback(self) -> Self {
        if self == Self::Avx2 && !Self::has_avx2() { Self::Scalar } else { self }
    }
}

/// How many entries before and after the range of a node vector kernels may touch.
pub(crate) const PAD: usize = 8;

/// The cheapest split of a node: the first `left` primitives in the order of `axis` go left.
/// Among equal costs the lowest axis, then the lowest position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Split {
    /// `A(l)·w(l) + A(r)·w(r)`; infinite if no position has a cost.
    pub(crate) cost: f32,
    pub(crate) axis: usize,
    pub(crate) left: usize,
}

impl Split {
    pub(crate) const NONE: Self = Self { cost: f32::INFINITY, axis: 0, left: 0 };
}

/// `minps`: the second operand unless the first is smaller.
#[inline]
pub(crate) fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// `maxps`: the second operand unless the first is greater.
#[inline]
pub(crate) fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Grows a box by a primitive exactly as the vector kernels do, signs of zeros included.
#[inline]
pub(crate) fn grow(b: &mut Aabb, p: &PrimRef) {
    for a in 0..3 {
        b.min[a] = lesser(b.min[a], p.min[a]);
        b.max[a] = greater(b.max[a], p.max[a]);
    }
}

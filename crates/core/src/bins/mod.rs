//! Bins of centroids, for builders that look for splits among a few planes a node (Wald 2007):
//! their layout, and kernels that fill them, find the cheapest border and partition by it.
//!
//! ```
//! use niwaki_core::bins::{Bins, Kernel, Mapping};
//! use niwaki_core::{Aabb, AreaScale, PrimRef, SahConstants, glam::Vec3};
//!
//! let prims: Vec<PrimRef> = (0..10_u32)
//!     .map(|i| PrimRef::new(Aabb::from_points([Vec3::X * i as f32]), i))
//!     .collect();
//! let centroids = Aabb::from_points(prims.iter().map(PrimRef::centroid2));
//! let (kernel, mapping) = (Kernel::fastest(), Mapping::new(&centroids, 8));
//! let mut bins = Bins::new();
//! kernel.fill(&mut bins, &prims, &mapping);
//! assert!(kernel.best(&bins, 8, AreaScale::ONE, &SahConstants::default()).is_some());
//! ```
//!
//! The scalar kernels are the reference; those for AVX2, picked at run time, do the same
//! operations in the same order and give the same bits.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod kernel;
mod scalar;

pub use kernel::Kernel;

use crate::{Aabb, AreaScale, PrimRef};
use glam::Vec3;

/// The most bins per axis: a power of two, so that an index can be masked.
pub const MAX_BINS: usize = 64;

/// A box as one 256-bit register: lanes 0–2 the smallest coordinates *negated*, lanes 4–6 the
/// largest, so that one maximum grows both corners. Lanes 3 and 7 have no meaning.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Corners(pub(super) [f32; 8]);

impl Corners {
    /// Nothing: grows to whatever it is united with.
    pub const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    /// A box in this form.
    #[must_use]
    #[inline]
    pub const fn of(b: &Aabb) -> Self {
        Self([-b.min.x, -b.min.y, -b.min.z, 0.0, b.max.x, b.max.y, b.max.z, 0.0])
    }

    /// Around both. Among zeros of both signs the later wins, as in `maxps`: order matters, but
    /// grouping does not.
    #[must_use]
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    /// The box; [`Aabb::EMPTY`] for nothing.
    #[must_use]
    pub const fn aabb(&self) -> Aabb {
        let [x, y, z, _, a, b, c, _] = self.0;
        Aabb::new(Vec3::new(-x, -y, -z), Vec3::new(a, b, c))
    }

    /// The lanes.
    #[must_use]
    pub const fn lanes(&self) -> &[f32; 8] {
        &self.0
    }

    /// As [`Aabb::half_area`].
    #[must_use]
    #[inline]
    pub fn half_area(&self, scale: AreaScale) -> f32 {
        let [x, y, z, _, a, b, c, _] = self.0;
        let e = [(a + x) * scale.get(), (b + y) * scale.get(), (c + z) * scale.get()];
        e[0] * (e[1] + e[2]) + e[1] * e[2]
    }
}

/// Which bin of each axis a centroid falls into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    /// Twice the smallest centroid.
    low: Vec3,
    /// Bins per unit of twice the centroid: +∞ where the extent is so small that the quotient
    /// overflows; 0, for one bin, where there is no extent.
    scale: Vec3,
    bins: usize,
}

impl Mapping {
    /// Divides the bounds of twice the centroids into `bins` equal slabs along each axis.
    ///
    /// # Panics
    /// Unless `bins` is in `1 ..= MAX_BINS`.
    #[must_use]
    pub fn new(centroid2_bounds: &Aabb, bins: usize) -> Self {
        assert!((1..=MAX_BINS).contains(&bins), "1 to {MAX_BINS} bins");
        let scale = centroid2_bounds.extent().to_array();
        let scale = scale.map(|e| if e > 0.0 { bins as f32 / e } else { 0.0 });
        Self { low: centroid2_bounds.min, scale: Vec3::from_array(scale), bins }
    }

    /// Bins per axis.
    #[must_use]
    pub const fn bins(&self) -> usize {
        self.bins
    }

    /// The position among the bins. May be NaN, where 0·∞ or ∞ − ∞ occurred at the ends of the
    /// range of `f32`, which counts as bin 0; or beyond the last bin, which counts as the last.
    #[inline]
    fn position(&self, p: &PrimRef) -> Vec3 {
        (p.centroid2() - self.low) * self.scale
    }

    /// The bins of a primitive: always in range.
    #[inline]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped below 64")]
    fn bins_of(&self, p: &PrimRef) -> [usize; 3] {
        let last = (self.bins - 1) as f32;
        self.position(p).to_array().map(|f| {
            let f = if f > 0.0 { f } else { 0.0 };
            (if f < last { f } else { last }) as usize
        })
    }

    /// True if the primitive's bin of `axis` is below `bin`, which is in `1 .. bins`.
    ///
    /// # Panics
    /// If `axis` is not 0, 1 or 2.
    #[must_use]
    #[inline]
    pub fn is_below(&self, p: &PrimRef, axis: usize, bin: usize) -> bool {
        // Truncation and clamps do not move a position across an inner border.
        let above = self.position(p)[axis] >= bin as f32;
        !above
    }
}

/// Primitives of one piece of parallel work: half a megabyte. A constant, so that the number of
/// threads does not show in what pieces are combined to.
pub const CHUNK: usize = 1 << 14;

/// Bounds and numbers of the primitives in each bin of each axis.
#[derive(Clone)]
#[repr(C, align(32))]
pub struct Bins {
    /// By bin, then axis.
    pub bounds: [[Corners; 3]; MAX_BINS],
    /// One number per axis; the fourth is not used.
    pub counts: [[u32; 4]; MAX_BINS],
}

/// The best split: primitives in bins below `bin` of `axis` go left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// 0, 1 or 2.
    pub axis: usize,
    /// 1 or more.
    pub bin: usize,
    /// C_T·(A(left)·N(left) + A(right)·N(right)) + C_L·(A(left) + A(right)), in scaled half areas.
    pub cost: f32,
}

/// A partitioned slice: the size of the left part, and for both parts the bounds of twice the
/// centroids.
#[derive(Clone, Copy, Debug)]
pub struct Parted {
    /// Primitives below the split.
    pub left: usize,
    /// Of the lower and the upper part.
    pub centroids: [Corners; 2],
}

impl Bins {
    /// Empty bins, on the heap for their size.
    #[must_use]
    pub fn new() -> Box<Self> {
        Box::new(Self { bounds: [[Corners::EMPTY; 3]; MAX_BINS], counts: [[0; 4]; MAX_BINS] })
    }

    /// Empties the first `bins` of each axis.
    pub fn clear(&mut self, bins: usize) {
        self.bounds[..bins].fill([Corners::EMPTY; 3]);
        self.counts[..bins].fill([0; 4]);
    }

    /// Adds the content of `later`, bins of primitives that come after these.
    pub fn merge(&mut self, later: &Self, bins: usize) {
        for i in 0..bins {
            for axis in 0..3 {
                self.bounds[i][axis] = self.bounds[i][axis].union(&later.bounds[i][axis]);
                self.counts[i][axis] += later.counts[i][axis];
            }
        }
    }

    /// Boxes of both sides of a split.
    #[must_use]
    pub fn sides(&self, split: &Split, bins: usize) -> [Aabb; 2] {
        let bounds = |range: std::ops::Range<usize>| {
            let all = self.bounds[range].iter();
            all.fold(Corners::EMPTY, |sum, axes| sum.union(&axes[split.axis])).aabb()
        };
        [bounds(0..split.bin), bounds(split.bin..bins)]
    }
}

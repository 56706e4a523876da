//! Bins of centroids: their layout and the scalar kernels over them, which are the reference for
//! [`crate::avx2`] and give the same bits.

use niwaki_core::glam::Vec3;
use niwaki_core::{Aabb, AreaScale, PrimRef, SahConstants};

/// The most bins per axis: a power of two, so that an index can be masked.
pub(crate) const MAX_BINS: usize = 64;

/// A box as one 256-bit register: lanes 0–2 the smallest coordinates *negated*, lanes 4–6 the
/// largest, so that one maximum grows both corners. Lanes 3 and 7 have no meaning.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(crate) struct Corners(pub(crate) [f32; 8]);

impl Corners {
    pub(crate) const EMPTY: Self = Self([f32::NEG_INFINITY; 8]);

    fn of(b: &Aabb) -> Self {
        Self([-b.min.x, -b.min.y, -b.min.z, 0.0, b.max.x, b.max.y, b.max.z, 0.0])
    }

    /// Around both. Among zeros of both signs the later wins, as in `maxps`: order matters, but
    /// grouping does not.
    #[inline]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|i| if self.0[i] > other.0[i] { self.0[i] } else { other.0[i] }))
    }

    pub(crate) const fn aabb(&self) -> Aabb {
        let [x, y, z, _, a, b, c, _] = self.0;
        Aabb::new(Vec3::new(-x, -y, -z), Vec3::new(a, b, c))
    }

    #[inline]
    fn half_area(&self, scale: AreaScale) -> f32 {
        let [x, y, z, _, a, b, c, _] = self.0;
        let e = [(a + x) * scale.get(), (b + y) * scale.get(), (c + z) * scale.get()];
        e[0] * (e[1] + e[2]) + e[1] * e[2]
    }
}

/// Which bin of each axis a centroid falls into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mapping {
    /// Twice the smallest centroid.
    pub(crate) low: Vec3,
    /// Bins per unit of twice the centroid: +∞ where the extent is so small that the quotient
    /// overflows; 0, for one bin, where there is no extent.
    pub(crate) scale: Vec3,
    pub(crate) bins: usize,
}

impl Mapping {
    pub(crate) fn new(centroid2_bounds: &Aabb, bins: usize) -> Self {
        let scale = centroid2_bounds.extent().to_array();
        let scale = scale.map(|e| if e > 0.0 { bins as f32 / e } else { 0.0 });
        Self { low: centroid2_bounds.min, scale: Vec3::from_array(scale), bins }
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
    #[inline]
    fn is_below(&self, p: &PrimRef, axis: usize, bin: usize) -> bool {
        // Truncation and clamps do not move a position across an inner border.
        let above = self.position(p)[axis] >= bin as f32;
        !above
    }
}

/// Bounds and numbers of the primitives in each bin of each axis.
#[derive(Clone)]
#[repr(C, align(32))]
pub(crate) struct Bins {
    pub(crate) bounds: [[Corners; 3]; MAX_BINS],
    /// One number per axis; the fourth is not used.
    pub(crate) counts: [[u32; 4]; MAX_BINS],
}

/// The best split: primitives in bins below `bin` of `axis` go left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Split {
    pub(crate) axis: usize,
    pub(crate) bin: usize,
    /// C_T·(A(left)·N(left) + A(right)·N(right)) + C_L·(A(left) + A(right)), in scaled half areas.
    pub(crate) cost: f32,
}

/// A partitioned slice: the size of the left part, and for both parts the bounds of twice the
/// centroids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parted {
    pub(crate) left: usize,
    pub(crate) centroids: [Corners; 2],
}

impl Bins {
    pub(crate) fn new() -> Box<Self> {
        Box::new(Self { bounds: [[Corners::EMPTY; 3]; MAX_BINS], counts: [[0; 4]; MAX_BINS] })
    }

    pub(crate) fn clear(&mut self, bins: usize) {
        self.bounds[..bins].fill([Corners::EMPTY; 3]);
        self.counts[..bins].fill([0; 4]);
    }

    /// Adds the content of `later`, bins of primitives that come after these.
    pub(crate) fn merge(&mut self, later: &Self, bins: usize) {
        for i in 0..bins {
            for axis in 0..3 {
                self.bounds[i][axis] = self.bounds[i][axis].union(&later.bounds[i][axis]);
                self.counts[i][axis] += later.counts[i][axis];
            }
        }
    }

    /// Boxes of both sides of a split.
    pub(crate) fn sides(&self, split: &Split, bins: usize) -> [Aabb; 2] {
        let bounds = |range: std::ops::Range<usize>| {
            let all = self.bounds[range].iter();
            all.fold(Corners::EMPTY, |sum, axes| sum.union(&axes[split.axis])).aabb()
        };
        [bounds(0..split.bin), bounds(split.bin..bins)]
    }
}

/// Adds primitives to the bins.
pub(crate) fn fill(bins: &mut Bins, prims: &[PrimRef], mapping: &Mapping) {
    for p in prims {
        let corners = Corners::of(&p.aabb());
        for (axis, bin) in mapping.bins_of(p).into_iter().enumerate() {
            let bounds = &mut bins.bounds[bin][axis];
            *bounds = bounds.union(&corners);
            bins.counts[bin][axis] += 1;
        }
    }
}

/// The split of least cost, the first axis and then the first bin among equals. `None` if no
/// split between bins has primitives on both sides.
pub(crate) fn best(
    bins: &Bins,
    number: usize,
    scale: AreaScale,
    sah: &SahConstants,
) -> Option<Split> {
    let mut best: Option<Split> = None;
    for axis in 0..3 {
        let area = |bounds: &Corners, count| if count > 0 { bounds.half_area(scale) } else { 0.0 };
        let mut right = [(0.0_f32, 0_u32); MAX_BINS];
        let mut bounds = Corners::EMPTY;
        let mut count = 0;
        for i in (1..number).rev() {
            bounds = bounds.union(&bins.bounds[i][axis]);
            count += bins.counts[i][axis];
            right[i] = (area(&bounds, count), count);
        }
        bounds = Corners::EMPTY;
        count = 0;
        for (i, &(right_area, right_count)) in right.iter().enumerate().take(number).skip(1) {
            bounds = bounds.union(&bins.bounds[i - 1][axis]);
            count += bins.counts[i - 1][axis];
            if count == 0 || right_count == 0 {
                continue;
            }
            let left_area = area(&bounds, count);
            let cost = sah.triangle * (left_area * count as f32 + right_area * right_count as f32)
                + sah.leaf * (left_area + right_area);
            if cost < best.map_or(f32::INFINITY, |b| b.cost) {
                best = Some(Split { axis, bin: i, cost });
            }
        }
    }
    best
}

/// Moves primitives below the split to the front.
pub(crate) fn partition(prims: &mut [PrimRef], mapping: &Mapping, split: &Split) -> Parted {
    let mut left = 0;
    let mut centroids = [Corners::EMPTY; 2];
    for i in 0..prims.len() {
        let p = prims[i];
        let below = mapping.is_below(&p, split.axis, split.bin);
        let centroid = p.centroid2();
        let side = &mut centroids[usize::from(!below)];
        *side = side.union(&Corners::of(&Aabb::new(centroid, centroid)));
        // Without a branch that could be mispredicted: what lies from `left` to `i` is all above.
        prims[i] = prims[left];
        prims[left] = p;
        left += usize::from(below);
    }
    Parted { left, centroids }
}

//! Nearest neighbours along the order, each pair's distance computed once.
//!
//! The distance of two clusters is half the surface area of their common box. A pair is held as
//! one number that sorts by distance: the upper bits of the distance (positive floats sort as
//! integers), then 7 bits that name the pair: how far apart the two stand, nearer first, and one
//! bit of the lower place in which it differs from the upper. No two pairs of one cluster have the
//! same number, so among equal distances the choice is strict. That has two consequences:
//! the pair with the smallest number of all is always chosen from both sides, so that every round
//! joins something; and where all distances are equal, even places choose the next one and are
//! chosen by it, so that the list halves.

use niwaki_core::AreaScale;
use niwaki_core::bottom_up::Cluster;
use niwaki_core::to_u32;

/// Clusters whose neighbours are found together.
pub(crate) const CHUNK: usize = 256;

/// Bits of a pair's number that are not of the distance.
const KEY_MASK: u32 = 127;
/// The sign bit is clear even for a distance of −0.0 or NaN.
pub(crate) const DISTANCE_MASK: u32 = !KEY_MASK & 0x7fff_ffff;

/// The bit of a place that tells the lower of two places `offset` apart from the upper: they
/// differ in it, as `offset` is an odd multiple of it.
#[inline]
const fn side(place: usize, offset: usize) -> u32 {
    to_u32(place >> offset.trailing_zeros() & 1)
}

/// The other place of the pair that `place` has chosen.
#[inline]
pub(crate) const fn partner(place: usize, number: u32) -> usize {
    let key = number & KEY_MASK;
    let offset = (key >> 1) as usize + 1;
    if side(place, offset) == key & 1 { place + offset } else { place - offset }
}

/// Half the area of the common box.
#[inline]
pub(crate) fn distance(a: &Cluster, b: &Cluster, scale: AreaScale) -> f32 {
    a.aabb().union(b.aabb()).half_area(scale)
}

/// What one thread needs to find the neighbours of a chunk.
pub(crate) struct Scratch {
    radius: usize,
    scale: f32,
    kernel: Kernel,
    /// Scaled coordinates, min then max, from `radius` places before the chunk to `radius` and a
    /// block after it.
    pub(crate) columns: [Vec<f32>; 6],
    /// For each offset and each place, from `radius` before the chunk to its end in full blocks:
    /// the number of the pair of that place and the one so far behind it.
    pub(crate) rows: Vec<u32>,
}

/// Places that a kernel may compute at once.
pub(crate) const BLOCK: usize = 8;

/// An instruction set that the inner loop exists for. All give the same numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// Any processor: the reference.
    Scalar,
    /// x86-64 with AVX2. Made by [`Kernel::fastest`] only, where the processor has it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
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
}

/// Places for which rows hold numbers: the chunk and `radius` before it, in full blocks.
pub(crate) const fn row_len(radius: usize) -> usize {
    (CHUNK + radius).next_multiple_of(BLOCK)
}

impl Scratch {
    pub(crate) fn new(radius: usize, scale: AreaScale, kernel: Kernel) -> Self {
        Self {
            radius,
            scale: scale.get(),
            kernel,
            columns: [(); 6].map(|()| vec![0.0; row_len(radius) + radius]),
            rows: vec![0; radius * row_len(radius)],
        }
    }

    /// Writes to `best` the smallest number of a pair of each of the places from `start` on, at
    /// most [`CHUNK`]. There are at least two clusters.
    pub(crate) fn nearest(&mut self, clusters: &[Cluster], start: usize, best: &mut [u32]) {
        let radius = self.radius;
        // The first lane is `radius` places before the chunk, perhaps before all.
        let before = radius.saturating_sub(start);
        let lanes = radius + best.len();
        let known =
            &clusters[start + before - radius..clusters.len().min(start + best.len() + radius)];
        match self.kernel {
            Kernel::Scalar => fill_columns(known, before, self.scale, &mut self.columns),
            // SAFETY: `Avx2` is only made where the processor has AVX2.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe {
                crate::avx2::fill_columns(known, before, self.scale, &mut self.columns);
            },
        }
        let first = to_u32(start).wrapping_sub(to_u32(radius));
        let row_len = row_len(radius);
        match self.kernel {
            Kernel::Scalar => fill_rows(&self.columns, &mut self.rows, radius, lanes, first),
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe {
                crate::avx2::fill_rows(&self.columns, &mut self.rows, radius, lanes, first);
            },
        }
        for (i, row) in self.rows.chunks_exact_mut(row_len).enumerate() {
            // Pairs that begin before the first place or end behind the last are none.
            let end = (before + known.len()).saturating_sub(i + 1).max(before);
            row[..before].fill(u32::MAX);
            row[end.min(lanes)..lanes].fill(u32::MAX);
        }
        match self.kernel {
            Kernel::Scalar => smallest(&self.rows, radius, best),
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => unsafe { crate::avx2::smallest(&self.rows, radius, best) },
        }
    }
}

/// Fills columns from lane `first` on.
pub(crate) fn fill_columns(
    clusters: &[Cluster],
    first: usize,
    scale: f32,
    columns: &mut [Vec<f32>; 6],
) {
    for (i, cluster) in clusters.iter().enumerate() {
        let corners = [cluster.min.to_array(), cluster.max.to_array()];
        for (column, x) in columns.iter_mut().zip(corners.as_flattened()) {
            column[first + i] = x * scale;
        }
    }
}

/// Fills rows, for `lanes` places of which the first is `first`, modulo 2³².
pub(crate) fn fill_rows(
    columns: &[Vec<f32>; 6],
    rows: &mut [u32],
    radius: usize,
    lanes: usize,
    first: u32,
) {
    for (offset, row) in (1..=radius).zip(rows.chunks_exact_mut(row_len(radius))) {
        for (lane, number) in row[..lanes].iter_mut().enumerate() {
            let edge = |axis: usize| {
                let [low, high] = [&columns[axis], &columns[axis + 3]];
                let low = smaller(low[lane], low[lane + offset]);
                let high = larger(high[lane], high[lane + offset]);
                high - low
            };
            let (x, y, z) = (edge(0), edge(1), edge(2));
            let distance = x * (y + z) + y * z;
            let place = first.wrapping_add(to_u32(lane));
            *number = (distance.to_bits() & DISTANCE_MASK)
                | to_u32(offset - 1) << 1
                | (place >> offset.trailing_zeros() & 1);
        }
    }
}

/// The smaller of two numbers as one instruction gives it.
#[inline]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two numbers as one instruction gives it.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smallest number of all pairs that each place is part of.
#[inline(always)]
pub(crate) fn smallest(rows: &[u32], radius: usize, best: &mut [u32]) {
    best.fill(u32::MAX);
    for (offset, row) in (1..=radius).zip(rows.chunks_exact(row_len(radius))) {
        let lower = &row[radius..];
        let upper = &row[radius - offset..];
        for ((best, &lower), &upper) in best.iter_mut().zip(lower).zip(upper) {
            *best = (*best).min(lower).min(upper);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::Aabb;
    use niwaki_core::glam::Vec3;
    use proptest::prelude::*;

    /// By definition: each place's pair with the smallest number.
    fn by_definition(clusters: &[Cluster], radius: usize, scale: f32) -> Vec<u32> {
        let number = |lower: usize, upper: usize| {
            let bounds = clusters[lower].aabb().union(clusters[upper].aabb());
            let e = bounds.max * scale - bounds.min * scale;
            let distance = e.x * (e.y + e.z) + e.y * e.z;
            let offset = upper - lower;
            (distance.to_bits() & DISTANCE_MASK) | to_u32(offset - 1) << 1 | side(lower, offset)
        };
        (0..clusters.len())
            .map(|place| {
                let lower = (place.saturating_sub(radius)..place).map(|lower| number(lower, place));
                let upper = place + 1..clusters.len().min(place + radius + 1);
                lower.chain(upper.map(|upper| number(place, upper))).min().unwrap()
            })
            .collect()
    }

    fn find(clusters: &[Cluster], radius: usize, kernel: Kernel, scale: AreaScale) -> Vec<u32> {
        let mut best = vec![0; clusters.len()];
        let mut scratch = Scratch::new(radius, scale, kernel);
        for (i, best) in best.chunks_mut(CHUNK).enumerate() {
            scratch.nearest(clusters, i * CHUNK, best);
        }
        best
    }

    fn clusters(boxes: impl IntoIterator<Item = Aabb>) -> Vec<Cluster> {
        boxes.into_iter().zip(0..).map(|(b, i)| Cluster::single(b, i)).collect()
    }

    proptest! {
        #[test]
        fn all_kernels_find_what_the_definition_says(
            corners in prop::collection::vec(prop::array::uniform6(0_i8..20), 2..700),
            radius in 1..=crate::MAX_RADIUS,
            size in prop::sample::select(vec![1e-30_f32, 1.0, 1e30]),
        ) {
            let boxes: Vec<_> = corners
                .iter()
                .map(|c| {
                    let c = c.map(|c| f32::from(c) * size);
                    Aabb::from_points([Vec3::from_slice(&c[..3]), Vec3::from_slice(&c[3..])])
                })
                .collect();
            let scale = AreaScale::of(&boxes.iter().copied().reduce(Aabb::union).unwrap());
            let clusters = clusters(boxes);
            let expected = by_definition(&clusters, radius, scale.get());
            for kernel in [Kernel::Scalar, Kernel::fastest()] {
                prop_assert_eq!(&find(&clusters, radius, kernel, scale), &expected);
            }
            // A partner exists, is near, and names the same pair if it chose this place too.
            let mut mutual = 0;
            for (place, &number) in expected.iter().enumerate() {
                let other = partner(place, number);
                prop_assert!(other != place && other.abs_diff(place) <= radius);
                prop_assert_eq!(
                    expected[other] == number,
                    partner(other, expected[other]) == place
                );
                mutual += usize::from(expected[other] == number);
            }
            prop_assert!(mutual >= 2);
        }
    }

    #[test]
    fn equal_clusters_pair_up() {
        for radius in [1, 2, 14, 64] {
            let clusters = clusters([Aabb::new(Vec3::ZERO, Vec3::ONE); 1000]);
            let best = find(&clusters, radius, Kernel::fastest(), AreaScale::ONE);
            assert!((0..1000).all(|place| partner(place, best[place]) == place ^ 1));
        }
    }
}

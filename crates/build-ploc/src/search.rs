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
const DISTANCE_MASK: u32 = !KEY_MASK & 0x7fff_ffff;

/// The bit of a place that tells the lower of two places `offset` apart from the upper: they
/// differ in it, as `offset` is an odd multiple of it.
#[inline]
const fn side(place: usize, offset: usize) -> u32 {
    to_u32(place >> offset.trailing_zeros() & 1)
}

/// The number of the pair of places `lower` and `lower + offset` at `distance`.
#[inline]
const fn number(distance: f32, lower: usize, offset: usize) -> u32 {
    (distance.to_bits() & DISTANCE_MASK) | to_u32(offset - 1) << 1 | side(lower, offset)
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

/// Writes to `best` the pair with the smallest number of each of the places from `start` on.
/// There are at least two clusters.
pub(crate) fn nearest(
    clusters: &[Cluster],
    start: usize,
    radius: usize,
    scale: AreaScale,
    best: &mut [u32],
) {
    best.fill(u32::MAX);
    let end = start + best.len();
    for lower in start.saturating_sub(radius)..end {
        for upper in lower + 1..clusters.len().min(lower + radius + 1) {
            let d = distance(&clusters[lower], &clusters[upper], scale);
            let number = number(d, lower, upper - lower);
            for place in [lower, upper] {
                if (start..end).contains(&place) {
                    let best = &mut best[place - start];
                    *best = number.min(*best);
                }
            }
        }
    }
}

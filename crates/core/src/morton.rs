//! Morton codes and the order they put primitives in: what linear and clustering builders start
//! from.
//!
//! The code of a primitive interleaves the bits of its quantised centroid (Morton 1966; Lauterbach
//! et al. 2009, section 3.1). Sorted codes are the leaves of a binary radix tree whose nodes are
//! common prefixes: [`common_prefix`] and [`split`] read it off.

mod prefix;

pub use prefix::{common_prefix, split};

use crate::radix::sort_by_key;
use crate::{AreaScale, PrimRef, SceneBounds, to_u32};
use glam::Vec3;
use rayon::prelude::*;

const CHUNK: usize = 4096;

/// Primitives in Morton order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sorted {
    /// Morton codes, ascending.
    pub codes: Vec<u64>,
    /// For each code the place of its primitive in the input; ascending where codes are equal.
    pub order: Vec<u32>,
}

/// Maps centroids to codes: the box of all centroids, cut into equal cells along each axis.
#[derive(Clone, Copy, Debug)]
pub struct Quantizer {
    /// Twice the smallest centroid.
    low: Vec3,
    /// A power of two that brings tiny or huge extents near 1, so that `scale` is finite.
    pre: f32,
    /// Cells per (scaled) unit.
    scale: Vec3,
    last: f32,
}

impl Quantizer {
    /// For the primitives of a scene and codes of `code_bits` bits, a multiple of 3 up to 63.
    #[must_use]
    pub fn new(scene: &SceneBounds, code_bits: u32) -> Self {
        let cells = (1_u32 << (code_bits / 3)) as f32;
        let bounds = &scene.centroid2_bounds;
        let pre = AreaScale::of(bounds).get();
        let scale = (bounds.extent() * pre).to_array().map(|e| {
            let scale = cells / e;
            if e > 0.0 && scale.is_finite() { scale } else { 0.0 }
        });
        Self { low: bounds.min, pre, scale: Vec3::from_array(scale), last: cells - 1.0 }
    }

    /// The code of a primitive: x in the highest bit, then y, z, x …
    #[must_use]
    #[inline]
    pub fn code(&self, p: &PrimRef) -> u64 {
        let f = (p.centroid2() - self.low) * self.pre * self.scale;
        let [x, y, z] = f.to_array().map(|f| self.cell(f));
        spread(x) << 2 | spread(y) << 1 | spread(z)
    }

    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 ..= last < 2^21"
    )]
    fn cell(&self, f: f32) -> u64 {
        // A NaN (∞ − ∞ or 0·∞ at the ends of the range) fails the comparison.
        let f = if f > 0.0 { f } else { 0.0 };
        u64::from((if f < self.last { f } else { self.last }) as u32)
    }
}

/// Puts two zero bits between the lowest 21 bits.
#[inline]
fn spread(x: u64) -> u64 {
    let x = (x | x << 32) & 0x001f_0000_0000_ffff;
    let x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// Sorts by codes of `code_bits` bits, a multiple of 3 up to 63; equal codes stay in input order.
/// The result does not depend on the number of threads.
///
/// Items are 8 bytes, the upper bits of the code over the index, so that a pass of the radix sort
/// moves little. Of 63 bits the lower 31 wait until the upper 32 are in order, when the few
/// primitives that share those are sorted by all of them.
#[must_use]
pub fn sort(prims: &[PrimRef], scene: &SceneBounds, code_bits: u32) -> Sorted {
    const LONG_RUN: usize = 256;
    let quantizer = Quantizer::new(scene, code_bits);
    let codes: Vec<u64> = prims.par_iter().with_min_len(CHUNK).map(|p| quantizer.code(p)).collect();
    let upper_bits = code_bits.min(32);
    let lower_bits = code_bits - upper_bits;
    let mut items: Vec<u64> = codes
        .par_iter()
        .with_min_len(CHUNK)
        .enumerate()
        .map(|(i, code)| code >> lower_bits << 32 | i as u64)
        .collect();
    let mut spare = vec![0; items.len()];
    // SAFETY: the key is computed from the item alone.
    unsafe { sort_by_key(&mut items, &mut spare, upper_bits, |item| item >> 32) };
    let code = |item: u64| codes[index(item)];
    if lower_bits > 0 {
        let mut start = 0;
        while let Some(&first) = items.get(start) {
            let len = items[start..].iter().take_while(|&item| item >> 32 == first >> 32).count();
            let run = &mut items[start..start + len];
            if len >= LONG_RUN {
                // SAFETY: the key is looked up in a list that nothing changes meanwhile.
                unsafe { sort_by_key(run, &mut spare[..len], lower_bits, |&item| code(item)) };
            } else if len > 1 {
                run.sort_unstable_by_key(|&item| (code(item), item));
            }
            start += len;
        }
    }
    let mut sorted = spare;
    sorted.par_iter_mut().with_min_len(CHUNK).zip(&items).for_each(|(to, &item)| *to = code(item));
    drop(codes);
    let order = items.par_iter().with_min_len(CHUNK).map(|&item| to_u32(index(item))).collect();
    Sorted { codes: sorted, order }
}

/// The place in the input that an item names.
#[inline]
const fn index(item: u64) -> usize {
    (item & 0xffff_ffff) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_leaves_two_zeros_between_bits() {
        for x in [0, 1, 0x1f_ffff, 0x15_5555, 0x0a_aaaa, 0x12_3456] {
            let expected = (0..21).fold(0, |sum, bit| sum | (x >> bit & 1) << (3 * bit));
            assert_eq!(spread(x), expected);
        }
    }
}

//! Sorts the primitives of one small tree along one axis.

use niwaki_core::PrimRef;
use niwaki_core::float::sortable_bits;
use niwaki_core::glam::Vec4;
use std::ops::RangeInclusive;

/// Memory of [`Keys::sort`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Keys {
    keys: [Vec<u64>; 3],
    spare: Vec<u64>,
}

const DIGITS: usize = 256;
/// Below this, counting digits costs more than comparing; above, positions need more than 16 bits.
const RADIX: RangeInclusive<usize> = 64..=1 << 16;

impl Keys {
    /// Makes room for `count` primitives.
    pub(crate) fn reserve(&mut self, count: usize) {
        for keys in self.keys.iter_mut().chain([&mut self.spare]) {
            if keys.len() < count {
                keys.reserve_exact(count - keys.len());
                keys.resize(count, 0);
            }
        }
    }

    /// Writes the positions of `prims` to `order`, sorted along each axis by their centroids,
    /// equal ones by position. Each order is as long as `prims`.
    ///
    /// Two passes of a radix sort over centroids rounded to 16 bits of their range, then an
    /// insertion sort of the exact values, which finds little to do: rounding keeps the order.
    /// Where it does find much, because nearly all values lie close together, a comparison sort
    /// takes over.
    pub(crate) fn sort(&mut self, prims: &[PrimRef], order: [&mut [u32]; 3]) {
        let count = prims.len();
        self.reserve(count);
        if !RADIX.contains(&count) {
            for (axis, order) in order.into_iter().enumerate() {
                let keys = &mut self.keys[axis][..count];
                for (key, (p, i)) in keys.iter_mut().zip(prims.iter().zip(0_u64..)) {
                    *key = u64::from(sortable_bits(p.min[axis] + p.max[axis])) << 32 | i;
                }
                keys.sort_unstable();
                #[expect(clippy::cast_possible_truncation, reason = "the low half is the position")]
                for (order, &key) in order.iter_mut().zip(keys.iter()) {
                    *order = key as u32;
                }
            }
            return;
        }
        let mut counts = self.round(prims);
        let spare = &mut self.spare[..count];
        for ((keys, order), [low, high]) in self.keys.iter_mut().zip(order).zip(&mut counts) {
            let keys = &mut keys[..count];
            scatter(keys, spare, low, 16);
            scatter(spare, keys, high, 24);
            if !insertion_sort(keys) {
                keys.sort_unstable();
            }
            for (order, &key) in order.iter_mut().zip(keys.iter()) {
                *order = (key & 0xffff) as u32;
            }
        }
    }

    /// Makes the keys, from high to low: the exact centroid, the rounded one, the position.
    /// Returns how often each of the two digits of the rounded one occurs on each axis.
    fn round(&mut self, prims: &[PrimRef]) -> [[[u32; DIGITS]; 2]; 3] {
        // The fourth components are ids and have no meaning as numbers.
        let corners: &[[Vec4; 2]] = bytemuck::cast_slice(prims);
        let (mut min, mut max) = ([Vec4::INFINITY; 2], [Vec4::NEG_INFINITY; 2]);
        for pair in corners.chunks(2) {
            // Two boxes in turn, because each depends on itself before.
            for (way, [a, b]) in pair.iter().enumerate() {
                let centroid2 = *a + *b;
                min[way] = min[way].min(centroid2);
                max[way] = max[way].max(centroid2);
            }
        }
        let (min, max) = (min[0].min(min[1]), max[0].max(max[1]));
        let steps = Vec4::splat(65535.0) / (max - min);
        let steps = Vec4::select(steps.is_finite_mask(), steps, Vec4::ZERO);
        // Adding 2^23 rounds to an integer and leaves it in the low bits. What is not a number
        // gives bits without meaning, which the exact sort repairs.
        let magic = Vec4::splat(8_388_608.0);
        let mut counts = [[[0_u32; DIGITS]; 2]; 3];
        let [x, y, z] = &mut self.keys;
        let keys = x.iter_mut().zip(y).zip(z);
        for (((x, y), z), ([a, b], i)) in keys.zip(corners.iter().zip(0_u64..)) {
            let centroid2 = *a + *b;
            let rounded = ((centroid2 - min) * steps + magic).to_array();
            let exact = centroid2.to_array();
            for (axis, key) in [x, y, z].into_iter().enumerate() {
                let rounded = rounded[axis].to_bits() & 0xffff;
                counts[axis][0][(rounded & 255) as usize] += 1;
                counts[axis][1][(rounded >> 8) as usize] += 1;
                *key = u64::from(sortable_bits(exact[axis])) << 32 | u64::from(rounded) << 16 | i;
            }
        }
        counts
    }
}

fn scatter(source: &[u64], target: &mut [u64], counts: &mut [u32; DIGITS], shift: u32) {
    let mut sum = 0;
    for count in counts.iter_mut() {
        sum += std::mem::replace(count, sum);
    }
    for &key in source {
        let place = &mut counts[(key >> shift & 255) as usize];
        target[*place as usize] = key;
        *place += 1;
    }
}

/// Sorts in place; false if that would have taken too long.
fn insertion_sort(keys: &mut [u64]) -> bool {
    let mut budget = 4 * keys.len();
    for i in 1..keys.len() {
        let key = keys[i];
        let mut place = i;
        while place > 0 && keys[place - 1] > key {
            keys[place] = keys[place - 1];
            place -= 1;
        }
        keys[place] = key;
        let Some(rest) = budget.checked_sub(i - place) else { return false };
        budget = rest;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use niwaki_core::{Aabb, glam::Vec3};
    use proptest::prelude::*;

    fn check(values: &[f32]) {
        let prims: Vec<PrimRef> = values
            .iter()
            .map(|&v| {
                let corner = Vec3::new(v, -v, v * 0.5);
                PrimRef::new(Aabb::new(corner, corner), u32::MAX)
            })
            .collect();
        let mut order = [const { Vec::new() }; 3].map(|_: Vec<u32>| vec![0; values.len()]);
        let [x, y, z] = &mut order;
        Keys::default().sort(&prims, [x, y, z]);
        for (axis, order) in order.iter().enumerate() {
            let mut expected: Vec<u32> = (0..u32::try_from(values.len()).unwrap()).collect();
            expected.sort_by_key(|&i| (sortable_bits(prims[i as usize].centroid2()[axis]), i));
            assert_eq!(*order, expected);
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_sort(
            values in prop::collection::vec(prop::num::f32::NORMAL | prop::num::f32::ZERO, 1..400),
            coarse in any::<bool>(),
        ) {
            check(&values.iter().map(|v| if coarse { v.signum() } else { *v }).collect::<Vec<_>>());
        }
    }

    #[test]
    fn clustered_values_sort_exactly() {
        // All but two share the rounded value.
        let mut values: Vec<f32> = (0..3000_u32).map(|i| (i * 7919 % 3001) as f32 * 1e-9).collect();
        values.extend([1e6, -1e6]);
        check(&values);
        check(&[f32::INFINITY, f32::MAX, f32::MIN, f32::NEG_INFINITY].repeat(50));
        check(&vec![3.0; 500]);
    }
}

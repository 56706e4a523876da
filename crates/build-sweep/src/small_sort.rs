//! Sorts the primitives of one small tree along one axis.

use niwaki_core::float::sortable_bits;

/// Memory of [`Keys::sort`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Keys {
    keys: Vec<u64>,
    spare: Vec<u64>,
}

const DIGITS: usize = 256;
/// Below this, counting digits costs more than comparing.
const RADIX_FROM: usize = 64;

impl Keys {
    /// Makes room for `count` values.
    pub(crate) fn reserve(&mut self, count: usize) {
        self.keys.clear();
        self.keys.reserve_exact(count);
        self.spare.reserve_exact(count.saturating_sub(self.spare.len()));
    }

    /// Writes the positions of `values` to `order`, lowest value first, equal values by position.
    ///
    /// Two passes of a radix sort over values rounded to 16 bits of their range, then an insertion
    /// sort of the exact values, which finds little to do: rounding keeps the order. Where it does
    /// find much, because nearly all values lie close together, a comparison sort takes over.
    pub(crate) fn sort(
        &mut self,
        values: impl ExactSizeIterator<Item = f32> + Clone,
        order: &mut [u32],
    ) {
        let count = values.len();
        self.reserve(count);
        let keys = &mut self.keys;
        if (RADIX_FROM..=1 << 16).contains(&count) {
            let (min, max) = values
                .clone()
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            let steps = 65535.0 / (max - min);
            let steps = if steps.is_finite() { steps } else { 0.0 };
            let mut counts = [[0_u32; DIGITS]; 2];
            keys.extend(values.zip(0_u64..).map(|(value, i)| {
                #[expect(clippy::cast_possible_truncation, reason = "from 0 to 65535")]
                #[expect(clippy::cast_sign_loss, reason = "not negative")]
                let rounded = ((value - min) * steps).min(65535.0) as u32;
                counts[0][(rounded & 255) as usize] += 1;
                counts[1][(rounded >> 8) as usize] += 1;
                u64::from(sortable_bits(value)) << 32 | u64::from(rounded) << 16 | i
            }));
            self.spare.resize(self.spare.len().max(count), 0);
            scatter(keys, &mut self.spare[..count], &mut counts[0], 16);
            scatter(&self.spare[..count], keys, &mut counts[1], 24);
            if !insertion_sort(keys) {
                keys.sort_unstable();
            }
            for (order, &key) in order.iter_mut().zip(keys.iter()) {
                *order = (key & 0xffff) as u32;
            }
        } else {
            keys.extend(values.zip(0_u64..).map(|(v, i)| u64::from(sortable_bits(v)) << 32 | i));
            keys.sort_unstable();
            #[expect(clippy::cast_possible_truncation, reason = "the low half is the position")]
            for (order, &key) in order.iter_mut().zip(keys.iter()) {
                *order = key as u32;
            }
        }
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
    use proptest::prelude::*;

    fn check(values: &[f32]) {
        let mut order = vec![0; values.len()];
        Keys::default().sort(values.iter().copied(), &mut order);
        let mut expected: Vec<u32> = (0..u32::try_from(values.len()).unwrap()).collect();
        expected.sort_by_key(|&i| (sortable_bits(values[i as usize]), i));
        assert_eq!(order, expected);
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

//! A stable parallel radix sort, the first step of sweep and Morton-code builders.
//!
//! Least significant digit first, 8 bits a pass. Each pass counts digits by chunk, forms the
//! offsets of all chunks and lets every chunk scatter its items; a digit that all keys share
//! costs only the counting. A stable sort has one result, so the number of chunks, and with it
//! the number of threads, does not show.

use rayon::prelude::*;

const DIGIT_BITS: u32 = 8;
const DIGITS: usize = 1 << DIGIT_BITS;
/// Below this, one chunk: sharing the work would cost more than it saves.
const PARALLEL_FROM: usize = 1 << 15;

/// Sorts `items` by the lowest `bits` bits of `key`, keeping the order of equal keys. `spare`
/// must be as long as `items`; it is overwritten.
///
/// # Panics
/// If the lengths differ or are over [`u32::MAX`].
///
/// # Safety
/// `key` must return the same value whenever it is given the same item during this call. Items
/// are moved to places that were counted before, without looking again: a key that changes
/// between the count and the move would write out of bounds.
pub unsafe fn sort_by_key<T: Copy + Send + Sync>(
    items: &mut [T],
    spare: &mut [T],
    bits: u32,
    key: impl Fn(&T) -> u64 + Sync,
) {
    assert_eq!(items.len(), spare.len(), "the spare array is as long as the items");
    assert!(items.len() <= u32::MAX as usize, "places are counted in 32 bits");
    let mut in_items = true;
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        let mask = (DIGITS as u64 - 1) >> DIGIT_BITS.saturating_sub(bits - shift);
        #[expect(clippy::cast_possible_truncation, reason = "masked to one digit")]
        let digit = |item: &T| ((key(item) >> shift) & mask) as usize;
        let (source, target) =
            if in_items { (&*items, &mut *spare) } else { (&*spare, &mut *items) };
        // SAFETY: the lengths were just checked; a digit depends on the key alone, which the
        // caller promises not to change.
        let moved = unsafe { scatter(source, target, digit) };
        in_items ^= moved;
    }
    if !in_items {
        items.copy_from_slice(spare);
    }
}

/// One pass from `source` to `target`; false if all items share the digit and nothing moved.
///
/// # Safety
/// Both have the same length of at most `u32::MAX`, and `digit` returns the same value, below
/// `DIGITS`, whenever it is given the same item.
unsafe fn scatter<T: Copy + Send + Sync>(
    source: &[T],
    target: &mut [T],
    digit: impl Fn(&T) -> usize + Sync,
) -> bool {
    let chunks = if source.len() < PARALLEL_FROM { 1 } else { rayon::current_num_threads() };
    let chunk_len = source.len().div_ceil(chunks).max(1);
    let mut offsets: Vec<[u32; DIGITS]> = source
        .par_chunks(chunk_len)
        .map(|chunk| {
            let mut counts = [0_u32; DIGITS];
            for item in chunk {
                counts[digit(item)] += 1;
            }
            counts
        })
        .collect();
    let mut sum = 0;
    for d in 0..DIGITS {
        let before = sum;
        for chunk in &mut offsets {
            let count = chunk[d];
            chunk[d] = sum;
            sum += count;
        }
        if (sum - before) as usize == source.len() {
            return false;
        }
    }
    let out = Shared(target.as_mut_ptr());
    let len = target.len();
    source.par_chunks(chunk_len).zip(&mut offsets).for_each(|(chunk, offsets)| {
        let out = &out;
        for item in chunk {
            let place = &mut offsets[digit(item)];
            debug_assert!((*place as usize) < len, "counted before");
            // SAFETY: `place` starts at the number of items with a smaller digit, or with the
            // same digit in an earlier chunk, and grows by one for each item of this chunk with
            // this digit. As the caller promises that digits are those that were counted, and
            // that no count overflows, the places of all chunks are a permutation of 0..len: in
            // bounds, and none is written twice.
            unsafe { out.0.add(*place as usize).write(*item) };
            *place += 1;
        }
    });
    true
}

/// A pointer that tasks share to write disjoint places.
struct Shared<T>(*mut T);
// SAFETY: every task writes only the places that the counting pass gave to its chunk.
unsafe impl<T: Send> Sync for Shared<T> {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(mut items: Vec<(u64, u32)>, bits: u32) {
        let mask = if bits == 64 { u64::MAX } else { (1 << bits) - 1 };
        let mut expected = items.clone();
        expected.sort_by_key(|i| i.0 & mask);
        let mut spare = items.clone();
        // SAFETY: the key is a field of the item.
        unsafe { sort_by_key(&mut items, &mut spare, bits, |i| i.0) };
        assert_eq!(items, expected);
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_stable_sort(
            keys in prop::collection::vec(any::<u64>(), 0..2000),
            spread in 0_u32..63,
            bits in prop::sample::select(vec![1_u32, 8, 30, 32, 63, 64]),
        ) {
            check(keys.into_iter().zip(0..).map(|(k, i)| (k >> spread, i)).collect(), bits);
        }
    }

    #[test]
    fn large_inputs_sort_the_same_on_any_number_of_threads() {
        let items: Vec<(u64, u32)> =
            (0..200_000_u32).map(|i| (u64::from(i.wrapping_mul(0x9e37_79b9) >> 12), i)).collect();
        for threads in [1, 2, 3, 8] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| check(items.clone(), 32));
        }
    }
}

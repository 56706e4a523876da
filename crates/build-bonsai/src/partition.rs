//! Splits a list of midpoints at a plane.

use crate::source::Midpoint;
use rayon::prelude::*;

/// Copies the items of `source` whose coordinate on `axis` is below `plane` to the front of
/// `target`, in order, and the others to its end, in reverse order. Returns how many went to the
/// front.
///
/// # Panics
/// If the lengths differ or there is no such axis.
pub(crate) fn partition(
    source: &[Midpoint],
    target: &mut [Midpoint],
    axis: usize,
    plane: f32,
) -> usize {
    assert!(source.len() == target.len() && axis < 3);
    let out = target.as_mut_ptr();
    let (mut left, mut right) = (0, source.len());
    for item in source {
        let is_left = item.center[axis] < plane;
        // Both places are written and one counts: cheaper than a branch that cannot be predicted.
        // SAFETY: before each item, `right − left` is the number of items still to come, so that
        // `left < right ≤ source.len()`, which is the length of `target`.
        unsafe {
            out.add(left).write(*item);
            out.add(right - 1).write(*item);
        }
        left += usize::from(is_left);
        right -= usize::from(!is_left);
    }
    left
}

/// Midpoints that one task of [`partition_parallel`] moves.
const CHUNK: usize = 1 << 14;

/// [`partition`] with all threads and the same result, for long lists.
pub(crate) fn partition_parallel(
    source: &[Midpoint],
    target: &mut [Midpoint],
    axis: usize,
    plane: f32,
) -> usize {
    assert!(source.len() == target.len());
    let is_left = |item: &Midpoint| item.center[axis] < plane;
    let counts: Vec<usize> = source
        .par_chunks(CHUNK)
        .map(|chunk| chunk.iter().filter(|item| is_left(item)).count())
        .collect();
    let left = counts.iter().sum();
    // Fronts of chunks follow each other from the left, backs from the right.
    let (mut front, mut back) = target.split_at_mut(left);
    let mut places = Vec::with_capacity(counts.len());
    for (chunk, &count) in source.chunks(CHUNK).zip(&counts) {
        let (front_here, front_after) = front.split_at_mut(count);
        let (back_after, back_here) = back.split_at_mut(back.len() - (chunk.len() - count));
        places.push((chunk, front_here, back_here));
        (front, back) = (front_after, back_after);
    }
    places.into_par_iter().for_each(|(chunk, front, back)| {
        let (mut front, mut back) = (front.iter_mut(), back.iter_mut().rev());
        for item in chunk {
            let place = if is_left(item) { front.next() } else { back.next() };
            if let Some(place) = place {
                *place = *item;
            }
        }
    });
    left
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_iterators(
            coordinates in prop::collection::vec(0_u8..20, 0..200),
            axis in 0_usize..3,
            plane in 0_u8..22,
        ) {
            let items: Vec<Midpoint> = coordinates
                .iter()
                .zip(0..)
                .map(|(&c, index)| {
                    let mut center = [f32::NAN; 3];
                    center[axis] = f32::from(c);
                    Midpoint { center, index }
                })
                .collect();
            let plane = f32::from(plane);
            let mut target = vec![Midpoint { center: [0.0; 3], index: u32::MAX }; items.len()];
            let left = partition(&items, &mut target, axis, plane);
            let goes_left = |item: &&Midpoint| item.center[axis] < plane;
            let expected: Vec<u32> = items
                .iter()
                .filter(goes_left)
                .chain(items.iter().rev().filter(|item| !goes_left(item)))
                .map(|item| item.index)
                .collect();
            prop_assert_eq!(left, items.iter().filter(goes_left).count());
            prop_assert!(target.iter().map(|item| item.index).eq(expected));
        }
    }

    #[test]
    fn all_threads_do_what_one_does() {
        let items: Vec<Midpoint> = (0..100_000_u32)
            .map(|index| Midpoint { center: [0.0, (index * 7919 % 1009) as f32, 0.0], index })
            .collect();
        for plane in [-1.0, 0.0, 300.0, 1008.0, 2000.0] {
            let mut expected = items.clone();
            let mut target = items.clone();
            let left = partition(&items, &mut expected, 1, plane);
            assert_eq!(partition_parallel(&items, &mut target, 1, plane), left);
            assert_eq!(target, expected);
        }
    }
}

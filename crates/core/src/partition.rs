//! Partitioning one list with all threads, in place.

use rayon::prelude::*;
use std::ops::Range;

/// Joins chunks that were partitioned each for itself: `items` are chunks of `chunk` items (the
/// last may be shorter), of which the `i`-th has its first `fronts[i]` items in front. Exchanges
/// what stands on the wrong side of the common border on the current rayon pool, so that the fronts
/// of all chunks come first, and returns how many there are.
///
/// The order depends on the size of chunks, but not on the number of threads.
///
/// # Panics
/// If `chunk` is 0, or `fronts` has not one entry for each chunk or one larger than its chunk.
pub fn join_chunks<T: Send>(items: &mut [T], chunk: usize, fronts: &[usize]) -> usize {
    assert_eq!(fronts.len(), items.len().div_ceil(chunk), "one front for each chunk");
    let border = fronts.iter().sum();
    let len = items.len();
    // Runs on the wrong side: what is not in front before the border, and what is behind it.
    let runs = || {
        let starts = (0..).step_by(chunk);
        fronts
            .iter()
            .zip(starts)
            .map(move |(&front, start)| (start, start + front, (start + chunk).min(len)))
    };
    let before = runs().map(|(_, middle, end)| middle..end.min(border));
    let after = runs().map(|(start, middle, _)| start.max(border)..middle);
    let (front, back) = items.split_at_mut(border);
    let mut back = carve(back, border, after).into_iter();
    let mut to: &mut [T] = &mut [];
    let mut exchanges = Vec::new();
    for mut from in carve(front, 0, before) {
        while !from.is_empty() {
            if to.is_empty() {
                // Both sides have the same number of items on the wrong side.
                let Some(next) = back.next() else { break };
                to = next;
            }
            let len = from.len().min(to.len());
            let (a, b);
            (a, from) = from.split_at_mut(len);
            (b, to) = to.split_at_mut(len);
            exchanges.push((a, b));
        }
    }
    exchanges.into_par_iter().for_each(|(a, b)| a.swap_with_slice(b));
    border
}

/// The ranges, ascending and disjoint, of a slice that begins at index `base`. Ranges that are
/// empty or reversed are left out.
fn carve<T>(
    mut slice: &mut [T],
    mut base: usize,
    ranges: impl Iterator<Item = Range<usize>>,
) -> Vec<&mut [T]> {
    let mut parts = Vec::new();
    for range in ranges.filter(|range| !range.is_empty()) {
        let (_, after) = slice.split_at_mut(range.start - base);
        let part;
        (part, slice) = after.split_at_mut(range.len());
        base = range.end;
        parts.push(part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fronts_of_all_chunks_come_first() {
        for len in [0_u32, 1, 7, 8, 9, 100, 1001] {
            for modulus in [1, 2, 3, 10, 1000] {
                let is_front = |x: &u32| (x * 7919 % 1009).is_multiple_of(modulus);
                let mut items: Vec<u32> = (0..len).collect();
                let fronts: Vec<usize> = items
                    .chunks_mut(8)
                    .map(|chunk| {
                        chunk.sort_by_key(|x| !is_front(x));
                        chunk.iter().filter(|x| is_front(x)).count()
                    })
                    .collect();
                let border = join_chunks(&mut items, 8, &fronts);
                assert!(items[..border].iter().all(is_front));
                assert!(!items[border..].iter().any(is_front));
                items.sort_unstable();
                assert!(items.into_iter().eq(0..len), "nothing is lost");
            }
        }
    }
}

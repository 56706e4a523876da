//! Rank correlation with ties in O(n log n).

/// Kendall's τ-b: how far two quantities put the same things in the same order, from −1 (reversed)
/// to 1 (the same order). Pairs that tie in one of the two count neither for nor against, and shrink
/// the denominator (Kendall 1945). Sorted and counted by merging (Knight 1966).
///
/// None where the lengths differ, a value is not a number, or one of the two does not vary, so that
/// it has no order.
///
/// ```
/// use niwaki_frame_control::kendall_tau_b;
///
/// assert_eq!(kendall_tau_b(&[1.0, 2.0, 3.0], &[10.0, 20.0, 30.0]), Some(1.0));
/// assert_eq!(kendall_tau_b(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]), Some(-1.0));
/// assert_eq!(kendall_tau_b(&[1.0, 2.0], &[5.0, 5.0]), None);
/// ```
pub fn kendall_tau_b(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() != y.len() || x.iter().chain(y).any(|v| v.is_nan()) {
        return None;
    }
    // Adding zero makes −0 and 0 the same value for `total_cmp` too.
    let mut pairs: Vec<(f64, f64)> = x.iter().zip(y).map(|(x, y)| (x + 0.0, y + 0.0)).collect();
    pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let tied_x = tied(&pairs, |a, b| a.0 == b.0);
    let tied_both = tied(&pairs, |a, b| a == b);
    let mut values: Vec<f64> = pairs.iter().map(|pair| pair.1).collect();
    let discordant = sort_counting(&mut values);
    let tied_y = tied(&values, |a, b| a == b);
    let n = x.len() as u128;
    let all = n * n.saturating_sub(1) / 2;
    let varied = (all - tied_x) as f64 * (all - tied_y) as f64;
    if varied == 0.0 {
        return None;
    }
    // Pairs that differ in both are concordant or discordant.
    let differing = all + tied_both - tied_x - tied_y;
    Some((differing as f64 - 2.0 * discordant as f64) / varied.sqrt())
}

/// Pairs within runs of equal neighbours.
fn tied<T>(sorted: &[T], equal: impl Fn(&T, &T) -> bool) -> u128 {
    sorted
        .chunk_by(equal)
        .map(|run| {
            let n = run.len() as u128;
            n * (n - 1) / 2
        })
        .sum()
}

/// Sorts from the bottom up and counts the pairs that were out of order.
fn sort_counting(values: &mut [f64]) -> u128 {
    let n = values.len();
    let mut merged = values.to_vec();
    let mut swaps = 0_u128;
    let mut width = 1;
    while width < n {
        for start in (0..n).step_by(2 * width) {
            let middle = (start + width).min(n);
            let end = (start + 2 * width).min(n);
            let (mut left, mut right) = (start, middle);
            for slot in &mut merged[start..end] {
                let take_left = right == end || (left < middle && values[left] <= values[right]);
                if take_left {
                    *slot = values[left];
                    left += 1;
                } else {
                    // It overtakes all that is left of the left half.
                    swaps += (middle - left) as u128;
                    *slot = values[right];
                    right += 1;
                }
            }
        }
        values.copy_from_slice(&merged);
        width *= 2;
    }
    swaps
}

//! Common prefixes of sorted Morton codes.

/// Length of the common prefix of the codes at places `i ≠ j` of the order, where equal codes go
/// on with the places themselves (Karras 2012, section 4): δ(i, j). From 0 to 95.
///
/// # Panics
/// If a place is not one of `codes`.
#[must_use]
#[inline]
pub fn common_prefix(codes: &[u64], i: usize, j: usize) -> u32 {
    let differing = codes[i] ^ codes[j];
    if differing != 0 {
        differing.leading_zeros()
    } else {
        // Places have 31 bits: the xor fits in the upper half of 64 bits.
        64 + ((i ^ j) as u64).leading_zeros() - 32
    }
}

/// The first place of the second child of the node over places `first ..= last`, `first < last`:
/// where the first differing bit of code or place changes (Lauterbach et al. 2009, section 3.2).
///
/// # Panics
/// If the places are not in that order, or not of `codes`.
#[must_use]
#[inline]
pub fn split(codes: &[u64], first: usize, last: usize) -> usize {
    let differing = codes[first] ^ codes[last];
    if differing == 0 {
        // Places differ in this bit, and are consecutive: no search.
        let bit = (first ^ last).ilog2();
        return last >> bit << bit;
    }
    let bit = 1_u64 << differing.ilog2();
    first + codes[first..=last].partition_point(|code| code & bit == 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// A split is where the common prefix of neighbours is shortest.
        #[test]
        fn splits_where_neighbours_share_least(
            mut codes in prop::collection::vec(any::<u64>(), 2..200),
            shift in 0_u32..64,
        ) {
            for code in &mut codes {
                *code = *code >> 1 >> shift;
            }
            codes.sort_unstable();
            let shortest = (0..codes.len() - 1)
                .min_by_key(|&i| common_prefix(&codes, i, i + 1))
                .unwrap();
            prop_assert_eq!(split(&codes, 0, codes.len() - 1), shortest + 1);
        }
    }
}

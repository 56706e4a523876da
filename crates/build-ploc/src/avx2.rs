//! The inner loops of [`crate::search`] for AVX2, eight pairs at once. The same operations in the
//! same order, hence the same bits.

use crate::search::{self, BLOCK, DISTANCE_MASK, row_len};
use niwaki_core::bottom_up::Cluster;
use niwaki_core::to_u32;
use std::arch::x86_64::*;

/// As [`search::fill_columns`].
#[target_feature(enable = "avx2")]
pub(crate) fn fill_columns(
    clusters: &[Cluster],
    first: usize,
    scale: f32,
    columns: &mut [Vec<f32>; 6],
) {
    let (blocks, rest) = clusters.as_chunks::<BLOCK>();
    for (i, block) in blocks.iter().enumerate() {
        // SAFETY: a `Cluster` is 32 bytes of plain numbers; they are read at any address.
        let row = |i: usize| unsafe { _mm256_loadu_ps(std::ptr::from_ref(&block[i]).cast()) };
        // Two registers of four lanes: the smallest coordinates of four clusters, and the largest.
        let quad = |i: usize| {
            let low = |a, b| _mm256_unpacklo_ps(a, b);
            let high = |a, b| _mm256_unpackhi_ps(a, b);
            let (a, b, c, d) = (row(i), row(i + 1), row(i + 2), row(i + 3));
            let (ac, bd) = (low(a, c), low(b, d));
            // x, y and z of all four, of the smallest corner below, of the largest above.
            [low(ac, bd), high(ac, bd), low(high(a, c), high(b, d))]
        };
        let (lower, upper) = (quad(0), quad(4));
        for axis in 0..3 {
            let scale = _mm256_set1_ps(scale);
            let min = _mm256_permute2f128_ps::<0x20>(lower[axis], upper[axis]);
            let max = _mm256_permute2f128_ps::<0x31>(lower[axis], upper[axis]);
            for (column, x) in [(axis, min), (axis + 3, max)] {
                let to = &mut columns[column][first + i * BLOCK..][..BLOCK];
                // SAFETY: `to` is eight numbers, at any address.
                unsafe { _mm256_storeu_ps(to.as_mut_ptr(), _mm256_mul_ps(x, scale)) };
            }
        }
    }
    search::fill_columns(rest, first + clusters.len() - rest.len(), scale, columns);
}

/// As [`search::fill_rows`]; fills full blocks.
#[target_feature(enable = "avx2")]
pub(crate) fn fill_rows(
    columns: &[Vec<f32>; 6],
    rows: &mut [u32],
    radius: usize,
    lanes: usize,
    first: u32,
) {
    let row_len = row_len(radius);
    assert!(lanes <= row_len && rows.len() == radius * row_len, "rows fit the chunk");
    assert!(columns.iter().all(|column| column.len() == row_len + radius), "columns fit the rows");
    let corners = columns.each_ref().map(|column| column.as_ptr());
    let load = |column: usize, lane: usize| {
        // SAFETY: lanes are at most `row_len − BLOCK + radius`, and columns are `row_len + radius`
        // long, as was just checked.
        unsafe { _mm256_loadu_ps(corners[column].add(lane)) }
    };
    let mask = _mm256_set1_epi32(DISTANCE_MASK.cast_signed());
    let one = _mm256_set1_epi32(1);
    let steps = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    for lane in (0..lanes).step_by(BLOCK) {
        let place = first.wrapping_add(to_u32(lane)).cast_signed();
        let places = _mm256_add_epi32(_mm256_set1_epi32(place), steps);
        let low = [load(0, lane), load(1, lane), load(2, lane)];
        let high = [load(3, lane), load(4, lane), load(5, lane)];
        for offset in 1..=radius {
            let edge = |axis: usize| {
                let low = _mm256_min_ps(low[axis], load(axis, lane + offset));
                let high = _mm256_max_ps(high[axis], load(axis + 3, lane + offset));
                _mm256_sub_ps(high, low)
            };
            let (x, y, z) = (edge(0), edge(1), edge(2));
            let distance =
                _mm256_add_ps(_mm256_mul_ps(x, _mm256_add_ps(y, z)), _mm256_mul_ps(y, z));
            let shift = _mm_cvtsi32_si128(offset.trailing_zeros().cast_signed());
            let side = _mm256_and_si256(_mm256_srl_epi32(places, shift), one);
            let key = _mm256_set1_epi32((to_u32(offset - 1) << 1).cast_signed());
            let number = _mm256_or_si256(
                _mm256_and_si256(_mm256_castps_si256(distance), mask),
                _mm256_or_si256(key, side),
            );
            let row = &mut rows[(offset - 1) * row_len + lane..][..BLOCK];
            // SAFETY: `row` is eight numbers, at any address.
            unsafe { _mm256_storeu_si256(row.as_mut_ptr().cast(), number) };
        }
    }
}

/// As [`search::smallest`].
#[target_feature(enable = "avx2")]
pub(crate) fn smallest(rows: &[u32], radius: usize, best: &mut [u32]) {
    search::smallest(rows, radius, best);
}

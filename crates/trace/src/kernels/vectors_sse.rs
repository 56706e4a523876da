//! The names of `vectors` for processors without AVX and FMA: SSE4.2.

pub(crate) use super::vectors::vectors128::{lane_ids, load_bytes, low};
use std::arch::x86_64::*;
pub(crate) use std::arch::x86_64::{
    __m128 as Floats, __m128i as Ints, _mm_add_ps as add, _mm_and_ps as and,
    _mm_and_si128 as and_ints, _mm_andnot_ps as and_not, _mm_andnot_si128 as and_not_ints,
    _mm_castps_si128 as as_ints, _mm_cvtss_f32 as first_lane, _mm_div_ps as div,
    _mm_load_ps as load, _mm_load_si128 as load_ints, _mm_loadu_ps as load_unaligned,
    _mm_max_ps as max, _mm_min_ps as min, _mm_mul_ps as mul, _mm_or_si128 as or_ints,
    _mm_set1_epi32 as splat_int, _mm_set1_ps as splat, _mm_setzero_ps as zero,
    _mm_storeu_ps as store_unaligned, _mm_storeu_si128 as store_ints, _mm_sub_epi32 as sub_ints,
    _mm_sub_ps as sub, _mm_xor_ps as xor,
};

/// [`loose_mul_add`] rounds twice.
pub(crate) const FUSED: bool = false;

/// `a·b + c`, the product rounded too.
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn loose_mul_add(a: Floats, b: Floats, c: Floats) -> Floats {
    add(mul(a, b), c)
}

/// `a·b + c` rounded once, as the instruction that these processors lack would: to the last bit,
/// so that hits are those of all other kernels.
///
/// In `f64` the product is exact, and the sum has 53 bits. Rounding these to `f32` gives what rounding
/// the exact sum would have unless they are just in the middle between two floats, which is rare:
/// the way out of it is [`odd_mul_add`]. Denormal floats have their middles elsewhere, so that they
/// take it too.
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn mul_add(a: Floats, b: Floats, c: Floats) -> Floats {
    let upper = |v| _mm_cvtps_pd(_mm_movehl_ps(v, v));
    let low = [a, b, c].map(|v| _mm_cvtps_pd(v));
    let high = [a, b, c].map(upper);
    let both = [low, high].map(|[a, b, c]| _mm_add_pd(_mm_mul_pd(a, b), c));
    let words = both.map(|sum| _mm_castpd_ps(sum));
    let low_words = _mm_castps_si128(_mm_shuffle_ps::<0b10_00_10_00>(words[0], words[1]));
    let high_words = _mm_castps_si128(_mm_shuffle_ps::<0b11_01_11_01>(words[0], words[1]));
    // The 29 bits that an f32 has no room for.
    let rest = _mm_and_si128(low_words, _mm_set1_epi32(0x1fff_ffff));
    let in_the_middle = _mm_cmpeq_epi32(rest, _mm_set1_epi32(0x1000_0000));
    // Below the smallest normal f32, but not zero, which is exact: no f64 here is denormal.
    let magnitude = _mm_and_si128(high_words, _mm_set1_epi32(i32::MAX));
    let is_small = _mm_cmplt_epi32(magnitude, _mm_set1_epi32((1023 - 126) << 20));
    let is_zero = _mm_cmpeq_epi32(magnitude, _mm_setzero_si128());
    let unclear = _mm_or_si128(in_the_middle, _mm_andnot_si128(is_zero, is_small));
    if _mm_movemask_epi8(unclear) == 0 {
        let [low, high] = both.map(|sum| _mm_cvtpd_ps(sum));
        _mm_movelh_ps(low, high)
    } else {
        let [low, high] = [low, high].map(|[a, b, c]| _mm_cvtpd_ps(odd_mul_add(a, b, c)));
        _mm_movelh_ps(low, high)
    }
}

/// `a·b − c` rounded once.
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn mul_sub(a: Floats, b: Floats, c: Floats) -> Floats {
    mul_add(a, b, xor(c, splat(-0.0)))
}

/// `c − a·b` rounded once.
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn neg_mul_add(a: Floats, b: Floats, c: Floats) -> Floats {
    mul_add(xor(a, splat(-0.0)), b, c)
}

/// `a·b + c` rounded to odd, where `a·b` is exact: toward zero, with the lowest bit set unless the
/// sum was exact. Rounding that to `f32` gives what rounding the exact sum would have (Boldo and
/// Melquiond 2008, "Emulation of FMA and correctly rounded sums: proved algorithms using rounding to
/// odd"; 53 bits are at least two more than twice 24), denormal results included.
#[target_feature(enable = "sse4.2")]
#[inline]
fn odd_mul_add(a: __m128d, b: __m128d, c: __m128d) -> __m128d {
    let product = _mm_mul_pd(a, b);
    let sum = _mm_add_pd(product, c);
    // What rounding took away, exactly (Knuth's two-sum).
    let virtual_c = _mm_sub_pd(sum, product);
    let virtual_product = _mm_sub_pd(sum, virtual_c);
    let error = _mm_add_pd(_mm_sub_pd(product, virtual_product), _mm_sub_pd(c, virtual_c));
    // Not for a NaN, which comes of infinite sums: these stay as they are.
    let none = _mm_setzero_pd();
    let inexact = _mm_or_pd(_mm_cmplt_pd(error, none), _mm_cmplt_pd(none, error));
    let inexact = _mm_castpd_si128(inexact);
    // Rounded away from zero if the rest has the other sign: one step back.
    let other_sign = _mm_srli_epi64::<63>(_mm_castpd_si128(_mm_xor_pd(error, sum)));
    let truncated = _mm_sub_epi64(_mm_castpd_si128(sum), _mm_and_si128(other_sign, inexact));
    _mm_castsi128_pd(_mm_or_si128(truncated, _mm_srli_epi64::<63>(inexact)))
}

/// The lanes that `lanes` names in its two lowest bits.
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn permute(v: Ints, lanes: Ints) -> Ints {
    let lowest = _mm_and_si128(lanes, _mm_set1_epi32(3));
    // Four times the lane in each of its bytes, and the number of the byte.
    let everywhere = _mm_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12);
    let first = _mm_slli_epi32::<2>(_mm_shuffle_epi8(lowest, everywhere));
    _mm_shuffle_epi8(v, _mm_or_si128(first, _mm_set1_epi32(0x0302_0100)))
}

/// As [`permute`].
#[target_feature(enable = "sse4.2")]
#[inline]
pub(crate) fn permute_floats(v: Floats, lanes: Ints) -> Floats {
    _mm_castsi128_ps(permute(_mm_castps_si128(v), lanes))
}

/// The first `count` lanes of a mask.
#[inline]
pub(crate) fn low_lanes(mask: u32, count: u32) -> u32 {
    mask & ((1 << count) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the emulation gives for four triples.
    #[target_feature(enable = "sse4.2")]
    fn emulated(a: [f32; 4], b: [f32; 4], c: [f32; 4]) -> [[f32; 4]; 3] {
        // SAFETY: arrays of four words.
        let load = |v: [f32; 4]| unsafe { load_unaligned(v.as_ptr()) };
        let (a, b, c) = (load(a), load(b), load(c));
        [mul_add(a, b, c), mul_sub(a, b, c), neg_mul_add(a, b, c)].map(|v| {
            let mut lanes = [0.0; 4];
            // SAFETY: as above.
            unsafe { store_unaligned(lanes.as_mut_ptr(), v) };
            lanes
        })
    }

    fn check(triples: [[f32; 3]; 4]) {
        let row = |i: usize| triples.map(|triple| triple[i]);
        // SAFETY: the caller has looked.
        let found = unsafe { emulated(row(0), row(1), row(2)) };
        for (lane, [a, b, c]) in triples.into_iter().enumerate() {
            let expected = [a.mul_add(b, c), a.mul_add(b, -c), (-a).mul_add(b, c)];
            for (found, expected) in found.iter().zip(expected) {
                let (found, what) = (found[lane], format!("{a:e} {b:e} {c:e}"));
                let same = found.to_bits() == expected.to_bits();
                assert!(same || (found.is_nan() && expected.is_nan()), "{what}: {found:e}");
            }
        }
    }

    #[test]
    fn one_rounding_is_emulated_to_the_last_bit() {
        if !is_x86_feature_detected!("sse4.2") {
            eprintln!("skipped: no SSE4.2");
            return;
        }
        // Halfway between two floats but for what a sum in f64 drops: rounding twice goes wrong.
        let ulp = f32::EPSILON;
        let tiny = f32::from_bits(1);
        check([
            [1.0 + ulp, 1.0 + ulp, 2.0_f32.powi(60)],
            [2.0_f32.powi(-60), 1.0, 1.0 + ulp],
            [1.0 + 2.0_f32.powi(-12), 1.0 + 2.0_f32.powi(-12), 2.0_f32.powi(-80)],
            [tiny, 0.5, tiny],
        ]);
        check([
            [0.0, -1.0, -0.0],
            [f32::MAX, f32::MAX, -f32::MAX],
            [f32::INFINITY, 0.0, 1.0],
            [f32::INFINITY, 2.0, f32::NEG_INFINITY],
        ]);
        let mut rng = fastrand::Rng::with_seed(1);
        let mut wrong = 0;
        for round in 0..100_000 {
            let triples = [0; 4].map(|_| match round % 4 {
                // Any bits.
                0 => [0; 3].map(|_| f32::from_bits(rng.u32(..))),
                // Products and sums around the smallest floats.
                1 => {
                    let exponent = rng.i32(-80..-60);
                    let (a, b) = (1.0 + rng.f32(), 1.0 + rng.f32());
                    let (a, b) = (a * 2.0_f32.powi(exponent), b * 2.0_f32.powi(-140 - exponent));
                    [a, b, (rng.f32() - 0.5) * 2.0_f32.powi(-130)]
                }
                // Few bits: sums halfway between floats, up to a term far below.
                2 => {
                    let a = 1.0 + rng.u32(0..4096) as f32 * 2.0_f32.powi(-12);
                    let b = 1.0 + rng.u32(0..4096) as f32 * 2.0_f32.powi(-12);
                    let c = 2.0_f32.powi(rng.i32(-70..30));
                    [a, b, if rng.bool() { c } else { -c }]
                }
                // Sums that cancel.
                _ => {
                    let (a, b) = (rng.f32() - 0.5, rng.f32() - 0.5);
                    [a, b, -(a * b)]
                }
            });
            check(triples);
            // The cases are such that rounding twice would have been noticed.
            for [a, b, c] in triples {
                #[expect(clippy::cast_possible_truncation, reason = "the second rounding")]
                let twice = (f64::from(a) * f64::from(b) + f64::from(c)) as f32;
                wrong += u32::from(twice != a.mul_add(b, c) && !twice.is_nan());
            }
        }
        assert!(wrong > 100, "{wrong}");
    }

    #[test]
    fn lanes_are_permuted_as_named() {
        if !is_x86_feature_detected!("sse4.2") {
            eprintln!("skipped: no SSE4.2");
            return;
        }
        #[target_feature(enable = "sse4.2")]
        fn permuted(lanes: [i32; 4]) -> [i32; 4] {
            let lanes = _mm_setr_epi32(lanes[0], lanes[1], lanes[2], lanes[3]);
            let mut out = [0; 4];
            let v = permute(_mm_setr_epi32(0x0102_0304, -1, i32::MIN, 77), lanes);
            // SAFETY: an array of four words.
            unsafe { store_ints(out.as_mut_ptr().cast(), v) };
            out
        }
        // SAFETY: as just checked. Only the two lowest bits of a lane count.
        let found = unsafe { permuted([3, 0x7fff_fff0 + 1, -4, 2]) };
        assert_eq!(found, [77, -1, 0x0102_0304, i32::MIN]);
        assert_eq!([low_lanes(0b1111, 2), low_lanes(0b0101, 4)], [0b11, 0b0101]);
    }
}

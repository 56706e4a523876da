//! Rounding-aware arithmetic: bounds on the error of `f32` expressions, and conversions that round
//! to a known side.

/// Half the distance from 1 to the next larger `f32`: 2⁻²⁴, the unit roundoff.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// γ(n) = n·u / (1 − n·u), the bound on the relative error of `n` chained `f32` operations, with
/// u = [`UNIT_ROUNDOFF`] (Higham 2002, section 3.1).
#[must_use]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// Factor on the far distance of a slab test that makes it conservative: 1 + 2γ(3) (Ize 2013,
/// section 3). With it, rounding never makes a ray miss a box that it hits, as long as the
/// products neither overflow nor lose bits as denormals.
pub const ROBUST_SLAB: f32 = 1.0 + 2.0 * gamma(3);

/// The largest `f32` that is not above `x`; NaN stays NaN.
#[must_use]
#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding to f32 is the purpose; the side is repaired below"
)]
#[inline]
pub fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    step(nearest, -i32::from(f64::from(nearest) > x))
}

/// The smallest `f32` that is not below `x`; NaN stays NaN.
#[must_use]
#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding to f32 is the purpose; the side is repaired below"
)]
#[inline]
pub fn round_up(x: f64) -> f32 {
    let nearest = x as f32;
    step(nearest, i32::from(f64::from(nearest) < x))
}

/// The neighbour of a number above (1), below (−1) or itself (0), without a branch. −0.0 is below
/// +0.0; rounding keeps the sign, so nothing on the wrong side of either is rounded to it.
#[inline]
const fn step(x: f32, by: i32) -> f32 {
    let bits = x.to_bits().cast_signed();
    // Negative numbers sort by the complement of what follows their sign.
    let sorted = (bits ^ ((bits >> 31) & i32::MAX)) + by;
    f32::from_bits((sorted ^ ((sorted >> 31) & i32::MAX)).cast_unsigned())
}

/// Bits that sort as unsigned integers the way the numbers sort: the key of a radix sort. −0.0
/// comes just before +0.0; NaNs sort to the ends.
#[must_use]
#[inline]
pub const fn sortable_bits(x: f32) -> u32 {
    let bits = x.to_bits();
    bits ^ if bits >> 31 == 0 { 1 << 31 } else { u32::MAX }
}

/// Narrows an index or count that the caller has already bounded by [`u32::MAX`] (builders refuse
/// larger inputs with [`crate::BuildError::TooManyPrimitives`]).
///
/// # Panics
/// In builds with debug assertions, if `n` does not fit.
#[must_use]
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "bounded by the caller, asserted in tests")]
pub const fn to_u32(n: usize) -> u32 {
    debug_assert!(n <= u32::MAX as usize, "index does not fit in 32 bits");
    n as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_bounds_the_error_of_repeated_rounding() {
        // Three roundings at worst move a value by (1+u)^3.
        let worst = (1.0 + f64::from(UNIT_ROUNDOFF)).powi(3) - 1.0;
        assert!(f64::from(gamma(3)) >= worst);
        const { assert!(ROBUST_SLAB > 1.0 && ROBUST_SLAB <= 1.0 + 4.0 * f32::EPSILON) };
    }

    #[test]
    fn sortable_bits_keep_the_order() {
        let sorted = [f32::NEG_INFINITY, -1e30, -1.0, -1e-45, -0.0, 0.0, 1e-45, 1.0, f32::INFINITY];
        assert!(sorted.windows(2).all(|w| sortable_bits(w[0]) < sortable_bits(w[1])));
    }

    #[test]
    fn rounding_takes_the_asked_side() {
        for x in [0.1_f64, -0.1, 1.0 + 1e-12, -1.0 - 1e-12, 1e-46, -1e-46, 1e300, -1e300, 0.0] {
            assert!(f64::from(round_down(x)) <= x, "{x}");
            assert!(f64::from(round_up(x)) >= x, "{x}");
        }
        assert_eq!(round_down(0.5), 0.5);
        assert_eq!(round_up(0.5), 0.5);
        assert_eq!(round_down(1e300), f32::MAX);
        assert_eq!(round_up(1e300), f32::INFINITY);
        assert!(round_down(f64::NAN).is_nan());
    }
}

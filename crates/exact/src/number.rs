//! The two kinds of numbers that the predicates are evaluated in.

use num_bigint::{BigInt, Sign};
use std::cmp::Ordering;

/// What a predicate needs: ring operations, and the sign if it is known.
pub(crate) trait Number: Clone {
    /// Exactly `x`, which is finite.
    fn new(x: f32) -> Self;
    fn add(&self, other: &Self) -> Self;
    fn sub(&self, other: &Self) -> Self;
    fn mul(&self, other: &Self) -> Self;
    /// The sign, as the ordering to zero; `None` if the number's error leaves it open.
    fn sign(&self) -> Option<Ordering>;
}

/// An `f64` and a bound on how far the true value may be from it (running error analysis: Higham
/// 2002, section 3.3).
///
/// Products of up to seven `f32` values, more than any predicate here forms, stay between 2⁻¹⁰⁴³
/// and 2⁸⁹⁶; where a product is so small that `f64` loses bits, the error bound has a term for it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounded {
    pub(crate) value: f64,
    pub(crate) error: f64,
}

impl Bounded {
    /// The unit roundoff of `f64`, doubled, which pays for the rounding of the bound itself.
    const U: f64 = f64::EPSILON;

    fn rounded(value: f64, error: f64) -> Self {
        // Each bound is a sum of at most four non-negative terms: its own relative rounding
        // error is far below 8 units.
        let error = (error + value.abs() * Self::U) * (1.0 + 8.0 * Self::U);
        Self { value, error }
    }
}

impl Number for Bounded {
    fn new(x: f32) -> Self {
        Self { value: f64::from(x), error: 0.0 }
    }

    fn add(&self, other: &Self) -> Self {
        Self::rounded(self.value + other.value, self.error + other.error)
    }

    fn sub(&self, other: &Self) -> Self {
        Self::rounded(self.value - other.value, self.error + other.error)
    }

    fn mul(&self, other: &Self) -> Self {
        let error = self.value.abs() * other.error
            + other.value.abs() * self.error
            + self.error * other.error;
        Self::rounded(self.value * other.value, error + f64::MIN_POSITIVE)
    }

    fn sign(&self) -> Option<Ordering> {
        if self.value > self.error {
            Some(Ordering::Greater)
        } else if self.value < -self.error {
            Some(Ordering::Less)
        } else {
            None
        }
    }
}

/// `mantissa · 2^exponent`, without rounding: every finite `f32` is one, and sums, differences
/// and products of such numbers are again. Unlike fractions they need no common divisors.
#[derive(Clone, Debug)]
pub(crate) struct Dyadic {
    mantissa: BigInt,
    exponent: i32,
}

impl Dyadic {
    /// Both mantissas at the smaller of the exponents.
    fn aligned(&self, other: &Self) -> (BigInt, BigInt, i32) {
        let exponent = self.exponent.min(other.exponent);
        let at = |n: &Self| n.mantissa.clone() << n.exponent.abs_diff(exponent);
        (at(self), at(other), exponent)
    }

    /// The quotient, rounded to the nearest `f64` (ties to even) as long as it is a normal one;
    /// `None` for division by zero.
    pub(crate) fn divide(&self, by: &Self) -> Option<f64> {
        if by.mantissa.sign() == Sign::NoSign {
            return None;
        }
        let negative = (self.mantissa.sign() == Sign::Minus) != (by.mantissa.sign() == Sign::Minus);
        let (n, d) = (self.mantissa.magnitude(), by.mantissa.magnitude());
        // Scale so that the integer quotient has 62 or 63 bits, more than a double's 53.
        let shift = 62 + d.bits().cast_signed() - n.bits().cast_signed();
        let (n, d) = if shift >= 0 {
            (n.clone() << shift.unsigned_abs(), d.clone())
        } else {
            (n.clone(), d.clone() << shift.unsigned_abs())
        };
        let quotient = &n / &d;
        // A remainder makes the last bit odd: it then breaks ties the right way.
        let sticky = u64::from(&quotient * &d != n);
        let bits = quotient.iter_u64_digits().next().unwrap_or(0) | sticky;
        let magnitude =
            scale(bits as f64, i64::from(self.exponent) - i64::from(by.exponent) - shift);
        Some(if negative { -magnitude } else { magnitude })
    }
}

/// `x · 2^exponent`; exact while the result is normal.
fn scale(mut x: f64, mut exponent: i64) -> f64 {
    while exponent > 1000 && x.is_finite() && x != 0.0 {
        x *= 2.0_f64.powi(1000);
        exponent -= 1000;
    }
    while exponent < -1000 && x != 0.0 {
        x *= 2.0_f64.powi(-1000);
        exponent += 1000;
    }
    let rest = i32::try_from(exponent.clamp(-1000, 1000)).unwrap_or(0);
    x * 2.0_f64.powi(rest)
}

impl Number for Dyadic {
    fn new(x: f32) -> Self {
        let bits = x.to_bits();
        let biased = (bits >> 23 & 0xff).cast_signed();
        let fraction = i64::from(bits & 0x007f_ffff);
        // Denormals have no hidden bit and the exponent of the smallest normal numbers.
        let (magnitude, exponent) =
            if biased == 0 { (fraction, -149) } else { (fraction | 1 << 23, biased - 150) };
        let mantissa = BigInt::from(if bits >> 31 == 0 { magnitude } else { -magnitude });
        Self { mantissa, exponent }
    }

    fn add(&self, other: &Self) -> Self {
        let (a, b, exponent) = self.aligned(other);
        Self { mantissa: a + b, exponent }
    }

    fn sub(&self, other: &Self) -> Self {
        let (a, b, exponent) = self.aligned(other);
        Self { mantissa: a - b, exponent }
    }

    fn mul(&self, other: &Self) -> Self {
        Self {
            mantissa: &self.mantissa * &other.mantissa,
            exponent: self.exponent + other.exponent,
        }
    }

    fn sign(&self) -> Option<Ordering> {
        Some(match self.mantissa.sign() {
            Sign::Minus => Ordering::Less,
            Sign::NoSign => Ordering::Equal,
            Sign::Plus => Ordering::Greater,
        })
    }
}

/// Three numbers.
pub(crate) type Vector<N> = [N; 3];

pub(crate) fn vector<N: Number>(v: glam::Vec3) -> Vector<N> {
    v.to_array().map(N::new)
}

pub(crate) fn difference<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    [a[0].sub(&b[0]), a[1].sub(&b[1]), a[2].sub(&b[2])]
}

pub(crate) fn cross<N: Number>(a: &Vector<N>, b: &Vector<N>) -> Vector<N> {
    let minor = |i: usize, j: usize| a[i].mul(&b[j]).sub(&a[j].mul(&b[i]));
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

pub(crate) fn dot<N: Number>(a: &Vector<N>, b: &Vector<N>) -> N {
    a[0].mul(&b[0]).add(&a[1].mul(&b[1])).add(&a[2].mul(&b[2]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotients_are_rounded_to_nearest() {
        let n = |x: f32| Dyadic::new(x);
        for (a, b) in [
            (1.0_f32, 3.0_f32),
            (2.0, 3.0),
            (-1.0, 3.0),
            (1e-45, 3e38),
            (3e38, 1e-45),
            (16_777_215.0, 16_777_213.0),
            (0.0, 5.0),
            (0.1, -0.7),
        ] {
            // IEEE division of exactly converted operands rounds to nearest.
            assert_eq!(n(a).divide(&n(b)), Some(f64::from(a) / f64::from(b)), "{a} / {b}");
        }
        assert_eq!(n(1.0).divide(&n(0.0)), None);
        // 2⁵³ + 1 is a tie: to even, unless the numerator is a trace larger.
        let tie = n(2.0_f32.powi(53)).add(&n(1.0));
        assert_eq!(tie.divide(&n(1.0)), Some(2.0_f64.powi(53)));
        let above = tie.add(&n(1e-45));
        assert_eq!(above.divide(&n(1.0)), Some(2.0_f64.powi(53) + 2.0));
    }

    #[test]
    fn bounds_hold_what_is_exact() {
        let values = [1.5_f32, -1e-45, 3e38, 0.1, -0.0, 1e-20, 123_456.79];
        for x in values {
            for y in values {
                for z in values {
                    // (x + y)·(y − z)·x, whose factors cancel in part.
                    fn evaluate<N: Number>([x, y, z]: [f32; 3]) -> N {
                        let [x, y, z] = [x, y, z].map(N::new);
                        x.add(&y).mul(&y.sub(&z)).mul(&x)
                    }
                    let exact: Dyadic = evaluate([x, y, z]);
                    let near: Bounded = evaluate([x, y, z]);
                    let exact_value = exact.divide(&Dyadic::new(1.0)).unwrap();
                    assert!(
                        (exact_value - near.value).abs() <= near.error,
                        "{x} {y} {z}: {near:?}, exactly {exact_value}"
                    );
                    if let Some(sign) = near.sign() {
                        assert_eq!(Some(sign), exact.sign());
                    }
                }
            }
        }
    }
}

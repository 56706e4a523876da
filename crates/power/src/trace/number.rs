//! Decimal numbers from bytes, fast.

/// Powers of ten that `f64` holds exactly.
const EXACT: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// The number that the bytes spell, correctly rounded; NaN for anything else.
///
/// Up to 15 digits and powers up to 10²² need one exact product or quotient (Clinger 1990), which is
/// all that instruments print; the rest goes to the standard library.
pub(super) fn float(text: &[u8]) -> f64 {
    let (negative, digits) = match text.first() {
        Some(b'-') => (true, &text[1..]),
        Some(b'+') => (false, &text[1..]),
        _ => (false, text),
    };
    let mut mantissa = 0u64;
    let mut count = 0usize;
    let mut point = None;
    for (at, &byte) in digits.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            count += 1;
        } else if byte == b'.' && point.is_none() {
            point = Some(at);
        } else {
            return slow(text);
        }
    }
    let decimals = point.map_or(0, |at| digits.len() - at - 1);
    if count == 0 || count > 15 {
        return slow(text);
    }
    let value = mantissa as f64 / EXACT[decimals];
    if negative { -value } else { value }
}

#[cold]
fn slow(text: &[u8]) -> f64 {
    std::str::from_utf8(text).ok().and_then(|text| text.parse().ok()).unwrap_or(f64::NAN)
}

/// The decimal number that the bytes spell, times 10^`shift`, as a whole number (further digits are
/// cut off). No `f64` is between, so a nanosecond since 1970 keeps its place.
pub(super) fn scaled(text: &[u8], shift: u32) -> Option<i64> {
    let (negative, digits) = match text.first()? {
        b'-' => (true, &text[1..]),
        b'+' => (false, &text[1..]),
        _ => (false, text),
    };
    let mut value = 0i64;
    let mut after = None;
    let mut any = false;
    for &byte in digits {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            any = true;
            match &mut after {
                Some(n) if *n == shift => continue,
                Some(n) => *n += 1,
                None => {}
            }
            value = value.checked_mul(10)?.checked_add(i64::from(digit))?;
        } else if byte == b'.' && after.is_none() {
            after = Some(0);
        } else {
            return exponential(text, shift);
        }
    }
    if !any {
        return None;
    }
    value = value.checked_mul(10i64.checked_pow(shift - after.unwrap_or(0))?)?;
    Some(if negative { -value } else { value })
}

/// Times such as `1.5e+06`, which C++ streams print for large numbers.
#[cold]
fn exponential(text: &[u8], shift: u32) -> Option<i64> {
    let value = slow(text) * 10f64.powi(i32::try_from(shift).ok()?);
    #[expect(clippy::cast_possible_truncation, reason = "inside the range, and rounded")]
    (value.abs() < 9e18).then(|| value.round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_instruments_print_is_read() {
        assert_eq!(float(b"12.034"), 12.034);
        assert_eq!(float(b"-0.5"), -0.5);
        assert_eq!(float(b"1e-05"), 1e-5);
        assert_eq!(float(b"inf"), f64::INFINITY);
        for bad in [&b""[..], b".", b"-", b"1.2.3", b"x", b"nan", b"\xff"] {
            assert!(float(bad).is_nan(), "{bad:?}");
        }
        assert_eq!(scaled(b"1700000000.123456789", 9), Some(1_700_000_000_123_456_789));
        assert_eq!(scaled(b"-2.5", 9), Some(-2_500_000_000));
        assert_eq!(scaled(b"0.0000000019", 9), Some(1));
        assert_eq!(scaled(b"25", 0), Some(25));
        assert_eq!(scaled(b"1.5e+06", 6), Some(1_500_000_000_000));
        assert_eq!(scaled(b"99999999999999", 9), None);
        assert_eq!(scaled(b".", 9), None);
    }

    proptest! {
        #[test]
        fn floats_are_those_of_the_standard_library(number in any::<f64>(), digits in 0usize..18) {
            for text in [format!("{number}"), format!("{number:.digits$}"), format!("{number:e}")] {
                let expected: f64 = text.parse().unwrap();
                let found = float(text.as_bytes());
                prop_assert!(found == expected || (found.is_nan() && expected.is_nan()), "{}", text);
            }
        }

        #[test]
        fn times_are_exact(ns in any::<i64>().prop_map(|x| x / 2)) {
            let text = format!("{}{}.{:09}", if ns < 0 { "-" } else { "" },
                               ns.unsigned_abs() / 1_000_000_000, ns.unsigned_abs() % 1_000_000_000);
            prop_assert_eq!(scaled(text.as_bytes(), 9), Some(ns));
        }
    }
}

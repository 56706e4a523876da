// IEEE 754 binary32 arithmetic on bit patterns, rounded to nearest even, with subnormals,
// infinities and NaN: what the CPU computes, on every device.
//
// A device may flush subnormals, fuse a product into a sum, and do as it likes with infinities and
// NaN (Vulkan 1.3, section "Precision and Operation of SPIR-V Instructions"). It rounds sums and
// products of moderate numbers correctly, so those take one instruction; the rest is done in
// integers. NaN results are always 0x7fc00000.

const F_SIGN = 0x80000000u;
const F_MAGNITUDE = 0x7fffffffu;
const F_INFINITY = 0x7f800000u;
const F_NAN = 0x7fc00000u;
const F_ONE = 0x3f800000u;

// Zero at run time, which a compiler cannot know. A product that passes through it is a result of
// its own and cannot be fused with a sum.
var<private> f_opaque_zero: u32 = 0u;

fn f_is_nan(a: u32) -> bool {
    return (a & F_MAGNITUDE) > F_INFINITY;
}

fn f_is_finite(a: u32) -> bool {
    return (a & F_MAGNITUDE) < F_INFINITY;
}

// Bits that sort as unsigned integers the way the numbers sort; -0 just before +0.
fn f_sortable(a: u32) -> u32 {
    return a ^ select(F_SIGN, 0xffffffffu, (a & F_SIGN) != 0u);
}

// The number with these sortable bits.
fn f_from_sortable(a: u32) -> u32 {
    return a ^ select(0xffffffffu, F_SIGN, (a & F_SIGN) != 0u);
}

// a < b: false for NaN; zeros of either sign are equal.
fn f_less(a: u32, b: u32) -> bool {
    if (f_is_nan(a) || f_is_nan(b) || ((a | b) & F_MAGNITUDE) == 0u) {
        return false;
    }
    return f_sortable(a) < f_sortable(b);
}

// a <= b: false for NaN; zeros of either sign are equal.
fn f_at_most(a: u32, b: u32) -> bool {
    if (f_is_nan(a) || f_is_nan(b)) {
        return false;
    }
    return ((a | b) & F_MAGNITUDE) == 0u || f_sortable(a) <= f_sortable(b);
}

// Zero, or of an exponent from 2^-100 to 2^126: sums of such numbers neither overflow nor become
// subnormal, since they are multiples of 2^-123.
fn f_adds_plainly(a: u32) -> bool {
    let m = a & F_MAGNITUDE;
    return m == 0u || m - 0x0d800000u < 0x71000000u;
}

// Normal numbers whose product is normal too, by their exponents.
fn f_multiply_plainly(a: u32, b: u32) -> bool {
    let e = (a >> 23u) & 255u;
    let f = (b >> 23u) & 255u;
    return e - 1u < 254u && f - 1u < 254u && e + f - 128u <= 252u;
}

fn f_add(a: u32, b: u32) -> u32 {
    if (f_adds_plainly(a) && f_adds_plainly(b)) {
        return bitcast<u32>(bitcast<f32>(a) + bitcast<f32>(b)) ^ f_opaque_zero;
    }
    return f_add_soft(a, b);
}

fn f_sub(a: u32, b: u32) -> u32 {
    return f_add(a, b ^ F_SIGN);
}

fn f_mul(a: u32, b: u32) -> u32 {
    // Edges of flat boxes are zero, so this is common enough for a way of its own.
    if (((a & F_MAGNITUDE) == 0u && f_is_finite(b)) || ((b & F_MAGNITUDE) == 0u && f_is_finite(a))) {
        return (a ^ b) & F_SIGN;
    }
    if (f_multiply_plainly(a, b)) {
        return bitcast<u32>(bitcast<f32>(a) * bitcast<f32>(b)) ^ f_opaque_zero;
    }
    return f_mul_soft(a, b);
}

// Rounds and packs `s` * 2^(exponent - 153), where `s` has 24 bits and 3 more for rounding, the
// last of which says whether anything was lost below it. A smaller `s` needs exponent 1.
fn f_pack(sign: u32, exponent: i32, s: u32) -> u32 {
    var e = exponent;
    var m = s;
    if (e < 1) {
        let by = u32(1 - e);
        if (by > 27u) {
            m = select(0u, 1u, m != 0u);
        } else {
            m = (m >> by) | select(0u, 1u, (m & ((1u << by) - 1u)) != 0u);
        }
        e = 1;
    }
    let rest = m & 7u;
    m >>= 3u;
    m += select(0u, 1u, rest > 4u || (rest == 4u && (m & 1u) == 1u));
    if (e >= 255) {
        return sign | F_INFINITY;
    }
    // The leading bit of `m`, where it has one, adds 1 to the exponent field.
    return sign | min((u32(e - 1) << 23u) + m, F_INFINITY);
}

fn f_add_soft(a: u32, b: u32) -> u32 {
    let a_is_larger = (a & F_MAGNITUDE) >= (b & F_MAGNITUDE);
    let large = select(b, a, a_is_larger);
    let small = select(a, b, a_is_larger);
    let differ = ((large ^ small) & F_SIGN) != 0u;
    if (!f_is_finite(large)) {
        let cancel = differ && (small & F_MAGNITUDE) == F_INFINITY;
        return select(large, F_NAN, f_is_nan(large) || cancel);
    }
    let sign = large & F_SIGN;
    var e_large = (large >> 23u) & 255u;
    var e_small = (small >> 23u) & 255u;
    var m_large = ((large & 0x7fffffu) | select(0u, 0x800000u, e_large != 0u)) << 3u;
    var m_small = ((small & 0x7fffffu) | select(0u, 0x800000u, e_small != 0u)) << 3u;
    e_large = max(e_large, 1u);
    e_small = max(e_small, 1u);
    let by = e_large - e_small;
    if (by > 27u) {
        m_small = select(0u, 1u, m_small != 0u);
    } else {
        m_small = (m_small >> by) | select(0u, 1u, (m_small & ((1u << by) - 1u)) != 0u);
    }
    var e = i32(e_large);
    if (!differ) {
        var s = m_large + m_small;
        if (s >= 0x8000000u) {
            s = (s >> 1u) | (s & 1u);
            e += 1;
        }
        return f_pack(sign, e, s);
    }
    let s = m_large - m_small;
    if (s == 0u) {
        return 0u;
    }
    let shift = min(i32(countLeadingZeros(s)) - 5, e - 1);
    return f_pack(sign, e - shift, s << u32(shift));
}

// Significand of 24 bits and exponent field of a finite number other than zero.
struct FParts {
    m: u32,
    e: i32,
}

fn f_parts(a: u32) -> FParts {
    let e = i32((a >> 23u) & 255u);
    let m = a & 0x7fffffu;
    if (e != 0) {
        return FParts(m | 0x800000u, e);
    }
    let shift = countLeadingZeros(m) - 8u;
    return FParts(m << shift, 1 - i32(shift));
}

fn f_mul_soft(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & F_SIGN;
    let a_is_zero = (a & F_MAGNITUDE) == 0u;
    let b_is_zero = (b & F_MAGNITUDE) == 0u;
    if (!f_is_finite(a) || !f_is_finite(b)) {
        let no_number = f_is_nan(a) || f_is_nan(b) || a_is_zero || b_is_zero;
        return select(sign | F_INFINITY, F_NAN, no_number);
    }
    if (a_is_zero || b_is_zero) {
        return sign;
    }
    let x = f_parts(a);
    let y = f_parts(b);
    // The product of 48 bits, from halves of 12.
    let x_high = x.m >> 12u;
    let x_low = x.m & 0xfffu;
    let y_high = y.m >> 12u;
    let y_low = y.m & 0xfffu;
    let middle = x_high * y_low + x_low * y_high;
    let lower = x_low * y_low + ((middle & 0xfffu) << 12u);
    let high = x_high * y_high + (middle >> 12u) + (lower >> 24u);
    let low = lower & 0xffffffu;
    let e = x.e + y.e - 127;
    if (high >= 0x800000u) {
        let sticky = select(0u, 1u, (low & 0x1fffffu) != 0u);
        return f_pack(sign, e + 1, (high << 3u) | (low >> 21u) | sticky);
    }
    let sticky = select(0u, 1u, (low & 0xfffffu) != 0u);
    return f_pack(sign, e, (high << 4u) | (low >> 20u) | sticky);
}

// a / b, always in integers: division is not rounded correctly by devices.
fn f_div(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & F_SIGN;
    let a_is_zero = (a & F_MAGNITUDE) == 0u;
    let b_is_zero = (b & F_MAGNITUDE) == 0u;
    let a_is_infinite = (a & F_MAGNITUDE) == F_INFINITY;
    let b_is_infinite = (b & F_MAGNITUDE) == F_INFINITY;
    let no_number = f_is_nan(a) || f_is_nan(b);
    if (no_number || (a_is_zero && b_is_zero) || (a_is_infinite && b_is_infinite)) {
        return F_NAN;
    }
    if (a_is_infinite || b_is_zero) {
        return sign | F_INFINITY;
    }
    if (a_is_zero || b_is_infinite) {
        return sign;
    }
    let x = f_parts(a);
    let y = f_parts(b);
    var e = x.e - y.e + 127;
    var remainder = x.m;
    if (remainder < y.m) {
        remainder <<= 1u;
        e -= 1;
    }
    // 27 bits of the quotient, the first of which is 1.
    var quotient = 0u;
    for (var i = 0u; i < 27u; i++) {
        quotient <<= 1u;
        if (remainder >= y.m) {
            remainder -= y.m;
            quotient |= 1u;
        }
        remainder <<= 1u;
    }
    return f_pack(sign, e, quotient | select(0u, 1u, remainder != 0u));
}

// The number nearest to a count.
fn f_from_u32(n: u32) -> u32 {
    if (n == 0u) {
        return 0u;
    }
    // 32 significant bits, of which the last 5 go into one.
    let shift = countLeadingZeros(n);
    let m = n << shift;
    let s = (m >> 5u) | select(0u, 1u, (m & 31u) != 0u);
    return f_pack(0u, 158 - i32(shift), s);
}

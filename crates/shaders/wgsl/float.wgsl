// IEEE arithmetic that does not depend on what a device leaves open.
// Twins: std's `mul_add`, division, and `niwaki_core::float`.

/// The device's `fma` rounds once. Vulkan lets it round the product too; `probe.wgsl` finds out.
override FUSED: bool = true;

/// Operands that hardly ever occur are looked after: edge functions that rounding leaves without a sign, rays
/// and scenes of extreme coordinates. Without, such rays miss. Off only where instructions are counted
/// that rays take as a rule.
override RARE: bool = true;

const F32_MAX: f32 = 0x1.fffffep+127;
const MIN_NORMAL: f32 = 0x1p-126;
const EPSILON: f32 = 0x1p-23;

/// a·b − p without error, where p = fl(a·b) and nothing over- or underflows (Dekker 1971).
fn product_error(a: f32, b: f32, p: f32) -> f32 {
    if FUSED {
        return fma(a, b, -p);
    }
    let ca = 4097.0 * a;
    let cb = 4097.0 * b;
    let ah = ca - (ca - a);
    let bh = cb - (cb - b);
    let al = a - ah;
    let bl = b - bh;
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl;
}

/// a·b + c, rounded once; without a fused instruction to within 2⁻²⁴ of a rounding more.
fn madd(a: f32, b: f32, c: f32) -> f32 {
    if FUSED {
        return fma(a, b, c);
    }
    let p = a * b;
    let e = product_error(a, b, p);
    let s = p + c;
    let of_c = s - p;
    let r = (p - (s - of_c)) + (c - of_c);
    return s + (r + e);
}

/// a / b, correctly rounded in all but rare cases for moderate numbers: Vulkan allows 2.5 units in
/// the last place, which a residual corrects (Markstein 1990).
fn divide(a: f32, b: f32) -> f32 {
    let q = a / b;
    if FUSED {
        let r = fma(-q, b, a);
        let corrected = fma(r, 1.0 / b, q);
        if abs(r) <= F32_MAX && abs(corrected) <= F32_MAX && abs(q) >= MIN_NORMAL {
            return corrected;
        }
    }
    return q;
}

/// By the bits: compilers may take comparisons with NaN apart.
fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

fn all_finite(v: vec3f) -> bool {
    return is_finite(v.x) && is_finite(v.y) && is_finite(v.z);
}

fn max_element(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

/// 2 to the `exponent`, which lies from −126 to 127.
fn power_of_two(exponent: i32) -> f32 {
    return bitcast<f32>(u32(exponent + 127) << 23u);
}

/// The exponent e of |x| = m·2^e with 1 ≤ m < 2, of denormal numbers too; x is finite and not 0.
fn exponent_of(x: f32) -> i32 {
    let bits = bitcast<u32>(x) & 0x7fffffffu;
    if bits >= 0x800000u {
        return i32(bits >> 23u) - 127;
    }
    return i32(firstLeadingBit(bits)) - 149;
}

/// x·2^exponent. Denormal numbers are read by their bits, as devices may take them for 0.
fn scaled_by(x: f32, exponent: i32) -> f32 {
    let bits = bitcast<u32>(x);
    var y = x;
    var e = clamp(exponent, -400, 400);
    if (bits & 0x7f800000u) == 0u {
        y = f32(bits & 0x7fffffu);
        if (bits >> 31u) != 0u {
            y = -y;
        }
        e -= 149;
    }
    // Powers that exist, five of which reach from end to end. No loop: drivers that limit loops count it.
    let e1 = clamp(e, -126, 126);
    let e2 = clamp(e - e1, -126, 126);
    let e3 = clamp(e - e1 - e2, -126, 126);
    let e4 = clamp(e - e1 - e2 - e3, -126, 126);
    let e5 = clamp(e - e1 - e2 - e3 - e4, -126, 126);
    y *= power_of_two(e1);
    y *= power_of_two(e2);
    y *= power_of_two(e3);
    y *= power_of_two(e4);
    y *= power_of_two(e5);
    return y;
}

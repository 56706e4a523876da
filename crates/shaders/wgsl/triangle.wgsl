// The triangle tests. Twins: `triangle::intersect` and `watertight` of niwaki-trace, whose
// derivations hold here: operations and their order are the same.
//!import ray

/// What a triangle test keeps of a ray: origin and direction in the fast mode; in the watertight one
/// the origin and slopes with the axes in the order across, across, along.
struct Test {
    origin: vec3f,
    direction: vec3f,
    /// The axis of the longest component.
    along: u32,
}

fn turned(v: vec3f, along: u32) -> vec3f {
    if along == 0u {
        return v.yzx;
    }
    if along == 1u {
        return v.zxy;
    }
    return v;
}

fn test_of(ray: Ray) -> Test {
    var test: Test;
    test.origin = ray.origin;
    test.direction = ray.direction;
    test.along = 2u;
    if MODE == WATERTIGHT {
        let length = abs(ray.direction);
        if !(length.z >= length.x && length.z >= length.y) {
            test.along = select(1u, 0u, length.x >= length.y);
        }
        let d = turned(ray.direction, test.along);
        test.origin = turned(ray.origin, test.along);
        test.direction = vec3f(divide(d.x, d.z), divide(d.y, d.z), d.z);
    }
    return test;
}

/// The hit, or `hit` if the triangle of these three rows is not met from `t_min` on and before it, or at
/// the same distance with a smaller id.
fn intersect(test: Test, t_min: f32, a: vec4u, b: vec4u, c: vec4u, hit: Hit) -> Hit {
    let found = met(test, bitcast<vec3f>(a.xyz), bitcast<vec3f>(b.xyz), bitcast<vec3f>(c.xyz));
    let id = a.w;
    if found.prim_id != NO_PRIM && found.t >= t_min {
        if found.t < hit.t || (found.t == hit.t && id < hit.prim_id) {
            return Hit(found.t, found.u, found.v, id);
        }
    }
    return hit;
}

const MISS: Hit = Hit(0.0, 0.0, 0.0, NO_PRIM);

fn met(test: Test, a: vec3f, b: vec3f, c: vec3f) -> Hit {
    if MODE == FAST {
        return met_fast(test, a, b, c);
    }
    return met_watertight(test, a, b, c);
}

fn cross_fused(a: vec3f, b: vec3f) -> vec3f {
    return vec3f(
        madd(a.y, b.z, -(a.z * b.y)),
        madd(a.z, b.x, -(a.x * b.z)),
        madd(a.x, b.y, -(a.y * b.x)),
    );
}

fn dot_fused(a: vec3f, b: vec3f) -> f32 {
    return madd(a.x, b.x, madd(a.y, b.y, a.z * b.z));
}

fn flip(x: f32, sign: u32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ sign);
}

/// Möller and Trumbore 1997 in the form with the normal; rows are a corner and two edges.
fn met_fast(test: Test, v0: vec3f, e1: vec3f, e2: vec3f) -> Hit {
    let c = v0 - test.origin;
    let r = cross_fused(c, test.direction);
    let n = cross_fused(e1, e2);
    let det = dot_fused(n, test.direction);
    let size = abs(det);
    let sign = bitcast<u32>(det) & 0x80000000u;
    let u = flip(dot_fused(e2, r), sign);
    let v = flip(dot_fused(e1, r), sign ^ 0x80000000u);
    if u >= 0.0 && v >= 0.0 && u + v <= size && size > 0.0 {
        let t = divide(flip(dot_fused(n, c), sign), size);
        return Hit(t, divide(u, size), divide(v, size), 0u);
    }
    return MISS;
}

/// Edge functions of at least this magnitude have the right sign.
const CERTAIN: f32 = 0x1p-100;

/// The corner in the space of the ray.
fn projected(test: Test, corner: vec3f) -> vec3f {
    let v = turned(corner, test.along) - test.origin;
    return vec3f(
        madd(-test.direction.x, v.z, v.x),
        madd(-test.direction.y, v.z, v.y),
        v.z,
    );
}

/// x, but 0 for −0. By the bits: adding zero is what compilers leave out.
fn positive_zero(x: f32) -> f32 {
    return select(x, 0.0, (bitcast<u32>(x) << 1u) == 0u);
}

/// a·b − c·d by Kahan's algorithm.
fn det2(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let q = c * d;
    return madd(a, b, -q) - product_error(c, d, q);
}

/// Woop, Benthin and Wald 2013 with exact signs; rows are the corners.
fn met_watertight(test: Test, v0: vec3f, v1: vec3f, v2: vec3f) -> Hit {
    let a = projected(test, v0);
    let b = projected(test, v1);
    let c = projected(test, v2);
    let wa = det2(b.x, c.y, b.y, c.x);
    let wb = det2(c.x, a.y, c.y, a.x);
    let wc = det2(a.x, b.y, a.y, b.x);
    let least = min(wa, min(wb, wc));
    let most = max(wa, max(wb, wc));
    let is_overflow = !(is_finite(wa) && is_finite(wb) && is_finite(wc));
    if !(is_overflow || -CERTAIN <= least || most <= CERTAIN) {
        return MISS;
    }
    let w = abs(vec3f(wa, wb, wc));
    let det = w.x + (w.y + w.z);
    let depth = madd(w.x, a.z, madd(w.y, b.z, w.z * c.z));
    if !is_overflow && CERTAIN <= min(w.x, min(w.y, w.z)) && is_finite(depth) {
        let t = divide(depth, det * test.direction.z);
        return Hit(positive_zero(t), divide(w.y, det), divide(w.z, det), 0u);
    }
    if !RARE {
        return MISS;
    }
    return decided(a, b, c, test.direction.z);
}

/// The sign of a·b − c·d: rounding is monotone, so different rounded products are in the order of
/// the exact ones, and of equal ones the errors, which are exact, decide.
fn sign_det2(a: f32, b: f32, c: f32, d: f32) -> i32 {
    let p = a * b;
    let q = c * d;
    if p != q {
        return select(-1, 1, p > q);
    }
    let e = product_error(a, b, p);
    let f = product_error(c, d, q);
    if e != f {
        return select(-1, 1, e > f);
    }
    return 0;
}

/// The rare case of an edge function that is zero, or so near to it that products vanish, or that
/// overflows. Coordinates across are brought near 2⁴⁰ by a power of two, so that products are in the
/// range of f32 with all their bits unless both factors are 2⁹⁰ times smaller than the largest
/// coordinate; such products are taken for 0, on the edge, for all triangles alike.
fn decided(pa: vec3f, pb: vec3f, pc: vec3f, along: f32) -> Hit {
    if !(all_finite(pa) && all_finite(pb) && all_finite(pc)) {
        return MISS;
    }
    let across = max(
        max(max(abs(pa.x), abs(pa.y)), max(abs(pb.x), abs(pb.y))),
        max(abs(pc.x), abs(pc.y)),
    );
    let deep = max(abs(pa.z), max(abs(pb.z), abs(pc.z)));
    if !(across > 0.0) {
        return MISS;
    }
    let e = 40 - exponent_of(across);
    let a = vec2f(scaled_by(pa.x, e), scaled_by(pa.y, e));
    let b = vec2f(scaled_by(pb.x, e), scaled_by(pb.y, e));
    let c = vec2f(scaled_by(pc.x, e), scaled_by(pc.y, e));
    let sa = sign_det2(b.x, c.y, b.y, c.x);
    let sb = sign_det2(c.x, a.y, c.y, a.x);
    let sc = sign_det2(a.x, b.y, a.y, b.x);
    let is_inside = (sa >= 0 && sb >= 0 && sc >= 0) || (sa <= 0 && sb <= 0 && sc <= 0);
    if !is_inside || (sa == 0 && sb == 0 && sc == 0) {
        return MISS;
    }
    // Weights whose sign is 0 are 0 as well.
    let w = vec3f(
        select(abs(det2(b.x, c.y, b.y, c.x)), 0.0, sa == 0),
        select(abs(det2(c.x, a.y, c.y, a.x)), 0.0, sb == 0),
        select(abs(det2(a.x, b.y, a.y, b.x)), 0.0, sc == 0),
    );
    let det = w.x + (w.y + w.z);
    if !(det > 0.0) {
        return MISS;
    }
    // Depths to at most 1: sums of products stay in range.
    let f = select(0, -exponent_of(deep) - 1, deep > 0.0);
    let z = vec3f(scaled_by(pa.z, f), scaled_by(pb.z, f), scaled_by(pc.z, f));
    let depth = madd(w.x, z.x, madd(w.y, z.y, w.z * z.z));
    let t = scaled_by(divide(divide(depth, det), along), -f);
    return Hit(positive_zero(t), divide(w.y, det), divide(w.z, det), 0u);
}

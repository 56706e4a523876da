// Rays, and what a kernel needs of one, computed once.
// Twins: `RaySetup`, `Slabs`, `watertight::slabs` of niwaki-trace.
//!import float

const FAST: u32 = 0;
const WATERTIGHT: u32 = 1;

/// The triangle test: `FAST` or `WATERTIGHT`.
override MODE: u32 = 1;

const NO_PRIM: u32 = 0xffffffff;

/// What all rays of a dispatch have in common.
struct Scene {
    /// Bounds of the scaled scene.
    bounds_min: vec3f,
    /// The power of two by which coordinates were multiplied.
    factor: f32,
    bounds_max: vec3f,
    /// The largest scaled coordinate, by magnitude.
    magnitude: f32,
    /// Without nodes nothing is hit.
    nodes: u32,
    /// Rays of the dispatch.
    rays: u32,
    /// Nothing is scaled and no coordinate is above `MODERATE`.
    is_moderate: u32,
    /// Of nodes and of triangles, the binary logarithm of how many are in a binding.
    shifts: u32,
}

/// A ray in the scaled coordinates of the scene.
struct Ray {
    origin: vec3f,
    /// At least 0.
    t_min: f32,
    direction: vec3f,
    /// Finite.
    t_max: f32,
    /// Scaled distances are 2 to this times the ray's own.
    exponent: i32,
    /// Products of its coordinates with the reciprocal direction may overflow.
    is_extreme: bool,
    /// It may hit something.
    is_usable: bool,
}

struct Hit {
    t: f32,
    u: f32,
    v: f32,
    prim_id: u32,
}

/// See `MODERATE` in setup.rs.
const MODERATE: f32 = 1e10;

/// The ray of two rows of four words: origin and t_min, direction and t_max.
fn ray_setup(scene: Scene, first: vec4f, second: vec4f) -> Ray {
    var ray: Ray;
    ray.origin = first.xyz;
    ray.direction = second.xyz;
    ray.exponent = 0;
    ray.is_extreme = false;
    ray.t_min = select(0.0, first.w, first.w > 0.0);
    ray.t_max = select(F32_MAX, second.w + 0.0, second.w < F32_MAX);
    ray.is_usable = all_finite(first.xyz) && all_finite(second.xyz)
        && !is_nan(first.w) && !is_nan(second.w)
        && first.w <= second.w && ray.t_min <= ray.t_max;
    if !ray.is_usable {
        return ray;
    }
    let distance = abs(ray.origin);
    let length = abs(ray.direction);
    let is_moderate = scene.is_moderate != 0u
        && distance.x + distance.y + distance.z <= MODERATE
        && length.x + length.y + length.z <= 1e9
        && max_element(length) >= 1e-9;
    if is_moderate || !RARE {
        return ray;
    }
    return rescaled(scene, ray);
}

/// Brings the longest component of the direction into 1..2.
fn rescaled(scene: Scene, given: Ray) -> Ray {
    var ray = given;
    ray.is_extreme = true;
    // By the bits, which sort like the numbers, denormal ones too.
    let bits = bitcast<vec3u>(ray.direction) & vec3u(0x7fffffffu);
    let longest = max(bits.x, max(bits.y, bits.z));
    let scale = exponent_of(scene.factor);
    ray.origin = vec3f(
        scaled_by(ray.origin.x, scale),
        scaled_by(ray.origin.y, scale),
        scaled_by(ray.origin.z, scale),
    );
    ray.is_usable = longest != 0u && all_finite(ray.origin);
    if !ray.is_usable {
        return ray;
    }
    let exponent = exponent_of(bitcast<f32>(longest));
    ray.direction = vec3f(
        scaled_by(ray.direction.x, -exponent),
        scaled_by(ray.direction.y, -exponent),
        scaled_by(ray.direction.z, -exponent),
    );
    // origin·s + t'·(direction·2^−e) = s·(origin + t·direction) with t' = t·s·2^e.
    ray.exponent = scale + exponent;
    // Inward where that is denormal: no hit may come out of the ray's own range.
    let t_min = scaled_by(ray.t_min, ray.exponent);
    let t_max = scaled_by(ray.t_max, ray.exponent);
    ray.t_min = select(t_min, MIN_NORMAL, t_min < MIN_NORMAL && ray.t_min > 0.0);
    ray.t_max = min(select(t_max, 0.0, t_max < MIN_NORMAL), F32_MAX);
    ray.is_usable = ray.t_min <= ray.t_max;
    return ray;
}

/// A hit in the ray's own distance, as words; a miss if there is none.
fn finished(ray: Ray, hit: Hit) -> vec4u {
    if hit.prim_id == NO_PRIM {
        return vec4u(0x7f800000u, 0u, 0u, NO_PRIM);
    }
    var t = hit.t;
    if RARE && ray.exponent != 0 {
        t = scaled_by(t, -ray.exponent);
    }
    return vec4u(bitcast<u32>(t), bitcast<u32>(hit.u), bitcast<u32>(hit.v), hit.prim_id);
}

/// Reciprocal direction and offsets of a slab test by fused multiply-adds.
struct Slabs {
    /// Finite and never zero.
    inverse: vec3f,
    near_offset: vec3f,
    far_offset: vec3f,
    /// 1 where the direction is negative, by its sign bit.
    negative: vec3<bool>,
}

/// See `Slabs` in setup.rs and `slabs` in watertight.rs for the bounds. Where multiply-adds round
/// twice, the products add u·3.1M to them, for which there are four units of roundoff more.
fn slabs_of(scene: Scene, ray: Ray) -> Slabs {
    let from_origin = abs(ray.origin) + vec3f(scene.magnitude);
    var near: vec3f;
    var far: vec3f;
    if MODE == FAST {
        near = from_origin * (select(6.0, 4.0, FUSED) * EPSILON);
        far = near;
    } else {
        let ends = max(abs(scene.bounds_max - ray.origin), abs(scene.bounds_min - ray.origin));
        let reach = max_element(ends);
        let own = from_origin * (select(5.0, 3.0, FUSED) * EPSILON);
        near = own + vec3f(reach * (9.0 * EPSILON));
        far = own + vec3f(reach * (3.0 * EPSILON));
    }
    // A component 2⁻⁶⁰ of the longest moves the ray by less than the pad over the whole scene.
    let length = abs(ray.direction);
    let least = max_element(length) * 0x1p-60;
    let magnitude = max(length, vec3f(least));
    let size = vec3f(
        divide(1.0, magnitude.x),
        divide(1.0, magnitude.y),
        divide(1.0, magnitude.z),
    );
    var slabs: Slabs;
    slabs.negative = (bitcast<vec3u>(ray.direction) >> vec3u(31u)) != vec3u(0u);
    slabs.inverse = select(size, -size, slabs.negative);
    let offset = ray.origin * -slabs.inverse;
    slabs.near_offset = offset - near * size;
    slabs.far_offset = offset + far * size;
    if ray.is_extreme {
        slabs.near_offset = clamp(slabs.near_offset, vec3f(-F32_MAX), vec3f(F32_MAX));
        slabs.far_offset = clamp(slabs.far_offset, vec3f(-F32_MAX), vec3f(F32_MAX));
    }
    return slabs;
}

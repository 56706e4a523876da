//!import hybrid/shadows
// Rays in the cube map: marching through the depth of a face in its perspective space (Ganestam and
// Doggett 2014, section 3.4).

@group(1) @binding(5) var face_depth: texture_depth_2d_array;
@group(1) @binding(6) var face_surface: texture_2d_array<u32>;

// Samples as the paper prints it instead of many for grazing rays.
override AS_PRINTED: bool = false;
// Rays that pass behind a surface of the map go on; otherwise to the sky.
override GO_ON: bool = true;

const MAP_HIT = 0u;
const MAP_FAR = 1u;
const MAP_NEAR = 2u;
const MAP_BEHIND = 3u;
// 4 + k: through side k, which are x = w, x = -w, y = w, y = -w.
const MAP_SIDE = 4u;

// tan(45.1 degrees).
const FACE_TANGENT = 1.0034968;

struct MarchResult {
    outcome: u32,
    // Along the ray, where it left or hit.
    t: f32,
    // Of a hit: normalised device coordinates and distance from the centre along the face's axis.
    at: vec2f,
    depth: f32,
    pixel: vec2u,
    // The ray has passed behind some surface.
    behind: bool,
    samples: u32,
}

fn face_forward(face: u32) -> vec3f {
    let sign = 1.0 - 2.0 * f32(face & 1u);
    let axis = face >> 1u;
    return sign * vec3f(f32(axis == 0u), f32(axis == 1u), f32(axis == 2u));
}

fn face_up(face: u32) -> vec3f {
    let flip = 1.0 - 2.0 * f32(face & 1u);
    return select(vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, flip), (face >> 1u) == 1u);
}

// The neighbour of a face beyond side k; twin of niwaki_hybrid::Face::neighbour.
fn face_neighbour(face: u32, side: u32) -> u32 {
    let up = face_up(face);
    var d = cross(face_forward(face), up);
    if side >= 2u {
        d = up;
    }
    return cube_layer(select(d, -d, (side & 1u) == 1u));
}

// Distance along the face's axis of a depth of its map.
fn linear_depth(z: f32) -> f32 {
    let n = frame.half_size;
    let f = frame.far;
    return n * f / (f - z * (f - n));
}

fn pixel_at(ndc: vec2f) -> vec2u {
    let size = frame.face_resolution;
    let p = (ndc * vec2f(0.5, -0.5) + 0.5) * size;
    return vec2u(clamp(p, vec2f(0.0), vec2f(size - 1.0)));
}

// How far behind the front a surface still counts as met.
fn thickness_of(face: u32, pixel: vec2u) -> f32 {
    let id = textureLoad(face_surface, pixel, face, 0).z >> 16u;
    return materials[id].thickness;
}

// Follows the line origin + t direction, both in clip space of the face, from t_start to where it
// hits or leaves.
fn march(face: u32, origin: vec4f, direction: vec4f, t_start: f32) -> MarchResult {
    var r = MarchResult(MAP_FAR, t_start, vec2f(0.0), 0.0, vec2u(0u), false, 0u);
    // Clipped before the division by w: no point behind the centre is ever projected.
    var t0 = t_start;
    var t1 = INFINITE;
    for (var k = 0u; k < 6u; k++) {
        var a = origin.w;
        var b = direction.w;
        if k < 4u {
            let sign = select(-1.0, 1.0, (k & 1u) == 1u);
            a += sign * origin[k >> 1u];
            b += sign * direction[k >> 1u];
        } else if k == 4u {
            a = origin.z;
            b = direction.z;
        } else {
            a -= origin.z;
            b -= direction.z;
        }
        if b < 0.0 {
            let t = -a / b;
            if t < t1 {
                t1 = t;
                r.outcome = select(MAP_FAR, MAP_SIDE + k, k < 4u);
                if k == 4u {
                    r.outcome = MAP_NEAR;
                }
            }
        } else if b > 0.0 {
            t0 = max(t0, -a / b);
        }
    }
    t1 = max(t1, t_start);
    r.t = t1;
    if !(t0 < t1) || t1 >= INFINITE || (frame.face_mask & (1u << face)) == 0u {
        return r;
    }
    let p0 = origin + t0 * direction;
    let p1 = origin + t1 * direction;
    let i0 = 1.0 / p0.w;
    let i1 = 1.0 / p1.w;
    let a = p0.xyz * i0;
    let b = p1.xyz * i1;
    let delta = b - a;
    let pixels = 0.5 * frame.face_resolution * max(abs(delta.x), abs(delta.y));
    var along = abs(delta.z) / max(length(delta), 1e-30);
    if !AS_PRINTED {
        along = 1.0 - along;
    }
    let wanted = frame.n_min + along * (frame.n_max - frame.n_min);
    let n = u32(max(min(wanted, ceil(pixels) + 1.0), 1.0));
    let step = 1.0 / f32(n);
    // Depth along the axis at the beginning of the step.
    var w_before = p0.w;
    var in_front = true;
    for (var k = 0u; k < n; k++) {
        let s = (f32(k) + 0.5) * step;
        let s_end = (f32(k) + 1.0) * step;
        // Along a line 1/w changes linearly in device coordinates.
        let w_after = 1.0 / mix(i0, i1, s_end);
        let ndc = mix(a.xy, b.xy, s);
        let pixel = pixel_at(ndc);
        let z = textureLoad(face_depth, pixel, face, 0);
        r.samples++;
        if z < 1.0 {
            let front = linear_depth(z);
            let nearest = min(w_before, w_after);
            let farthest = max(w_before, w_after);
            if farthest >= front {
                if nearest <= front + thickness_of(face, pixel) {
                    return refine(face, r, a, b, i0, i1, t0, t1, s - 0.5 * step, s_end);
                }
                if in_front {
                    r.behind = true;
                    if !GO_ON {
                        r.outcome = MAP_BEHIND;
                        return r;
                    }
                }
            }
            in_front = nearest < front;
        } else {
            in_front = true;
        }
        w_before = w_after;
    }
    return r;
}

// Finds where between two samples the line first lies within a surface.
fn refine(
    face: u32,
    march: MarchResult,
    a: vec3f,
    b: vec3f,
    i0: f32,
    i1: f32,
    t0: f32,
    t1: f32,
    s_low: f32,
    s_high: f32,
) -> MarchResult {
    var r = march;
    var low = s_low;
    var high = s_high;
    var found = 0.5 * (s_low + s_high);
    for (var k = 0u; k < 6u; k++) {
        let s = 0.5 * (low + high);
        let pixel = pixel_at(mix(a.xy, b.xy, s));
        let z = textureLoad(face_depth, pixel, face, 0);
        let front = linear_depth(z);
        let w = 1.0 / mix(i0, i1, s);
        r.samples++;
        if z < 1.0 && w >= front {
            high = s;
            if w <= front + thickness_of(face, pixel) {
                found = s;
            }
        } else {
            low = s;
        }
    }
    r.outcome = MAP_HIT;
    r.at = mix(a.xy, b.xy, found);
    r.pixel = pixel_at(r.at);
    var z = textureLoad(face_depth, r.pixel, face, 0);
    if z >= 1.0 {
        // The refinement ran off the surface: take the sample that met it.
        r.at = mix(a.xy, b.xy, 0.5 * (s_low + s_high));
        r.pixel = pixel_at(r.at);
        z = textureLoad(face_depth, r.pixel, face, 0);
        found = 0.5 * (s_low + s_high);
    }
    r.depth = linear_depth(z);
    let i = mix(i0, i1, found);
    r.t = mix(t0 * i0, t1 * i1, found) / i;
    return r;
}

// The surface of a hit in the map.
fn map_surface(face: u32, hit: MarchResult, o: vec3f, d: vec3f) -> Surface {
    var s: Surface;
    let forward = face_forward(face);
    let up = face_up(face);
    let right = cross(forward, up);
    let slope = hit.at * FACE_TANGENT;
    s.point = frame.center + hit.depth * (forward + right * slope.x + up * slope.y);
    // What the pixel covers of the surface: its depth is known no better.
    s.clearance = 1.5 * hit.depth * 2.0 * FACE_TANGENT / frame.face_resolution;
    let pixel = textureLoad(face_surface, hit.pixel, face, 0);
    read_pixel(&s, pixel);
    let n = unpack_normal(pixel.x);
    orient(&s, n, n, d);
    s.opacity = 1.0;
    s.distance = distance(s.point, o);
    return s;
}

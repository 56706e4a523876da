//!import clearance
//!import hybrid/scene
//!import hybrid/shading
// Rays in the near region: the tree, triangles, and the surfaces that rays meet.

struct Node {
    low: vec3f,
    // First child (the second follows it), or first triangle of a leaf.
    first: u32,
    high: vec3f,
    // Triangles of a leaf; 0 for an inner node.
    count: u32,
}

@group(1) @binding(0) var<storage, read> nodes: array<Node>;
// Triangles in the order of the leaves.
@group(1) @binding(1) var<storage, read> leaf_triangles: array<u32>;

// Whether any surface has an alpha to be tested.
override ALPHA: bool = true;

const NO_TRIANGLE = 0xffffffffu;
const INFINITE = 3.0e38;
// One node a level: 30 bits of code and 32 of position are the deepest tree.
const TREE_STACK = 64u;

struct TreeHit {
    t: f32,
    u: f32,
    v: f32,
    triangle: u32,
    // What the surfaces on the way to a light let pass.
    share: f32,
}

// What the triangle test needs of a ray (Woop, Benthin and Wald 2013): the axis along which it is
// longest, and the shear that makes it that axis.
struct Shear {
    kx: u32,
    ky: u32,
    kz: u32,
    s: vec3f,
}

fn shear_of(d: vec3f) -> Shear {
    let a = abs(d);
    var kz = 0u;
    if a.y > a.x && a.y >= a.z {
        kz = 1u;
    } else if a.z > a.x {
        kz = 2u;
    }
    let kx = (kz + 1u) % 3u;
    let ky = (kz + 2u) % 3u;
    return Shear(kx, ky, kz, vec3f(d[kx], d[ky], 1.0) / d[kz]);
}

fn corner(triangle: u32, k: u32) -> vec3f {
    return vertices[indices[3u * triangle + k]].position;
}

// t, u and v of the hit of a triangle; t is negative for a miss.
fn meet_triangle(o: vec3f, shear: Shear, kz_direction: f32, triangle: u32) -> vec3f {
    let miss = vec3f(-1.0, 0.0, 0.0);
    let a = corner(triangle, 0u) - o;
    let b = corner(triangle, 1u) - o;
    let c = corner(triangle, 2u) - o;
    let a2 = vec2f(a[shear.kx], a[shear.ky]) - shear.s.xy * a[shear.kz];
    let b2 = vec2f(b[shear.kx], b[shear.ky]) - shear.s.xy * b[shear.kz];
    let c2 = vec2f(c[shear.kx], c[shear.ky]) - shear.s.xy * c[shear.kz];
    let u = c2.x * b2.y - c2.y * b2.x;
    let v = a2.x * c2.y - a2.y * c2.x;
    let w = b2.x * a2.y - b2.y * a2.x;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return miss;
    }
    let det = u + v + w;
    if det == 0.0 {
        return miss;
    }
    let t = (u * a[shear.kz] + v * b[shear.kz] + w * c[shear.kz]) / (det * kz_direction);
    // Written so that NaN misses.
    if !(t >= 0.0) {
        return miss;
    }
    return vec3f(t, v / det, w / det);
}

fn inverse_direction(d: vec3f) -> vec3f {
    // Large but finite, so that 0 · ∞ never arises.
    let tiny = abs(d) < vec3f(1e-30);
    return select(1.0 / d, select(vec3f(1e30), vec3f(-1e30), d < vec3f(0.0)), tiny);
}

// Where a ray enters and leaves a box; a miss if the first is larger.
fn slab(low: vec3f, high: vec3f, o: vec3f, inverse: vec3f) -> vec2f {
    let a = (low - o) * inverse;
    let b = (high - o) * inverse;
    let near = min(a, b);
    let far = max(a, b);
    // 2γ(3) makes up for the rounding of the products (Ize 2013).
    return vec2f(
        max(near.x, max(near.y, near.z)),
        min(far.x, min(far.y, far.z)) * 1.0000004,
    );
}

fn uv_at(triangle: u32, u: f32, v: f32) -> vec2f {
    let a = vertices[indices[3u * triangle]];
    let b = vertices[indices[3u * triangle + 1u]];
    let c = vertices[indices[3u * triangle + 2u]];
    return vec2f(a.u, a.v) * (1.0 - u - v) + vec2f(b.u, b.v) * u + vec2f(c.u, c.v) * v;
}

fn opacity_at(triangle: u32, u: f32, v: f32) -> f32 {
    let m = materials[material_ids[triangle]];
    if m.alpha_mode == 0u {
        return 1.0;
    }
    return opacity(m, uv_at(triangle, u, v));
}

fn meets(span: vec2f, t_min: f32, t_max: f32) -> bool {
    return max(span.x, t_min) <= min(span.y, t_max);
}

// The closest hit between t_min and t_max that alpha does not cut out, and that alone; or, on the
// way to a light, the share of it that surfaces leave.
fn traverse(o: vec3f, d: vec3f, t_min: f32, t_max: f32, to_light: bool) -> TreeHit {
    var hit = TreeHit(t_max, 0.0, 0.0, NO_TRIANGLE, 1.0);
    let inverse = inverse_direction(d);
    let shear = shear_of(d);
    let kz_direction = d[shear.kz];
    var stack: array<u32, TREE_STACK>;
    var size = 0u;
    var at = 0u;
    if !meets(slab(nodes[0].low, nodes[0].high, o, inverse), t_min, t_max) {
        return hit;
    }
    loop {
        let node = nodes[at];
        var next = NO_TRIANGLE;
        if node.count > 0u {
            for (var i = node.first; i < node.first + node.count; i++) {
                let triangle = leaf_triangles[i];
                let h = meet_triangle(o, shear, kz_direction, triangle);
                if !(h.x >= t_min && h.x <= hit.t) {
                    continue;
                }
                if to_light {
                    var rest = 0.0;
                    if ALPHA {
                        rest = hit.share * (1.0 - opacity_at(triangle, h.y, h.z));
                    }
                    hit.share = max(rest, 0.0);
                    if hit.share <= 0.0 {
                        return hit;
                    }
                    continue;
                }
                // Among equals the first triangle, so that the order of the tree does not matter.
                let nearer = h.x < hit.t || triangle < hit.triangle;
                if nearer && h.x < t_max && (!ALPHA || opacity_at(triangle, h.y, h.z) > 0.0) {
                    hit = TreeHit(h.x, h.y, h.z, triangle, 1.0);
                }
            }
        } else {
            let a = slab(nodes[node.first].low, nodes[node.first].high, o, inverse);
            let b = slab(nodes[node.first + 1u].low, nodes[node.first + 1u].high, o, inverse);
            let in_a = meets(a, t_min, hit.t);
            let in_b = meets(b, t_min, hit.t);
            if in_a && in_b {
                let second = u32(a.x <= b.x);
                next = node.first + 1u - second;
                if size < TREE_STACK {
                    stack[size] = node.first + second;
                    size++;
                }
            } else if in_a {
                next = node.first;
            } else if in_b {
                next = node.first + 1u;
            }
        }
        if next == NO_TRIANGLE {
            if size == 0u {
                break;
            }
            size--;
            next = stack[size];
        }
        at = next;
    }
    return hit;
}

fn closest(o: vec3f, d: vec3f, t_min: f32, t_max: f32) -> TreeHit {
    return traverse(o, d, t_min, t_max, false);
}

fn open_share(o: vec3f, d: vec3f, t_min: f32, t_max: f32) -> f32 {
    return traverse(o, d, t_min, t_max, true).share;
}

fn largest(v: vec3f) -> f32 {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// Place and normals of a point on a triangle seen along `d`, without its material: twin of
// niwaki_render's Surface::at.
fn locate(triangle: u32, u_: f32, v_: f32, d: vec3f) -> Surface {
    let ia = indices[3u * triangle];
    let ib = indices[3u * triangle + 1u];
    let ic = indices[3u * triangle + 2u];
    let a = vertices[ia].position;
    let b = vertices[ib].position;
    let c = vertices[ic].position;
    let excess = max(max(u_, 0.0) + max(v_, 0.0), 1.0);
    let u = max(u_, 0.0) / excess;
    let v = max(v_, 0.0) / excess;
    var s: Surface;
    s.point = a + (b - a) * u + (c - a) * v;
    let reach = max(distance(s.point, a), max(distance(s.point, b), distance(s.point, c)));
    let size = max(largest(a), max(largest(b), largest(c)));
    s.clearance = CLEARANCE * reach + POINT_ERROR * size;
    var outward = cross(b - a, c - a);
    let scale = largest(outward);
    outward = select(-d, normalize(outward / scale), scale > 0.0);
    let n = vertices[ia].normal * (1.0 - u - v) + vertices[ib].normal * u + vertices[ic].normal * v;
    let smooth_ = select(outward, normalize(n), dot(n, n) > 0.0);
    orient(&s, outward, smooth_, d);
    s.material = material_ids[triangle];
    return s;
}

// Turns normals to the viewer. `smooth_` says which side is outside.
fn orient(s: ptr<function, Surface>, outward_: vec3f, smooth_: vec3f, d: vec3f) {
    let outward = select(outward_, -outward_, dot(smooth_, outward_) < 0.0);
    let is_front = dot(outward, d) <= 0.0;
    let side = select(-1.0, 1.0, is_front);
    (*s).front = select(0.0, 1.0, is_front);
    (*s).geometric = outward * side;
    let shading = smooth_ * side;
    (*s).normal = select(outward * side, shading, -dot(shading, d) > 1e-4);
}

// The surface of a hit in the tree.
fn tree_surface(hit: TreeHit, d: vec3f) -> Surface {
    var s = locate(hit.triangle, hit.u, hit.v, d);
    let m = materials[s.material];
    let uv = uv_at(hit.triangle, hit.u, hit.v);
    let base = sample_texture(m.base_texture, uv);
    let surface = sample_texture(m.surface_texture, uv);
    s.base = clamp(m.base_color * base.xyz, vec3f(0.0), vec3f(1.0));
    s.metallic = clamp(m.metallic * surface.z, 0.0, 1.0);
    s.roughness = clamp(m.roughness * surface.y, 0.0, 1.0);
    s.emission = max(m.emission * sample_texture(m.emission_texture, uv).xyz, vec3f(0.0));
    s.opacity = 1.0;
    if ALPHA {
        s.opacity = opacity(m, uv);
    }
    s.distance = hit.t;
    return s;
}

// What a pixel of a G-buffer says of a surface.
fn read_pixel(s: ptr<function, Surface>, pixel: vec4u) {
    (*s).base = unpack_color(pixel.y);
    (*s).metallic = f32((pixel.z >> 10u) & 63u) / 63.0;
    (*s).material = pixel.z >> 16u;
    (*s).roughness = f32(pixel.z & 1023u) / 1023.0;
    (*s).emission = unpack_radiance(pixel.w);
}

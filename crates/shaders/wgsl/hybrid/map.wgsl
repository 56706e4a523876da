//!import hybrid/depth
//!import hybrid/light
// The cube map: its faces, its layers, and what rays find there.

@group(1) @binding(5) var face_depth: texture_depth_2d_array;
@group(1) @binding(6) var face_surface: texture_2d_array<u32>;

// The cube map is used; otherwise what leaves the near region is sky.
override USE_MAP: bool = true;
// Rays that pass behind a surface of the map go on; otherwise to the sky.
override GO_ON: bool = true;
// Layers of the map; layer k of a face is array layer 6 k + face.
override LAYERS: u32 = 1u;
// Rays look through surfaces of the map that light passes, glass and what is blended, to what the
// second layer has behind them.
override LOOK_THROUGH: bool = true;
// The second layer has nothing else.
override THROUGH_ONLY: bool = false;

// The ray at hand has met such a surface: others of them do not hold it up.
var<private> looking_through: bool;

const MAP_HIT = 0u;
const MAP_FAR = 1u;
const MAP_NEAR = 2u;
const MAP_BEHIND = 3u;
// 4 + k: through side k, which are x = w, x = -w, y = w, y = -w.
const MAP_SIDE = 4u;

struct MarchResult {
    outcome: u32,
    // Along the ray, where it left or hit.
    t: f32,
    // Of a hit: normalised device coordinates and distance from the centre along the face's axis.
    at: vec2f,
    depth: f32,
    pixel: vec2u,
    layer: u32,
    // The ray has passed behind some surface, and behind what the next layer knows there.
    behind: bool,
    // Pixels of the map and cells of its pyramid that were looked at.
    samples: u32,
    cells: u32,
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

fn pixel_at(ndc: vec2f) -> vec2u {
    let size = frame.face_resolution;
    let p = (ndc * vec2f(0.5, -0.5) + 0.5) * size;
    return vec2u(clamp(p, vec2f(0.0), vec2f(size - 1.0)));
}

// How far behind the front a surface still counts as met.
fn thickness_of(array_layer: u32, pixel: vec2u) -> f32 {
    let id = textureLoad(face_surface, pixel, array_layer, 0).z >> 16u;
    return materials[id].thickness;
}

// What rays may do at a surface of the first layer: SEE_THROUGH, CUT_OUT.
fn clear_flags(face: u32, pixel: vec2u) -> u32 {
    if !LOOK_THROUGH {
        return 0u;
    }
    let id = textureLoad(face_surface, pixel, face, 0).z >> 16u;
    return materials[id].flags & (SEE_THROUGH | CUT_OUT);
}

// A line in a face between two points in device coordinates, and 1/w at both.
struct Line {
    face: u32,
    a: vec2f,
    b: vec2f,
    i0: f32,
    i1: f32,
    // The ray's parameter over w at both.
    t0: f32,
    t1: f32,
}

// A point of a line beside the map.
struct Look {
    pixel: vec2u,
    // How far it lies behind the map's surface along the face's axis.
    gap: f32,
    // Its own distance along that axis.
    w: f32,
    // What a pixel covers there.
    pixel_size: f32,
}

fn look(line: Line, s: f32, layer: u32) -> Look {
    let pixel = pixel_at(mix(line.a, line.b, s));
    let w = line_depth(line, s);
    let z = textureLoad(face_depth, pixel, line.face + 6u * layer, 0);
    let gap = select(w - linear_depth(z), -INFINITE, z >= 1.0);
    return Look(pixel, gap, w, w * pixel_slope());
}

// Along a line 1/w changes linearly in device coordinates.
fn line_depth(line: Line, s: f32) -> f32 {
    return 1.0 / mix(line.i0, line.i1, s);
}

// The end of a march at a surface that the line meets at `s`.
fn met(result: MarchResult, line: Line, s: f32, found: Look) -> MarchResult {
    var r = result;
    r.outcome = MAP_HIT;
    r.at = mix(line.a, line.b, s);
    r.pixel = found.pixel;
    r.depth = found.w - found.gap;
    r.t = mix(line.t0, line.t1, s) * found.w;
    return r;
}

// True if a ray that lies just behind a pixel's surface is on its way out to the front: it started
// there, and the depth of a whole pixel is known at one point of it only.
fn leaves(face: u32, layer: u32, hit: Look, d: vec3f) -> bool {
    let ndc = (vec2f(hit.pixel) + 0.5) / (0.5 * frame.face_resolution) - 1.0;
    let forward = face_forward(face);
    let up = face_up(face);
    let slope = vec2f(ndc.x, -ndc.y) * FACE_TANGENT;
    let toward = normalize(forward + cross(forward, up) * slope.x + up * slope.y);
    var n = unpack_normal(textureLoad(face_surface, hit.pixel, face + 6u * layer, 0).x);
    let cosine = dot(n, toward);
    n = select(n, -n, cosine > 0.0);
    return dot(d, n) >= 0.0 && hit.gap <= 4.0 * hit.pixel_size / max(abs(cosine), 0.01);
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
    s.clearance = 1.5 * hit.depth * pixel_slope();
    let pixel = textureLoad(face_surface, hit.pixel, face + 6u * hit.layer, 0);
    read_pixel(&s, pixel);
    let n = unpack_normal(pixel.x);
    orient(&s, n, n, d);
    s.opacity = 1.0;
    if ALPHA && materials[s.material].alpha_mode == ALPHA_BLEND {
        s.roughness = f32(pixel.z & 31u) / 31.0;
        s.metallic = f32((pixel.z >> 5u) & 7u) / 7.0;
        if LOOK_THROUGH {
            s.opacity = f32((pixel.z >> 8u) & 255u) / 255.0;
        }
    }
    s.distance = distance(s.point, o);
    return s;
}

// How far off its surface a ray starts: beyond the near region by what a pixel of the map covers.
fn start_clearance(s: Surface) -> f32 {
    if !USE_MAP || HOLDS_ALL || in_cube(s.point, frame.traced) {
        return s.clearance;
    }
    return max(s.clearance, 1.5 * largest(s.point - frame.center) * pixel_slope());
}

//!import hybrid/visibility
//!import random
// Ambient occlusion by rays in the tree of the near region: twins of niwaki_render's rng, sampling and
// occlusion, so that with the whole scene in the region the share is that of the CPU.

// Surfaces in the near region look for what holds ambient light back.
override OCCLUSION: bool = true;

// The pixel, and how many directions it has drawn: the renderer's CPU twin draws the same.
var<private> occlusion_pixel: u32;
var<private> occlusion_first: u32;
var<private> occlusion_count: u32;

// What niwaki_render's Sampler makes of the seed 0: the first word of pcg4d(0, 0, 0, 0).
fn plain_seed() -> u32 {
    return pcg4d(vec4u(0u)).x;
}

// Around a unit normal (Duff et al. 2017); the columns are tangent, bitangent and normal.
fn basis(n: vec3f) -> mat3x3f {
    let side = select(-1.0, 1.0, (bitcast<u32>(n.z) & 0x80000000u) == 0u);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    return mat3x3f(
        vec3f(1.0 + side * n.x * n.x * a, side * b, -side * n.x),
        vec3f(b, side + n.y * n.y * a, -n.y),
        n,
    );
}

fn cosine_hemisphere(u: vec2f) -> vec3f {
    let radius = sqrt(u.x);
    let angle = 2.0 * PI * u.y;
    return vec3f(radius * cos(angle), radius * sin(angle), sqrt(1.0 - u.x));
}

// The share of ambient light that arrives at a surface. Beyond the near region nothing is known: rays
// end at its border, and towards it, within their length, what they say fades out, so that no edge
// shows where the region ends.
fn open_surroundings(s: Surface) -> f32 {
    let first = occlusion_first;
    occlusion_first += frame.occlusion_rays;
    var trust = 1.0;
    if !HOLDS_ALL {
        let room = frame.half_size - largest(s.point - frame.center);
        trust = clamp(room / min(frame.occlusion_radius, frame.half_size), 0.0, 1.0);
        if trust <= 0.0 {
            return 1.0;
        }
    }
    let around = basis(s.normal);
    let origin = s.point + s.geometric * s.clearance;
    let seed = plain_seed();
    var open = 0.0;
    for (var k = 0u; k < frame.occlusion_rays; k++) {
        let words = pcg4d(vec4u(occlusion_pixel, first + k, 0u, seed));
        let u = vec2f(words.xy >> vec2u(8u)) / 16777216.0;
        let direction = normalize(around * cosine_hemisphere(u));
        // What the shading normal shows but the surface itself hides is closed.
        if dot(direction, s.geometric) <= 0.0 {
            continue;
        }
        occlusion_count++;
        var end = frame.occlusion_radius;
        if !HOLDS_ALL {
            end = min(end, cube_span(origin, direction, frame.traced).y);
        }
        open += open_share(origin, direction, 0.0, end);
    }
    return mix(1.0, open / f32(frame.occlusion_rays), trust);
}

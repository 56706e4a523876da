//!import raster/frame
// The light of a spotlight, added where the volume that it lights may be, with its shadows.

@group(1) @binding(0) var surfaces: texture_2d<u32>;
@group(1) @binding(1) var depths: texture_depth_2d;

// Write the share of the light that arrives instead of what it lights.
override SHOW_SHARE: bool = false;

// Sides of the cone.
const SIDES = 24u;

struct Volume {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) light: u32,
}

struct View {
    // Relative to the eye.
    matrix: mat4x4f,
    eye: vec3f,
    pad: f32,
}

@group(3) @binding(0) var<uniform> view: View;

// A point of the cone's rim; the cone of SIDES sides encloses the round one.
fn rim(light: SpotLight, k: u32) -> vec3f {
    let d = light.direction;
    let helper = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(d.x) > 0.7);
    let right = normalize(cross(d, helper));
    let up = cross(right, d);
    let angle = 6.2831853 * f32(k % SIDES) / f32(SIDES);
    let out = (right * cos(angle) + up * sin(angle)) * light.tangent;
    return light.position + (d + out) * light.range;
}

// Two triangles a side: one from the tip to the rim, one of the base.
@vertex
fn cone_main(
    @builtin(vertex_index) i: u32,
    @builtin(instance_index) number: u32,
) -> Volume {
    let light = lights[number];
    let side = i / 6u;
    var p: vec3f;
    switch i % 6u {
        case 0u: { p = light.position; }
        case 1u, 5u: { p = rim(light, side); }
        case 2u, 4u: { p = rim(light, side + 1u); }
        default: { p = light.position + light.direction * light.range; }
    }
    return Volume(view.matrix * vec4f(p - view.eye, 1.0), number);
}

struct Point {
    surface: Surface,
    lit: Illumination,
    // It may receive light.
    reached: bool,
}

fn point_of(at: vec4f, light: SpotLight) -> Point {
    let pixel = vec2u(at.xy);
    let depth = textureLoad(depths, pixel, 0);
    if depth <= 0.0 {
        return Point();
    }
    let s = unpack_surface(textureLoad(surfaces, pixel, 0), at.xy, depth);
    let lit = illuminate(light, s.point);
    return Point(s, lit, any(lit.irradiance > vec3f(0.0)));
}

fn output(p: Point, share: f32) -> vec4f {
    if SHOW_SHARE {
        return vec4f(share, 1.0, 0.0, 0.0);
    }
    return vec4f(lit_radiance(p.surface, p.lit) * share, 0.0);
}

// Without shadows, or with those that a stencil has left out.
@fragment
fn light_main(in: Volume) -> @location(0) vec4f {
    let p = point_of(in.clip, lights[in.light]);
    if !p.reached {
        discard;
    }
    return output(p, 1.0);
}

//!import hybrid/primitive_index
//!import hybrid/depth
// Rasterising what a camera or a face of the cube map sees (Ganestam and Doggett 2014, 3.1, 3.2).
// A pixel of the G-buffer: x normal, y base colour, z material, metallic and roughness, w emission.

struct View {
    // Relative to the eye.
    matrix: mat4x4f,
    eye: vec3f,
    pad: f32,
}

@group(1) @binding(0) var<uniform> view: View;

// Whether any surface has an alpha to be tested.
override ALPHA: bool = true;

struct Varying {
    // The same in all passes, so that a surface of the first layer is not behind itself.
    @invariant @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    // The first triangle of the draw.
    @location(2) @interpolate(flat) first: u32,
}

@vertex
fn vertex_main(
    @location(0) position: vec3f,
    @location(1) u: f32,
    @location(2) normal: vec3f,
    @location(3) v: f32,
    @builtin(instance_index) first: u32,
) -> Varying {
    return Varying(view.matrix * vec4f(position - view.eye, 1.0), normal, vec2f(u, v), first);
}

fn corner(triangle: u32, k: u32) -> vec3f {
    return vertices[indices[3u * triangle + k]].position;
}

// Normal by winding; zero for a degenerate triangle.
fn winding_normal(triangle: u32) -> vec3f {
    let a = corner(triangle, 0u);
    let n = cross(corner(triangle, 1u) - a, corner(triangle, 2u) - a);
    let largest = max(abs(n.x), max(abs(n.y), abs(n.z)));
    if largest == 0.0 {
        return vec3f(0.0);
    }
    return normalize(n / largest);
}

// In faces, what is blended has its opacity in eight bits, metallic in three and roughness in five:
// nothing else says there where on its texture it was met.
fn pixel(in: Varying, triangle: u32, is_face: bool) -> vec4u {
    let id = material_ids[triangle];
    let m = materials[id];
    var share = 1.0;
    if ALPHA && m.alpha_mode != 0u {
        share = opacity(m, in.uv);
        if share <= 0.0 {
            discard;
        }
    }
    var n = in.normal;
    if dot(n, n) > 0.0 {
        n = normalize(n);
    } else {
        n = winding_normal(triangle);
        if dot(n, n) == 0.0 {
            n = vec3f(0.0, 1.0, 0.0);
        }
    }
    let base = sample_texture(m.base_texture, in.uv).xyz;
    let surface = sample_texture(m.surface_texture, in.uv);
    let color = clamp(m.base_color * base, vec3f(0.0), vec3f(1.0));
    let metallic = clamp(m.metallic * surface.z, 0.0, 1.0);
    let roughness = clamp(m.roughness * surface.y, 0.0, 1.0);
    let glow = max(m.emission * sample_texture(m.emission_texture, in.uv).xyz, vec3f(0.0));
    var made = (u32(metallic * 63.0 + 0.5) << 10u) | u32(roughness * 1023.0 + 0.5);
    if ALPHA && is_face && m.alpha_mode == ALPHA_BLEND {
        made = (u32(share * 255.0 + 0.5) << 8u) | (u32(metallic * 7.0 + 0.5) << 5u)
            | u32(roughness * 31.0 + 0.5);
    }
    return vec4u(
        pack_normal(n),
        pack_color(color),
        (id << 16u) | made,
        pack_radiance(glow),
    );
}

struct Primary {
    @location(0) surface: vec4u,
    // The number of the triangle, from 1; 0 is background.
    @location(1) triangle: u32,
}

@fragment
fn primary_main(in: Varying, @builtin(primitive_index) primitive: u32) -> Primary {
    let triangle = in.first + primitive;
    return Primary(pixel(in, triangle, false), triangle + 1u);
}

@fragment
fn face_main(in: Varying, @builtin(primitive_index) primitive: u32) -> @location(0) vec4u {
    return pixel(in, in.first + primitive, true);
}

// The first layer of the face, while the second is drawn.
@group(2) @binding(0) var first_depth: texture_depth_2d;
@group(2) @binding(1) var first_surface: texture_2d<u32>;

// The second layer holds what lies behind surfaces with holes or that light passes, and nothing else.
override THROUGH_ONLY: bool = false;

// What comes next behind the first layer, its thickness included: what lies within that no ray
// reaches. A bit more, so that surfaces that touch the first do not fill the layer. Behind what rays
// look through it is the next that they do not look through.
@fragment
fn second_main(in: Varying, @builtin(primitive_index) primitive: u32) -> @location(0) vec4u {
    let at = vec2u(in.clip.xy);
    let id = textureLoad(first_surface, at, 0).z >> 16u;
    let back = surface_depth(textureLoad(first_depth, at, 0)) + materials[id].thickness;
    if !(less_doubt(linear_depth(in.clip.z)) > back) {
        discard;
    }
    let first_flags = materials[id].flags;
    if THROUGH_ONLY && (first_flags & (SEE_THROUGH | CUT_OUT)) == 0u {
        discard;
    }
    let triangle = in.first + primitive;
    if (first_flags & materials[material_ids[triangle]].flags & SEE_THROUGH) != 0u {
        discard;
    }
    return pixel(in, triangle, true);
}

// Depth alone, for shadow maps.
@fragment
fn shadow_main(in: Varying, @builtin(primitive_index) primitive: u32) {
    if ALPHA {
        let m = materials[material_ids[in.first + primitive]];
        if m.alpha_mode != 0u && opacity(m, in.uv) <= 0.0 {
            discard;
        }
    }
}

//!import frame/gbuffer
//!import hybrid/depth
// Rasterising what a face of the cube map sees (Ganestam and Doggett 2014, 3.2), besides what
// `frame/gbuffer` draws.

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

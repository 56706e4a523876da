//!import frame/gbuffer
// Filling a variance shadow map: depth and its square, then the levels of both.

struct MomentParams {
    // Distance of the near plane over the light's range.
    near: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

@group(2) @binding(0) var<uniform> params: MomentParams;

// The distance along the light's axis in units of its range, and its square.
@fragment
fn moment_main(in: Varying) -> @location(0) vec4f {
    let d = min(params.near / in.clip.z, 1.0);
    return vec4f(d, d * d, 0.0, 0.0);
}

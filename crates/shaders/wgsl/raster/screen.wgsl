//!import raster/frame
// Passes over all pixels: what there is without lights, and the picture for the display.

@group(1) @binding(0) var surfaces: texture_2d<u32>;
@group(1) @binding(1) var depths: texture_depth_2d;
// The sum of all light.
@group(3) @binding(0) var sum: texture_2d<f32>;

// A triangle that covers the screen, at depth 0: infinitely far.
@vertex
fn screen_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// Where nothing was drawn, the environment, for the display.
@fragment
fn sky_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return display(environment(through(at.xy)));
}

// The environment, or what surfaces give off and reflect of the ambient light.
@fragment
fn base_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2u(at.xy);
    let depth = textureLoad(depths, pixel, 0);
    if depth <= 0.0 {
        return vec4f(environment(through(at.xy)), 1.0);
    }
    return vec4f(base_radiance(unpack_surface(textureLoad(surfaces, pixel, 0), at.xy, depth)), 1.0);
}

@fragment
fn resolve_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return display(textureLoad(sum, vec2u(at.xy), 0).xyz);
}

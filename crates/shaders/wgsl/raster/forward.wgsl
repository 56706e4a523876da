//!import frame/gbuffer
//!import raster/frame
// Forward shading: all lights in a loop where a triangle is drawn.

@fragment
fn forward_main(
    in: Varying,
    @builtin(primitive_index) primitive: u32,
    @builtin(front_facing) front: bool,
) -> @location(0) vec4f {
    // Through the 16 bytes that a G-buffer would hold, so that forward and deferred shading differ
    // in when they shade and not in what.
    let bits = facing_pixel(in, in.first + primitive, select(-1.0, 1.0, front), false);
    let s = unpack_surface(bits, in.clip.xy, in.clip.z);
    var sum = base_radiance(s);
    for (var i = 0u; i < frame.light_count; i++) {
        sum += lit_radiance(s, illuminate(lights[i], s.point));
    }
    return display(sum);
}

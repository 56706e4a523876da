// One level of two filtered hierarchies from the one below: means over the area of each pixel, also
// where sides are odd.

@group(0) @binding(0) var below: texture_2d<f32>;
// What is written, to know its size.
struct Level {
    size: vec2u,
    pad: vec2u,
}
@group(0) @binding(1) var<uniform> level: Level;

@vertex
fn level_main(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

// The share of pixel `i` below that lies within a pixel that spans `from` to `to`.
fn overlap(i: u32, from_: f32, to: f32) -> f32 {
    return max(min(f32(i) + 1.0, to) - max(f32(i), from_), 0.0);
}

@fragment
fn reduce_main(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let size = textureDimensions(below);
    let ratio = vec2f(size) / vec2f(level.size);
    let start = floor(at.xy) * ratio;
    let end = start + ratio;
    var sum = vec2f(0.0);
    var total = 0.0;
    for (var y = u32(start.y); y < min(size.y, u32(ceil(end.y))); y++) {
        for (var x = u32(start.x); x < min(size.x, u32(ceil(end.x))); x++) {
            let w = overlap(x, start.x, end.x) * overlap(y, start.y, end.y);
            sum += textureLoad(below, vec2u(x, y), 0).xy * w;
            total += w;
        }
    }
    return vec4f(sum / max(total, 1e-9), 0.0, 0.0);
}

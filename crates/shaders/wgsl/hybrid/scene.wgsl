//!import frame/surfaces
// What all passes of the hybrid renderer know of a frame.
// The Rust twin is in crates/hybrid/src/layout.rs.

struct Frame {
    // Camera: primary rays go through corner + (x + 1/2) step_x + (y + 1/2) step_y.
    eye: vec3f,
    width: u32,
    corner: vec3f,
    height: u32,
    step_x: vec3f,
    max_depth: u32,
    step_y: vec3f,
    cutoff: f32,
    // The traced region and the cube map around it.
    center: vec3f,
    half_size: f32,
    traced: f32,
    far: f32,
    n_min: f32,
    n_max: f32,
    // Radiance from outside; all three equal for a constant environment.
    zenith: vec3f,
    face_resolution: f32,
    horizon: vec3f,
    face_mask: u32,
    ground: vec3f,
    light_count: u32,
    ambient_up: vec3f,
    mirror_roughness: f32,
    ambient_down: vec3f,
    max_rays: u32,
    // The highest level of the depth pyramid that marches read; 0 without one.
    top_level: u32,
    // Rays from each surface that look for what holds ambient light back, and how far they look.
    occlusion_rays: u32,
    occlusion_radius: f32,
    pad: u32,
    // Relative to the centre: world to clip space of each face.
    faces: array<mat4x4f, 6>,
    // From clip space of face i to that of its neighbour beyond side k: 4 i + k.
    hops: array<mat4x4f, 24>,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Light from outside that arrives from a unit direction.
fn environment(direction: vec3f) -> vec3f {
    let rest = 1.0 - abs(direction.y);
    let t = 1.0 - rest * rest;
    return mix(frame.horizon, select(frame.ground, frame.zenith, direction.y >= 0.0), t);
}

fn primary_direction(x: u32, y: u32) -> vec3f {
    let d = frame.corner + frame.step_x * (f32(x) + 0.5) + frame.step_y * (f32(y) + 0.5);
    return normalize(d);
}

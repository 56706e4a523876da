//!import frame/shading
// What all passes of the raster case studies know: the frame, its lights, and what light does at a
// surface. The Rust twins of the structures are in crates/raster/src/layout.rs.

struct RasterFrame {
    // Camera: primary rays go through corner + (x + 1/2) step_x + (y + 1/2) step_y, all of them at
    // depth 1.
    eye: vec3f,
    width: u32,
    corner: vec3f,
    height: u32,
    step_x: vec3f,
    // Distance of the near plane.
    near: f32,
    step_y: vec3f,
    light_count: u32,
    // Radiance from outside; all three equal for a constant environment.
    zenith: vec3f,
    exposure: f32,
    horizon: vec3f,
    // Pixels of a shadow map's side.
    map_side: f32,
    ground: vec3f,
    // How far a point is moved before it is compared with a map, in pixels of the map where the
    // point is: towards the light, as far again for each unit of the tangent of the light's angle
    // to the normal, and along the normal.
    bias_constant: f32,
    ambient_up: vec3f,
    bias_slope: f32,
    ambient_down: vec3f,
    bias_normal: f32,
    // Taps of the percentage-closer filter along a side; 0 compares with the nearest pixel alone.
    taps: u32,
    // The least width of a variance map's filter, in pixels of its finest level.
    least_filter: f32,
    // The least standard deviation of depth, in pixels of the map where the point is.
    least_deviation: f32,
    // Shares of light up to this one count as none.
    bleeding: f32,
    // The greatest width of that filter, whatever a pixel of the image covers.
    most_filter: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

struct SpotLight {
    position: vec3f,
    range: f32,
    direction: vec3f,
    cos_inner: f32,
    intensity: vec3f,
    cos_outer: f32,
    // Relative to the position: world to clip space of its map, depth 1 near and 0 infinitely far.
    matrix: mat4x4f,
    // Width of the map at distance 1 along the axis.
    width: f32,
    // Distance of the map's near plane.
    near: f32,
    // Tangent of half the angle of the cone that encloses what it lights.
    tangent: f32,
    pad: f32,
}

@group(0) @binding(0) var<uniform> frame: RasterFrame;
@group(2) @binding(0) var<storage, read> lights: array<SpotLight>;

// The direction through a pixel's centre, of depth 1.
fn through(pixel: vec2f) -> vec3f {
    return frame.corner + frame.step_x * pixel.x + frame.step_y * pixel.y;
}

// What a pixel shows at this depth of the depth buffer, relative to the eye; not for depth 0.
fn seen_from_eye(pixel: vec2f, depth: f32) -> vec3f {
    return through(pixel) * (frame.near / depth);
}

// The surface that a pixel of a G-buffer holds; its point and all that depends on it.
fn unpack_surface(bits: vec4u, pixel: vec2f, depth: f32) -> Surface {
    let along = seen_from_eye(pixel, depth);
    let to_viewer = -normalize(along);
    // Interpolated normals may look away from the viewer near outlines; shading needs them on the
    // viewer's side.
    var n = unpack_normal(bits.x);
    let cosine = dot(n, to_viewer);
    if cosine < 0.01 {
        n = normalize(n + to_viewer * (0.01 - cosine));
    }
    let metallic = f32((bits.z >> 10u) & 63u) / 63.0;
    return Surface(
        frame.eye + along,
        0.0,
        n,
        metallic,
        n,
        f32(bits.z & 1023u) / 1023.0,
        unpack_color(bits.y),
        1.0,
        unpack_radiance(bits.w),
        1.0,
        bits.z >> 16u,
        length(along),
    );
}

struct Illumination {
    direction: vec3f,
    irradiance: vec3f,
}

// Twin of niwaki_raster::SpotLight::illuminate.
fn illuminate(light: SpotLight, point: vec3f) -> Illumination {
    let offset = light.position - point;
    let squared = dot(offset, offset);
    if !(squared > 0.0) || squared >= light.range * light.range {
        return Illumination(vec3f(0.0, 1.0, 0.0), vec3f(0.0));
    }
    let direction = offset * inverseSqrt(squared);
    let cosine = -dot(direction, light.direction);
    let span = max(light.cos_inner - light.cos_outer, 1e-4);
    let t = clamp((cosine - light.cos_outer) / span, 0.0, 1.0);
    let q = squared / (light.range * light.range);
    let window = 1.0 - q * q;
    return Illumination(direction, light.intensity * (t * t * window * window / squared));
}

fn viewer_of(s: Surface) -> vec3f {
    return normalize(frame.eye - s.point);
}

// What a surface sends to the viewer without any light of the scene.
fn base_radiance(s: Surface) -> vec3f {
    let m = point_material_at(s, 0.0);
    let cosine = clamp(dot(s.normal, viewer_of(s)), 0.0, 1.0);
    let around = mix(frame.ambient_down, frame.ambient_up, 0.5 + 0.5 * s.normal.y);
    return s.emission + around * ambient_weight(m, cosine);
}

// What it sends of a light.
fn lit_radiance(s: Surface, lit: Illumination) -> vec3f {
    if all(lit.irradiance <= vec3f(0.0)) {
        return vec3f(0.0);
    }
    let m = point_material_at(s, 0.0);
    return direct_weight(m, s.normal, viewer_of(s), lit.direction) * lit.irradiance;
}

// Light from outside that arrives from a direction.
fn environment(direction: vec3f) -> vec3f {
    let y = normalize(direction).y;
    let rest = 1.0 - abs(y);
    let t = 1.0 - rest * rest;
    return mix(frame.horizon, select(frame.ground, frame.zenith, y >= 0.0), t);
}

// What a display is sent: exposed, cut at 1 and encoded as sRGB.
fn display(radiance: vec3f) -> vec4f {
    let c = clamp(radiance * frame.exposure, vec3f(0.0), vec3f(1.0));
    let high = 1.055 * pow(c, vec3f(1.0 / 2.4)) - 0.055;
    return vec4f(select(high, c * 12.92, c <= vec3f(0.0031308)), 1.0);
}

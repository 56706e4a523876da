//!import hybrid/tracing
// Which lights a point sees: rays within the near region, shadow maps beyond it.

struct Light {
    position: vec3f,
    // LIGHT_*.
    kind: u32,
    // Where its light travels.
    direction: vec3f,
    // Its first shadow map.
    layer: u32,
    intensity: vec3f,
    cos_inner: f32,
    cos_outer: f32,
    // Clip-space size of a pixel of its map at distance 1 (of a directional light: at all).
    pixel: f32,
    // 1, or 6 for those around it.
    maps: u32,
    pad: u32,
}

const LIGHT_POINT = 0u;
const LIGHT_DIRECTIONAL = 1u;
const LIGHT_SPOT = 2u;

// A shadow map: relative to `eye`, world to clip space.
struct ShadowView {
    matrix: mat4x4f,
    eye: vec3f,
    pad: f32,
}

@group(1) @binding(2) var<storage, read> lights: array<Light>;
@group(1) @binding(3) var<storage, read> shadow_views: array<ShadowView>;
@group(1) @binding(4) var shadow_maps: texture_depth_2d_array;

// Shadow rays are traced in the near region.
override TRACE_SHADOWS: bool = true;
// Shadow maps are looked up.
override MAP_SHADOWS: bool = true;
// The near region holds every triangle: what rays do not meet there is not there.
override HOLDS_ALL: bool = false;

// The map of a light that a direction away from it falls into.
fn cube_layer(d: vec3f) -> u32 {
    let a = abs(d);
    if a.x >= a.y && a.x >= a.z {
        return select(0u, 1u, d.x < 0.0);
    }
    if a.y >= a.z {
        return select(2u, 3u, d.y < 0.0);
    }
    return select(4u, 5u, d.z < 0.0);
}

// 1 if the light's map has nothing in front of a point, else 0. `slack` is how many pixels of the
// map the point may lie behind what the map shows, for points on surfaces; `normal` is theirs.
fn map_share(light: Light, point: vec3f, normal: vec3f, slack: f32) -> f32 {
    var layer = light.layer;
    let away = point - light.position;
    var span = light.pixel;
    if light.maps > 1u {
        layer += cube_layer(away);
        span *= largest(away);
    } else if light.kind != LIGHT_DIRECTIONAL {
        span *= abs(dot(away, light.direction));
    }
    let view = shadow_views[layer];
    // Off the surface by as much as a pixel covers of it.
    let lifted = point + normal * (span * slack);
    let clip = view.matrix * vec4f(lifted - view.eye, 1.0);
    if !(clip.w > 0.0) {
        return 1.0;
    }
    let p = clip.xyz / clip.w;
    if any(abs(p.xy) > vec2f(1.0)) || p.z > 1.0 || p.z < 0.0 {
        return 1.0;
    }
    let size = vec2f(textureDimensions(shadow_maps));
    let at = vec2u(clamp((p.xy * vec2f(0.5, -0.5) + 0.5) * size, vec2f(0.0), size - 1.0));
    let depth = textureLoad(shadow_maps, at, layer, 0);
    // Depth is 1 at the light and 0 far away.
    return select(0.0, 1.0, p.z >= depth);
}

struct Illumination {
    direction: vec3f,
    distance: f32,
    irradiance: vec3f,
}

// Twin of niwaki_scene::Light::illuminate; no irradiance where it has none.
fn illuminate(light: Light, point: vec3f) -> Illumination {
    if light.kind == LIGHT_DIRECTIONAL {
        return Illumination(-light.direction, INFINITE, light.intensity);
    }
    let offset = light.position - point;
    let distance = length(offset);
    if !(distance > 0.0) {
        return Illumination(vec3f(0.0, 1.0, 0.0), 0.0, vec3f(0.0));
    }
    let to_light = offset / distance;
    var irradiance = light.intensity / (distance * distance);
    if light.kind == LIGHT_SPOT {
        let cosine = -dot(to_light, light.direction);
        let range = max(light.cos_inner - light.cos_outer, 1e-4);
        let t = clamp((cosine - light.cos_outer) / range, 0.0, 1.0);
        irradiance *= t * t;
    }
    return Illumination(to_light, distance, irradiance);
}

// Where a ray enters and leaves the cube of this half size around the centre.
fn cube_span(o: vec3f, d: vec3f, half: f32) -> vec2f {
    return slab(frame.center - half, frame.center + half, o, inverse_direction(d));
}

fn in_cube(p: vec3f, half: f32) -> bool {
    return largest(p - frame.center) <= half;
}

var<private> shadow_rays: u32;

// The share of a light's radiance that arrives at a surface.
fn visibility(s: Surface, light: Light, lit: Illumination) -> f32 {
    if !TRACE_SHADOWS && !MAP_SHADOWS {
        return 1.0;
    }
    if TRACE_SHADOWS && (HOLDS_ALL || in_cube(s.point, frame.half_size)) {
        let origin = s.point + s.geometric * s.clearance;
        var to_light = lit.direction;
        var range = INFINITE;
        if light.kind != LIGHT_DIRECTIONAL {
            // Aim anew from the offset origin, and end short of the light, so that a light that
            // lies on a surface shines.
            let span = light.position - origin;
            range = length(span);
            if !(range > 0.0 && dot(span, to_light) > 0.0) {
                return 0.0;
            }
            to_light = span / range;
            range *= 1.0 - CLEARANCE;
        }
        shadow_rays++;
        var end = range;
        if !HOLDS_ALL {
            end = min(range, cube_span(origin, to_light, frame.traced).y);
        }
        let share = open_share(origin, to_light, 0.0, end);
        if !MAP_SHADOWS || share <= 0.0 || end >= range {
            return share;
        }
        // What lies beyond the region the map knows: the exit is not on a surface.
        return share * map_share(light, origin + to_light * end, to_light, 0.0);
    }
    if MAP_SHADOWS {
        return map_share(light, s.point, s.geometric, 2.0);
    }
    return 1.0;
}

// The kernels of a frame of niwaki-gpu-tracer (Ganestam and Doggett 2012): the nearest hit of each pixel, then its
// shading by Phong's model with shadow rays, and ambient occlusion within a radius. Modules that
// import this define `traverse`, as for drive.wgsl. By itself, this file is no module.
// Twin: `reference.rs` of niwaki-gpu-tracer, line by line.
//!import tracing
//!import clearance
//!import normals
//!import random

struct Frame {
    position: vec3f,
    width: u32,
    /// From the camera to the image's top left corner, in units of the focal length.
    corner: vec3f,
    height: u32,
    /// From one pixel to the next in a row.
    step_x: vec3f,
    /// Directions of ambient occlusion a pixel; 0 for none.
    ao_rays: u32,
    /// From one row to the next.
    step_y: vec3f,
    ao_radius: f32,
    /// Mean radiance of the surroundings.
    ambient: vec3f,
    lights: u32,
    /// The directions of this dispatch: all, or where that takes too long, some.
    ao_first: u32,
    ao_end: u32,
    seed: u32,
    /// 1 if rays go to the lights.
    shadows: u32,
}

struct Material {
    diffuse: vec3f,
    /// Of Phong's lobe.
    exponent: f32,
    specular: vec3f,
    pad_0: u32,
    emission: vec3f,
    pad_1: u32,
}

struct Light {
    /// Where it stands, or unit direction to it.
    place: vec3f,
    /// 0 directional, 1 point, 2 spot.
    kind: u32,
    intensity: vec3f,
    /// Cosine of the outer angle, and one over the difference of both cosines.
    outer: f32,
    /// Where a spot's light travels.
    direction: vec3f,
    falloff: f32,
}

@group(0) @binding(16) var<storage, read> frame: Frame;
/// Three rows a triangle: a corner each, and its unit normal, packed.
@group(0) @binding(17) var<storage, read> shapes: array<vec4u>;
@group(0) @binding(18) var<storage, read> material_ids: array<u32>;
@group(0) @binding(19) var<storage, read> materials: array<Material>;
@group(0) @binding(20) var<storage, read> lights: array<Light>;
/// Linear radiance, and how many directions of ambient occlusion were open.
@group(0) @binding(21) var<storage, read_write> image: array<vec4f>;

const PI: f32 = 3.14159265;

fn pixel_of(id: vec3u, groups: vec3u) -> u32 {
    return id.y * groups.x * WORKGROUP + id.x;
}

fn direction_of(pixel: u32) -> vec3f {
    let x = f32(pixel % frame.width) + 0.5;
    let y = f32(pixel / frame.width) + 0.5;
    return normalize(frame.corner + frame.step_x * x + frame.step_y * y);
}

/// The nearest hit of each pixel, in `hits`.
@compute @workgroup_size(WORKGROUP)
fn primary(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = pixel_of(id, groups);
    if pixel >= scene.rays {
        return;
    }
    steps = 0u;
    let ray = ray_setup(scene, vec4f(frame.position, 0.0), vec4f(direction_of(pixel), F32_MAX));
    var hit = Hit(ray.t_max, 0.0, 0.0, NO_PRIM);
    if COUNT {
        counts = vec4u(0u);
    }
    if scene.nodes != 0u && ray.is_usable {
        hit = traverse(ray, hit, vec2u(FRESH, 0u));
    }
    if COUNT {
        work[pixel] = counts;
    }
    hits[pixel] = finished(ray, hit);
}

/// True if nothing is met between the origin and `reach`.
fn is_open(origin: vec3f, direction: vec3f, reach: f32) -> bool {
    let ray = ray_setup(scene, vec4f(origin, 0.0), vec4f(direction, reach));
    if scene.nodes == 0u || !ray.is_usable {
        return true;
    }
    let hit = traverse(ray, Hit(ray.t_max, 0.0, 0.0, NO_PRIM), vec2u(FRESH, 0u));
    return hit.prim_id == NO_PRIM;
}

/// The 24 high bits as a number in [0, 1).
fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * 0x1p-24;
}

/// The i-th of n directions about a normal with density cos θ / π: Hammersley's points, turned for each pixel
/// (Cranley and Patterson 1976).
fn ao_direction(normal: vec3f, i: u32, n: u32, turn: vec2f) -> vec3f {
    let u = fract((f32(i) + 0.5) / f32(n) + turn.x);
    let v = fract(unit(reverseBits(i)) + turn.y);
    let radius = sqrt(u);
    let angle = 2.0 * PI * v;
    let x = radius * cos(angle);
    let y = radius * sin(angle);
    let z = sqrt(1.0 - u);
    // A basis without branches (Duff et al. 2017).
    let sign = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = vec3f(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let bitangent = vec3f(b, sign + normal.y * normal.y * a, -normal.y);
    return normalize(tangent * x + bitangent * y + normal * z);
}

/// What a light adds: Lambert's and Phong's lobe (normalised, Lafortune and Willems 1994), if nothing stands between.
fn lit(light: Light, material: Material, origin: vec3f, point: vec3f, normal: vec3f, geometric: vec3f,
    reflected: vec3f) -> vec3f {
    var to_light = light.place;
    var distance = F32_MAX;
    var irradiance = light.intensity;
    if light.kind != 0u {
        let way = light.place - point;
        distance = length(way);
        if !(distance > 0.0) {
            return vec3f(0.0);
        }
        to_light = way / distance;
        irradiance /= distance * distance;
        if light.kind == 2u {
            let cosine = -dot(to_light, light.direction);
            let t = clamp((cosine - light.outer) * light.falloff, 0.0, 1.0);
            irradiance *= t * t;
        }
    }
    let cosine = dot(normal, to_light);
    if !(cosine > 0.0 && dot(geometric, to_light) > 0.0 && max_element(irradiance) > 0.0) {
        return vec3f(0.0);
    }
    if frame.shadows != 0u {
        var aim = to_light;
        var reach = F32_MAX;
        if light.kind != 0u {
            // Anew from where the ray starts, and short of the light: one on a surface shines.
            let way = light.place - origin;
            reach = length(way);
            aim = way / reach;
            reach *= 1.0 - CLEARANCE;
        }
        if !is_open(origin, aim, reach) {
            return vec3f(0.0);
        }
    }
    let gloss = pow(max(dot(reflected, to_light), 0.0), material.exponent);
    let lobe = material.diffuse * (1.0 / PI)
        + material.specular * ((material.exponent + 2.0) * (0.5 / PI) * gloss);
    return irradiance * cosine * lobe;
}

/// The radiance of each pixel, from its hit. The first dispatch of a frame, whose directions begin at 0, writes the
/// light of lights and of the material; the last, whose directions end with `ao_rays`, adds that of
/// the surroundings.
@compute @workgroup_size(WORKGROUP)
fn shade(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let pixel = pixel_of(id, groups);
    if pixel >= scene.rays {
        return;
    }
    steps = 0u;
    if COUNT {
        counts = vec4u(0u);
    }
    let row = hits[pixel];
    if row.w == NO_PRIM {
        image[pixel] = vec4f(frame.ambient, 0.0);
        if COUNT {
            work[pixel] = counts;
        }
        return;
    }
    let a = shapes[3u * row.w];
    let b = shapes[3u * row.w + 1u];
    let c = shapes[3u * row.w + 2u];
    let p = bitcast<vec3f>(a.xyz);
    let ab = bitcast<vec3f>(b.xyz) - p;
    let ac = bitcast<vec3f>(c.xyz) - p;
    let u = bitcast<f32>(row.y);
    let v = bitcast<f32>(row.z);
    let point = p + (ab * u + ac * v);
    let toward = direction_of(pixel);
    // Both on the side that is seen. A triangle that was hit has an area, if one that may vanish in f32.
    var geometric = cross(ab, ac);
    let area = length(geometric);
    geometric = select(-toward, geometric / area, area > 0.0);
    geometric = select(geometric, -geometric, dot(geometric, toward) > 0.0);
    var normal = unpack_normal(a.w) * (1.0 - u - v) + unpack_normal(b.w) * u + unpack_normal(c.w) * v;
    let size = length(normal);
    normal = select(geometric, normal / size, size > 1e-3);
    normal = select(normal, -normal, dot(normal, geometric) < 0.0);
    let reach = max(length(point - p), max(length(point - p - ab), length(point - p - ac)));
    let from_zero = abs(point) + abs(p);
    let clearance = CLEARANCE * reach + POINT_ERROR * (from_zero.x + from_zero.y + from_zero.z);
    let origin = point + geometric * clearance;
    let material = materials[material_ids[row.w]];

    var light = vec3f(0.0);
    var open = 0.0;
    if frame.ao_first == 0u {
        light = material.emission;
        let reflected = reflect(toward, normal);
        for (var i = 0u; i < frame.lights; i++) {
            light += lit(lights[i], material, origin, point, normal, geometric, reflected);
        }
    } else {
        let before = image[pixel];
        light = before.xyz;
        open = before.w;
    }
    let words = pcg4d(vec4u(pixel, frame.seed, 0u, 0u));
    let turn = vec2f(unit(words.x), unit(words.y));
    for (var i = frame.ao_first; i < frame.ao_end; i++) {
        let direction = ao_direction(normal, i, frame.ao_rays, turn);
        // What the shading normal shows but the surface itself hides is closed.
        if dot(direction, geometric) > 0.0 && is_open(origin, direction, frame.ao_radius) {
            open += 1.0;
        }
    }
    if frame.ao_end == frame.ao_rays {
        let share = select(open / f32(frame.ao_rays), 1.0, frame.ao_rays == 0u);
        light += frame.ambient * (material.diffuse + material.specular) * share;
    }
    image[pixel] = vec4f(light, open);
    if COUNT {
        work[pixel] = counts;
    }
}

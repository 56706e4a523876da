//!import frame/surfaces
// The shading model of niwaki_render::shading, function by function; its documentation has the
// equations.

const PI = 3.14159265358979;
const LEAST_GLOSS = 0.1;

// What is known of a point that a ray has met.
struct Surface {
    point: vec3f,
    // Rays that leave start this far from the point along the normal.
    clearance: f32,
    // Unit normals on the viewer's side.
    geometric: vec3f,
    metallic: f32,
    normal: vec3f,
    roughness: f32,
    base: vec3f,
    // 1 if seen from outside, else 0.
    front: f32,
    emission: vec3f,
    opacity: f32,
    material: u32,
    // Length of the ray that met it.
    distance: f32,
}

// A material at one point.
struct PointMaterial {
    base: vec3f,
    // Weights of the metal, the interface and the base under a coat.
    metal: f32,
    interface_: f32,
    coated: f32,
    roughness: f32,
    ior: f32,
    eta: f32,
    mean_fresnel: f32,
    // Mirror shares of metal and coat.
    mirror: f32,
    coat_mirror: f32,
}

// `limit` is the roughness up to which surfaces are mirrors.
fn point_material_at(s: Surface, limit: f32) -> PointMaterial {
    let m = materials[s.material];
    let rest = 1.0 - s.metallic;
    let mirror = clamp(2.0 - 2.0 * s.roughness / max(limit, 1.2e-38), 0.0, 1.0);
    return PointMaterial(
        s.base,
        s.metallic,
        rest * m.transmission,
        rest * (1.0 - m.transmission),
        s.roughness,
        m.ior,
        select(1.0 / m.ior, m.ior, s.front > 0.5),
        m.mean_fresnel,
        mirror * clamp(4.0 * s.metallic - 2.0, 0.0, 1.0),
        select(0.0, mirror, (m.flags & POLISHED) != 0u),
    );
}

// Twin of niwaki_render::fresnel::dielectric.
fn fresnel_dielectric(cosine_: f32, eta: f32) -> f32 {
    if eta == 1.0 {
        return 0.0;
    }
    let cosine = clamp(cosine_, 0.0, 1.0);
    let sine_squared = (1.0 - cosine * cosine) / (eta * eta);
    if sine_squared >= 1.0 {
        return 1.0;
    }
    let beyond = sqrt(1.0 - sine_squared);
    let parallel = (eta * cosine - beyond) / (eta * cosine + beyond);
    let perpendicular = (cosine - eta * beyond) / (cosine + eta * beyond);
    return clamp(0.5 * (parallel * parallel + perpendicular * perpendicular), 0.0, 1.0);
}

fn fresnel_conductor(cosine: f32, f0: vec3f) -> vec3f {
    let x = clamp(1.0 - cosine, 0.0, 1.0);
    let x2 = x * x;
    return f0 + (1.0 - f0) * (x2 * x2 * x);
}

// K_r: what a reflected ray's radiance counts.
fn reflected_weight(m: PointMaterial, cosine: f32) -> vec3f {
    let coat = m.coated * m.coat_mirror * fresnel_dielectric(cosine, m.ior);
    let inner = m.interface_ * fresnel_dielectric(cosine, m.eta);
    return fresnel_conductor(cosine, m.base) * (m.metal * m.mirror) + (coat + inner);
}

// K_t: what a refracted ray's radiance counts.
fn refracted_weight(m: PointMaterial, cosine: f32) -> vec3f {
    return m.base * (m.interface_ * (1.0 - fresnel_dielectric(cosine, m.eta)));
}

fn ggx_lambda(a2: f32, x: f32) -> f32 {
    return 0.5 * (sqrt(1.0 + a2 * max(1.0 - x * x, 0.0) / (x * x)) - 1.0);
}

fn ggx(alpha: f32, half: f32, viewer: f32, light: f32) -> f32 {
    let a2 = alpha * alpha;
    let t = half * half * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * t * t);
    return distribution / (1.0 + ggx_lambda(a2, viewer) + ggx_lambda(a2, light)) / (4.0 * viewer);
}

// f(l): what the irradiance of a light counts.
fn direct_weight(m: PointMaterial, normal: vec3f, to_viewer: vec3f, to_light: vec3f) -> vec3f {
    let cosine = dot(normal, to_viewer);
    let light_cosine = dot(normal, to_light);
    if !(cosine > 0.0 && light_cosine > 0.0) {
        return vec3f(0.0);
    }
    let passed = (1.0 - fresnel_dielectric(cosine, m.ior))
        * (1.0 - fresnel_dielectric(light_cosine, m.ior));
    var f = m.base * (m.coated * passed / max(1.0 - m.mean_fresnel, 1e-6) * light_cosine / PI);
    let metal = m.metal * (1.0 - m.mirror);
    let coat = m.coated * (1.0 - m.coat_mirror);
    if metal > 0.0 || (coat > 0.0 && m.ior > 1.0) {
        let sum = to_viewer + to_light;
        var half = normal;
        if dot(sum, sum) > 0.0 {
            half = normalize(sum);
        }
        let facing = clamp(dot(half, to_viewer), 0.0, 1.0);
        let gloss = max(m.roughness, LEAST_GLOSS);
        let lobe = ggx(gloss * gloss, dot(half, normal), cosine, light_cosine);
        let coated = coat * fresnel_dielectric(facing, m.ior);
        f += (fresnel_conductor(facing, m.base) * metal + coated) * lobe;
    }
    return f;
}

// What ambient radiance counts.
fn ambient_weight(m: PointMaterial, cosine: f32) -> vec3f {
    let fresnel = fresnel_dielectric(cosine, m.ior);
    return m.base * (m.coated * (1.0 - fresnel))
        + fresnel_conductor(cosine, m.base) * (m.metal * (1.0 - m.mirror))
        + m.coated * (1.0 - m.coat_mirror) * fresnel;
}

// The direction beyond an interface by Snell's law; zero past the critical angle.
fn refract_direction(to_viewer: vec3f, normal: vec3f, eta: f32) -> vec3f {
    let cosine = dot(to_viewer, normal);
    let sine_squared = max(1.0 - cosine * cosine, 0.0) / (eta * eta);
    if sine_squared >= 1.0 {
        return vec3f(0.0);
    }
    let beyond = sqrt(1.0 - sine_squared);
    return normalize(-to_viewer / eta + (cosine / eta - beyond) * normal);
}

fn mirror_direction(to_viewer: vec3f, normal: vec3f) -> vec3f {
    return 2.0 * dot(to_viewer, normal) * normal - to_viewer;
}
